"""Section "Describe": catalogue, kinds of components, checks, drawings and load."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import typer

import pneudrive as pn
from pneudrive.cli import terminal
from pneudrive.errors import CommandError, DescriptionError, nearest
from pneudrive.lazy_names import used_later
from pneudrive.repr_tables import aligned

with used_later(__name__):
    from pneudrive import references, views
    from pneudrive.campaign.planning import protocol
    from pneudrive.control import mismatch, motion, setup, tuning
    from pneudrive.describe import base, kinds
    from pneudrive.describe import components as component_texts
    from pneudrive.describe.files import catalogue as parts
    from pneudrive.describe.files import load, toml
    from pneudrive.files import content
    from pneudrive.report.circuit import svg
    from pneudrive.rig import description
    from pneudrive.signals import layout
    from pneudrive.sizing import task


def catalogue(
    name: str | None = None,
    *,
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

    Examples
    --------
    pneudrive catalogue --kind valve --flow '500 l/min ANR .. 800 l/min ANR'
    pneudrive catalogue starter --out drive.toml
    """
    search = {"kind": kind, "bore": bore, "stroke": stroke, "flow": flow}
    if any(search.values()):
        if name is not None:
            raise CommandError(f"{name} cannot be combined with a search", remedy="Give a name or a search option.")
        found = parts.find_parts(**search)
        _list(found) if found else typer.echo("No part fits.")
    elif out is not None:
        entries = parts.entries()
        if name is None or (name in entries and not entries[name].is_drive):
            drives = ", ".join(entry.name for entry in entries.values() if entry.is_drive)
            what = f"{name} is a part, not a drive" if name else "--out needs the name of a drive"
            raise CommandError(what, remedy=f"Drives: {drives}.")
        terminal.check_outputs(out, (".toml",))
        terminal.write_text(pn.Drive.load(f"{parts.PREFIX}{name}").to_toml(), out)
    elif name is None:
        _list(list(parts.entries().values()))
    else:
        _show_entry(parts.entry(name))


def _list(entries: list[parts.Entry]) -> None:
    width = max(len(e.name) for e in entries)
    for heading, chosen in (
        ("Drives (pneudrive simulate catalogue:NAME ...)", [e for e in entries if e.is_drive]),
        ('Parts (use = "catalogue:NAME" in a component of a circuit)', [e for e in entries if not e.is_drive]),
    ):
        if not chosen:
            continue
        typer.echo(heading)
        for e in sorted(chosen, key=lambda entry: entry.kind):
            values = parts.all_values(e)
            sourced = sum(v.source is not None for v in values)
            kind = "" if e.is_drive else f"{e.kind}: "
            typer.echo(f"  {e.name:<{width}}  {kind}{e.title} ({sourced} of {len(values)} values with a source)")
        typer.echo("")
    typer.echo("pneudrive catalogue NAME shows every value with its source.")


def _show_entry(e: parts.Entry) -> None:
    typer.echo(f"{e.name}: {e.title}")
    notes = [e.note]
    if e.is_drive:
        for table, part in e.parts.items():
            typer.echo(f"  {table}: {part}")
            notes.append(parts.entry(part).note)
    else:
        parts.check(e)
    values = parts.all_values(e)
    named = [*((v.key, v) for v in values), *((f"printed.{v.key}", v) for v in e.printed)]
    typer.echo(f"\n{aligned((key, base.inline(v.value), v.said) for key, v in named)}")
    if not e.is_drive and e.open:
        typer.echo(f"\nNot in the catalogue; give these values with the part: {', '.join(e.open)}.")
    for note in filter(None, notes):
        typer.echo(f"\n{note}")
    for key in sorted({v.source for _, v in named if v.source is not None} & references.entries().keys()):
        typer.echo(f"\n{references.bibtex(key)}")


def components(kind: str | None = None) -> None:
    """List the components of circuits, or the parameters of one kind.

    Options
    -------
    kind : KIND
        Kind to show.

    Examples
    --------
    pneudrive components flow-control
    """
    known = kinds.component_kinds()
    if kind is None:
        ports = {name: ", ".join(port["name"] for port in entry["ports"]) for name, entry in known.items()}
        typer.echo(aligned((name, entry["title"], f"ports {ports[name]}") for name, entry in known.items()))
        typer.echo("\npneudrive components KIND shows the parameters of one.")
        return
    if kind not in known:
        raise CommandError(f'there is no component "{kind}"', remedy=nearest(kind, known))
    entry = known[kind]
    names = entry["formula"]["names"] if entry["formula"] else []
    typer.echo(f"{entry['kind']}: {entry['title']}\n\n{entry['doc']}")
    for title, lines in (
        ("Ports", [(port["name"], port["kind"], _flags(port)) for port in entry["ports"]]),
        ("Keys", component_texts.rows(entry)),
        ("Names of its formula", [(name["name"], name["unit"], name["meaning"]) for name in names]),
        ("Inputs of a session", [(each["name"], each["unit"], each["meaning"]) for each in entry["inputs"]]),
        ("Columns", [(column["name"], column["meaning"]) for column in entry["outputs"]]),
    ):
        if lines:
            typer.echo(f"\n{title}\n{aligned(lines)}")
    for key in entry["sources"]:
        typer.echo(f"\n{references.bibtex(key)}")


def _flags(port: Mapping[str, Any]) -> str:
    if port["exhaust"]:
        return "open to the ambient air if not joined"
    return "may stay unconnected" if port["optional"] else ""


def check(drive: str) -> None:
    """Check a drive or a circuit, and list the sources of its values.

    Examples
    --------
    pneudrive check drive.toml
    """
    described = load.load_described(drive)
    each = [f"{name} ({component.kind})" for name, component in described.circuit.components.items()]
    typer.echo(f"{described.name}: {len(each)} components, no errors\n  {', '.join(each)}")
    ideal = []  # proportional valves with parameters that are zero
    for component in json.loads(described.circuit.core_json())["components"]:
        numbers = component["numbers"]
        if zeros := [key for key in mismatch.OF_VALVE.values() if "overlap" in numbers and numbers[key] == 0.0]:
            cost = "pneudrive control tune shows their effect on a controller"
            ideal.append((f"{{}}: {', '.join(zeros)} = 0, as in an ideal valve; {cost}", component["name"]))
    for title, lines in (
        ("To note", [*described.notes, *_together(ideal)]),
        ("Values with a source", described.sources()),
        ("Assumed", list(_together(described.assumptions))),
    ):
        if lines:
            typer.echo("\n".join(["", title, *(f"  {line}" for line in lines)]))


def _together(assumptions: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield assumptions or notes. A text that applies to several components or joints appears once."""
    names: dict[str, list[str]] = {}
    for line, name in assumptions:
        names.setdefault(line, []).append(name)
    for line, of in names.items():
        each = ", ".join(of)
        if len(of) > 1 and line.startswith("{}."):
            yield f"{each}: {line[3:]}"
        else:
            text = line.replace("the joint of", "each joint of") if len(of) > 1 else line
            yield text.replace("{}", each, 1) if any(of) else text


def draw(drive: str, *, out: Path = Path("circuit.svg")) -> None:
    """Draw a drive or a circuit with symbols after ISO 1219.

    Options
    -------
    out
        Picture: .svg, .png or .pdf.

    Examples
    --------
    pneudrive draw drive.toml --out circuit.svg
    """
    terminal.check_outputs(None, plot=out)
    circuit = load.load_described(drive).circuit
    try:
        svg.draw_circuit(circuit, out)
    except DescriptionError as error:
        raise toml.located(error, drive, content.read_text(Path(drive), DescriptionError, folder="")) from None
    terminal.show_paths(out)
    for name, volume in circuit.joint_volumes:
        typer.echo(f"joint of {name}: {1e6 * volume:.3g} cm3")


def schema(
    kind: Literal[
        "drive", "circuit", "layout", "rig", "protocol", "task", "controller", "setup", "trajectory", "view"
    ] = "drive",
) -> None:
    """Print the JSON schema of a kind of file, for an editor that completes and checks TOML.

    Options
    -------
    kind
        Kind of file: drive, circuit, layout of recordings, rig, protocol of a campaign, task of a sizing, controller,
        setup of a controller, or trajectory (a reference); or the view of a result.

    Examples
    --------
    pneudrive schema drive
    """
    schema_of = {"drive": load.drive_schema, "circuit": load.circuit_schema, "layout": layout.layout_schema}
    schema_of |= {"rig": description.rig_schema, "protocol": protocol.protocol_schema, "task": task.task_schema}
    schema_of["view"] = views.view_schema
    tables = {"controller": tuning.Controller, "setup": setup.Setup, "trajectory": motion.ReferenceFile}
    found = schema_of[kind]() if kind in schema_of else tables[kind].model_json_schema(by_alias=True)
    draft = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    typer.echo(json.dumps(draft | found, indent=2, ensure_ascii=False))
