"""The tutorials are true: their files are written, their commands run in order and print the text of the page."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import shutil
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive import batching
from pneudrive.cli.hand_over import AXIS, SHIPPED
from pneudrive.cli.main import run
from pneudrive.errors import CampaignError
from pneudrive.friction.characterisation import characterise_recordings
from pneudrive.report.recordings import closures

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BLOCK = re.compile(r"^```(toml|console|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
#: Tutorial -> smallest number of its commands.
TUTORIALS = {"first-hour": 13, "first-controlled-axis": 6, "first-sizing": 5, "controlled-tripod": 7}


def commands(block):
    """Each command of a block with the output that the page shows."""
    for entry in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        line, _, wanted = entry.partition("\n")
        yield line, wanted


def shell(line):
    words = shlex.split(line)
    if words[0] == "cp":
        for path in ROOT.glob(words[1]):
            shutil.copy(path, words[2])
        return "", ""
    out, aside = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(aside):
        assert words[0] == "pneudrive"
        assert run(words[1:]) == 0, f"{line}\n{aside.getvalue()}"
    return out.getvalue(), aside.getvalue()


@pytest.mark.parametrize("folder", ["guide", "tutorials"])
def test_the_index_lists_every_page_once(folder):
    listed = re.findall(r"^[a-z][a-z-]*$", (DOCS / folder / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(path.stem for path in (DOCS / folder).glob("*.md") if path.stem != "index")


def test_the_names_of_the_guide_show_the_output_of_the_page():
    text = (DOCS / "guide/describe.md").read_text(encoding="utf-8")
    test = doctest.DocTestParser().get_doctest(text, {"pn": pn}, "describe", None, 0)
    assert len(test.examples) == 4
    wrong = io.StringIO()
    assert doctest.DocTestRunner(optionflags=FLAGS).run(test, out=wrong.write).failed == 0, wrong.getvalue()


@pytest.mark.parametrize("tutorial", TUTORIALS)
def test_every_command_prints_the_text_of_the_page(tutorial, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = DOCS / "tutorials" / f"{tutorial}.md"
    names, seen = {}, 0
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "toml":
            Path(text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
        elif kind == "python":
            test = doctest.DocTestParser().get_doctest(text, names, "page", str(page), 0)
            wrong = io.StringIO()
            runner = doctest.DocTestRunner(optionflags=FLAGS)
            assert runner.run(test, out=wrong.write, clear_globs=False).failed == 0, wrong.getvalue()
            names = test.globs
        else:
            for line, wanted in commands(text):
                got = shell(line)
                seen += 1
                printed = [doctest.OutputChecker().check_output(wanted, output, FLAGS) for output in got]
                assert any(printed), "\n".join((line, *got))
    assert seen >= TUTORIALS[tutorial]


# --- `pneudrive demo` and `pneudrive reproduce` from end to end.


def test_the_demo_prints_five_lines_and_where_the_report_lies(demonstration):
    assert demonstration.status == 0
    lines = demonstration.printed.splitlines()
    assert [line[:3] for line in lines[1:7]] == ["1. ", "2. ", "3. ", "4. ", "5. ", "6. "]
    assert "30 recordings" in lines[0]
    assert "16 of 22 sentences that can be checked hold, 5 hold in part, 1 does not hold" in lines[6]
    report = Path(lines[-1].removeprefix("Report: "))
    assert report == demonstration.folder / "report.html"
    page = report.read_text(encoding="utf-8")
    for key in ("result", "measured", "recovered", "paper", "stick-slip", "chambers", "controlled-axis", "provenance"):
        assert f'<section id="{key}">' in page
    for name in ("map.parquet", "map.csv", "fit-PK.toml"):
        assert (demonstration.folder / name).stat().st_size > 500


def test_a_folder_without_recordings_is_told(tmp_path, capsys):
    assert run(["demo", "--out", str(tmp_path / "out"), "--measurements", str(tmp_path)]) == 2
    assert f"there are no recordings in {tmp_path}" in capsys.readouterr().err


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
    assert (reproduced.folder / "figures" / "paper-8-pressure.svg").is_file()
    cycles = sorted(path.relative_to(reproduced.folder) for path in reproduced.folder.glob("campaigns/*/cycles/*"))
    assert len(cycles) > 200
    for path in cycles:
        assert (reproduced.folder / path).read_bytes() == (demonstration.folder / path).read_bytes()


def test_the_seed_is_that_of_the_rigs(tmp_path, monkeypatch):
    seeds = []

    def stop(work, jobs):
        seeds.extend(job[-1] for job in jobs)
        raise CampaignError("stopped")

    monkeypatch.setattr(batching, "in_processes", stop)
    assert run(["reproduce", "--out", str(tmp_path / "out"), "--seed", "7"]) == 2
    assert seeds == [7, 7, 7, 7]


def test_reproduce_into_a_place_that_cannot_be(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert run(["reproduce", "--out", str(tmp_path / "file")]) == 2
    assert "cannot be written to" in capsys.readouterr().err
