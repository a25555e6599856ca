"""`pneudrive demo` and `pneudrive reproduce` from end to end."""

import subprocess
import sys
from pathlib import Path

from pneudrive.cli.main import run

ROOT = Path(__file__).resolve().parents[2]


def test_the_demo_prints_five_lines_and_where_the_report_lies(demonstration):
    assert demonstration.status == 0
    lines = demonstration.printed.splitlines()
    assert [line[:3] for line in lines[:5]] == ["1. ", "2. ", "3. ", "4. ", "5. "]
    assert "30 recordings, 6 seals" in lines[0]
    assert "14 of 21 sentences that can be checked hold, 6 hold in part, 1 does not hold" in lines[4]
    report = Path(lines[-1].removeprefix("Report: "))
    assert report == demonstration.folder / "report.html"
    page = report.read_text(encoding="utf-8")
    for key in ("measured", "pressure", "recovered", "paper", "stick-slip", "chambers", "provenance"):
        assert f'<section id="{key}">' in page
    for name in ("map.parquet", "map.csv", "fit.toml"):
        assert (demonstration.folder / name).stat().st_size > 500


def test_the_demo_elsewhere_says_where_to_run_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["demo"]) == 2
    assert "there are no recordings in data/measurements" in capsys.readouterr().err


def test_reproduce_says_of_each_sentence_whether_it_holds(tmp_path, capsys):
    assert run(["reproduce", "--out", str(tmp_path / "out"), "--seed", "7"]) == 0
    out = capsys.readouterr().out
    for number in range(1, 10):
        assert f"figure {number}" in out
    assert [out.count(f"  {verdict}: ") for verdict in ("holds", "holds in part", "does not hold")] == [14, 6, 1]
    assert (tmp_path / "out" / "figures" / "paper-8-pressure.svg").is_file()


def test_reproduce_into_a_place_that_cannot_be(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert run(["reproduce", "--out", str(tmp_path / "file")]) == 2
    assert "cannot be written to" in capsys.readouterr().err


def test_the_table_on_the_first_page_is_what_its_example_prints(tmp_path):
    command = [sys.executable, str(ROOT / "examples" / "friction_of_seals.py")]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True).stdout
    rows = printed.splitlines()
    assert len(rows) > 10
    missing = [row for row in rows if row not in (ROOT / "README.md").read_text(encoding="utf-8").splitlines()]
    assert missing == [], "README.md is out of date: copy what examples/friction_of_seals.py prints, renew its figure"
