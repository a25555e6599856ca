"""``pneudrive lines``: effect of the tubes between valve and cylinder."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

from pneudrive.cli.options import CatalogueFolders, Plot, names_in
from pneudrive.cli.output import check_outputs, write_outputs
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pneudrive.describe.drive import Drive

TABLES = (".csv", ".parquet")
SAID = (
    "Tubes are steady: C = 0.029 d^2/sqrt(L/d^1.25 + 510), an empirical formula (assumed; smooth-pipe theory gives "
    "10 to 15 % more), and their volume; waves are left out. Strokes are simulated from rest at the start of the "
    "stroke, the emptying chamber at supply pressure; the choked speed is the limit that the exhaust path alone causes."
)


def lines(
    drive: str,
    length: str = "0.5 m, 1 m, 2 m, 5 m",
    diameter: str = "4 mm, 6 mm, 8 mm",
    out: Path | None = None,
    plot: Plot = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Show speed and stroke time over length and bore of the tubes.

    Options
    -------
    drive : DRIVE
        Drive file (TOML), or catalogue:NAME.
    length : LENGTHS
        Lengths of the tubes.
    diameter : DIAMETERS
        Inner diameters of the tubes.
    out
        Table: .csv or .parquet.
    """
    from pneudrive.cli.progress import on_terminal
    from pneudrive.describe.files.load import load_described
    from pneudrive.report.lines_figure import plot_lines
    from pneudrive.simulation.tube_study import study

    check_outputs(out, TABLES, plot)
    described = load_described(drive)
    found = study(cast("Drive", described), names_in(length), names_in(diameter), on_terminal())
    _show(found)
    write_outputs((out, partial(_save, found)), (plot, partial(plot_lines, found)))


def _show(study: xr.Dataset) -> None:
    names = list(study.data_vars)
    rows = [("without tubes", "", study.attrs["without_tubes"])]
    if "as_described" in study.attrs:
        rows.append(("as described", "", study.attrs["as_described"]))
    for diameter in study.diameter.to_numpy():
        for length in study.length.to_numpy():
            one = study.sel(diameter=diameter, length=length)
            rows.append((f"{1e3 * diameter:g} mm", f"{length:g} m", {str(name): float(one[name]) for name in names}))
    first = rows[0][2]
    heads = ("bore", "length", "C dm3/(s bar)", "choked m/s", "out s", "back s", "mean m/s", "end m/s", "of the speed")
    table = [heads, *((bore, length, *_cells(values, first)) for bore, length, values in rows)]
    typer.echo(f"{study.attrs['title']}\n{aligned(table, right_from=0)}")
    typer.echo(f"\n{SAID}")


def _cells(values: Mapping[str, Any], first: Mapping[str, Any]) -> tuple[str, ...]:
    share = values["mean_speed"] / first["mean_speed"]
    speeds = (values["vent_speed"], values["stroke_time_out"], values["stroke_time_back"])
    ends = (values["mean_speed"], values["end_speed"])
    never = "never"
    return (
        f"{1e8 * values['vent_conductance']:.3f}",
        *(f"{value:.3f}" if value == value else never for value in (*speeds, *ends)),
        f"{100.0 * share:.0f} %" if share == share else "",
    )


def _save(study: xr.Dataset, path: Path) -> None:
    """Write a row for each length and bore, with units in the names of the columns."""
    import numpy as np

    from pneudrive.simulation.trajectory import save_columns

    wide, long = np.meshgrid(study.diameter.to_numpy(), study.length.to_numpy(), indexing="ij")
    columns = {"diameter_m": wide.ravel(), "length_m": long.ravel()}
    endings = {"m3/(s Pa)": "m3_s_pa", "m/s": "m_s", "s": "s"}
    for name, values in study.data_vars.items():
        columns[f"{name}_{endings[values.attrs['units']]}"] = values.to_numpy().ravel()
    save_columns(columns, dict(study.attrs), path)
