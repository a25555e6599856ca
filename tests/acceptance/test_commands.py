"""Commands that the documentation and the help show exist with their options; each help fits one screen."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from pneudrive.cli.commands import command_paths
from pneudrive.cli.main import COMMANDS, HIDDEN, app, run

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^(?: {4,}|\$ )(pneudrive (?:.*\\\n)*.*)$", re.MULTILINE)
INLINE = re.compile(r"`(pneudrive [^`\n]+)`")
LINES = 40


def resolve(words):
    """Return the command of the words, its context's parent, and its arguments."""
    command, context = typer.main.get_command(app), None
    name = "pneudrive"
    while hasattr(command, "table") and words:
        context = command.make_context(name, [], parent=context, resilient_parsing=True)
        name, command, words = command.resolve_command(context, words)
    return command, context, words


def unknown_options(words):
    command, _, words = resolve(words)
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    return [word for word in words if word.startswith("--") and word.partition("=")[0] not in {*known, "--help"}]


def shown(pattern):
    for page in PAGES:
        for text in pattern.findall(page.read_text("utf-8")):
            yield page.relative_to(ROOT).as_posix(), text.replace("\\\n", " ")


def test_commands_in_blocks_parse():
    seen = 0
    for page, line in shown(BLOCK):
        words = shlex.split(line.partition("   #")[0])[1:]
        if "&&" in words or any(word.startswith("[") or word == "..." for word in words):
            continue
        if words[0].startswith("-"):
            continue
        command, context, words = resolve(words)
        places = [word for word in words if word != "..."]
        try:
            command.make_context("command", places, parent=context)
        except Exception as error:
            pytest.fail(f"{page}: {line}: {error}")
        seen += 1
    assert seen > 60


def test_inline_commands_have_known_options():
    seen = 0
    for page, line in shown(INLINE):
        words = shlex.split(line)[1:]
        if words[0].startswith(("-", ".")):
            continue
        assert unknown_options([word for word in words if word != "..."]) == [], (page, line)
        seen += 1
    assert seen > 40


@pytest.mark.parametrize("path", list(command_paths(COMMANDS, HIDDEN)), ids=" ".join)
def test_help_fits_one_screen_and_ends_with_examples(path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert run([*path, "--help"]) == 0
    text = capsys.readouterr().out.rstrip()
    assert len(text.splitlines()) <= LINES
    assert max(map(len, text.splitlines())) <= 80
    command = resolve(list(path))[0]
    lines = (command.epilog or "").splitlines()[2:]
    assert lines or hasattr(command, "table")
    assert text.endswith("\n".join(("", *(f"  {line}" for line in lines))))
    for line in "\n".join(lines).replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words[0] == "pneudrive":
            assert unknown_options(words[1:]) == []
