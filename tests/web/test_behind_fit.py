"""What lies behind a fit: residuals, profiles, ellipses and next points, as Python gives them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.characterise import write_map
from pneudrive.errors import FitError
from pneudrive.figures import Line, Markers
from pneudrive.identify.identified import FittedData, comparison_figure
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import FrictionFit, ellipses, with_map
from web.client import get, post, run_line, run_python
from web.conftest import Served
from web.maps import WIDE, coulomb, friction_map, stribeck

FOLDER = "results/seal"
FIT = f"{FOLDER}/fit.toml"


@pytest.fixture
def fitted(served: Served) -> Served:
    (served.folder / FOLDER).mkdir(parents=True)
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5), noise_n=0.2)
    write_map(curves, served.folder / FOLDER / "map.parquet")
    pn.fit_friction(curves, pressure_dependence=True).to_toml(served.folder / FIT)
    return served


def panels_of(found: dict) -> dict[str, list[dict]]:
    """Return the panels of the figures of an answer, by the names of the figures."""
    return {one["name"]: one["figure"]["panels"] for one in found["view"]["figures"]}


@pytest.mark.parametrize(("axis", "mark"), [("speed_m_s", Markers), ("time_s", Line)])
def test_many_rows_of_a_map_are_points_and_many_samples_a_line(axis: str, mark: type) -> None:
    values = np.linspace(1.0, 2.0, 300)
    figure = comparison_figure({"all": FittedData(axis, "friction_n", values, values, values)})
    assert all(isinstance(panel.marks[0], mark) for panel in figure.panels)


def test_residuals_profiles_and_ellipses_are_those_of_the_fit(fitted: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    found = get(fitted, "/api/behind", path=FIT)
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5), noise_n=0.2)
    whole = pn.fit_friction(curves, pressure_dependence=True)  # which has its data
    data = whole.compared()["friction"]
    panels = panels_of(found)
    mark, _ = panels["Friction and residuals over speed"][1]["marks"]
    assert np.array_equal(np.array([mark["x"], mark["y"]]), np.array([data.at, data.measured - data.model]))
    assert np.std(mark["y"]) == pytest.approx(0.2, rel=0.3)  # the noise, and no law
    for panel in panels["Profiles"]:
        name, unit = panel["title"].removeprefix("Profile of "), panel["x"]["unit"]
        x, y = (np.array(panel["marks"][0][side]) for side in "xy")
        size = {"N/bar": 1e-5, "mm/s": 1e-3}.get(unit, 1.0)
        low, high = (end / size for end in whole.intervals[name])
        assert x[np.isclose(y, 95.0)] == pytest.approx((low, high), rel=1e-9)
        assert np.all(np.diff(x) >= 0.0)  # a likelier interval is wider
        assert np.argmin(y) == np.argmin(np.abs(x - whole.values[name] / size))
    assert {panel["title"].removeprefix("Profile of ") for panel in panels["Profiles"]} == set(whole.free)

    pair = next(one for one in panels["Values that change together"] if one["title"].startswith("viscous over coulomb"))
    assert float(pair["title"].split()[-1]) < -0.5  # more of the one, less of the other
    outline = np.array([pair["marks"][0]["x"], pair["marks"][0]["y"]]).T
    high = outline[outline[:, 0] > outline[:, 0].mean()]
    assert high[:, 1].mean() < outline[:, 1].mean()
    half = 0.5 * np.ptp(outline[:, 0])
    low, top = whole.intervals["coulomb"]
    assert half == pytest.approx(0.5 * (top - low), rel=0.25)  # the profile is nearly of first order there

    monkeypatch.chdir(fitted.folder)
    names = run_python(found["python"])
    assert np.array_equal(names["residuals"], data.measured - data.model)
    assert names["ends"].keys() == set(whole.free)
    monkeypatch.setattr(
        "pneudrive.report.page.write_fit_report", lambda fit, folder: Path(folder) / str(len(fit.compared()))
    )
    assert run_line(found["command"]) == 0


def test_an_ellipse_is_that_of_the_normal_equations() -> None:
    """Of a straight line through values of one precision: covariance (X'X)^-1, and t standard errors as its shadow."""
    fit = pn.fit_friction(friction_map(coulomb(30.0), WIDE, noise_n=0.1), "coulomb")
    ((names, _, points),) = ellipses(fit)
    columns = np.column_stack([np.ones(2 * len(WIDE)), np.tile(WIDE, 2)])
    shape = columns.T @ columns
    away = points - [fit.values[name] for name in names]
    size = np.einsum("ni,ij,nj->n", away, shape, away)
    assert np.allclose(size, size[0], rtol=1e-6)
    assert np.sqrt(size[0]) / fit.reach == pytest.approx(0.1, rel=0.5)  # the noise of one value, N
    assert np.ptp(points[:, 0]) == pytest.approx(2.0 * fit.reach * fit.standard_errors["coulomb"], rel=2e-3)


def test_a_map_that_changed_shows_no_residuals(fitted: Served) -> None:
    write_map(friction_map(coulomb(30.0)), fitted.folder / FOLDER / "map.parquet")
    found = get(fitted, "/api/behind", path=FIT)
    assert list(panels_of(found)) == ["Values that change together"]
    assert "this map was removed or changed" in found["view"]["title"]
    with pytest.raises(FitError, match="not the one of this fit"):
        with_map(FrictionFit.from_toml(fitted.folder / FIT), friction_map(coulomb(30.0)))


def test_next_points_are_those_of_the_command_and_of_python(
    fitted: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    found = get(fitted, "/api/next", path=FIT, points="12")
    points, expected = (table["rows"] for table in found["view"]["tables"])
    assert sum(int(repeats) for *_, repeats in points) == 12
    for _, now, then, _ in expected:
        assert float(then) < float(now)
    monkeypatch.chdir(fitted.folder)
    run_python(found["python"])
    first = capsys.readouterr().out.splitlines()[2].split()
    assert run_line(found["command"]) == 0
    assert first in [line.split() for line in capsys.readouterr().out.splitlines()]
    assert first[0] == points[0][0]
    job = {"kind": "design", "fit": FIT, "points": 12, "name": "next"}
    assert run_line(post(fitted, "/api/work", job)["command"]) == 0
    text = (fitted.folder / "next.toml").read_text()
    written = [float(text) for text in re.findall(r'"([\d.]+) mm/s"', text)]
    for speed, *_ in points:
        assert any(f"{one:.3g}" == speed for one in written)
    read_protocol(fitted.folder / "next.toml")
    for wrong in ({"points": "0"}, {"points": "x"}, {"path": "axis.toml"}, {"path": "../fit.toml"}):
        assert get(fitted, "/api/next", status=400, **({"path": FIT} | wrong))["problems"]
    for wrong in ({"points": 0}, {"points": "3"}, {"name": "a/b"}, {"fit": "missing.toml"}):
        assert post(fitted, "/api/jobs", job | wrong, 400)["problems"]


# --- A friction map at one speed, and what another map lies above it.

GAUGES = (0.0, 2e5, 4e5)
NEW, WORN = "results/new/map.parquet", "results/worn/map.parquet"


def wear(speed: np.ndarray) -> np.ndarray:
    return 4.0 + 16.0 * speed


@pytest.fixture
def maps(served: Served) -> Served:
    for name, added in ((NEW, 0.0), (WORN, 1.0)):
        path = served.folder / name
        path.parent.mkdir(parents=True)
        noise = 0.1 + 0.1 * added  # another noise in all
        curves = friction_map(lambda v, g, a=added: stribeck(v, g) + a * wear(v), WIDE, GAUGES, noise)
        write_map(curves, path)
        pn.fit_friction(curves, pressure_dependence=True).to_toml(path.with_name("fit.toml"))
    return served


def test_a_map_at_one_speed_is_friction_over_pressure(maps: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    found = get(maps, "/api/slice", path=NEW, speed="0.0305")
    assert found["chamber"] == "b"
    (group,) = found["groups"]
    assert {round(point["speed"], 9) for point in group["points"]} == {0.03}  # the level beside, and no other
    assert {round(point["x"]) for point in group["points"]} == {0, 200000, 400000}
    gauge, friction = np.array(group["curve"]["x"]), np.array(group["curve"]["y"])
    assert np.all(np.abs(friction - stribeck(np.full(len(gauge), 0.0305), gauge)) < 0.3)
    assert np.ptp(friction) == pytest.approx(3e-5 * 4e5, rel=0.05)
    assert np.all(group["curve"]["low"] <= friction)
    monkeypatch.chdir(maps.folder)
    names = run_python(found["python"])
    (said,) = names["found"]
    assert np.array_equal(said.friction_n, friction)
    for speed in ("0", "-1", "nan", "x", ""):
        assert get(maps, "/api/slice", status=400, path=NEW, speed=speed)["problems"]


def test_what_a_worn_seal_adds_is_found_with_its_band(maps: Served) -> None:
    pair = {"before": f"{NEW.rpartition('/')[0]}/fit.toml", "after": f"{WORN.rpartition('/')[0]}/fit.toml"}
    panels = post(maps, "/api/compare", pair)["figure"]["figure"]["panels"]
    differences = [panel["marks"] for panel in panels if panel["title"].startswith("worn less new")]
    assert len(differences) == 2  # at both ends of the pressure
    inside = []
    for band, line, _ in differences:
        speed, gap, low, high = (np.array(values) for values in (line["x"], line["y"], band["low"], band["high"]))
        assert np.abs(gap - wear(speed)).max() < 0.3
        inside.append(np.mean((low <= wear(speed)) & (wear(speed) <= high)))
    assert np.mean(inside) > 0.8


def test_each_seal_of_many_has_its_curves_and_the_python_names_its_fit(
    maps: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten seals at three pressures are 30 pairs: more than a panel has line styles, but three for each seal."""
    folder = maps.folder / "results" / "seals"
    folder.mkdir()
    each = []
    for number in range(10):
        one = friction_map(stribeck, WIDE, GAUGES, 0.2 + 0.1 * number)
        one["recording"] = one["recording"] + f"-{number}"
        each.append(one.assign(seal=("row", [f"S{number}"] * one.sizes["row"])))
        pn.fit_friction(each[-1], pressure_dependence=True).to_toml(folder / fit_file(f"S{number}"))
    write_map(xr.concat(each, "row", combine_attrs="override"), folder / "map.parquet")
    shown = get(maps, "/api/map", path="results/seals/map.parquet")["groups"]
    assert [("curve" in group) for group in shown] == [True] * 10 * len(GAUGES)
    monkeypatch.chdir(maps.folder)
    cut = get(maps, "/api/slice", path="results/seals/map.parquet", speed="0.03")
    names = run_python(cut["python"])
    assert [group["assembly"] for group in cut["groups"]] == [f"S{number}" for number in range(10)]
    for group, said in zip(cut["groups"], names["found"], strict=True):
        assert list(said.friction_n) == group["curve"]["y"]
