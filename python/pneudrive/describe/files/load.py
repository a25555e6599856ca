"""Reading of drives and circuits, distinguished by the content of the file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from pneudrive.arrays import Plain
from pneudrive.describe.circuit import TABLES, TUBES, Circuit
from pneudrive.describe.components import component_class
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import catalogue, toml
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.marks import table_schema
from pneudrive.errors import DescriptionError

#: Tables that only a circuit file has.
OF_A_CIRCUIT = ("components", "connections")


def load_described(source: str) -> Drive | Circuit:
    """Read a drive file, a circuit file or ``catalogue:NAME``; a file with components or connections is a circuit.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    if source.startswith(catalogue.PREFIX):
        return Drive.load(source)
    tables, text = toml.read(source)
    return _made(tables, text, Path(source)).read_from(source)


def described_in(text: str, path: Path, allow: Callable[[Plain], object]) -> Drive | Circuit:
    """Read a drive or a circuit from the text of its file. The file need not exist.

    Parameters
    ----------
    text : str
    path : Path
        Name of the file in messages. Paths of custom laws and formulas are relative to its folder.
    allow : callable
        Called with the tables before any other file is read. It may reject the tables with an error.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    tables = toml.parse(text, str(path))
    allow(tables)
    return _made(tables, text, path)


def _made(tables: Plain, text: str, path: Path) -> Drive | Circuit:
    if {"mass", "stroke"} <= tables.keys():
        raise DescriptionError(f"{path} describes a task, not a drive", remedy="`pneudrive size` finds drives for it.")
    kind = Circuit if any(key in tables for key in OF_A_CIRCUIT) else Drive
    return kind.from_tables(tables, text, path)


# --- JSON schemas of the drive file and of the circuit file.

_COPIES = {"type": "array", "items": {"type": "string"}, "minItems": 1}


def drive_schema() -> Plain:
    """Return the JSON schema (draft 2020-12) of a drive file.

    No table is required in a file with ``drive = "catalogue:NAME"``.
    """
    schema = Drive.model_json_schema(by_alias=True)
    required = schema.pop("required")
    schema["properties"]["drive"] = {
        "type": "string",
        "pattern": "^catalogue:.+$",
        "description": "Drive of the catalogue to start from; values of the file replace its values.",
    }
    model = {"enum": list(TUBES), "default": "steady", "description": "Model of the tube; alternative to kind"}
    for table, kind in (("tubing", "tube"), ("flow_control", "flow-control")):
        own = component_class(kind).model_json_schema(by_alias=True)["properties"]
        keys = {key: form for key, form in own.items() if key != "kind"}
        # In a flow control, a size without prefix is that of the needle.
        keys |= {key.removeprefix("needle_"): form for key, form in keys.items() if key.startswith("needle_")}
        one = table_schema(keys | ({"model": model} if kind == "tube" else {}))
        schema["properties"][table] = table_schema({"a": one, "b": one})
    tables = [table for name, table in schema["$defs"].items() if name not in ("Friction", "Origin")]
    _allow_origins([*tables, *schema["$defs"]["Friction"]["oneOf"]])
    whole = {"required": required, "properties": {"drive": False}}
    return schema | {"anyOf": [whole, {"required": ["drive"]}]}


def circuit_schema() -> Plain:
    """Return the JSON schema (draft 2020-12) of a circuit file."""
    schema = Circuit.model_json_schema(by_alias=True)
    del schema["required"]  # tables of a drive file can define the components
    definitions = schema["$defs"]
    del definitions["Component"]
    alternatives = []
    for kind, entry in component_kinds().items():
        made = component_class(kind)
        one = made.model_json_schema(by_alias=True)
        one["properties"] |= {old: one["properties"][key] | {"deprecated": True} for old, key in made.renamed.items()}
        definitions |= one.pop("$defs", {})
        if entry["formula"]:  # parameters of the formula are also keys
            one["properties"]["formula"] = {"anyOf": [{"type": "string", "pattern": "^file:.+$"}, {"type": "object"}]}
            one["additionalProperties"] = {"type": ["string", "number", "object"]}
        whole = _with_tables(one)
        _allow_origins([whole])
        alternatives.append(whole | {"properties": whole["properties"] | {"copies": _COPIES}})
    _allow_origins(definitions["Friction"]["oneOf"])
    use = {"type": "string", "pattern": "^catalogue:.+$", "description": "Part of the catalogue; other keys override"}
    alternatives.append({"type": "object", "properties": {"use": use, "copies": _COPIES}, "required": ["use"]})
    schema["properties"]["components"] = {
        "type": "object",
        "additionalProperties": {"oneOf": alternatives},
        "minProperties": 1,
    }
    for table in TABLES:
        schema["properties"][table] = {"type": "object", "description": f"Same as [{table}] of a drive file"}
    return schema


def _allow_origins(tables: Iterable[Plain]) -> None:
    """Extend the schemas of tables, so that each value except `kind` may have its origin."""
    said = {word: {"type": "string"} for word in ("source", "assumed", "note")}
    for table in tables:
        for key, form in table["properties"].items():
            if key != "kind":
                with_origin = table_schema({"value": form} | said, ["value"])
                table["properties"] = table["properties"] | {key: {"anyOf": [form, with_origin]}}


def _with_tables(component: Plain) -> Plain:
    """Extend the schema, so that keys such as ``end_stop_stiffness`` may also be in a table ``end_stop``."""
    properties, required = component["properties"], component.get("required", [])
    tables: Plain = {}
    heads = {key[:end] for key in properties for end, sign in enumerate(key) if sign == "_"}
    for head in sorted(heads):
        parted = [key for key in properties if key.startswith(f"{head}_")]
        if len(parted) > 1:
            tables[head] = table_schema({key.removeprefix(f"{head}_"): properties[key] for key in parted})
            required = [key for key in required if key not in parted]
    return component | {"properties": tables | properties, "required": required}
