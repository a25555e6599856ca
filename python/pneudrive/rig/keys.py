"""Keys of a rig file: unit, meaning, bounds, default. Parameters of components come from the core.

The parameters of friction are those of the law in the core; its modifiers are as in a drive file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from pneudrive.constants import ANR_TEMPERATURE_K
from pneudrive.describe.keys import WrongValueError
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.marks import Bounds, Choice, Mark, Quantity, StatedPressure
from pneudrive.describe.parameters import parameter_quantity
from pneudrive.describe.tables.geometry import KINDS
from pneudrive.rig.sensors import CLOCKS


class Key(NamedTuple):
    """Key of a rig file: annotation, meaning, default; ``...`` for a required key."""

    mark: Mark
    meaning: str
    default: Any = ...


@dataclass(frozen=True)
class AbsolutePressure(Quantity):
    """Annotation of a field for an absolute pressure, stored in Pa."""

    def read(self, given: object) -> float:
        """Convert and check."""
        pressure = StatedPressure().read(given)
        if pressure.gauge:
            raise WrongValueError(f'"{given}" is not an absolute pressure', remedy='Write "... abs".')
        return pressure.value_pa


@dataclass(frozen=True)
class Difference(Quantity):
    """Annotation of a field for a difference of temperatures, in K."""

    def read(self, given: object) -> float:
        """Convert and check."""
        if not str(given).endswith(" K"):
            raise WrongValueError(f'"{given}" is not a difference of temperatures', rule='in K, e.g. "0.5 K"')
        return super().read(given)


def _mark(unit: str, bounds: Bounds) -> Mark:
    """Return the annotation of a unit: "1" is a pure number, "abs" an absolute pressure, "delta K" a difference."""
    if unit == "abs":
        return AbsolutePressure("Pa", "bar", bounds)
    return Difference("K", "K", bounds) if unit == "delta K" else Quantity("" if unit == "1" else unit, bounds=bounds)


def of(path: str, meaning: str = "", default: Any = ...) -> Key:  # noqa: ANN401
    """Return a key for a parameter of a component, ``kind.key``, with its unit, bounds and default."""
    kind, _, name = path.rpartition(".")
    parameter = next(p for p in component_kinds()[kind]["parameters"] if p["key"] == name)
    if default is ... and parameter["default"] is not None:
        default = parameter["default"]
    said = parameter["meaning"]
    return Key(parameter_quantity(parameter), meaning or said[0].lower() + said[1:], default)


def positive(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Return a key with a positive value."""
    return Key(_mark(unit, Bounds(above=0.0)), meaning, default)


def not_negative(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Return a key with a value of zero or above."""
    return Key(_mark(unit, Bounds(at_least=0.0)), meaning, default)


def any_sign(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Return a key with a value of either sign."""
    return Key(_mark(unit, Bounds()), meaning, default)


def word(*choices: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Return a key for one of some words."""
    return Key(Choice(choices), meaning, default)


#: table -> its title
TABLES: dict[str, str] = {
    "cylinder": "Drive under test.",
    "ambient": "Room at the beginning.",
    "servo": "Axis with ideal position control. Its commanded motion has piecewise constant jerk.",
    "chambers": "Air supply of the chambers.",
    "sampling": "Sampling of `SimulatedRig.drag` (`clock`, `samples_per_cycle`) and of campaigns by default (others).",
    "force_sensor": "Force sensor: spring and damper between axis and piston, and errors of its readings.",
    "pressure_sensor": "Pressure sensors, in each chamber or at each regulator.",
    "temperature_sensor": "Thermometer on the barrel.",
    "encoder": "Position encoder on the carriage.",
    "thermal": "Temperatures of room and seal: Fc and Fs times 1 + coulomb * rise, Fv times exp(viscous * rise).",
    "run_in": "Friction that a new seal loses with the distance slid.",
    "repeatability": "Relative standard deviations of the friction scale; the scale is lognormal.",
    "supply": "Supply of the regulators.",
    "safety": "Limits of the rig that are tighter than those of axis and sensors.",
}

KEYS: dict[str, dict[str, Key]] = {
    "cylinder": {
        "kind": word(*KINDS, default="rodless", meaning="diameter of the rod, if any; a single rod is in chamber b"),
        "bore": of("cylinder/rodless.bore"),
        "rod_diameter": of("cylinder/single-rod.rod_diameter"),
        "stroke": of("piston.stroke"),
        "moving_mass": of("piston.moving_mass", "mass beyond the force sensor, including the piston"),
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
        "speed": positive("m/s", "largest speed; absent: limited by the stroke", None),
        "bandwidth": of(
            "carriage.servo_bandwidth", "natural frequency of the position loop; absent: a rigid axis", None
        ),
        "damping_ratio": of(
            "carriage.servo_damping_ratio", "damping ratio of the position loop, with `bandwidth`", None
        ),
        "ripple": of("carriage.ripple_velocity", default=0.0),
        "pitch": of("carriage.ripple_pitch", default=None),
        "release_time": of("carriage.release_time", "time constant of the motion of the axis in a released hold"),
    },
    "chambers": {
        "kind": word(
            "held",
            "open",
            "common",
            "separate",
            default="held",
            meaning="pressures independent of the piston; ports to the room; one regulator and a manifold; "
            "a regulator and a hose for each",
        ),
        "dead_volume": of("tank.volume", "volume of each chamber at the end of the stroke", None),
        "heat_transfer": of("tank.heat_transfer", "heat transfer coefficient to all walls", None),
        "line_conductance": of("fitting.conductance", "sonic conductance of the line, or port, of each chamber", None),
        "regulator_conductance": of(
            "fitting.conductance", "sonic conductance of a regulator, in both directions", None
        ),
        "critical_pressure_ratio": of(
            "fitting.critical_pressure_ratio", "critical pressure ratio of lines, ports and regulators", None
        ),
        "manifold_volume": of("tank.volume", "volume between a regulator and the lines", None),
        "hose_diameter": positive("m", "diameter of the hose of that volume, for the area of its wall", None),
        "leakage": of("cylinder/rodless.leakage", "leakage of each chamber to the room"),
        "piston_leakage": of("cylinder/rodless.leakage"),
    },
    "sampling": {
        "clock": word(*CLOCKS, meaning="uniform in time, or in position"),
        "samples_per_cycle": positive("1", "samples of a cycle, out and back"),
        "samples_per_stroke": positive("1", "samples of each move", 5000.0),
        "burst_rate": not_negative("1/s", "lowest sampling rate around each reversal, stop and restart", 5000.0),
        "burst_before": not_negative("s", "duration of the fast sampling before a reversal, stop or restart", 0.05),
        "burst_after": not_negative("s", "duration of the fast sampling after a reversal, stop or restart", 0.2),
        "hold_rate": positive("1/s", "rate while the axis is at rest", 20.0),
    },
    "force_sensor": {
        "stiffness": of("force-sensor.stiffness"),
        "damping": of("force-sensor.damping"),
        "range": positive("N", "range in both directions"),
        "bits": positive("1", "resolution of the converter"),
        "noise": not_negative("N", "standard deviation of one sample"),
        "zero": any_sign("N", "reading without force"),
        "accuracy": not_negative("N", "standard uncertainty, stated in recordings; errors are drawn from it"),
        "zero_drift_temperature": any_sign("N/K", "drift of the zero with the temperature of the room", 0.0),
        "zero_drift_time": any_sign("N/s", "drift of the zero with time", 0.0),
    },
    "pressure_sensor": {
        "at": word("chamber", "regulator", default="chamber", meaning="location of the sensor"),
        "range": positive("Pa", "range above ambient"),
        "bits": positive("1", "resolution of the converter"),
        "noise": not_negative("Pa", "standard deviation of one sample"),
        "zero": any_sign("Pa", "reading at ambient pressure"),
        "accuracy": not_negative("Pa", "standard uncertainty, stated in recordings; errors are drawn from it"),
    },
    "temperature_sensor": {
        "noise": not_negative("delta K", "standard deviation of one sample", 0.02),
        "accuracy": not_negative(
            "delta K", "standard uncertainty, stated in recordings; errors are drawn from it", 0.1
        ),
        "share": not_negative("1", "fraction of the seal's temperature rise at the thermometer", 0.5),
    },
    "encoder": {"resolution": positive("m", "distance of two counts")},
    "thermal": {
        "room_amplitude": not_negative("delta K", "amplitude of the room's temperature", 0.0),
        "room_period": positive("s", "period of the room's temperature", 86400.0),
        "seal_rise": not_negative("K/W", "rise of the seal's temperature per power of friction", 0.0),
        "seal_time": positive("s", "time constant of this temperature rise", 600.0),
        "viscous": any_sign("1/K", "change of viscous friction with the seal's temperature", 0.0),
        "coulomb": any_sign("1/K", "change of dry friction with the seal's temperature", 0.0),
    },
    "run_in": {
        "excess": not_negative("1", "relative excess of friction of a new seal", 0.0),
        "distance": positive("m", "distance after which the additional friction has fallen to 37 %", 100.0),
    },
    "repeatability": {
        "cycle": not_negative("1", "between cycles", 0.0),
        "day": not_negative("1", "between days", 0.0),
        "mounting": not_negative("1", "between mountings of the drive", 0.0),
        "seal": not_negative("1", "between seals", 0.0),
    },
    "supply": {"pressure": positive("abs", "pressure before the regulators", None)},
    "safety": {
        "force": positive("N", "largest force on the sensor", None),
        "pressure": positive("abs", "highest pressure in a chamber", None),
        "least_supply": positive("abs", "supply pressure below which measuring pauses", None),
        "least_temperature": positive("K", "temperature below which measuring pauses", None),
        "greatest_temperature": positive("K", "temperature above which measuring pauses", None),
    },
}

#: Keys of a table [mounting.NAME]: a mounting other than `RIGID`.
MOUNTING: dict[str, Key] = {
    "side_load": not_negative("N", "force across the axis on the guide", 0.0),
    "coefficient": not_negative("1", "coefficient of friction of the guide", 0.0),
}
#: Mounting of every rig, without side load.
RIGID = "rigid"

_SUPPLIED = tuple(key for key in KEYS["chambers"] if key not in ("kind", "leakage", "piston_leakage"))
#: Required keys of each kind of chambers.
NEEDED: dict[str, tuple[str, ...]] = {
    "held": (),
    "open": ("dead_volume", "heat_transfer", "line_conductance", "critical_pressure_ratio"),
    "common": _SUPPLIED,
    "separate": _SUPPLIED,
}
