"""Stops in the middle of a move: relaxation while held, breakaway peak, return to uninterrupted sliding.

Every number is a difference within one move (or to an uninterrupted one of the same cycle), so the zero of the
sensor and slow drift cancel. Samples are raw; friction here is direction * balance, and still contains the offset.

All stops of a campaign are one table, which is also their file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.batching import share_out
from pneudrive.campaign.storage.folder import CycleFile
from pneudrive.friction.campaign.reading import condition_of, read_each, recording_of, steps_of
from pneudrive.friction.campaign.stops.course import (
    SAME_SPEED,
    ForceRelaxation,
    Phases,
    Recovery,
    Running,
    UninterruptedStroke,
    bin_excess,
    find_phases,
    mean_velocity,
    read_strokes,
    recover,
    relax,
    running_level,
    steady_part,
    stop_step,
    strokes_of,
)
from pneudrive.friction.campaign.stops.peak import BreakawayPeak, find_breakaway
from pneudrive.friction.friction_map import Skipped
from pneudrive.rig.interface import Move
from pneudrive.signals.motion import noise_level

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import polars as pl
    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.storage.folder import Campaign
    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.friction_map import Condition
    from pneudrive.rig.interface import Identity, Samples
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]
    Row = dict[str, Any]

#: Share of the increment above which the air's force or inertia spoils a peak; share of the stop for the loading.
SPOILS = 0.1
NOTHING = float("nan")
LEAST_RATE_HZ = 5000.0  # least rate of samples around a restart
SAME_DURATION = 0.2  # share by which a rest may differ from the planned stop without a flag
MOST_CYCLES = 24  # cycles without a stop, of one condition and speed, that are read for comparison
WORTH_WORKERS = 60  # stops below which starting processes costs more than it saves
AROUND_PEAK = 3.0  # times from restart to peak, in which missing samples count
TRACE_SAMPLES = (120, 160, 480)  # of approach, rest and restart that are kept for figures
#: Flags that take a stop out of the law of breakaway over duration.
SPOILING = frozenset(
    {"undersampled", "no_peak", "pressure_transient", "saturated", "stuck", "negative_friction", "no_running"}
)


#: Columns of friction around a stop over time since the start of the rest, thinned: for figures only.
TRACE = ("trace_time_s", "trace_position_m", "trace_friction_n")


def _read(
    file: CycleFile, samples: Samples, identity: Identity, others: Sequence[UninterruptedStroke]
) -> Row | Skipped:
    """Return the columns of a stop, or the reason for a missing one."""
    recording, _ = recording_of(file, identity, samples)
    step = steps_of(recording, samples)
    cycle, condition = file.head.cycle, condition_of(file.head)
    phases = find_phases(cycle, recording.time_s, recording.position_m, step)
    if isinstance(phases, str):
        return Skipped(cycle.key, file.path.name, phases)
    friction = phases.direction * recording.balance_n()
    own = strokes_of(file, recording, step, leave=stop_step(cycle)) if phases.by_steps else []
    running = running_level(recording, friction, phases, own, others, condition)
    steady = steady_part(recording, phases.restart)
    part = phases.restart
    travel = phases.direction * (recording.position_m[part] - recording.position_m[part.start])
    time, travel, after = recording.time_s[part], np.maximum.accumulate(travel), friction[part]
    level = running.level_n if np.isfinite(running.level_n) else float(np.median(after[after.size // 2 :]))
    peak = find_breakaway(time, travel, after, level, identity.stiffness_n_m, identity.bandwidth_hz.get("force_n"))
    at_peak = phases.restart.start + peak.index
    shift = float(running.shape(recording.position_m[[at_peak]])[0])
    held = phases.rest
    increment, stderr = peak.friction_n - running.level_n - shift, float(np.hypot(peak.stderr_n, running.stderr_n))
    inertia = _inertia(recording, peak, cycle.speed_m_s)
    relaxation = None if cycle.released else relax(recording.time_s[held] - phases.rest_s, friction[held])
    in_chamber = identity.pressure_measured_at == "chamber"
    flags = (
        *_flags(file, recording, phases, peak, running, samples),
        *_spoiled(recording, phases, (increment, stderr, inertia), at_peak, in_chamber),
    )
    return {
        **vars(condition),
        "index": file.head.index,
        **{name: getattr(cycle, name) for name in ("key", "block", "repeat")},
        "direction": phases.direction,
        "speed_m_s": float(cycle.speed_m_s or 0.0) or abs(mean_velocity(recording, steady)),
        "position_m": float(recording.position_m[phases.restart.start]),
        "began_s": file.head.began_s,
        "stop_s": float(cycle.stop_s) if cycle.stop_s is not None else phases.dwell_s,
        "dwell_s": phases.dwell_s,
        "released": cycle.released,
        "running_n": running.level_n + shift,
        "running_stderr_n": running.stderr_n,
        "basis": running.basis,
        "breakaway_n": peak.friction_n,
        "breakaway_stderr_n": peak.stderr_n,
        "increment_n": increment,
        "increment_stderr_n": stderr,
        "loading_rate_n_s": peak.loading_rate_n_s,
        "loading_s": peak.time_s,
        "sample_rate_hz": peak.rate_hz,
        "inertia_n": inertia,
        **_of_relaxation(relaxation),
        **_of_recovery(_recovery(recording, friction, slice(at_peak, steady.stop), phases.direction, running)),
        "usable": bool(np.isfinite(increment)) and not SPOILING.intersection(flags),
        "flags": list(flags),
        **_trace(recording, friction, phases),
    }


def _of_relaxation(relaxation: ForceRelaxation | None) -> Row:
    """Return the columns of the fall of a held force; NaN if the axis was released, or with too few samples."""
    r = relaxation
    return {
        **_three("relaxation_n", r and r.amount),
        **_three("relaxation_n_per_decade", r and r.per_decade),
        "relaxation_form": r.form if r else "",
        "relaxation_held_n": r.held_n if r else NOTHING,
        "relaxation_time_s": r.times_s[0] if r and r.times_s else NOTHING,
        "relaxation_amplitude_n": r.amplitudes_n[0] if r and r.amplitudes_n else NOTHING,
    }


def _of_recovery(recovery: Recovery | None) -> Row:
    """Return the columns of the return to sliding; NaN if the peak cannot be separated from running friction."""
    r = recovery
    columns = {"recovery_m": r and r.distance, "recovery_s": r and r.time, "left_n": r and r.left}
    row = {name: value for key, estimate in columns.items() for name, value in _three(key, estimate).items()}
    return row | {"recovery_seen_m": r.seen_m if r else NOTHING, "recovery_complete": bool(r and r.complete)}


def _three(name: str, estimate: Estimate | None) -> dict[str, float]:
    ends = {"": "value", "_low": "low", "_high": "high"}
    return {f"{name}{end}": getattr(estimate, of, NOTHING) for end, of in ends.items()}


def _recovery(recording: Recording, friction: Array, part: slice, direction: int, running: Running) -> Recovery | None:
    """Fit the return to sliding over the part after the peak at constant speed."""
    if not np.isfinite(running.level_n) or part.stop - part.start < 2:
        return None
    position = recording.position_m[part]
    travel = np.maximum.accumulate(direction * (position - position[0]))
    time = recording.time_s[part] - recording.time_s[part.start]
    excess = friction[part] - running.level_n - running.shape(position)
    bins = bin_excess(travel, time, excess, noise_level(friction[part]), running.texture_n)
    speed = float(travel[-1]) / max(float(time[-1]), 1e-12)
    return recover(bins, running.stderr_n, speed) if bins is not None else None


def _flags(
    file: CycleFile, recording: Recording, phases: Phases, peak: BreakawayPeak, running: Running, samples: Samples
) -> tuple[str, ...]:
    # Samples at the sensor's limit were left out on reading: some are missing around the peak.
    begin, end = phases.restart_s, phases.restart_s + AROUND_PEAK * peak.time_s
    here, kept = (int(((t >= begin) & (t <= end)).sum()) for t in (samples.time_s, recording.time_s))
    planned = file.head.cycle.stop_s
    found = {
        "no_running": running.basis == "none",
        "negative_friction": running.level_n < 0,
        "stuck": np.ptp(recording.force_n[phases.restart]) == 0,
        "saturated": recording.flags.get("saturated", 0) and here - kept > 2,
        "slow_samples": peak.rate_hz < LEAST_RATE_HZ * 0.9,
        "duration": planned is not None and abs(phases.dwell_s - planned) > SAME_DURATION * planned,
        "long_loading": peak.time_s > SPOILS * phases.dwell_s,
        "reversed": phases.reversed,
        "by_motion": not phases.by_steps,
    }
    return (*peak.flags, *(flag for flag, holds in found.items() if holds))


def _spoiled(
    recording: Recording, phases: Phases, peak_n: tuple[float, float, float], at_peak: int, in_chamber: bool
) -> Iterator[str]:
    """Return flags for parts of the increment that may not be friction: force of the air, inertia of the mass.

    `peak_n` has the increment, its standard error, and the largest contribution of the mass.
    """
    increment, stderr, inertia = peak_n
    size = max(abs(increment), 3.0 * stderr)
    begin = max(phases.restart.start - 3, 0)
    moved = 0.0
    for side in ("a", "b"):
        channel = getattr(recording, f"pressure_{side}_pa")
        ends = [float(channel[max(i - 20, 0) : i + 20].mean()) for i in (begin, at_peak)]
        noise = noise_level(channel, quantisation=False) / np.sqrt(20.0)
        moved += max(abs(ends[1] - ends[0]) - 3.0 * noise, 0.0) * getattr(recording, f"area_{side}_m2")
    # A force of the air measured in the chambers is corrected. It spoils a result that is not larger.
    if moved > (1.0 if in_chamber else SPOILS) * size:
        yield "pressure_transient"
    if inertia > SPOILS * size:
        yield "inertia"


def _inertia(recording: Recording, peak: BreakawayPeak, speed_m_s: float | None) -> float:
    """Return the overshoot of a mass that breaks loose on the rig's spring, at the speed of the axis then."""
    speed = 2.0 * peak.travel_m / max(peak.time_s, 1e-12)  # at constant acceleration; less in a longer move
    speed = min(speed, speed_m_s) if speed_m_s is not None else speed
    stiffness = recording.stiffness_n_m or abs(np.nan_to_num(peak.loading_rate_n_s)) / max(speed, 1e-12)
    return speed * float(np.sqrt(max(stiffness, 0.0) * recording.mass_beyond_sensor_kg))


def _trace(recording: Recording, friction: Array, phases: Phases) -> Row:
    chosen = []
    for part, most in zip((phases.approach, phases.rest, phases.restart), TRACE_SAMPLES, strict=True):
        size = part.stop - part.start
        # Dense around the peak.
        ranks = np.geomspace(1, size, most) - 1 if part is phases.restart else np.linspace(0, size - 1, most)
        chosen.append(part.start + np.unique(ranks.astype(int)) if size > 0 else np.zeros(0, dtype=int))
    index = np.concatenate(chosen)
    values = (recording.time_s[index] - phases.rest_s, recording.position_m[index], friction[index])
    return {name: each.tolist() for name, each in zip(TRACE, values, strict=True)}


def find_stops(
    campaign: Campaign, processes: int | None = None, files: Sequence[CycleFile] | None = None
) -> tuple[pl.DataFrame, tuple[Skipped, ...]]:
    """Read all stops of a campaign.

    Parameters
    ----------
    campaign : Campaign
    processes : int, optional
        None: one for each processor, with enough stops.
    files : sequence of CycleFile, optional
        Its usable files, if known.

    Returns
    -------
    polars.DataFrame
        One row for each stop, in the order of execution. Besides those of its `Condition` and its header, the columns
        are, in SI: `direction` and `speed_m_s` of the restart; duration as planned (`stop_s`) and as measured
        (`dwell_s`); `running_n`, friction of uninterrupted sliding at the stop, and its `basis`; `breakaway_n`, the
        peak after the restart; `increment_n`, the peak less running friction; `loading_rate_n_s` and `loading_s`, rate
        and time of the rise of the force; `inertia_n`, the largest contribution of the moving mass; relaxation of the
        held force; recovery: travel and time until the excess over sliding has fallen to 5 %, and the excess that is
        left; `usable`, whether the increment is used for the law of breakaway over duration; `flags`. Ends of 95 %
        intervals have the endings `_low` and `_high`.
    tuple of Skipped
        Unreadable stops with reasons.
    """
    import polars as pl

    known = campaign.scan()[0] if files is None else files
    files = [CycleFile(f.path, replace(f.head, memory={})) for f in known]
    stops = [f for f in files if f.head.cycle.kind == "stop" and f.head.cycle.stop_s != 0.0]
    if not stops:
        return pl.DataFrame(), ()
    others = read_strokes(_comparable(files, stops), campaign.identity)
    found = share_out(read_stops, stops, campaign.identity, others, least=WORTH_WORKERS, processes=processes)
    rows = sorted((s for s in found if isinstance(s, dict)), key=lambda row: row["index"])
    skipped = sorted((s for s in found if isinstance(s, Skipped)), key=lambda s: s.file)
    return pl.DataFrame(rows, infer_schema_length=None), tuple(skipped)


def read_stops(
    files: Sequence[CycleFile], identity: Identity, others: Sequence[UninterruptedStroke]
) -> list[Row | Skipped]:
    """Read some stops one after the other.

    Parameters
    ----------
    files : sequence of CycleFile
    identity : Identity
        Values of the rig.
    others : sequence of UninterruptedStroke
        Strokes of other cycles, for cycles without their own.
    """
    return read_each(lambda file, samples: _read(file, samples, identity, others), files)


def _comparable(files: Sequence[CycleFile], stops: Sequence[CycleFile]) -> list[CycleFile]:
    """Return cycles without a stop, at condition and speed of a stop without its own uninterrupted stroke."""
    wanted = {_place(f) for f in stops if not _has_reference(f.head.cycle)}
    found: dict[tuple, list[CycleFile]] = {}
    for file in files:
        cycle = file.head.cycle
        uninterrupted = cycle.kind in ("sweep", "sentinel", "blank") or (cycle.kind == "stop" and cycle.stop_s == 0.0)
        if uninterrupted and (key := _place(file)) in wanted:
            found.setdefault(key, []).append(file)
    return [
        group[i] for group in found.values() for i in np.unique(np.linspace(0, len(group) - 1, MOST_CYCLES).astype(int))
    ]


def _place(file: CycleFile) -> tuple[Condition, float]:
    """Return condition and number of the speed of a cycle."""
    speed = file.head.cycle.speed_m_s
    return condition_of(file.head), round(float(np.log(speed)) / SAME_SPEED) if speed else float("nan")


def _has_reference(cycle: Cycle) -> bool:
    """Return whether a move of the cycle, away from the stop, is at the speed of the restart."""
    hold = stop_step(cycle)
    moves = ((i, step) for i, step in enumerate(cycle.steps) if isinstance(step, Move))
    return hold is not None and any(abs(i - hold) > 1 and step.speed_m_s == cycle.speed_m_s for i, step in moves)
