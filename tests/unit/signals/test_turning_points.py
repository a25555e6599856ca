"""Turning points, held against the prominent peaks that SciPy finds in the motion and in its mirror image."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from pneudrive.signals.motion import turning_points


def peaks(values: np.ndarray, least: float) -> list[int]:
    """Peaks and troughs that stand out by at least `least`, those at the ends too, of equal neighbours the first."""
    found = []
    for sign in (1, -1):
        beyond = (sign * values).min() - 2 * least - 1
        at, _ = find_peaks(np.concatenate(([beyond], sign * values, [beyond])), prominence=max(least, 1e-12))
        found += [(int(place) - 1, sign) for place in at]
    kept: list[tuple[int, int]] = []
    for place, sign in sorted(found):
        if kept and kept[-1][1] == sign:
            if sign * values[place] > sign * values[kept[-1][0]]:
                kept[-1] = place, sign
        else:
            kept.append((place, sign))
    return [place for place, _ in kept]


@pytest.mark.parametrize("step", [0.0, 0.5, 3.0], ids=["fine", "quantised", "coarse"])
def test_random_motions_turn_where_their_prominent_peaks_are(step: float) -> None:
    random = np.random.default_rng(5)
    for _ in range(200):
        values = np.cumsum(random.normal(size=random.integers(20, 400)))
        values = np.round(values / step) * step if step else values
        least = random.uniform(0.05, 0.9) * float(np.ptp(values))
        if least > 0.0:
            assert turning_points(values, least).tolist() == peaks(values, least)


def test_a_stroke_without_end_has_two_turning_points_in_the_middle_of_its_rests() -> None:
    values = np.concatenate((np.zeros(5), np.arange(10.0), np.full(7, 10.0), [9.5, 10.0]))
    assert turning_points(values, 1.0).tolist() == [2, 18]
    assert turning_points(-values, 1.0).tolist() == [2, 18]
    assert turning_points(values[:5], 1.0).tolist() == [2, 2]
    assert turning_points(values[::2], 1.0).tolist() == turning_points(np.ascontiguousarray(values[::2]), 1.0).tolist()
