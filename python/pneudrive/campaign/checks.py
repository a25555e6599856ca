"""What is wrong with the samples of a cycle as they arrive: counted and named, never repaired.

The samples are kept as they came; the counts go into the head of the cycle (``flags``), an adaptive campaign repeats
the cycle, and whoever characterises the recording drops what cannot be used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.rig.interface import CHANNELS, Move

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.rig.interface import Identity, Samples, Sampling

    Array = NDArray[np.float64]

#: Every flag and what it counts.
FLAGS = {
    "non_finite": "samples with a value that is no number",
    "duplicated": "samples that came twice, equal in every channel",
    "repeated_time": "samples at the time of the one before, but with other values",
    "time_runs_back": "samples earlier than the one before: the clock jumped back",
    "dropped": "samples that are missing between two others",
    "saturated": "samples at an end of the sensor's range",
    "stuck": "samples at which a sensor stood still while the axis travelled",
    "too_few_samples": "samples that are missing in moves that have less than a tenth of what was asked for",
    "steps_missing": "moves and holds of which there is no sample",
    "target_missed": "moves that ended elsewhere than they were told to",
}
#: Flags with which the numbers of a cycle mean little: after some of these cycles in a row a campaign stops.
SERIOUS = frozenset(FLAGS) - {"duplicated", "dropped", "repeated_time"}

NEIGHBOURS = 8  # intervals on each side that tell the usual one
LATE = 1.75  # usual intervals until the next sample, at which one is missing
JITTER = 6.0  # median deviations of the intervals that are allowed on top
STUCK_RUN, STUCK_SHARE = 20, 0.02  # equal samples in a row, over this share of the cycle's travel
SATURATED_RUN = 5  # equal samples in a row at the largest or smallest value, where the range is not known
USUAL_RUN = 0.95  # quantile of the runs of equal samples that coarse steps make by themselves
UNUSUAL = 4  # times that one is no longer usual
LEAST_SHARE, LEAST_SAMPLES = 0.1, 20  # of the samples that were asked for, in each move
MISSED_SHARE, MISSED_M = 0.05, 1e-3  # of the way of a move, and on top


def arrival_flags(samples: Samples, cycle: Cycle, identity: Identity) -> dict[str, int]:
    """Count what is wrong.

    Parameters
    ----------
    samples : Samples
        As they came.
    cycle : Cycle
        As planned: its steps and sampling.
    identity : Identity
        Of the rig: ``limits`` are the ranges of its sensors.

    Returns
    -------
    dict
        Flag of `FLAGS` -> count; what was not found is absent.
    """
    table = np.stack([getattr(samples, name) for name in CHANNELS])
    timed = np.isfinite(table[0])
    counts = {"non_finite": int((~np.isfinite(table[:-1]).all(axis=0)).sum())}
    table, step = table[:, timed], samples.step[timed]
    fresh, counts["duplicated"] = _first_of_each(table, step)
    table, step = table[:, fresh], step[fresh]
    intervals = np.diff(table[0])
    counts["time_runs_back"] = int((intervals < 0.0).sum())
    counts["repeated_time"] = int((intervals == 0.0).sum())
    counts["dropped"] = _dropped(table[0], step, cycle)
    finite = np.isfinite(table[:-1]).all(axis=0)
    table, step = table[:, finite], step[finite]
    counts["saturated"], counts["stuck"] = _sensors(table, step, cycle, identity)
    counts |= _steps(table, step, cycle)
    return {name: counts[name] for name in FLAGS if counts.get(name)}


def _first_of_each(table: Array, step: NDArray[np.int64]) -> tuple[NDArray[np.bool_], int]:
    """Mark all samples but those that equal an earlier one in every channel."""
    order = np.argsort(table[0], kind="stable")
    ordered = table[:, order]
    with np.errstate(invalid="ignore"):
        same = (ordered[:, 1:] == ordered[:, :-1]) | (np.isnan(ordered[:, 1:]) & np.isnan(ordered[:, :-1]))
    again = same.all(axis=0) & (step[order][1:] == step[order][:-1])
    fresh = np.ones(step.size, dtype=bool)
    fresh[order[1:][again]] = False
    return fresh, int(again.sum())


def _dropped(time: Array, step: NDArray[np.int64], cycle: Cycle) -> int:
    """Count the samples that are missing within steps: intervals beyond what is usual there, and beyond the plan."""
    intervals = np.maximum(np.diff(time), 0.0)  # where the clock jumps back nothing can be told
    if intervals.size < 2 * NEIGHBOURS:
        return 0
    usual = _usual_interval(intervals)
    deviation = float(np.median(np.abs(intervals - usual)))
    expected = np.maximum(usual, _planned_interval(time, step, cycle))
    late = (intervals > LATE * expected + JITTER * deviation) & (step[1:] == step[:-1])
    return int(np.sum(np.maximum(np.rint(intervals[late] / expected[late]) - 1.0, 1.0)))


def _usual_interval(intervals: Array) -> Array:
    """Give the median of the intervals before or after each one, whichever is longer: the rate may change there."""
    padded = np.pad(intervals, NEIGHBOURS, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    medians = np.median(windows, axis=1)
    return np.maximum(medians[: intervals.size], medians[NEIGHBOURS + 1 : NEIGHBOURS + 1 + intervals.size])


def _planned_interval(time: Array, step: NDArray[np.int64], cycle: Cycle) -> Array:
    """Give the interval that the plan allows between samples; 0 inside bursts and where there is no plan."""
    planned = np.zeros(time.size - 1)
    sampling: Sampling = cycle.sampling
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(step == number)
        if members.size < 2:
            continue
        begin, end = time[members[0]], time[members[-1]]
        moving = isinstance(one, Move)
        planned_s = (end - begin) / sampling.samples_per_stroke if moving else 1.0 / sampling.hold_rate_hz
        inside = members[:-1]
        early = time[inside + 1] - begin <= sampling.burst_after_s
        late = end - time[inside] <= sampling.burst_before_s
        burst = (early | late) if sampling.burst_rate_hz > 0.0 else np.zeros(inside.size, dtype=bool)
        planned[inside[~burst]] = planned_s
    return planned


def _sensors(table: Array, step: NDArray[np.int64], cycle: Cycle, identity: Identity) -> tuple[int, int]:
    """Count saturated and stuck samples over all sensors."""
    position = table[CHANNELS.index("position_m")]
    moves = [number for number, one in enumerate(cycle.steps) if isinstance(one, Move)]
    moving = np.isin(step, moves)
    saturated, stuck = np.zeros(step.size, dtype=bool), np.zeros(step.size, dtype=bool)
    travel = float(np.ptp(position[moving])) if moving.any() else 0.0
    for name, values in zip(CHANNELS[1:-1], table[1:-1], strict=True):
        if not values.size:
            continue
        full = _saturated(name, values, identity)
        saturated |= full
        if name == "position_m":
            stuck |= _stuck_position(values, travel)
            stuck |= _constant_in_a_move(values, step, moves)
        elif name == "force_n" or np.ptp(values) > 0.0:  # a pressure that is not measured never changes
            stuck |= _stuck(values, position, moving, travel) & ~full
    return int(saturated.sum()), int(stuck.sum())


def _saturated(name: str, values: Array, identity: Identity) -> NDArray[np.bool_]:
    if name in identity.limits:
        low, high = identity.limits[name]
        margin = 0.5 * identity.resolution.get(name, 0.0)
        return (values <= low + margin) | (values >= high - margin)
    if name != "force_n":
        return np.zeros(values.size, dtype=bool)
    starts, lengths = _runs(values)
    extreme = (values[starts] == values.max()) | (values[starts] == values.min())
    long = lengths >= max(SATURATED_RUN, UNUSUAL * _usual_run(lengths))
    return _filled(values.size, starts, lengths, extreme & long) if lengths.size > 1 else np.zeros(values.size, bool)


def _stuck(values: Array, position: Array, moving: NDArray[np.bool_], travel: float) -> NDArray[np.bool_]:
    """Mark runs of one value over which the axis travelled."""
    if travel <= 0.0:
        return np.zeros(values.size, dtype=bool)
    starts, lengths = _runs(values)
    if lengths.size == 1:
        return moving.copy()
    long = lengths >= max(STUCK_RUN, UNUSUAL * _usual_run(lengths))
    for run in np.flatnonzero(long):
        part = slice(starts[run], starts[run] + lengths[run])
        long[run] = np.ptp(position[part]) > STUCK_SHARE * travel
    return _filled(values.size, starts, lengths, long) & moving


def _stuck_position(position: Array, travel: float) -> NDArray[np.bool_]:
    """Mark runs of one position that end in a jump: a carriage that stands starts without one."""
    if travel <= 0.0:
        return np.zeros(position.size, dtype=bool)
    starts, lengths = _runs(position)
    jump = np.zeros(starts.size)
    jump[:-1] = np.abs(position[starts[1:]] - position[starts[:-1]])
    return _filled(position.size, starts, lengths, (lengths >= STUCK_RUN) & (jump > STUCK_SHARE * travel))


def _constant_in_a_move(values: Array, step: NDArray[np.int64], moves: list[int]) -> NDArray[np.bool_]:
    """Mark moves over which a value did not change at all."""
    mask = np.zeros(step.size, dtype=bool)
    for number in moves:
        members = step == number
        if members.any() and np.ptp(values[members]) == 0.0:
            mask |= members
    return mask


def _steps(table: Array, step: NDArray[np.int64], cycle: Cycle) -> dict[str, int]:
    """Hold the samples against the steps that were asked for."""
    counts = {"steps_missing": 0, "too_few_samples": 0, "target_missed": 0}
    asked, at = cycle.sampling.samples_per_stroke, cycle.start_m
    position = table[CHANNELS.index("position_m")]
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(step == number)
        begin = at
        if isinstance(one, Move):
            at = one.to_m
            if members.size < max(LEAST_SHARE * asked, LEAST_SAMPLES):
                counts["too_few_samples"] += max(asked - members.size, 1)
            way = abs(one.to_m - begin) if begin is not None else 0.0
            if members.size and abs(position[members[-1]] - one.to_m) > MISSED_SHARE * way + MISSED_M:
                counts["target_missed"] += 1
        elif one.duration_s * cycle.sampling.hold_rate_hz < 1.0:
            continue
        counts["steps_missing"] += not members.size
    return counts


def _runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give start and length of each run of equal samples."""
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0.0) + 1))
    return starts, np.diff(np.concatenate((starts, [values.size])))


def _usual_run(lengths: NDArray[np.intp]) -> float:
    return float(np.quantile(lengths, USUAL_RUN))


def _filled(
    size: int, starts: NDArray[np.intp], lengths: NDArray[np.intp], chosen: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mark the samples of the chosen runs."""
    mask = np.zeros(size, dtype=bool)
    for start, length in zip(starts[chosen], lengths[chosen], strict=True):
        mask[start : start + length] = True
    return mask


def serious(flags: Sequence[str] | dict[str, int]) -> list[str]:
    """Name those flags with which the numbers of a cycle mean little."""
    return [name for name in flags if name in SERIOUS]
