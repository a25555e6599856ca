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
from page.conftest import ROOT
from pneudrive.cli.main import run

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
