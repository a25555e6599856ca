"""Results of published models, compared with those of the same circuits: data/published-models."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import pneudrive as pn

DATA = Path(__file__).parents[1] / "data/published-models"
STEP_S, END_S, SPOOL_S, LOADED_S = 1e-4, 4.5, 0.025, 2.0
TARGETS_M = ((0.0, 0.010), (0.5, 0.035), (3.0, 0.015))
SETTLED_M = 5e-4
QUANTITIES = (("rms error", "mm"), ("overshoot", "mm"), ("settling time", "s"), ("peak pressure", "bar abs"))


class Case(NamedTuple):
    """Gains, mass, kg, load, N, supply, bar abs, and published results in the order of `QUANTITIES`."""

    gains: tuple[float, float, float]
    mass_kg: float
    load_n: float
    supply_bar: float
    published: tuple[float, float, float, float]


CASES = {
    "baseline": Case((40.0, 8.0, 2.0), 0.4, 2.0, 6.0, (3.68633, 0.49027, 0.262, 2.14723)),
    "tuned": Case((100.0, 30.0, 5.0), 0.4, 2.0, 6.0, (3.49538, 0.38180, 0.230, 2.46929)),
    "heavy": Case((100.0, 30.0, 5.0), 0.8, 5.0, 6.0, (3.81145, 3.59762, 1.124, 4.53241)),
    "low supply": Case((100.0, 30.0, 5.0), 0.4, 2.0, 4.0, (3.70605, 0.37692, 0.254, 1.96991)),
}
VALVE_START = "cyl.position = 0 mm, cyl.a.pressure = 101325 Pa abs, cyl.b.pressure = 52.72420892278395 bar abs"
#: Published results of the valve actuator, with units.
VALVE = (
    ("starts to move", "s", 0.59),
    ("open", "s", 0.91),
    ("chamber a at 1 s", "bar abs", 24.66),
    ("chamber b at 1 s", "bar abs", 3.05),
)


class Row(NamedTuple):
    """Published result and ours."""

    model: str
    quantity: str
    unit: str
    published: float
    ours: float

    @property
    def off(self) -> float:
        """Difference in percent of the published value."""
        return 100.0 * (self.ours / self.published - 1.0)


def rows() -> list[Row]:
    """Return the results of both models."""
    found = []
    for name, case in CASES.items():
        each = zip(QUANTITIES, case.published, actuator(case), strict=True)
        found += [Row(f"actuator, {name}", what, unit, published, ours) for (what, unit), published, ours in each]
    each = zip(VALVE, valve(pn.Circuit.load(DATA / "valve_actuator.toml")), strict=True)
    return found + [Row("valve actuator", what, unit, published, ours) for (what, unit, published), ours in each]


def actuator(case: Case) -> tuple[float, float, float, float]:
    """Return the results of the actuator with its sampled controller, in the order of `QUANTITIES`."""
    changes = {
        "components.cyl.moving_mass": f"{case.mass_kg} kg",
        "components.supply.pressure": f"{case.supply_bar} bar abs",
    }
    ambient = ", ".join(f"cyl.{end}.pressure = 101325 Pa abs" for end in "ab")
    session = pn.Circuit.load(DATA / "actuator.toml").replace(changes).start(f"cyl.position = 10 mm, {ambient}")
    kp, ki, kd = case.gains
    count, spool, integral = round(END_S / STEP_S), 0.0, 0.0
    time = STEP_S * np.arange(count)
    target = np.select([time >= at for at, _ in TARGETS_M[::-1]], [x for _, x in TARGETS_M[::-1]])
    position, pressure = np.empty(count), np.empty((count, 2))
    for k in range(count):
        position[k] = session.read("cyl.position_m")
        pressure[k] = [session.read(f"cyl.{end}.pressure_pa") for end in "ab"]
        error = target[k] - position[k]
        wanted = kp * error + ki * integral - kd * session.read("cyl.velocity_m_s")
        command = min(max(wanted, -1.0), 1.0)
        integral += STEP_S * error if wanted == command else 0.0
        session.set("valve.command", spool)
        spool += STEP_S / SPOOL_S * (command - spool)
        session.set("cyl.load_force_n", -case.load_n if time[k] >= LOADED_S else 0.0)
        session.advance((k + 1) * STEP_S)
    error = target - position
    step_s = TARGETS_M[1][0]
    rough = np.flatnonzero((time >= step_s) & (time < LOADED_S) & (np.abs(error) > SETTLED_M))
    overshoot = position.max() - TARGETS_M[1][1]
    rms = np.sqrt(np.mean(error**2))
    return 1e3 * float(rms), 1e3 * float(overshoot), float(time[rough[-1]]) - step_s, 1e-5 * float(pressure.max())


def valve(circuit: pn.Circuit) -> tuple[float, float, float, float]:
    """Return the results of the valve actuator, in the order of `VALVE`."""
    run = pn.simulate(circuit, None, "1.2 s", initial=VALVE_START, sample_rate="2 kHz")
    time, x = run["time"].to_numpy(), run["cyl.position"].to_numpy()
    stroke = float(vars(circuit.components["cyl"])["stroke_m"])
    second = [1e-5 * float(np.interp(1.0, time, run[f"cyl.{end}.pressure"])) for end in "ab"]
    return float(time[np.argmax(x > 1e-4)]), float(time[np.argmax(x >= stroke)]), second[0], second[1]


def lines() -> list[str]:
    """Return the section of the page."""
    return [
        "## Published models",
        "",
        "Two published models state all parameters and results [README.md in `data/published-models`].",
        "",
        "| model | result | published | pneudrive | difference, % |",
        "| --- | --- | ---: | ---: | ---: |",
        *(
            f"| {row.model} | {row.quantity}, {row.unit} | {row.published:.4g} | {row.ours:.4g} | {row.off:+.1f} |"
            for row in rows()
        ),
        "",
    ]
