"""The JSON schemas of the drive file and of the circuit file."""

from __future__ import annotations

from typing import Any

from pneudrive.describe.circuit import Circuit
from pneudrive.describe.components import component_class, component_kinds
from pneudrive.describe.drive import Drive


def drive_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a drive file.

    Where a file starts from a drive of the catalogue (``drive = "catalogue:NAME"``), no table is required.
    """
    schema = Drive.model_json_schema(by_alias=True)
    required = schema.pop("required")
    schema["properties"]["drive"] = {
        "type": "string",
        "pattern": "^catalogue:.+$",
        "description": "Drive of the catalogue to start from; what the file gives replaces its values.",
    }
    whole = {"required": required, "properties": {"drive": False}}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "anyOf": [whole, {"required": ["drive"]}],
    }


def circuit_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a circuit file."""
    schema = Circuit.model_json_schema(by_alias=True)
    definitions = schema.setdefault("$defs", {})
    definitions.pop("Component", None)
    alternatives = []
    for kind in component_kinds():
        one = component_class(kind).model_json_schema(by_alias=True)
        definitions |= one.pop("$defs", {})
        one["properties"]["copies"] = {"type": "array", "items": {"type": "string"}, "minItems": 1}
        alternatives.append(_with_tables(one))
    schema["properties"]["components"] = {
        "type": "object",
        "additionalProperties": {"oneOf": alternatives},
        "minProperties": 1,
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _with_tables(component: dict[str, Any]) -> dict[str, Any]:
    """Let ``end_stop_stiffness`` and its like stand in a table ``end_stop``, too."""
    properties, required = dict(component["properties"]), component.get("required", [])
    parted: dict[tuple[str, ...], str] = {}  # keys that a table may hold -> its name, the longest one
    for key in component["properties"]:
        for end, sign in enumerate(key):
            same = tuple(other for other in component["properties"] if other.startswith(key[: end + 1]))
            if sign == "_" and len(same) > 1:
                parted[same] = key[:end]
    for keys, head in parted.items():
        inner = {key.removeprefix(f"{head}_"): properties[key] for key in keys}
        properties[head] = {"type": "object", "properties": inner, "additionalProperties": False}
        required = [key for key in required if key not in keys]
    return component | {"properties": properties, "required": required}
