"""A spectrum holds the variance of its signal, and a sine stands at its frequency."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.characterise import write_map
from pneudrive.errors import RecordingError
from pneudrive.signals.channels import amplitude_density
from web.conftest import Served
from web.frames import unpack
from web.maps import WIDE, friction_map, stribeck
from web.test_sizing import TASK


def test_a_sine_in_noise_in_a_view_of_a_recording(served: Served) -> None:
    """Variance of noise 0.3^2, of a sine of 2 at 50 Hz 2^2/2; in the view alone, and in the unit of the column."""
    time = np.arange(200_000) * 1e-3
    force = 0.3 * np.random.default_rng(1).standard_normal(len(time))
    force[100_000:] += 2.0 * np.sin(2.0 * np.pi * 50.0 * time[100_000:])
    pl.DataFrame({"time_s": time, "force_n": 7.0 + force}).write_parquet(served.folder / "rig.parquet")
    found = {}
    for name, span in (("noise", ("0", "99.9")), ("sine", ("100.05", "199"))):
        given = {"path": "rig.parquet", "from": span[0], "to": span[1], "columns": "force_n"}
        for _ in range(50):
            answered = served.client.get("/api/spectrum", params=given, headers=served.headers)
            if answered.status_code == 200:
                break
        _, arrays = unpack(answered.content)
        found[name] = arrays["hz/force_n"], arrays["density/force_n"]
    for name, variance in (("noise", 0.09), ("sine", 2.09)):
        hz, density = found[name]
        assert np.trapezoid(density**2, hz) == pytest.approx(variance, rel=0.02)
        assert hz[-1] == pytest.approx(500.0)
    hz, density = found["sine"]
    assert hz[density.argmax()] == pytest.approx(50.0, abs=hz[0])
    assert np.median(found["noise"][1]) == pytest.approx(0.3 / 500.0**0.5, rel=0.1)
    given |= {"from": "1", "to": "1.5"}
    _, arrays = unpack(served.client.get("/api/samples", params=given, headers=served.headers).content)
    assert np.allclose(arrays["time"], time[1000:1501])  # every sample, where a plot has two values of each pixel
    assert np.allclose(arrays["force_n"], 7.0 + force[1000:1501])


def test_what_has_no_spectrum_is_refused(served: Served) -> None:
    time = np.arange(100) * 1e-3
    uneven = time.copy()
    uneven[50:] += 5e-4
    for times, values, words in (
        (uneven, time, "evenly"),
        (time, np.where(time == 0.05, np.nan, 1.0), "a value is missing"),
        (time[:9], time[:9], "too few"),
        (0.0 * time, time, "evenly"),
    ):
        with pytest.raises(RecordingError, match=words):
            amplitude_density(times, values)


# --- The overview has a line about each file; a damaged file has none and hides no other.


def test_each_file_says_what_it_holds(served: Served) -> None:
    curves = friction_map(stribeck, WIDE, (0.0, 2e5), 0.2)
    write_map(curves, served.folder / "map.parquet")
    fit = pn.fit_friction(curves, pressure_dependence=True)
    fit.to_toml(served.folder / "fit.toml")
    (served.folder / "push.toml").write_text(TASK)
    (served.folder / "wrong.toml").write_text("[cylinder]\nbore = 'x'\n[valve]\n[supply]\n")
    (served.folder / "wrong.fmu").write_text("no archive")
    found = served.client.get("/api/headlines", headers=served.headers).json()
    assert found["axis.toml"].endswith("bore 25 mm, stroke 500 mm")
    assert found["push.toml"] == "push: 2 kg, 100 mm in 0.42 s"
    assert found["map.parquet"].startswith("lowest friction (monday, 30 mm/s) 23.29 ± 0.40 N, highest friction ")
    assert found["fit.toml"].startswith(f"coulomb {fit.values['coulomb']:.4g} ± ")
    assert not {"wrong.toml", "wrong.fmu"} & set(found)
