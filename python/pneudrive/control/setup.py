"""Instrumentation between a drive and its controller: sensors, converter, computing time, disturbances."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Field, model_validator

from pneudrive import _core, units
from pneudrive.arrays import Interval, NamedNumbers, Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.errors import DescriptionError, invalid, nearest, package_table, wrong
from pneudrive.rig.description import BELOW_ZERO, BOUNDS, KEYS

_Kind = TypeVar("_Kind", bound=Described)
SETUPS = Path(__file__).with_name("setups")
LEAST_BITS, MOST_BITS = 4, 32  # like those of a rig's converters


def _mark(table: str, key: str) -> marks.Quantity:
    """Return the annotation of a key of a rig file."""
    return KEYS[table][key][0].__metadata__[0]


def _bits(given: object) -> int:
    """Read the resolution of a converter."""
    bits = marks.Whole(bound=None).read(given)
    if not LEAST_BITS <= bits <= MOST_BITS:
        raise DescriptionError(f"{bits} is out of bounds", rule=f"a converter has {LEAST_BITS} to {MOST_BITS} bits")
    return bits


Bits = Annotated[int | None, marks.Reads(_bits)]
NOT_NEGATIVE = BOUNDS["not_negative"]
Seconds = Annotated[float, marks.Quantity("s", bounds=NOT_NEGATIVE)]


class PositionSensor(Described):
    """Encoder: position with noise, rounded to whole counts."""

    table_name = "sensors.position"
    resolution_m: Annotated[float | None, _mark("encoder", "resolution")] = Field(
        default=None, description="distance between two counts; absent: no rounding"
    )
    noise_m: Annotated[float, marks.Quantity("m", bounds=NOT_NEGATIVE)] = Field(
        default=0.0, description="standard deviation"
    )
    jitter_s: Seconds = Field(default=0.0, description="standard deviation of the time of a sample")

    def core(self) -> NamedNumbers:
        """Return the position sensor in the core's form, in SI."""
        return {"resolution_m": self.resolution_m or 0.0, "noise_m": self.noise_m}


class PressureSensor(Described):
    """Pressure sensor of a chamber, with an amplifier and a converter."""

    range_pa: Annotated[float, _mark("pressure_sensor", "range")] = Field(description="above ambient")
    bits: Bits = Field(default=None, description="resolution of the converter; absent: none")
    noise_pa: Annotated[float, _mark("pressure_sensor", "noise")] = Field(default=0.0, description="standard deviation")
    zero_pa: Annotated[float, _mark("pressure_sensor", "zero")] = Field(default=0.0, description="error of the zero")
    gain_error: Annotated[float, marks.Quantity("")] = Field(default=0.0, description="relative")
    lag_s: Seconds = Field(default=0.0, description="time constant of the amplifier")
    jitter_s: Seconds = Field(default=0.0, description="standard deviation of the time of a sample")

    def core(self, ambient_pa: float) -> Plain:
        """Return the pressure sensor in the core's form, in SI, with absolute pressures."""
        ends = [ambient_pa - BELOW_ZERO * self.range_pa, ambient_pa + self.range_pa]
        own = {name: getattr(self, name) for name in ("noise_pa", "zero_pa", "gain_error", "lag_s")}
        return own | {"range_pa": ends, "bits": self.bits or 0}


class ControlSensors(Described):
    """Sensors of the controller. Without pressure sensors, the controller simulates the pressures with its model."""

    table_name = "sensors"
    position: PositionSensor = PositionSensor()
    pressure_a: PressureSensor | None = None
    pressure_b: PressureSensor | None = None

    @model_validator(mode="after")
    def _both_pressures(self) -> ControlSensors:
        if (self.pressure_a is None) != (self.pressure_b is None):
            one, other = "ba" if self.pressure_a is None else "ab"
            raise invalid(f"pressure_{one}", "control.one_pressure", one=one, other=other)
        return self


class CommandConverter(Described):
    """Converter that rounds the command to its resolution."""

    table_name = "converter"
    bits: Bits = Field(default=None, description="resolution over -1 .. 1; absent: none")


class ControlComputer(Described):
    """Computer that runs the law."""

    table_name = "computer"
    time_s: Seconds = Field(default=0.0, description="from a sample to its command; shorter than the period")
    jitter_s: Seconds = Field(default=0.0, description="standard deviation of a random delay added to this time")


class LimitSwitches(Described):
    """Limit switches. Beyond a switch, only commands that move the piston back are allowed."""

    table_name = "switches"
    low_m: marks.Position
    high_m: marks.Position

    @model_validator(mode="after")
    def _ordered(self) -> LimitSwitches:
        if not self.low_m < self.high_m:
            raise invalid("switches.high", "control.switches", low_mm=1e3 * self.low_m, high_mm=1e3 * self.high_m)
        return self


#: Kind of fault -> effect, and unit of its value, or a dash if it has no value.
FAULTS: dict[str, tuple[str, str]] = package_table(__file__, "faults.toml")
CHANNEL_UNITS = {"position": "m", "pressure_a": "Pa", "pressure_b": "Pa"}
MAY_LACK_A_VALUE = ("reference",)
ABSOLUTE = ("supply-fallen", "saturated")  # kinds with an absolute pressure


class ControlFault(Described):
    """A fault that starts at a given time, and ends at another time or never."""

    kind: Annotated[str, marks.Choice(tuple(FAULTS))]
    channel: Annotated[str | None, marks.Choice(tuple(CHANNEL_UNITS))] = None
    at_s: Seconds
    until_s: Annotated[float | None, marks.Quantity("s", bounds=NOT_NEGATIVE)] = None
    value: Annotated[str | None, marks.Reads(str)] = Field(
        default=None, description="quantity with its unit; see the kinds"
    )

    @model_validator(mode="after")
    def _fits(self) -> ControlFault:
        unit = FAULTS[self.kind][1]
        acts_on_channel = unit == "channel" or self.kind in ("stuck", "nan")
        if acts_on_channel != (self.channel is not None):
            what = f"a fault of kind {self.kind} {'needs a' if acts_on_channel else 'does not accept a'} channel"
            raise wrong("channel", what, remedy=f"Give one of {', '.join(CHANNEL_UNITS)}." if acts_on_channel else "")
        if unit == "-" and self.value is not None:
            raise wrong("value", f"a fault of kind {self.kind} does not accept a value")
        if unit != "-" and self.value is None and self.kind not in MAY_LACK_A_VALUE:
            raise wrong("value", f"a fault of kind {self.kind} needs a value")
        if self.until_s is not None and not self.until_s > self.at_s:
            raise wrong("until", f"until = {self.until_s:g} s", rule=f"`until` must be after `at`, {self.at_s:g} s")
        self.core()
        return self

    def core(self) -> Plain:
        """Return the fault in the core's form, in SI. A pressure is absolute or a difference, never gauge."""
        unit = FAULTS[self.kind][1]
        si_unit = CHANNEL_UNITS[self.channel] if self.channel is not None and unit == "channel" else unit
        given, is_absolute = self.value, self.kind in ABSOLUTE
        if given is not None and si_unit == "Pa":  # a pressure without "abs"
            given, mark = units.split_mark(text := given.strip())
            if mark == " gauge" or (mark and not is_absolute):
                what = f'"{text}" is {"gauge" if mark == " gauge" else "an absolute pressure"}'
                rule, example = ("an absolute pressure", "3 bar abs") if is_absolute else ("a difference", "0.2 bar")
                raise wrong("value", f"value: {what}", rule=f'a fault of kind {self.kind} has {rule}, e.g. "{example}"')
        value = None if given is None else units.parse(given, si_unit)
        return {
            "kind": self.kind,
            "channel": self.channel,
            "begin_s": self.at_s,
            "end_s": self.until_s,
            "value": value,
        }


class Disturbance(Described):
    """An external force that starts at a given time."""

    at_s: Seconds
    force_n: marks.Force


class Setup(Described):
    """Instrumentation of a run under control. The package contains ``ideal``, ``real`` and ``cheap``.

    The values in these three files are assumed. A file has these tables and keys, all optional.

    - ``about`` is free text.
    - ``[sensors.position]`` has resolution, noise and jitter.
    - ``[sensors.pressure_a]`` and ``[sensors.pressure_b]`` have range (needed), bits, noise, zero, gain_error, lag and
      jitter.
    - ``[converter]`` has bits, ``[computer]`` time and jitter, ``[switches]`` low and high.
    - Each ``[[disturbances]]`` has at and force.
    - Each ``[[faults]]`` has kind, channel, at, until and value.

    Examples
    --------
    >>> setup = Setup(converter={"bits": 12}, computer={"time": "0.3 ms"})
    >>> setup.computer.time_s
    0.0003
    """

    schema_version: Literal[1] = Field(default=1, alias="schema")
    about: str = Field(default="", description="free text")
    sensors: ControlSensors = ControlSensors()
    converter: CommandConverter = CommandConverter()
    computer: ControlComputer = ControlComputer()
    switches: LimitSwitches | None = None
    disturbances: tuple[Disturbance, ...] = ()
    faults: tuple[ControlFault, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> Setup:
        times = [one.at_s for one in self.disturbances]
        for number, (before, after) in enumerate(pairwise(times), start=1):
            if not after > before:
                raise invalid(f"disturbances.{number}.at", "control.disturbances", before=before, after=after)
        for number, fault in enumerate(self.faults):
            if fault.channel is not None and getattr(self.sensors, fault.channel) is None:
                raise invalid(f"faults.{number}.channel", "control.fault", channel=fault.channel)
        return self

    def short_of(self, supply_pa: float, ambient_pa: float) -> list[str]:
        """Return a warning if the range of the pressure sensors ends below the supply pressure; else an empty list."""
        ranges = [one.range_pa for one in (self.sensors.pressure_a, self.sensors.pressure_b) if one is not None]
        top = ambient_pa + min(ranges, default=math.inf)
        ends = f"The range of the pressure sensors ends at {1e-5 * top:.4g} bar abs, below the supply pressure"
        said = f"{ends} of {1e-5 * supply_pa:.4g} bar abs: at higher pressures the sensors count as faulty"
        return [said] if top < supply_pa else []

    def core(self, seed: int, ambient_pa: float) -> Plain:
        """Return the instrumentation in the core's form, in SI, with the seed of all noise and the ambient pressure."""
        pressures = self.sensors.pressure_a, self.sensors.pressure_b  # both or none
        jitter = [getattr(one, "jitter_s", 0.0) for one in (self.sensors.position, *pressures, self.computer)]
        wrongs: Plain = {"jitter_s": jitter} if any(jitter) else {}
        if self.faults:
            wrongs["faults"] = [one.core() for one in self.faults]
        if self.switches is not None:
            wrongs["switches_m"] = [self.switches.low_m, self.switches.high_m]
        return wrongs | {
            "position": self.sensors.position.core(),
            "pressures": [one.core(ambient_pa) for one in pressures if one is not None] or None,
            "command_bits": self.converter.bits or 0,
            "computing_time_s": self.computer.time_s,
            "forces": [[one.at_s, one.force_n] for one in self.disturbances],
            "seed": seed,
        }


#: A setup, the name of a setup in the package, or a TOML file.
SetupOrFile: TypeAlias = Setup | str | Path


@cache
def ready_setups() -> dict[str, Path]:
    """Return the files of the package's setups by name."""
    return {path.stem: path for path in sorted(SETUPS.glob("*.toml"))}


def read_setup(given: SetupOrFile) -> tuple[Setup, str]:
    """Read a setup of the package by its name, or a TOML file.

    Parameters
    ----------
    given : Setup, str or path-like
        A setup is returned unchanged.

    Returns
    -------
    Setup, str
        The setup and its name: the name in the package or of the file, or ``"own"`` for a given object.

    Raises
    ------
    DescriptionError
        The file is not valid; the message gives file, line, value, rule and remedy.

    Examples
    --------
    >>> setup, name = read_setup("cheap")
    >>> name, setup.converter.bits, setup.sensors.pressure_a
    ('cheap', 10, None)
    """
    start = 'For instance: schema = 1, then [sensors.position] resolution = "5 um".'
    return read_ready(Setup, given, ready_setups(), start)


def read_ready(
    kind: type[_Kind],
    given: _Kind | str | Path,
    ready: dict[str, Path],
    start: str,
) -> tuple[_Kind, str]:
    """Read a table of the package by its name, or a TOML file. Return the table and its name, "own" for a given table.

    Raises
    ------
    DescriptionError
        There is no such name or file, or the file is not valid.
    """
    if isinstance(given, kind):
        return given, "own"
    name = kind.__name__.lower()
    if not isinstance(given, (str, Path)):
        raise invalid("", "control.not_read", name=name, given=type(given).__name__, kind=kind.__name__)
    path = ready.get(str(given), Path(given))
    if not path.suffix and not path.exists():
        raise invalid("", "control.not_known", name=name, given=given, known=nearest(str(given), ready))
    return toml.load(kind.model_validate, path, start=start), str(given) if str(given) in ready else path.name


# --- Supervisor of a law: limits, the rule for a complete motion, reactions to faults. It is not a safety function.
#
# Values that are not in the controller file are assumed, like all other thresholds of the supervisor.

_SECONDS = marks.Quantity("s", "ms", marks.Bounds(above=0.0))


class ControlLimits(Described):
    """Limits of a drive under control. A reference beyond a limit is rejected; a drive beyond a limit is stopped."""

    table_name = "limits"
    position: Annotated[Interval | None, marks.Between("m", "mm")] = Field(
        default=None, description="positions that the drive may reach; absent: its stroke"
    )
    speed_m_s: Annotated[float | None, marks.Quantity("m/s", "m/s", marks.Bounds(above=0.0))] = Field(
        default=None, description="largest speed; absent: none"
    )
    pressure: Annotated[Any, marks.PressureBetween()] = Field(default=None, description="of the chambers; absent: none")
    stop_deceleration_m_s2: Annotated[float, marks.Quantity("m/s^2", "m/s2", marks.Bounds(above=0.0))] = Field(
        default=10.0, description="of stop ramps; the default is assumed"
    )


class MotionComplete(Described):
    """Conditions under which a motion is complete, and the time after which an incomplete motion is reported."""

    table_name = "motion"
    tolerance_m: marks.Length = Field(default=1e-4, description="error within which the drive has settled; assumed")
    settled_for_s: Annotated[float, _SECONDS] = Field(default=0.05, description="time within this error; assumed")
    timeout_s: Annotated[float, _SECONDS] = Field(
        default=2.0, description="time to move by 1 mm, or to settle; assumed"
    )


class OnFault(Described):
    """Reaction to a fault: the fault is reported, the drive is stopped by a ramp, or the valve is shut."""

    table_name = "on_fault"
    position: Annotated[str, marks.Choice(("stop", "block"))] = Field(
        default="block", description="position sensor lost; block: a ramp stops a moving drive first"
    )
    pressure: Annotated[str, marks.Choice(("model", "stop", "block"))] = Field(
        default="model", description="pressure sensor lost; block: a ramp stops a moving drive first"
    )
    valve: Annotated[str, marks.Choice(("tell", "stop", "block"))] = Field(
        default="block", description="valve does not answer"
    )
    supply: Annotated[str, marks.Choice(("tell", "stop", "block"))] = Field(
        default="block", description="supply pressure has fallen; block: only when the supply no longer fills a chamber"
    )
    law: Annotated[str | None, marks.Choice(tuple(_core.control_laws()))] = Field(
        default=None, description="replaces a failed controller; absent: inversion, except for custom controllers"
    )


def told(events: list[tuple[float, str, float]]) -> list[Plain]:
    """Return the events of a supervisor as records of time_s, kind, value, unit of the value, and text."""
    known = {key: (unit, text) for key, unit, text in _core.control_events()} if events else {}
    return [
        {"time_s": time, "kind": kind, "value": value, "unit": known[kind][0], "text": known[kind][1]}
        for time, kind, value in events
    ]
