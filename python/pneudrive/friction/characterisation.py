"""Characterisation of recordings: all results by one function, and notes on measured and doubtful values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations, product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pneudrive.arrays import Row, evenly
from pneudrive.errors import RecordingError
from pneudrive.estimate.estimates import changed, student
from pneudrive.files.inputs import INPUTS, stored_input
from pneudrive.friction import level as reduction
from pneudrive.friction import pressure
from pneudrive.friction.budget import CLOCKS
from pneudrive.friction.friction_map import AMBIENT, COLUMNS, SAME_PA, columns_to_dataset
from pneudrive.friction.level import Level, RecordingResult
from pneudrive.friction.sentences import named, sentence
from pneudrive.friction.strokes import SampleChoice, Settled, StrokeUse, stroke_notes
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch
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
    for way in (1, -1):
        own = points.filter(pl.col("direction") == way)
        seals, scatter = own["seal"].to_numpy(), own["speed_stderr_m_s"].to_numpy()
        values = np.column_stack([own["velocity_m_s"].abs(), own["pressure_pa"]])
        has_changed = False
        for seal in set(seals):
            members = seals == seal
            has_changed |= changed(values[members, 0], float(np.median(scatter)))
            values[members] -= values[members].mean(axis=0)
        if len(own) >= 3 and has_changed and np.ptp(values[:, 1]) > pressure.MINIMUM_RANGE_PA:
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

    Errors of a source that both levels have are fully correlated, except those of the clocks of loggers.
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
        A row for each speed level, also of seals without a line; columns in `pneudrive.friction.pressure`.
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
    def closures(self) -> tuple[pressure.ClosureFit, ...]:
        """Effective areas and force zero of each seal."""
        return tuple(pressure.fit_closures(self.table))

    @cached_property
    def pressure_lines(self) -> tuple[pressure.PressureLine, ...]:
        """Friction over pressure of each seal."""
        return tuple(pressure.fit_pressure_lines(self.table))

    @cached_property
    def run_spread(self) -> pressure.RunSpread | None:
        """Relative spread between runs; None without repeated runs."""
        return pressure.run_spread(self.table)

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
        if abs(together) > pressure.CONFOUNDED:
            notes.append(sentence("note.confounded", word="falls" if together < 0 else "rises", together=together))
        gauges = [item for level in levels for item in level.gauge_pa.items()]
        under_pressure = {side for side, gauge in gauges if abs(gauge) > pressure.MINIMUM_RANGE_PA}
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
        points += map(pressure.point_of, result.levels)
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
