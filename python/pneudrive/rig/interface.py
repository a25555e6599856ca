"""Interface of rigs: nine methods for simulated rigs, replays, PLCs and the code of a laboratory.

A laboratory connects its hardware by a class with the methods of `Rig`. A base class is not needed. All numbers are SI,
and pressures are absolute. x grows as chamber a grows. The force is that of the rig on the piston in +x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import DescriptionError, PneudriveError, RigError, nearest
from pneudrive.signals.force_calibration import ForceCalibration, of_json
from pneudrive.units import LARGEST

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

T = TypeVar("T")

#: Fields of a rig in both an identity and a recording.
SHARED = ("area_a_m2", "area_b_m2", "ambient_pressure_pa", "mass_beyond_sensor_kg", "incline_rad")
#: Channels that every rig delivers, in the order of the files; SI. Channels that a rig does not measure are constant.
CHANNELS = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa", "temperature_k")


@dataclass(frozen=True)
class Move:
    """Straight move from rest to rest.

    Parameters
    ----------
    to_m : float
        Position at the end.
    speed_m_s : float
        Speed between the ramps, > 0.
    """

    to_m: float
    speed_m_s: float


@dataclass(frozen=True)
class Hold:
    """Rest for a time.

    Parameters
    ----------
    duration_s : float
    released : bool
        The axis moves freely until the force sensor reads zero; otherwise it keeps its position, and the seal its
        deflection.
    shut : bool
        The supply is shut off, so that a leak appears as a fall of pressure.
    weight_n : float
        Known weight in +x that the operator put on the force sensor, with the drive uncoupled; 0: none.
    """

    duration_s: float
    released: bool = False
    shut: bool = False
    weight_n: float = 0.0


Step = Move | Hold


@dataclass(frozen=True)
class Sampling:
    """Spacing of samples over a cycle.

    Parameters
    ----------
    samples_per_stroke : int
        Number of samples, uniform in time over each move.
    burst_rate_hz : float
        Least rate around each reversal, stop and restart: at both ends of every step; 0: no bursts.
    burst_before_s, burst_after_s : float
        Duration of a burst before the end and after the beginning of a step.
    hold_rate_hz : float
        Rate while the axis is at rest, outside the bursts.

    See Also
    --------
    pneudrive.rig.motion.schedule : times and number of the samples.
    """

    samples_per_stroke: int = 5000
    burst_rate_hz: float = 5000.0
    burst_before_s: float = 0.05
    burst_after_s: float = 0.2
    hold_rate_hz: float = 20.0


@dataclass(frozen=True, eq=False)  # with arrays: equal only to itself
class Samples:
    """Samples in the order in which they were taken, shape (n,) each.

    Attributes
    ----------
    time_s
        From the start of the cycle, never decreasing.
    position_m, force_n, pressure_a_pa, pressure_b_pa, temperature_k
    step
        int64, index of the cycle's step (move or hold) of each sample.
    """

    time_s: Array
    position_m: Array
    force_n: Array
    pressure_a_pa: Array
    pressure_b_pa: Array
    temperature_k: Array
    step: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time_s.size

    @classmethod
    def join(cls, parts: Sequence[Samples]) -> Samples:
        """Join parts in their order; no parts give no samples."""
        first: dict[str, NDArray[Any]] = {**dict.fromkeys(CHANNELS, np.zeros(0)), "step": np.zeros(0, dtype=np.int64)}
        return cls(**{name: np.concatenate([none, *(getattr(p, name) for p in parts)]) for name, none in first.items()})

    @classmethod
    def of(cls, given: Any) -> Samples:  # noqa: ANN401 - any result of a lab's code
        """Convert samples from a rig to new arrays of float64.

        Raises
        ------
        RigError
            A channel is missing or of another length.
        """
        try:
            channels = {name: np.array(getattr(given, name), dtype=np.float64) for name in CHANNELS}
            step = np.array(given.step, dtype=np.int64)
        except (AttributeError, TypeError, ValueError) as error:
            raise RigError("the rig did not return samples", value=str(error), rule="see Samples") from None
        lengths = {name: values.shape for name, values in (channels | {"step": step}).items()}
        if len(set(lengths.values())) != 1 or step.ndim != 1:
            raise RigError(
                "the rig returned channels of different lengths",
                value=str(lengths),
                rule="all channels have the same length",
            )
        return cls(**channels, step=step)

    def rows(self, chosen: slice | NDArray[Any]) -> Samples:
        """Return some of the samples, by slice, mask or indices."""
        return Samples(**{name: values[chosen] for name, values in vars(self).items()})


@contextmanager
def closed_after(given: T) -> Iterator[T]:
    """Close a connection or an acquisition at the end of the block, also after an error."""
    try:
        yield given
    finally:
        close = getattr(given, "close", None)
        if close is not None:
            close()


def has_verbs(rig: object, of: type) -> bool:
    """Return whether a rig has all methods of a protocol, possibly through a wrapper."""
    return all(callable(getattr(rig, verb, None)) for verb in vars(of) if not verb.startswith("_"))


@dataclass(frozen=True)
class RigState:
    """State of a rig between and during cycles.

    Attributes
    ----------
    position_m, force_n, pressure_a_pa, pressure_b_pa, supply_pressure_pa, temperature_k : float
    time_s : float
        Clock of the rig.
    moving : bool
    fault : str or None
        Fault in words; None without a fault.
    """

    position_m: float
    force_n: float
    pressure_a_pa: float
    pressure_b_pa: float
    supply_pressure_pa: float
    temperature_k: float
    time_s: float
    moving: bool = False
    fault: str | None = None


@dataclass(frozen=True)
class Envelope:
    """Limits of a rig; the pre-flight check of a campaign compares the plan with them.

    Attributes
    ----------
    position_m : (float, float)
        Range in which the axis may move.
    speed_m_s, acceleration_m_s2, jerk_m_s3 : float
        Largest values of the axis.
    force_n : float
        Largest force of either sign on the sensor.
    pressure_pa : (float, float)
        Range of the absolute pressure in either chamber.
    separate_pressures : bool
        Whether the chambers can have different pressures.
    temperature_k : (float, float)
        Range in which measuring continues.
    supply_pressure_pa : float
        Least absolute supply pressure; 0: not monitored.
    expected_friction_n : float
        Largest expected friction, for the check against the force range; 0: unknown.
    home_m : float
        Home position of the axis.
    """

    position_m: tuple[float, float]
    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    force_n: float
    pressure_pa: tuple[float, float]
    separate_pressures: bool
    temperature_k: tuple[float, float]
    supply_pressure_pa: float = 0.0
    expected_friction_n: float = 0.0
    home_m: float = 0.0


@dataclass(frozen=True)
class Identity:
    """Identity of rig and drive, with the calibration of the sensors; kept with every campaign as ``rig.json``.

    Attributes
    ----------
    name : str
    area_a_m2, area_b_m2 : float
        Piston areas of the chambers.
    ambient_pressure_pa : float
    mass_beyond_sensor_kg : float
        Mass between the force sensor and the seal, including the piston.
    incline_rad : float
        Positive where +x points up.
    stiffness_n_m : float or None
        Stiffness between the axis and the piston.
    accuracy : dict
        Channel -> standard uncertainty in SI; ``bore_m`` or ``area`` (relative) for the piston.
    limits : dict
        Channel -> (lowest, highest) reading of the sensor.
    resolution : dict
        Channel -> smallest step of the sensor's readings.
    calibration : dict
        Channel -> free text: certificate, date. A text that starts with "assumed" marks the accuracy as assumed.
    labels : dict
        Free text: drive, seal, grease, serial numbers.
    chambers : str
        ``open``, ``common`` (one regulator, common manifold), ``separate`` (a regulator each) or ``held``
        (pressures do not change with motion).
    pressure_measured_at : str
        ``chamber``, or ``regulator``: then the force of the air cannot be separated from that of the seal.
    synthetic : bool
        Whether the rig is simulated.
    bandwidth_hz : dict
        Channel -> corner frequency (-3 dB) of the sensor, of first order; only that of ``force_n`` is used.
    force_calibration : ForceCalibration or None
        Calibration curve of the force sensor, which analysis applies in place of the accuracy of ``force_n``.
    """

    name: str
    area_a_m2: float
    area_b_m2: float
    ambient_pressure_pa: float = STANDARD_ATMOSPHERE_PA
    mass_beyond_sensor_kg: float = 0.0
    incline_rad: float = 0.0
    stiffness_n_m: float | None = None
    accuracy: dict[str, float] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    resolution: dict[str, float] = field(default_factory=dict)
    calibration: dict[str, str] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    chambers: str = "held"
    pressure_measured_at: str = "chamber"
    synthetic: bool = False
    bandwidth_hz: dict[str, float] = field(default_factory=dict)
    force_calibration: ForceCalibration | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return asdict(self)


@runtime_checkable
class Rig(Protocol):
    """Protocol of rigs. Every method blocks until it is done, and raises `pneudrive.errors.RigError` on failure."""

    def identity(self) -> Identity:
        """Return the identity of the rig."""
        ...

    def limits(self) -> Envelope:
        """Return the limits of the rig."""
        ...

    def state(self) -> RigState:
        """Return the state of the rig."""
        ...

    def home(self) -> None:
        """Bring the axis to its home position."""
        ...

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures, Pa; ambient pressure vents a chamber."""
        ...

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""
        ...

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Rest for a time without recording."""
        ...

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps in their order, and yield the samples in parts as they arrive.

        Closing the iterator early brings the axis to rest.
        """
        ...

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        ...


@runtime_checkable
class Reproducible(Protocol):
    """Protocol of rigs with a restorable history, so that a resumed campaign equals the undisturbed one."""

    def begin_cycle(self, key: str) -> None:
        """Seed the noise of the next cycle from the rig's seed and this key."""
        ...

    def memory(self) -> dict[str, Any]:
        """Return the saved state (clock, travel, temperature, age of the contact) as plain data."""
        ...

    def restore(self, memory: dict[str, Any]) -> None:
        """Restore a saved state from `memory`."""
        ...

    def truth(self) -> dict[str, Any]:
        """Return the ground truth of the last cycle as plain data, stored with the recording for tests only."""
        ...


@runtime_checkable
class Changeable(Protocol):
    """Protocol of rigs that accept the operator's manual changes: simulated rigs."""

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the possible levels of factors with fixed levels; every other factor takes any name."""
        ...

    def change(self, levels: dict[str, str]) -> None:
        """Set mounted factor levels: factor -> level, as in `Cycle.levels`; factors left out are unchanged."""
        ...


def plain(value: Any) -> Any:  # noqa: ANN401 - any plain data
    """Convert numbers and arrays of NumPy to plain data for JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not plain data")


def is_number(value: object) -> bool:
    """Return whether a value is a number but not NaN. Infinity is valid for a rigid rig or a sensor without limits."""
    return type(value) in (int, float) and (abs(value) <= LARGEST or abs(value) == math.inf)  # type: ignore[arg-type]


def _is_pair(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


#: Annotation of a field -> rule of its JSON value in words, and its check; others are tables.
_RULES: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "float": ("a number", is_number),
    "int": ("a whole number", lambda value: type(value) is int),
    "str": ("text", lambda value: type(value) is str),
    "bool": ("true or false", lambda value: type(value) is bool),
    "tuple[float, float]": ("a list of two numbers", _is_pair),
    "tuple": ("a list", lambda value: type(value) is list),
    "list": ("a list", lambda value: type(value) is list),
}
_TABLE = ("a table", lambda value: type(value) is dict)


@cache
def _rules(cls: type) -> dict[str, tuple[str, Callable[[Any], bool]]]:
    """Return the rule of each field of a dataclass from its annotation."""
    kinds = {field.name: str(field.type).partition(" |")[0] for field in fields(cls)}
    return {name: _RULES.get(kind) or _RULES.get(kind.partition("[")[0], _TABLE) for name, kind in kinds.items()}


def read_fields(
    data: Any,  # noqa: ANN401 - JSON
    cls: type,
    where: str,
    kind: type[PneudriveError],
    path: str = "",
) -> tuple[dict[str, Any], list[str]]:
    """Check a table against the fields of its class.

    Parameters
    ----------
    data : dict
        Data from JSON; null counts as absent.
    cls : type
        Dataclass with annotations as texts.
    where : str
        File, for messages.
    kind : type of PneudriveError
    path : str
        Prefix of names in messages.

    Returns
    -------
    dict, list of str
        The known fields that are not null, and notes on unknown keys, which are ignored.

    Raises
    ------
    PneudriveError
        The data are not a table, or a value is of another type.
    """
    if not isinstance(data, dict):
        raise kind("this is not a JSON object", where=where)
    rules, known, notes = _rules(cls), dict[str, Any](), []
    for name, value in data.items():
        if name not in rules:
            notes.append(f"{path}{name} is ignored, as it is not a known key. {nearest(name, rules)}")
        elif value is not None:
            words, holds = rules[name]
            if not holds(value):
                raise kind(f"{path}{name} = {value!r:.80}", where=where, rule=f"the value is {words}")
            known[name] = value
    return known, notes


def identity_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> tuple[Identity, list[str]]:  # noqa: ANN401 - JSON
    """Return the identity of a rig from plain data.

    Returns
    -------
    Identity, list of str
        Identity, and notes as from `read_fields`.

    Raises
    ------
    PneudriveError
        A key is missing or its value is not valid.
    """
    known, notes = read_fields(data, Identity, where, kind)
    known = {"name": "unnamed rig", **known}
    for name in ("area_a_m2", "area_b_m2"):
        if name not in known:
            raise kind(f"{name} is missing", where=where, rule="the pistons' areas must be known")
        if not 0.0 < known[name] < math.inf:
            raise kind(f"{name} = {known[name]:g}", where=where, rule="an area is positive")
    for name, (rule, holds) in _CHANNELS.items():
        for channel, value in known.get(name, {}).items():
            if not holds(value):
                raise kind(f"{name}.{channel} = {value}", where=where, rule=rule)
    known["limits"] = {channel: (float(low), float(high)) for channel, (low, high) in known.get("limits", {}).items()}
    try:
        curve = known.get("force_calibration")
        known["force_calibration"] = None if curve is None else of_json(curve)
    except DescriptionError as error:
        raise kind(error.what, where=where, rule=error.rule, remedy=error.remedy) from None
    return Identity(**known), notes


#: Tables of an identity by channel: rule of their values, and its check.
_CHANNELS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "limits": ("[lowest, highest]", lambda value: _is_pair(value) and value[0] < value[1]),
    "accuracy": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "resolution": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "bandwidth_hz": ("a frequency is positive", lambda value: is_number(value) and 0.0 < value < math.inf),
}


def envelope_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> Envelope:  # noqa: ANN401 - JSON
    """Return the envelope of a rig from plain data.

    Raises
    ------
    PneudriveError
        The data are not an envelope.
    """
    if not isinstance(data, dict):
        raise kind("the rig's envelope is not valid", where=where, value=data, rule="a table")
    known, _ = read_fields(data, Envelope, where, kind)
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in known.items()}
    try:
        return Envelope(**values)
    except TypeError as error:
        raise kind("the rig's envelope is not valid", where=where, value=str(error)) from None
