"""``pneudrive validate``: validate a drive against recordings, or its friction law against a friction map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.cli.options import CatalogueFolders, Layout, Results, quantity, sensor_option
from pneudrive.cli.output import MOST_ROWS, show_lines, show_table, tell, writable_folder
from pneudrive.cli.progress import on_terminal

if TYPE_CHECKING:
    from pneudrive.describe.drive import Drive
    from pneudrive.identify.dynamic.result import DriveFit
    from pneudrive.validate.validation import Validation


def validate(
    drive: str,
    recordings: list[Path],
    layout: Layout = None,
    sensor: list[str] | None = None,
    window: str = "0.5 s",
    out: Results = Path("validation"),
    catalogue: CatalogueFolders = None,
) -> None:
    """Compare a drive with recordings, and diagnose differences.

    A friction map (map.parquet, map.csv) or a campaign folder is compared with the drive's friction law.

    Options
    -------
    drive : DRIVE|FIT
        Drive file (TOML), catalogue:NAME, or fit of `pneudrive identify --out` with the zeros of its sensors.
        Also a fit along motions or of a regulator. Verdicts use the recordings that were held out of the fit.
    recordings : RECORDING...|MAP|CAMPAIGN
        Recordings of the drive (time, command, position, both pressures), or one friction map or campaign.
    sensor : CHANNEL: KEY = VALUE, ...
        Known error of a sensor: "pressure_a: offset = 0.02 bar"; gain; "command: delay = 3 ms".
    window
        Length of the runs that start from measured states.
    """
    from pneudrive.describe.drive import Drive
    from pneudrive.errors import CommandError
    from pneudrive.identify.follow.regulator import read_regulator_fit
    from pneudrive.report.validation.page import write_validation_report
    from pneudrive.validate.regulator import validate_regulator
    from pneudrive.validate.static import is_friction
    from pneudrive.validate.validation import validate as validated

    lag = read_regulator_fit(drive)
    if lag is not None:
        checked = validate_regulator(lag, list(recordings), layout=layout)
        show_lines([str(checked)])
        tell(checked.write(writable_folder(out)))
        return
    if _follows_motion(drive):
        _motion(drive, recordings, layout, out)
        return
    seconds, fit = quantity("--window", window, "s"), _fit(drive)
    described = Drive.load(drive) if fit is None else fit.apply()
    known = dict(sensor_option(text) for text in sensor or ())
    if any(is_friction(path) for path in recordings):
        if len(recordings) > 1:
            raise CommandError(
                "a friction map or a campaign cannot be validated together with other files", remedy="Name one of them."
            )
        _friction(described, recordings[0], out)
        return
    found = validated(
        described if fit is None else fit,
        list(recordings),
        layout=layout,
        window_s=seconds,
        sensors=known or None,
        progress=on_terminal().tell,
    )
    folder = writable_folder(out)
    written = [*found.write(folder), write_validation_report(found, folder)]
    _say(found)
    tell(written)


def _follows_motion(path: str) -> bool:
    """Whether a file is a fit along motions, or a circuit without a valve to command."""
    from pneudrive.describe.files import toml
    from pneudrive.errors import DescriptionError

    if Path(path).suffix != ".toml" or not Path(path).is_file():
        return False
    tables, _ = toml.read(path, DescriptionError)
    return tables.get("kind") == "motion" or ("components" in tables and "valve" not in tables)


def _motion(path: str, recordings: list[Path], layout: Path | None, out: Path) -> None:
    from pneudrive.validate.motion import validate_motion

    found = validate_motion(path, list(recordings), layout=layout, progress=on_terminal().tell)
    folder = writable_folder(out)
    show_lines([str(found)])
    tell(found.write(folder))


def _fit(path: str) -> DriveFit | None:
    """Read a fit of a drive; None for another file."""
    from pneudrive.describe.files import toml
    from pneudrive.errors import DescriptionError
    from pneudrive.identify.dynamic.result import DriveFit

    if Path(path).suffix != ".toml" or not Path(path).is_file():
        return None
    tables, _ = toml.read(path, DescriptionError, "`pneudrive identify --out` and `pneudrive apply --out` write TOML.")
    return DriveFit.from_toml(path) if tables.get("kind") == "drive" and "values" in tables else None


def _friction(drive: Drive, path: Path, out: Path) -> None:
    from pneudrive.report.validation.static import write_friction_report
    from pneudrive.validate.static import validate_friction

    found = validate_friction(drive, path)
    folder = writable_folder(out)
    written = [*found.write(folder), write_friction_report(found, folder)]
    show_lines([str(found)])
    tell(written)


def _say(found: Validation) -> None:
    """Print one line per recording, the verdicts and the diagnosis."""
    heads = (
        "recording",
        "position fit %",
        f"from states, {found.window_s:g} s %",
        "pressure NRMSE %",
        "off from s",
        "fit",
    )
    rows = []
    for record in found.records[:MOST_ROWS]:
        position = record.channels["position_m"]
        pressure = max(record.channels[c].free.nrmse for c in ("pressure_a_pa", "pressure_b_pa"))
        off = "-" if position.off_s is None else f"{position.off_s:.2f}"
        fits = (f"{position.free.fit_percent:.1f}", f"{position.restarted.fit_percent:.1f}")
        rows.append((record.recording.name, *fits, f"{100 * pressure:.2g}", off, found.badge(record)))
    if not found.fitted:
        heads, rows = heads[:-1], [row[:-1] for row in rows]
    show_table(heads, rows)
    show_lines([str(found)])
