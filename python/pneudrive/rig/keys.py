"""The keys of a rig file, each listed once: unit, meaning, bounds, default. Parameters of components are the core's.

The parameters of friction are those of the law, which the core knows; what acts on it is as in a drive file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from pneudrive.constants import ANR_TEMPERATURE_K
from pneudrive.describe.base import Bounds, Mark, Quantity, StatedPressure, WrongValueError
from pneudrive.describe.components import component_kinds
from pneudrive.describe.geometry import KINDS
from pneudrive.describe.marks import Choice
from pneudrive.describe.parameters import parameter_quantity
from pneudrive.rig.sensors import CLOCKS


class Key(NamedTuple):
    """What a key of a rig file holds: how it is written, its meaning, its default; ``...`` where it must be there."""

    mark: Mark
    meaning: str
    default: Any = ...


@dataclass(frozen=True)
class AbsolutePressure(Quantity):
    """Annotation of a field that takes an absolute pressure and stores Pa."""

    def read(self, given: object) -> float:
        """Convert and check."""
        pressure = StatedPressure().read(given)
        if pressure.gauge:
            raise WrongValueError(f'"{given}" is no absolute pressure', remedy='Write "... abs".')
        return pressure.value_pa


@dataclass(frozen=True)
class Difference(Quantity):
    """Annotation of a field that takes a difference of temperatures, in K."""

    def read(self, given: object) -> float:
        """Convert and check."""
        if not str(given).endswith(" K"):
            raise WrongValueError(f'"{given}" is no difference of temperatures', rule='in K, e.g. "0.5 K"')
        return super().read(given)


def _mark(unit: str, bounds: Bounds) -> Mark:
    """Give the annotation of a unit: "1" is a pure number, "abs" an absolute pressure, "delta K" a difference."""
    if unit == "abs":
        return AbsolutePressure("Pa", "bar", bounds)
    return Difference("K", "K", bounds) if unit == "delta K" else Quantity("" if unit == "1" else unit, bounds=bounds)


def of(path: str, meaning: str = "", default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key that is a parameter of a component, ``kind.key``, with its unit, bounds and default."""
    kind, _, name = path.rpartition(".")
    parameter = next(p for p in component_kinds()[kind]["parameters"] if p["key"] == name)
    if default is ... and parameter["default"] is not None:
        default = parameter["default"]
    said = parameter["meaning"]
    return Key(parameter_quantity(parameter), meaning or said[0].lower() + said[1:], default)


def positive(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key whose value is above zero."""
    return Key(_mark(unit, Bounds(above=0.0)), meaning, default)


def not_negative(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key whose value is zero or above."""
    return Key(_mark(unit, Bounds(at_least=0.0)), meaning, default)


def any_sign(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key whose value is of either sign."""
    return Key(_mark(unit, Bounds()), meaning, default)


def word(*choices: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key that is one of some words."""
    return Key(Choice(choices), meaning, default)


#: table -> what it is about
TABLES: dict[str, str] = {
    "cylinder": "The drive under test.",
    "ambient": "The room at the beginning.",
    "servo": "The axis: position controlled and infinitely strong. Its commanded motion has piecewise constant jerk.",
    "chambers": "Where the air in the chambers comes from and goes to.",
    "sampling": "Of `SimulatedRig.drag` (`clock`, `samples_per_cycle`), and what is usual in a campaign (the others).",
    "force_sensor": "Spring and damper between axis and piston, and what it shows.",
    "pressure_sensor": "One in each chamber, or at each regulator.",
    "temperature_sensor": "On the barrel.",
    "encoder": "On the carriage.",
    "thermal": "Temperatures of room and seal: Fc and Fs times 1 + coulomb * rise, Fv times exp(viscous * rise).",
    "run_in": "Friction that a new seal loses with its way.",
    "repeatability": "Relative standard deviation of the level of all friction; the deviates are lognormal.",
    "supply": "The air before the regulators.",
    "safety": "What may be asked of the rig, where it is less than what axis and sensors can do.",
}

KEYS: dict[str, dict[str, Key]] = {
    "cylinder": {
        "kind": word(*KINDS, default="rodless", meaning="where it has a rod; that of a single rod is in chamber b"),
        "bore": of("cylinder/rodless.bore"),
        "rod_diameter": of("cylinder/single-rod.rod_diameter"),
        "stroke": of("piston.stroke"),
        "moving_mass": of("piston.moving_mass", "mass beyond the force sensor, piston included"),
        "incline": of("piston.incline"),
    },
    "ambient": {
        "pressure": positive("abs", "pressure of the room"),
        "temperature": positive("K", "temperature of room, air and walls", ANR_TEMPERATURE_K),
    },
    "servo": {
        "acceleration": positive("m/s^2", "largest acceleration"),
        "jerk": positive("m/s^3", "largest jerk"),
        "margin": not_negative("m", "distance of the reversals from the ends of the stroke"),
        "speed": positive("m/s", "largest speed; absent: what the stroke allows", None),
        "bandwidth": of(
            "carriage.servo_bandwidth", "natural frequency of the position loop; absent: a rigid axis", None
        ),
        "damping_ratio": of(
            "carriage.servo_damping_ratio", "damping ratio of the position loop, with `bandwidth`", None
        ),
        "ripple": of("carriage.ripple_velocity", default=0.0),
        "pitch": of("carriage.ripple_pitch", default=None),
        "release_time": of("carriage.release_time", "time constant with which the axis gives way in a released hold"),
    },
    "chambers": {
        "kind": word(
            "held",
            "open",
            "common",
            "separate",
            default="held",
            meaning="pressures that take no notice of the piston; ports to the room; one regulator and a manifold; "
            "a regulator and a hose for each",
        ),
        "dead_volume": of("tank.volume", "volume of each chamber at the end of the stroke", None),
        "heat_transfer": of("tank.heat_transfer", "heat transfer coefficient to all walls", None),
        "line_conductance": of("fitting.conductance", "sonic conductance of the line, or port, of each chamber", None),
        "regulator_conductance": of("fitting.conductance", "sonic conductance of a regulator; both ways", None),
        "critical_pressure_ratio": of("fitting.critical_pressure_ratio", "of lines, ports and regulators", None),
        "manifold_volume": of("tank.volume", "volume between a regulator and the lines", None),
        "hose_diameter": positive("m", "gives the wall of that volume, as of a hose", None),
        "leakage": of("cylinder/rodless.leakage", "leakage of each chamber to the room"),
        "piston_leakage": of("cylinder/rodless.leakage"),
    },
    "sampling": {
        "clock": word(*CLOCKS, meaning="even in time, or in position"),
        "samples_per_cycle": positive("1", "samples out and back"),
        "samples_per_stroke": positive("1", "samples of each move", 5000.0),
        "burst_rate": not_negative("1/s", "least rate around each reversal, stop and restart", 5000.0),
        "burst_before": not_negative("s", "how long before", 0.05),
        "burst_after": not_negative("s", "how long after", 0.2),
        "hold_rate": positive("1/s", "rate while the axis stands", 20.0),
    },
    "force_sensor": {
        "stiffness": of("force-sensor.stiffness"),
        "damping": of("force-sensor.damping"),
        "range": positive("N", "range, both ways"),
        "bits": positive("1", "resolution of the converter"),
        "noise": not_negative("N", "standard deviation of one sample"),
        "zero": any_sign("N", "what it shows without force"),
        "accuracy": not_negative("N", "standard uncertainty that recordings state, and errors are drawn from"),
        "zero_drift_temperature": any_sign("N/K", "drift of the zero with the temperature of the room", 0.0),
        "zero_drift_time": any_sign("N/s", "drift of the zero with time", 0.0),
    },
    "pressure_sensor": {
        "at": word("chamber", "regulator", default="chamber", meaning="where it is"),
        "range": positive("Pa", "range above ambient"),
        "bits": positive("1", "resolution of the converter"),
        "noise": not_negative("Pa", "standard deviation of one sample"),
        "zero": any_sign("Pa", "what it shows at ambient pressure"),
        "accuracy": not_negative("Pa", "standard uncertainty that recordings state, and errors are drawn from"),
    },
    "temperature_sensor": {
        "noise": not_negative("delta K", "standard deviation of one sample", 0.02),
        "accuracy": not_negative(
            "delta K", "standard uncertainty that recordings state, and errors are drawn from", 0.1
        ),
        "share": not_negative("1", "share of the seal's rise of temperature that reaches it", 0.5),
    },
    "encoder": {"resolution": positive("m", "distance of two counts")},
    "thermal": {
        "room_amplitude": not_negative("delta K", "amplitude of the room's temperature", 0.0),
        "room_period": positive("s", "period of the room's temperature", 86400.0),
        "seal_rise": not_negative("K/W", "rise of the seal's temperature with the power of friction", 0.0),
        "seal_time": positive("s", "time constant of that rise", 600.0),
        "viscous": any_sign("1/K", "change of viscous friction with the seal's temperature", 0.0),
        "coulomb": any_sign("1/K", "change of dry friction with the seal's temperature", 0.0),
    },
    "run_in": {
        "excess": not_negative("1", "how much more friction a seal has before its first stroke", 0.0),
        "distance": positive("m", "way after which 37 % of that is left", 100.0),
    },
    "repeatability": {
        "cycle": not_negative("1", "from cycle to cycle", 0.0),
        "day": not_negative("1", "from day to day", 0.0),
        "mounting": not_negative("1", "each time that it is mounted", 0.0),
        "seal": not_negative("1", "from seal to seal", 0.0),
    },
    "supply": {"pressure": positive("abs", "pressure before the regulators", None)},
    "safety": {
        "force": positive("N", "largest force that the sensor may see", None),
        "pressure": positive("abs", "highest pressure in a chamber", None),
        "least_supply": positive("abs", "supply pressure below which measuring waits", None),
        "least_temperature": positive("K", "temperature below which measuring waits", None),
        "greatest_temperature": positive("K", "temperature above which measuring waits", None),
    },
}

#: Keys of a table [mounting.NAME]: a way of mounting beside `RIGID`.
MOUNTING: dict[str, Key] = {
    "side_load": not_negative("N", "force across the axis that the guide takes", 0.0),
    "coefficient": not_negative("1", "coefficient of friction of the guide", 0.0),
}
#: The mounting that every rig has, without side load.
RIGID = "rigid"

_SUPPLIED = tuple(key for key in KEYS["chambers"] if key not in ("kind", "leakage", "piston_leakage"))
#: What chambers need beside their kind.
NEEDED: dict[str, tuple[str, ...]] = {
    "held": (),
    "open": ("dead_volume", "heat_transfer", "line_conductance", "critical_pressure_ratio"),
    "common": _SUPPLIED,
    "separate": _SUPPLIED,
}
