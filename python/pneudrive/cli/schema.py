"""``pneudrive schema``: the JSON schema of the drive file, for editors and other programs."""

from __future__ import annotations

import json

import typer


def schema() -> None:
    """Print the JSON schema of the drive file."""
    from pneudrive.describe.schema import drive_schema

    typer.echo(json.dumps(drive_schema(), indent=2, ensure_ascii=False))
