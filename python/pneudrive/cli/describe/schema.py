"""``pneudrive schema``: JSON schemas of files that users write, for editors and other programs."""

from __future__ import annotations

import json
from enum import Enum
from typing import Annotated

import typer


class SchemaKind(str, Enum):
    """Files with a schema."""

    drive = "drive"
    circuit = "circuit"
    protocol = "protocol"
    task = "task"


def schema(
    kind: Annotated[SchemaKind, typer.Argument()] = SchemaKind.drive,
) -> None:
    """Print the JSON schema of drive files, circuit files, protocols, or tasks.

    Options
    -------
    kind
        Kind of file: drive, circuit, protocol of a campaign, or task of a sizing.
    """
    if kind is SchemaKind.drive:
        from pneudrive.describe.files.schema import drive_schema as described
    elif kind is SchemaKind.circuit:
        from pneudrive.describe.files.schema import circuit_schema as described
    elif kind is SchemaKind.task:
        from pneudrive.sizing.task import task_schema as described
    else:
        from pneudrive.campaign.planning.protocol import protocol_schema as described

    typer.echo(json.dumps(described(), indent=2, ensure_ascii=False))
