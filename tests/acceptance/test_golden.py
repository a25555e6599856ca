"""The core at its default tolerance against trajectories of an independent model (tests/golden).

Position within 1 um (20 um where stick-slip amplifies errors) and both pressures within 1e-4
relative, outside the instants of impact: for rodless, single-rod and through-rod drives, level,
inclined and vertical, 12 to 63 mm bore, 50 mm to 1 m stroke, slamming into the stops, with hot
supply and wall, friction that grows with pressure, another gas, LuGre and exact sticking.
"""

from __future__ import annotations

import math
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from benches.servo import READS, controller, follow_sine
from oracle.cases import CASES, GOLDEN
from oracle.compare import difference, outside_impact, simulated
from oracle.integrate import COLUMNS
from pneudrive.cli.main import run
from pneudrive.describe.system import System
from pneudrive.describe.tables.friction import friction_laws
from pneudrive.errors import PneudriveWarning
from pneudrive.simulation.trajectory import columns

DEFAULT_RTOL = 1e-6
TEMPERATURE_BOUND = 1e-4
OPEN_LOOP = sorted(name for name, case in CASES.items() if "commands" in case)


def golden(name):
    with np.load(GOLDEN / f"{name}.npz") as data:
        return np.stack([data[c] for c in COLUMNS], axis=1)


@pytest.mark.parametrize("name", OPEN_LOOP)
def test_a_drive_moves_as_the_independent_model_says(name):
    case = CASES[name]
    states, _ = simulated(case, DEFAULT_RTOL)
    found = difference(case, states, golden(name))
    assert found.meets(case), found
    assert found.temperature < TEMPERATURE_BOUND, found


@pytest.mark.parametrize("name", ["case_a", "stribeck_strokes", "single_rod_lifts"])
def test_a_tighter_tolerance_comes_nearer_to_the_truth(name):
    """Not the same error at every tolerance: what is left at 1e-6 is the solver's, not a different law's."""
    case, want = CASES[name], golden(name)
    loose, tight = (difference(case, simulated(case, rtol)[0], want) for rtol in (1e-6, 1e-10))
    assert tight.position_everywhere_um < 2e-3
    assert tight.pressure < 1e-7
    assert tight.position_um < loose.position_um


def test_what_creeps_is_timed_as_well_as_it_is_placed():
    """An error of time in slow motion becomes one of place when the piston slips: at 1e-5 too it is small."""
    case = CASES["creeps"]
    states, work = simulated(case, 1e-5)
    assert difference(case, states, golden("creeps")).position_um < 2.0
    assert work["steps"] + work["rejected"] < 350


def test_a_piston_that_sticks_has_exactly_no_velocity():
    case, want = CASES["stribeck_creeps"], golden("stribeck_creeps")
    states, _ = simulated(case, DEFAULT_RTOL)
    sticks = (want[:, 1] == 0.0).mean()
    assert sticks > 0.5
    assert (states[:, 1] == 0.0).mean() == pytest.approx(sticks, abs=0.01)


def test_servo_control_follows_the_independent_model():
    """Case C: 10,000 samples of position control, each with its own command."""
    case, want = CASES["case_c"], golden("case_c")
    servo = case["servo"]
    drive = System.of_drive(case["drive"]).compiled()
    gains = (servo[key] for key in ("kp", "kd", "amplitude_m", "frequency_hz"))
    control = controller(*gains, 0.5 * case["drive"]["cylinder"]["stroke_m"])
    rate = servo["sample_rate_hz"]
    run = follow_sine(drive, control, case["duration_s"], rate, case["initial"], DEFAULT_RTOL)
    states = np.stack([run[name] for name in READS], axis=1)[:: round(rate / case["sample_rate_hz"])]
    found = difference(case, states, want)
    assert found.meets(case), found
    assert np.ptp(want[:, 0]) > 0.15  # it moves


def test_the_impact_mask_hides_little():
    """The comparison leaves out only some hundredths of a second around each first contact."""
    case, want = CASES["case_a"], golden("case_a")
    times = np.arange(len(want)) / case["sample_rate_hz"]
    keep = outside_impact(times, want[:, 0], case["drive"]["cylinder"]["stroke_m"])
    assert 0.9 < keep.mean() < 1.0


@pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")  # this LuGre set is not passive
def test_the_described_reference_drive_moves_as_its_golden_trajectory():
    """The whole way of a user: units, catalogue, `simulate` with its defaults, labelled results."""
    case, want = CASES["case_a"], golden("case_a")
    initial = pn.Initial(position="50 mm", pressure_a="3 bar abs", pressure_b="3 bar abs")
    run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.6, 1 s: -0.6", "2 s", initial=initial)
    names = ("position", "velocity", "pressure_a", "temperature_a", "pressure_b", "temperature_b")
    found = difference(case, np.stack([run[name].to_numpy() for name in names], axis=1), want)
    assert found.meets(case), found
    assert run.time.to_numpy()[-1] == 2.0


# --- The reference drive with every law of the core: it moves, its energy is accounted for, at rest it stays there.
#
# A new law takes the values of `data/every_law.toml` where its parameters have these names; a new name needs one there.

VALUES, EVERYTHING = tomllib.loads((GOLDEN.parent / "data" / "every_law.toml").read_text("utf-8")).values()


def with_law(law):
    """Return the reference drive with a law, its parameters from `VALUES` or its own defaults."""
    needed = [p for p in friction_laws()[law]["parameters"] if p["default"] is None or p["key"] in VALUES]
    missing = [p["key"] for p in needed if p["key"] not in VALUES]
    assert missing == [], f"values for the parameters of law {law!r}"
    friction = {"law": law} | {p["key"]: VALUES[p["key"]] for p in needed}
    return pn.Drive.load("catalogue:reference").replace({"friction": friction})


@pytest.mark.parametrize("law", friction_laws())
def test_it_moves_and_its_energy_is_accounted_for(law):
    out = pn.simulate(with_law(law), "0 s: 0.3, 0.6 s: -0.2, 1.2 s: 0.02, 1.8 s: 0", "2.5 s", ledger=True)
    assert float(out.velocity.max()) > 0.1
    assert float(out.velocity.min()) < -0.1
    ledger = out.attrs["ledger"]
    assert abs(ledger["energy_error"]) < 1e-6
    assert abs(ledger["mass_error"]) < 1e-12
    assert ledger["least_entropy_production_j_k"] > -1e-9, "friction never cools"


@pytest.mark.parametrize("law", friction_laws())
def test_all_that_acts_on_a_law_acts_on_it_from_a_drive_file(law, tmp_path):
    """The energy is accounted for to the same bound as alone; the contact warms by 0.8 K for each watt."""
    can_relax = friction_laws()[law]["bristles"]
    acting = {key: table for key, table in EVERYTHING.items() if key != "relaxation" or can_relax}
    drive = with_law(law)
    file = tmp_path / "drive.toml"
    file.write_text(drive.replace({"friction": drive.friction.to_dict() | acting}).to_toml())
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*not passive", category=PneudriveWarning)
        out = pn.simulate(
            pn.Drive.load(file), "0 s: 0.5, 0.1 s: -0.5", "0.2 s", initial="contact_age = 60 s", ledger=True
        )
    assert set(friction_laws()[law]["states"]) <= set(columns(out))
    ledger = out.attrs["ledger"]
    assert abs(ledger["energy_error"]) < 1e-6
    assert abs(ledger["mass_error"]) < 1e-12
    # Bristles give way by some tenths of a millimetre before they slide.
    way = float(abs(out.position.diff("time")).sum())
    assert math.isclose(float(out.sliding_distance[-1]), way, abs_tol=2e-3)
    assert way > 0.01
    power = out.friction_force * out.velocity
    warming = 0.8 * float(power.integrate("time"))
    assert 0.8 * warming < float(out.contact_warming[-1]) < 1.05 * warming


NOT_SOUND = {
    "lugre": ({"bristle_damping": "1000 N s/m", "viscous": "0 N s/m"}, "not passive"),
    "elasto-plastic": ({"bristle_damping": "1000 N s/m", "viscous": "0 N s/m"}, "not passive"),
    "karnopp": ({"dead_zone": "30 mm/s"}, "stribeck_velocity"),
}


@pytest.mark.parametrize("law", NOT_SOUND)
def test_a_set_that_is_not_sound_runs_with_a_warning(law, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    changes, expected = NOT_SOUND[law]
    friction = with_law(law).friction.to_dict() | changes
    drive = pn.Drive.load("catalogue:reference").replace({"friction": friction})
    Path("drive.toml").write_text(drive.to_toml())
    assert run(["simulate", "drive.toml", "--command", "0 s: 0.5", "--duration", "0.01 s"]) == 0
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("law", friction_laws())
def test_at_rest_it_stays_at_rest(law):
    out = pn.simulate(with_law(law), "0 s: 0", "20 s", sample_rate="10 Hz")
    position = out.position.to_numpy()
    assert math.isclose(position.min(), position.max(), rel_tol=0, abs_tol=1e-12)
