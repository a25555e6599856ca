"""No impossible number without a word: covers, impacts, the budget of work, cancelling."""

import math
import re
import threading
import warnings

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import Cancelled, CommandError, PneudriveWarning, SimulationError
from pneudrive.simulate import compiled

SOFT = {
    "cylinder.stroke": "100 mm",
    "cylinder.moving_mass": "5 kg",
    "cylinder.dead_volume": {"a": "0.5 cm3", "b": "0.5 cm3"},
}


def soft() -> pn.Drive:
    """Return a heavy piston before stops that are too soft for its dead length of 1 mm."""
    return pn.Drive.load("catalogue:reference").replace(SOFT)


def own_stops(drive: pn.Drive) -> pn.Drive:
    """Return the drive with the stops that follow from it."""
    tables = drive.to_dict()
    del tables["cylinder"]["end_stop"]
    return pn.Drive.model_validate(tables)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("ledger", [False, True])
@pytest.mark.parametrize("rate", ["50 Hz", "20 kHz"])
def test_a_piston_at_the_cover_stops_the_run_with_a_reason(rtol, ledger, rate):
    with pytest.raises(SimulationError, match=r"t = 0\.05\d+ s: the piston .* cover of chamber b") as told:
        pn.simulate(soft(), "0 s: 1", "0.5 s", rtol=rtol, ledger=ledger, sample_rate=rate)
    assert "end_stop.stiffness" in str(told.value)


def test_shooting_and_measured_records_meet_the_same_covers():
    core = compiled(soft().core_json())
    start = np.array([[0.05, 0.0, 1.013e5, 293.15, 1.013e5, 293.15, 0.0]])
    shot = core.shoot([0.0], [1.0], np.linspace(0.0, 0.5, 26), [0], start, [], False, ["pressure_b_pa"], 1e-6)
    assert "cover of chamber b" in str(shot["failures"][0])
    given = shot["values"][np.isfinite(shot["values"])]
    assert 0 < given.size < 26
    assert given.min() > 0.0
    still, shut = np.full(3, 1e5), np.zeros((3, 4))
    with pytest.raises(RuntimeError, match=r"at t = 0\.1 s the piston is at 0\.1020"):
        core.along(
            np.array([0.0, 0.1, 0.2]), np.array([0.05, 0.102, 0.05]), np.zeros(3), still, still, shut, [293.0] * 2
        )


def test_stops_that_follow_from_the_drive_keep_the_piston_off_the_cover():
    drive = own_stops(soft())
    run = pn.simulate(drive, "0 s: 1, 0.3 s: -1", "0.6 s", sample_rate="20 kHz")
    beyond = max(float(run.position.max()) - 0.1, -float(run.position.min()))
    assert 0.0 < beyond < 0.5 * 0.5e-6 / drive.cylinder.area_a_m2  # half of the dead length
    lines = [line for line in run.attrs["assumed"] if line.startswith("cylinder.end_stop")]
    assert re.fullmatch(r"cylinder.end_stop.stiffness = \S+ N/m, from the drive", lines[0])


def test_stops_grow_with_mass_and_shrink_with_room_and_what_is_given_stays():
    base = own_stops(soft())
    stiffness = base.end_stop["stiffness_n_m"]
    throttled = base.replace({"valve.conductance": "0.05 dm3/(s bar)"})
    heavier = throttled.replace({"load.mass": "20 kg"})
    roomier = base.replace({"cylinder.dead_volume": {"a": "5 cm3", "b": "5 cm3"}})
    assert heavier.end_stop["stiffness_n_m"] > 3.0 * throttled.end_stop["stiffness_n_m"]
    assert roomier.end_stop["stiffness_n_m"] < 0.05 * stiffness
    given = base.replace({"cylinder.end_stop": {"stiffness": "3e6 N/m"}})
    assert given.end_stop["stiffness_n_m"] == 3e6
    assert given.end_stop["damping_n_s_m"] == pytest.approx(math.sqrt(3e6 * 5.0))  # 2 zeta sqrt(k M)
    assert not any("stiffness" in line for line in given.assumed())


def test_an_impact_is_told_as_the_spring_took_it():
    """Energy at first touch; depth and force obey the stop's own law; a piston that leaves has the impact behind it."""
    drive = own_stops(soft()).replace({"cylinder.end_stop": {"stiffness": "2e7 N/m", "damping": "0 N s/m"}})
    with pytest.warns(PneudriveWarning, match="harder than a cylinder of this bore usually takes"):
        run = pn.simulate(drive, "0 s: 1", "0.2 s", sample_rate="50 kHz")
    first = run.attrs["impacts"][0]
    touch = int(np.argmax(run.position.to_numpy() > 0.1))
    assert first["end"] == "b"
    assert first["time_s"] == pytest.approx(float(run.time[touch]), abs=2e-5)
    assert first["speed_m_s"] == pytest.approx(float(run.velocity[touch]), rel=1e-3)
    assert first["energy_j"] == pytest.approx(0.5 * 5.0 * first["speed_m_s"] ** 2)
    assert first["depth_m"] == pytest.approx(float(run.position.max()) - 0.1, rel=1e-3)
    assert first["peak_force_n"] == pytest.approx(2e7 * first["depth_m"], rel=1e-9)
    spring = 0.5 * 2e7 * first["depth_m"] ** 2
    assert spring == pytest.approx(first["energy_j"], rel=0.1)  # the gas does the rest
    assert any("harder than" in line for line in run.attrs["warnings"])


def test_what_a_friction_table_without_a_law_assumed_is_kept():
    tables = pn.Drive.load("catalogue:reference").to_dict()
    tables["friction"] = {"coulomb": "30 N", "breakaway": "45 N"}
    with pytest.warns(PneudriveWarning, match="names no law"):
        drive = pn.Drive.model_validate(tables)
    run = pn.simulate(drive, "0 s: 0.5", "0.05 s")
    assert "friction.law = elasto-plastic" in run.attrs["assumed"]
    assert any(line.startswith("friction.bristle_damping = ") for line in run.attrs["assumed"])
    assert any("names no law" in line for line in run.attrs["warnings"])


def test_work_is_bounded_by_a_budget_that_the_message_names():
    drive = pn.Drive.load("catalogue:reference")
    with pytest.raises(SimulationError, match=r"budget of 50 attempts .* --budget"):
        pn.simulate(drive, "0 s: 1", "0.5 s", budget=50)
    with pytest.raises(CommandError, match="budget = 0"):
        pn.simulate(drive, "0 s: 1", "0.5 s", budget=0)
    enough = pn.simulate(drive, "0 s: 1", "0.5 s", budget=10_000)
    assert enough.identical(pn.simulate(drive, "0 s: 1", "0.5 s"))


def test_a_long_run_tells_where_it_is_and_can_be_cancelled():
    drive = pn.Drive.load("catalogue:reference")
    said, flag = [], threading.Event()

    def progress(done, total, task):
        said.append((done, total, task))
        flag.set()

    # Pulses of the valve keep the solver busy for some 100,000 attempts.
    pulses = [(0.002 * i, float(1 - 2 * (i % 2))) for i in range(5_000)]
    with pytest.raises(Cancelled):
        pn.simulate(drive, pulses, "10 s", rtol=1e-9, sample_rate="10 Hz", progress=progress, cancel=flag)
    (first,) = said
    assert 0.0 < first[0] < first[1] == 10.0
    with pytest.raises(Cancelled):
        pn.simulate(drive, "0 s: 1", "0.1 s", cancel=flag)


def test_exact_friction_never_pushes():
    """Fault of 31 drives: against a stop, at 1e-13 to 1e-7 m/s, a sample slid backwards in its mode."""
    tables = pn.Drive.load("catalogue:reference").to_dict()
    tables["friction"] = {"law": "coulomb", "coulomb": "10 N"}
    drive = pn.Drive.model_validate(tables)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        for rtol in (1e-4, 1e-5, 1e-6):
            run = pn.simulate(
                drive, "0 s: -0.33, 0.7 s: 0.4", "1.6 s", rtol=rtol, sample_rate="5 kHz", initial="position = 4 mm"
            )
            assert float((run.friction_force * run.velocity).min()) >= 0.0
