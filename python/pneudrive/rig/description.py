"""Description of a simulated rig: a TOML file in which each value states its source."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pneudrive.describe.files import toml
from pneudrive.describe.keys import wrong
from pneudrive.describe.tables.friction import Friction
from pneudrive.describe.tables.geometry import piston_areas
from pneudrive.errors import Problems
from pneudrive.rig.interface import Sampling
from pneudrive.rig.keys import KEYS, NEEDED, RIGID
from pneudrive.rig.motion import MotionLimits
from pneudrive.rig.reader import Source, read_tables
from pneudrive.rig.sensors import CLOCKS, AnalogSensor, Encoder, EncoderClock, TimeClock

DEFAULT = Path(__file__).with_name("default.toml")

#: Share of its range by which a gauge transducer reads below zero before it saturates (assumed).
BELOW_ZERO = 0.02
#: Range and resolution of the thermometer (assumed): a 4-wire Pt100 with a 16-bit converter.
THERMOMETER_K, THERMOMETER_BITS = (253.15, 353.15), 16


@dataclass(frozen=True)
class RigMounting:
    """Mounting of the drive: force across the axis, and coefficient of friction of the guide that carries it."""

    side_load_n: float = 0.0
    coefficient: float = 0.0


@dataclass(frozen=True)
class RigDescription:
    """Description of a simulated rig in SI.

    Attributes
    ----------
    name : str
    law, parameters, pressure : str, dict, dict or None
        Friction of the piston as in a drive file; `pressure` in N/Pa per chamber.
    dependences : dict
        Other friction modifiers (dwell, relaxation, position, direction), in the core's form.
    mountings : dict of RigMounting
    cylinder, rod_diameter_m, bore_m, stroke_m, moving_mass_kg, incline_rad, ambient_pressure_pa, ambient_temperature_k
    limits, margin_m
        Servo axis, and the distance of its reversals from the ends of the stroke.
    clock
        Sample clock of `SimulatedRig.drag`.
    sampling : Sampling
        Usual sampling of a session.
    stiffness_n_m, damping_n_s_m : float
        Stiffness and damping of the force sensor.
    force_sensor, pressure_sensor, thermometer, encoder
    force_accuracy_n, pressure_accuracy_pa, temperature_accuracy_k : float
        Standard uncertainties stated in recordings.
    barrel_share : float
        Share of the seal's rise of temperature that reaches the thermometer on the barrel.
    servo, chambers, drift, thermal, run_in, repeatability, supply, safety : dict
        The tables of the file in SI, None if a key is absent.
    sources : dict
        ``table.key`` -> `Source`.
    """

    name: str
    law: str
    parameters: dict[str, float]
    pressure: dict[str, float] | None
    dependences: dict[str, Any]
    mountings: dict[str, RigMounting]
    cylinder: str
    bore_m: float
    rod_diameter_m: float
    stroke_m: float
    moving_mass_kg: float
    incline_rad: float
    ambient_pressure_pa: float
    ambient_temperature_k: float
    limits: MotionLimits
    margin_m: float
    clock: TimeClock | EncoderClock
    sampling: Sampling
    stiffness_n_m: float
    damping_n_s_m: float
    force_sensor: AnalogSensor
    pressure_sensor: AnalogSensor
    thermometer: AnalogSensor
    encoder: Encoder
    force_accuracy_n: float
    pressure_accuracy_pa: float
    temperature_accuracy_k: float
    barrel_share: float
    servo: dict[str, Any]
    chambers: dict[str, Any]
    pressure_measured_at: str
    drift: dict[str, float]
    thermal: dict[str, float]
    run_in: dict[str, float]
    repeatability: dict[str, float]
    supply_pressure_pa: float | None
    safety: dict[str, float | None]
    sources: dict[str, Source] = field(repr=False)

    @property
    def areas_m2(self) -> tuple[float, float]:
        """Piston areas in chambers a and b."""
        return piston_areas(self.cylinder, self.bore_m, self.rod_diameter_m)

    @property
    def area_m2(self) -> float:
        """Piston area in chamber a."""
        return self.areas_m2[0]


def read_description(path: str | Path = DEFAULT) -> RigDescription:
    """Read a rig file.

    Raises
    ------
    DescriptionError
        If the file cannot be read, a key is unknown or missing, a value lacks its unit or its source.
    """
    name, tables, friction, sources = read_tables(Path(path))
    with toml.locating(path, toml.read(path)[1]):
        _check(tables)
    values = {table: dict(vars(getattr(tables, table))) for table in KEYS}
    return _build(name, values, friction, tables.mounting, sources)


def _check(tables: Any) -> None:  # noqa: ANN401 - of a class that is made of the keys
    """Check the values against each other, and raise all errors at once."""
    cylinder, servo, chambers, problems = tables.cylinder, tables.servo, tables.chambers, Problems()

    def refuse(key: str, what: str, rule: str) -> None:
        problems.add(wrong(key, what, rule=rule))

    if 2.0 * servo.margin >= cylinder.stroke:
        refuse("servo.margin", "servo.margin leaves no stroke to move", "0 <= margin < stroke / 2")
    if cylinder.rod_diameter >= cylinder.bore:
        refuse("cylinder.rod_diameter", "cylinder.rod_diameter is not smaller than the bore", "rod_diameter < bore")
    if (servo.bandwidth is None) != (servo.damping_ratio is None):
        rule = "give both, or neither for a rigid axis"
        refuse("servo.bandwidth", "servo.bandwidth and servo.damping_ratio are needed together", rule)
    if servo.ripple > 0.0 and servo.pitch is None:
        refuse("servo.ripple", "servo.ripple needs servo.pitch", "servo.pitch is the period of the ripple")
    for key in NEEDED[chambers.kind]:
        if getattr(chambers, key) is None:
            refuse("chambers", f"chambers.{key} is missing", f'chambers of kind "{chambers.kind}" need this value')
    problems.tell()


def _build(
    name: str,
    values: dict[str, dict[str, Any]],
    friction: Friction,
    mountings: dict[str, Any],
    sources: dict[str, Source],
) -> RigDescription:
    cylinder, servo, force, air = (values[t] for t in ("cylinder", "servo", "force_sensor", "pressure_sensor"))
    ambient, sampling, warm = values["ambient"], values["sampling"], values["temperature_sensor"]
    core = friction.core()
    low, high = ambient["pressure"] - BELOW_ZERO * air["range"], ambient["pressure"] + air["range"]
    return RigDescription(
        name=name,
        law=core.pop("law"),
        parameters=core.pop("parameters"),
        pressure=core.pop("pressure"),
        dependences=core,
        mountings={RIGID: RigMounting()} | {key: RigMounting(*vars(one).values()) for key, one in mountings.items()},
        cylinder=cylinder["kind"],
        bore_m=cylinder["bore"],
        rod_diameter_m=cylinder["rod_diameter"],
        stroke_m=cylinder["stroke"],
        moving_mass_kg=cylinder["moving_mass"],
        incline_rad=cylinder["incline"],
        ambient_pressure_pa=ambient["pressure"],
        ambient_temperature_k=ambient["temperature"],
        limits=MotionLimits(servo["acceleration"], servo["jerk"]),
        margin_m=servo["margin"],
        clock=CLOCKS[sampling["clock"]](int(sampling["samples_per_cycle"])),
        sampling=Sampling(
            int(sampling["samples_per_stroke"]),
            sampling["burst_rate"],
            sampling["burst_before"],
            sampling["burst_after"],
            sampling["hold_rate"],
        ),
        stiffness_n_m=force["stiffness"],
        damping_n_s_m=force["damping"],
        force_sensor=AnalogSensor(-force["range"], force["range"], int(force["bits"]), force["noise"], force["zero"]),
        pressure_sensor=AnalogSensor(low, high, int(air["bits"]), air["noise"], air["zero"]),
        thermometer=AnalogSensor(*THERMOMETER_K, THERMOMETER_BITS, warm["noise"]),
        encoder=Encoder(values["encoder"]["resolution"]),
        force_accuracy_n=force["accuracy"],
        pressure_accuracy_pa=air["accuracy"],
        temperature_accuracy_k=warm["accuracy"],
        barrel_share=warm["share"],
        servo=servo,
        chambers=values["chambers"],
        pressure_measured_at=air["at"],
        drift={"per_k": force["zero_drift_temperature"], "per_s": force["zero_drift_time"]},
        thermal=values["thermal"],
        run_in=values["run_in"],
        repeatability=values["repeatability"],
        supply_pressure_pa=values["supply"]["pressure"],
        safety=values["safety"],
        sources=sources,
    )
