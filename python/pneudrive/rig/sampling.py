"""Times of samples: uniform over each step, denser at its ends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import CommandError
from pneudrive.files.bounds import within

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.rig.interface import Sampling

    Array = NDArray[np.float64]


def step_times(duration_s: float, moving: bool, sampling: Sampling) -> Array:
    """Return the times of the samples of one step, counted from its beginning.

    The end of the step belongs to the next one.

    Parameters
    ----------
    duration_s : float
        Duration of the step, s; zero gives no samples.
    moving : bool
        True for a move, with uniform samples. False for a hold at a separate rate.
    sampling : Sampling

    Returns
    -------
    ndarray, shape (n,)
        Times, s, ascending from zero.

    Examples
    --------
    >>> from pneudrive.rig.interface import Sampling
    >>> step_times(1.0, True, Sampling(samples_per_stroke=4, burst_rate_hz=0.0)).tolist()
    [0.0, 0.25, 0.5, 0.75]
    """
    parts = [begin + (end - begin) * np.arange(n) / max(n, 1) for begin, end, n in _spans(duration_s, moving, sampling)]
    return np.concatenate(parts) if parts else np.zeros(0)


def step_samples(duration_s: float, moving: bool, sampling: Sampling) -> int:
    """Return the number of samples of `step_times`."""
    return sum(n for _, _, n in _spans(duration_s, moving, sampling))


def _spans(duration_s: float, moving: bool, sampling: Sampling) -> list[tuple[float, float, int]]:
    """Return the spans of a step with one rate each: begin, end, number of samples."""
    if duration_s <= 0.0:
        return []
    rate = sampling.samples_per_stroke / duration_s if moving else sampling.hold_rate_hz
    if not (math.isfinite(rate) and rate > 0.0):
        raise CommandError(
            f"a step of {duration_s:g} s cannot be sampled at {rate} Hz",
            rule="samples_per_stroke and hold_rate_hz are positive",
        )
    spans = [(0.0, duration_s, rate)]
    if sampling.burst_rate_hz > rate:
        after = min(sampling.burst_after_s, duration_s)
        before = max(duration_s - sampling.burst_before_s, after)
        dense = sampling.burst_rate_hz
        spans = [(0.0, after, dense), (after, before, rate), (before, duration_s, dense)]
    counts = [(end - begin) * wanted * (1.0 - 1e-12) for begin, end, wanted in spans]
    total = sum(counts)
    within("samples", total, f"a step of {duration_s:g} s would have {np.ceil(total):,.15g} samples", CommandError)
    return [(begin, end, math.ceil(count)) for (begin, end, _), count in zip(spans, counts, strict=True)]


def schedule(
    durations_s: Sequence[float], moving: Sequence[bool], sampling: Sampling
) -> tuple[Array, NDArray[np.int64]]:
    """Return the times of all samples of a cycle, including its end, and the step of each.

    Parameters
    ----------
    durations_s : sequence of float
        Durations of the steps, s.
    moving : sequence of bool
        Whether a step is a move.
    sampling : Sampling

    Returns
    -------
    ndarray, shape (n,)
        Times, s, strictly ascending.
    ndarray of int64, shape (n,)
        Index of the step of each sample.
    """
    total = sum(step_samples(duration, move, sampling) for duration, move in zip(durations_s, moving, strict=True))
    within("samples", total, f"a cycle would have {total:,.15g} samples", CommandError)
    each = [step_times(duration, move, sampling) for duration, move in zip(durations_s, moving, strict=True)]
    borders = np.concatenate([[0.0], np.cumsum(durations_s)])
    last = max((i for i, part in enumerate(each) if part.size), default=-1)
    if last < 0:
        return np.zeros(0), np.zeros(0, dtype=np.int64)
    each[last] = np.append(each[last], durations_s[last])
    times = np.concatenate([border + part for border, part in zip(borders, each, strict=False)])
    return times, np.repeat(np.arange(len(each), dtype=np.int64), [part.size for part in each])
