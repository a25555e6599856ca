"""The messages of errors in messages.toml: each is used, and the code gives a value for each of its places."""

from __future__ import annotations

import ast
from pathlib import Path
from string import Formatter

import pneudrive
from pneudrive.errors import messages

FOLDER = Path(pneudrive.__file__).parent


def _uses() -> list[tuple[str, set[str]]]:
    """Return the name of each message that the code uses, and the names of its values."""
    found = []
    for path in FOLDER.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text if any(word in text for word in (".of(", "invalid(", "fault(")) else "")):
            if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in ("of", "invalid", "fault"):
                names = [a.value for a in node.args[:2] if isinstance(a, ast.Constant) and "." in str(a.value)]
                package = names[-1].partition(".")[0] if names else ""
                if package and (FOLDER / package / "messages.toml").is_file():
                    found.append((names[-1], {str(keyword.arg) for keyword in node.keywords}))
    return found


def test_each_message_has_its_values_and_a_use():
    uses = _uses()
    for name, given in uses:
        if "None" in given:  # **values
            continue
        package, _, key = name.partition(".")
        texts = messages(package)[key]
        places = {
            field.partition(".")[0].partition("[")[0]
            for t in texts.values()
            for _, field, *_ in Formatter().parse(t)
            if field
        }
        assert places <= given, f"{name}: no value for {places - given}"
        assert given <= places | {"where", "value", "rule", "remedy"}, f"{name}: {given - places} not shown"
    known = {
        f"{path.parent.name}.{key}" for path in FOLDER.glob("*/messages.toml") for key in messages(path.parent.name)
    }
    assert known == {name for name, _ in uses}
