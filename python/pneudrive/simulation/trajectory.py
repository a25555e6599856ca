"""Trajectories: meaning of their columns, and reading and writing of their files.

In memory, a trajectory is an `xarray.Dataset`, in which each variable has its unit as attribute. In a file, the names
of the columns contain the unit. A file is written completely or not at all.
"""

from __future__ import annotations

import json
import os
import secrets
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError, ErrorKind, RecordingError, nearest, package_table, warn
from pneudrive.files.content import csv_names, read_csv, spreadsheet_text
from pneudrive.files.inputs import stored_beside
from pneudrive.files.seal import sealed_parquet
from pneudrive.units import suffix

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import polars as pl
    import xarray as xr

    from pneudrive.arrays import Array, Columns, Keyed, Plain
    from pneudrive.files.tables import Table

MOST_SAMPLES = 50_000_000  # samples of a run, whose trajectory then takes about 6 GB
#: Names, units and meanings of columns.
TABLE: Plain = package_table(__file__, "columns.toml")
#: Column of a file -> variable, unit, long name.
MEANING: dict[str, tuple[str, str, str]] = {column: tuple(about) for column, about in TABLE["columns"].items()}
#: Ending of the name of a column -> its unit.
_ENDINGS = {f"_{suffix(unit)}": unit for unit in TABLE["units"]}
SUFFIXES = (".parquet", ".csv", ".nc")
TABLES = {".parquet": "parquet", ".nc": "netcdf"}


@lru_cache(maxsize=4096)
def meaning(column: str) -> tuple[str, str, str]:
    """Return (variable, units, long name) of a column. If it is not in `MEANING`, its suffix gives the unit.

    Examples
    --------
    >>> meaning("film_thickness_m")
    ('film_thickness', 'm', 'film thickness')
    >>> meaning("tank.pressure_pa")
    ('tank.pressure', 'Pa', 'tank: pressure')
    """
    of, dot, last = column.rpartition(".")
    if dot:  # a column of a circuit: component and quantity
        name, unit, what = meaning(last)
        return f"{of}.{name}", unit, f"{of}: {what}"
    known = MEANING.get(column)
    if known is not None:
        return known
    ending = max((ending for ending in _ENDINGS if column.endswith(ending)), key=len, default="")
    name = column.removesuffix(ending)
    return name, _ENDINGS.get(ending, "1"), name.replace("_", " ")


def columns(run: xr.Dataset) -> Columns:
    """Return the columns of a trajectory's file, time first. Variables with other dimensions than time are left out.

    Raises
    ------
    CommandError
        The run is not in SI.
    """
    check_si(run)
    out = {"time_s": run["time"].to_numpy()}
    for name, variable in run.data_vars.items():
        if variable.dims == ("time",):
            out[variable.attrs.get("column", name)] = variable.to_numpy()
    return out


def check_si(run: xr.Dataset) -> None:
    """Raise a CommandError for a run that is not in SI, because names of columns and labels of axes assume SI."""
    for name, variable in run.variables.items():
        if "column" in variable.attrs and variable.attrs.get("units") != (unit := meaning(variable.attrs["column"])[1]):
            what = f"{name} of this run is in {variable.attrs.get('units')}"
            raise CommandError(what, rule=f"the run must be in SI, here in {unit}", remedy="Pass the run in SI.")


def check_target(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Reject a file that cannot be written, before any work is done.

    Raises
    ------
    CommandError
        The suffix is unknown, or the folder does not exist or is not writable.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise CommandError.of("simulation.unknown-suffix", remedy=nearest(path.suffix, suffixes), path=path)
    folder = path.parent
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "does not exist"
        raise CommandError(f"the output folder {folder} {what}", remedy=f"mkdir -p {folder}")
    if not os.access(folder, os.W_OK) or path.is_dir():
        raise CommandError(f"{path} cannot be written", remedy="Choose another folder or name.")
    return path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a temporary name next to `path`, and rename it to `path` at the end.

    A reader never sees an incomplete file.

    Raises
    ------
    CommandError
        The file cannot be written, for instance on a full disk. The temporary file is removed.
    """
    temporary = path.with_name(f".pneudrive-{secrets.token_hex(8)}{path.suffix}")  # random: no link waits under it
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error).replace(str(temporary), str(path))
        raise CommandError(f"{path} cannot be written: {why}") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(target: Path, text: str, encoding: str = "utf-8") -> Path:
    """Write a text file with `whole`, and return its path."""
    with whole(target) as temporary:
        temporary.write_text(text, encoding=encoding)
    return target


def save(run: xr.Dataset, path: str | Path) -> Path:
    """Write a trajectory as Parquet, CSV or netCDF, as the suffix of `path` states.

    Parameters
    ----------
    run : xarray.Dataset
        Run of `pneudrive.simulate`.
    path : path-like
        ``.parquet``, ``.csv`` or ``.nc``. Parquet and netCDF also store the provenance; CSV does not.

    Raises
    ------
    CommandError
        The suffix is unknown, or the file cannot be written.

    Warns
    -----
    PneudriveWarning
        Parquet and CSV leave out variables with other dimensions than time, such as derivatives.
    """
    target = check_target(path)
    check_si(run)
    if target.suffix.lower() == ".nc":
        flat = run.copy()
        for key, value in stored_beside(run.attrs, target.parent).items():
            is_plain = isinstance(value, str | int | float)
            flat.attrs[key] = value if is_plain else json.dumps(value, default=str)
        numbers = [str(name) for name, v in flat.variables.items() if v.ndim and v.dtype.kind in "iuf"]
        checked = {name: {"fletcher32": True} for name in numbers}
        # In memory first: HDF5 crashes the process when the disk is full.
        image = flat.to_netcdf(engine="h5netcdf", encoding=checked)
        with whole(target) as temporary:
            temporary.write_bytes(image)
        return target
    if left_out := [str(name) for name, variable in run.data_vars.items() if variable.dims != ("time",)]:
        warn(
            f"{target.name} leaves out {', '.join(left_out)}: a table has only the dimension time. Use the suffix .nc."
        )
    return save_columns(columns(run), run.attrs, target)


def save_columns(table: Mapping[str, Array], provenance: Keyed, path: str | Path) -> Path:
    """Write columns with units in their names as Parquet or CSV."""
    import polars as pl

    target = check_target(path, (".parquet", ".csv"))
    metadata = {"pneudrive": json.dumps(stored_beside(provenance, target.parent), default=str)}
    write_frame(pl.DataFrame(dict(table)), target, metadata)
    return target


def write_frame(frame: pl.DataFrame, target: Path, metadata: dict[str, str] | None = None) -> None:
    """Write a table as Parquet or CSV, as the suffix of `target` states. Only Parquet keeps the metadata.

    Raises
    ------
    CommandError
        The file cannot be written.
    """
    import polars as pl

    with whole(target) as temporary:
        try:
            if target.suffix.lower() == ".csv":
                texts = pl.col(pl.String).map_elements(spreadsheet_text, return_dtype=pl.String)
                frame.with_columns(texts).rename(spreadsheet_text).write_csv(temporary)
            else:
                temporary.write_bytes(sealed_parquet(frame, metadata or {}))
        except pl.exceptions.ComputeError as error:  # polars reports a full disk by this error
            raise OSError(str(error)) from None


def column_names(path: Path, kind: ErrorKind = RecordingError) -> list[str]:
    """Return the names of the columns in a file of one of the `SUFFIXES`.

    Raises
    ------
    PneudriveError
        The file does not exist, or is damaged. For a CSV file, the error has the class `kind`.
    """
    from pneudrive.files.tables import open_table

    suffix = path.suffix.lower()
    return csv_names(path, kind) if suffix == ".csv" else open_table(path, TABLES[suffix]).names


def columns_in(path: str | Path, asked: Iterable[str]) -> list[str]:
    """Return the columns in `asked` that a file written by `save` contains; empty for another kind of file.

    Raises
    ------
    RecordingError
        The file does not exist, or a Parquet or netCDF file is damaged.
    """
    path = Path(path)
    names = column_names(path) if path.suffix in SUFFIXES else ()
    return [column for column in asked if _name_in(path, column) in names]


def read_columns(
    path: str | Path, wanted: Iterable[str], rows: tuple[int, int] | None = None, table: Table | None = None
) -> Columns:
    """Read columns of a file that `save` wrote.

    Parameters
    ----------
    path : path-like
    wanted : iterable of str
        Names of columns in the file, with the unit as in CSV and Parquet, even for netCDF.
    rows : tuple of int, optional
        First row and the row after the last, only for Parquet; None: all rows.
    table : Table, optional
        The file, if it is already open.

    Returns
    -------
    dict
        Name -> values, float64, shape (n,).

    Raises
    ------
    RecordingError
        The file is damaged, or a column does not hold numbers.
    """
    import numpy as np
    import polars as pl

    from pneudrive.files.tables import open_table

    path, wanted = Path(path), list(wanted)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        frame = read_csv(path, dict.fromkeys(wanted, pl.Float64), RecordingError, wanted)
        return {name: frame[name].to_numpy() for name in wanted}
    names = {name: _name_in(path, name) for name in wanted}
    found = (table or open_table(path, TABLES[suffix])).get(names.values(), rows)
    for values in found.values():
        if values.ndim != 1 or values.dtype.kind not in "iuf":
            shown = f"{values.dtype}, {values.shape}"
            raise RecordingError("a column of the file holds no numbers", where=str(path), value=shown)
    return {name: np.asarray(found[there], dtype=float) for name, there in names.items()}


def _name_in(path: Path, column: str) -> str:
    """Return the name of a column in the file. Names of netCDF variables do not contain the unit."""
    return meaning(column)[0] if path.suffix.lower() == ".nc" else column


def attributes(run: xr.Dataset) -> Plain:
    """Return the attributes of a run in the form of `pneudrive.simulate`, even for a run from netCDF.

    netCDF stores lists and tables as JSON.
    """
    out = dict(run.attrs)
    for name in TABLE["structured"]:
        if isinstance(out.get(name), str):
            with suppress(ValueError):
                out[name] = json.loads(out[name])
    return out
