"""The tripod of the examples as a MuJoCo model, and its legs as circuits of one cylinder."""

import tomllib
from pathlib import Path

import numpy as np

import pneudrive as pn

FILE = Path(__file__).parents[2] / "examples" / "tripod.toml"
LOOPS = 'solref="0.004 1" solimp="0.999 0.9999 0.001"'


def leg():
    """Return one leg with its valve and supply."""
    tables = tomllib.loads(FILE.read_text(encoding="utf-8"))
    del tables["components"]["tripod"]
    for name in ("valve", "leg"):
        del tables["components"][name]["copies"]
    tables["connections"] = ["mains -> valve.1", "valve.4 -> leg.a", "valve.2 -> leg.b"]
    tables["initial"] = {"leg.a": "3 bar gauge", "leg.b": "2.5 bar gauge"}
    return pn.Circuit.model_validate(tables)


def _numbers(values):
    return " ".join(repr(float(value)) for value in values)


def tripod(timestep, loops=LOOPS):
    """Return the tripod at half strokes. The platform hangs at the rod of leg 1. The other rods are connected to it."""
    platform = pn.platform(pn.Circuit.load(FILE))
    origin, *axes = platform.evaluate(platform.home)["frame"][0]
    frame, joints, hinges = (np.array(own) for own in platform.core.joints)
    joints = origin + joints @ np.array(axes)
    bodies, equalities = [], []
    for i in range(3):
        along = (joints[i] - frame[i]) / np.linalg.norm(joints[i] - frame[i])
        child = ""
        if i == 0:
            sites = "".join(f'<site name="p{k}" pos="{_numbers(joints[k] - joints[0])}"/>' for k in range(3))
            centre = _numbers(origin - joints[0] + np.array([0.0, 0.0, 0.03]))
            inertia = f'<inertial mass="6" pos="{centre}" diaginertia="0.09 0.09 0.17"/>'
            child = f'<body><joint type="ball"/>{inertia}{sites}</body>'
        else:
            equalities.append(f'<connect site1="r{i}" site2="p{i}" {loops}/>')
        bodies.append(
            f'<body pos="{_numbers(joints[i])}">'
            f'<joint type="hinge" axis="{_numbers(hinges[i])}" pos="{_numbers(frame[i] - joints[i])}"/>'
            f'<joint name="leg_{i + 1}" type="slide" axis="{_numbers(along)}"/>'
            f'<inertial mass="0.6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/><site name="r{i}"/>{child}</body>'
        )
    motors = "".join(f'<motor joint="leg_{i}"/>' for i in (1, 2, 3))
    return f"""<mujoco><option timestep="{timestep}" gravity="0 0 -9.80665" integrator="implicitfast"/>
        <worldbody>{"".join(bodies)}</worldbody><equality>{"".join(equalities)}</equality>
        <actuator>{motors}</actuator></mujoco>"""


def slide(timestep=1e-3, *, mass=2.0, incline=0.0, joint="", actuator="", option=""):
    """Return one mass on a slide joint."""
    weight = -9.80665 * np.sin(incline)
    return f"""<mujoco><option timestep="{timestep}" gravity="{weight} 0 0" {option}/><worldbody><body>
        <joint name="slide" type="slide" axis="1 0 0" {joint}/><geom size="0.1" mass="{mass}"/></body></worldbody>
        <actuator><motor joint="slide" {actuator}/></actuator></mujoco>"""
