"""What is shown beside a run is what Python and the command line give; p-V loops hold the mass that flowed in."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K
from pneudrive.simulation.trajectory import save
from pneudrive.web.live import answer
from pneudrive.web.workspace import Workspace
from web.client import post, run_python
from web.conftest import DRIVE, Served
from web.frames import unpack
from web.test_control import shell

ASKED = {
    "path": "axis.toml",
    "changes": {"load.mass": "2 kg"},
    "command": "0 s: 0.3, 0.25 s: -0.3",
    "duration": "0.4 s",
    "initial": "position = 100 mm",
}
SHOWN = ["position_m", "pressure_a_pa"]


def asked(served: Served, **beside: object) -> tuple[dict, dict]:
    head, arrays = unpack(answer(Workspace.at(served.folder), json.dumps(ASKED | beside)))
    assert "problems" not in head, head
    return head, arrays


def test_loops_hold_the_mass_that_flowed_in(served: Served) -> None:
    """Mass p V/(R T) at the end less that at the start is the integral of the mass flow, of a rod on one side too."""
    rod = (
        DRIVE
        + '\n[cylinder]\nkind = "single-rod"\nrod_diameter = "10 mm"\ndead_volume = { a = "15 cm3", b = "9 cm3" }\n'
    )
    (served.folder / "axis.toml").write_text(rod)
    head, arrays = asked(served, loops=True, motion=True)
    assert head["loops"] == ["cylinder.a", "cylinder.b"]
    assert head["cylinders"][0]["stroke_m"] == 0.5
    drive = pn.Drive.load(served.folder / "axis.toml").replace(ASKED["changes"])
    run = pn.simulate(drive, ASKED["command"], "0.4 s", initial=ASKED["initial"], sample_rate="20 kHz")
    for end in "ab":
        volume, pressure = (arrays[f"loop/cylinder.{end}/{axis}"] for axis in ("volume_m3", "pressure_pa"))
        temperature = run[f"temperature_{end}"].to_numpy()[::20]
        mass = pressure * volume / (AIR_GAS_CONSTANT_J_KG_K * temperature)
        flowed = np.trapezoid(run[f"mass_flow_{end}"].to_numpy(), run.time.to_numpy())
        assert mass[-1] - mass[0] == pytest.approx(flowed, rel=1e-3)  # the flow jumps between two samples
        assert np.array_equal(pressure, arrays[f"pressure_{end}_pa"])


def test_energy_is_that_of_the_run(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction heat is the integral of force times velocity; the air given is what chambers hold more, and exhaust."""
    head, _ = asked(served, energy=True)
    monkeypatch.chdir(served.folder)
    copied = post(served, "/api/copy", ASKED | {"energy": True, "columns": SHOWN})
    names = run_python(copied["python"])
    energy = names["energy"]
    assert head["energy"]["rows"] == energy.view().data()["rows"]
    shell(served, copied["command"])
    drive = pn.Drive.load("axis.toml").replace(ASKED["changes"])
    run = pn.simulate(drive, ASKED["command"], "0.4 s", initial=ASKED["initial"], sample_rate="20 kHz")
    slid = -np.trapezoid(run.friction_force * run.velocity, run.time)
    assert energy.accounts_j["cylinder: friction heat"] == pytest.approx(slid, rel=1e-2)
    assert energy.lost_j["cylinder: friction"] == pytest.approx(-energy.accounts_j["cylinder: friction heat"])
    flows = [run[f"mass_flow_{end}"].to_numpy() for end in "ab"]
    inward = sum(
        np.trapezoid(np.maximum(flow, 0.0), run.time) for flow in flows
    )  # a chamber fills from the supply alone
    assert energy.air_kg["supply"] == pytest.approx(inward, rel=1e-2)
    assert abs(energy.open_share) < 1e-4
    assert "energy" not in asked(served)[0]


def test_other_drives_and_files_are_those_of_python(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder / "light.toml").write_text(DRIVE.replace("1.5 kg", "0.5 kg"))
    monkeypatch.chdir(served.folder)
    shell(served, "pneudrive simulate light.toml --command '0 s: 0.3' --duration '0.3 s' --out kept.parquet")
    others = ["light.toml", "kept.parquet"]
    head, arrays = asked(served, others=others)
    copied = post(served, "/api/copy", ASKED | {"others": others, "columns": SHOWN})
    names = run_python(copied["python"])
    assert np.array_equal(arrays["position_m"], names["run"].position.to_numpy())
    assert np.array_equal(arrays["1/position_m"], names["run_1"].position.to_numpy())
    assert np.array_equal(arrays["2/position_m"], names["run_2"].position.to_numpy())
    light, kept = head["others"]
    off = np.abs(names["run"].pressure_a.to_numpy() - names["run_1"].pressure_a.to_numpy())
    assert light["largest"]["pressure_a_pa"] == off.max() > 1e3
    assert kept["ends"]["velocity_m_s"] == names["run_2"].velocity[-1]
    shell(served, copied["command"])
    assert np.array_equal(pl.read_parquet("light.parquet")["position_m"], arrays["1/position_m"])
    assert np.array_equal(pl.read_parquet("axis.parquet")["position_m"], arrays["position_m"])


def test_a_drive_beside_that_takes_no_such_command_is_named(served: Served) -> None:
    shutil.copy(Path(__file__).parents[2] / "examples" / "two_cylinders.toml", served.folder)
    beside = {"others": ["two_cylinders.toml"]}
    head, _ = unpack(answer(Workspace.at(served.folder), json.dumps(ASKED | {"initial": ""} | beside)))
    (problem,) = head["problems"]
    assert problem["file"] == "two_cylinders.toml"
    assert "valve_l, valve_r" in problem["what"]


def test_a_gap_at_the_end_of_a_file_is_no_number_of_the_table(served: Served) -> None:
    """It would be a word that no JSON has, and the page would draw nothing."""
    text = "time_s,position_m,pressure_a_pa\n0,0.1,1e5\n0.2,0.1,1e5\n0.4,nan,2e5\n"
    (served.folder / "gap.csv").write_text(text)
    frame = answer(Workspace.at(served.folder), json.dumps(ASKED | {"others": ["gap.csv"]}))
    assert b"NaN" not in frame
    (other,) = unpack(frame)[0]["others"]
    assert other["ends"] == {"pressure_a_pa": 2e5}


def test_a_trajectory_of_any_kind_is_read_by_the_copied_python(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    run = pn.simulate(pn.Drive.load(served.folder / "axis.toml"), 0.3, "0.1 s")
    monkeypatch.chdir(served.folder)
    for suffix in ("csv", "nc"):
        save(run, f"kept.{suffix}")
        copied = post(served, "/api/copy", ASKED | {"others": [f"kept.{suffix}"], "columns": SHOWN})
        names = run_python(copied["python"])
        assert np.array_equal(names["run_1"].position.to_numpy(), run.position.to_numpy())


def test_a_band_is_that_of_many_members(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    spreads = {"friction.coulomb": [20.0, 36.0, "N"], "supply.pressure": [6, 8, "bar abs"]}
    head, arrays = asked(served, spreads=spreads)
    assert head["band"]["members"] == 200
    copied = post(served, "/api/copy", ASKED | {"spreads": spreads, "columns": SHOWN})
    monkeypatch.chdir(served.folder)
    names = run_python(copied["python"])
    for column, name in (("position_m", "position"), ("pressure_a_pa", "pressure_a")):
        low, high = names["band"][name].to_numpy()
        assert np.array_equal(arrays[f"band/{column}/low"], low)
        assert np.array_equal(arrays[f"band/{column}/high"], high)
        own = np.interp(arrays["band/time_s"], arrays["time_s"], arrays[column])
        wide = high - low > 0.1 * (high - low).max()
        assert ((low < own) & (own < high))[wide].mean() > 0.9  # the run is in their middle
    shell(served, copied["command"].splitlines()[-1])
    table = pl.read_parquet("axis-band.parquet")
    many = names["many"]
    assert np.array_equal(np.stack(table["position_m"].to_numpy()), many["position"].to_numpy())


def test_a_member_that_cannot_be_is_counted_and_the_run_is_shown(served: Served) -> None:
    message = ASKED | {"changes": {"friction.coulomb": "30 N", "friction.breakaway": "30 N"}}

    def band(low: float, high: float, key: str = "friction.coulomb", unit: str = "N") -> tuple[dict, dict]:
        given = message | {"spreads": {key: [low, high, unit]}}
        head, arrays = unpack(answer(Workspace.at(served.folder), json.dumps(given)))
        assert "problems" not in head, head
        assert len(arrays["position_m"]) == len(arrays["time_s"]) == 401
        return head["band"], arrays

    told, arrays = band(27.0, 33.0)
    assert told["failed"] == 100  # those above the breakaway force: the members lie evenly
    assert told["refused"]
    assert "must not be below friction.coulomb" in told["why"]
    _, below = band(27.0, 30.0)
    for end in ("low", "high"):  # the band is that of the members that there are
        shown, expected = arrays[f"band/velocity_m_s/{end}"], below[f"band/velocity_m_s/{end}"]
        assert np.abs(shown - expected).max() < 0.02 * np.abs(expected).max()
    none, arrays = band(31.0, 33.0)
    assert none["failed"] == 200
    assert not any(name.startswith("band/") for name in arrays)
    ratio, _ = band(0.9, 1.1, "valve.critical_pressure_ratio", "")
    assert ratio["failed"] == 100


@pytest.mark.parametrize(
    "beside",
    [
        {"others": ["../axis.toml"]},
        {"others": ["none.parquet"]},
        {"others": [3]},
        {"others": ["axis.toml"] * 8},
        {"spreads": {"friction.coulomb": [2, 1, "N"]}},
        {"spreads": {"friction.coulomb": [1, 2, "N), file:x"]}},
        {"spreads": {"../x": [1, 2, "N"]}},
        {"spreads": {"friction.coulomb": [1, 2, "bar"]}},
        {"spreads": {"friction.coulomb": ["1", 2, "N"]}},
        {"others": ["empty.csv"]},
        {"others": ["backwards.csv"]},
    ],
)
def test_what_cannot_be_shown_beside_is_answered_in_words(served: Served, beside: dict) -> None:
    (served.folder / "empty.csv").write_text("time_s,position_m\n")
    (served.folder / "backwards.csv").write_text("time_s,position_m\n0.1,0.1\n0,0.1\n")
    head, arrays = unpack(answer(Workspace.at(served.folder), json.dumps(ASKED | beside)))
    assert head["problems"][0]["what"]
    assert not arrays
