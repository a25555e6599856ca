"""``pneudrive characteristic``: one characteristic of a drive."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneudrive.cli.options import CatalogueFolders, Described, Plot, pair_in
from pneudrive.cli.output import check_outputs, console, show_table, write_outputs
from pneudrive.errors import CommandError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from pneudrive.datasheet.characteristic import Characteristic

TABLES = (".csv", ".nc")


def characteristic(
    drive: Described,
    name: Annotated[str, typer.Argument()] = "",
    setting: Annotated[list[str] | None, typer.Option("--set")] = None,
    out: Path | None = None,
    plot: Plot = None,
    intervals: bool = True,
    catalogue: CatalogueFolders = None,
) -> None:
    """Show a characteristic of a drive, with definition and standard.

    Options
    -------
    name : NAME
        Name; without a name, all are listed.
    setting : NAME=VALUE
        A setting, "command = 0.6"; repeatable.
    out
        All results: .csv or .nc (netCDF).
    intervals
        Propagate intervals of identified values.
    """
    from pneudrive.datasheet.registry import characteristics

    if not name:
        rows = [(one.name, one.title, one.standard or "-") for one in characteristics().values()]
        return show_table(("characteristic", "<title", "<standard"), rows)
    from pneudrive.cli.progress import on_terminal
    from pneudrive.datasheet.registry import characteristic_named, found_under
    from pneudrive.describe.files.load import load_described
    from pneudrive.report.datasheet.figures import plot_characteristic

    check_outputs(out, TABLES, plot)
    settings = dict(_setting(text, characteristic_named(name)) for text in setting or [])
    found = found_under(load_described(drive), name, on_terminal(), intervals=intervals, **settings)
    _show(found)
    write_outputs((out, partial(_save, found)), (plot, partial(plot_characteristic, found)))
    return None


def _setting(text: str, one: Characteristic) -> tuple[str, Any]:
    """Read ``name = value``; several values are separated by commas."""
    name, value = pair_in("--set", text, "command = 0.6")
    if name not in one.settings:
        raise CommandError(f"{one.name} has no setting {name!r}", remedy=nearest(name, one.settings))
    values = [_number(part.strip()) for part in value.split(",")]
    default = one.settings[name][0]
    if isinstance(default, int):
        return name, _whole(name, values)
    many = isinstance(default, tuple) or (default is None and name.endswith("s"))
    if len(values) > 1 and not many:
        raise CommandError(f"{name} = {value} is more than one value", rule=f"{one.name} takes one {name}")
    return name, values if many else values[0]


def _whole(name: str, values: list[str | float]) -> int:
    """Return a whole number greater than 0."""
    value = values[0]
    if len(values) > 1 or not isinstance(value, float) or not value.is_integer() or value < 1.0:
        raise CommandError(f"{name} = {', '.join(map(str, values))} is out of bounds", rule="a whole number from 1 on")
    return int(value)


def _number(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text


def _show(found: xr.Dataset) -> None:
    from pneudrive.datasheet.sheet import in_words, written_value

    screen = console()
    for line in (found.attrs["title"], found.attrs["definition"], f"Standard: {found.attrs['standard']}"):
        screen.print(line)
    rows, long = [], []
    for name, place, value, low, high in rows_of(found, written_value):
        if found[name].size > MOST:
            long += [] if name in long else [name]
            continue
        shown = written_value(value, found[name].attrs["units"], low, high)
        rows.append((in_words(name), place, shown, found[name].attrs["long_name"]))
    show_table(("result", "<at", "<value", "<meaning"), rows)
    if long:
        screen.print(f"More than {MOST} values each, in --out FILE.csv: {', '.join(map(in_words, long))}")
    screen.print(f"Interval: {found.attrs.get('interval', 'not asked for')}")


MOST = 24  # values of one result on the terminal


def rows_of(
    found: xr.Dataset, write: Callable[[float, str], str] = lambda value, _: f"{value:.5g}"
) -> list[tuple[str, str, float, float | None, float | None]]:
    """Return each value with its formatted coordinates and its interval; single numbers come first."""
    import numpy as np

    names = [str(name) for name in found.data_vars]
    plain = [name for name in names if not (name.endswith(("_low", "_high")) and name.rpartition("_")[0] in names)]
    out = []
    for name in sorted(plain, key=lambda one: found[one].ndim):
        value = found[name].to_numpy()
        ends = [found[f"{name}_{end}"].to_numpy() if f"{name}_{end}" in found else None for end in ("low", "high")]
        for index in np.ndindex(value.shape):
            place = ", ".join(
                f"{dim} {write(float(found[dim].to_numpy()[k]), found[dim].attrs['units'])}"
                if found[dim].dtype.kind == "f"
                else str(found[dim].to_numpy()[k])
                for dim, k in zip(found[name].dims, index, strict=True)
                if dim in found.coords
            )
            low, high = (None if end is None else float(end[index]) for end in ends)
            out.append((name, place, float(value[index]), low, high))
    return out


def _save(found: xr.Dataset, path: Path) -> None:
    """Write all results in SI: rows of a table, or the data set as netCDF."""
    import csv
    import json

    from pneudrive.simulation.trajectory import whole

    with whole(path) as temporary:
        if path.suffix.lower() == ".nc":
            plain = {k: v if isinstance(v, str | int | float) else json.dumps(v) for k, v in found.attrs.items()}
            found.assign_attrs(plain).to_netcdf(temporary, engine="h5netcdf")
            return
        with temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(("result", "at", "value", "low", "high", "unit", "meaning"))
            for name, place, value, low, high in rows_of(found):
                about = found[name].attrs
                writer.writerow(
                    (
                        name,
                        place,
                        repr(value),
                        *("" if end is None else repr(end) for end in (low, high)),
                        about["units"],
                        about["long_name"],
                    )
                )
