"""``pneudrive identify``: identify parameters of a drive from recordings of its motion."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pneudrive.cli.options import CatalogueFolders, Layout, Page, Profile, names_in, one_of, sensor_option
from pneudrive.cli.output import check_outputs, tell, tell_fit, writable_folder
from pneudrive.numbers import plain
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

if TYPE_CHECKING:
    from pneudrive.identify.dynamic.search import Progress


def identify(
    drive: str,
    recordings: list[Path],
    free: str = "",
    sensor: list[str] | None = None,
    segment: str = "0.4 s",
    robust: bool = False,
    follow: str | None = None,
    profile: Profile = False,
    report: Page = None,
    layout: Layout = None,
    out: Path | None = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Identify the numbers of a drive from recordings of its motion.

    Ctrl-C keeps the best values so far. A file with a table [volume] describes a tank, whose line, heat
    transfer and leak follow from its pressure. A file with a table [regulator] describes a pressure
    regulator, whose gain and lag follow from command and pressure.

    Options
    -------
    drive : DRIVE
        Drive file (TOML), catalogue:NAME, or tank file, with the start values.
    recordings : RECORDING...
        Recordings: time, command, position, pressures; for a tank, time and pressure.
    free : NAMES
        Free numbers, separated by commas. Default for a tank: all.
    sensor : CHANNEL:KEY=VALUE
        Sensor: "position: noise = 2 um, offset = free", with noise, offset, offset_uncertainty, gain, lag,
        resolution. "command: delay = free".
    segment
        Length of a segment, or "whole".
    robust
        Reduce the weight of outliers.
    follow : motion
        A circuit follows the recorded position. Free: volumes, heat, wall, leak, leak_a, leak_b, barrel, or names
        such as upper.volume.
    out
        Fit file to write (TOML).
    """
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tank import Tank
    from pneudrive.identify.dynamic.fit import identify as identified
    from pneudrive.identify.follow.regulator import Regulator, identify_regulator

    check_outputs(out, (".toml",))
    names = names_in(free)
    if follow is not None:
        one_of("--follow", follow, {"motion": None})
        _motion(drive, recordings, names, layout, out, report)
        return
    if Regulator.is_file(drive):
        lag = identify_regulator(drive, list(recordings), layout)
        typer.echo(str(lag))
        tell([lag.to_toml(out) if out is not None else None])
        return
    if Tank.is_file(drive):
        _tank(
            drive,
            recordings,
            names,
            layout,
            (out, report),
            profile=profile,
            beside={"sensor": sensor, "robust": robust},
        )
        return
    sensors = dict(sensor_option(text) for text in sensor or ())
    fit = identified(
        Drive.load(drive),
        list(recordings),
        names,
        sensors=sensors,
        segment=None if segment == "whole" else segment,
        robust=robust,
        layout=layout,
        progress=_show,
    )
    tell_fit(fit, out, report, profile=profile)


def _motion(
    circuit: str, recordings: list[Path], names: list[str], layout: Path | None, out: Path | None, report: Path | None
) -> None:
    """Identify a circuit along recorded motions."""
    from pneudrive.cli.progress import on_terminal
    from pneudrive.identify.follow.fit import identify_motion

    groups = names or ["volumes", "heat"]
    fit = identify_motion(circuit, list(recordings), groups, layout=layout, progress=on_terminal().tell)
    typer.echo(str(fit))
    if out is not None:
        fit.to_toml(out)
    tell([out, fit.report(writable_folder(report)) if report is not None else None])


def _show(progress: Progress) -> None:
    """Write the rms residual of each channel. The cost is left out: each phase weights the residuals anew."""
    from pneudrive.identify.dynamic.sensors import CHANNELS

    rms = []
    for name, value in progress.rms.items():
        size, unit = readable(meaning(CHANNELS[name])[1])
        rms.append(f"{name} {plain(value / size)} {unit}")
    sys.stderr.write(f"step {progress.step} ({progress.phase}): rms residual {', '.join(rms)}\n")


def _tank(
    tank: str,
    recordings: list[Path],
    names: list[str],
    layout: Path | None,
    written: tuple[Path | None, Path | None],
    *,
    profile: bool,
    beside: dict[str, object],
) -> None:
    """Identify a fixed volume."""
    from pneudrive.cli.progress import on_terminal
    from pneudrive.describe.tank import Tank
    from pneudrive.errors import CommandError
    from pneudrive.identify.volume import identify_volume

    for option, given in beside.items():
        if given:
            raise CommandError(
                f"--{option} is not an option for a tank",
                where=tank,
                rule="options for a tank: --free, --layout, --out, --profile, --report",
            )
    fit = identify_volume(Tank.load(tank), list(recordings), names or None, layout=layout, progress=on_terminal().tell)
    tell_fit(fit, *written, profile=profile)
