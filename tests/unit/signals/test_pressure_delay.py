"""The delay of the pressures of closed chambers, from recordings with a known delay and from a real gas spring."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle.gas_spring import AREAS, Truth, record
from pneudrive.characterise import load_recordings
from pneudrive.signals.recording import Recording, pressure_delay

DATA = Path(__file__).resolve().parents[3] / "data" / "measurements" / "mbari-2022-gas-spring"


def late(recording, seconds):
    """Return the recording with pressures that come later."""
    time = recording.time_s
    names = ("pressure_a_pa", "pressure_b_pa")
    return replace(recording, **{n: np.interp(time - seconds, time, getattr(recording, n)) for n in names})


@pytest.mark.parametrize(
    "truth",
    [
        Truth(delay_s=-0.2, heat=(10.0, 200.0)),
        Truth(delay_s=0.1, capacity=2000.0, outer=40.0, leak=4e-15),
    ],
)
def test_a_known_delay_returns(truth):
    """Also with a wall that stores heat and a leak, which the estimate does not model."""
    recording = record(truth)
    found = pressure_delay(recording)
    assert found.value_s == pytest.approx(truth.delay_s, abs=0.01)
    assert abs(found.value_s - truth.delay_s) < found.half_width_s < 0.05
    assert found.is_clear
    aligned = found.removed(recording)
    assert abs(pressure_delay(aligned).value_s) < 0.01
    assert abs(len(aligned) - len(recording)) <= 1 + abs(found.value_s) / 0.05


def test_a_delay_that_is_added_to_a_real_recording_is_found():
    charged, vented = load_recordings([DATA / "charged.exp.xz", DATA / "vented.exp.xz"], DATA / "layout.toml")
    before = pressure_delay(charged)
    assert not before.is_clear
    assert abs(before.value_s) < 0.02  # the delay of the recording itself, within the error of the model
    for seconds in (0.3, -0.3):
        after = pressure_delay(late(charged, seconds))
        assert after.value_s - before.value_s == pytest.approx(seconds, abs=0.01)
        assert after.is_clear
    assert pressure_delay(vented) is None


def test_chambers_under_a_valve_tell_no_delay():
    run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.2, 1 s: -0.2, 2 s: 0.2, 3 s: -0.2", "4 s")
    columns = [np.asarray(run[n]) for n in ("time", "position", "pressure_a", "pressure_b")]
    time, position, a, b = columns
    assert pressure_delay(Recording("run", time, position, 0.0 * time, a, b, *AREAS)) is None
