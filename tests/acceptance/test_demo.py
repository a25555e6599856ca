"""`pneudrive demo` and `pneudrive reproduce` from end to end."""

from __future__ import annotations

from pathlib import Path

from pneudrive.cli.hand_over import AXIS, SHIPPED
from pneudrive.friction.characterisation import characterise_recordings
from pneudrive.report.recordings import closures


def test_the_demo_prints_five_lines_and_where_the_report_lies(demonstration):
    assert demonstration.status == 0
    lines = demonstration.printed.splitlines()
    assert [line[:3] for line in lines[1:8]] == ["1. ", "2. ", "3. ", "4. ", "5. ", "6. ", "7. "]
    assert "30 recordings" in lines[0]
    assert "NAPN: the law does not follow the values" in lines[1]  # line over pressure: docs/theory/fit.md
    assert "16 of 22 sentences that can be checked hold, 5 hold in part, 1 does not hold" in lines[7]
    report = Path(lines[-1].removeprefix("Report: "))
    assert report == demonstration.folder / "report.html"
    page = report.read_text(encoding="utf-8")
    for key in ("result", "measured", "recovered", "paper", "stick-slip", "chambers", "controlled-axis", "provenance"):
        assert f'<section id="{key}">' in page
    for name in ("map.parquet", "map.csv", "fit-PK.toml"):
        assert (demonstration.folder / name).stat().st_size > 500


def test_what_the_demo_has_elsewhere_can_be_characterised():
    files = sorted(SHIPPED.glob("friction/*"))
    found = characterise_recordings(files)
    assert [one.recording.name for one in found.results] == ["O-ring_1bar", "O-ring_5bar"]
    assert len(closures(found.closures).panels) == 1, "a line through two points has no residuals"
    assert (SHIPPED / "LICENSE").is_file()
    assert AXIS.is_file()


def test_reproduce_says_of_each_sentence_whether_it_holds(reproduced, demonstration):
    """Cycles that are there are not run again: the folder of the demonstration gives its verdicts."""
    assert reproduced.status == 0
    for number in range(1, 10):
        assert f"figure {number}" in reproduced.printed
    verdicts = ("holds", "holds in part", "does not hold")
    assert [reproduced.printed.count(f"  {verdict}: ") for verdict in verdicts] == [16, 5, 1]
    assert (demonstration.folder / "figures" / "paper-8-pressure.svg").is_file()
    cycles = sorted(path.relative_to(reproduced.folder) for path in reproduced.folder.glob("campaigns/*/cycles/*"))
    assert len(cycles) > 200
    for path in cycles:
        assert (reproduced.folder / path).read_bytes() == (demonstration.folder / path).read_bytes()


def test_reproduce_into_a_place_that_cannot_be(tmp_path, refusal):
    (tmp_path / "file").touch()
    refusal(["reproduce", "--out", tmp_path / "file"], "cannot be written to")
