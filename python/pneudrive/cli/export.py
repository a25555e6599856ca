"""``pneudrive export``: friction parameters in the form of another tool's law."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import option


def export(
    source: Annotated[str, typer.Argument(help="Fit (fit.toml), or drive file.", metavar="FIT|DRIVE")],
    to: Annotated[str, typer.Option(help="simscape, modelica or csv.", metavar="TOOL")],
    out: Annotated[Path | None, typer.Option(help="File; default: standard output.")] = None,
    pressure_a: Annotated[
        str | None,
        typer.Option(help='Pressure in chamber a, e.g. "3 bar gauge"; default: middle of the measured ones.'),
    ] = None,
    pressure_b: Annotated[str | None, typer.Option(help="Pressure in chamber b.")] = None,
    speeds: Annotated[
        str | None,
        typer.Option(help='Range of speeds for the law, "1 mm/s .. 500 mm/s"; default: the measured speeds.'),
    ] = None,
) -> None:
    """Write friction as another tool's law, with the error and the losses of the conversion."""
    from pneudrive.describe.drive import Drive
    from pneudrive.errors import CommandError
    from pneudrive.identify.export.convert import check_tool
    from pneudrive.identify.export.convert import export as exported
    from pneudrive.identify.files import read_source
    from pneudrive.identify.friction_curve import curve_of_drive
    from pneudrive.units import parse_pressure, parse_range

    check_tool(to)

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
