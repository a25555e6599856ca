"""What a fit of a drive claims: intervals only where they hold, derived defaults that move, a floor for model error.

All records are synthetic.
"""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

import pneudrive as pn
from benches.servo import controller, follow_sine
from oracle.drive_records import record
from pneudrive.errors import Cancelled, FitError, PneudriveWarning
from pneudrive.free.parameters import chosen, family_of
from pneudrive.identify import fit_friction
from pneudrive.identify.dynamic.problem import FittedRecording
from pneudrive.identify.dynamic.result import DriveFit

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
STEPS = [(0.0, 0.1), (0.4, -0.15), (0.8, 0.2), (1.2, -0.1), (1.5, 0.3), (1.8, -0.3)]


def plain_drive(mass: str, coulomb: str, breakaway: str = "40 N", **friction: str) -> pn.Drive:
    """Describe a drive whose friction table names no law."""
    tables = pn.Drive.load("catalogue:reference").to_dict()
    tables["cylinder"]["moving_mass"] = mass
    tables["friction"] = {"coulomb": coulomb, "breakaway": breakaway, **friction}
    return pn.Drive.model_validate(tables)


def test_defaults_that_follow_from_the_guess_move_with_it_and_the_mass_is_not_off(tmp_path) -> None:
    truth, guess = plain_drive("2.5 kg", "25 N"), plain_drive("2 kg", "15 N")
    before = guess.friction.parameters["damping_fade_velocity"]
    assert before < 0.7 * truth.friction.parameters["damping_fade_velocity"]
    free = ["cylinder.moving_mass", "friction.coulomb", "friction.breakaway"]
    fit = pn.identify(guess, record(truth, 3, 2.2, 1e-6, 200.0, steps=STEPS), free)
    assert fit.converged
    assert fit.fits
    for name, true in zip(free, (2.5, 25.0, 40.0), strict=True):
        low, high = fit.intervals[name]
        assert low - 0.5 * (high - low) < true < high + 0.5 * (high - low), name
    assert any("damping_fade_velocity = 290 mm/s is derived" in note for note in fit.notes)
    after = fit.apply()
    assert after.friction.parameters["damping_fade_velocity"] == truth.friction.parameters["damping_fade_velocity"]
    assert guess.friction.parameters["damping_fade_velocity"] == before


def test_a_default_that_was_given_stays() -> None:
    guess = plain_drive("2 kg", "15 N", damping_fade_velocity="0.29 m/s")
    moving = family_of(guess, chosen(guess, ["friction.coulomb"])).moving
    assert "friction.damping_fade_velocity" not in [one.name for one in moving]


def test_derivatives_go_through_what_follows() -> None:
    """Breakaway -> stiffness -> damping -> fade, and coulomb -> fade: against differences of the core's form."""
    guess = plain_drive("2 kg", "15 N")
    family = family_of(guess, chosen(guess, ["friction.coulomb", "friction.breakaway"]))
    at = np.array([16.0, 42.0])
    by_free = family.by_free(at)
    for k in range(2):
        step = np.zeros(2)
        step[k] = 1e-4
        ends = []
        for sign in (1.0, -1.0):
            family.json(at + sign * step)
            ends.append(np.array([family.get(path) for path in family.paths]))
        assert by_free[:, k] == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5, abs=1e-9)
    assert len(family.paths) == 5


def test_the_temperature_of_the_supply_follows_that_of_the_room() -> None:
    drive = pn.Drive.load("catalogue:reference")
    family = family_of(drive, chosen(drive, ["ambient.temperature"]))
    assert '"numbers": {"pressure": 700000.0, "temperature": 300.0}' in family.json(np.array([300.0]))


@pytest.fixture(scope="module")
def stopped() -> DriveFit:
    def stop(done: float, _total: float, _task: str) -> None:
        if done == 2:
            raise KeyboardInterrupt

    guess = pn.Drive.load("catalogue:reference").replace(
        {"friction.coulomb": "40 N", "valve.conductance": "1.6 dm3/(s bar)"}
    )
    made = record(pn.Drive.load("catalogue:reference"), 4, 1.0, steps=STEPS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pneudrive.progress.LEAST_PAUSE_S", 0.0)
        return pn.identify(guess, made, ["friction.coulomb", "valve.conductance"], progress=stop)


def test_a_search_that_did_not_converge_says_so_instead_of_intervals(stopped, tmp_path) -> None:
    assert not stopped.converged
    stopped.to_toml(tmp_path / "fit.toml")
    entries = tomllib.loads((tmp_path / "fit.toml").read_text())["values"]
    assert not any({"interval", "standard_error"} & set(entry) for entry in entries.values())
    for fit in (stopped, DriveFit.from_toml(tmp_path / "fit.toml")):
        assert not fit.intervals
        assert not fit.standard_errors
        assert "not converged" in str(fit)
        assert "95 %" not in str(fit)
        with pytest.warns(PneudriveWarning, match="did not converge"):
            assert not fit.apply().provenance


def test_no_other_way_gives_it_an_interval(stopped) -> None:
    with pytest.raises(FitError, match="did not converge"):
        stopped.profile()


def test_what_people_read_is_in_their_units(stopped) -> None:
    assert re.search(r"valve.conductance +\d\.\d+ dm3/\(s bar\)", str(stopped))
    assert "m^3" not in str(stopped)


def test_an_interval_of_a_few_millionths_stands_beside_a_floor_for_model_error(tmp_path) -> None:
    """The force balance is m a = A dp - F: with every term off by 1 % the mass is off by about as much."""
    truth = pn.Drive.load("catalogue:reference")
    fit = pn.identify(
        truth.replace({"cylinder.moving_mass": "2.2 kg"}),
        record(truth, 5, 2.2, 1e-7, 20.0, steps=STEPS),
        ["cylinder.moving_mass", "friction.coulomb"],
    )
    low, high = fit.intervals["cylinder.moving_mass"]
    floor = fit.model_errors["cylinder.moving_mass"]
    assert high - low < 1e-3
    assert 0.01 < floor / 2.0 < 0.1
    assert "model ±" in str(fit)
    fit.to_toml(tmp_path / "fit.toml")
    assert DriveFit.from_toml(tmp_path / "fit.toml").model_errors == fit.model_errors
    written = fit.apply().provenance["cylinder.moving_mass"]
    assert float(str(written.model_error).split()[0]) == pytest.approx(floor, rel=0.05)
    half = pn.identify(
        truth.replace({"cylinder.moving_mass": "2.2 kg"}),
        record(truth, 5, 2.2, 1e-5, 2000.0, steps=STEPS),
        ["cylinder.moving_mass", "friction.coulomb"],
    )
    assert half.model_errors["cylinder.moving_mass"] == pytest.approx(floor, rel=0.05), "noise has no part in it"


def test_a_model_that_lacks_something_is_not_plainly_converged() -> None:
    truth = pn.Drive.load("catalogue:reference")
    waves = {"harmonics": [{"period": "0.15 m", "amplitude": 0.3}]}
    made = record(truth.replace({"friction.position": waves}), 6, 1.5, 1e-6, 200.0, steps=STEPS)
    fit = pn.identify(truth, made, ["friction.coulomb"])
    assert fit.converged
    assert not fit.fits
    assert str(fit).splitlines()[0].endswith("converged, but the model does not fit")


def test_shorter_segments_are_tried_where_long_ones_stick() -> None:
    """A guess that is off by factors of up to four, slow stick and slip: 0.4 s alone end beside the truth."""
    names = {"coulomb": "N", "breakaway": "N", "stribeck_velocity": "m/s", "viscous": "N s/m"}
    rng = np.random.default_rng([7, 16])
    true = {"coulomb": rng.uniform(8, 50), "stribeck_velocity": 10 ** rng.uniform(-2.3, -1.3)}
    true |= {"viscous": rng.uniform(20, 100), "breakaway": true["coulomb"] * rng.uniform(1.2, 1.9)}
    mass = rng.uniform(1, 5)
    far = {key: true[key] * float(np.exp(rng.uniform(-1.4, 1.4))) for key in names}
    far["breakaway"] = max(far["breakaway"], 1.05 * far["coulomb"])
    conductance, other = (float(np.exp(rng.uniform(-0.3, 0.3))) for _ in range(2))

    def drive(values: dict[str, float], kg: float, c: float) -> pn.Drive:
        friction = {f"friction.{key}": f"{values[key]!r} {unit}" for key, unit in names.items()}
        more = {"cylinder.moving_mass": f"{kg!r} kg", "valve.conductance": f"{c!r} dm3/(s bar)"}
        return pn.Drive.load("catalogue:reference").replace(friction | more)

    truth, guess = drive(true, mass, 2.0), drive(far, mass * other, 2.0 * conductance)
    start = {"position_m": 0.25, "velocity_m_s": 0.0} | {f"pressure_{c}_pa": 3e5 for c in "ab"}
    start |= {f"temperature_{c}_k": 293.15 for c in "ab"}
    amplitude, frequency, gain = rng.uniform(0.01, 0.06), rng.uniform(0.1, 0.6), rng.uniform(2, 12)
    core = truth.system.compiled()
    run = follow_sine(core, controller(gain, 0.25, amplitude, frequency, 0.25), 4.0, 1000.0, start, 1e-8)
    n, noise = len(run["time_s"]), np.random.default_rng(16)
    made = {
        "time_s": np.arange(n) * 1e-3,
        "command": run["command"],
        "position_m": run["position_m"] + 1e-5 * noise.standard_normal(n),
        "pressure_a_pa": run["pressure_a_pa"] + 1000.0 * noise.standard_normal(n),
        "pressure_b_pa": run["pressure_b_pa"] + 1000.0 * noise.standard_normal(n),
    }
    fit = pn.identify(guess, made, [*(f"friction.{key}" for key in names), "cylinder.moving_mass", "valve.conductance"])
    assert fit.converged
    assert fit.fits
    assert float(fit.provenance["segment_s"]) < 0.4
    for key in names:
        assert fit.values[f"friction.{key}"] == pytest.approx(true[key], rel=0.01), key


def test_a_search_is_cancelled_within_a_run_of_the_core(monkeypatch) -> None:
    """The flag shows itself only while the core works: who looks at it between runs alone never sees it."""

    class WhileItRuns:
        runs = False

        def is_set(self) -> bool:
            return self.runs

    flag, plain = WhileItRuns(), FittedRecording._shoot

    def shoot(self, *args, **kwargs):
        flag.runs = True
        try:
            return plain(self, *args, **kwargs)
        finally:
            flag.runs = False

    monkeypatch.setattr(FittedRecording, "_shoot", shoot)
    truth = pn.Drive.load("catalogue:reference")
    made = record(truth, 4, 4.0, steps=[(0.02 * i, 0.3 * (-1.0) ** i) for i in range(200)])
    with pytest.raises(Cancelled):
        pn.identify(truth, made, ["friction.coulomb"], cancel=flag)


# --- Equations that are singular, and numbers beyond the largest one: a FitError in words, never NumPy's own error.


@pytest.fixture(scope="module")
def run():
    return pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.2, 0.2 s: -0.2", "0.4 s")


def test_a_shut_valve_ends_in_words(run):
    """The valve is never open, so that the recording does not depend on its conductance."""
    shut = {name: run[name].to_numpy() for name in ("position", "pressure_a", "pressure_b")}
    columns = {"time_s": run.time.to_numpy(), "command": np.zeros(run.time.size), "position_m": shut["position"]}
    columns |= {f"{name}_pa": shut[name] for name in ("pressure_a", "pressure_b")}
    fit = pn.identify(pn.Drive.load("catalogue:reference"), columns, ["valve.conductance", "cylinder.heat_transfer"])
    assert "valve.conductance cannot be determined: the recordings do not depend on this" in "\n".join(fit.statements())


# --- Correlations in words and the block bootstrap, on simulated maps.

SPEED = np.geomspace(1e-3, 0.45, 20)


def simulated(make_map, friction_of, speed=SPEED, noise=0.3, seed=1, **options):
    error = noise * np.random.default_rng(seed).standard_normal(speed.size)
    return fit_friction(make_map(speed, friction_of(speed) + error, noise), **options)


def test_the_correlation_that_stick_slip_leaves_is_said_with_its_remedy(make_map, friction_of):
    fit = simulated(make_map, friction_of, speed=np.geomspace(9e-3, 0.45, 20), noise=0.1)
    i, j = fit.free.index("breakaway"), fit.free.index("stribeck_velocity")
    # design study: -0.90 from 9 to 450 mm/s, -0.48 from 1 to 450 mm/s
    assert fit.correlation[i, j] == pytest.approx(-0.9, abs=0.06)
    dense = simulated(make_map, friction_of)
    assert dense.correlation[i, j] == pytest.approx(-0.48, abs=0.08)
    assert not dense.correlated()
    said = " ".join(simulated(make_map, friction_of, speed=np.geomspace(11e-3, 0.45, 20), noise=0.05).correlated())
    assert "breakaway and stribeck_velocity change together" in said
    assert "speeds below 11 mm/s would separate them" in said


@pytest.mark.parametrize("wrong", ["mass", "sign", "chambers"])
def test_a_reversed_command_and_swapped_chambers_are_named(wrong: str) -> None:
    drive = pn.Drive.load("catalogue:reference")
    columns = dict(record(drive.replace({"load.mass": "20 kg"}), 6, 1.0, 1e-6, 200.0, steps=STEPS).columns)
    if wrong == "sign":
        columns["command"] = -columns["command"]
    if wrong == "chambers":
        columns["pressure_a_pa"], columns["pressure_b_pa"] = columns["pressure_b_pa"], columns["pressure_a_pa"]
    fit = pn.identify(drive, columns, ["friction.coulomb"])
    assert not fit.fits
    assert any("reversed sign or swapped chambers" in note for note in fit.notes) == (wrong != "mass")
