"""Means over bins of position."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings
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


# --- Breakaway peaks after a reversal, and what spoils them.

PEAK = 3.0  # N above sliding friction
DECAY = 1e-3  # m


def with_peaks(make, rate: float, swing: float = 0.0, **options):
    """Friction 5 N that starts at 8 N after each reversal and settles over 1 mm; the rise takes 0.2 mm."""
    recording = make(rate=rate, presliding=1e-4, swing=swing, noise=0.02, dwell=0.5, position_noise=1e-8, **options)
    velocity = np.gradient(recording.position_m, recording.time_s)
    direction = np.sign(np.where(np.abs(velocity) > 1e-3, velocity, 0.0))
    for i in range(1, direction.size):
        direction[i] = direction[i] or direction[i - 1]
    away = np.where(direction > 0, recording.position_m, 0.04 - recording.position_m)
    extra = direction * PEAK * np.exp(-np.maximum(away, 0) / DECAY) * (1 - np.exp(-np.maximum(away, 0) / 1e-4))
    return replace(recording, force_n=recording.force_n + extra)


def bent(x):
    """Offset that rises by 5 N towards the middle of the stroke: a straight line through it misses the turns by 3 N."""
    return 5.0 * np.sin(np.pi * x / 0.04)


@pytest.mark.parametrize("offset", [0.0, bent])
def test_a_well_sampled_peak_is_measured(make, offset):
    level = characterise_recordings(with_peaks(make, rate=1000.0, offset=offset)).levels[0]
    good = [p for p in level.peaks if not p.flags]
    assert len(good) >= 8
    a = np.linspace(0.0, 2e-3, 2001)
    truth = (5 * (1 - 2 * np.exp(-a / 1e-4)) + PEAK * np.exp(-a / DECAY) * (1 - np.exp(-a / 1e-4))).max()
    assert np.median([p.friction_n for p in good]) == pytest.approx(truth, abs=0.1 if offset == 0.0 else 0.55)
    assert level.sides[1]["dwell_s"] == pytest.approx(0.5, abs=0.05)
    assert all(p.loading_rate_n_s > 100 for p in good)
    for row in level.rows:
        assert row["breakaway_n"] == pytest.approx(truth, abs=0.1 if offset == 0.0 else 0.55)
        assert "breakaway_spoiled" not in row["flags"]


@pytest.mark.parametrize("noise", [0.3, 0.6])
def test_noise_of_the_force_does_not_raise_it(make, noise):
    """The largest of many noisy samples is too large by 2 to 3 standard deviations of the noise."""
    quiet = with_peaks(make, rate=1000.0)
    drawn = np.random.default_rng(5).normal(0.0, noise, len(quiet))
    rows = [
        characterise_recordings(replace(quiet, force_n=quiet.force_n + force)).levels[0].rows for force in (0.0, drawn)
    ]
    for exact, noisy in zip(*rows, strict=True):
        assert noisy["breakaway_n"] == pytest.approx(exact["breakaway_n"], abs=0.6 * noise)


def test_fewer_than_ten_samples_on_the_rise_spoil_it(make):
    """From 10 % to 90 % of 11.9 N it takes 19.5 ms, by 1 mm/s."""
    found = characterise_recordings(with_peaks(make, rate=460.0))
    level = found.levels[0]
    assert not any(p.flags for p in characterise_recordings(with_peaks(make, rate=550.0)).levels[0].peaks)
    assert [row.text for row in found.view().rows if row.quantity == "flags"] == ["breakaway_spoiled"]
    assert all("undersampled" in p.flags for p in level.peaks)
    assert all(np.isnan(row["breakaway_n"]) and "breakaway_spoiled" in row["flags"] for row in level.rows)


@pytest.mark.parametrize(("share", "is_spoiled"), [(0.095, False), (0.105, True)])
def test_a_tenth_of_the_rise_by_pressure_or_inertia_spoils_it(make, share, is_spoiled):
    """Of 11.9 N, from -5 N to the peak: twice the swing of the pressure, or 80 % of 10 mm/s within a sample, 8 m/s2."""
    changes = {"swing": 0.5 / (np.pi / 4.0 * 0.025**2), "mass_beyond_sensor_kg": 1.0 / 8.0}
    for flag, (name, per_newton) in zip(("pressure_transient", "inertia"), changes.items(), strict=True):
        changed = with_peaks(make, rate=1000.0, **{name: share * 11.87 * per_newton})
        flags = [peak.flags for peak in characterise_recordings(changed).levels[0].peaks]
        assert flags.count((flag,)) in ((9,) if is_spoiled else (0, 1))  # a rise begins at up to 10 %


def test_noise_of_the_pressure_is_no_transient(make):
    recording = with_peaks(make, rate=1000.0)
    noise = np.random.default_rng(1).normal(0.0, 500.0, len(recording))
    # Real noise of the pressure acts on the piston: the force carries it too, and the balance is free of it.
    noisy = replace(
        recording,
        pressure_b_pa=recording.pressure_b_pa + noise,
        force_n=recording.force_n + noise * recording.area_b_m2,
    )
    assert not any("pressure_transient" in p.flags for p in characterise_recordings(noisy).levels[0].peaks)
