"""Drives at the actuators of MuJoCo models. `make test-extras` runs it."""

import re
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="make test-extras")
import pneudrive as pn  # noqa: E402
from extras import machines  # noqa: E402
from pneudrive.errors import CommandError, DescriptionError, PneudriveWarning  # noqa: E402

ROOT = Path(__file__).parents[2]
DRIVE = pn.Drive.load("catalogue:reference").replace({"friction.viscous": "150 N s/m"})
PLAN = [(0.0, 0.3), (0.15, -0.3), (0.3, 0.1)]


def at_slide(drive=DRIVE, position=0.1, model=None, **options):
    model = mujoco.MjModel.from_xml_string(model or machines.slide())
    data = mujoco.MjData(model)
    data.qpos[0] = position
    return pn.mujoco.Actuators(model, {"slide": drive}, data, **options)


def test_one_slide_agrees_with_a_drive_to_first_order():
    wanted = np.asarray(
        pn.simulate(DRIVE, PLAN, "0.4 s", initial={"position": "100 mm"}, rtol=1e-9, sample_rate="500 Hz").position
    )
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        actuators = at_slide(model=machines.slide(step))
        run = actuators.simulate({"slide": PLAN}, "0.4 s")
        found = np.interp(np.arange(201) * 2e-3, run["time_s"], run["slide.position_m"])
        errors.append(np.abs(found - wanted).max() / np.ptp(wanted))
        report = actuators.report
        assert abs(report.work_gap_j) < 1e-10 * report.work_j
        assert actuators.data.qpos[0] == pytest.approx(run["slide.position_m"][-1], abs=1e-12)
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.1)


def test_a_tripod_with_closed_loops_agrees_with_the_platform():
    plans = [[(0.0, 0.15), (0.25, -0.1)], [(0.0, -0.1), (0.2, 0.15)], [(0.0, 0.0), (0.1, 0.1)]]
    native = pn.Circuit.load(machines.FILE).simulate(
        {f"valve_{i}": plan for i, plan in enumerate(plans, 1)}, "0.5 s", rtol=1e-8, sample_rate="500 Hz"
    )
    wanted = np.array([np.asarray(native[f"leg_{i}.position"]) for i in (1, 2, 3)])
    legs = {f"leg_{i}": machines.leg() for i in (1, 2, 3)}
    errors = []
    for step in (1e-3, 5e-4):
        model = mujoco.MjModel.from_xml_string(machines.tripod(step))
        actuators = pn.mujoco.Actuators(model, legs, zero=dict.fromkeys(legs, "-100 mm"))
        run = actuators.simulate(dict(zip(legs, plans, strict=True)), "0.5 s")
        found = np.array([np.interp(np.arange(251) * 2e-3, run["time_s"], run[f"{leg}.position_m"]) for leg in legs])
        errors.append(np.abs(found - wanted).max() / np.ptp(wanted, axis=1).max())
        report = actuators.report
        assert report.loop_gap_m < 1e-5
        assert abs(report.work_gap_j) < 1e-10 * report.work_j
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)


def test_wide_loops_are_reported():
    model = mujoco.MjModel.from_xml_string(machines.tripod(1e-3, 'solref="0.02 1"'))
    legs = {f"leg_{i}": machines.leg() for i in (1, 2, 3)}
    actuators = pn.mujoco.Actuators(model, legs, zero=dict.fromkeys(legs, -0.1))
    with pytest.warns(PneudriveWarning, match="the loops of the model open by"):
        actuators.simulate({}, "20 ms")


def test_an_inclined_load_is_held_without_drift():
    pressures = {"slide": {"pressure_a": "3 bar gauge", "pressure_b": "3 bar gauge"}}
    actuators = at_slide(model=machines.slide(mass=5.0, incline=0.5), initial=pressures)
    for _ in range(10_000):
        actuators.step()
    held = actuators.data.qpos[0]
    for _ in range(60_000):
        actuators.step()
    assert abs(actuators.data.qpos[0] - held) < 1e-8


def test_a_reset_gives_the_same_bits():
    actuators = at_slide()

    def run():
        rows = []
        for k in range(60):
            actuators.set("slide", 0.3 if k < 30 else -0.2)
            actuators.step()
            rows.append([*actuators.data.qpos, *actuators.data.qvel, *actuators.sense("slide").values()])
        return rows

    actuators.data.qpos[0] = 0.05
    actuators.reset(keep=True)
    first = run()
    actuators.reset()
    actuators.data.qpos[0], actuators.data.qvel[0] = 0.05, 0.0
    actuators.reset(keep=True)
    assert run() == first


def test_sensors_are_those_of_an_instrumentation():
    ideal, real = (at_slide(setup=name) for name in ("ideal", "real"))
    for own in (ideal, real):
        own.simulate({"slide": PLAN}, "50 ms")
    true = {name: ideal.read("slide", name) for name in ("position_m", "pressure_a_pa", "pressure_b_pa")}
    assert ideal.sense("slide") == true
    seen = real.sense("slide")
    assert seen["position_m"] / 5e-6 == pytest.approx(round(seen["position_m"] / 5e-6), abs=1e-6)
    assert seen["pressure_a_pa"] - true["pressure_a_pa"] == pytest.approx(1500.0, abs=2500.0)
    assert seen["pressure_a_pa"] != true["pressure_a_pa"]


@pytest.mark.parametrize(
    ("model", "fault"),
    [
        ({"joint": 'damping="3"'}, "has frictionloss or damping"),
        ({"actuator": 'ctrlrange="-5 5" ctrllimited="true"'}, "is not a plain force"),
        ({"actuator": 'name="other"'}, None),
    ],
)
def test_a_model_that_does_not_fit_is_rejected(model, fault):
    if fault is None:
        assert at_slide(model=machines.slide(**model)).names == ("slide",)
    else:
        with pytest.raises(CommandError, match=fault):
            at_slide(model=machines.slide(**model))


def test_a_law_that_sticks_moves_the_model_through_a_coupling():
    levels = {"coulomb": "30 N", "breakaway": "40 N", "stribeck_velocity": "20 mm/s", "viscous": "60 N s/m"}
    drive = pn.Drive.load("catalogue:reference").replace({"friction": {"law": "stribeck", **levels}})
    wanted = np.asarray(
        pn.simulate(drive, PLAN, "0.4 s", initial={"position": "100 mm"}, rtol=1e-8, sample_rate="1 kHz").position
    )
    light = drive.replace({"cylinder.moving_mass": "0.2 kg"})  # the model has the other 1.8 kg
    actuators = at_slide(light, model=machines.slide(mass=1.8), couplings={"slide": "1e7 N/m"})
    run = actuators.simulate({"slide": PLAN}, "0.4 s")
    assert np.abs(run["slide.position_m"] - wanted).max() < 0.01 * np.ptp(wanted)
    report = actuators.report
    assert abs(report.work_gap_j) < 1e-9 * report.work_j


TENDON = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody><site name="wall"/>
<body pos="0.35 0 0"><joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/><site name="end"/></body>
</worldbody><tendon><spatial name="leg" {}><site site="wall"/><site site="end"/></spatial></tendon>
<actuator><motor tendon="leg"/></actuator></mujoco>"""


def test_a_tendon_is_named_as_a_joint_is():
    model = mujoco.MjModel.from_xml_string(TENDON.format(""))
    run = pn.mujoco.Actuators(model, {"leg": DRIVE}, zero={"leg": "250 mm"}).simulate({"leg": PLAN}, "0.2 s")
    at_joint = at_slide(position=0.1).simulate({"slide": PLAN}, "0.2 s")
    assert np.abs(run["leg.position_m"] - at_joint["slide.position_m"]).max() < 1e-6
    with pytest.raises(CommandError, match="the tendon of 'leg' has frictionloss or damping"):
        pn.mujoco.Actuators(mujoco.MjModel.from_xml_string(TENDON.format('damping="3"')), {"leg": DRIVE})


def test_messages_name_what_to_do():
    with pytest.raises(CommandError, match=r"(?s)starts at 600 mm.*0 to 500 mm"):
        at_slide(position=0.6)
    with pytest.raises(CommandError, match="no actuator, joint or tendon 'slid'"):
        pn.mujoco.Actuators(mujoco.MjModel.from_xml_string(machines.slide()), {"slid": DRIVE})
    with pytest.raises(DescriptionError, match="put a coupling"):
        at_slide(pn.Drive.load("catalogue:parker-osp-p25-sy5000"))
    with pytest.warns(PneudriveWarning, match="RK4"):
        at_slide(model=machines.slide(option='integrator="RK4"'))


def test_the_code_of_the_guide_runs():
    text = (ROOT / "docs/guide/mujoco.md").read_text(encoding="utf-8")
    names = {}
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(block, names)
    assert names["actuators"].data.qpos[0] == pytest.approx(0.25, abs=0.02)
