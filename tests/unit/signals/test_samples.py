"""Bad samples are flagged, counted, and kept out of the averages."""

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings
from pneudrive.signals.recording import clean


def changed(recording, channel, where, value):
    values = getattr(recording, channel).copy()
    values[where] = value
    return replace(recording, **{channel: values})


def test_a_clean_recording_has_no_flags(make):
    assert clean(make()).flags == {}
    assert clean(make(noise=0.0, position_noise=0.0)).flags == {}


def test_non_finite_samples(make):
    recording = changed(make(), "force_n", [100, 200], [np.nan, np.inf])
    assert clean(recording).flags == {"non_finite": 2}
    assert characterise_recordings(recording).levels[0].friction_n == pytest.approx(5.0, abs=0.03)


def test_spikes_are_found_in_every_channel(make):
    for channel, size in (("force_n", 50.0), ("pressure_b_pa", 1e5), ("position_m", 0.01)):
        recording = make(swing=0.02e5)
        noisy = replace(
            recording, pressure_b_pa=recording.pressure_b_pa + np.random.default_rng(1).normal(0, 50, len(recording))
        )
        for at in (150, 555):
            noisy = changed(noisy, channel, at, getattr(noisy, channel)[at] + size)
        found = clean(noisy)
        assert found.flags == {"spike": 2}
        assert len(found) == len(noisy) - 2


@pytest.mark.parametrize(("channel", "size"), [("force_n", 50.0), ("pressure_b_pa", 1e5), ("position_m", 0.01)])
def test_many_spikes_do_not_hide_each_other(make, channel, size):
    recording = make(strokes=20)
    recording = replace(
        recording, pressure_b_pa=recording.pressure_b_pa + np.random.default_rng(1).normal(0, 50, len(recording))
    )
    at = np.arange(150, len(recording) - 50, 97)  # 1 % of the samples
    noisy = changed(recording, channel, at, getattr(recording, channel)[at] + size)
    assert clean(noisy).flags == {"spike": at.size}


def test_a_reversal_is_no_spike(make):
    assert "spike" not in clean(make(presliding=1e-5, noise=0.0)).flags


def test_saturation(make):
    recording = make(friction=lambda x: 5.0 + 200.0 * x)
    clipped = clean(replace(recording, force_n=np.minimum(recording.force_n, 155.0)))
    assert clipped.flags["saturated"] == int((recording.force_n >= 155.0).sum()) > 100
    limited = replace(recording, limits={"force_n": (-1e3, 150.0)})
    assert clean(limited).flags["saturated"] == int((recording.force_n >= 150.0).sum())


def test_a_stuck_sensor(make):
    recording = make()
    stuck = changed(recording, "force_n", slice(600, 700), recording.force_n[600])
    assert clean(stuck).flags == {"stuck": 100, "gap": 1}
    frozen = changed(recording, "position_m", slice(600, 700), recording.position_m[600])
    assert clean(frozen).flags["stuck"] >= 90


def test_gaps_and_repeated_times(make):
    recording = make()
    keep = np.ones(len(recording), bool)
    keep[500:560] = False
    cut = replace(
        recording,
        **{
            c: getattr(recording, c)[keep]
            for c in ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
        },
    )
    assert clean(cut).flags == {"gap": 1}
    doubled = changed(recording, "time_s", 300, recording.time_s[299])
    assert clean(doubled).flags == {"repeated_time": 1}
