"""The JSON schema of the drive file."""

from __future__ import annotations

from typing import Any

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
