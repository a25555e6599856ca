"""Write what type checkers and editors know of the tables of a description: ``python tools/stubs.py [--check]``.

A field is stored in SI under a name with its unit (``bore_m``). Users write the key of the file (``bore``), as an
argument and as an attribute, and Python adds it as the class is made. A type checker reads source text only, so these
modules have a stub. It is stubgen's, with an attribute for each key and a constructor that takes the keys.
"""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from pneudrive.describe.base import Described, _by_key, mark_of
from pneudrive.describe.marks import EachChamber, Quantity, StatedPressure
from pneudrive.describe.tables.friction import Friction, friction_laws

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic.fields import FieldInfo

BIN = Path(sys.executable).parent
PACKAGE = Path(__file__).parents[1] / "python"
MODULES = (
    "pneudrive.describe.tables.parts",
    "pneudrive.describe.tables.dependences",
    "pneudrive.describe.tables.friction",
    "pneudrive.describe.components",
    "pneudrive.describe.circuit",
    "pneudrive.describe.drive",
)
HEAD = """# Written by tools/stubs.py from {module}: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
"""


def stub(module: str) -> str:
    """Return the stub of a module."""
    source = PACKAGE / f"{module.replace('.', '/')}.py"
    with tempfile.TemporaryDirectory() as folder:
        words = ["--parse-only", "--quiet", "--include-private", "-o", folder, str(source)]
        subprocess.run([BIN / "stubgen", *words], check=True, cwd=PACKAGE.parent)
        text = next(Path(folder).rglob("*.pyi")).read_text("utf-8")
    tree = _Plain().visit(ast.parse(text))
    home, inner = importlib.import_module(module), set()
    for node in tree.body:
        about = getattr(home, node.name) if isinstance(node, ast.ClassDef) else None
        if isinstance(about, type) and issubclass(about, Described):
            assert isinstance(node, ast.ClassDef)
            node.body = [*_fields(about, node.body), *ast.parse("\n".join(_keys(about))).body]
            inner |= {kind for field in about.model_fields.values() for kind in _parts(field)[0]}
    foreign = {
        kind.__name__: kind.__module__ for kind in inner if isinstance(kind, type) and issubclass(kind, Described)
    }
    more = "".join(f"from {of} import {name}\n" for name, of in sorted(foreign.items()) if not hasattr(home, name))
    words = [str(BIN / "ruff"), "format", "--stdin-filename", f"{source}i", "-"]
    return subprocess.run(
        words, input=HEAD.format(module=module) + more + ast.unparse(tree), capture_output=True, text=True, check=True
    ).stdout


class _Plain(ast.NodeTransformer):
    """Replace ``Annotated[float, None]``, which stubgen writes for an annotation with a call, by ``float``."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        is_annotated = isinstance(node.value, ast.Name) and node.value.id == "Annotated"
        return node.slice.elts[0] if is_annotated and isinstance(node.slice, ast.Tuple) else node


def _fields(table: type[Described], body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a class but pydantic's validators.

    A table that may be absent has the type ``Table | Any``, as in typeshed: a user who has set it need not check.
    """
    for one in body:
        if isinstance(one, ast.FunctionDef) and one.name.startswith("_") and not one.name.startswith("__"):
            continue
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name) and one.target.id in table.model_fields:
            field = table.model_fields[one.target.id]
            if not field.is_required():  # a table derived from this one, in another module, may leave the key out
                one.value = ast.Constant(...)
            kinds, optional = _parts(field)
            if optional and isinstance(kinds[0], type) and issubclass(kinds[0], Described):
                one.annotation = ast.parse(f"{kinds[0].__name__} | _Any", mode="eval").body
        yield one


def _keys(table: type[Described]) -> Iterator[str]:
    """Yield the attributes by key, and the constructor that takes the keys."""
    arguments = []
    for name, field in table.model_fields.items():
        key = field.alias or name
        attribute = vars(table).get(key)
        if key != name and isinstance(attribute, property) and attribute.fget.__qualname__.startswith(_by_key.__name__):
            yield f"@property\ndef {key}(self) -> {_read(field)}: ..."
        if not (table is Friction and key in {"formula", "values", "given"}):
            arguments.append(
                f"{key}: {_taken(field)}{'' if field.is_required() and table is not Friction else ' = ...'}"
            )
    if table is Friction:
        keys = {p["key"] for law in friction_laws().values() for p in law["parameters"]}
        for key in sorted(keys):
            yield f"@property\ndef {key}(self) -> _UnitFloat: ..."
            arguments.append(f"{key}: _Given = ...")
    open_keys = ", **keys: _Any" if table.__name__ in {"Component", "Friction", "Circuit"} else ""
    if table.__name__ == "Component":
        yield "def __getattr__(self, name: str) -> _Any: ..."
    if arguments:
        yield f"def __init__(self, *, {', '.join(arguments)}{open_keys}) -> None: ..."


def _parts(field: FieldInfo) -> tuple[list[Any], str]:
    """Return the types of a field without None, and what makes it optional in a stub."""
    kinds = list(get_args(field.annotation) or (field.annotation,))
    if get_origin(field.annotation) in {Literal, dict, tuple, frozenset}:
        kinds = [field.annotation]
    rest = [kind for kind in kinds if kind is not type(None)]
    return rest, " | None" if len(rest) < len(kinds) else ""


def _read(field: FieldInfo) -> str:
    """Return the type of the attribute of a key."""
    mark, (kinds, optional) = mark_of(field), _parts(field)
    if isinstance(mark, EachChamber):
        return "_PerChamber"
    if isinstance(mark, StatedPressure):
        return f"_Pressure{optional}"
    if isinstance(mark, Quantity):
        is_tuple = any(kind is tuple or get_origin(kind) is tuple for kind in kinds)
        return ("tuple[_UnitFloat, ...]" if is_tuple else "_UnitFloat" if mark.si_unit else "float") + optional
    return "_Any"


def _taken(field: FieldInfo) -> str:
    """Return the type of the argument of a key: whatever a file may have there."""
    mark, (kinds, optional) = mark_of(field), _parts(field)
    if isinstance(mark, StatedPressure):
        return f"_Given | _Pressure{optional}"
    if mark is not None:
        return f"_Given{'' if type(mark) is Quantity and float in kinds else ' | _Sequence[_Any]'}{optional}"
    words = []
    for kind in kinds:
        if isinstance(kind, type) and issubclass(kind, Described):
            words.append(f"{kind.__name__} | _Mapping[str, _Any]")
        elif get_origin(kind) is Literal:
            words.append(f"_Literal[{', '.join(map(repr, get_args(kind)))}]")
        elif get_origin(kind) in {dict, tuple}:
            words.append("_Mapping[str, _Any]" if get_origin(kind) is dict else "_Sequence[_Any]")
        else:
            words.append(kind.__name__ if kind in {str, int, float, bool} else "_Any")
    return " | ".join(words) + optional


def main() -> None:
    """Write the stubs, or name those that differ from the classes."""
    wrong = []
    for module in MODULES:
        path, text = PACKAGE / f"{module.replace('.', '/')}.pyi", stub(module)
        if "--check" not in sys.argv:
            path.write_text(text, encoding="utf-8")
        elif not path.is_file() or path.read_text("utf-8") != text:
            wrong.append(f"{path.name} is not what the classes of {module} say: python tools/stubs.py")
    sys.exit("\n".join(wrong) or None)


if __name__ == "__main__":
    main()
