"""Designs: rows are functions of their place, shares and correlations are those asked for."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import pneudrive as pn
from pneudrive.ensemble.design import Lognormal, Normal, Triangular, Uniform
from pneudrive.ensemble.variation import Variation
from pneudrive.errors import CommandError
from pneudrive.identify.dynamic import DriveFit
from pneudrive.identify.files import read_fit

ROOT = Path(__file__).parents[3]
DRIVE = pn.Drive.load("catalogue:reference")
TWO = {"cylinder.bore": "uniform(20 mm, 30 mm)", "friction.coulomb": "normal(30 N, 10 %)"}


def rows_of(design):
    return design.rows(Variation(DRIVE, design.names))


@pytest.mark.parametrize("make", [pn.EnsembleDesign.sobol, pn.EnsembleDesign.latin_hypercube, pn.EnsembleDesign.random])
def test_rows_do_not_depend_on_the_chunk_in_which_they_are_asked_for(make):
    rows = rows_of(make(TWO, 10_000, seed=3, correlation={("cylinder.bore", "friction.coulomb"): 0.6}))
    whole = rows.take(0, 10_000)
    for first, last in ((5000, 5003), (0, 1), (4095, 4097), (9999, 10_000)):
        np.testing.assert_array_equal(rows.take(first, last), whole[first:last])
    scores = stats.norm.ppf(stats.uniform(0.02, 0.01).cdf(whole[:, 0])), whole[:, 1]
    assert np.corrcoef(scores)[0, 1] == pytest.approx(0.6, abs=0.02)
    assert whole[:, 1].mean() == pytest.approx(30.0, abs=0.1)
    assert whole[:, 1].std() == pytest.approx(3.0, abs=0.1)
    other = rows_of(make(TWO, 10_000, seed=4))
    assert not np.array_equal(other.take(0, 5), whole[:5])


def test_threads_that_take_rows_at_once_do_not_disturb_each_other():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    rows = rows_of(pn.EnsembleDesign.sobol(TWO, 1 << 14))
    whole = rows.take(0, 1 << 14)
    firsts = list(range(0, 1 << 14, 16))
    try:
        with ThreadPoolExecutor(8) as pool:
            parts = list(pool.map(lambda first: rows.take(first, first + 16), firsts))
    finally:
        sys.setswitchinterval(before)
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_a_hypercube_has_one_member_in_each_share_and_sobol_fills_evenly():
    for design, per_share in ((pn.EnsembleDesign.latin_hypercube(TWO, 100), 1), (pn.EnsembleDesign.sobol(TWO, 128), 2)):
        bore = rows_of(design).take(0, design.members)[:, 0]
        shares = np.floor((bore - 0.02) / 0.01 * (design.members // per_share)).astype(int)
        assert np.bincount(shares).tolist() == [per_share] * (design.members // per_share)


def test_a_grid_has_all_combinations_the_last_number_fastest():
    rows = rows_of(pn.EnsembleDesign.grid({"cylinder.bore": pn.grid("20 mm .. 30 mm", 3), "load.mass": [1.0, 2.0]}))
    assert rows.size == 6
    expected = [[0.02, 1.0], [0.02, 2.0], [0.025, 1.0], [0.025, 2.0], [0.03, 1.0], [0.03, 2.0]]
    np.testing.assert_allclose(rows.take(0, 6), expected)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (Uniform(2.0, 5.0), stats.uniform(2.0, 3.0)),
        (Triangular(2.0, 3.0, 6.0), stats.triang(0.25, 2.0, 4.0)),
        (Triangular(2.0, 2.0, 6.0), stats.triang(0.0, 2.0, 4.0)),
        (Normal(2.0, 0.5), stats.norm(2.0, 0.5)),
        (Lognormal(2.0, 0.5), stats.lognorm(np.sqrt(np.log1p(0.0625)), scale=2.0 / np.sqrt(1.0625))),
    ],
)
def test_quantiles_are_those_of_scipy(ours, theirs):
    share = np.linspace(0.01, 0.99, 25)
    np.testing.assert_allclose(ours.quantile(share), theirs.ppf(share), rtol=1e-12)


def test_quantities_are_read_in_the_unit_of_their_number():
    read = Variation(DRIVE, ["supply.pressure", "ambient.temperature"])
    pressure, temperature = read.reader("supply.pressure"), read.reader("ambient.temperature")
    assert Normal("6 bar gauge", "0.2 bar").in_si(pressure) == Normal(701300.0, 20000.0)
    assert Normal("20 degC", "5 K").in_si(temperature) == Normal(293.15, 5.0)
    assert Normal("20 degC", "5 degC").in_si(temperature).sd == pytest.approx(5.0)
    with pytest.raises(CommandError, match="abs or gauge"):
        Normal("6 bar", "0.2 bar").in_si(pressure)


def test_the_posterior_of_a_fit_has_its_values_and_its_covariance():
    names = ("friction.coulomb", "friction.breakaway", "cylinder.incline")
    spread, correlation = np.array([1.0, 1.5, 0.01]), np.array([[1, 0.8, 0], [0.8, 1, 0], [0, 0, 1]])
    fit = DriveFit(
        values={
            "friction.coulomb": 31.0,
            "friction.breakaway": 50.0,
            "cylinder.incline": 0.02,
            "friction.viscous": 41.0,
        },
        units={},
        free=names,
        covariance=correlation * np.outer(spread, spread),
        intervals={},
        systematic={},
        model_errors={},
        undetermined=(),
        notes=(),
        statistics={},
        provenance={},
        converged=True,
        sensors={},
        start=DRIVE,
    )
    rows = rows_of(pn.EnsembleDesign.posterior(fit, 4096))
    values = rows.take(0, 4096)
    np.testing.assert_allclose(values.mean(axis=0), [31.0, 50.0, 0.02], rtol=2e-3)
    np.testing.assert_allclose(np.cov(values.T), fit.covariance, rtol=0.1, atol=1e-4)
    assert (values[:, 1] > values[:, 0]).all()
    np.testing.assert_array_equal(rows.take(1000, 1002), values[1000:1002])


def test_the_posterior_of_a_friction_fit_takes_its_names_and_those_of_it_that_are_asked_for():
    fit = read_fit(ROOT / "tests/old_files/f77d3a3/map-fit.toml")
    some = pn.EnsembleDesign.posterior(fit, 64, names=["coulomb"])
    assert some.names == ["friction.coulomb"]
    low, high = fit.intervals["coulomb"]
    spread = rows_of(some).take(0, 64).std()
    assert spread == pytest.approx(fit.standard_errors["coulomb"], rel=0.1)
    assert low < fit.values["coulomb"] < high
    with pytest.raises(CommandError, match="no covariance of speed"):
        pn.EnsembleDesign.posterior(fit, 64, names=["speed"])


def test_correlations_that_contradict_each_other_are_refused():
    three = {**TWO, "load.mass": "uniform(1 kg, 2 kg)"}
    names = list(three)
    pairs = {(names[0], names[1]): 0.9, (names[1], names[2]): 0.9, (names[0], names[2]): -0.9}
    with pytest.raises(CommandError, match="contradict"):
        rows_of(pn.EnsembleDesign.sobol(three, 4, correlation=pairs))
    with pytest.raises(CommandError, match="does not vary"):
        rows_of(pn.EnsembleDesign.sobol(TWO, 4, correlation={("cylinder.bore", "load.mass"): 0.1}))


@pytest.mark.parametrize(
    ("name", "mean", "sd"),
    [("ambient.temperature", "20 degC", "5 K"), ("supply.pressure", "6 bar gauge", "0.5 bar")],
)
def test_a_share_of_what_does_not_count_from_zero_is_refused(name, mean, sd):
    """10 % of 20 degC are 2 K to one and 29 K to another."""
    for word in ("normal", "lognormal"):
        with pytest.raises(CommandError, match="on the zero of the scale"):
            rows_of(pn.EnsembleDesign.random({name: f"{word}({mean}, 10 %)"}, 4))
    assert rows_of(pn.EnsembleDesign.random({name: f"normal({mean}, {sd})"}, 4)).size == 4
    assert rows_of(pn.EnsembleDesign.random({"supply.pressure": "normal(7 bar abs, 10 %)"}, 4)).size == 4


def test_the_posterior_of_a_value_next_to_nothing_stays_as_small_as_it_is_known():
    """Friction that falls with speed leaves no viscous part: its logarithm is anywhere, the value is not."""
    n, speed = 20, np.geomspace(2e-3, 0.3, 20)
    noise = 0.1 * np.random.default_rng(2).standard_normal(n)
    columns = {"velocity_m_s": speed, "friction_n": 12.0 - 5.0 * speed + noise, "stderr_n": np.full(n, 0.1)}
    columns |= {"balance_n": columns["friction_n"], "direction": np.ones(n), "strokes": np.full(n, 5.0)}
    columns |= {f"pressure_{side}_pa": np.full(n, 1.013e5) for side in "ab"}
    table = xr.Dataset({name: ("row", values) for name, values in columns.items()})
    fit = pn.fit_friction(table.assign(recording=("row", [f"r{k}" for k in range(n)])), law="coulomb")
    assert fit.values["viscous"] < fit.standard_errors["viscous"]
    drive = fit.apply(DRIVE)
    design = pn.EnsembleDesign.posterior(fit, 1024)
    rows = dict(zip(design.names, design.rows(Variation(drive, design.names)).take(0, 1024).T, strict=True))
    error = fit.standard_errors["viscous"]
    assert rows["friction.viscous"].min() >= 0.0
    assert np.sqrt(np.mean(rows["friction.viscous"] ** 2)) == pytest.approx(error, rel=0.1)
    assert rows["friction.coulomb"].std() == pytest.approx(fit.standard_errors["coulomb"], rel=0.1)
