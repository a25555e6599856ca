"""``pneudrive catalogue``: parts and drives, each value with its source."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.options import CatalogueFolders
from pneudrive.cli.output import check_outputs, write_text
from pneudrive.errors import CommandError
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from pneudrive.describe.files.catalogue import Entry


def catalogue(
    name: Annotated[str | None, typer.Argument()] = None,
    catalogue: CatalogueFolders = None,
    out: Path | None = None,
    kind: str | None = None,
    bore: str | None = None,
    stroke: str | None = None,
    flow: str | None = None,
) -> None:
    """List parts and drives, or the values and sources of one of them.

    Options
    -------
    name : NAME
        Part or drive to show.
    out
        Write the drive NAME as a drive file: .toml.
    kind : KIND
        Parts of a kind: "valve", "cylinder/rodless", "*5/3".
    bore : LENGTHS
        Parts of a bore: "25 mm", "20 mm .. 40 mm".
    stroke : LENGTHS
        Parts with this stroke, also those made to order.
    flow : FLOWS
        Flow of the parts: "1 dm3/(s bar) .. 3 dm3/(s bar)", "500 l/min ANR .. 800 l/min ANR".
    """
    from pneudrive.describe.files.catalogue import entries, entry

    search = {"kind": kind, "bore": bore, "stroke": stroke, "flow": flow}
    if any(search.values()):
        _search(name, search)
    elif out is not None:
        _write(name, out)
    elif name is None:
        _list(list(entries().values()))
    else:
        _show(entry(name))


def _write(name: str | None, out: Path) -> None:
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.files.catalogue import PREFIX, entries

    if name is None or (name in entries() and not entries()[name].is_drive):
        drives = ", ".join(entry.name for entry in entries().values() if entry.is_drive)
        what = f"{name} is a part, not a drive" if name else "--out needs the name of a drive"
        raise CommandError(what, remedy=f"Drives: {drives}.")
    check_outputs(out, (".toml",))
    write_text(Drive.load(f"{PREFIX}{name}").to_toml(), out)


def _search(name: str | None, search: dict[str, str | None]) -> None:
    from pneudrive.describe.files.catalogue import find_parts

    if name is not None:
        raise CommandError(f"{name} cannot be combined with a search", remedy="Give a name or a search option.")
    found = find_parts(**search)
    if found:
        _list(found)
    else:
        typer.echo("No part fits.")


def _list(found: list[Entry]) -> None:
    from pneudrive.describe.files.catalogue import all_values

    width = max(len(e.name) for e in found)
    for heading, chosen in (
        ("Drives (pneudrive simulate catalogue:NAME ...)", [e for e in found if e.is_drive]),
        ('Parts (use = "catalogue:NAME" in a component of a circuit)', [e for e in found if not e.is_drive]),
    ):
        if not chosen:
            continue
        typer.echo(heading)
        for e in sorted(chosen, key=lambda one: one.kind):
            values = all_values(e) if e.is_drive else list(e.values)
            sourced = sum(v.source is not None for v in values)
            kind = "" if e.is_drive else f"{e.kind}: "
            typer.echo(f"  {e.name:<{width}}  {kind}{e.title} ({sourced} of {len(values)} values with a source)")
        typer.echo("")
    typer.echo("pneudrive catalogue NAME shows every value with its source.")


def _show(e: Entry) -> None:
    from pneudrive.describe.files.catalogue import all_values, check, entry

    typer.echo(f"{e.name}: {e.title}")
    notes = [e.note]
    if e.is_drive:
        for table, part in e.parts.items():
            typer.echo(f"  {table}: {part}")
            notes.append(entry(part).note)
    else:
        check(e)
    typer.echo("")
    values = all_values(e) if e.is_drive else list(e.values)
    lines = [(v.key, _plain(v.value), v.said) for v in values]
    lines += [(f"printed.{v.key}", _plain(v.value), v.said) for v in e.printed]
    typer.echo(aligned(lines))
    if not e.is_drive and e.open:
        typer.echo(f"\nNot in the catalogue; give these values with the part: {', '.join(e.open)}.")
    for note in filter(None, notes):
        typer.echo(f"\n{note}")
    from pneudrive.references import bibtex
    from pneudrive.references import entries as references

    keys = {v.source for v in (*values, *e.printed) if v.source is not None}
    for key in sorted(keys & references().keys()):
        typer.echo("\n" + bibtex(key))


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} = {v}" for k, v in value.items())
    return str(value)
