"""The friction map: one row per recording, speed level and direction."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.csv_tables import read_csv
from pneudrive.files.tables import open_table
from pneudrive.trajectory import check_target, write_frame

if TYPE_CHECKING:
    import xarray as xr

# Column -> (unit, meaning), in the order of the files; the labels of the recordings follow them.
COLUMNS: dict[str, tuple[str, str]] = {
    "recording": ("", "name of the recording"),
    "direction": ("1", "+1 where position grows, -1 where it falls"),
    "velocity_m_s": ("m/s", "mean speed in the window, with the sign of the direction"),
    "pressure_a_pa": ("Pa", "mean absolute pressure in chamber a"),
    "pressure_b_pa": ("Pa", "mean absolute pressure in chamber b"),
    "balance_n": ("N", "mean of force + p_a A_a - p_b A_b - p_ambient (A_a - A_b) - m a - weight"),
    "friction_n": ("N", "half the difference of both directions at equal position, positive against motion"),
    "offset_n": ("N", "half the sum of both directions at equal position"),
    "stderr_n": ("N", "statistical standard uncertainty of friction_n"),
    "u_systematic_n": ("N", "systematic standard uncertainty of friction_n"),
    "samples": ("1", "samples that entered the mean"),
    "strokes": ("1", "strokes that entered the mean"),
    "position_from_m": ("m", "lower end of the window"),
    "position_to_m": ("m", "upper end of the window"),
    "breakaway_n": ("N", "median peak of friction after reversal, NaN where no peak is usable"),
    "dwell_s": ("s", "median time at rest before the stroke"),
    "loading_rate_n_s": ("N/s", "median rate at which friction rises after reversal"),
    "flags": ("", "comma separated names of what was found"),
}
_TEXT = {"recording", "flags"}
_WHOLE = {"direction", "samples", "strokes"}


@dataclass(frozen=True)
class MapRow:
    """One row, see ``COLUMNS``; ``labels`` are those of its recording."""

    recording: str
    direction: int
    velocity_m_s: float
    pressure_a_pa: float
    pressure_b_pa: float
    balance_n: float
    friction_n: float
    offset_n: float
    stderr_n: float
    u_systematic_n: float
    samples: int
    strokes: int
    position_from_m: float
    position_to_m: float
    breakaway_n: float
    dwell_s: float
    loading_rate_n_s: float
    flags: str
    labels: dict[str, str] = field(default_factory=dict)


def to_dataset(rows: list[MapRow]) -> xr.Dataset:
    """Rows as a Dataset with one dimension ``row`` and a unit on every variable; each label is a column of texts."""
    found = columns_to_dataset({name: [getattr(row, name) for row in rows] for name in COLUMNS})
    names = dict.fromkeys(name for row in rows for name in row.labels)
    labels = {name: np.array([row.labels.get(name, "") for row in rows], dtype=object) for name in names}
    about = {"units": "", "long_name": "label of the recording"}
    return found.assign({name: ("row", values, about) for name, values in labels.items()})


def columns_to_dataset(columns: dict[str, list | np.ndarray]) -> xr.Dataset:
    """Columns of equal length as a friction map."""
    import xarray as xr

    variables = {}
    for name, (unit, meaning) in COLUMNS.items():
        kind = object if name in _TEXT else np.int64 if name in _WHOLE else np.float64
        variables[name] = ("row", np.asarray(columns[name], dtype=kind), {"units": unit, "long_name": meaning})
    return xr.Dataset(variables, attrs={"title": "friction map"})


def write_map(friction_map: xr.Dataset, path: str | Path) -> Path:
    """Write map.parquet or map.csv, by suffix: the columns of ``COLUMNS``, and after them the labels.

    Raises
    ------
    CommandError
        Another suffix, or a folder that cannot be written to.
    """
    import polars as pl

    path = check_target(path, (".parquet", ".csv"))
    names = [*COLUMNS, *(str(name) for name in friction_map.data_vars if name not in COLUMNS)]
    columns = {name: friction_map[name].to_numpy().tolist() for name in names}
    frame = pl.DataFrame(
        {n: pl.Series(n, v, dtype=_polars_type(n) if n in COLUMNS else None) for n, v in columns.items()}
    )
    write_frame(frame, path)
    return path


def read_map(path: str | Path) -> xr.Dataset:
    """Read a friction map from map.parquet or map.csv; further columns, labels such as a seal or a day, are kept.

    Raises
    ------
    RecordingError
        No such file, not such a table, or columns missing.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        table = open_table(path, "parquet")
        columns = table.get(table.names)
    else:
        frame = read_csv(path, {name: _polars_type(name) for name in COLUMNS}, RecordingError)
        columns = {name: frame[name].to_numpy() for name in frame.columns}
    missing = [name for name in COLUMNS if name not in columns]
    if missing:
        remedy = "take the map that pneudrive characterise writes"
        raise RecordingError(f"the friction map lacks {', '.join(missing)}", where=str(path), remedy=remedy)
    found = columns_to_dataset({name: _checked(name, columns[name], path) for name in COLUMNS})
    own = {name: values for name, values in columns.items() if name not in COLUMNS}  # labels that a user added
    return found.assign(
        {n: ("row", values.astype(object) if values.dtype.kind == "U" else values) for n, values in own.items()}
    )


def _checked(name: str, values: np.ndarray, path: Path) -> np.ndarray:
    """Give a column of a file as the map holds it."""
    if name in _TEXT:
        return np.array([str(v) if v is not None else "" for v in values.tolist()], dtype=object)
    if values.dtype.kind not in "iuf" or (name in _WHOLE and not np.all(values == np.floor(values))):
        rule = "whole numbers" if name in _WHOLE else "numbers"
        shown = f"{values.dtype}, {values[:3].tolist()}"
        raise RecordingError(f"column {name} of the friction map holds no {rule}", where=str(path), value=shown)
    return values


def _polars_type(name: str):  # noqa: ANN202 - polars is imported on use
    import polars as pl

    return pl.String if name in _TEXT else pl.Int64 if name in _WHOLE else pl.Float64
