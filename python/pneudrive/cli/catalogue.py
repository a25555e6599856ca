"""``pneudrive catalogue``: parts and drives, each value with its source."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pneudrive.describe.catalogue import Entry, Value


def catalogue(
    name: Annotated[str | None, typer.Argument(help="Part or drive to show.", metavar="NAME")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the drive NAME as a file to start from: .toml.")] = None,
) -> None:
    """List parts and drives; with a name, each of its values with its source, or why it is assumed."""
    from pneudrive.describe.catalogue import entries, entry

    if out is not None:
        _write(name, out)
    elif name is None:
        _list(list(entries().values()))
    else:
        _show(entry(name))


def _write(name: str | None, out: Path) -> None:
    from pneudrive.describe import Drive
    from pneudrive.describe.catalogue import PREFIX, entries
    from pneudrive.trajectory import check_target, whole

    if name is None or (name in entries() and entries()[name].kind != "drive"):
        drives = ", ".join(one.name for one in entries().values() if one.kind == "drive")
        what = f"{name} is a part, not a drive" if name else "--out needs the name of a drive"
        raise CommandError(what, remedy=f"Drives: {drives}.")
    target = check_target(out, (".toml",))
    text = Drive.load(f"{PREFIX}{name}").to_toml()
    with whole(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    typer.echo(str(out))


def _list(found: list[Entry]) -> None:
    from pneudrive.describe.catalogue import all_values

    width = max(len(e.name) for e in found)
    for heading, chosen in (
        ("Drives (pneudrive simulate catalogue:NAME ...)", [e for e in found if e.kind == "drive"]),
        ("Parts", [e for e in found if e.kind != "drive"]),
    ):
        typer.echo(heading)
        for e in chosen:
            values = all_values(e) if e.kind == "drive" else list(e.values)
            sourced = sum(v.source is not None for v in values)
            typer.echo(f"  {e.name:<{width}}  {e.title} ({sourced} of {len(values)} values with a source)")
        typer.echo("")
    typer.echo("pneudrive catalogue NAME shows every value with its source.")


def _show(e: Entry) -> None:
    from pneudrive.describe.catalogue import all_values

    typer.echo(f"{e.name}: {e.title}")
    notes = [e.note]
    if e.kind == "drive":
        from pneudrive.describe.catalogue import entry

        for table, part in e.parts.items():
            typer.echo(f"  {table}: {part}")
            notes.append(entry(part).note)
    typer.echo("")
    values = all_values(e) if e.kind == "drive" else list(e.values)
    key_width = max(len(v.key) for v in values)
    shown = {v.key: _plain(v.value) for v in values}
    value_width = max(len(s) for s in shown.values())
    for v in values:
        typer.echo(f"  {v.key:<{key_width}}  {shown[v.key]:<{value_width}}  {_origin(v)}")
    for note in filter(None, notes):
        typer.echo(f"\n{note}")
    keys = sorted({v.source for v in values if v.source is not None})
    if keys:
        from pneudrive.references import bibtex

        typer.echo("")
        for key in keys:
            typer.echo(bibtex(key) + "\n")


def _origin(v: Value) -> str:
    if v.source is None:
        return f"assumed: {v.assumed}"
    return f"[{v.source}]" + (f" {v.note}" if v.note else "")


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} = {v}" for k, v in value.items())
    return str(value)
