"""Interface of rigs with nine methods, for simulated rigs, replays, PLCs and custom code.

To connect your own hardware, write a class with the methods of `Rig`; a base class is not needed. All numbers are in
SI, and pressures are absolute. x grows as chamber a grows. A positive force of the rig pushes the piston in +x.
"""

from __future__ import annotations

import json
import math
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from typing import Annotated, Any, ClassVar, Protocol, TypeGuard, TypeVar, runtime_checkable

import numpy as np
import pydantic
from numpy.typing import NDArray

from pneudrive.arrays import Array, Ints, Plain
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import DescriptionError, ErrorKind, RigError, nearest, package_table
from pneudrive.signals.force_calibration import ForceCalibration
from pneudrive.units import LARGEST

T = TypeVar("T")


def present(data: Any) -> Any:  # noqa: ANN401 - JSON
    """Return a table without its null values, which count as absent."""
    return {name: value for name, value in data.items() if value is not None} if isinstance(data, dict) else data


def holds(rule: str, check: Callable[[Any], bool]) -> pydantic.AfterValidator:
    """Return a validator that applies `check` to a value from JSON. Its error message states `rule`."""

    def checked(value: T) -> T:
        if check(value):
            return value
        raise ValueError(rule)

    return pydantic.AfterValidator(checked)


#: Number, not NaN. Infinity is valid for a rigid rig or a sensor without limits.
Number = Annotated[
    pydantic.StrictFloat, holds("the value is a number", lambda value: abs(value) <= LARGEST or abs(value) == math.inf)
]
Positive = Annotated[Number, pydantic.Field(gt=0.0, lt=math.inf)]
NotNegative = Annotated[Number, pydantic.Field(ge=0.0)]
Span = tuple[Number, Number]
Limits = Annotated[Span, holds("[lowest, highest]", lambda value: value[0] < value[1])]
#: Texts by name. Numbers are converted to text.
Texts = Annotated[
    dict[str, str],
    pydantic.BeforeValidator(lambda data: {n: str(v) for n, v in data.items()} if isinstance(data, dict) else data),
]

WORDS: dict[str, Plain] = package_table(__file__, "words.toml")
ONLY_KNOWN = pydantic.ConfigDict(extra="forbid")
#: Fields of a rig in both an identity and a recording.
SHARED = (
    *("area_a_m2", "area_b_m2", "ambient_pressure_pa", "mass_beyond_sensor_kg", "incline_rad", "stiffness_n_m"),
    *("accuracy", "limits", "calibration", "force_calibration", "synthetic"),
)
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

    __pydantic_config__: ClassVar = ONLY_KNOWN
    to_m: Number
    speed_m_s: Number


@dataclass(frozen=True)
class Hold:
    """Rest for a time.

    Parameters
    ----------
    duration_s : float
    released : bool
        Whether the axis moves until the force sensor reads zero. Otherwise, the axis keeps its position, and the seal
        its deflection.
    shut : bool
        Whether the supply is shut off, so that a leak lowers the pressure.
    weight_n : float
        Force in N in +x of a known weight on the force sensor, with the drive uncoupled; 0: no weight.
    """

    __pydantic_config__: ClassVar = ONLY_KNOWN
    duration_s: Number
    released: pydantic.StrictBool = False
    shut: pydantic.StrictBool = False
    weight_n: Number = 0.0


Step = Move | Hold
#: Kinds of steps in JSON: a step without a target, and a step with a target.
TAGS = ("hold", "move")
WrittenStep = Annotated[
    Annotated[Move, pydantic.Tag("move")] | Annotated[Hold, pydantic.Tag("hold")],
    pydantic.Discriminator(lambda step: TAGS[isinstance(step, Move) or (isinstance(step, dict) and "to_m" in step)]),
    pydantic.BeforeValidator(present),
]


@dataclass(frozen=True)
class Sampling:
    """Distribution of samples over a cycle.

    Parameters
    ----------
    samples_per_stroke : int
        Number of samples, uniform in time over each move.
    burst_rate_hz : float
        Minimum sampling rate at both ends of every step, i.e. around each reversal, stop and restart; 0: no bursts.
    burst_before_s, burst_after_s : float
        Duration of a burst before the end and after the beginning of a step.
    hold_rate_hz : float
        Sampling rate while the axis is at rest, outside the bursts.

    See Also
    --------
    pneudrive.rig.motion.step_times : times of the samples of a step.
    """

    __pydantic_config__: ClassVar = ONLY_KNOWN
    samples_per_stroke: pydantic.StrictInt = 5000
    burst_rate_hz: Number = 5000.0
    burst_before_s: Number = 0.05
    burst_after_s: Number = 0.2
    hold_rate_hz: Number = 20.0


@dataclass(frozen=True, eq=False)  # with arrays: equal only to itself
class Samples:
    """Samples in the order in which they were taken, shape (n,) each.

    Attributes
    ----------
    time_s
        Time from the start of the cycle, never decreasing.
    position_m, force_n, pressure_a_pa, pressure_b_pa, temperature_k
    step
        Index of the step of the cycle (move or hold) in which each sample was taken, int64.
    """

    time_s: Array
    position_m: Array
    force_n: Array
    pressure_a_pa: Array
    pressure_b_pa: Array
    temperature_k: Array
    step: Ints

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time_s.size

    @classmethod
    def join(cls, parts: Sequence[Samples]) -> Samples:
        """Join parts in their order. Without parts, the result has no samples."""
        none: dict[str, NDArray[Any]] = {**dict.fromkeys(CHANNELS, np.zeros(0)), "step": np.zeros(0, dtype=np.int64)}
        all_parts = [none, *map(vars, parts)]
        return cls(**{name: np.concatenate([part[name] for part in all_parts]) for name in none})

    @classmethod
    def of(cls, given: Any) -> Samples:  # noqa: ANN401 - any result of a lab's code
        """Convert samples from a rig to new arrays of float64.

        Raises
        ------
        RigError
            A channel is missing, or its length differs from the others.
        """
        try:
            channels = {name: np.array(getattr(given, name), dtype=float) for name in CHANNELS}
            step = np.array(given.step, dtype=np.int64)
        except (AttributeError, TypeError, ValueError) as error:
            raise RigError("the rig returned no Samples", value=str(error), rule="see pneudrive.rig.Samples") from None
        lengths = {name: values.shape for name, values in (channels | {"step": step}).items()}
        if len(set(lengths.values())) != 1 or step.ndim != 1:
            raise RigError.of("rig.lengths", value=str(lengths))
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


def missing_verbs(rig: object, of: type) -> list[str]:
    """Return the methods of a protocol that a rig does not have. Methods of a wrapped rig count."""
    return [verb for verb in vars(of) if not verb.startswith("_") and not callable(getattr(rig, verb, None))]


def has_verbs(rig: object, of: type) -> TypeGuard[Any]:
    """Return whether a rig has all methods of a protocol, possibly through a wrapper."""
    return not missing_verbs(rig, of)


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
    """Limits of a rig. The pre-flight check of a campaign compares the plan with these limits.

    Attributes
    ----------
    position_m : (float, float)
        Range in which the axis may move.
    speed_m_s, acceleration_m_s2, jerk_m_s3 : float
        Largest speed, acceleration and jerk of the axis.
    force_n : float
        Largest force of either sign on the sensor.
    pressure_pa : (float, float)
        Range of the absolute pressure in either chamber.
    separate_pressures : bool
        Whether the chambers can have different pressures.
    temperature_k : (float, float)
        Range in which a campaign continues to measure.
    supply_pressure_pa : float
        Lowest absolute supply pressure; 0: not monitored.
    expected_friction_n : float
        Largest expected friction, for the check against the force range; 0: unknown.
    home_m : float
        Home position of the axis.
    """

    position_m: Span
    speed_m_s: Number
    acceleration_m_s2: Number
    jerk_m_s3: Number
    force_n: Number
    pressure_pa: Span
    separate_pressures: pydantic.StrictBool
    temperature_k: Span
    supply_pressure_pa: Number = 0.0
    expected_friction_n: Number = 0.0
    home_m: Number = 0.0


@dataclass(frozen=True)
class Identity:
    """Identity of rig and drive, with the calibration of the sensors. Every campaign stores it as ``rig.json``.

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
        ``open``, ``common`` (one regulator and a common manifold), ``separate`` (one regulator for each chamber) or
        ``held`` (pressures do not change with motion).
    pressure_measured_at : str
        ``chamber`` or ``regulator``. At the regulator, the air force cannot be separated from the friction of the seal.
    synthetic : bool
        Whether the rig is simulated.
    bandwidth_hz : dict
        Channel -> corner frequency (-3 dB) of the sensor as a first-order filter; only ``force_n`` is used.
    force_calibration : ForceCalibration or None
        Calibration curve of the force sensor, which the analysis uses instead of the accuracy of ``force_n``.
    """

    name: str
    area_a_m2: Positive
    area_b_m2: Positive
    ambient_pressure_pa: Number = STANDARD_ATMOSPHERE_PA
    mass_beyond_sensor_kg: Number = 0.0
    incline_rad: Number = 0.0
    stiffness_n_m: Number | None = None
    accuracy: dict[str, NotNegative] = field(default_factory=dict)
    limits: dict[str, Limits] = field(default_factory=dict)
    resolution: dict[str, NotNegative] = field(default_factory=dict)
    calibration: Texts = field(default_factory=dict)
    labels: Texts = field(default_factory=dict)
    chambers: str = "held"
    pressure_measured_at: str = "chamber"
    synthetic: pydantic.StrictBool = False
    bandwidth_hz: dict[str, Positive] = field(default_factory=dict)
    force_calibration: ForceCalibration | None = None

    def to_dict(self) -> Plain:
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

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures in Pa. For ambient pressure, the chambers are vented."""

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Rest for a time without recording."""

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps in their order, and yield the samples in parts as they arrive.

        Closing the iterator early brings the axis to rest.
        """
        ...

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""


@runtime_checkable
class Reproducible(Protocol):
    """Protocol of rigs with a restorable history, so that a resumed campaign equals an uninterrupted one."""

    def begin_cycle(self, key: str) -> None:
        """Seed the noise of the next cycle from the rig's seed and this key."""

    def memory(self) -> Plain:
        """Return the saved state (clock, travel, temperature, age of the contact) as plain data."""
        ...

    def restore(self, memory: Plain) -> None:
        """Restore a saved state from `memory`."""


@runtime_checkable
class Changeable(Protocol):
    """Protocol of simulated rigs, which also carry out the manual changes of an operator."""

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the levels of each factor with fixed levels. Other factors accept any name of a level."""
        ...

    def change(self, levels: dict[str, str]) -> None:
        """Set the levels of mounted factors: factor -> level, as in `Cycle.levels`. Omitted factors stay unchanged."""


def plain(value: Any) -> Any:  # noqa: ANN401 - any plain data
    """Convert numbers and arrays of NumPy to plain data for JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not plain data")


def as_json(value: Any) -> Any:  # noqa: ANN401 - any plain data
    """Return data in the form that is read back from JSON, so that a resumed campaign equals an uninterrupted one."""
    return json.loads(json.dumps(value, default=plain))


# --- Identities, envelopes and cycles from JSON of any program.


def read_table(
    data: Any,  # noqa: ANN401 - JSON
    cls: type[T],
    where: str,
    kind: ErrorKind = RigError,
    path: str = "",
    **usual: Any,  # noqa: ANN401 - values of absent keys
) -> tuple[T, list[str]]:
    """Make an object of a class from a table. The annotations of the class check the values.

    Parameters
    ----------
    data : dict
        Data from JSON; null counts as absent.
    cls : type
    where : str
        File, for messages.
    kind : type of PneudriveError
    path : str
        Prefix of names in messages.
    **usual
        Values of absent keys.

    Returns
    -------
    object, list of str
        The object, and notes on unknown keys, which are ignored.

    Raises
    ------
    PneudriveError
        The data are not a table, a key is missing, or a value is not valid.
    """
    if not isinstance(data, dict):
        raise kind("this is not a JSON object", where=where)
    names = [field.name for field in fields(cls)]  # type: ignore[arg-type] - a dataclass
    notes = [f"{path}{n} is ignored: it is not a known key. {nearest(n, names)}" for n in data if n not in names]
    try:
        known = {name: value for name, value in present(data).items() if name in names}
        return _adapter(cls).validate_python(usual | known), notes
    except pydantic.ValidationError as error:
        first = error.errors()[0]
    cause = first.get("ctx", {}).get("error", "")
    if isinstance(cause, DescriptionError):  # of the calibration curve
        raise kind(cause.what, where=where, rule=cause.rule, remedy=cause.remedy)
    key = path + ".".join(str(part) for part in first["loc"] if part not in TAGS)
    why = first["type"]
    if why in WORDS["faults"]:
        known = fields(ForceCalibration if "force_calibration" in first["loc"] else cls)  # type: ignore[arg-type]
        keys = f"keys: {', '.join(field.name for field in known)}"
        rule = "a step needs either to_m and speed_m_s, or duration_s" if "steps" in first["loc"] else keys
        raise kind(f"{key} {WORDS['faults'][why]}", where=where, rule=rule)
    words = str(cause) or f"the value is {WORDS['rules'].get(why, 'of another type')}"
    raise kind(f"{key} = {first['input']!r:.80}", where=where, rule=words)


_adapter = cache(pydantic.TypeAdapter)


def identity_of(data: Any, where: str, kind: ErrorKind = RigError) -> tuple[Identity, list[str]]:  # noqa: ANN401 - JSON
    """Return the identity of a rig from plain data, and notes on unknown keys; errors as for `read_table`."""
    return read_table(data, Identity, where, kind, name="unnamed rig")


def envelope_of(data: Any, where: str, kind: ErrorKind = RigError) -> Envelope:  # noqa: ANN401 - JSON
    """Return the envelope of a rig from plain data; errors as for `read_table`."""
    return read_table(data, Envelope, where, kind)[0]


# --- Calls of a rig.


class JobThread:
    """Thread that runs one job after the other. A job that never returns does not prevent the process from ending.

    Parameters
    ----------
    name : str
        Name of the thread.
    """

    def __init__(self, name: str) -> None:
        self._jobs: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (given := self._jobs.get()) is not None:
            future, job = given
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(job())
            except BaseException as error:  # any exception of a lab's code goes to the caller
                future.set_exception(error)

    def start(self, job: Callable[[], T]) -> Future[T]:
        """Run a job after the previous job."""
        future: Future[T] = Future()
        self._jobs.put((future, job))
        return future

    def close(self, wait_s: float = 0.0) -> None:
        """End the thread after its last job. Wait for its end at most `wait_s` seconds."""
        self._jobs.put(None)
        self._thread.join(wait_s)
