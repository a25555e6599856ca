"""A survey of several seals: its intervals hold what they say on simulated seals, and it notices a curve."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.errors import FitError
from pneudrive.identify.static.model import at_conditions
from pneudrive.identify.static.survey import held_out, survey, survey_values

LEVELS = np.array([1e5, 3e5, 5e5, 7e5])


def seals(seed, *, count=6, scatter=0.08, between=0.12, bend=0.0):
    """Seals with two runs each of the first two, one of the rest; returns values, runs and a further run of each."""
    rng = np.random.default_rng([11, seed])
    groups, runs, further = {}, {}, {}
    for k in range(count):
        base, slope = rng.uniform(2.0, 8.0), rng.uniform(0.3, 1.5) * 1e-5
        own = scatter * np.exp(0.3 * rng.standard_normal())

        def curve(p, base=base, slope=slope):
            return (base + slope * p) * (1.0 + bend * ((p - 4e5) / 3e5) ** 2)

        def values(p, own=own, curve=curve):
            return curve(p) * (1.0 + between * rng.standard_normal() + own * rng.standard_normal(p.size))

        names = ("1", "2") if k < 2 else ("1",)
        pressure = np.tile(LEVELS, len(names))
        friction = np.concatenate([values(LEVELS) for _ in names])
        empty = at_conditions(np.full(pressure.size, 0.01), 0.0 * pressure, pressure)
        groups[f"seal {k}"] = type(empty)(
            empty.speed_m_s, friction, 0.01 * friction, *(getattr(empty, n) for n in ("gauge_a_pa", "gauge_b_pa")),
            empty.u_systematic_n, np.arange(pressure.size),
        )  # fmt: skip
        runs[f"seal {k}"] = np.repeat(names, LEVELS.size).tolist()
        further[f"seal {k}"] = values
    return groups, runs, further


def test_intervals_hold_a_further_run_and_a_further_recording_as_often_as_stated():
    at = np.array([2e5, 6e5])
    inside, half = [], []
    for seed in range(25):
        groups, runs, further = seals(seed)
        found = survey_values(groups, runs)
        for name, values in further.items():
            band = found.predict(name, speed_m_s=0.01, gauge_b_pa=at, probability=0.9)
            new = values(at)
            inside += ((band.lower_n <= new) & (new <= band.upper_n)).tolist()
            half += ((band.upper_n - band.lower_n) / 2.0 / band.friction_n).tolist()
    assert 0.86 <= np.mean(inside) <= 0.98, np.mean(inside)
    # 1.645 sqrt(2 between^2 + scatter^2 (1 + 1/4)) = 0.32 if all were known
    assert 0.32 < np.median(half) < 0.55


def test_a_straight_line_that_misses_is_noticed_and_one_that_holds_is_not():
    bent = [survey_values(*seals(seed, scatter=0.02, bend=0.25)[:2]) for seed in range(3)]
    assert all("does not hold" in " ".join(found.statements()) for found in bent)
    assert all(found.misses > 0.05 for found in bent)
    line = [survey_values(*seals(seed, scatter=0.02)[:2]) for seed in range(5)]
    assert sum("does not hold" in " ".join(found.statements()) for found in line) <= 1


def test_a_known_run_is_predicted_better_than_a_new_one():
    groups, runs, _ = seals(3)
    found = survey_values(groups, runs)
    known = found.predict("seal 0", speed_m_s=0.01, gauge_b_pa=4e5, run="1")
    new = found.predict("seal 0", speed_m_s=0.01, gauge_b_pa=4e5)
    assert known.upper_n - known.lower_n < 0.8 * (new.upper_n - new.lower_n)


def test_without_a_repeat_the_difference_of_runs_is_called_assumed():
    groups, _, _ = seals(1)
    alone = {name: data.take(np.arange(4)) for name, data in groups.items()}
    assert any("no seal was run twice" in said for said in survey_values(alone).statements())


def test_messages_name_what_is_there(make_map):
    curves = make_map(np.full(6, 0.01), 3.0 + np.arange(6.0), 0.1, gauge_b=1e5 * np.arange(6))
    found = survey(curves, ["O-ring"] * 12)
    own = found.seals["O-ring"].fit  # the fit of one seal has the verbs of any other
    assert len(own.recordings) == 6
    assert own.coordinates.tolist() == found.seals["O-ring"].theta.tolist()
    assert own.profile(["coulomb"])["coulomb"] == own.intervals["coulomb"]
    with pytest.raises(FitError, match=r"(?s)no seal 'Oring'.*Did you mean 'O-ring'"):
        found.predict("Oring", speed_m_s=0.01)
    with pytest.raises(FitError, match="no run '2'"):
        found.predict("O-ring", speed_m_s=0.01, run="2")
    with pytest.raises(FitError, match=r"(?s)no column 'seal'.*Known: flags, recording"):
        survey(curves, "seal")
    with pytest.raises(FitError, match=r"cannot hold out by 'day'"):
        held_out(curves, ["O-ring"] * 12, by="day")
    with pytest.raises(FitError, match="too few recordings for the number of parameters"):
        survey(curves.isel(row=slice(0, 6)), ["O-ring"] * 6)
