"""The messages of errors in messages.toml: each is used, and the code gives a value for each of its places."""

import ast
from pathlib import Path
from string import Formatter

import pneudrive
from pneudrive.errors import messages

FOLDER = Path(pneudrive.__file__).parent


def test_each_message_has_its_values_and_a_use():
    known = {
        f"{path.parent.name}.{key}" for path in FOLDER.glob("*/messages.toml") for key in messages(path.parent.name)
    }
    nodes = (node for path in FOLDER.rglob("*.py") for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    used = set()
    for call in (node for node in nodes if isinstance(node, ast.Call)):
        for name in {getattr(argument, "value", None) for argument in call.args[:2]} & known:
            package, _, key = name.partition(".")
            fields = [
                field for text in messages(package)[key].values() for _, field, *_ in Formatter().parse(text) if field
            ]
            given = {keyword.arg for keyword in call.keywords}
            assert None in given or {field.partition(".")[0].partition("[")[0] for field in fields} <= given, name
            used.add(name)
    assert known == used
