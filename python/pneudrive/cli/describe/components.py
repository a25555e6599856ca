"""``pneudrive components``: list the components of circuits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from collections.abc import Mapping


def components(
    kind: Annotated[str | None, typer.Argument()] = None,
) -> None:
    """List the components of circuits, or the parameters of one kind.

    Options
    -------
    kind : KIND
        Kind to show.
    """
    from pneudrive.describe.kinds import component_kinds
    from pneudrive.errors import CommandError, nearest

    kinds = component_kinds()
    if kind is None:
        typer.echo(aligned((name, entry["title"], f"ports {_ports(entry)}") for name, entry in kinds.items()))
        typer.echo("\npneudrive components KIND shows the parameters of one.")
        return
    if kind not in kinds:
        raise CommandError(f'there is no component "{kind}"', remedy=nearest(kind, kinds))
    _show(kinds[kind])


def _show(entry: Mapping[str, Any]) -> None:
    from pneudrive.describe.components import rows

    typer.echo(f"{entry['kind']}: {entry['title']}\n\n{entry['doc']}")
    for title, lines in (
        ("Ports", [(port["name"], port["kind"], _flags(port)) for port in entry["ports"]]),
        ("Keys", rows(entry)),
        ("Names of its formula", [(name["name"], name["unit"], name["meaning"]) for name in _names(entry)]),
        ("Inputs of a session", [(one["name"], one["unit"], one["meaning"]) for one in entry["inputs"]]),
        ("Columns", [(one["name"], one["meaning"]) for one in entry["outputs"]]),
    ):
        if lines:
            typer.echo(f"\n{title}\n{aligned(lines)}")
    if entry["sources"]:
        from pneudrive.references import bibtex

        for key in entry["sources"]:
            typer.echo(f"\n{bibtex(key)}")


def _ports(entry: Mapping[str, Any]) -> str:
    return ", ".join(port["name"] for port in entry["ports"])


def _names(entry: Mapping[str, Any]) -> list[dict[str, str]]:
    return entry["formula"]["names"] if entry["formula"] else []


def _flags(port: Mapping[str, Any]) -> str:
    if port["exhaust"]:
        return "open to the ambient air if not joined"
    return "may stay unconnected" if port["optional"] else ""
