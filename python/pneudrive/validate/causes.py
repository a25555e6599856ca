"""Possible causes of model errors. Each cause is a change to one quantity, with an effect on the balances.

A cause changes the scene (drive, sensors, openings of the valve) by an amount, or adds a term to a residual. The column
of a cause in the regression is the difference quotient of the residuals. causes.toml has units and texts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from pneudrive.arrays import Array, Interval, Plain, Row, by_name
from pneudrive.constants import LEAK_CRITICAL_RATIO
from pneudrive.describe.drive import Drive
from pneudrive.errors import package_table
from pneudrive.units import write
from pneudrive.validate.balance import RATES, Scene, at_samples, openings

Rows = dict[str, Row]
_TEXTS = package_table(__file__, "causes.toml")
#: Change of the scene by an amount; and drive-dependent arguments of `Cause`.
Change = Callable[[Scene, float], Scene]

#: Bounds of a critical pressure ratio.
RATIO = (0.01, 0.95)
#: Lag of the supply pressure behind the flow if a volume is between regulator and valve, s (assumed).
SLOW_SAG_S = 0.5
#: Number of polynomials for friction along the stroke, including the constant.
PROFILE_ORDERS = 5


@dataclass(frozen=True)
class Cause:
    """Possible cause of a model error.

    Attributes
    ----------
    key : str
        Short name, unique.
    words : str
        Text with ``{size}`` for the amount: "{size} Coulomb friction".
    unit : str
        Unit of the amount: an SI unit, or "share" for a fraction of the present value.
    step : float
        Amount for the difference quotient.
    least : float
        Smallest relevant amount.
    remedy : str
    change : callable or None
        (scene, amount) -> changed scene.
    ratio : callable or None
        Scene -> ratio of downstream to upstream pressure of a leak at each sample, and its critical pressure ratio.
    profile : callable or None
        Scene -> columns, for a cause with several coefficients.
    parts : int
        Number of coefficients. A cause with more coefficients explains more of the residual by chance.
    bounds : pair of float
        Smallest and largest amount that a description allows.
    described : bool
        Whether a drive file or the sensor data can describe the cause.
    free : sequence of str
        Values of the drive file that a new identification should fit to correct the error.
    """

    key: str
    words: str
    unit: str
    step: float
    least: float
    remedy: str
    change: Change | None = None
    ratio: Callable[[Scene], tuple[Array, float]] | None = None
    profile: Callable[[Scene], list[Array]] | None = None
    parts: int = 1
    bounds: Interval = (-np.inf, np.inf)
    described: bool = True
    free: Sequence[str] = ()


def causes(drive: Drive) -> list[Cause]:
    """Return all causes that can be tested for a drive."""
    cylinder, valve, load = drive.cylinder, drive.valve, drive.carried
    rows = _of_friction(drive)
    heavier = "load.mass" if load.mass_kg > cylinder.moving_mass_kg else "cylinder.moving_mass"
    rows |= {
        "moving mass": {"change": _drive(_mass), "free": (heavier,)},
        "constant force": {"change": _value("load.force", "N", lambda d, f: d.carried.force_n + f)},
        "spring": {"change": _drive(_spring), "bounds": (-load.spring.stiffness_n_m if load.spring else 0.0, np.inf)},
    }
    ratio, gauge = valve.critical_pressure_ratio, drive.supply_pressure_pa - drive.ambient.pressure_pa
    whole = _value("valve.conductance", "m^3/(s Pa)", lambda d, s: d.valve.conductance_m3_s_pa * (1.0 + s))
    rows |= {
        "conductance": {"change": whole},
        "conductance to exhaust": {"change": _edges(1, 3)},
        "conductance from supply": {"change": _edges(0, 2)},
        "conductance of a": {"change": _edges(0, 1)},
        "conductance of b": {"change": _edges(2, 3)},
        "critical pressure ratio": {"change": _drive(_ratio), "bounds": (RATIO[0] - ratio, RATIO[1] - ratio)},
        "valve delay": {"change": _command(_delayed)},
        "valve zero": {"change": _command(lambda u, zero, _: np.clip(u - zero, -1.0, 1.0))},
        "dead zone": {"change": _overlap, "bounds": (-(valve.overlap or 0.0), 0.9)},
        "supply pressure": {"change": _supply, "bounds": (-0.9 * gauge, np.inf)},
        "supply sag": {"change": _sag(0.0)},
        "slow supply sag": {"change": _sag(SLOW_SAG_S)},
    }
    stated = cylinder.leakage_m3_s_pa / valve.conductance_m3_s_pa
    piston = _value("cylinder.leakage", "m^3/(s Pa)", _leakage)
    rows |= {
        "leak from a": {"change": _opened(np.add, 1), "ratio": _to_ambient(0)},
        "leak from b": {"change": _opened(np.add, 3), "ratio": _to_ambient(1)},
        "leak through the valve": {"change": _opened(np.add, 0, 2)},
        "leak past the piston": {"change": piston, "ratio": _past_piston, "bounds": (-stated, np.inf)},
    }
    for key, sides in (("dead volume of a", "a"), ("dead volume of b", "b"), ("dead volumes", "ab")):
        rows[key] = {"change": _dead_volume(sides)}
    key, field, unit = "cylinder.heat_transfer", "heat_transfer_w_m2_k", "W/(m^2 K)"
    if cylinder.heat_transfer_w_m2_k is None:
        key, field, unit = "cylinder.heat_transfer_scale", "heat_transfer_scale", ""
    if getattr(cylinder, field) > 0.0:
        change = _value(key, unit, lambda d, share: getattr(d.cylinder, field) * (1.0 + share))
        remedy = _TEXTS["heat transfer"]["remedy"].format(key=key)
        rows["heat transfer"] = {"change": change, "remedy": remedy, "free": (key,)}
    rows |= _SENSORS
    level, out = drive.friction.parameters.get("coulomb", 1.0), []
    for name, row in rows.items():
        entry = _TEXTS[name] | row
        if entry.pop("relative", False):
            entry.update({size: level * entry[size] for size in ("step", "least")})
        lists = {field: tuple(value) for field, value in entry.items() if isinstance(value, list)}
        out.append(Cause(key=name, **entry | lists))
    return out


def _value(key: str, si_unit: str, value: Callable[[Drive, float], float]) -> Change:
    """Return the change to one value of the description; `value` is a function (drive, amount) -> value in SI."""
    return _drive(lambda drive, amount: {key: write(value(drive, amount), si_unit)})


def _drive(changes: Callable[[Drive, float], Plain]) -> Change:
    return lambda scene, amount: replace(scene, drive=scene.drive.replace(changes(scene.drive, amount)))


def _of_friction(drive: Drive) -> Rows:
    parameters, seals = drive.friction.parameters, drive.friction.pressure
    if "coulomb" not in parameters:
        return {}
    level, lips = parameters["coulomb"], 0.0 if seals is None else min(seals.coulomb_n_pa)
    rows: Rows = {
        "Coulomb friction": {"change": _drive(_friction_level), "bounds": (-level, np.inf)},
        "pressure-dependent friction": {"change": _drive(_pressure_friction), "bounds": (-lips, np.inf)},
        "direction of friction": {"change": _drive(_direction)},
        "friction along the stroke": {"profile": _along_stroke, "parts": PROFILE_ORDERS},
    }
    if "viscous" in parameters:
        change = _value("friction.viscous", "N s/m", lambda d, b: max(d.friction.parameters["viscous"] + b, 0.0))
        rows["viscous friction"] = {"change": change, "bounds": (-parameters["viscous"], np.inf)}
    if "breakaway" in parameters:
        bounds = (level - parameters["breakaway"], np.inf)
        rows["Stribeck friction"] = {"change": _value("friction.breakaway", "N", _breakaway), "bounds": bounds}
    return rows


def _friction_level(drive: Drive, amount: float) -> Plain:
    """Change Fc and Fs by the same amount."""
    known = drive.friction.parameters
    return {f"friction.{k}": write(max(known[k] + amount, 1e-6), "N") for k in ("coulomb", "breakaway") if k in known}


def _breakaway(drive: Drive, amount: float) -> float:
    known = drive.friction.parameters
    return max(known["breakaway"] + amount, known["coulomb"])


def _pressure_friction(drive: Drive, amount: float) -> Plain:
    """Change the slopes of Coulomb and breakaway force over the pressure of each chamber by an amount in N/Pa."""
    seals = drive.friction.pressure
    pairs = {}
    for name in ("coulomb", "breakaway"):
        old = getattr(seals, name) if seals is not None else (0.0, 0.0)
        pairs[name] = by_name("ab", (write(v + amount, "N/Pa") for v in old))
    return {"friction.pressure": pairs}


def _direction(drive: Drive, amount: float) -> Plain:
    """Increase the friction in motion towards +x, and decrease it in motion towards -x, by the fraction `amount`."""
    old = drive.friction.direction
    positive, negative = (1.0, 1.0) if old is None else (old.positive, old.negative)
    return {"friction.direction": {"positive": positive * (1.0 + amount), "negative": negative * (1.0 - amount)}}


def _along_stroke(scene: Scene) -> list[Array]:
    """Return the effects of friction along the stroke (Legendre polynomials) on the residuals, per N."""
    x, out = scene.position, []
    domain = [x.min(), x.max()]
    for order in range(PROFILE_ORDERS):
        shape = np.polynomial.legendre.Legendre.basis(order, domain=domain)(x)
        force = np.convolve(scene.signals.direction * shape, scene.kernel[0], "valid")
        out.append(np.stack([force, np.zeros_like(force), np.zeros_like(force)]))
    return out


def _mass(drive: Drive, share: float) -> Plain:
    """Change the masses of piston and load by the same fraction, so that both stay positive."""
    masses = {"cylinder.moving_mass": drive.cylinder.moving_mass_kg, "load.mass": drive.carried.mass_kg}
    return {key: write((1.0 + share) * mass, "kg") for key, mass in masses.items() if mass or key != "load.mass"}


def _spring(drive: Drive, amount: float) -> Plain:
    old = drive.carried.spring
    if old is not None:
        return {"load.spring.stiffness": write(old.stiffness_n_m + amount, "N/m")}
    middle = write(0.5 * drive.cylinder.stroke_m, "m")
    return {"load.spring": {"stiffness": write(amount, "N/m"), "rest_position": middle}}


def _ratio(drive: Drive, amount: float) -> Plain:
    return {"valve.critical_pressure_ratio": float(np.clip(drive.valve.critical_pressure_ratio + amount, *RATIO))}


_supply = _drive(lambda drive, amount: {"supply.pressure": f"{drive.supply_pressure_pa + amount!r} Pa abs"})


def _opened(how: Callable[[Array, Array], Array], *edges: int) -> Change:
    """Return a change that applies `how` to the openings of some valve edges.

    `how` is a function (openings, amount at each edge) -> openings.

    With `numpy.add`, it models a leak: each edge passes a further fraction of its full conductance.
    """

    def change(scene: Scene, amount: float) -> Scene:
        amounts = np.zeros(4)
        amounts[list(edges)] = amount
        return replace(scene, opened=how(scene.opened, amounts))

    return change


def _edges(*edges: int) -> Change:
    """Return a change that scales the conductance of some valve edges by 1 + amount."""
    return _opened(lambda opened, share: np.maximum(opened * (1.0 + share), 0.0), *edges)


def _command(how: Callable[[Array, float, float], Array]) -> Change:
    """Return a change that opens the valve for another command, `how` (command, amount, sampling step) -> command."""

    def change(scene: Scene, amount: float) -> Scene:
        return _reopened(scene, scene.drive, how(scene.signals.command, amount, scene.signals.step_s))

    return change


def _overlap(scene: Scene, amount: float) -> Scene:
    """Change the overlap of the valve's edges."""
    drive = scene.drive.replace({"valve.overlap": (scene.drive.valve.overlap or 0.0) + amount})
    return _reopened(scene, drive, scene.signals.command)


def _reopened(scene: Scene, drive: Drive, command: Array) -> Scene:
    """Return the scene with another drive and the changed openings of its valve under this command."""
    before = at_samples(openings(scene.drive, scene.signals.command))
    after = at_samples(openings(drive, command))
    return replace(scene, drive=drive, opened=np.maximum(scene.opened + after - before, 0.0))


def _delayed(command: Array, delay_s: float, step_s: float) -> Array:
    """Delay the command by a time that need not be a whole number of samples."""
    sample = np.arange(command.size)
    return np.interp(sample - delay_s / step_s, sample, command)


def _sag(lag_s: float) -> Change:
    """Return a change that lowers the supply pressure in proportion to the lagged flow, by at most the amount in Pa."""

    def change(scene: Scene, amount: float) -> Scene:
        step = 1e-3 * scene.drive.supply_pressure_pa
        before, after = scene.terms, _supply(scene, -step).terms
        drawn = np.maximum(before["mass_flow_a_kg_s"], 0.0) + np.maximum(before["mass_flow_b_kg_s"], 0.0)
        decay = np.exp(-scene.signals.step_s / lag_s) if lag_s else 0.0
        drawn = np.asarray(lfilter([1.0 - decay], [1.0, -decay], drawn))
        fall, k0 = amount * drawn / max(drawn.max(), 1e-30), scene.kernel[0]
        a, b = (np.convolve(fall * (after[rate] - before[rate]) / step, k0, "valid") for rate in RATES)
        return scene.less(np.stack([np.zeros_like(a), a, b]))

    return change


def _leakage(drive: Drive, share: float) -> float:
    return drive.cylinder.leakage_m3_s_pa + share * drive.valve.conductance_m3_s_pa


def _to_ambient(chamber: int) -> Callable[[Scene], tuple[Array, float]]:
    """Return a function: scene -> pressure ratio over a leak to the ambient air, and critical ratio of the leak."""
    return lambda scene: (
        scene.drive.ambient.pressure_pa / scene.pressures[chamber],
        scene.drive.valve.critical_pressure_ratio,
    )


def _past_piston(scene: Scene) -> tuple[Array, float]:
    """Return the pressure ratio of a leak past the piston, and the critical ratio of `cylinder.leakage`."""
    a, b = scene.pressures
    return np.minimum(a, b) / np.maximum(a, b), LEAK_CRITICAL_RATIO


def _dead_volume(sides: str) -> Change:
    def changes(drive: Drive, share: float) -> Plain:
        old = drive.cylinder.dead_volume_m3
        factor = {c: 1.0 + share if c in sides else 1.0 for c in "ab"}
        return {"cylinder.dead_volume": {c: write(getattr(old, c) * factor[c], "m^3", "cm3") for c in "ab"}}

    return _drive(changes)


def _sensor(position: float = 0.0, a: float = 0.0, b: float = 0.0) -> Change:
    """Return a change for sensors that read too high by an amount: it lowers the values by this amount."""

    def change(scene: Scene, amount: float) -> Scene:
        p_a, p_b = scene.pressures
        truth = (p_a - a * amount, p_b - b * amount)
        return replace(scene, position=scene.position - position * amount, pressures=truth)

    return change


def _gain(scene: Scene, share: float) -> Scene:
    a, b = scene.pressures
    return replace(scene, pressures=(a / (1.0 + share), b / (1.0 + share)))


_SENSORS: Rows = {
    "zero of pressure a": {"change": _sensor(a=1.0)},
    "zero of pressure b": {"change": _sensor(b=1.0)},
    "gain of the pressures": {"change": _gain},
    "zero of the position": {"change": _sensor(position=1.0)},
}
