"""The paper's sentences hold on the simulated data, and the checks say no where the physics is another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pneudrive.campaign.planning.protocol import ready_protocols
from pneudrive.studies.bracha.figure import EXPERIMENTS, run_experiment, stick_slip_figures
from pneudrive.studies.bracha.reproduction import paper_figures

#: Breakaway no higher than sliding, no effect of pressure, no ageing: nothing of what the paper shows.
FLAT = (Path(__file__).parents[2] / "data/flat_rig.toml").read_text("utf-8")


@pytest.fixture(scope="module")
def figures(made):
    return made.figures


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("flat"), {}
    for name, (protocol, base) in EXPERIMENTS.items():
        rig, own = folder / f"{name}-rig.toml", folder / f"{name}.toml"
        rig.write_text(FLAT.format(base=base), encoding="utf-8")
        text = ready_protocols()[protocol].read_text(encoding="utf-8")
        text = text.replace("repeats = 5", "repeats = 2")  # of the stops: what is not there
        own.write_text(text.replace("count = 8", "count = 5"), encoding="utf-8")  # of the pressures
        made[name] = run_experiment(str(own), str(rig), str(folder / protocol), 3)
    return paper_figures(made)


def verdict(figure, said):
    return next(claim.verdict for claim in figure.claims if claim.said.startswith(said))


def test_all_figures_hold(figures):
    assert list(figures) == list(range(1, 10))
    for number, figure in figures.items():
        assert figure.number == number
        assert figure.claims
        assert all(np.isfinite(values).all() for values in figure.columns.values())
        assert all(np.isfinite(value) for value in figure.quantities.values())


def test_a_seal_without_stribeck_pressure_and_age_does_not_show_them(flat):
    assert verdict(flat[5], "the friction value is the largest") != "holds"
    assert verdict(flat[6], "for small values of speed") != "holds"
    assert verdict(flat[8], "Lower line") != "holds"
    assert verdict(flat[8], "as the pressure increases") == "does not hold"
    assert verdict(flat[8], "As a result of drive seal") == "does not hold"
    assert verdict(flat[9], "Even short-term stop") == "does not hold"
    assert verdict(flat[9], "static friction value") == "does not hold"
    assert all(claim.verdict == "holds" for number in (4, 7) for claim in flat[number].claims)  # the campaigns ran


def test_verdicts_are_those_of_the_numbers(figures):
    """Where ours differs from the paper, the table says so: a plain Stribeck point, a change that is soon over."""
    assert verdict(figures[6], "it is difficult to see") == "does not hold"
    assert verdict(figures[8], "as the pressure increases") == "holds in part"  # a Stribeck curve at 0.1 bar already
    assert figures[9].quantities["recovery_m"] < 2e-3
    assert verdict(figures[9], "Even short-term stop") == "holds in part"
    for number, said in (
        (1, "compressibility"),
        (2, "This model"),
        (3, "Another"),
        (5, "the friction value"),
        (6, "for small"),
        (8, "Lower line"),
    ):
        assert verdict(figures[number], said) == "holds"


@pytest.mark.parametrize("number", [1, 2, 3])
def test_stick_slip_meets_its_numbers(figures, number):
    figure = figures[number]
    time, position, velocity = (figure.columns[k] for k in ("time_s", "position_m", "velocity_m_s"))
    # measured again from the arrays, without the package: mean between the first and last slip
    slips = np.flatnonzero((velocity[1:] > 0.03) & (velocity[:-1] <= 0.03))
    first, last = slips[0], slips[-1]
    mean = (position[last] - position[first]) / (time[last] - time[first])
    inside = velocity[first:last]
    assert mean == pytest.approx(9.34e-3, abs=0.5e-3)
    assert slips.size - 1 >= 5
    assert inside.max() >= 3.0 * mean
    assert np.mean(inside < 0.2 * mean) >= 0.3


def test_stribeck_rests_exactly_and_lugre_does_not(figures):
    rest = figures[3]
    assert np.mean(rest.columns["velocity_m_s"] == 0.0) == rest.quantities["rest_share"] > 0.5
    assert np.mean(figures[2].columns["velocity_m_s"] == 0.0) < 0.01


def test_sensors_of_figure_1_show_counts_and_noise():
    one, two = (next(stick_slip_figures(seed)) for seed in (1, 2))
    counts = one.columns["position_m"] / 5e-6
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.std(one.columns["pressure_a_pa"] - two.columns["pressure_a_pa"]) == pytest.approx(
        2**0.5 * 200.0, rel=0.05
    )


def test_protocol_and_settling_against_the_truth(figures):
    figure = figures[6]
    c = figure.columns
    inside = (c["low_n"] <= c["friction_true_n"]) & (c["friction_true_n"] <= c["high_n"])
    assert np.mean(inside) > 0.8  # of each cycle, whose own scatter of 0.3 % the band of the mean does not hold
    assert figure.quantities["settled_error_n"] < 0.1
    assert abs(figure.quantities["protocol_error_n"]) > figure.quantities["settled_error_n"]
    assert figure.quantities["protocol_error_at_m_s"] > 0.2  # where starting and stopping take longest


def test_curves_under_pressure_divide_into_air_and_seal(figures):
    c = figures[8].columns
    assert c["friction_n"].shape == (c["gauge_pa"].size, c["speed_m_s"].size)
    middle = c["speed_m_s"] < 0.1  # above it the paper's mean takes in the ramps, the parts do not
    np.testing.assert_allclose((c["air_n"] + c["seal_n"])[:, middle], c["friction_n"][:, middle], rtol=0.03)
    assert np.all(np.diff(c["air_n"][:, -1]) > 0.0)  # denser air takes more force
    np.testing.assert_allclose(c["seal_n"][:, middle], c["friction_true_n"][:, middle], atol=0.2)
    # at the top the force of the sensor is more wrong as friction than what is left when the air is taken out
    top = np.abs(c["friction_n"][:, -1] - c["friction_true_n"][:, -1])
    assert np.all(top > 10.0 * np.abs(c["seal_n"][:, -1] - c["friction_true_n"][:, -1]))
