"""The friction map: one row per recording (or cycle of a campaign), speed level and direction."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.arrays import Array, Ints, Row, by_name
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import RecordingError, package_table
from pneudrive.files.content import read_csv
from pneudrive.files.inputs import INPUTS, located, stored_beside
from pneudrive.files.tables import open_table
from pneudrive.lazy_names import upper
from pneudrive.simulation.trajectory import SUFFIXES, check_target, column_names, write_frame
from pneudrive.views import ShownCurve

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import polars as pl
    import xarray as xr


TABLES = package_table(__file__, "columns.toml")
#: Column -> (unit, meaning), in the order of the files: columns of every map, then further columns of a campaign.
COLUMNS: dict[str, tuple[str, str]] = TABLES["map"]
LEVEL_COLUMNS: dict[str, tuple[str, str]] = TABLES["campaign"]
CYCLE_COLUMNS: Row = TABLES["cycle"]  # column of a cycle -> value of a cycle without it
AMBIENT = "ambient_pressure_pa"
ADDED = (AMBIENT, "strokes_recorded")  # missing from maps of earlier versions
FILE = "file"  # attribute: path of the map


def columns_to_dataset(columns: Mapping[str, Sequence | np.ndarray], about: Mapping = COLUMNS) -> xr.Dataset:
    """Return the columns of equal length as a Dataset with one dimension ``row`` and a unit on every variable.

    Parameters
    ----------
    columns : mapping
        Name -> values; names missing from `about` are left out. ``labels`` has the labels of the recording of each row;
        each label becomes a further variable of texts.
    about : mapping
        Name -> (unit, meaning), in the order of the variables. A variable without a unit is text, and one with the unit
        "1" a whole number.
    """
    import xarray as xr

    variables = {}
    for name, (unit, meaning) in about.items():
        if name in columns:
            kind = {"": object, "1": np.int64}.get(unit, np.float64)
            variables[name] = ("row", np.asarray(columns[name], dtype=kind), {"units": unit, "long_name": meaning})
    labels = columns.get("labels", ())
    for name in dict.fromkeys(name for row in labels for name in row):
        texts = np.array([row.get(name, "") for row in labels], dtype=object)
        variables[name] = ("row", texts, {"units": "", "long_name": "label of the recording"})
    upper("Pneu")  # registers `map.pneu`
    return xr.Dataset(variables, attrs={"title": "friction map"})


def write_map(friction_map: xr.Dataset, path: str | Path) -> Path:
    """Write the map to a Parquet or CSV file, by suffix: the columns of ``COLUMNS``, and after them the labels.

    Only Parquet stores the list of recordings. The path of the file becomes an attribute of the map.

    Raises
    ------
    CommandError
        The suffix is unknown, or the folder cannot be written.
    """
    import polars as pl

    path = check_target(path, (".parquet", ".csv"))
    columns = {str(name): column.to_numpy() for name, column in friction_map.data_vars.items()}
    kinds = {"i": pl.Int64, "f": pl.Float64}
    series = [pl.Series(n, v.tolist(), dtype=kinds.get(v.dtype.kind, pl.String)) for n, v in columns.items()]
    known = stored_beside({INPUTS: friction_map.attrs.get(INPUTS, [])}, path.parent)
    write_frame(pl.DataFrame(series), path, {INPUTS: json.dumps(known[INPUTS])})
    if path.suffix == ".parquet" or FILE not in friction_map.attrs:
        friction_map.attrs[FILE] = str(path.resolve())
    return path


def read_map(path: str | Path) -> xr.Dataset:
    """Read a friction map from map.parquet or map.csv; further columns (labels) are kept.

    Raises
    ------
    RecordingError
        The file does not exist, is not such a table, or lacks columns.
    """
    path, inputs = Path(path), "[]"
    names = column_names(path) if path.suffix in SUFFIXES else ()
    if missing := [name for name in COLUMNS if name not in names and name not in ADDED]:
        few = ", ".join(missing[:3]) + ", ..." * (len(missing) > 3)
        raise RecordingError.of("friction.no_map", where=str(path), missing=few)
    if path.suffix == ".parquet":
        table = open_table(path, "parquet")
        columns, inputs = table.get(table.names), table.metadata.get(INPUTS, "[]")
    else:
        import polars as pl

        kinds = {"": pl.String, "1": pl.Int64}
        types = {name: kinds.get(unit, pl.Float64) for name, (unit, _) in COLUMNS.items()}
        frame = read_csv(path, types, RecordingError)
        columns = {name: frame[name].to_numpy() for name in frame.columns}
    found = columns_to_dataset({n: _checked(n, v, path) for n, v in columns.items() if n in COLUMNS})
    if AMBIENT in columns:
        found.attrs[AMBIENT] = float(found[AMBIENT].mean())
    found.attrs |= {FILE: str(path.resolve()), **located({INPUTS: json.loads(inputs)}, path.parent)}
    own = {name: values for name, values in columns.items() if name not in COLUMNS}  # labels added by a user
    return found.assign(
        {n: ("row", values.astype(object) if values.dtype.kind == "U" else values) for n, values in own.items()}
    )


def _checked(name: str, values: np.ndarray, path: Path) -> np.ndarray:
    """Check a column of a file, and convert it to its type in the map."""
    unit, _ = COLUMNS[name]
    if not unit:
        return np.array([str(v) if v is not None else "" for v in values.tolist()], dtype=object)
    if values.dtype.kind not in "iuf" or (unit == "1" and not np.all(values == np.floor(values))):
        rule = "whole numbers" if unit == "1" else "numbers"
        shown = f"{values.dtype}, {values[:3].tolist()}"
        raise RecordingError(f"column {name} of the friction map must hold {rule}", where=str(path), value=shown)
    return values


# --- Condition of a curve, skipped cycles, and the slopes that pressure pairs determine.

PA_PER_BAR = 1e5
HOUR_S = 3600.0
CHAMBERS = {"a": "chamber a", "b": "chamber b", "sum": "both chambers"}  # by the name of their effect
TOLD = {"both": ("a", "b"), "a": ("a",), "b": ("b",)}  # chambers whose pressure has a separate effect
SAME_SLOPE = 1e-3  # of the largest pressure: pairs nearer to one line do not determine both effects
ALL_RECORDINGS = "all recordings"  # the group of recordings without labels of their assembly
LEVELS = ("mounting", "seal", "drive")  # labels of the assembly: different ones never share a curve
BOTH = 0  # `direction` of half the difference of both directions


@dataclass(frozen=True, order=True)
class Condition:
    """Condition of a curve, in addition to speed and direction.

    Attributes
    ----------
    pressure_a_pa, pressure_b_pa : float
        Absolute pressures, as planned.
    mounting, seal, drive : str
        Levels of the hard-to-change factors; "" for a factor that the campaign does not have.
    """

    pressure_a_pa: float
    pressure_b_pa: float
    mounting: str = ""
    seal: str = ""
    drive: str = ""

    @property
    def levels(self) -> tuple[str, str, str]:
        """Mounting, seal, drive."""
        return self.mounting, self.seal, self.drive

    @property
    def title(self) -> str:
        """Mounting, seal and drive as text, without factors that the campaign does not have."""
        return ", ".join(level for level in self.levels if level)

    def label(self, ambient_pressure_pa: float) -> str:
        """Return a label: gauge pressures in bar, then the title.

        Examples
        --------
        >>> Condition(151325.0, 101325.0, seal="NBR").label(101325.0)
        'a 0.5 bar, b 0 bar, NBR'
        """
        a, b = ((p - ambient_pressure_pa) / PA_PER_BAR for p in (self.pressure_a_pa, self.pressure_b_pa))
        pressures = f"{_tidy(a)} bar in both" if abs(a - b) < 1e-3 else f"a {_tidy(a)} bar, b {_tidy(b)} bar"
        return f"{pressures}, {self.title}" if self.title else pressures


def conditions_of(table: pl.DataFrame) -> list[Condition]:
    """Return the condition of each row of a table of cycles or stops."""
    return [Condition(*row) for row in table.select(field.name for field in fields(Condition)).iter_rows()]


def _tidy(bar: float) -> str:
    return f"{bar:.3g}" if abs(bar) >= 5e-4 else "0"


@dataclass(frozen=True)
class Skipped:
    """A cycle that was left out, and the reason."""

    key: str
    file: str
    reason: str


def group_of(labels: Mapping[str, str]) -> str:
    """Return the name of the assembly, from the labels of mounting, seal and drive.

    Examples
    --------
    >>> group_of({"seal": "NBR", "run": "2"}), group_of({})
    ('NBR', 'all recordings')
    """
    return ", ".join(labels[name] for name in LEVELS if labels.get(name)) or ALL_RECORDINGS


def assemblies_of(table: xr.Dataset) -> list[str]:
    """Return the assembly of each row of a map, from its columns of labels."""
    names = [name for name in LEVELS if name in table]
    columns = [table[name].to_numpy().astype(str).tolist() for name in names]
    rows = zip(*columns, strict=True) if names else [()] * table.sizes["row"]
    return [group_of(by_name(names, row)) for row in rows]


def classify_pressures(pairs: Array) -> str:
    """Return which slopes of friction over pressure the pressure pairs determine.

    The result is ``both`` or a single chamber (``a`` or ``b``). If both pressures are always equal, it is ``sum``. If
    the pairs are on another line, it is ``line``.
    """
    away = pairs - pairs.mean(axis=0)
    scale = max(np.abs(pairs).max(), 1e-12)
    spans = np.ptp(pairs, axis=0)
    if spans[1] < SAME_SLOPE * scale:
        return "a"
    if spans[0] < SAME_SLOPE * scale:
        return "b"
    if np.linalg.svd(away, compute_uv=False)[1] > SAME_SLOPE * scale:
        return "both"
    return "sum" if np.abs(pairs[:, 0] - pairs[:, 1]).max() < SAME_SLOPE * scale else "line"


# --- Groups of rows: one assembly at one pair of pressures.

SAME_PA = 1e4  # chamber pressures that differ by less make one curve


class MapGroup(NamedTuple):
    """Rows of a map with one assembly (mounting, seal, drive) and one pair of chamber pressures.

    Attributes
    ----------
    assembly : str
    rows : ndarray of int
    gauges : ndarray, shape (2,)
        Mean gauge pressures of chambers a and b, in Pa.
    """

    assembly: str
    rows: Ints
    gauges: Array

    @property
    def label(self) -> str:
        """Pressures as text."""
        a, b = map(bar, self.gauges)
        return f"a {a}, b {b} bar gauge"

    def curves(self, table: xr.Dataset) -> list[ShownCurve]:
        """Return friction over speed with U (k = 2), a point for each level.

        Levels with both directions have one value. Levels with a single direction form a curve for each direction.
        """
        import polars as pl

        part = {name: table[name].to_numpy()[self.rows] for name in COLUMNS if name in table}
        single = np.array(["unpaired" in str(flags) for flags in part["flags"]])
        frame = pl.DataFrame(
            {
                "recording": part["recording"].astype(str),
                "direction": np.where(single, part["direction"], BOTH),
                "speed": np.abs(part["velocity_m_s"]),
                "friction": part["friction_n"],
                "reach": 2.0 * np.hypot(np.nan_to_num(part["stderr_n"]), part["u_systematic_n"]),
            }
        )
        levels = frame.group_by("recording", "direction", "friction", maintain_order=True)
        points = levels.agg(pl.col("speed").mean(), pl.col("reach").first()).sort("speed", maintain_order=True)
        curves = []
        for (way,), own in sorted(points.partition_by("direction", as_dict=True).items(), reverse=True):
            x, y, reach = (own[name].to_numpy() for name in ("speed", "friction", "reach"))
            label = f"{self.assembly}: {self.label}" + {1: ", +x", -1: ", -x"}.get(way, "")
            # Curves of two maps with equal set pressures have equal keys, for set pressures in steps of 0.05 bar.
            key = f"{self.assembly}: {np.floor(self.gauges / SAME_PA + 0.25)}, {way}"
            axes = ("speed", "friction", "m/s", "N", (y - reach, y + reach))
            curves.append(ShownCurve(key, label, x, y, *axes, np.ones(x.size, dtype=bool), self.assembly))
        return curves


def groups_of(table: xr.Dataset, most: int | None = None) -> list[MapGroup]:
    """Group the first `most` rows of a map (None: all). Assemblies are in the order of their first rows."""
    table = table.isel(row=slice(most))
    assemblies = np.array(assemblies_of(table))
    # Both pressures of a row are the means of its recording.
    recordings = np.unique(table["recording"].to_numpy().astype(str), return_inverse=True)[1]
    sizes = np.bincount(recordings)
    means = [np.bincount(recordings, table[f"pressure_{side}_pa"].to_numpy()) / sizes for side in "ab"]
    gauges = np.column_stack(means)[recordings] - float(table.attrs.get(AMBIENT, STANDARD_ATMOSPHERE_PA))
    groups = []
    for name in dict.fromkeys(assemblies.tolist()):
        own = np.flatnonzero(assemblies == name)
        groups += [MapGroup(name, own[part], gauges[own[part]].mean(axis=0)) for part in alike(gauges[own])]
    return groups


def alike(pairs: Array) -> list[Ints]:
    """Group rows with similar pressures: they differ by less than `SAME_PA` from the first row of the group."""
    left, out = np.arange(len(pairs)), []
    while len(left):
        near = (np.abs(pairs[left] - pairs[left[0]]) < SAME_PA).all(axis=1)
        out.append(left[near])
        left = left[~near]
    return out


def bar(gauge_pa: float) -> str:
    """Return a gauge pressure in bar as text. Values near zero become zero."""
    return f"{0.0 if abs(gauge_pa) < 0.5 * SAME_PA else gauge_pa / PA_PER_BAR:.3g}"
