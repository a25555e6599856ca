"""A friction map as a surface: the fit over speed and pressure, and where it is extrapolated."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.characterise import write_map
from web.conftest import Served
from web.maps import AIR_PA, WIDE, friction_map, stribeck
from web.test_recordings import get


def put(served: Served, curves: xr.Dataset, *, fitted: bool = True) -> None:
    write_map(curves, served.folder / "map.parquet")
    if fitted:
        pn.fit_friction(curves, pressure_dependence=True).to_toml(served.folder / "fit.toml")


def test_the_surface_is_the_law_and_says_where_nothing_was_measured(served: Served) -> None:
    """At 4 bar fast speeds were not measured: the surface is extrapolated there, and less and less towards 2 bar."""
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5))
    is_slow = (curves["pressure_b_pa"] < AIR_PA + 3e5) | (abs(curves["velocity_m_s"]) < 0.02)
    put(served, curves.where(is_slow, drop=True).astype(curves.dtypes))
    found = get(served, "/api/surface", path="map.parquet")
    (level,) = found["levels"]
    assert (found["chamber"], level["label"], found["fit"]) == ("b", "chamber a at 0 bar gauge", "")
    speeds, gauges = np.array(found["speeds"]), np.array(found["gauges"])
    assert (speeds[0], speeds[-1], gauges[0]) == pytest.approx((0.002, 0.25, 0.0), abs=1e-6)
    friction, inside = np.array(level["friction"]), np.array(level["inside"])
    assert friction == pytest.approx(stribeck(*np.meshgrid(speeds, gauges)), rel=0.03)
    assert inside[gauges <= 2e5].all()
    assert np.array_equal(inside[-1], speeds <= 0.016 * (1 + 1e-9))
    halfway = inside[np.argmin(abs(gauges - 3e5))]
    assert speeds[halfway][-1] == pytest.approx(np.sqrt(0.016 * 0.25), rel=0.1)  # the logarithm goes along a line
    groups = get(served, "/api/map", path="map.parquet")["groups"]
    for number, expected in zip(level["groups"], level["expected"], strict=True):
        points = groups[number]["points"]
        assert expected == pytest.approx([one["friction"] for one in points], rel=0.03)


def test_each_pressure_of_the_other_chamber_has_a_surface_over_all_that_was_measured(served: Served) -> None:
    maps = [friction_map(stribeck, WIDE, gauges) for gauges in ((0.0, 2e5, 4e5), (0.0, 1e5), (3e5,))]
    for k, one in enumerate(maps):
        one["pressure_a_pa"] = one["pressure_a_pa"] + 1e5 * k
        one["recording"] = "day " + str(k) + " " + one["recording"].astype(object)
    put(served, xr.concat(maps, "row"))
    found = get(served, "/api/surface", path="map.parquet")
    assert [one["label"] for one in found["levels"]] == [f"chamber a at {k} bar gauge" for k in (0, 1)]  # at 2 one only
    assert [one["at"] for one in found["levels"]] == [pytest.approx([0.0, 2e5, 4e5]), pytest.approx([0.0, 1e5])]
    gauges, inside = np.array(found["gauges"]), np.array(found["levels"][1]["inside"])
    assert np.array_equal(inside.any(axis=1), gauges <= 1e5 + 1e-3)


def test_pressures_that_were_varied_together_are_one_surface(served: Served) -> None:
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5))
    curves["pressure_a_pa"] = AIR_PA + 0.25 * (curves["pressure_b_pa"] - AIR_PA)
    put(served, curves)
    (level,) = get(served, "/api/surface", path="map.parquet")["levels"]
    assert level["label"] == "chamber a from 0 to 1 bar gauge along with it"
    assert np.all(level["inside"])
    assert np.diff(np.array(level["friction"])[:, 0]).min() > 0.0


def test_a_map_without_a_fit_or_of_one_pressure_says_so(served: Served) -> None:
    put(served, friction_map(stribeck, WIDE, (0.0, 2e5)), fitted=False)
    found = get(served, "/api/surface", path="map.parquet")
    assert "no fit.toml beside the map" in found["fit"]
    assert found["levels"][0]["friction"] is None
    assert found["levels"][0]["at"] == pytest.approx([0.0, 2e5])
    put(served, friction_map(stribeck, WIDE, (2e5,)))
    assert get(served, "/api/surface", path="map.parquet")["levels"] == []
    put(served, friction_map(stribeck, (0.1,), (0.0, 2e5)), fitted=False)
    assert get(served, "/api/surface", path="map.parquet")["levels"] == []
    assert get(served, "/api/surface", 400, path="../map.parquet")["problems"]
