"""What may be wrong with a model: one change of one thing, as it shows in the balances.

A candidate changes the scene (drive, sensors, openings of the valve) by an amount, or adds a term to a residual. Its
column in the regression is the difference quotient of the residuals: the equations stay the core's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.valve_flow import openings
from pneudrive.units import write
from pneudrive.validate.residuals import Scene, at_samples, half_support, kernel, raw_residuals

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.validate.balance import Terms
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]
    Change = Callable[[Scene, Signals, float], Scene]
    Values = tuple[Array, Array, Array]


#: Bounds of a change that is a share of the present value.
SHARE = (-0.95, 20.0)


@dataclass(frozen=True)
class Candidate:
    """One thing that may be wrong.

    Attributes
    ----------
    key : str
        Short name, unique.
    family : str
        What it belongs to: friction, load, valve, supply, chamber, sensor.
    words : str
        With ``{size}`` where the amount is said: "{size} Coulomb friction".
    unit : str
        Of the amount: an SI unit, or "share" of the present value.
    step : float
        Amount over which the difference quotient is taken.
    least : float
        Amounts below this are not worth a name.
    remedy : str
    change : callable or None
        (scene, signals, amount) -> scene.
    term : callable or None
        (terms, signals, scene) -> extra residual per amount, for what no change of the scene can say.
    profile : callable or None
        (scene, signals) -> columns, for what several numbers say together.
    parts : int
        Numbers that the candidate stands for: more of them explain more by chance.
    bounds : tuple of float
        Least and greatest amount that the description takes.
    described : bool
        Whether a drive file, or what is known of the sensors, can say it.
    """

    key: str
    family: str
    words: str
    unit: str
    step: float
    least: float
    remedy: str
    change: Change | None = None
    term: Callable[[Terms, Signals, Scene], Values] | None = None
    profile: Callable[[Scene, Signals], list[Values]] | None = None
    parts: int = 1
    bounds: tuple[float, float] = (-np.inf, np.inf)
    described: bool = True

    def effect(self, scene: Scene, signals: Signals, amount: float, base: Values) -> Values:
        """Return what the residuals lose when the model is changed by `amount`."""
        if self.term is not None:
            _, terms = raw_residuals(scene, signals)
            return tuple(amount * v for v in self.term(terms, signals, scene))  # type: ignore[return-value]
        assert self.change is not None
        changed, _ = raw_residuals(self.change(scene, signals, amount), signals)
        return tuple(b - c for b, c in zip(base, changed, strict=True))  # type: ignore[return-value]


def _drive(changes: Callable[[Drive, float], dict[str, object]]) -> Change:
    return lambda scene, _, amount: replace(scene, drive=scene.drive.replace(changes(scene.drive, amount)))


def _scaled(key: str, value: Callable[[Drive], float], si_unit: str) -> Change:
    def changes(drive: Drive, share: float) -> dict[str, object]:
        after = value(drive) * (1.0 + share)
        return {key: write(after, si_unit) if si_unit else after}

    return _drive(changes)


def _friction_level(drive: Drive, amount: float) -> dict[str, object]:
    """Fc and Fs by the same amount."""
    known = drive.friction.parameters
    return {f"friction.{k}": write(max(known[k] + amount, 1e-6), "N") for k in ("coulomb", "breakaway") if k in known}


def _breakaway(drive: Drive, amount: float) -> dict[str, object]:
    known = drive.friction.parameters
    return {"friction.breakaway": write(max(known["breakaway"] + amount, known["coulomb"]), "N")}


def _viscous(drive: Drive, amount: float) -> dict[str, object]:
    return {"friction.viscous": write(max(drive.friction.parameters.get("viscous", 0.0) + amount, 0.0), "N s/m")}


def _pressure_friction(drive: Drive, amount: float) -> dict[str, object]:
    """Coulomb and breakaway by so many N/Pa in either chamber."""
    seals = drive.friction.pressure
    pairs = {}
    for name in ("coulomb", "breakaway"):
        old = getattr(seals, name) if seals is not None else (0.0, 0.0)
        pairs[name] = dict(zip("ab", (write(v + amount, "N/Pa") for v in old), strict=True))
    return {"friction.pressure": pairs}


def _direction(drive: Drive, amount: float) -> dict[str, object]:
    """More friction towards +x, less towards -x, by this share."""
    old = drive.friction.direction
    positive, negative = (1.0, 1.0) if old is None else (old.positive, old.negative)
    return {"friction.direction": {"positive": positive * (1.0 + amount), "negative": negative * (1.0 - amount)}}


def _moving_mass(drive: Drive, share: float) -> dict[str, object]:
    """Piston and load together by a share, as a change of the piston."""
    piston = drive.cylinder.moving_mass_kg
    return {"cylinder.moving_mass": write(piston + share * (piston + drive.carried.mass_kg), "kg")}


def _dead_volume(sides: str) -> Change:
    def changes(drive: Drive, share: float) -> dict[str, object]:
        old = drive.cylinder.dead_volume_m3
        factor = {c: 1.0 + share if c in sides else 1.0 for c in "ab"}
        return {"cylinder.dead_volume": {c: write(getattr(old, c) * factor[c], "m^3", "cm3") for c in "ab"}}

    return _drive(changes)


def _piston_leak(drive: Drive, share: float) -> dict[str, object]:
    """Leakage past the piston by so much of the valve's conductance."""
    leakage = drive.cylinder.leakage_m3_s_pa + share * drive.valve.conductance_m3_s_pa
    return {"cylinder.leakage": write(leakage, "m^3/(s Pa)")}


def _spring(drive: Drive, amount: float) -> dict[str, object]:
    old = drive.carried.spring
    if old is not None:
        return {"load.spring.stiffness": write(old.stiffness_n_m + amount, "N/m")}
    return {
        "load.spring": {"stiffness": write(amount, "N/m"), "rest_position": write(0.5 * drive.cylinder.stroke_m, "m")}
    }


def _edges(*edges: int) -> Change:
    """Conductance of some edges of the valve by a share."""

    def change(scene: Scene, _: Signals, share: float) -> Scene:
        factor = np.ones(4)
        factor[list(edges)] += share
        return replace(scene, opened=np.maximum(scene.opened * factor, 0.0))

    return change


def _leak(*edges: int) -> Change:
    """Edges that never shut: at least this share of the full conductance."""

    def change(scene: Scene, _: Signals, share: float) -> Scene:
        opened = scene.opened.copy()
        opened[:, list(edges)] += share
        return replace(scene, opened=opened)

    return change


def _command(how: Callable[[Array, float, float], Array]) -> Change:
    """Make the openings of a command that the valve sees otherwise: (command, amount, step) -> command."""

    def change(scene: Scene, signals: Signals, amount: float) -> Scene:
        before = at_samples(openings(signals.command))
        after = at_samples(openings(how(signals.command, amount, signals.step_s)))
        return replace(scene, opened=np.maximum(scene.opened + after - before, 0.0))

    return change


def _delayed(command: Array, delay_s: float, step_s: float) -> Array:
    """Hold the command back by a time that need not be a whole number of samples."""
    k = np.arange(command.size)
    whole = int(np.floor(delay_s / step_s))
    part = delay_s / step_s - whole
    late, later = command[np.clip(k - whole, 0, command.size - 1)], command[np.clip(k - whole - 1, 0, command.size - 1)]
    return (1.0 - part) * late + part * later


def _dead_zone(command: Array, zone: float, _: float) -> Array:
    return np.sign(command) * np.maximum(np.abs(command) - zone, 0.0)


def _sensor(which: str) -> Change:
    """Make a sensor that shows too much by an amount: the truth is less."""

    def change(scene: Scene, _: Signals, amount: float) -> Scene:
        a, b = scene.pressures
        if which == "position":
            return replace(scene, position=scene.position - amount)
        return replace(scene, pressures=(a - amount, b) if which == "a" else (a, b - amount))

    return change


def _gain(scene: Scene, _: Signals, share: float) -> Scene:
    a, b = scene.pressures
    return replace(scene, pressures=(a / (1.0 + share), b / (1.0 + share)))


def _sag(terms: Terms, signals: Signals, scene: Scene) -> Values:
    """Supply pressure that falls with the flow: per Pa at the greatest flow into the drive."""
    drive = scene.drive
    step = 1e-3 * drive.supply_pressure_pa
    lower = drive.replace({"supply.pressure": f"{drive.supply_pressure_pa - step!r} Pa abs"})
    from pneudrive.validate.balance import evaluate

    after = evaluate(lower, signals, position=scene.position, pressures=scene.pressures, opened=scene.opened)
    drawn = np.maximum(terms.mass_flow_a_kg_s, 0.0) + np.maximum(terms.mass_flow_b_kg_s, 0.0)
    share = drawn / max(float(drawn.max()), 1e-30)
    k0 = kernel(half_support(signals), signals.step_s)[0]
    rates = (terms.pressure_rate_a_pa_s, terms.pressure_rate_b_pa_s)
    afters = (after.pressure_rate_a_pa_s, after.pressure_rate_b_pa_s)
    a, b = (np.convolve(share * (new - old) / step, k0, "valid") for new, old in zip(afters, rates, strict=True))
    return np.zeros_like(a), a, b


#: Orders of the polynomials that say how friction varies along the stroke, its mean among them.
PROFILE_ORDERS = (0, 1, 2, 3, 4)


def _along_stroke(scene: Scene, signals: Signals) -> list[Values]:
    """Friction along the stroke: Legendre polynomials over the travelled range, per N."""
    x = scene.position
    low, high = float(x.min()), float(x.max())
    k0 = kernel(half_support(signals), signals.step_s)[0]
    sign = np.where(signals.moving, np.sign(signals.velocity_m_s), 0.0)
    out: list[Values] = []
    for order in PROFILE_ORDERS:
        shape = np.polynomial.legendre.Legendre.basis(order, domain=[low, high])(x)
        force = np.convolve(sign * shape, k0, "valid")
        out.append((force, np.zeros_like(force), np.zeros_like(force)))
    return out


_PATH_REMEDY = "measure C of this path (ISO 6358), look for a fitting, silencer or flow control that the model lacks"


def candidates(drive: Drive) -> list[Candidate]:
    """Everything that is asked of a residual, for this drive."""
    friction = _of_friction(drive) if "coulomb" in drive.friction.parameters else []
    leaks = _of_leaks(drive)
    return [*friction, *_of_load(), *_of_valve(), *_of_supply(), *leaks, *_of_chambers(drive), *_of_sensors()]


def _of_load() -> list[Candidate]:
    return [
        Candidate("moving mass", "load", "{size} moving mass", "share", 0.05, 0.03,
                  "weigh piston, slide and load", _drive(_moving_mass), bounds=SHARE),
        Candidate("constant force", "load", "a constant force of {size} in +x that the model lacks", "N", 1.0, 1.0,
                  "look for weight (incline), a cable drag, and the zeros of the pressure sensors",
                  _drive(lambda d, f: {"load.force": write(d.carried.force_n + f, "N")})),
        Candidate("spring", "load", "a spring of {size} around mid stroke that the model lacks", "N/m", 20.0, 10.0,
                  "look for cables, hoses and covers that pull", _drive(_spring)),
    ]  # fmt: skip


def _of_valve() -> list[Candidate]:
    conductance = _scaled("valve.conductance", lambda d: d.valve.conductance_m3_s_pa, "m^3/(s Pa)")
    return [
        Candidate("conductance", "valve", "{size} conductance C of the valve, all paths", "share", 0.05, 0.03,
                  "measure C (ISO 6358), or fit valve.conductance to these records", conductance, bounds=SHARE),
        Candidate("conductance to exhaust", "valve", "{size} conductance of the valve towards exhaust", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(1, 3), bounds=SHARE, described=False),
        Candidate("conductance from supply", "valve", "{size} conductance of the valve from supply", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(0, 2), bounds=SHARE, described=False),
        Candidate("conductance of a", "valve", "{size} conductance of the paths of chamber a", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(0, 1), bounds=SHARE, described=False),
        Candidate("conductance of b", "valve", "{size} conductance of the paths of chamber b", "share",
                  0.05, 0.04, _PATH_REMEDY, _edges(2, 3), bounds=SHARE, described=False),
        Candidate("critical pressure ratio", "valve", "critical pressure ratio b {size}", "1", 0.03, 0.03,
                  "measure b (ISO 6358), or fit valve.critical_pressure_ratio to these records",
                  _drive(lambda d, b: {"valve.critical_pressure_ratio": float(
                      np.clip(d.valve.critical_pressure_ratio + b, 0.01, 0.95))}), bounds=(-0.6, 0.6)),
        Candidate("valve delay", "valve", "a valve that acts {size} late", "s", 2e-3, 1e-3,
                  "measure the valve's step response; identify with a free delay of the command", _command(_delayed)),
        Candidate("valve zero", "valve", "a valve whose zero lies at a command of {size}", "1", 0.01, 0.005,
                  "find the command at which the piston stands, and tare it",
                  _command(lambda u, zero, _: np.clip(u - zero, -1.0, 1.0)), described=False),
        Candidate("dead zone", "valve", "a dead zone of the valve of {size} of its command", "1", 0.01, 0.005,
                  "measure the flow over the command near zero", _command(_dead_zone), described=False),
    ]  # fmt: skip


def _of_supply() -> list[Candidate]:
    return [
        Candidate("supply pressure", "supply", "{size} supply pressure", "Pa", 0.05e5, 0.05e5,
                  "measure the pressure at the valve's inlet while the drive runs",
                  _drive(lambda d, p: {"supply.pressure": f"{d.supply_pressure_pa + p!r} Pa abs"})),
        Candidate("supply sag", "supply", "a supply pressure that falls by {size} at the greatest flow", "Pa",
                  0.05e5, 0.1e5, "a larger regulator or a tank near the valve; measure the pressure there", term=_sag,
                  described=False),
    ]  # fmt: skip


def _of_leaks(drive: Drive) -> list[Candidate]:
    return [
        Candidate("leak from a", "valve", "a leak from chamber a outside, {size} of C", "share of C", 0.005, 0.002,
                  "seal-tightness test: shut the valve and watch pressure a", _leak(1), described=False),
        Candidate("leak from b", "valve", "a leak from chamber b outside, {size} of C", "share of C", 0.005, 0.002,
                  "seal-tightness test: shut the valve and watch pressure b", _leak(3), described=False),
        Candidate("leak through the valve", "valve", "a leak of the valve from supply to both chambers, {size} of C",
                  "share of C", 0.005, 0.002, "measure the pressure rise behind the shut valve", _leak(0, 2),
                  described=False),
        Candidate("leak past the piston", "chamber", "a leak past the piston of {size} of C", "share of C",
                  0.005, 0.002, "hold the piston with one chamber under pressure and watch the other; "
                  "cylinder.leakage describes it", _drive(_piston_leak),
                  bounds=(-drive.cylinder.leakage_m3_s_pa / drive.valve.conductance_m3_s_pa, np.inf)),
    ]  # fmt: skip


def _of_chambers(drive: Drive) -> list[Candidate]:
    out = [
        *[Candidate(f"dead volume of {c}", "chamber", f"{{size}} dead volume of chamber {c}", "share", 0.1, 0.08,
                    "add ports, fittings and tubes up to the valve to cylinder.dead_volume", _dead_volume(c),
                    bounds=SHARE)
          for c in "ab"],
        Candidate("dead volumes", "chamber", "{size} dead volume of both chambers", "share", 0.1, 0.08,
                  "add ports, fittings and tubes up to the valve to cylinder.dead_volume", _dead_volume("ab"),
                  bounds=SHARE),
    ]  # fmt: skip
    if drive.cylinder.heat_transfer_w_m2_k > 0.0:
        out.append(
            Candidate("heat transfer", "chamber", "{size} heat transfer to the walls", "share", 0.3, 0.3,
                      "fit cylinder.heat_transfer to the pressure decay after a fast fill with the valve shut",
                      _scaled("cylinder.heat_transfer", lambda d: d.cylinder.heat_transfer_w_m2_k, "W/(m^2 K)"),
                      bounds=SHARE)
        )  # fmt: skip
    return out


def _of_sensors() -> list[Candidate]:
    return [
        *[Candidate(f"zero of pressure {c}", "sensor", f"pressure sensor {c} that shows {{size}} too much", "Pa",
                    2e3, 2e3, "tare the sensor at ambient pressure, or let identify find its offset and validate that "
                    "fit", _sensor(c)) for c in "ab"],
        Candidate("gain of the pressures", "sensor", "pressure sensors that show {size} too much", "share", 0.01, 0.01,
                  "calibrate the pressure sensors", _gain, bounds=(-0.5, 0.5)),
        Candidate("zero of the position", "sensor", "a position that is shown {size} too large", "m", 2e-3, 2e-3,
                  "tare the position at the end of the stroke", _sensor("position")),
    ]  # fmt: skip


def _of_friction(drive: Drive) -> list[Candidate]:
    refit = "measure friction over speed (pneudrive campaign), or fit it to these records"
    parameters = drive.friction.parameters
    level = parameters["coulomb"]
    out = [
        Candidate("Coulomb friction", "friction", "{size} Coulomb friction", "N", 0.05 * level, 0.04 * level, refit,
                  _drive(_friction_level)),
        Candidate("pressure-dependent friction", "friction", "friction that grows by {size} more with the pressure in "
                  "either chamber", "N/Pa", 2e-6, 2e-6, "fit with pressure_dependence=True over several pressures",
                  _drive(_pressure_friction)),
        Candidate("direction of friction", "friction", "{size} friction towards +x and as much the other way "
                  "towards -x", "share", 0.03, 0.03, "fit both directions by themselves (friction.direction)",
                  _drive(_direction), bounds=(-0.9, 0.9)),
        Candidate("friction along the stroke", "friction", "friction that varies by {size} either way along the stroke",
                  "N", 1.0, 0.04 * level, "measure friction over position; friction.position describes it",
                  profile=_along_stroke, parts=len(PROFILE_ORDERS)),
    ]  # fmt: skip
    if "viscous" in parameters:
        out.append(
            Candidate("viscous friction", "friction", "{size} viscous friction", "N s/m", 5.0, 4.0, refit,
                      _drive(_viscous))
        )  # fmt: skip
    if "breakaway" in parameters:
        out.append(
            Candidate("Stribeck friction", "friction", "{size} friction at low speed (breakaway above Coulomb)", "N",
                      0.05 * level, 0.1 * level, refit, _drive(_breakaway))
        )  # fmt: skip
    return out
