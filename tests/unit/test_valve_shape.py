"""Overlap and leakage of the valve of a drive file: the circuit's valve acts, and identify and validate know them."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import DescriptionError, FitError
from pneudrive.validate.balance import openings

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
START = "position = 200 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
STEPS = [(0.0, 0.05), (0.15, 0.6), (0.25, -0.05), (0.4, -0.5), (0.5, 0.15), (0.65, -0.15)]


@pytest.fixture(scope="module")
def plain():
    return pn.Drive.load("catalogue:reference")


@pytest.fixture(scope="module")
def recorded(plain):
    run = pn.simulate(plain.replace({"valve.overlap": 0.03}), STEPS, "0.8 s", initial=START)
    noise, size = np.random.default_rng(3), run.time.size
    columns = {"time_s": run.time.to_numpy(), "command": run.command.to_numpy()}
    columns["position_m"] = run.position.to_numpy() + 2e-6 * noise.standard_normal(size)
    return columns | {
        f"pressure_{c}_pa": run[f"pressure_{c}"].to_numpy() + 300.0 * noise.standard_normal(size) for c in "ab"
    }


def test_an_edge_opens_behind_its_overlap(plain):
    """A command u acts as (u - d) / (1 - d): the run is that of the valve without overlap under this command."""
    shifted = [(t, float(np.sign(u) * max(abs(u) - 0.1, 0.0) / 0.9)) for t, u in STEPS]
    with_overlap = pn.simulate(plain.replace({"valve.overlap": 0.1}), STEPS, "0.8 s", initial=START, rtol=1e-9)
    without = pn.simulate(plain, shifted, "0.8 s", initial=START, rtol=1e-9)
    assert np.abs(with_overlap.position - without.position).max() < 1e-8
    assert np.abs(without.position - pn.simulate(plain, STEPS, "0.8 s", initial=START).position).max() > 1e-2


def test_the_balances_use_the_openings_of_the_run(plain):
    leaky = plain.replace({"valve.overlap": 0.02, "valve.leakage": 0.004})
    found = pn.validate(leaky, pn.simulate(leaky, STEPS, "0.8 s", initial=START))
    assert found.verdicts[1].value < 1e-4
    assert found.diagnosis().is_clean
    shut = openings(leaky, np.zeros(1))
    assert shut == pytest.approx(np.full((1, 4), 0.004))
    assert openings(leaky, np.array([0.51]))[0] == pytest.approx([0.5, 0.0, 0.0, 0.5], abs=2e-7)


def test_a_drive_without_these_keys_is_as_before(plain):
    assert plain.description_hash == "6dd42b38838bd530334e75ffcda9d794a940c8a1734304a60ebb3537f6798480"
    assert plain.replace({"valve.overlap": 0.03}).description_hash != plain.description_hash
    with pytest.raises(DescriptionError, match=r"valve\.overlap: 1.0 is out of bounds"):
        plain.replace({"valve.overlap": 1.0})


def test_the_overlap_is_identified_and_applied(plain, recorded):
    fit = pn.identify(plain, recorded, ["valve.overlap", "valve.conductance"], segment="0.1 s")
    low, high = fit.intervals["valve.overlap"]
    assert low <= 0.03 <= high
    assert high - low < 1e-3
    assert fit.apply(plain).valve.overlap == pytest.approx(0.03, abs=5e-4)
    with pytest.raises(FitError, match=r"valve\.overlop is not a number of this drive"):
        pn.identify(plain, recorded, ["valve.overlop"])
