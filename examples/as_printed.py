"""Effect of the source paper's printed chamber equations: the same stroke with them and with the energy balance."""

import math
import warnings
from collections.abc import Callable
from typing import Literal

import numpy as np
import xarray as xr

import pneudrive as pn

# "as-printed" warns that it breaks the energy balance. This effect is measured here.
warnings.simplefilter("ignore", pn.errors.PneudriveWarning)

Law = Literal["energy-balance", "as-printed"]
BORE, STROKE, DEAD, HEAT = 0.032, 0.2, 5e-6, 60.0  # m, m, m3, W/(m2 K)
AREA = 0.25 * math.pi * BORE**2
K, R, AMBIENT = 1.4, 287.05, 293.15
WALL: dict[Law, Callable[[float], float]] = {
    "energy-balance": lambda x: math.pi * (BORE * x + 0.5 * BORE**2),
    "as-printed": lambda x: math.pi * (BORE * x + 0.25 * BORE**3),
}


def drive(law: Law, heat_transfer: float = HEAT, coulomb: str = "20 N", viscous: str = "40 N s/m") -> pn.Drive:
    """Describe the drive of the table with one of the two chamber laws."""
    return pn.Drive(
        supply=pn.Supply(pressure="7 bar abs"),
        cylinder=pn.Cylinder(
            kind="rodless",
            bore="32 mm",
            stroke="200 mm",
            dead_volume={"a": "5 cm3", "b": "5 cm3"},
            moving_mass="5 kg",
            heat_transfer=f"{heat_transfer} W/(m2 K)",
            chamber_law=law,
        ),
        valve=pn.Valve(kind="proportional-5/3", conductance="0.5 dm3/(s bar)", critical_pressure_ratio=0.3),
        friction=pn.Friction(law="coulomb", coulomb=coulomb, viscous=viscous),
    )


def cycle(law: Law) -> xr.Dataset:
    """Run out and back at full opening, 0.6 s each way, from x = 0 with the other chamber full."""
    initial = pn.Initial(position="0 mm", pressure_a="1.013 bar abs", pressure_b="7 bar abs")
    return pn.simulate(drive(law), "0 s: 1, 0.6 s: -1", "1.2 s", initial=initial, sample_rate="20 kHz", rtol=1e-9)


def energy_residual(run: xr.Dataset, law: Law) -> float:
    """Largest difference between the energy stored in chamber a and the energy that entered it, J."""
    x, v, p, t, flow = (
        run[n].to_numpy() for n in ("position", "velocity", "pressure_a", "temperature_a", "mass_flow_a")
    )
    c_v = R / (K - 1.0)
    heat = HEAT * np.array([WALL[law](s) for s in x]) * (AMBIENT - t)
    power = (c_v + R) * flow * np.where(flow > 0.0, AMBIENT, t) - p * AREA * v + heat
    got = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.time.to_numpy()))])
    held = p * (DEAD + AREA * x) / (K - 1.0)
    return float(np.abs(held - held[0] - got).max())


def closed(law: Law) -> tuple[float, float]:
    """Ring at mid stroke on a shut valve without heat: (polytropic exponent, frequency in Hz)."""
    ring = drive(law, heat_transfer=0.0, coulomb="0.001 N", viscous="0 N s/m")
    initial = pn.Initial(position="100 mm", pressure_a="5.01 bar abs", pressure_b="5 bar abs")
    run = pn.simulate(ring, "0 s: 0", "1 s", initial=initial, sample_rate="10 kHz", rtol=1e-9)
    volume, p = DEAD + AREA * run.position.to_numpy(), run.pressure_a.to_numpy()
    far = int(np.argmax(volume))
    exponent = -math.log(p[far] / p[0]) / math.log(volume[far] / volume[0])
    v, time = run.velocity.to_numpy(), run.time.to_numpy()
    crossings = np.flatnonzero((v[1:] > 0.0) & (v[:-1] <= 0.0))[1:]
    at = [time[i] - v[i] * (time[i + 1] - time[i]) / (v[i + 1] - v[i]) for i in crossings]
    return exponent, 1.0 / float(np.diff(at).mean())


runs = {law: cycle(law) for law in WALL}
rings = {law: closed(law) for law in WALL}
apart = {
    name: float(np.abs(runs["as-printed"][name] - runs["energy-balance"][name]).max())
    for name in ("pressure_a", "position")
}


def stroke_time(run: xr.Dataset) -> float:
    """Time of the first arrival at the far stop, s."""
    return float(run.time[int(np.argmax(run.position.to_numpy() >= STROKE))])


def line(what: str, value: Callable[[Law], str]) -> None:
    """Print one row: a value for each law."""
    print(f"| {what} | {value('energy-balance')} | {value('as-printed')} |")


def ends(name: str) -> Callable[[Law], str]:
    """Return the lowest and highest value of a result as text, for each law."""
    return lambda law: f"{float(runs[law][name].min()):.0f} … {float(runs[law][name].max()):.0f}"


print("| | energy balance | as printed |")
print("| --- | ---: | ---: |")
line("stroke time, s", lambda law: f"{stroke_time(runs[law]):.3f}")
for side in "ab":
    line(f"gas in chamber {side}, K", ends(f"temperature_{side}"))
line("energy of chamber a out of nothing, J", lambda law: f"{energy_residual(runs[law], law):.1f}")
line(
    "largest difference of pressure a, bar",
    lambda law: "–" if law == "energy-balance" else f"{apart['pressure_a'] / 1e5:.2f}",
)
line(
    "largest difference of position, mm",
    lambda law: "–" if law == "energy-balance" else f"{1e3 * apart['position']:.1f}",
)
line("closed chamber without heat, exponent", lambda law: f"{rings[law][0]:.3f}")
line("natural frequency, valve shut, Hz", lambda law: f"{rings[law][1]:.2f}")
