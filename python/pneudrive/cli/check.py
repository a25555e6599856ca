"""``pneudrive check``: whether a description is right, and what was assumed and what is sourced in it."""

from __future__ import annotations

from typing import Annotated

import typer

from pneudrive.cli.options import CatalogueFolders


def check(
    drive: Annotated[
        str, typer.Argument(help="Drive or circuit file (TOML), or catalogue:NAME.", metavar="DRIVE|CIRCUIT")
    ],
    catalogue: CatalogueFolders = None,
) -> None:
    """Check a drive or a circuit, and list what was assumed and what has a source."""
    from pneudrive.cli.described import circuit_of, load

    described = load(drive)
    circuit = circuit_of(described)
    kinds = [f"{name} ({one.kind})" for name, one in circuit.components.items()]
    typer.echo(f"{described.name}: {len(kinds)} components, nothing wrong\n  {', '.join(kinds)}")
    for title, lines in (
        ("To note", described.notes),
        ("Values with a source", described.sources()),
        ("Assumed", described.assumed()),
    ):
        if lines:
            typer.echo("\n".join(["", title, *(f"  {line}" for line in lines)]))
