"""What lies behind a fit: residuals, profiles, ellipses and next points, as Python gives them."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.characterise import write_map
from pneudrive.cli.main import run as run_command
from pneudrive.errors import FitError
from pneudrive.identify.static.result import FrictionFit, ellipses, with_map
from web.conftest import Served
from web.maps import WIDE, coulomb, friction_map, stribeck
from web.test_friction import post
from web.test_recordings import get

FOLDER = "results/seal"
FIT = f"{FOLDER}/fit.toml"


@pytest.fixture
def fitted(served: Served) -> Served:
    (served.folder / FOLDER).mkdir(parents=True)
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5), noise_n=0.2)
    write_map(curves, served.folder / FOLDER / "map.parquet")
    pn.fit_friction(curves, pressure_dependence=True).to_toml(served.folder / FIT)
    return served


def test_residuals_profiles_and_ellipses_are_those_of_the_fit(fitted: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    found = get(fitted, "/api/behind", path=FIT)
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5), noise_n=0.2)
    whole = pn.fit_friction(curves, pressure_dependence=True)  # which has its data
    data = whole.compared()["friction"]
    assert np.array_equal(found["residuals"], np.column_stack([data.at, data.measured - data.model]))
    assert np.std([one for _, one in found["residuals"]]) == pytest.approx(0.2, rel=0.3)  # the noise, and no law
    for one in found["profiles"]:
        at = one["probability"].index(0.95)
        size = {"N/bar": 1e-5, "mm/s": 1e-3}.get(one["unit"], 1.0)
        low, high = (end / size for end in whole.intervals[one["name"]])
        assert (one["low"][at], one["high"][at]) == pytest.approx((low, high), rel=1e-9)
        assert np.all(np.diff(one["high"]) >= 0.0)  # a likelier interval is wider
        assert np.all(np.diff(one["low"]) <= 0.0)
    assert {one["name"] for one in found["profiles"]} == set(whole.free)

    pairs = {(one["x"]["name"], one["y"]["name"]): one for one in found["ellipses"]}
    pair = pairs["coulomb", "viscous"]
    assert pair["correlation"] < -0.5  # more of the one, less of the other
    outline = np.array(pair["points"])
    high = outline[outline[:, 0] > outline[:, 0].mean()]
    assert high[:, 1].mean() < outline[:, 1].mean()
    half = 0.5 * np.ptp(outline[:, 0])
    low, top = whole.intervals["coulomb"]
    assert half == pytest.approx(0.5 * (top - low), rel=0.25)  # the profile is nearly of first order there

    monkeypatch.chdir(fitted.folder)
    names: dict = {}
    exec(found["python"], names)
    assert np.array_equal(names["residuals"], data.measured - data.model)
    assert names["ends"].keys() == set(whole.free)
    monkeypatch.setattr(
        "pneudrive.report.fit.write_fit_report", lambda fit, folder: Path(folder) / str(len(fit.compared()))
    )
    assert run_command(shlex.split(found["command"])[1:]) == 0


def test_an_ellipse_is_that_of_the_normal_equations() -> None:
    """Of a straight line through values of one precision: covariance (X'X)^-1, and t standard errors as its shadow."""
    fit = pn.fit_friction(friction_map(coulomb(30.0), WIDE, noise_n=0.1), "coulomb", robust=False)
    (pair,) = ellipses(fit)
    columns = np.column_stack([np.ones(2 * len(WIDE)), np.tile(WIDE, 2)])
    shape = columns.T @ columns
    away = pair.points - [fit.values[name] for name in (pair.x, pair.y)]
    size = np.einsum("ni,ij,nj->n", away, shape, away)
    assert np.allclose(size, size[0], rtol=1e-6)
    assert np.sqrt(size[0]) / fit.reach == pytest.approx(0.1, rel=0.5)  # the noise of one value, N
    assert np.ptp(pair.points[:, 0]) == pytest.approx(2.0 * fit.reach * fit.standard_errors["coulomb"], rel=2e-3)


def test_a_map_that_changed_shows_no_residuals(fitted: Served) -> None:
    write_map(friction_map(coulomb(30.0)), fitted.folder / FOLDER / "map.parquet")
    found = get(fitted, "/api/behind", path=FIT)
    assert found["residuals"] == found["profiles"] == []
    assert "it was removed or changed" in found["why"]
    assert found["ellipses"]
    with pytest.raises(FitError, match="not the one of this fit"):
        with_map(FrictionFit.from_toml(fitted.folder / FIT), friction_map(coulomb(30.0)))


def test_next_points_are_those_of_the_command_and_of_python(
    fitted: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    found = get(fitted, "/api/next", path=FIT, points="12")
    assert sum(one["repeats"] for one in found["points"]) == 12
    for one in found["expected"]:
        assert one["then"] < one["now"]
    monkeypatch.chdir(fitted.folder)
    exec(found["python"], {})
    by_python = capsys.readouterr().out
    assert run_command(shlex.split(found["command"])[1:]) == 0
    assert by_python.splitlines()[1] in capsys.readouterr().out
    assert f"{1e3 * found['points'][0]['speed_m_s']:8.3g} mm/s" in by_python
    job = {"kind": "design", "fit": FIT, "points": 12, "name": "next"}
    assert run_command(shlex.split(post(fitted, "/api/work", job)["command"])[1:]) == 0
    text = (fitted.folder / "next.toml").read_text()
    for one in found["points"]:
        assert f'"{1e3 * one["speed_m_s"]:.6g} mm/s"' in text
    read_protocol(fitted.folder / "next.toml")
    for wrong in ({"points": "0"}, {"points": "x"}, {"path": "axis.toml"}, {"path": "../fit.toml"}):
        assert get(fitted, "/api/next", status=400, **({"path": FIT} | wrong))["problems"]
    for wrong in ({"points": 0}, {"points": "3"}, {"name": "a/b"}, {"fit": "missing.toml"}):
        assert post(fitted, "/api/jobs", job | wrong, 400)["problems"]
