"""``pneudrive demo``: real recordings, the source paper on a simulated rig, an axis under control; one report."""

from __future__ import annotations

from pathlib import Path

import typer

MEASUREMENTS = Path("data/measurements/zillen-2021-pneumatic-piston")
#: Two of the recordings and the axis, in every installation.
SHIPPED = Path(__file__).parents[2] / "data" / "demo"
AXIS = SHIPPED / "controlled_axis.toml"


def demo(
    out: Path = Path("out"),
    measurements: Path | None = None,
) -> None:
    """Characterise the real recordings, reproduce the source paper on the simulated rig, write one report.

    Options
    -------
    out
        Folder for the results.
    measurements
        Folder with the recordings; default: those of the project, or two shipped ones.
    """
    from pneudrive.cli.output import writable_folder
    from pneudrive.describe.circuit import Circuit
    from pneudrive.errors import CommandError
    from pneudrive.friction.characterisation import characterise_recordings
    from pneudrive.friction.friction_map import write_map
    from pneudrive.identify.static.fit import fit_characterisation, fit_file
    from pneudrive.report import write_report
    from pneudrive.report.recording.verdict import verdict
    from pneudrive.report.study import WithSections
    from pneudrive.studies.bracha import FOLDER
    from pneudrive.studies.bracha.reproduction import reproduce
    from pneudrive.studies.identified_axis import identify_axis

    folder = writable_folder(out)
    if measurements is None:
        measurements = MEASUREMENTS if MEASUREMENTS.is_dir() else SHIPPED
    files = sorted([*measurements.glob("friction/*.csv*"), *measurements.glob("repeatability/*.csv*")])
    if not files:
        raise CommandError(
            f"there are no recordings in {measurements}",
            rule="friction/*.csv or repeatability/*.csv",
            remedy="Leave out --measurements, or name a folder with recordings.",
        )
    found = characterise_recordings(list(files))
    for name in ("map.parquet", "map.csv"):
        write_map(found.friction_map, folder / name)
    fits, _ = fit_characterisation(found)
    for group, by_law in fits.items():
        if "stribeck" in by_law:
            by_law["stribeck"].to_toml(folder / fit_file(group))
    made = reproduce(folder / FOLDER)
    more = (identify_axis(Circuit.load(AXIS)).section(),)
    report = write_report(found, fits, folder, WithSections(made, more))
    for number, line in enumerate(verdict(found, fits, made), 1):
        typer.echo(f"{number}. {line}")
    typer.echo(f"\nReport: {report.resolve()}")
