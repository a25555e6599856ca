"""Checks of single samples: non-finite, repeated, spikes, saturated, stuck, gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.motion import NOISE_FACTOR, middle, noise_level, thinned
from pneudrive.signals.recording import CHANNELS, Recording

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

GAP_FACTOR = 5.0  # a gap is longer than this many usual intervals
SPIKE_FACTOR = 12.0  # a spike stands out of both neighbours by this many noise deviations
STEP_FACTOR = 3.0  # and stands out by this many of the channel's own steps:
FEW_SPIKES = 0.95  # those below this quantile, which spikes do not reach,
OWN_STEPS = 0.99  # and, without the spikes, below this one
AGREEMENT = 0.5  # neighbours of a spike differ by less than this share of its height
JUMP_SHARE = 0.5  # least jump of a position, of the travel
JUMP_NEIGHBOURS, JUMP_FACTOR = 3, 10.0  # steps on each side that show the motion; least ratio of the jump to them
SATURATED_RUN = 5  # equal samples in a row at a channel's extreme
CLIPPED_SHARE = 0.5  # share of the samples at the extremes above which a signal is smooth
STUCK_RUN = 20  # equal samples in a row while the piston travels
STUCK_TRAVEL_SHARE = 0.02


@dataclass(frozen=True)
class SampleFault:
    """Faults of one kind: the number of samples or intervals, and the first and last time of each occurrence, s."""

    count: int
    places: list[tuple[float, float]]


def find_faults(recording: Recording) -> dict[str, SampleFault]:
    """Return places of samples that `clean` drops, and gaps of a recording.

    Parameters
    ----------
    recording
        As read.

    Returns
    -------
    dict of str to SampleFault
        Places by kind, with the counts of `clean`. Faults of reading have no time and therefore no place. Neighbouring
        samples are one place.

    Raises
    ------
    RecordingError
        As for `clean`.
    """
    places: dict[str, list[tuple[float, float]]] = {}

    def find(kind: str, time_s: NDArray[np.float64], mask: NDArray[np.bool_]) -> None:
        edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
        ends = zip(time_s[edges[::2]], time_s[edges[1::2] - (kind != "gap")], strict=True)
        places[kind] = [(float(first), float(last)) for first, last in ends if np.isfinite(first + last)]

    flags = clean(recording, find).flags
    return {kind: SampleFault(count, places.get(kind, [])) for kind, count in flags.items()}


def clean(
    recording: Recording,
    found: Callable[[str, NDArray[np.float64], NDArray[np.bool_]], None] = lambda _kind, _time_s, _mask: None,
) -> Recording:
    """Drop unusable samples and count them by kind.

    Parameters
    ----------
    recording
        As read.
    found
        Called with each kind of fault, the times and the mask of its samples. For gaps, the mask has the samples before
        them.

    Returns
    -------
    Recording
        Only usable samples. ``flags`` counts ``non_finite``, ``repeated_time``, ``spike``, ``saturated``, ``stuck``
        samples and ``gap`` intervals (kinds with count 0 are absent).

    Raises
    ------
    RecordingError
        If no finite sample is left.
    """
    counts = dict(recording.flags)
    finite = np.isfinite(recording.time_s)
    for channel in CHANNELS:
        finite &= np.isfinite(getattr(recording, channel))
    for force in recording.parallel:
        finite &= np.isfinite(force.force_n)
    _count(counts, "non_finite", int((~finite).sum()))
    found("non_finite", recording.time_s, ~finite)
    if not finite.any():
        raise RecordingError(
            "no sample is finite in all channels",
            where=recording.name,
            value=f"{len(recording)} rows",
            remedy="check which columns the layout names, and their units",
        )
    recording = _take(recording, finite)
    fresh = np.concatenate(([True], np.diff(recording.time_s) > 0))
    _count(counts, "repeated_time", int((~fresh).sum()))
    found("repeated_time", recording.time_s, ~fresh)
    recording = _take(recording, fresh)

    good = np.ones(len(recording), dtype=bool)
    for kind, mask in _bad_samples(recording).items():
        _count(counts, kind, int((mask & good).sum()))
        found(kind, recording.time_s, mask & good)
        good &= ~mask
    if good.any():
        recording = _take(recording, good)
    jumps = jumps_back(recording.position_m)
    _count(counts, "position_jump", int(jumps.sum()))
    found("position_jump", recording.time_s, jumps)
    steps = np.diff(recording.time_s)
    if steps.size:
        gaps = steps > GAP_FACTOR * middle(steps)
        _count(counts, "gap", int(gaps.sum()))
        found("gap", recording.time_s, gaps)
    return replace(recording, flags=counts) if counts != recording.flags else recording


def _bad_samples(recording: Recording) -> dict[str, NDArray[np.bool_]]:
    """Return a mask per kind of bad sample."""
    n = len(recording)
    masks = {kind: np.zeros(n, dtype=bool) for kind in ("spike", "saturated", "stuck")}
    if n < 2 * STUCK_RUN:
        return masks
    position = recording.position_m
    moves = np.ptp(position) > NOISE_FACTOR * noise_level(position)
    for channel in CHANNELS:
        values = getattr(recording, channel)
        if np.ptp(values) == 0 or recording.accuracy.get(channel) == 0.0:
            continue  # an unmeasured pressure or an exact channel has no sensor that could fail
        masks["spike"] |= spikes(values)
        if channel in recording.limits:
            low, high = recording.limits[channel]
            masks["saturated"] |= (values <= low) | (values >= high)
        if not (values[1:] == values[:-1]).any():
            continue
        runs = equal_runs(values)
        if runs[1].max() < SATURATED_RUN:
            continue
        if channel != "position_m":
            masks["saturated"] |= clipped(values, runs)
        if moves:  # a piston at rest makes every sensor look stuck
            masks["stuck"] |= stuck_position(position, runs) if channel == "position_m" else stuck_runs(position, runs)
    return masks


def spikes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return single samples that differ from both neighbours by much more than the noise, if the neighbours agree.

    If the neighbours differ, or the channel changes just before or after, it is a change of level. The overshoot of
    such a change may be real, for example breakaway after a reversal.
    """
    mask = np.zeros(values.size, dtype=bool)
    steps = np.diff(values)
    threshold = max(SPIKE_FACTOR * noise_level(values), STEP_FACTOR * _upper(steps, FEW_SPIKES))
    large = np.flatnonzero(np.abs(steps[:-1]) > threshold)  # few, usually none
    there, back = steps[large], steps[large + 1]
    height = np.minimum(np.abs(there), np.abs(back))
    alone = (there * back < 0) & (height > threshold) & (np.abs(there + back) < AGREEMENT * height)
    for neighbour in (np.maximum(large - 1, 0), np.minimum(large + 2, steps.size - 1)):
        alone &= (np.abs(steps[neighbour]) < AGREEMENT * height) | (neighbour == large) | (neighbour == large + 1)
    if alone.any():  # exclude spikes from the channel's largest steps (reversals): many spikes would hide otherwise
        rest = np.ones(steps.size, dtype=bool)
        rest[large[alone]] = rest[large[alone] + 1] = False
        alone &= height > STEP_FACTOR * _upper(steps[rest], OWN_STEPS)
    mask[large[alone] + 1] = True
    return mask


def jumps_back(position: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the samples before jumps over most of the travel, against the motion before and behind them.

    Such jumps come from a counter that wraps or is reset, because a piston cannot move in this way.
    """
    mask = np.zeros(position.size, dtype=bool)
    steps = np.diff(position)
    if steps.size < 2 * JUMP_NEIGHBOURS + 1:
        return mask
    for at in np.flatnonzero(np.abs(steps) > JUMP_SHARE * np.ptp(position)):
        before, behind = steps[max(at - JUMP_NEIGHBOURS, 0) : at], steps[at + 1 : at + 1 + JUMP_NEIGHBOURS]
        if not before.size or not behind.size:
            continue
        moved = [float(np.sum(part)) / part.size * np.sign(steps[at]) for part in (before, behind)]
        mask[at] = all(abs(steps[at]) > -JUMP_FACTOR * step > 0 for step in moved)
    return mask


def _upper(steps: NDArray[np.float64], share: float) -> float:
    """Return the quantile of the steps at this probability."""
    some = np.abs(thinned(steps))
    rank = int(share * (some.size - 1))
    return float(np.partition(some, rank)[rank])


def equal_runs(values: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Start and length of each run of equal samples."""
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0) + 1))
    return starts, np.diff(np.concatenate((starts, [values.size])))


def _fill(size: int, starts: NDArray[np.intp], lengths: NDArray[np.intp]) -> NDArray[np.bool_]:
    edges = np.zeros(size + 1, dtype=np.int64)
    np.add.at(edges, starts, 1)
    np.add.at(edges, starts + lengths, -1)
    return np.cumsum(edges[:-1]) > 0


def _usual_run(lengths: NDArray[np.intp]) -> float:
    """Return the usual length of runs from coarse quantisation, weighted by samples.

    The longest run is excluded: a sensor that is stuck for most of the time must not be mistaken for a coarse one.
    """
    if lengths.size <= 1:
        return 0.0
    numbers = np.bincount(lengths)
    numbers[-1] -= 1
    covered = np.cumsum(numbers * np.arange(numbers.size))
    return float(np.searchsorted(covered, 0.9 * covered[-1]))


def clipped(values: NDArray[np.float64], runs: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.bool_]:
    """Mark samples at the largest or smallest value of a noisy channel, if long runs have this value.

    A channel near its limit also touches it for single samples. These samples are marked like the runs.

    A channel that rests at its extremes for most of the time is a smooth signal (a simulation), not a clipped one.
    """
    starts, lengths = runs
    extreme = (values[starts] == values.max()) | (values[starts] == values.min())
    needed = max(SATURATED_RUN, 4 * _usual_run(lengths[~extreme]))
    hit = extreme & (lengths >= needed)
    if lengths[hit].sum() > CLIPPED_SHARE * values.size:
        return np.zeros(values.size, dtype=bool)
    return np.isin(values, np.unique(values[starts[hit]]))


def stuck_runs(position: NDArray[np.float64], runs: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.bool_]:
    """Mark runs of one value while the piston moves."""
    starts, lengths = runs
    long = lengths >= max(STUCK_RUN, 4 * _usual_run(lengths))
    starts, lengths = starts[long], lengths[long]
    # Out and back ends at its start: the whole way counts, not its ends.
    runs_of = [position[start : start + length] for start, length in zip(starts, lengths, strict=True)]
    moved = np.array([np.ptp(run) > STUCK_TRAVEL_SHARE * np.ptp(position) for run in runs_of], dtype=bool)
    return _fill(position.size, starts[moved], lengths[moved])


def stuck_position(position: NDArray[np.float64], runs: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.bool_]:
    """Mark runs of one position that end in a jump. A real piston leaves its rest without a jump."""
    starts, lengths = runs
    inside = (lengths >= STUCK_RUN) & (starts + lengths < position.size)
    starts, lengths = starts[inside], lengths[inside]
    jump = np.abs(position[starts + lengths] - position[starts])
    hit = jump > STUCK_TRAVEL_SHARE * np.ptp(position)
    return _fill(position.size, starts[hit], lengths[hit])


def _take(recording: Recording, mask: NDArray[np.bool_]) -> Recording:
    if mask.all():
        return recording
    return recording.at(mask)


def _count(counts: dict[str, int], kind: str, number: int) -> None:
    if number:
        counts[kind] = counts.get(kind, 0) + number
