"""Reference numbers of the reference drive, by linearisation and sessions; each to the digits that it is printed with.

The drive: rodless, bore 25 mm, stroke 500 mm, dead volumes 10 cm3, 2 kg, 5/3 valve of C = 2 dm3/(s bar) and b = 0.3
between 7 and 1.013 bar abs, 293.15 K, friction of 30 N and 40 N s/m. The numbers were computed by root finding on the
printed equations, independently of the product, before it could give them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import root

import pneudrive as pn

DRIVE = pn.Drive.load("catalogue:reference")
SLIDING = DRIVE.replace({
    "cylinder.heat_transfer": "0 W/(m2 K)",
    "friction": {
        "law": "stribeck",
        "coulomb": "30 N",
        "breakaway": "45 N",
        "stribeck_velocity": "20 mm/s",
        "viscous": "40 N s/m",
    },
})  # fmt: skip
AREA, MASS = 0.25 * math.pi * 0.025**2, 2.0
GAS = slice(2, 6)  # masses and energies of both chambers, behind position and velocity


def stiffness(position: str, frequency: float) -> complex:
    """Return the dynamic stiffness of both chambers at 3 bar behind a shut valve, N/m, at a frequency in Hz."""
    about = DRIVE.start({"position": position, "pressure_a": "3 bar abs", "pressure_b": "3 bar abs"})
    a, s = about.linearise(["load_force_n"]).A, 2j * math.pi * frequency
    gas_by_position = np.linalg.solve(s * np.eye(4) - a[GAS, GAS], a[GAS, 0] + s * a[GAS, 1])
    return complex(-MASS * (a[1, 0] + a[1, GAS] @ gas_by_position))


@pytest.mark.parametrize(
    ("position", "expected", "natural"),
    [("250 mm", 1525.1, 4.395), ("125 mm", None, 4.956), ("0 mm", 10516.0, 11.54), ("500 mm", 10516.0, 11.54)],
)
def test_stiffness_and_natural_frequency_without_heat(position, expected, natural):
    # Far above the 0.3 Hz of the chambers' heat.
    found = stiffness(position, 1e6).real
    if expected is not None:
        assert f"{found:.5g}" == f"{expected:.5g}"
    assert f"{math.sqrt(found / MASS) / (2.0 * math.pi):.4g}" == f"{natural:.4g}"


def test_stiffness_with_heat():
    assert f"{stiffness('250 mm', 1e-7).real:.1f}" == "1089.3"
    # (k - 1)/(2 sqrt k) at sqrt(k)/(2 pi tau) is the greatest loss factor, tau = 0.549 s.
    loss = {f: stiffness("250 mm", f).imag / stiffness("250 mm", f).real for f in (0.24, 0.245, 0.25)}
    assert f"{loss[0.245]:.3f}" == "0.169"
    assert loss[0.245] == max(loss.values())


def steady(command: float, load: float = 0.0) -> tuple[float, float, float]:
    """Return speed and pressures, bar, at which neither they nor the temperatures change."""

    def rates(unknown: np.ndarray) -> np.ndarray:
        v, p_a, p_b = unknown[0], *np.exp(unknown[1:])
        session = SLIDING.start({
            "position": "250 mm", "velocity": f"{float(v)!r} m/s", "pressure_a": f"{float(p_a)!r} bar abs",
            "pressure_b": f"{float(p_b)!r} bar abs",
        })  # fmt: skip
        session.set("command", command)
        session.set("load_force_n", -load)
        about = session.linearise(["load_force_n"])
        of = dict(zip(about.outputs, about.C @ about.rates, strict=True))
        for temperature in ("temperature_a_k", "temperature_b_k"):
            seen[temperature] = of[temperature]
        return np.array([about.rates[1], of["pressure_a_pa"] / 1e5, of["pressure_b_pa"] / 1e5])

    seen: dict[str, float] = {}
    guess = [5.3, 3.0] if command > 0.0 else [3.0, 5.3]
    found = root(rates, [4.0 * command, *np.log(guess)], tol=1e-12)
    assert np.abs(found.fun).max() < 1e-6, found
    rates(found.x)
    assert max(map(abs, seen.values())) < 1e-5
    return found.x[0], *np.exp(found.x[1:])


def test_steady_velocity():
    # C rho0 R T0/A = 4.0628 m/s for each unit of command while the exhaust is choked: up to 94.4 N.
    for command in (0.1, 0.3, -0.2):
        v, p_a, p_b = steady(command)
        driving = p_a if command > 0.0 else p_b
        assert (f"{v / command:.4f}", f"{driving:.4f}") == ("4.0628", "5.3005")
    assert f"{steady(0.3, 94.3 - 30.0 - 40.0 * 0.3 * 4.0628)[0] / 0.3:.4f}" == "4.0628"
    assert steady(0.3, 100.0 - 30.0 - 40.0 * 0.3 * 4.0628)[0] < 0.3 * 4.0625
    v, _, p_b = steady(0.6)
    assert (f"{v:.4f}", f"{p_b:.3f}") == ("2.4249", "2.726")
    assert f"{steady(1.0)[0]:.4f}" == "3.7640"
    assert [f"{steady(command, 100.0)[0]:.4f}" for command in (0.6, 1.0)] == ["2.0021", "2.7104"]


def test_theoretical_force():
    session = DRIVE.start({"position": "250 mm", "pressure_a": "7 bar abs", "pressure_b": "1.013 bar abs"})
    assert f"{MASS * session.read('acceleration_m_s2'):.3f}" == "293.886"


@pytest.mark.parametrize("leak", [0.01, 0.02])
def test_pressure_gain_of_four_equal_leaks(leak):
    tank = {"kind": "tank", "volume": "1 cm3"}
    circuit = pn.Circuit(
        components={
            "supply": {"kind": "reservoir", "pressure": "7 bar abs"},
            "valve": {
                "kind": "valve/proportional-5/3",
                "conductance": "2 dm3/(s bar)",
                "critical_pressure_ratio": 0.3,
                "leakage": leak,
            },
            "a": tank,
            "b": tank,
        },
        connections=["supply -> valve.1", "valve.4 -> a", "valve.2 -> b"],
        initial={"a": "5 bar abs", "b": "5 bar abs"},
    )
    session = circuit.start(rtol=1e-9)
    session.set("valve.command", 1e-7 * leak)
    session.advance(20.0)
    about = session.linearise(["valve.command"])
    slopes = about.D[:, 0] - about.C @ np.linalg.solve(about.A, about.B[:, 0])
    a, b = (about.outputs.index(f"{name}.pressure_pa") for name in "ab")
    assert f"{about.output[a] / 7e5:.4f}" == "0.7572"
    # Of the supply's 7 bar: at r = phi(r) both exhausts are choked, and each port moves by r/(1 - phi').
    r = (0.6 + math.sqrt(0.36 + 4.0 * 1.49 * 0.4)) / 2.98
    closed = 2.0 * r / (1.0 + (r - 0.3) / (0.49 * r)) * 7.0
    assert f"{(slopes[a] - slopes[b]) * leak / 1e5:.4f}" == f"{closed:.4f}" == "4.7490"


def test_air_of_a_full_cycle():
    # Each chamber is filled at its end to 7 bar, and vented to its dead volume at 1.013 bar, all at 293.15 K.
    session = DRIVE.replace({"cylinder.end_stop": {"stiffness": "1e9 N/m", "damping": "1e5 N s/m"}}).start()
    masses = []
    for command, until in ((-1.0, 20.0), (1.0, 40.0), (-1.0, 60.0)):
        session.set("command", command)
        session.advance(until)
        masses.append(session.linearise(["load_force_n"]).state[[2, 4]])
    drawn = masses[1][0] - masses[0][0] + masses[2][1] - masses[1][1]
    assert f"{1e3 * drawn / 1.185:.3f}" == "3.566"


def test_strokes_of_the_first_golden_run():
    start = "position = 50 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
    run = pn.simulate(DRIVE, "0 s: 0.6, 1 s: -0.6", "2 s", initial=start, sample_rate="1 kHz")
    x, v, t = (run[name].to_numpy() for name in ("position", "velocity", "time"))
    # Times of the first sample in the stop: the contacts are at 0.20843 s and 0.32892 s.
    out, back = int(np.argmax(x > 0.5)), int(np.argmax((t > 1.0) & (x < 0.0)))
    arrives, returns = v[out - 1], v[back - 1]
    assert (f"{t[out]:.3f}", f"{arrives:.2f}", f"{0.5 * MASS * arrives**2:.1f}") == ("0.209", "2.39", "5.7")
    assert (f"{t[back] - 1.0:.3f}", f"{-returns:.2f}") == ("0.329", "2.24")
    assert f"{1e3 * (x.max() - 0.5):.2f}" == "1.59"
    temperatures = run[["temperature_a", "temperature_b"]].to_dataarray()
    assert (f"{temperatures.min().item():.0f}", f"{temperatures.max().item():.0f}") == ("184", "383")
