"""``pneudrive check``: check a description, and list its assumptions and sources."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from pneudrive.cli.options import CatalogueFolders, Described

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


def check(
    drive: Described,
    catalogue: CatalogueFolders = None,
) -> None:
    """Check a drive or a circuit, and list the sources of its values."""
    from pneudrive.describe.files.load import load_described

    described = load_described(drive)
    circuit = described.circuit
    kinds = [f"{name} ({one.kind})" for name, one in circuit.components.items()]
    typer.echo(f"{described.name}: {len(kinds)} components, no errors\n  {', '.join(kinds)}")
    for title, lines in (
        ("To note", described.notes),
        ("Values with a source", described.sources()),
        ("Assumed", list(_together(described.assumptions()))),
    ):
        if lines:
            typer.echo("\n".join(["", title, *(f"  {line}" for line in lines)]))


def _together(assumptions: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield the assumptions. Equal assumptions of several components or joints appear once."""
    names: dict[str, list[str]] = {}
    for line, name in assumptions:
        names.setdefault(line, []).append(name)
    for line, of in names.items():
        each = ", ".join(of)
        if len(of) > 1 and line.startswith("{}."):
            yield f"{each}: {line[3:].format()}"
        else:
            yield (line.replace("the joint of", "each joint of") if len(of) > 1 else line).format(each)
