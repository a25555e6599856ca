"""Messages of errors in messages.toml: each exists and is used, and the code gives a value for each of its places."""

import ast
from pathlib import Path
from string import Formatter

import pneudrive
from pneudrive.errors import messages

FOLDER = Path(pneudrive.__file__).parent


def _named(call):
    """Return the literal name of a message in the call of `invalid`, or of `of` of an error."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    is_error = name == "of" and ast.unparse(call.func).endswith("Error.of")
    place = call.args[1:2] if name == "invalid" else call.args[:1] if is_error else []
    return {argument.value for argument in place if isinstance(argument, ast.Constant)}


def test_each_message_has_its_values_and_a_use():
    known = {
        f"{path.parent.name}.{key}" for path in FOLDER.glob("*/messages.toml") for key in messages(path.parent.name)
    }
    nodes = (node for path in FOLDER.rglob("*.py") for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    used = set()
    for call in (node for node in nodes if isinstance(node, ast.Call)):
        assert _named(call) <= known, f"{_named(call)} is not in messages.toml"
        for name in {getattr(argument, "value", None) for argument in call.args[:3]} & known:
            package, _, key = name.partition(".")
            fields = [
                field for text in messages(package)[key].values() for _, field, *_ in Formatter().parse(text) if field
            ]
            given = {keyword.arg for keyword in call.keywords}
            assert None in given or {field.partition(".")[0].partition("[")[0] for field in fields} <= given, name
            used.add(name)
    assert known == used
