"""Equations that are singular, and numbers beyond the largest one: a FitError in words, never NumPy's own error."""

import dataclasses

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import FitError
from pneudrive.estimate.transforms import Transforms
from pneudrive.identify.dynamic.problem import Shooter
from pneudrive.identify.dynamic.search import Equations, reduced, start_solution

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
FREE = ["friction.coulomb", "valve.conductance"]


def test_states_of_a_start_that_act_alike_share_the_effect():
    """1e22 u u' + I is singular in numbers; any solution for u is as good as another, and none is large."""
    u = np.array([1.0, 3.0, 0.5])
    n = 1e22 * np.outer(u, u) + np.eye(3)
    block = Equations(n, np.zeros(3))
    solution = start_solution(block, u)
    assert n @ solution == pytest.approx(u, rel=1e-6)
    assert np.abs(solution).max() < 1e-21
    information, gradient = reduced([Equations(np.pad(n, ((1, 0), (1, 0))), np.zeros(4))], 1)
    assert np.isfinite(information).all()
    assert np.isfinite(gradient).all()


def test_coordinates_far_outside_have_values_and_no_warning():
    scales = Transforms([0.0, 0.0, -np.inf], [np.inf, 1.0, np.inf])
    for q in (-1e5, 1e5):
        assert not np.isnan(scales.natural(np.full(3, q))).any()
        assert not np.isnan(scales.jacobian(np.full(3, q))).all()


@pytest.fixture(scope="module")
def run():
    return pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.2, 0.2 s: -0.2", "0.4 s")


def test_derivatives_that_overflow_name_the_number(run, monkeypatch):
    whole = Shooter.run

    def overflowing(self, *args, **options):
        shot = whole(self, *args, **options)
        by = shot.by_parameter.copy()
        by[..., :1] *= 1e300
        return dataclasses.replace(shot, by_parameter=by)

    monkeypatch.setattr(Shooter, "run", overflowing)
    with pytest.raises(FitError, match=r"derivatives by friction\.coulomb overflow"):
        pn.identify(pn.Drive.load("catalogue:reference").replace({"friction.coulomb": "25 N"}), run, FREE)


def test_a_shut_valve_ends_in_words(run):
    """The valve is never open, so that the recording does not depend on its conductance."""
    shut = {name: run[name].to_numpy() for name in ("position", "pressure_a", "pressure_b")}
    columns = {"time_s": run.time.to_numpy(), "command": np.zeros(run.time.size), "position_m": shut["position"]}
    columns |= {f"{name}_pa": shut[name] for name in ("pressure_a", "pressure_b")}
    fit = pn.identify(pn.Drive.load("catalogue:reference"), columns, ["valve.conductance", "cylinder.heat_transfer"])
    assert "valve.conductance cannot be determined: the recordings do not depend on it" in "\n".join(fit.statements())
