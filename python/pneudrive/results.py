"""Reading of results and descriptions from any file or folder, and comparison of two results of the same kind."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import polars as pl
import xarray as xr

from pneudrive.arrays import Array, ArrayPair, Columns, Keyed, Plain
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.control.benchmarks import read_comparison
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files import toml
from pneudrive.describe.files.load import load_described
from pneudrive.describe.system import values_of
from pneudrive.describe.tables.valve_flow import NEEDLE, conductance_key
from pneudrive.describe.tank import Tank
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.estimate.estimates import whole_interval
from pneudrive.figures import Axis, Band, Figure, Line, Look, Panel, Rule, label_of
from pneudrive.files.content import kind_of_folder, kind_of_toml
from pneudrive.files.inputs import located
from pneudrive.files.tables import open_table
from pneudrive.friction.campaign.characteristics import campaign_friction
from pneudrive.friction.friction_map import groups_of, read_map
from pneudrive.identify.base import Fit
from pneudrive.identify.files import common, read_fit
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import FrictionFit
from pneudrive.identify.volume import Regulator
from pneudrive.lazy_names import upper
from pneudrive.numbers import places, plain, with_u
from pneudrive.report.recordings import map_view
from pneudrive.repr_tables import Card, Shown
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import NO_RECORDING, find_layout, load_recording
from pneudrive.simulation.simulate import Run
from pneudrive.simulation.trajectory import SUFFIXES, attributes, column_names, meaning, read_columns
from pneudrive.sizing.result import SUMMARY, SizingResult, in_words
from pneudrive.sizing.task import SizingTask
from pneudrive.units import TABLE, in_unit, readable
from pneudrive.validate.validation import CHANNELS
from pneudrive.views import ShownCurve, ShownValue, View, Viewed

#: Column -> kind of the table with this column.
_MARKS = {"law": "comparison of controllers", "friction_n": "friction map", "time_s": "run", "member": "ensemble"}
MOST_PANELS, POINTS = 4, 61  # pairs of curves in a figure; points of a fitted curve
COMPARED = (Look("black"), Look("orange", "--", "s"))  # looks of both results
ONE_SIDED = " The differences contain the force sensor's zero error; the intervals contain its estimate from the maps."
APART = " The laws are not compared: the maps have no common speed and pressures. Measure both at the same levels."
SHOWN_PLACES = 5  # points of a curve in a table
JOINT = 1.5  # factor from a band of 95 % at one place to that of about 17 places together (Bonferroni)
SAME_PA = 1.0  # difference of two pressures that is only rounding
SAME_LEVEL = 0.05  # largest relative difference of two speeds of the same level
NARROW = 3.0  # ratio of speeds below which friction fits are compared over the pressure
_NUMBER = re.compile(r"([-+]?\d[\d.]*(?:e[-+]?\d+)?)(?: (.+))?")


@dataclass(frozen=True, repr=False, eq=False)
class StoredResult(Viewed):
    """Result stored as plain data in a folder or a file.

    Attributes
    ----------
    kind : str
        ``"validation"`` or ``"characterisation"``.
    path : Path
    content : mapping
        Stored content.
    """

    kind: str
    path: Path
    content: Keyed

    def view(self) -> View:
        """Return the stored values, curves and sentences.

        Raises
        ------
        CommandError
            A file lacks values that pneudrive writes.
        """
        try:
            if self.kind == "characterisation":
                return self._map_and_fits()
            return upper("validation_view")(self.content, self._run_of)
        except (KeyError, TypeError) as error:
            rule = f"a {self.kind} as pneudrive wrote it"
            raise CommandError(
                f"{self.path} is incomplete: {error}", rule=rule, remedy=f"Repeat the {self.kind}."
            ) from None

    def _run_of(self, number: int) -> Columns | None:
        """Return the columns of the run in a validation record; None if the file of the run is missing."""
        names = [name if run == "" else f"{run}.{name}" for run in ("", "free", "restarted") for name in CHANNELS]
        path = self.path.parent / self.content["record"][number].get("run", "")
        return read_columns(path, ["time_s", *names]) if path.is_file() else None

    def _map_and_fits(self) -> View:
        """Return the view of a friction map with the values of all fits. The fits of the map's groups are drawn."""
        fits, table = self.content["fits"], self.content["map"]
        rows = [
            replace(row, key=f"{name}: {row.key}", label=f"{name}: {row.label}")
            for name, fit in fits.items()
            for row in fit.view().rows
        ]
        groups = list(dict.fromkeys(group.assembly for group in groups_of(table)))
        names = {group: "fit" if len(groups) == 1 else Path(fit_file(group)).stem for group in groups}
        with_law = {name: fit for name, fit in fits.items() if hasattr(fit, "law")}
        laws = {group: {with_law[name].law: with_law[name]} for group, name in names.items() if name in with_law}
        return replace(map_view(table, laws), rows=rows)


#: Kind of a file or a folder -> function that reads it.
_READERS: dict[str, Callable[[Path], Any]] = {
    "campaign": campaign_friction,
    "comparison": read_comparison,
    "sizing": SizingResult.load,
    "tank": Tank.load,
    "regulator": Regulator.load,
    "drive": lambda path: load_described(str(path)),
    "circuit": lambda path: load_described(str(path)),
    "task": SizingTask.load,
    "protocol": read_protocol,
    "layout": Layout.load,
}


def load(path: str | Path) -> Any:  # noqa: ANN401 - one class for each kind
    """Read a result or a description. The kind is recognised from the content.

    Parameters
    ----------
    path : path-like
        File or folder written by pneudrive, a description, ``catalogue:NAME``, or a recording of a rig with its
        ``layout.toml``.

    Returns
    -------
    object
        A Drive, Circuit, Tank, Regulator, SizingTask, Protocol, Layout or `Recording`; a fit of any kind; a sizing; an
        evaluated campaign; a comparison of controllers; a run, a friction map or an ensemble as `xarray.Dataset`; a
        validation or a characterisation as `StoredResult`.

    Raises
    ------
    PneudriveError
        The path does not exist, has no known kind, or is damaged.

    Examples
    --------
    >>> import pneudrive as pn
    >>> pn.load("catalogue:reference").name
    'Reference rodless drive'
    """
    if str(path).startswith("catalogue:"):
        return Drive.load(path)
    path = Path(path)
    readers = {".toml": _load_toml} | dict.fromkeys(SUFFIXES, _load_table)
    read = _load_folder if path.is_dir() else readers.get(path.suffix)
    result = read(path) if read is not None and path.exists() else None
    if result is None and path.is_file() and path.suffix not in NO_RECORDING:
        layout = find_layout(path)
        result = load_recording(path, layout) if layout is not None and layout.kind == "rig" else None
    if result is None:
        raise CommandError(
            f"{path} is not a result" if path.exists() else f"there is no {path}",
            rule="a file (.toml, .parquet, .csv, .nc) or a folder that pneudrive wrote",
            remedy="A report or a data sheet is a page: give the drive, fit or folder from which it was made.",
        )
    return result


def _load_folder(path: Path) -> Any:  # noqa: ANN401
    kind = "sizing" if (path / SUMMARY).is_file() else kind_of_folder(path)
    if kind in _READERS:
        return _READERS[kind](path)
    if (path / "map.parquet").is_file():
        fits = {file.stem: read_fit(file) for file in sorted(path.glob("fit*.toml"))}
        return StoredResult("characterisation", path, {"map": read_map(path / "map.parquet"), "fits": fits})
    if members := sorted(path.glob("members-*.parquet")):
        return _dataset(pl.concat([_frame(file)[0] for file in members]), {})
    return next((load(path / name) for name in ("validation.toml", "run.parquet") if (path / name).is_file()), None)


def _load_toml(path: Path) -> Any:  # noqa: ANN401
    tables, _ = toml.read(path, CommandError)
    if "verdict" in tables and "record" in tables:
        return StoredResult("validation", path, tables)
    kind = kind_of_toml(path)
    if kind == "other" and "kind" not in tables and {"drive", "friction"} & tables.keys():
        kind = "drive"  # an incomplete drive file: its message names the missing tables
    return _READERS.get(kind, read_fit)(path)


def _load_table(path: Path) -> Any:  # noqa: ANN401
    names = column_names(path, CommandError)
    kind = next((kind for column, kind in _MARKS.items() if {column, column.removesuffix("_s")} & {*names}), "")
    if kind == "comparison of controllers":
        return read_comparison(path.parent)
    if kind == "friction map":
        return read_map(path)
    if path.suffix == ".nc" and kind:
        data = xr.load_dataset(path, engine="h5netcdf")  # the names were read before, in a process that may crash
        return data.assign_attrs(located(attributes(data), path.parent))
    if kind == "run":
        frame, provenance = _frame(path)
        return Run({name: frame[name].to_numpy() for name in frame.columns}, provenance).dataset()
    return _dataset(*_frame(path)) if kind else None


def _frame(path: Path) -> tuple[pl.DataFrame, Plain]:
    """Return the numeric columns and the provenance of a table that pneudrive wrote."""
    if path.suffix == ".csv":
        names = [name for name in column_names(path, CommandError) if name != "reason"]
        return pl.DataFrame(read_columns(path, names)), {}
    table = open_table(path, "parquet")
    frame = {name: values for name, values in table.get(table.names).items() if values.dtype.kind in "iuf"}
    return pl.DataFrame(frame), located(json.loads(table.metadata.get("pneudrive", "{}")), path.parent)


def _dataset(frame: pl.DataFrame, attrs: Plain) -> xr.Dataset:
    """Return the members of an ensemble as a data set."""
    variables = {}
    for column in frame.columns:
        name, unit, words = meaning(column)
        variables[name] = ("member", frame[column].to_numpy(), {"units": unit, "long_name": words})
    return xr.Dataset(variables, attrs=attrs)


def _curve(
    label: str, x: Array, y: Array, axes: tuple[str, str, str, str], band: ArrayPair | None = None
) -> ShownCurve:
    return ShownCurve(label, label, x, y, *axes, band, np.ones(len(x), dtype=bool))


def _fit_pairs(before: FrictionFit, after: FrictionFit) -> Iterator[CurvePair]:
    """Yield the curves of both laws over the common range of speed, or of pressure if the pressure varies more."""
    low, high = common(before, after, "speed_m_s")
    (a, a_most), (b, b_most) = gauges = [common(before, after, f"gauge_{side}_pa") for side in "ab"]
    if low > high or any(least > most + SAME_PA for least, most in gauges):
        return
    side = int(b_most - b >= a_most - a)
    if high < NARROW * low and gauges[side][1] > gauges[side][0] + SAME_PA:
        over = np.linspace(*gauges[side], POINTS)
        speed, axes = np.full(POINTS, math.sqrt(low * high)), (f"gauge pressure of chamber {'ab'[side]}", "Pa")
        yield _law_pair("friction", before, after, over, axes, (speed, a if side else over, over if side else b))
        return
    speeds = np.geomspace(low, high, POINTS) if low < high else np.array([low])
    if not all("stribeck_velocity" in fit.determined for fit in (before, after) if fit.model.stribeck):
        # Between the measured speeds, laws of this shape can differ although both agree with the data.
        old, new = (fit.provenance.get("speed_levels_m_s", ()) for fit in (before, after))
        speeds = np.array([v for v in old if any(abs(v - w) < SAME_LEVEL * v for w in new)])
    for pair in dict.fromkeys(zip(*gauges, strict=True)):
        label = f"a {pair[0] / 1e5:z.2f}, b {pair[1] / 1e5:z.2f} bar gauge"
        yield _law_pair(label, before, after, speeds, ("speed", "m/s"), (speeds, *pair))


def _law_pair(
    label: str,
    before: FrictionFit,
    after: FrictionFit,
    x: Array,
    axes: tuple[str, str],
    at: tuple[Any, Any, Any],
) -> CurvePair:
    """Return the curves of two laws at the given speeds and gauge pressures, with bands and difference.

    The fits are treated as independent. The band of the difference does not include sensor errors that both fits share.
    """
    laws = [fit.predict(*at) for fit in (before, after)]
    names = axes[0], "friction", axes[1], "N"
    first, second = (_curve(label, x, law.friction_n, names, (law.lower_n, law.upper_n)) for law in laws)
    half_n = JOINT * np.hypot(*(law.upper_n - law.friction_n for law in laws))
    zero_n = sum(2.0 * fit.systematic.get("coulomb", 0.0) for fit in (before, after) if _is_one_sided(fit))
    return CurvePair(first, second, x, laws[1].friction_n - laws[0].friction_n, half_n + zero_n)


def _is_one_sided(fit: FrictionFit) -> bool:
    """Return whether a fit uses only one direction. Its friction then contains the zero error of the force sensor."""
    return fit.provenance["direction"] != "both"


def kind_of(result: Any) -> str:  # noqa: ANN401 - any result
    """Return the kind of a result in words."""
    if isinstance(result, xr.Dataset):
        if "characteristic" in result.attrs:
            return "characteristic"
        kinds = {"member": "ensemble", "number": "sensitivity", "time": "run", "row": "friction map"}
        if kinds.keys().isdisjoint(result.dims):
            raise CommandError("this data set is not a result", rule="a run, a friction map or an ensemble")
        return next(kind for name, kind in kinds.items() if name in result.dims)
    return str(getattr(result, "TITLE", "") or getattr(result, "kind", "") or type(result).__name__.lower())


def view_of(result: Any) -> View:  # noqa: ANN401 - any result
    """Return values, curves and sentences of a result.

    Raises
    ------
    CommandError
        The result is a description, which has no view.
    """
    if isinstance(result, xr.Dataset):
        view = result.pneu.view()
        if kind_of(result) != "run":
            return view
        curves, time = [], result["time"].to_numpy()
        for name, column in result.data_vars.items():
            unit, words = str(column.attrs.get("units")), str(name).replace("_", " ")
            if column.dims == ("time",) and unit in ("m", "m/s", "Pa", "N"):
                curves.append(_curve(words, time, column.to_numpy(), ("time", words, "s", unit)))
        return replace(view, curves=curves)
    if hasattr(result, "view"):
        return result.view()
    raise CommandError(f"a {kind_of(result)} has no values to show")


class ValuePair(NamedTuple):
    """A value that differs between two results.

    Attributes
    ----------
    key : str
        Name in the description, or in the result.
    before, after : str
        Values in the same unit; empty if a result does not contain the value.
    interval_before, interval_after : str
        95 % intervals; empty if a value has no interval.
    change : float or None
        (after - before) / |before| in SI. None if a number is unknown, if `before` is 0, or if only one of two
        pressures is a gauge pressure.
    """

    key: str
    before: str
    after: str
    interval_before: str
    interval_after: str
    change: float | None


#: A value of one result: text with unit, text of the 95 % interval, and number in SI.
Compared: TypeAlias = tuple[str, str, float | None]
NO_VALUE: Compared = ("", "", None)


class CurvePair(NamedTuple):
    """One curve from each of two results, and the difference (second - first) with its 95 % half band, in SI."""

    first: ShownCurve
    second: ShownCurve
    x: Array
    difference: Array
    half_band: Array | None

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Yield label, abscissa, difference and its 95 % interval, in usual units.

        A curve with a band has rows at several abscissas, a curve without a band one row at the largest difference.
        """
        (x_size, x_unit), (size, unit) = self.first.units
        most = [int(np.argmax(np.abs(self.difference)))]
        evenly = np.unique(np.linspace(0, len(self.x) - 1, SHOWN_PLACES).round().astype(int))
        for at in most if self.half_band is None else evenly:
            value, half = self.difference[at], math.nan if self.half_band is None else self.half_band[at]
            ends = "" if math.isnan(half) else f"{(value - half) / size:+.3g} .. {(value + half) / size:+.3g}"
            yield self.first.label, f"{self.x[at] / x_size:.3g} {x_unit}", f"{value / size:+.3g} {unit}", ends

    @property
    def differs(self) -> bool:
        """Whether the curves differ; if the band of the difference is known, whether they differ significantly."""
        half = 0.0 if self.half_band is None else np.nan_to_num(self.half_band)
        return bool((np.abs(self.difference) > half).any())

    def sentence(self, names: tuple[str, str]) -> str:
        """Return a sentence: which curve is larger, by how much, and where the difference is significant."""
        if self.half_band is None or not np.isfinite(self.half_band).all():
            return ""
        (x_size, x_unit), (size, unit) = self.first.units
        place = [f"{x / x_size:.3g} {x_unit}" for x in self.x]
        each = zip(abs(self.difference) / size, self.half_band / size, strict=True)
        gap = [with_u(distance, half, unit) for distance, half in each]
        differs, quantity = np.abs(self.difference) > self.half_band, self.first.quantity
        if not differs.any():
            middle = len(gap) // 2
            return f"The data show no difference in {quantity} ({gap[middle]} at {place[middle]}). "
        inside = np.flatnonzero(differs)
        middle, end = inside[len(inside) // 2], inside[-1 if differs[-1] else 0]
        word = "less" if self.difference[end] < 0.0 else "more"
        where = f"from {place[inside[0]]} up" if differs[-1] else f"up to {place[inside[-1]]}"
        text = f"{names[1]} has {word} {quantity} than {names[0]}{'' if differs.all() else f' {where}'}"
        return text + f": {gap[middle]} at {place[middle]}, {gap[end]} at {place[end]}. "


@dataclass(frozen=True, repr=False, eq=False)
class ResultComparison(Shown):
    """Comparison of two results of one kind.

    Attributes
    ----------
    kind : str
    names : tuple of str
    values : tuple of ValuePair
        Values that differ.
    same : int
        Number of equal values.
    curves : tuple of CurvePair
    note : str
        Sentence on the limits of the comparison.
    """

    kind: str
    names: tuple[str, str]
    values: tuple[ValuePair, ...]
    same: int
    curves: tuple[CurvePair, ...]
    note: str = ""

    @property
    def sentence(self) -> str:
        """Number of values and curves that differ, and the value that differs most."""
        count, moved = self.same + len(self.values), sum(pair.differs for pair in self.curves)
        if not count and not self.curves:
            return f"These two results of the kind {self.kind} have no common values or curves."
        if not self.values and not moved:
            return f"No {'curve differs beyond its 95 % interval' if self.curve_rows() else 'value differs'}."
        parts = [f"{len(self.values)} of {count} values"] if count else []
        parts += [f"{moved} of {len(self.curves)} curves"] if self.curves else []
        most = max(self.values, key=lambda pair: abs(pair.change or 0.0), default=None)
        first = f"; largest change: {most.key} {100.0 * most.change:+.3g} %" if most and most.change else ""
        gaps = (pair.sentence(self.names) for pair in self.curves if self.kind == "friction fit")
        alone = sum("" in (value.before, value.after) for value in self.values)
        single = f", {alone} of them in one result only" if alone else ""
        return f"{next(filter(None, gaps), '')}{' and '.join(parts)} differ{single}{first}.{self.note}"

    def rows(self) -> list[tuple[str, ...]]:
        """Return for each pair: key, first value and interval, second value and interval, change in per cent."""
        return [
            (key, before, ends_before, after, ends_after, "" if change is None else f"{100 * change:+.3g}")
            for key, before, after, ends_before, ends_after, change in self.values
        ]

    def figure(self) -> Figure:
        """Return a figure of at most four pairs of curves and their differences with bands; differing pairs come first.

        Raises
        ------
        CommandError
            The results have no curves in common.
        """
        pairs = sorted(self.curves, key=lambda pair: not pair.differs)[:MOST_PANELS]
        if not pairs:
            raise CommandError(f"these two results of the kind {self.kind} have no curves in common")
        panels = []
        for first, second, x, difference, half in pairs:
            sides = list(zip((first, second), self.names, COMPARED, strict=True))
            marks: list[Any] = [Band(c.x, *c.band, look=look) for c, _, look in sides if c.band is not None]
            marks += [Line(c.x, c.y, name, look) for c, name, look in sides]
            across = _axis(first.x_quantity, first.x_unit)
            title = "" if first.label == first.quantity else first.label
            panels.append(Panel(marks, title, across, _axis(first.quantity, first.unit)))
            band = [] if half is None else [Band(x, difference - half, difference + half)]
            gap = [*band, Line(x, difference, look=Look("path")), Rule(y=0.0)]
            panels.append(Panel(gap, f"{self.names[1]} less {self.names[0]}", across, _axis("difference", first.unit)))
        if len(pairs) == 1:
            return Figure(panels, row_in=2.0, share_x="all", heights=(2, 1))
        return Figure(panels, columns=2, share_x="all")

    def curve_rows(self) -> list[tuple[str, ...]]:
        """Return label, abscissa, difference and its 95 % interval for each curve that differs."""
        return [row for pair in self.curves if pair.difference.any() for row in pair.rows()]

    def _card(self) -> Card:
        head = ("value", self.names[0], "95 %", self.names[1], "95 %", "change %")
        curves = ["  ".join(row) for row in self.curve_rows()]
        return Card(self.sentence, head if self.values else (), self.rows(), curves)


def _axis(quantity: str, unit: str) -> Axis:
    return Axis(label_of(quantity, readable(unit)[1]))


def compare_results(first: Any, second: Any, names: tuple[str, str] = ("before", "after")) -> ResultComparison:  # noqa: ANN401
    """Compare two results or descriptions of the same kind: values in the same unit, and curves.

    Parameters
    ----------
    first, second : object or path-like
        Drives, circuits, fits, friction maps, runs, ensembles, sizings, validations or evaluated campaigns, or paths
        for `load`. Differences are `second` minus `first`.
    names : tuple of str
        Names of both results.

    Raises
    ------
    CommandError
        The results have different kinds.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:reference")
    >>> compared = pn.compare_results(drive, drive.replace({"load.mass": "2 kg"}))
    >>> [(pair.key, pair.after) for pair in compared.values]
    [('load.mass', '2 kg')]
    """
    results = [load(each) if isinstance(each, str | Path) else each for each in (first, second)]
    kinds = [kind_of(each) for each in results]
    if kinds[0] != kinds[1]:
        raise CommandError(
            "only results of the same kind can be compared",
            value=f"{kinds[0]} and {kinds[1]}",
            rule="two drives, circuits, fits, maps, runs, sizings, validations, campaigns or ensembles",
        )
    old, new = (_values(each, other) for each, other in (results, results[::-1]))
    pairs = []
    for key in {**old, **new}:
        before, ends_before, si_before = old.get(key, NO_VALUE)
        after, ends_after, si_after = new.get(key, NO_VALUE)
        change, unit = None, before.partition(" ")[2]
        if si_before is not None and si_after is not None:
            if unit and not after.endswith(f" {unit}"):
                with suppress(DescriptionError):  # another quantity, or words
                    after = in_unit(after, unit)
            if si_before != 0.0 and before.endswith(" abs") == after.endswith(" abs"):
                change = (si_after - si_before) / abs(si_before)
        pairs.append(ValuePair(key, before, after, ends_before, ends_after, change))
    different = tuple(p for p in pairs if (p.before, p.interval_before) != (p.after, p.interval_after))
    are_fits = all(isinstance(each, FrictionFit) for each in results)
    if are_fits:
        curves = list(_fit_pairs(*results))
    else:
        of_first, of_second = (() if isinstance(each, Drive | Circuit) else view_of(each).curves for each in results)
        by_key = {curve.key: curve for curve in of_second}
        curves = [_curve_pair(curve, by_key[curve.key]) for curve in of_first if curve.key in by_key]
    shown = tuple(pair for pair in curves if len(pair.x))
    note = ONE_SIDED * any(map(_is_one_sided, results)) + APART * (not shown) if are_fits else ""
    return ResultComparison(kinds[0], names, different, len(pairs) - len(different), shown, note)


def _values(result: Any, other: Any) -> dict[str, Compared]:  # noqa: ANN401 - any results
    """Return the values of a result by key. A nominal flow becomes a conductance if `other` states a conductance."""
    if isinstance(result, Drive | Circuit):
        ends = {key: " … ".join(one.interval) for key, one in (getattr(result, "provenance", None) or {}).items()}
        keys = {v.key for v in values_of(other)}
        values: dict[str, Compared] = {}
        for described in values_of(result):
            key, value = described.key, str(described.value)
            # A nominal flow, Kv or Cv is compared as a conductance if the other description states a conductance.
            size = conductance_key(key)
            if size != key and size in keys:
                name, _, last = size.removeprefix("components.").rpartition(".")  # flow_control.a is flow_control_a
                numbers = result.circuit.components[name.replace(".", "_")].core(0.0)["numbers"]
                number = numbers[last if last in numbers else f"{NEEDLE}{last}"]
                key, value = size, f"{1e8 * number:.4g} dm3/(s bar)"
            values[key] = value, ends.get(key, ""), _number(value)
        return values | {f"connection {each}": ("yes", "", None) for each in getattr(result, "connections", ())}
    view = view_of(result)
    rows = [row for row in view.rows if row.origin != "text"]
    if isinstance(result, Fit):  # as in the report of a fit: the intervals contain the sensor errors
        u = result.systematic
        about = {row.key: (float(row.value), row.interval) for row in rows if row.interval}
        wide = {key: whole_interval(*of, u.get(key, 0.0)) for key, of in about.items()}
        rows = [replace(row, interval=wide.get(row.key)) for row in rows]
    values = {row.key: _compared(row) for row in rows}
    if isinstance(result, SizingResult):  # a table of the view names the parts
        values |= {f"rank {k}.parts": (d.part_names, "", None) for k, d in enumerate(result.by_cylinder, 1)}
        values["verdict"] = result.state, "", None
        if result.miss:
            values["nearest miss"] = f"{in_words(result.miss.parts)}: {result.miss.limit}", "", None
    return values


def _compared(row: ShownValue) -> Compared:
    if isinstance(row.value, str):
        return row.value, "", _number(row.value)
    if not math.isfinite(row.value):
        return NO_VALUE
    size, ends = readable(row.unit)[0], row.interval
    if ends is None or not np.isfinite(ends).all():
        last = row.quantity.rpartition(", ")[2]  # air of a cycle, l ANR
        unit = row.usual_unit or (last if last.removesuffix(" ANR") in TABLE else "")
        return f"{plain(row.value / size)} {unit}".strip(), "", row.value
    digits = places(0.5 * (ends[1] - ends[0]) / size)
    text, *bounds = (f"{value / size:.{digits}f}" for value in (row.value, *ends))
    return f"{text} {row.usual_unit}".strip(), " … ".join(bounds), row.value


def _number(text: str) -> float | None:
    """Return a quantity, such as ``25 mm``, in SI; None for other texts."""
    found = _NUMBER.fullmatch(text)
    if found is None or " of " in text:
        return None
    unit = (found[2] or "").removesuffix(" abs").removesuffix(" gauge").removesuffix(" ANR")
    _, factor, offset = TABLE.get(unit, (unit, 1.0, 0.0))
    return float(found[1]) * factor + offset


def _curve_pair(first: ShownCurve, second: ShownCurve) -> CurvePair:
    """Interpolate two curves at the abscissas of both curves, within their common range."""
    both, x = (first, second), np.unique(np.concatenate([first.x, second.x]))
    low, high = max(curve.x.min() for curve in both), min(curve.x.max() for curve in both)
    x = x[(x >= low) & (x <= high)]
    before, after = (np.interp(x, curve.x, curve.y) for curve in both)
    known = ((curve.x, curve.band) for curve in both if curve.band is not None)
    bands = [np.interp(x, at, (high - low) / 2.0) for at, (low, high) in known]
    return CurvePair(first, second, x, after - before, JOINT * np.hypot(*bands) if len(bands) == 2 else None)
