"""Means over bins of position."""

from itertools import pairwise

import numpy as np
import pytest

from pneudrive.friction.bins import bin_means


def test_a_bin_has_the_mean_of_the_chosen_samples_of_all_parts_within_it() -> None:
    random = np.random.default_rng(3)
    position, values = random.uniform(-0.2, 1.2, 500), random.normal(size=500)
    chosen, edges = random.random(500) < 0.6, np.linspace(0.0, 1.0, 8)
    position[10], position[11] = edges[0], edges[-1]  # a bin holds its lower end, not its upper one
    chosen[10:12] = True
    chosen &= ~((position > edges[3]) & (position < edges[4]))
    parts = [slice(5, 200), slice(200, 201), slice(300, 500)]
    counted = np.zeros(500, dtype=bool)
    for part in parts:
        counted[part] = True
    for mask, use in ((None, counted), (chosen, counted & chosen)):
        found = bin_means(position, values, edges, parts, mask)
        inside = [use & (position >= low) & (position < high) for low, high in pairwise(edges)]
        wanted = [values[one].mean() if one.any() else np.nan for one in inside]
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert np.isnan(found[3])


def test_parts_lie_within_the_samples() -> None:
    with pytest.raises(ValueError, match="lie within"):
        bin_means(np.zeros(3), np.zeros(3), np.linspace(0.0, 1.0, 3), [slice(1, 4)])
