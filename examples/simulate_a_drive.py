"""Describe a drive in Python, move it out and back, and look at speed and air."""

import numpy as np

import pneudrive as pn

drive = pn.Drive(
    name="ISO cylinder on a proportional valve",
    supply=pn.Supply(pressure="6 bar gauge"),
    cylinder=pn.Cylinder(
        kind="single-rod",
        bore="32 mm",
        rod_diameter="12 mm",
        stroke="200 mm",
        dead_volume={"a": "8 cm3", "b": "8 cm3"},
        moving_mass="1.5 kg",
        incline="30 deg",
    ),
    valve=pn.Valve(kind="proportional-5/3", nominal_flow="350 l/min ANR", critical_pressure_ratio=0.3),
    friction=pn.Friction(
        law="stribeck", coulomb="20 N", breakaway="30 N", stribeck_velocity="20 mm/s", viscous="40 N s/m"
    ),
)
run = pn.simulate(drive, "0 s: 0.5, 1 s: -0.5", "2 s", initial="position = 0 mm")

arrival = float(run.time[np.argmax(run.position.to_numpy() >= drive.cylinder.stroke_m)])
air = float(run.mass_flow_a.clip(min=0.0).integrate("time") + run.mass_flow_b.clip(min=0.0).integrate("time"))
print(f"out after {arrival:.3f} s, at up to {float(run.velocity.max()):.2f} m/s")
print(f"air taken from the supply: {air * 1e3:.2f} g, or {air / 1.185 * 1e3:.2f} litres ANR")
