"""``pneudrive export``: friction in the form of another tool's law, or a whole drive for another tool."""

from __future__ import annotations

import platform
import sys
from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import check_used, option

#: Tools that take a whole drive, and those that take its friction.
_WHOLE, _FRICTION = ("fmu", "c"), ("simscape", "modelica", "csv", "st")
#: Parameter of the command -> tools that use it, and what to do for another one.
_USED = {
    "pressure_a": (_FRICTION, 'Remove it; a start pressure is --initial "pressure_a = 3 bar abs".'),
    "pressure_b": (_FRICTION, 'Remove it; a start pressure is --initial "pressure_b = 3 bar abs".'),
    "speeds": (_FRICTION, "Remove this option: a whole drive runs at every speed."),
    "initial": (_WHOLE, "Remove it: friction has no start state; set pressures by --pressure-a and --pressure-b."),
    "fmi": (("fmu",), "Remove it, or write --to fmu."),
    "actuator": (("fmu",), "Remove it, or write --to fmu."),
}


def export(
    context: typer.Context,
    source: str,
    to: Annotated[str, typer.Option()],
    out: Path | None = None,
    pressure_a: str | None = None,
    pressure_b: str | None = None,
    speeds: str | None = None,
    fmi: str = "2.0",
    actuator: Annotated[bool, typer.Option("--actuator")] = False,
    initial: str | None = None,
) -> None:
    """Write a drive as an FMU or for C, or friction for another tool.

    Options
    -------
    source : FIT|DRIVE
        Fit (fit.toml), or drive file.
    to : TOOL
        Friction: simscape, modelica, csv or st. A whole drive or circuit: fmu or c.
    out
        File, for c a folder; default for friction: standard output.
    pressure_a
        Pressure in chamber a, e.g. "3 bar gauge"; default: middle of the measured ones.
    pressure_b
        Pressure in chamber b.
    speeds
        Range of speeds for the law, "1 mm/s .. 500 mm/s"; default: the measured speeds.
    fmi
        Version of the interface of an FMU: 2.0 or 3.0.
    actuator
        FMU whose piston is moved by the other tool; its output is the force.
    initial
        Start state of a drive, e.g. "position = 50 mm, pressure_a = 3 bar abs".
    """
    if to in _WHOLE:
        check_used(context, to, _USED)
        _export_whole(source, to, out, fmi, actuator, initial)
        return
    from pneudrive.describe.drive import Drive
    from pneudrive.errors import CommandError
    from pneudrive.identify.export.convert import check_tool
    from pneudrive.identify.export.convert import export as exported
    from pneudrive.identify.files import read_source
    from pneudrive.identify.static.friction_curve import curve_of_drive
    from pneudrive.units import parse_pressure, parse_range

    check_tool(to)
    check_used(context, to, _USED)

    def gauge(text: str | None, name: str) -> float | None:
        if text is None:
            return None
        with option(name):
            pressure = parse_pressure(text)
        if not pressure.gauge:
            raise CommandError(
                f'{name} "{text}" is an absolute pressure', rule="a gauge pressure", remedy='Write "... gauge".'
            )
        return pressure.value_pa

    with option("--speeds"):
        between = None if speeds is None else parse_range(speeds, "m/s")
    pressures = gauge(pressure_a, "--pressure-a"), gauge(pressure_b, "--pressure-b")
    given = read_source(source)
    is_drive = isinstance(given, Drive)
    curve = curve_of_drive(given, between, *pressures) if is_drive else given.curve(*pressures, between)
    done = exported(curve, to)
    if out is None:
        sys.stdout.write(done.text)
        return
    for remark in done.remarks():
        sys.stderr.write(f"- {remark}\n")
    typer.echo(str(done.write(out)))


def _export_whole(source: str, to: str, out: Path | None, fmi: str, actuator: bool, initial: str | None) -> None:
    """Write a drive or a circuit for another tool, and print the variables that the tool sees."""
    from pneudrive.describe.files.load import load_described
    from pneudrive.errors import CommandError

    if out is None:
        what, remedy = ("an FMU is a file", "drive.fmu") if to == "fmu" else ("C needs a folder", "drive_c")
        raise CommandError(f"--out is missing: {what}", remedy=f"Write --out {remedy}.")
    drive = load_described(source)
    if to == "c":
        from pneudrive.fmu.package import export_c

        for path in export_c(drive, out, initial=initial):
            typer.echo(str(path))
        return
    from pneudrive.fmu.package import export_fmu

    done = export_fmu(drive, out, version=fmi, actuator=actuator, initial=initial)
    for note in done.notes:
        sys.stderr.write(f"- {note}\n")
    typer.echo(f"{done.path}: FMI {done.version}, token {done.token}")
    typer.echo("inputs: " + ", ".join(f"{one.name} [{one.unit}]" for one in done.inputs))
    typer.echo("outputs: " + ", ".join(f"{one.name} [{one.unit}]" for one in done.outputs))
    typer.echo(f"parameters: {len(done.parameters)}, by the keys of the drive file; pressures are absolute")
    system = f"{platform.system()} {platform.machine()}"
    typer.echo(f"runs on {system} only, the system of this computer: for another one, export the drive there")
