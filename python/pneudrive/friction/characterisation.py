"""Characterisation of recordings: all results by one function, and notes on measured and doubtful values.

Results over pressure are the effective area and force zero (closure), and lines of friction over pressure.

Both results are computed from a table of points, with a row for each speed level of each recording. The
columns `recording`, `seal` and `run` name the origin of a row.

`pressure_pa` (Pa) is the higher gauge pressure of both chambers. `speed_m_s` (m/s) is the mean speed of both
directions, and `speed_stderr_m_s` the standard error of that mean from the scatter of the strokes.

`friction_n` (N) has the expanded uncertainty U (k = 2) `expanded_n`. `offset_n` is NaN without both directions.
`weight_n` is the weight along the axis.

`gauge_a_pa` (Pa) is the gauge pressure of chamber a, `u_a_pa` its standard uncertainty, and `area_a_m2` (m2) the
nominal area of the chamber. Columns of chamber b have b in place of a.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations, product
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Columns, Interval, NamedNumbers, Row, evenly, groups_by
from pneudrive.errors import RecordingError
from pneudrive.estimate.estimates import Estimate, changed, rms, student
from pneudrive.files.inputs import INPUTS, stored_input
from pneudrive.friction import level as reduction
from pneudrive.friction.friction_map import AMBIENT, COLUMNS, SAME_PA, TABLES, columns_to_dataset
from pneudrive.friction.level import CLOCKS, Level, RecordingResult
from pneudrive.friction.sentences import named, sentence
from pneudrive.friction.strokes import SampleChoice, Settled, StrokeUse, stroke_notes
from pneudrive.lazy_names import upper
from pneudrive.numbers import with_u
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.repr_tables import Shown
from pneudrive.signals.layout import AnyLayout
from pneudrive.signals.load import RecordingFile, digest_of, find_cycles, from_run, is_run, recording_files
from pneudrive.signals.recording import CHANNELS, Recording
from pneudrive.views import View, Viewed

if TYPE_CHECKING:
    import xarray as xr

    Input = Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset


def _speed_with_pressure(found: Characterisation) -> float:
    """Return the correlation of speed and pressure within seals, for the direction with the stronger correlation."""
    level = ("recording", "friction_n")  # the rows of a level have its friction
    rows = pl.DataFrame({n: found.friction_map[n].to_numpy().tolist() for n in (*level, "direction", "velocity_m_s")})
    points, strongest = rows.join(found.table, on=level, maintain_order="left"), 0.0
    speed, both = pl.col("velocity_m_s").abs(), pl.col("speed", "pressure_pa")
    for way in (1, -1):
        own = points.filter(pl.col("direction") == way).with_columns(speed=speed)
        seals, scatter = own.partition_by("seal"), own["speed_stderr_m_s"].to_numpy()
        has_changed = any(changed(seal["speed"].to_numpy(), float(np.median(scatter))) for seal in seals)
        values = own.select(both - both.mean().over("seal")).to_numpy()
        if len(own) >= 3 and has_changed and np.ptp(values[:, 1]) > MINIMUM_RANGE_PA:
            strongest = max(strongest, float(np.corrcoef(values.T)[0, 1]), key=abs)
    return strongest


def _stick_slip_note(level: Level) -> str:
    columns = ("period_s", "step_m", "peak_speed_m_s", "mean_speed_m_s", "stuck_share")
    slips = [row.slip for row in level.table.rows if row.means and row.slip]
    # Behind a soft sensor the piston may stick and slip while the axis moves evenly.
    sliding = [axis for axis, _ in slips if axis.found] or [piston for _, piston in slips if piston and piston.found]
    found = [[getattr(one, name) for name in columns] for one in sliding]
    period_s, step_m, peak_m_s, mean_m_s, stuck = np.median(found, axis=0).tolist()
    speeds = {"peak_mm_s": 1e3 * peak_m_s, "mean_mm_s": 1e3 * mean_m_s, "stuck": 100 * stuck}
    return sentence("note.stick_slip", name=level.recording, period_s=period_s, step_mm=1e3 * step_m, **speeds)


LEAST_SPEEDS = 3  # speed levels of a direction that make its friction a curve over speed
NEAR = 0.1  # speeds within this ratio are compared
BEYOND_U = 0.0455  # probability of a normal value beyond U (k = 2)


def _differences(results: Sequence[RecordingResult]) -> list[str]:
    """Return a note on the two recordings of one assembly that differ most in friction.

    Recordings with several speeds are compared. If there are three or more, only those at equal pressures are compared,
    because pressure changes friction. The 95 % limit of the difference holds for all comparisons together.

    If both levels have the same source of error, its errors are fully correlated, except errors of loggers' clocks.
    """
    every: list[tuple[float, Row]] = []
    for (first, second), way in product(combinations(results, 2), (1, -1)):
        a, b = first.levels[0], second.levels[0]
        is_apart = any(abs(a.gauge_pa[side] - b.gauge_pa[side]) > SAME_PA for side in "ab")
        if a.seal != b.seal or (is_apart and len(results) > 2):
            continue
        ours, others = ([level for level in result.levels if way in level.sides] for result in (first, second))
        if min(len(ours), len(others)) < LEAST_SPEEDS:
            continue
        for one in ours:  # with the level of about the same speed
            other = others[int(np.argmin([abs(level.speed_m_s - one.speed_m_s) for level in others]))]
            if abs(one.speed_m_s - other.speed_m_s) >= NEAR * one.speed_m_s:
                continue
            sources = [
                {e.source: e.friction_n if len(level.sides) == 2 else e.offset_n for e in level.budget}
                for level in (one, other)
            ]
            names = [name for name in sources[0] | sources[1] if name != CLOCKS]
            apart = [sources[0].get(name, 0.0) - sources[1].get(name, 0.0) for name in names]
            clocks = [source.get(CLOCKS, 0.0) for source in sources]
            u_n = float(np.linalg.norm([one.stderr_n, other.stderr_n, *apart, *clocks]))
            off_n = abs(one.friction_n - other.friction_n)
            values = {"first": one.recording, "second": other.recording, "speed_mm_s": 1e3 * one.speed_m_s, "u_n": u_n}
            values |= {"first_n": one.friction_n, "second_n": other.friction_n, "way": "+x" if way > 0 else "-x"}
            values |= {"off_n": off_n, "percent": 100.0 * off_n / abs(one.friction_n)}
            every.append((off_n / u_n, values))
    reach = student(0, 1.0 - BEYOND_U / max(len(every), 1))
    off, values = max(every, key=lambda one: one[0], default=(0.0, {}))
    return [sentence("note.differ", **values, count=len(every), half_n=reach * values["u_n"])] if off > reach else []


KEPT_IN_FULL = 300  # recordings; the samples of a larger campaign are not kept
SHOWN = 24  # number of recordings of a larger campaign whose curves are kept


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Characterisation(Viewed):
    """All results of a characterisation, in SI units and with absolute pressures.

    Attributes
    ----------
    results : tuple of RecordingResult
        One per used recording: ``recording`` is the cleaned Recording with name, sha256, labels, and flags as counts.
        ``strokes`` is a tuple of Stroke (index, direction, start, stop, from_m, to_m, speed_m_s, dwell_s). ``settled``
        is bool with shape (n,), ``balance_n`` has shape (n,), and ``levels`` is a tuple of Level. A Level has
        ``profile`` (Profile: position_m, up_n, down_n, friction_n, offset_n, each (m,); up_strokes_n, down_strokes_n
        (strokes, m); in_window (m,)), ``window_m``, ``friction_n``, ``offset_n``, ``stderr_n``, ``u_systematic_n``,
        ``u_offset_n``, ``expanded_n`` (U, k = 2), ``spreads`` {+1/-1: Spread(strokes, mean_n, deviation_n, stderr_n,
        effective, trend_p, has_trend)}, ``budget`` (tuple of BudgetEntry: source, standard_uncertainty, unit, basis,
        kind, friction_n, offset_n, note), ``peaks`` (tuple of ReversalPeak: direction, friction_n, loading_rate_n_s,
        flags), ``stick_slip`` (tuple of StickSlip, one per stroke), ``flags``, ``rows``.
    friction_map : xarray.Dataset
        One dimension ``row``; the variables of ``friction_map.COLUMNS``.
    closures : tuple of ClosureFit
        Effective area and force zero per seal: group, recordings, areas_m2 {"a"/"b": Estimate(value,
        stderr, low, high)}, nominal_m2, force_zero_n (Estimate), pressure_pa, half_sum_force_n,
        residual_n (points,), degrees_of_freedom, statement.
    pressure_lines : tuple of PressureLine
        Friction against gauge pressure per seal: seal, table (rows of the table below), intercept_n, slope_n_pa,
        covariance, band_pressure_pa, band_mean_n, band_low_n, band_high_n (41,), basis, statement.
    table : polars.DataFrame
        A row for each speed level, also of seals without a line; columns in `pneudrive.friction.characterisation`.
    run_spread : RunSpread or None
        Relative standard deviation between runs; cells (seal, pressure_pa, lowest, highest, relative
        difference). None without repeated runs.
    reading_notes : tuple of str
        Notes on recordings that were left out, not kept in memory, or read part by part. ``notes`` begins with them.
    notes : tuple of str
        Cautions in sentences: identical files, confounded speed and pressure, assumed
        accuracies, inseparable effects.
    skipped : tuple of (str, str)
        Recordings that were left out, and why.
    protocol : str
        "settled" or "source-paper".
    """

    results: tuple[RecordingResult, ...]
    friction_map: xr.Dataset
    table: pl.DataFrame
    reading_notes: tuple[str, ...]
    skipped: tuple[tuple[str, str], ...]
    protocol: str
    stroke_uses: dict[str, StrokeUse]

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The cleaned recordings."""
        return tuple(result.recording for result in self.results)

    @property
    def levels(self) -> tuple[Level, ...]:
        """All speed levels of all recordings."""
        return tuple(level for result in self.results for level in result.levels)

    @property
    def synthetic(self) -> bool:
        """Whether any recording comes from a simulated rig."""
        return any(recording.synthetic for recording in self.recordings)

    @cached_property
    def closures(self) -> tuple[ClosureFit, ...]:
        """Effective areas and force zero of each seal."""
        return tuple(fit_closures(self.table))

    @cached_property
    def pressure_lines(self) -> tuple[PressureLine, ...]:
        """Friction over pressure of each seal."""
        return tuple(fit_pressure_lines(self.table))

    @cached_property
    def run_spread(self) -> RunSpread | None:
        """Relative spread between runs; None without repeated runs."""
        return run_spread(self.table)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Cautions in sentences."""
        levels, results = self.levels, self.results
        speeds = np.abs(self.friction_map["velocity_m_s"].to_numpy()) * 1e3
        notes = [*self.reading_notes, *stroke_notes(self.stroke_uses)]
        notes.append(sentence("note.measured", low=speeds.min(), high=speeds.max()))
        notes += [
            sentence("note.delay", name=result.recording.name, delay=result.delay)
            for result in results
            if result.delay is not None and result.delay.is_clear
        ]
        together = _speed_with_pressure(self)
        if abs(together) > CONFOUNDED:
            notes.append(sentence("note.confounded", word="falls" if together < 0 else "rises", together=together))
        gauges = [item for level in levels for item in level.gauge_pa.items()]
        under_pressure = {side for side, gauge in gauges if abs(gauge) > MINIMUM_RANGE_PA}
        notes += [sentence("note.one_side")] if len(under_pressure) == 1 else []
        notes += self.doubts
        sources = [source for level in levels for source in level.budget]
        assumed = {e.source for e in sources if e.basis == "assumed" and e.friction_n + e.offset_n}
        massless = not any(result.recording.mass_beyond_sensor_kg for result in results)
        assumed |= {"mass between force sensor and piston (`mass_beyond_sensor`): 0 kg"} if massless else set()
        counts = Counter[str]()
        for result in results:
            counts.update(result.recording.flags)
        doubts = {
            "counts": [f"{count} {kind}" for kind, count in counts.items() if count],
            "negative": [level.recording for level in levels if "negative_friction" in level.flags],
            "assumed": sorted(assumed),
            "larger_offset": [level.recording for level in levels if abs(level.offset_n) > level.friction_n],
        }
        notes += [sentence(f"note.{key}", names=", ".join(dict.fromkeys(some))) for key, some in doubts.items() if some]
        notes += _differences(results)
        notes += [line.statement for line in self.pressure_lines]
        notes += [_stick_slip_note(level) for level in levels if "stick_slip" in level.flags]
        return (*notes, *([] if self.closures else [sentence("note.no_closure")]))

    @property
    def doubts(self) -> list[str]:
        """Sentences on physically implausible values: for each flag, values and a check of the first recording."""
        found: dict[str, dict[str, str]] = {}
        for level in self.levels:
            for flag, doubt in level.doubts.items():
                found.setdefault(flag, {}).setdefault(level.recording, doubt)
        of_flags = ((named(doubts), next(iter(doubts.values()))) for doubts in found.values())
        return [sentence("note.check_layout", names=names, doubt=doubt) for names, doubt in of_flags]

    def view(self) -> View:
        """Return the values of each speed level, flags with remedies, and figures of friction and force balance."""
        return upper("characterisation_view")(self)


def characterise_recordings(
    recordings: Input,
    layout: AnyLayout = None,
    protocol: SampleChoice | None = None,
    *,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> Characterisation:
    """Characterise recordings: strokes, friction, offset, uncertainty, closure, lines over pressure.

    Parameters
    ----------
    recordings
        One or several recordings, files or trajectories of ``pn.simulate``.
    layout
        Layout of the files. None: ``layout.toml`` next to each file. Trajectories need no layout.
    protocol
        Selection of samples: ``Settled()`` (default) or ``SourcePaper()``.
    progress, cancel
        As for `pneudrive.progress.Watch`.

    Returns
    -------
    Characterisation
        The results.

    Raises
    ------
    RecordingError, LayoutError
        A file or recording cannot be used. If there are more than `KEPT_IN_FULL` recordings, unusable ones are skipped.
    """
    choice = protocol or Settled()
    watch, (number, sources) = Watch(progress, cancel), _sources(recordings, layout)
    is_large = number > KEPT_IN_FULL
    shown = evenly(number, SHOWN) if is_large else np.arange(number)
    results, rows, points = list[RecordingResult](), list[Row](), list[Row]()
    uses, inputs, skipped = dict[str, StrokeUse](), list[dict[str, str]](), list[tuple[str, str]]()
    seen, long = dict[str, str](), list[str]()
    for place, source in enumerate(sources):
        watch.tell(place, number, "recordings characterised")
        name = source.name
        try:
            if isinstance(source, RecordingFile) and source.span[1] > reduction.LONG_SAMPLES:
                long.append(name)
                result = reduction.extract_long(source, choice, watch)
            else:
                recording = source.read() if isinstance(source, RecordingFile) else source
                digest = digest_of(getattr(recording, channel) for channel in ("time_s", *CHANNELS))
                if digest in seen:  # recordings with equal samples count once
                    skipped.append((name, f"identical to {seen[digest]}"))
                    continue
                result = reduction.extract(recording, choice)
                seen[digest] = name
        except RecordingError as error:
            if not is_large:
                raise
            skipped.append((name, error.what))
            continue
        rows += [row for level in result.levels for row in level.rows]
        points += map(point_of, result.levels)
        uses[name] = result.stroke_use
        inputs.append(stored_input("recording", name, result.recording.source, result.recording.sha256))
        results += [result] if place in shown else []
    watch.tell(number, number, "recordings characterised")
    if not rows:
        raise RecordingError("no recording could be used", value="; ".join(map(": ".join, skipped[:3])))
    friction_map = columns_to_dataset({name: [row[name] for row in rows] for name in (*COLUMNS, "labels")})
    synthetic = any(result.recording.synthetic for result in results)
    ambient = [result.recording.ambient_pressure_pa for result in results]
    friction_map.attrs |= {"protocol": choice.name, "synthetic": synthetic, INPUTS: inputs}
    friction_map.attrs |= {AMBIENT: float(np.mean(ambient))} if ambient else {}
    return Characterisation(
        results=tuple(results),
        friction_map=friction_map,
        table=pl.DataFrame(points, infer_schema_length=None),
        reading_notes=tuple(_reading_notes(len(uses), len(results), skipped, long, large=is_large)),
        skipped=tuple(skipped),
        protocol=choice.name,
        stroke_uses=uses,
    )


def _sources(recordings: Input, layout: AnyLayout) -> tuple[int, Iterable[Recording | RecordingFile]]:
    """Return the number of recordings, and the recordings or their files. Those in memory come first."""
    items: list = [recordings]
    if isinstance(recordings, Iterable) and not (isinstance(recordings, str) or is_run(recordings)):
        items = list(recordings)
    if not items:
        raise RecordingError("no recording is given", remedy="Give at least one recording or file.")
    loaded: list[Recording] = []
    paths: list[str | Path] = []
    for item in items:
        if isinstance(item, str | Path):
            paths.append(item)
        elif isinstance(item, Recording):
            loaded.append(item)
        elif is_run(item):
            loaded.append(from_run(item, f"trajectory-{len(loaded) + 1}" if len(items) > 1 else "trajectory"))
        else:
            raise RecordingError.of("friction.no_recording", value=type(item).__name__)
    files = recording_files(paths, layout) if paths else []
    parts = [find_cycles(file) if file.has_cycles else (np.zeros(1), iter([file])) for file in files]
    count = len(loaded) + sum(numbers.size for numbers, _ in parts)
    return count, chain(loaded, *(sources for _, sources in parts))


def _reading_notes(
    used: int, shown: int, skipped: list[tuple[str, str]], long: list[str], *, large: bool
) -> Iterator[str]:
    """Yield notes on recordings that were left out, not kept in memory, or read part by part."""
    if large:
        yield sentence("note.sampled", count=used, shown=shown)
        if skipped:
            yield sentence("note.not_counted", count=len(skipped), first=skipped[0])
    else:
        yield from (sentence("note.same_samples", name=name, why=why) for name, why in skipped)
    yield from (sentence("note.part_by_part", name=name) for name in long)


# --- Results of several recordings over pressure: effective area and force zero (closure), friction over pressure.

TOGETHER = 0.05  # pressures change together if the rest is below this share
IMPLAUSIBLE_AREA = 0.25  # relative difference from nominal that no tolerance of a bore explains
MINIMUM_RANGE_PA = 2e4  # pressures that differ by less are equal: they give neither area nor slope
# Least ratio of the independent spread of both pressures to the sensors' uncertainty. A noisy regressor biases its
# factor towards zero, by 1 / (1 + RELIABLE**2) at this limit.
RELIABLE = 5.0
BAND_POINTS = 41
SAME_SPEED = 0.02  # controlled speeds closer than this are one level
SHOWN_SPEEDS = 5
CONFOUNDED = 0.7  # correlation of speed and pressure above which their effects are confounded
SPEED_OF_REPEAT = 0.25  # largest difference of speed between repeats without controlled speed
NET = "net"  # name of both areas together
CONTRADICTION = 1e-3  # p-value of groups of residuals below which the line does not hold
SAME_PRESSURE = 0.1  # recordings within this share of their pressure are repeats


def point_of(level: Level) -> Row:
    """Return the row of a speed level in the table of points."""
    recording, gauge = level.motion.recording, level.gauge_pa
    known = {entry.source: entry.standard_uncertainty for entry in level.budget}
    row = {name: getattr(level, name) for name in TABLES["lists"]["point"]} | {"weight_n": recording.weight_n}
    for side in "ab":
        row[f"gauge_{side}_pa"] = gauge[side]
        row[f"u_{side}_pa"] = known.get(f"pressure {side}: common error", 0.0)
        row[f"area_{side}_m2"] = getattr(recording, f"area_{side}_m2")
    return row


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class ClosureFit(Shown):
    """Effective areas and force zero of one group of recordings (one seal, one geometry).

    ``areas_m2`` has an entry for each chamber whose pressure changed, ``nominal_m2`` the areas of the
    layout. If both pressures changed together, the only entry is ``net``: the force of both chambers divided by the
    pressure that changed most. ``force_zero_n`` is the reading of the sensor without friction and pressure.
    For each point, ``pressure_pa`` is the gauge pressure of the chamber that changed most, and ``residual_n`` is the
    residual of the line. Intervals are unbounded without a redundant recording, or if the residuals contradict the
    line.
    """

    group: str
    recordings: tuple[str, ...]
    areas_m2: dict[str, Estimate]
    nominal_m2: dict[str, float]
    force_zero_n: Estimate
    pressure_pa: Array
    half_sum_force_n: Array
    residual_n: Array
    degrees_of_freedom: int
    statement: str

    @property
    def has_interval(self) -> bool:
        """Whether the interval of the force zero is bounded."""
        return self.force_zero_n.low > -np.inf


def fit_closures(points: pl.DataFrame) -> list[ClosureFit]:
    """Fit  F = A_b p_b - A_a p_a + weight + zero  to each group, with gauge pressures.

    Groups in which no pressure changes by more than 0.2 bar, or with fewer than two points, are left out. If both
    pressures change together, only the net area of both is fitted; if their forces cancel within the sensors'
    uncertainty, no area can be determined.
    """
    paired = points.filter(pl.col("offset_n").is_finite(), pl.any_horizontal(pl.col("area_a_m2", "area_b_m2") != 0.0))
    groups = paired.partition_by("seal", "area_a_m2", "area_b_m2", maintain_order=True)
    return [fit for group in groups if (fit := _closure(group)) is not None]


def _closure(points: pl.DataFrame) -> ClosureFit | None:
    seal, nominal = points["seal"][0], {side: points[f"area_{side}_m2"][0] for side in "ab"}
    gauge = {side: points[f"gauge_{side}_pa"].to_numpy() for side in "ab"}
    # Force of the rig against each chamber, by nominal areas: the fit gives a factor on each.
    push = {"a": -nominal["a"] * gauge["a"], "b": nominal["b"] * gauge["b"]}
    unsure = {side: nominal[side] * rms(points[f"u_{side}_pa"].to_numpy()) for side in "ab"}
    factors = _factors(gauge, push, unsure, max(nominal.values()))
    if not factors or len(points) < len(factors) + 1:
        return None
    # Half the sum of the forces of both directions at equal positions does not contain friction.
    offset, weight = points["offset_n"].to_numpy(), points["weight_n"].to_numpy()
    total = offset + push["a"] + push["b"] + weight
    varied = sum(factors, ())
    # A chamber at constant pressure acts with its nominal area.
    force = total - weight - sum(push[side] for side in "ab" if side not in varied)
    matrix = np.column_stack([*(sum(push[s] for s in sides) for sides in factors), np.ones(len(points))])
    solution = np.linalg.lstsq(matrix, force, rcond=None)[0]
    residual = force - matrix @ solution
    dof = len(points) - matrix.shape[1]
    deviation = np.sqrt(residual @ residual / dof) if dof > 0 else np.nan
    errors = deviation * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    doubt = _contradiction(points, residual) if dof > 0 else "few"
    freedom = 0 if doubt else dof
    lead = max(varied, key=lambda side: np.ptp(gauge[side]))
    sizes = {side: nominal[side] for side, *_ in factors}
    if len(factors[0]) == 2:  # the same force follows from many pairs of areas
        sizes = {NET: float(np.std(push["a"] + push["b"]) / np.std(gauge[lead]))}
    estimates = zip(sizes.items(), solution, errors, strict=False)
    areas = {side: _estimate(k * area, error * area, freedom, "m2") for (side, area), k, error in estimates}
    zero = _estimate(solution[-1], errors[-1], freedom, "N")
    parts = []
    for side, area in areas.items():
        off, low, high = (100 * (value / sizes[side] - 1) for value in (area.value, area.low, area.high))
        shown = sentence("closure.area", side=side, area_cm2=area.value * 1e4, off=off)
        parts.append(sentence("closure.area_interval", area=shown, low=low, high=high) if not doubt else shown)
    far = any(abs(area.value / sizes[side] - 1) > IMPLAUSIBLE_AREA for side, area in areas.items())
    why = "implausible" if far else "together" if NET in areas else "one_side" if len(areas) == 1 else None
    end = sentence(f"closure.zero_{doubt or 'interval'}", zero=zero) + (sentence(f"closure.{why}") if why else "")
    return ClosureFit(
        group=seal,
        recordings=tuple(points["recording"]),
        areas_m2=areas,
        nominal_m2=sizes,
        force_zero_n=zero,
        pressure_pa=gauge[lead],
        half_sum_force_n=total,
        residual_n=residual,
        degrees_of_freedom=dof,
        statement=f"{seal}: {', '.join(parts)}; {end}.",
    )


def _contradiction(points: pl.DataFrame, residual_n: Array) -> str:
    """Return "speed" or "recording" if residuals differ between speeds or recordings (one-way F-test), else ""."""
    from scipy.stats import f_oneway

    points = points.with_columns(residual_n=residual_n)
    by_speed = _neighbours(points, "speed_m_s", lambda v: SAME_SPEED * v)
    for name, groups in (("speed", by_speed), ("recording", points.partition_by("recording"))):
        values = [group["residual_n"].to_numpy() for group in groups]
        if 1 < len(groups) < len(points) and f_oneway(*values).pvalue < CONTRADICTION:
            return name
    return ""


def _factors(gauge: Columns, push: Columns, unsure: NamedNumbers, area: float) -> list[tuple[str, ...]]:
    """Return the chambers of each area factor that the data determine: a factor per chamber, one for both, or none."""
    sides = [side for side in ("a", "b") if np.ptp(gauge[side]) > MINIMUM_RANGE_PA]
    if len(sides) < 2:
        return [tuple(sides)] if sides else []
    spread = np.column_stack([push[side] - push[side].mean() for side in sides])
    _, (large, small), axes = np.linalg.svd(spread, full_matrices=False)
    noise = np.array([unsure[side] for side in sides])
    is_apart = small / np.sqrt(len(spread)) > RELIABLE * np.linalg.norm(axes[1] * noise)
    if small > TOGETHER * large and is_apart:
        return [("a",), ("b",)]
    net = push["a"] + push["b"]
    is_visible = np.ptp(net) > MINIMUM_RANGE_PA * area and np.std(net) > RELIABLE * np.linalg.norm(noise)
    return [("a", "b")] if is_visible else []


def _estimate(value: float, stderr: float, dof: int, unit: str) -> Estimate:
    """Return a value with its interval, which is unbounded without a redundant recording."""
    if dof <= 0:
        return Estimate(float(value), -np.inf, np.inf, np.nan, unit)
    return Estimate.of(float(value), float(stderr), dof, unit)


@dataclass(frozen=True)
class RunSpread:
    """Relative standard deviation between runs with equal seal, pressure and speed, pooled over all such groups.

    ``cells`` lists these groups: (seal, pressure in Pa, smallest friction, largest friction, relative difference).
    """

    relative: float
    degrees_of_freedom: int
    cells: tuple[tuple[str, float, float, float, float], ...]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class PressureLine(Shown):
    """Friction = intercept + slope * gauge pressure for one seal.

    ``table`` has a row for each point; ``points`` has these rows as objects.
    ``band_mean_n`` is the line at 41 pressures ``band_pressure_pa``.
    ``band_low_n`` and ``band_high_n`` are the 95 % prediction interval of a further run. ``covariance`` is that of
    (intercept_n, slope_n_pa), and ``slope_interval_n_pa`` is a 95 % interval. ``basis`` states which runs determine the
    spread between runs. These are the runs of this seal (``own``) or of other seals (``pooled``). It is ``unknown``
    without such runs.
    """

    seal: str
    table: pl.DataFrame
    intercept_n: float
    slope_n_pa: float
    slope_interval_n_pa: Interval
    covariance: Array
    band_pressure_pa: Array
    band_mean_n: Array
    band_low_n: Array
    band_high_n: Array
    basis: str
    statement: str

    @property
    def points(self) -> tuple[SimpleNamespace, ...]:
        """Points of the line, with the columns of the table as attributes."""
        return tuple(SimpleNamespace(**row) for row in self.table.iter_rows(named=True))


def run_spread(points: pl.DataFrame) -> RunSpread | None:
    """Return the relative spread between runs; None without repeated runs."""
    cells: list[tuple[str, float, float, float, float]] = []
    squares, freedom = 0.0, 0
    for members in points.partition_by("seal", maintain_order=True):
        # Repeats have about the same pressure and speed.
        for some in _neighbours(members, "pressure_pa", lambda v: SAME_PRESSURE * max(abs(v), 1e4)):
            for cell in _neighbours(some, "speed_m_s", lambda v: SPEED_OF_REPEAT * v):
                runs = cell.partition_by("run", maintain_order=True)
                values = np.array([run["friction_n"].to_numpy().mean() for run in runs])
                if values.size >= 2:
                    mean = float(values.mean())
                    squares += ((values / mean - 1) ** 2).sum()
                    freedom += values.size - 1
                    low, high = float(values.min()), float(values.max())
                    cells.append((cell["seal"][0], cell["pressure_pa"][0], low, high, (high - low) / mean))
    if freedom == 0:
        return None
    return RunSpread(float(np.sqrt(squares / freedom)), freedom, tuple(cells))


def _neighbours(points: pl.DataFrame, column: str, width: Callable[[float], float]) -> list[pl.DataFrame]:
    """Group points by a column. Each value exceeds the lowest value v of its group by at most `width(v)`."""
    points = points.sort(column, maintain_order=True)
    groups = groups_by(points[column].to_list(), lambda lowest, value: value - lowest > width(lowest))
    return [points[group] for group in groups]


def fit_pressure_lines(points: pl.DataFrame) -> list[PressureLine]:
    """Fit the line over pressure to each seal with at least three recordings at two or more pressures.

    If speed was controlled and crossed with pressure, a line is fitted at each of up to five speeds.
    """
    spread = run_spread(points)
    lines = []
    for members in points.partition_by("seal", maintain_order=True):
        groups = _neighbours(members, "speed_m_s", lambda v: SAME_SPEED * v)
        crossed = [group for group in groups if _has_line(group)]
        if len(crossed) >= 2 and sum(map(len, crossed)) >= 0.6 * len(members):
            for i in evenly(len(crossed), SHOWN_SPEEDS):
                speed = 1e3 * crossed[i]["speed_m_s"][0]
                lines.append(_line(f"{members['seal'][0]} at {speed:.3g} mm/s", crossed[i], spread))
        elif _has_line(members):
            lines.append(_line(members["seal"][0], members, spread))
    return lines


def _has_line(points: pl.DataFrame) -> bool:
    return len(points) >= 3 and np.ptp(points["pressure_pa"].to_numpy()) > MINIMUM_RANGE_PA


def _line(title: str, points: pl.DataFrame, spread: RunSpread | None) -> PressureLine:
    names = ("pressure_pa", "friction_n", "speed_m_s", "speed_stderr_m_s")
    pressure, friction, speed, speed_stderr = (points[name].to_numpy() for name in names)
    scale = np.abs(pressure).max()
    matrix = np.column_stack([np.ones(pressure.size), pressure / scale])
    solution = np.linalg.lstsq(matrix, friction, rcond=None)[0]
    residual = friction - matrix @ solution
    dof = pressure.size - 2
    own = residual @ residual / dof
    repeated = spread is not None and any(cell[0] == points["seal"][0] for cell in spread.cells)
    basis = "own" if repeated else "pooled" if spread else "unknown"

    band = np.linspace(min(pressure.min(), 0.0), pressure.max(), BAND_POINTS)
    design = np.column_stack([np.ones(BAND_POINTS), band / scale])
    mean = design @ solution
    single, freedom = np.full(BAND_POINTS, own), float(dof)
    inverse = np.linalg.inv(matrix.T @ matrix)
    variance = own
    if spread is not None:
        # With several runs of this seal, scatter about the line and spread between runs both estimate
        # the deviation of a further recording; the larger one counts. With one run the scatter lacks
        # the spread between runs, so the pooled spread is added.
        between = (spread.relative * np.abs(mean)) ** 2
        typical = np.mean((spread.relative * friction) ** 2)
        single = np.maximum(single, between) if repeated else single + between
        variance = max(own, typical) if repeated else own + typical
        if typical > own:
            freedom = float(spread.degrees_of_freedom + (dof if repeated else 0))
    leverage = np.einsum("ij,jk,ik->i", design, inverse, design)
    half = student(freedom) * np.sqrt(single + variance * leverage)
    unit = np.diag([1.0, 1.0 / scale])
    has_changed = changed(speed, float(np.median(speed_stderr)))
    together = float(np.corrcoef(speed, pressure)[0, 1]) if has_changed else 0.0
    intercept_n, slope_n_pa = float(solution[0]), float(solution[1] / scale)
    covariance = unit @ (inverse * variance) @ unit
    half_n, half_n_pa = (student(freedom) * np.sqrt(np.diag(covariance))).tolist()
    word = "falls" if together < 0 else "rises"
    confounded = sentence("pressure_line.confounded", word=word, together=together)
    return PressureLine(
        seal=title,
        table=points,
        intercept_n=intercept_n,
        slope_n_pa=slope_n_pa,
        slope_interval_n_pa=(slope_n_pa - half_n_pa, slope_n_pa + half_n_pa),
        covariance=covariance,
        band_pressure_pa=band,
        band_mean_n=mean,
        band_low_n=mean - half,
        band_high_n=mean + half,
        basis=basis,
        statement=sentence(
            "pressure_line.line",
            seal=title,
            intercept=with_u(intercept_n, half_n),
            rise=with_u(slope_n_pa * 1e5, half_n_pa * 1e5, "N/bar"),
            interval=sentence(f"pressure_line.{basis}", percent=0.0 if spread is None else 100 * spread.relative),
            confounded=confounded if abs(together) > CONFOUNDED else "",
        ),
    )
