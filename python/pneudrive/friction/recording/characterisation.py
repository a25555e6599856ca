"""Characterisation of recordings: all results by one function."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.friction.friction_map import HASHES, rows_to_dataset
from pneudrive.friction.recording import long_recording
from pneudrive.friction.recording.closure import ClosureFit, fit_closures
from pneudrive.friction.recording.notes import notes_of
from pneudrive.friction.recording.pressure_line import (
    FrictionPoint,
    PressureLine,
    RunSpread,
    fit_pressure_lines,
    run_spread,
)
from pneudrive.friction.recording.summaries import Source, Summary, summarise, summary_of
from pneudrive.friction.reduction.budget import COVERAGE_FACTOR
from pneudrive.friction.reduction.level import Level, RecordingResult, extract
from pneudrive.friction.reduction.settling import SampleChoice, Settled
from pneudrive.friction.reduction.stroke_use import StrokeUse, stroke_notes
from pneudrive.friction.sentences import sentence
from pneudrive.progress import UNWATCHED, Watch
from pneudrive.repr_tables import Card, Shown
from pneudrive.signals.cycles import Cycles, find_cycles, read_cycles
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import RecordingFile, find_long, recording_files
from pneudrive.signals.recording import CHANNELS, Recording
from pneudrive.signals.trajectories import from_run, is_run
from pneudrive.views import ShownValue, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import xarray as xr

    from pneudrive.progress import Flag

KEPT_IN_FULL = 300  # recordings; the samples of a larger campaign are not kept
SHOWN = 24  # number of recordings of a larger campaign whose curves are kept


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Characterisation(Shown):
    """All results of a characterisation. SI, absolute pressures, N.

    Attributes
    ----------
    results : tuple of RecordingResult
        One per used recording: ``recording`` is the cleaned Recording with name, sha256, labels, and flags as counts.
        ``strokes`` is a tuple of Stroke (index, direction, start, stop, from_m, to_m, speed_m_s, dwell_s). ``settled``
        is bool with shape (n,), ``balance_n`` has shape (n,), and ``levels`` is a tuple of Level. A Level has
        ``profile`` (Profile: position_m, up_n, down_n, friction_n, offset_n, each (m,); up_strokes_n, down_strokes_n
        (strokes, m); in_window (m,)), ``window_m``, ``friction_n``, ``offset_n``, ``stderr_n``, ``u_systematic_n``,
        ``u_offset_n``, ``expanded_n`` (U, k = 2), ``spreads`` {+1/-1: Spread(strokes, mean_n, deviation_n, stderr_n,
        effective, slope_n, trend_p, has_trend)}, ``stroke_friction_n`` and ``stroke_times_s`` {+1/-1: (strokes,)} for
        drift, ``budget`` (tuple of BudgetEntry: source, standard_uncertainty, unit, basis, kind, friction_n, offset_n,
        note), ``peaks`` (tuple of ReversalPeak: direction, time_s, position_m, friction_n, sliding_n, excess_n,
        significant, dwell_s, loading_rate_n_s, rise_samples, flags), ``stick_slip`` (tuple of StickSlip, one per
        stroke), ``flags``, ``rows``.
    friction_map : xarray.Dataset
        One dimension ``row``; the variables of ``friction_map.COLUMNS``.
    closures : tuple of ClosureFit
        Effective area and force zero per seal: group, recordings, areas_m2 {"a"/"b": Estimate(value,
        stderr, low, high)}, nominal_m2, force_zero_n (Estimate), pressure_pa, half_sum_force_n,
        residual_n (points,), residual_deviation_n, degrees_of_freedom, statement.
    pressure_lines : tuple of PressureLine
        Friction against gauge pressure per seal: seal, points (tuple of FrictionPoint: recording, seal,
        run, pressure_pa, speed_m_s, friction_n, expanded_n), intercept_n, slope_n_pa, covariance,
        band_pressure_pa, band_mean_n, band_low_n, band_high_n (41,), basis, statement.
    points : tuple of FrictionPoint
        All points, also of seals without a line.
    run_spread : RunSpread or None
        Relative standard deviation between runs; cells (seal, pressure_pa, lowest, highest, relative
        difference). None without repeated runs.
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
    closures: tuple[ClosureFit, ...]
    pressure_lines: tuple[PressureLine, ...]
    points: tuple[FrictionPoint, ...]
    run_spread: RunSpread | None
    notes: tuple[str, ...]
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

    def view(self) -> View:
        """Return the values of each speed level, and the notes; the curves are in ``recorded_characteristics``."""
        rows = []
        for result in self.results:
            for level in result.levels:
                one = len(result.levels) == 1
                rows += _shown(level, level.recording if one else f"{level.recording}#{level.index + 1}")
        title = f"{len(self.results)} recordings ({'simulated' if self.synthetic else 'measured'})"
        return View(title, tuple(rows), notes=self.notes)

    def _card(self) -> Card:
        return self.view().card()


def _shown(level: Level, label: str) -> Iterator[ShownValue]:
    """Return speeds, strokes, friction and offset with U (k = 2), and flags."""
    for direction, side in level.sides.items():
        sign = "+x" if direction > 0 else "-x"
        yield ShownValue(f"{label}.speed{sign}", label, f"speed {sign}", abs(side.velocity_m_s), "m/s")
    used = sum(side.strokes for side in level.sides.values())
    yield ShownValue(f"{label}.strokes", label, "strokes", f"{used} of {len(level.strokes)}")
    for name, value, u in (
        ("friction", level.friction_n, level.expanded_n),
        ("offset", level.offset_n, COVERAGE_FACTOR * level.u_offset_n),
    ):
        yield ShownValue(f"{label}.{name}", label, name, value, "N", (value - u, value + u))
    yield ShownValue(f"{label}.flags", label, "flags", " ".join(level.flags))


def characterise_recordings(
    recordings: Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset,
    layout: Layout | str | Path | None = None,
    protocol: SampleChoice | None = None,
    *,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> Characterisation:
    """Characterise recordings: strokes, friction, offset, uncertainty, closure, lines over pressure.

    Parameters
    ----------
    recordings
        Recordings, files or trajectories (what ``pn.simulate`` returns), or one of them.
    layout
        How files are read. None: ``layout.toml`` next to each file. Trajectories need none.
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
        If a file or recording cannot be used.
    """
    choice = protocol if protocol is not None else Settled()
    watch = Watch(progress, cancel)
    loaded, sources = _sources(recordings, layout)
    number = len(loaded) + sum(len(s) if isinstance(s, Cycles) else 1 for s in sources)
    if number <= KEPT_IN_FULL:
        most = long_recording.LONG_SAMPLES
        as_long = [find_long(source, most) if isinstance(source, RecordingFile) else None for source in sources]
        long = [file for file in as_long if file is not None]
        loaded += _read([source for source, one in zip(sources, as_long, strict=True) if one is None], watch)
        places, skipped = _count_once((r.name, _digest(r), "") for r in loaded)
        unique = [loaded[place] for place in places]
        notes = [sentence("note.same_samples", name=name, why=why) for name, why in skipped]
        results = tuple(extract(recording, choice) for recording in watch.each(unique, "recordings characterised"))
        results += tuple(long_recording.extract_long(file, choice, watch) for file in long)
        notes += [sentence("note.part_by_part", name=one.file.name) for one in long]
        return _assemble(results, [summary_of(result) for result in results], skipped, notes, choice)
    summaries = [summary_of(extract(recording, choice)) for recording in loaded] + summarise(sources, choice)
    places, skipped = _count_once((s.name, s.digest, s.reason) for s in summaries)
    kept = [summaries[place] for place in places]
    if not kept:
        raise RecordingError("no recording could be used", value="; ".join(f"{n}: {why}" for n, why in skipped[:3]))
    notes = [sentence("note.not_counted", count=len(skipped), first=skipped[0])] if skipped else []
    results = tuple(extract(recording, choice) for recording in _sample(loaded, sources, {s.name for s in kept}))
    notes.insert(0, sentence("note.sampled", count=len(kept), shown=len(results)))
    return _assemble(results, kept, skipped, notes, choice)


def _sources(
    recordings: Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset,
    layout: Layout | str | Path | None,
) -> tuple[list[Recording], list[Source]]:
    """Split the input into recordings and files."""
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
            raise RecordingError(
                "this is not a recording", value=type(item).__name__, rule="a Recording, a file or a trajectory"
            )
    files = recording_files(paths, layout) if paths else []
    sources: list[Source] = [find_cycles(f.path, f.layout) if f.layout and f.has_cycles else f for f in files]
    return loaded, sources


def _read(sources: list[Source], watch: Watch = UNWATCHED) -> list[Recording]:
    recordings: list[Recording] = []
    for source in watch.each(sources, "files read"):
        if isinstance(source, Cycles):
            recordings += read_cycles(source)
        else:
            recordings.append(source.read())
    return recordings


def _sample(loaded: list[Recording], sources: list[Source], usable: set[str]) -> list[Recording]:
    """Return recordings that are spread evenly over a campaign, for the curves of a report."""
    units: list[Recording | Source] = [*loaded]
    for source in sources:
        units += [source.part(i, i + 1) for i in range(len(source))] if isinstance(source, Cycles) else [source]
    chosen = [units[i] for i in np.unique(np.linspace(0, len(units) - 1, SHOWN).astype(int))]
    recordings = [u if isinstance(u, Recording) else _read([u])[0] for u in chosen]
    return [recording for recording in recordings if recording.name in usable]


def _assemble(
    results: tuple[RecordingResult, ...],
    summaries: list[Summary],
    skipped: list[tuple[str, str]],
    notes: list[str],
    choice: SampleChoice,
) -> Characterisation:
    uses = {summary.name: summary.stroke_use for summary in summaries}
    points = tuple(point for summary in summaries for point in summary.friction_points)
    closures = fit_closures([point for summary in summaries for point in summary.closure_points])
    lines = fit_pressure_lines(list(points))
    rows = [row for summary in summaries for row in summary.rows]
    friction_map = rows_to_dataset(rows, [summary.labels for summary in summaries for _ in summary.rows])
    friction_map.attrs["protocol"] = choice.name
    friction_map.attrs["synthetic"] = any(result.recording.synthetic for result in results)
    friction_map.attrs[HASHES] = json.dumps({one.name: one.sha256 for one in summaries if one.sha256})
    if results:
        ambient = float(np.mean([result.recording.ambient_pressure_pa for result in results]))
        friction_map.attrs["ambient_pressure_pa"] = ambient
    return Characterisation(
        results=results,
        friction_map=friction_map,
        closures=tuple(closures),
        pressure_lines=tuple(lines),
        points=points,
        run_spread=run_spread(list(points)),
        notes=(
            *notes,
            *stroke_notes(uses),
            *notes_of(results, points, lines, rows, closures),
        ),
        skipped=tuple(skipped),
        protocol=choice.name,
        stroke_uses=uses,
    )


def _count_once(found: Iterable[tuple[str, object, str]]) -> tuple[list[int], list[tuple[str, str]]]:
    """Leave out unusable recordings, and those with the samples of an earlier one.

    Parameters
    ----------
    found : iterable of tuple
        Name, digest of the samples, and why it is unusable ("" if usable).

    Returns
    -------
    list of int, list of tuple
        Places of the used recordings; names of the others, and why.
    """
    seen: dict[object, str] = {}
    kept, skipped = [], []
    for place, (name, digest, reason) in enumerate(found):
        if reason or digest in seen:
            skipped.append((name, reason or f"identical to {seen[digest]}"))
        else:
            seen[digest] = name
            kept.append(place)
    return kept, skipped


def _digest(recording: Recording) -> bytes:
    total = hashlib.sha256()
    for channel in ("time_s", *CHANNELS):
        total.update(np.ascontiguousarray(getattr(recording, channel)).data)
    return total.digest()
