"""Possible causes of model errors: a change of one quantity each, and its effect on the balances.

A cause changes the scene (drive, sensors, openings of the valve) by an amount, or adds a term to a residual. Its column
in the regression is the difference quotient of the residuals, evaluated by the core.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pneudrive.constants import LEAK_CRITICAL_RATIO
from pneudrive.units import write
from pneudrive.validate.balance import Scene, Values, at_samples, openings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive

    Array = NDArray[np.float64]

Change = Callable[[Scene, float], Scene]


#: Bounds of a change as a share of the present value.
SHARE = (-0.95, 20.0)
#: Bounds of a critical pressure ratio.
RATIO = (0.01, 0.95)
#: Bounds of an amount that physics allows in one sense only: a leak does not blow, a supply does not rise with flow.
NOT_NEGATIVE = (0.0, np.inf)


@dataclass(frozen=True)
class Cause:
    """Possible cause of a model error.

    Attributes
    ----------
    key : str
        Short name, unique.
    family : str
        Group: friction, load, valve, supply, chamber, sensor.
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
        (scene, amount) -> scene.
    ratio : callable or None
        Scene -> ratio of the pressures after and before a leak at each sample, and the critical ratio of its flow.
    profile : callable or None
        Scene -> columns, for a cause with several coefficients.
    parts : int
        Number of coefficients: more of them explain more by chance.
    bounds : tuple of float
        Least and greatest amount that a description allows.
    described : bool
        Whether a drive file or the data of the sensors can describe it.
    free : tuple of str
        Values of the drive file that `pneudrive identify` would set free for it.
    """

    key: str
    family: str
    words: str
    unit: str
    step: float
    least: float
    remedy: str
    change: Change | None = None
    ratio: Callable[[Scene], tuple[Array, float]] | None = None
    profile: Callable[[Scene], list[Values]] | None = None
    parts: int = 1
    bounds: tuple[float, float] = (-np.inf, np.inf)
    described: bool = True
    free: tuple[str, ...] = ()

    def effect(self, scene: Scene, amount: float) -> Values:
        """Return the reduction of the residuals when the model is changed by `amount`."""
        assert self.change is not None
        (a, b, c), (x, y, z) = scene.residuals, self.change(scene, amount).residuals
        return a - x, b - y, c - z


def _drive(changes: Callable[[Drive, float], dict[str, object]]) -> Change:
    return lambda scene, amount: scene.with_drive(scene.drive.replace(changes(scene.drive, amount)))


def _value(key: str, si_unit: str, value: Callable[[Drive, float], float]) -> Change:
    """Change one value of the description: (drive, amount) -> value, SI."""
    return _drive(lambda drive, amount: {key: write(value(drive, amount), si_unit)})


def _friction_level(drive: Drive, amount: float) -> dict[str, object]:
    """Change Fc and Fs by the same amount."""
    known = drive.friction.parameters
    return {f"friction.{k}": write(max(known[k] + amount, 1e-6), "N") for k in ("coulomb", "breakaway") if k in known}


def _breakaway(drive: Drive, amount: float) -> float:
    known = drive.friction.parameters
    return max(known["breakaway"] + amount, known["coulomb"])


def _pressure_friction(drive: Drive, amount: float) -> dict[str, object]:
    """Change Coulomb and breakaway force with the pressure in either chamber, N/Pa."""
    seals = drive.friction.pressure
    pairs = {}
    for name in ("coulomb", "breakaway"):
        old = getattr(seals, name) if seals is not None else (0.0, 0.0)
        pairs[name] = dict(zip("ab", (write(v + amount, "N/Pa") for v in old), strict=True))
    return {"friction.pressure": pairs}


def _direction(drive: Drive, amount: float) -> dict[str, object]:
    """Increase friction towards +x and decrease it towards -x by this fraction."""
    old = drive.friction.direction
    positive, negative = (1.0, 1.0) if old is None else (old.positive, old.negative)
    return {"friction.direction": {"positive": positive * (1.0 + amount), "negative": negative * (1.0 - amount)}}


def _dead_volume(sides: str) -> Change:
    def changes(drive: Drive, share: float) -> dict[str, object]:
        old = drive.cylinder.dead_volume_m3
        factor = {c: 1.0 + share if c in sides else 1.0 for c in "ab"}
        return {"cylinder.dead_volume": {c: write(getattr(old, c) * factor[c], "m^3", "cm3") for c in "ab"}}

    return _drive(changes)


def _piston_leak(drive: Drive, share: float) -> float:
    """Change the leakage past the piston by a fraction of the valve's conductance."""
    return drive.cylinder.leakage_m3_s_pa + share * drive.valve.conductance_m3_s_pa


def _spring(drive: Drive, amount: float) -> dict[str, object]:
    old = drive.carried.spring
    if old is not None:
        return {"load.spring.stiffness": write(old.stiffness_n_m + amount, "N/m")}
    return {
        "load.spring": {"stiffness": write(amount, "N/m"), "rest_position": write(0.5 * drive.cylinder.stroke_m, "m")}
    }


def _opened(how: Callable[[Array, Array], Array], *edges: int) -> Change:
    """Change the openings of some edges of the valve: (openings, amount at each edge) -> openings."""

    def change(scene: Scene, amount: float) -> Scene:
        each = np.zeros(4)
        each[list(edges)] = amount
        return replace(scene, opened=how(scene.opened, each))

    return change


def _edges(*edges: int) -> Change:
    """Change the conductance of some edges of the valve by a fraction."""
    return _opened(lambda opened, share: np.maximum(opened * (1.0 + share), 0.0), *edges)


def _leak(*edges: int) -> Change:
    """Keep some edges open by at least this fraction of the full conductance."""
    return _opened(np.add, *edges)


def _command(how: Callable[[Array, float, float], Array]) -> Change:
    """Change the openings by a changed command: (command, amount, step) -> command."""

    def change(scene: Scene, amount: float) -> Scene:
        command = scene.signals.command
        after = at_samples(openings(scene.drive, how(command, amount, scene.signals.step_s)))
        before = at_samples(openings(scene.drive, command))
        return replace(scene, opened=np.maximum(scene.opened + after - before, 0.0))

    return change


def _delayed(command: Array, delay_s: float, step_s: float) -> Array:
    """Delay the command by a time that need not be a whole number of samples."""
    k = np.arange(command.size)
    whole = int(np.floor(delay_s / step_s))
    part = delay_s / step_s - whole
    late, later = command[np.clip(k - whole, 0, command.size - 1)], command[np.clip(k - whole - 1, 0, command.size - 1)]
    return (1.0 - part) * late + part * later


def _overlap(scene: Scene, amount: float) -> Scene:
    """Change the overlap of the valve's edges."""
    changed = scene.with_drive(scene.drive.replace({"valve.overlap": (scene.drive.valve.overlap or 0.0) + amount}))
    command = scene.signals.command
    before, after = (at_samples(openings(one.drive, command)) for one in (scene, changed))
    return replace(changed, opened=np.maximum(scene.opened + after - before, 0.0))


def _sensor(position: float = 0.0, a: float = 0.0, b: float = 0.0) -> Change:
    """Sensors that read too high by an amount: the true values are lower."""

    def change(scene: Scene, amount: float) -> Scene:
        p_a, p_b = scene.pressures
        truth = (p_a - a * amount, p_b - b * amount)
        return replace(scene, position=scene.position - position * amount, pressures=truth)

    return change


def _gain(scene: Scene, share: float) -> Scene:
    a, b = scene.pressures
    return replace(scene, pressures=(a / (1.0 + share), b / (1.0 + share)))


def _sag(lag_s: float) -> Change:
    """Lower the supply pressure with the flow into the drive, through a first-order lag: Pa at the lowest pressure."""

    def change(scene: Scene, amount: float) -> Scene:
        step = 1e-3 * scene.drive.supply_pressure_pa
        lower = scene.drive.replace({"supply.pressure": f"{scene.drive.supply_pressure_pa - step!r} Pa abs"})
        before, after = scene.terms, scene.with_drive(lower).terms
        drawn = np.maximum(before.mass_flow_a_kg_s, 0.0) + np.maximum(before.mass_flow_b_kg_s, 0.0)
        decay = float(np.exp(-scene.signals.step_s / lag_s)) if lag_s else 0.0
        drawn = np.asarray(lfilter([1.0 - decay], [1.0, -decay], drawn))
        fall, k0 = amount * drawn / max(float(drawn.max()), 1e-30), scene.kernel[0]
        rates = zip(after.pressure_rates, before.pressure_rates, strict=True)
        a, b = (np.convolve(fall * (new - old) / step, k0, "valid") for new, old in rates)
        _, known_a, known_b = scene.explained or (0.0, 0.0, 0.0)
        return replace(scene, explained=(np.zeros_like(a), known_a + a, known_b + b))

    return change


#: Lag of the supply pressure behind the flow where a volume lies between regulator and valve, s (assumed).
SLOW_SAG_S = 0.5


def _after_leak(side: str) -> Callable[[Scene], tuple[Array, float]]:
    """Return the pressure ratio over a leak to the ambient air; its flow follows the law of the valve."""

    def ratio(scene: Scene) -> tuple[Array, float]:
        inside = scene.pressures["ab".index(side)]
        return scene.drive.ambient.pressure_pa / inside, scene.drive.valve.critical_pressure_ratio

    return ratio


def _past_piston(scene: Scene) -> tuple[Array, float]:
    """Return the pressure ratio over a leak past the piston, and the critical ratio of `cylinder.leakage`."""
    a, b = scene.pressures
    return np.minimum(a, b) / np.maximum(a, b), LEAK_CRITICAL_RATIO


#: Number of polynomials for friction along the stroke, including the constant.
PROFILE_ORDERS = (0, 1, 2, 3, 4)


def _along_stroke(scene: Scene) -> list[Values]:
    """Return the residuals of friction along the stroke: Legendre polynomials over the travelled range, per N."""
    x, signals = scene.position, scene.signals
    sign = np.where(signals.moving, np.sign(signals.velocity_m_s), 0.0)
    out: list[Values] = []
    for order in PROFILE_ORDERS:
        shape = np.polynomial.legendre.Legendre.basis(order, domain=[float(x.min()), float(x.max())])(x)
        force = np.convolve(sign * shape, scene.kernel[0], "valid")
        out.append((force, np.zeros_like(force), np.zeros_like(force)))
    return out


_PATH_REMEDY = "measure C of this path (ISO 6358), check for an unmodelled fitting, silencer or flow control"


def causes(drive: Drive) -> list[Cause]:
    """Return all causes that can be tested for a drive."""
    friction = _of_friction(drive) if "coulomb" in drive.friction.parameters else []
    leaks = _of_leaks(drive)
    return [
        *friction,
        *_of_load(drive),
        *_of_valve(drive),
        *_of_supply(drive),
        *leaks,
        *_of_chambers(drive),
        *_of_sensors(),
    ]


def _mass(drive: Drive, share: float) -> dict[str, object]:
    """Change piston and load by the same fraction, so that each stays above zero."""
    own, load = drive.cylinder.moving_mass_kg, drive.carried.mass_kg
    changed: dict[str, object] = {"cylinder.moving_mass": write((1.0 + share) * own, "kg")}
    return changed | ({"load.mass": write((1.0 + share) * load, "kg")} if load else {})


def _of_load(drive: Drive) -> list[Cause]:
    spring = drive.carried.spring
    own_stiffness = 0.0 if spring is None else spring.stiffness_n_m
    heavier = "load.mass" if drive.carried.mass_kg > drive.cylinder.moving_mass_kg else "cylinder.moving_mass"
    return [
        Cause("moving mass", "load", "{size} moving mass", "share", 0.05, 0.03,
                  "weigh piston, slide and load", _drive(_mass), bounds=SHARE, free=(heavier,)),
        Cause("constant force", "load", "an unmodelled constant force of {size} in +x", "N", 1.0, 1.0,
                  "check the incline (weight), the drag of cables, and the zeros of the pressure sensors",
                  _value("load.force", "N", lambda d, f: d.carried.force_n + f), free=("load.force",)),
        Cause("spring", "load", "an unmodelled spring of {size} around mid stroke", "N/m", 20.0, 10.0,
                  "check for cables, hoses and covers that pull", _drive(_spring), bounds=(-own_stiffness, np.inf)),
    ]  # fmt: skip


def _of_valve(drive: Drive) -> list[Cause]:
    ratio = drive.valve.critical_pressure_ratio
    conductance = _value(
        "valve.conductance", "m^3/(s Pa)", lambda d, share: d.valve.conductance_m3_s_pa * (1.0 + share)
    )
    return [
        Cause("conductance", "valve", "{size} conductance C of the valve, all paths", "share", 0.05, 0.03,
                  "measure C (ISO 6358), or fit valve.conductance to these records", conductance, bounds=SHARE,
                  free=("valve.conductance",)),
        Cause("conductance to exhaust", "valve", "{size} conductance of the valve towards exhaust", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(1, 3), bounds=SHARE, described=False),
        Cause("conductance from supply", "valve", "{size} conductance of the valve from supply", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(0, 2), bounds=SHARE, described=False),
        Cause("conductance of a", "valve", "{size} conductance of the paths of chamber a", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(0, 1), bounds=SHARE, described=False),
        Cause("conductance of b", "valve", "{size} conductance of the paths of chamber b", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(2, 3), bounds=SHARE, described=False),
        Cause("critical pressure ratio", "valve", "critical pressure ratio b {size}", "1", 0.03, 0.03,
                  "measure b (ISO 6358), or fit valve.critical_pressure_ratio to these records",
                  _drive(lambda d, b: {"valve.critical_pressure_ratio": float(
                      np.clip(d.valve.critical_pressure_ratio + b, *RATIO))}),
                  bounds=(RATIO[0] - ratio, RATIO[1] - ratio),
                  free=("valve.critical_pressure_ratio",)),
        Cause("valve delay", "valve", "a valve delay of {size}", "s", 2e-3, 1e-3,
                  "measure the valve's step response (negative: the command was logged late); identify with a free "
                  "delay of the command", _command(_delayed)),
        Cause("valve zero", "valve", "a valve with its zero at a command of {size}", "1", 0.01, 0.005,
                  "find the command at which the piston rests, and use it as zero",
                  _command(lambda u, zero, _: np.clip(u - zero, -1.0, 1.0)), described=False),
        Cause("dead zone", "valve", "a dead zone of the valve of {size} of its command", "1", 0.01, 0.005,
                  "measure the flow over the command near zero, or fit valve.overlap to small and large commands",
                  _overlap, bounds=(-(drive.valve.overlap or 0.0), 0.9), free=("valve.overlap",)),
    ]  # fmt: skip


def _of_supply(drive: Drive) -> list[Cause]:
    gauge = drive.supply_pressure_pa - drive.ambient.pressure_pa
    return [
        Cause("supply pressure", "supply", "{size} supply pressure", "Pa", 0.05e5, 0.05e5,
                  "measure the pressure at the valve's inlet while the drive runs",
                  _drive(lambda d, p: {"supply.pressure": f"{d.supply_pressure_pa + p!r} Pa abs"}),
                  bounds=(-0.9 * gauge, np.inf), free=("supply.pressure",)),
        Cause("supply sag", "supply", "a supply pressure that falls by {size} at the greatest flow", "Pa",
                  0.05e5, 0.1e5, "a larger regulator or a tank near the valve; measure the pressure there", _sag(0.0),
                  bounds=NOT_NEGATIVE, described=False),
        Cause("slow supply sag", "supply", "a supply pressure that falls by {size} with the flow of the last "
                  f"{SLOW_SAG_S:g} s", "Pa", 0.05e5, 0.1e5, "a larger regulator; measure the pressure at the valve",
                  _sag(SLOW_SAG_S), bounds=NOT_NEGATIVE, described=False),
    ]  # fmt: skip


def _of_leaks(drive: Drive) -> list[Cause]:
    return [
        Cause("leak from a", "valve", "a leak from chamber a outside, {size} of C", "share of C", 0.005, 0.002,
                  "seal-tightness test: shut the valve and watch pressure a", _leak(1), _after_leak("a"),
                  bounds=NOT_NEGATIVE, described=False),
        Cause("leak from b", "valve", "a leak from chamber b outside, {size} of C", "share of C", 0.005, 0.002,
                  "seal-tightness test: shut the valve and watch pressure b", _leak(3), _after_leak("b"),
                  bounds=NOT_NEGATIVE, described=False),
        Cause("leak through the valve", "valve", "a leak of the valve from supply to both chambers, {size} of C",
                  "share of C", 0.005, 0.002, "measure the pressure rise behind the shut valve", _leak(0, 2),
                  bounds=NOT_NEGATIVE, described=False),
        Cause("leak past the piston", "chamber", "a leak past the piston of {size} of C", "share of C",
                  0.005, 0.002, "hold the piston with one chamber under pressure and watch the other; "
                  "cylinder.leakage describes it", _value("cylinder.leakage", "m^3/(s Pa)", _piston_leak), _past_piston,
                  bounds=(-drive.cylinder.leakage_m3_s_pa / drive.valve.conductance_m3_s_pa, np.inf),
                  free=("cylinder.leakage",)),
    ]  # fmt: skip


def _of_chambers(drive: Drive) -> list[Cause]:
    out = [
        *[Cause(f"dead volume of {c}", "chamber", f"{{size}} dead volume of chamber {c}", "share", 0.1, 0.08,
                    "add ports, fittings and tubes up to the valve to cylinder.dead_volume", _dead_volume(c),
                    bounds=SHARE, free=(f"cylinder.dead_volume.{c}",))
          for c in "ab"],
        Cause("dead volumes", "chamber", "{size} dead volume of both chambers", "share", 0.1, 0.08,
                  "add ports, fittings and tubes up to the valve to cylinder.dead_volume", _dead_volume("ab"),
                  bounds=SHARE, free=("cylinder.dead_volume.a", "cylinder.dead_volume.b")),
    ]  # fmt: skip
    is_stated = drive.cylinder.heat_transfer_w_m2_k is not None
    key, field, unit = (
        ("cylinder.heat_transfer", "heat_transfer_w_m2_k", "W/(m^2 K)")
        if is_stated
        else ("cylinder.heat_transfer_scale", "heat_transfer_scale", "")
    )
    if getattr(drive.cylinder, field) > 0.0:
        out.append(
            Cause("heat transfer", "chamber", "{size} heat transfer to the walls", "share", 0.3, 0.3,
                      f"fit {key} to the pressure decay after a fast fill with the valve shut",
                      _value(key, unit, lambda d, share: getattr(d.cylinder, field) * (1.0 + share)),
                      bounds=SHARE, free=(key,))
        )  # fmt: skip
    return out


def _of_sensors() -> list[Cause]:
    return [
        *[Cause(f"zero of pressure {c}", "sensor", f"pressure sensor {c} that reads {{size}} too high", "Pa",
                    2e3, 2e3, "tare the sensor at ambient pressure, or let identify find its offset and validate that "
                    "fit", _sensor(**{c: 1.0})) for c in "ab"],
        Cause("gain of the pressures", "sensor", "pressure sensors that read {size} too high", "share", 0.01, 0.01,
                  "calibrate the pressure sensors", _gain, bounds=(-0.5, 0.5)),
        Cause("zero of the position", "sensor", "a position sensor that reads {size} too high", "m", 2e-3, 2e-3,
                  "tare the position at the end of the stroke", _sensor(position=1.0)),
    ]  # fmt: skip


def _of_friction(drive: Drive) -> list[Cause]:
    refit = "measure friction over speed (pneudrive campaign), or fit it to these records"
    parameters = drive.friction.parameters
    level = parameters["coulomb"]
    own_lips = (0.0,) if drive.friction.pressure is None else drive.friction.pressure.coulomb_n_pa
    out = [
        Cause("Coulomb friction", "friction", "{size} Coulomb friction", "N", 0.05 * level, 0.04 * level, refit,
                  _drive(_friction_level), bounds=(-level, np.inf), free=("friction.coulomb",)),
        Cause("pressure-dependent friction", "friction", "friction that grows by {size} more with the pressure in "
                  "either chamber", "N/Pa", 2e-6, 2e-6, "fit with pressure_dependence=True over several pressures",
                  _drive(_pressure_friction), bounds=(-min(own_lips), np.inf)),
        Cause("direction of friction", "friction", "{size} friction towards +x and the opposite change "
                  "towards -x", "share", 0.03, 0.03, "fit each direction separately (friction.direction)",
                  _drive(_direction), bounds=(-0.9, 0.9)),
        Cause("friction along the stroke", "friction", "friction that varies by +/- {size} along the stroke",
                  "N", 1.0, 0.04 * level, "measure friction over position; friction.position describes it",
                  profile=_along_stroke, parts=len(PROFILE_ORDERS)),
    ]  # fmt: skip
    if "viscous" in parameters:
        out.append(
            Cause("viscous friction", "friction", "{size} viscous friction", "N s/m", 5.0, 4.0, refit,
                  _value("friction.viscous", "N s/m", lambda d, b: max(d.friction.parameters["viscous"] + b, 0.0)),
                  bounds=(-parameters["viscous"], np.inf), free=("friction.viscous",))
        )  # fmt: skip
    if "breakaway" in parameters:
        out.append(
            Cause("Stribeck friction", "friction", "{size} friction at low speed (breakaway above Coulomb)", "N",
                      0.05 * level, 0.1 * level, refit, _value("friction.breakaway", "N", _breakaway),
                      bounds=(level - parameters["breakaway"], np.inf), free=("friction.breakaway",))
        )  # fmt: skip
    return out
