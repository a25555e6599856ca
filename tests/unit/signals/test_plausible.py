"""A recording in other units is refused in words before it comes out as strange physics; gaps are told."""

import numpy as np
import pytest

from oracle.drive_records import drive, record
from pneudrive.errors import RecordingError
from pneudrive.signals.drive_recording import check_plausible, drive_recording, refuse_standstill, time_gaps


@pytest.fixture(scope="module")
def columns():
    return record(drive(), 1, duration_s=1.0).columns


LIMITS = (drive().cylinder.stroke_m, drive().ambient.pressure_pa, drive().supply_pressure_pa)


@pytest.mark.parametrize(
    ("column", "wrong", "word"),
    [
        ("position_m", lambda x: 1e3 * x, "stroke"),
        ("position_m", lambda x: x - 0.5, "stroke"),
        ("pressure_a_pa", lambda p: 1e-5 * p, "unit"),
        ("pressure_b_pa", lambda p: np.abs(p - p.min()) + 1.0, "gauge"),
        ("time_s", lambda t: 1e3 * t, "ms"),
    ],
)
def test_another_unit_is_refused_with_what_to_look_at(columns, column, wrong, word):
    with pytest.raises(RecordingError, match=word):
        check_plausible(drive_recording({**columns, column: wrong(columns[column])}), *LIMITS)


def test_a_record_with_noise_and_a_few_outliers_is_taken(columns):
    torn = columns["pressure_a_pa"].copy()
    torn[::300] = 1.0
    check_plausible(drive_recording({**columns, "pressure_a_pa": torn}), *LIMITS)


def test_gaps_in_time_are_told_with_their_place(columns):
    keep = (columns["time_s"] < 0.4) | (columns["time_s"] > 0.6)
    (said,) = time_gaps([drive_recording({name: values[keep] for name, values in columns.items()})])
    assert "0.399 .. 0.601 s" in said
    assert not time_gaps([drive_recording(columns)])


def test_a_piston_that_never_moves_tells_nothing_of_friction_and_of_the_valve(columns):
    rng = np.random.default_rng(0)
    still = 0.1 + 1e-6 * rng.standard_normal(columns["time_s"].size)
    stands = drive_recording({**columns, "position_m": still})
    with pytest.raises(RecordingError, match=r"(?s)does not move.*valve\.conductance.*fixed volume"):
        refuse_standstill([stands], ["valve.conductance", "cylinder.leakage"])
    refuse_standstill([stands], ["cylinder.leakage"])
    refuse_standstill([stands, drive_recording(columns)], ["valve.conductance"])
