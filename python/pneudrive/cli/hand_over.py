"""Section "Hand over": a drive or its friction for another tool, and the demonstration."""

from __future__ import annotations

import platform
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

import pneudrive as pn
from pneudrive.cli import terminal
from pneudrive.cli.measure import write_map_and_fits
from pneudrive.cli.options import check_used
from pneudrive.errors import CommandError, naming
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive import units
    from pneudrive.describe.files import load
    from pneudrive.friction import characterisation
    from pneudrive.identify import export as friction_export
    from pneudrive.identify import files
    from pneudrive.report import page, recordings, trajectory
    from pneudrive.studies.bracha import reproduction

if TYPE_CHECKING:
    from pneudrive.fmu.package import FmuFile

#: Tools that take a whole drive, and those that take its friction.
_WHOLE, _FRICTION = ("fmu", "c"), ("simscape", "modelica", "csv", "st")
#: Parameter of the command -> tools that use it, and a remedy for other tools.
_USED = {
    "pressure_a": (_FRICTION, 'Remove it; a start pressure is --initial "pressure_a = 3 bar abs".'),
    "pressure_b": (_FRICTION, 'Remove it; a start pressure is --initial "pressure_b = 3 bar abs".'),
    "speeds": (_FRICTION, "Remove this option: a whole drive runs at every speed."),
    "initial": (_WHOLE, "Remove it: friction has no start state; set pressures by --pressure-a and --pressure-b."),
    "fmi": (("fmu",), "Remove it, or write --to fmu."),
    "actuator": (("fmu",), "Remove it, or write --to fmu."),
}
MEASUREMENTS = Path("data/measurements/zillen-2021-pneumatic-piston")
#: Folder with two recordings and the axis description, part of every installation.
SHIPPED = Path(__file__).parents[1] / "data" / "demo"
AXIS = SHIPPED / "controlled_axis.toml"


def export(
    context: typer.Context,
    source: str,
    *,
    to: str,
    out: Path | None = None,
    pressure_a: str | None = None,
    pressure_b: str | None = None,
    speeds: str | None = None,
    fmi: str = "2.0",
    actuator: bool = False,
    initial: str | None = None,
) -> None:
    """Write a drive as an FMU or C library, or friction for another tool.

    Options
    -------
    source : FIT|DRIVE
        Fit (fit.toml), or drive file.
    to : TOOL
        Friction: simscape, modelica, csv or st. A whole drive or circuit: fmu or c.
    out
        File, for c a folder; default for friction: standard output.
    pressure_a
        Pressure in chamber a, e.g. "3 bar gauge"; default: middle of the measured pressures.
    pressure_b
        Pressure in chamber b.
    speeds
        Range of speeds for the law, "1 mm/s .. 500 mm/s"; default: the measured speeds.
    fmi
        Version of the interface of an FMU: 2.0 or 3.0.
    actuator
        FMU whose piston the other tool moves; its output is the force.
    initial
        Start state of a drive, e.g. "position = 50 mm, pressure_a = 3 bar abs".

    Examples
    --------
    pneudrive export drive.toml --to fmu --out drive.fmu
    pneudrive export fit.toml --to modelica --out friction.mo
    """
    if to not in _WHOLE:
        friction_export.check_tool(to)
    check_used(context, to, _USED)
    if to in _WHOLE:
        if out is None:
            what, remedy = ("an FMU needs a file name", "drive.fmu") if to == "fmu" else ("C needs a folder", "drive_c")
            raise CommandError(f"--out is missing: {what}", remedy=f"Write --out {remedy}.")
        drive = load.load_described(source)
        if to == "c":
            terminal.show_paths(*pn.export_c(drive, out, initial=initial))
        else:
            _show_fmu(pn.export_fmu(drive, out, version=fmi, actuator=actuator, initial=initial))
        return
    with naming("--speeds"):
        between = None if speeds is None else units.parse_range(speeds, "m/s")
    pressures = _gauge(pressure_a, "--pressure-a"), _gauge(pressure_b, "--pressure-b")
    content = files.read_source(source)
    if isinstance(content, pn.Drive):
        curve = friction_export.curve_of_drive(content, between, *pressures)
    else:
        curve = content.curve(*pressures, between)
    done = friction_export.export(curve, to)
    if out is None:
        sys.stdout.write(done.text)
        return
    sys.stderr.write("".join(f"- {remark}\n" for remark in done.remarks()))
    terminal.show_paths(done.write(out))


def _gauge(text: str | None, name: str) -> float | None:
    if text is None:
        return None
    with naming(name):
        pressure = units.parse_pressure(text)
    if not pressure.gauge:
        raise CommandError.of("cli.gauge", name=name, text=text)
    return pressure.value_pa


def _show_fmu(done: FmuFile) -> None:
    """Print the variables of an FMU that the other tool sees."""
    sys.stderr.write("".join(("Notes and assumed values of the drive:\n", *(f"- {note}\n" for note in done.notes))))
    typer.echo(f"{done.path}: FMI {done.version}, token {done.token}")
    for title, variables in (("inputs", done.inputs), ("outputs", done.outputs)):
        typer.echo(f"{title}: " + ", ".join(f"{variable.name} [{variable.unit}]" for variable in variables))
    typer.echo(f"parameters: {len(done.parameters)}, by the keys of the drive file; pressures are absolute")
    typer.echo(f"runs on {platform.system()} {platform.machine()} only, the system of this computer")


def demo(*, out: Path = Path("out")) -> None:
    """Characterise the real recordings, reproduce the source paper on the simulated rig, and write one report.

    The recordings are those of the project, or two shipped ones.

    Options
    -------
    out
        Folder for the results.
    """
    folder = terminal.writable_folder(out)
    measurements = MEASUREMENTS if MEASUREMENTS.is_dir() else SHIPPED
    files_of = sorted([*measurements.glob("friction/*.csv*"), *measurements.glob("repeatability/*.csv*")])
    found = characterisation.characterise_recordings(files_of)
    _, fits, _ = write_map_and_fits(found, folder)
    made = reproduction.reproduce(folder / reproduction.FOLDER)
    axis = pn.control.run(pn.Circuit.load(AXIS), "super-twisting", reference="sine 60 mm 1 Hz around 250 mm")
    controlled = page.view_section("controlled-axis", trajectory.view_of_run(axis), synthetic=True)
    report, study = recordings.recordings_report(found, fits), made.report().sections
    verdict = [*report.verdict, *reproduction.verdict(made, alone=False)]
    title, sections = f"{report.title}, with a simulated rig", [*report.sections, *study, controlled]
    report = replace(report, title=title, verdict=verdict, sections=sections)
    written = report.write(folder)
    typer.echo(f"{report.title}: {len(found.results)} recordings")
    for number, line in enumerate(report.lines, 1):
        typer.echo(f"{number}. {line.text}")
    typer.echo(f"\nReport: {written.resolve()}")
