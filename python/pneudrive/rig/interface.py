"""What a rig is to a campaign: nine verbs that a simulated rig, a replay, a PLC and a laboratory's own code share.

A laboratory binds its hardware by writing a class with the methods of `Rig`; it inherits from nothing.
All numbers are SI, pressures absolute; x grows as chamber a grows; the force is what the rig applies to the piston
in +x.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import RigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.force_calibration import ForceCalibration

    Array = NDArray[np.float64]

T = TypeVar("T")

#: What an identity and a recording both say of a rig.
SHARED = ("area_a_m2", "area_b_m2", "ambient_pressure_pa", "mass_beyond_sensor_kg", "incline_rad")
#: Channels that every rig delivers, in the order of the files; SI. What a rig does not measure is constant.
CHANNELS = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa", "temperature_k")


@dataclass(frozen=True)
class Move:
    """A straight move from rest to rest.

    Parameters
    ----------
    to_m : float
        Position at which it ends.
    speed_m_s : float
        Speed between the ramps, > 0.
    """

    to_m: float
    speed_m_s: float


@dataclass(frozen=True)
class Hold:
    """Standing still.

    Parameters
    ----------
    duration_s : float
    released : bool
        The axis gives way until the force sensor shows no force; otherwise it keeps its position, and the seal its
        deflection.
    shut : bool
        The supply is shut off meanwhile: a leak shows as a fall of pressure.
    weight_n : float
        Known force in +x that the operator has hung on the force sensor, the drive uncoupled; 0: none.
    """

    duration_s: float
    released: bool = False
    shut: bool = False
    weight_n: float = 0.0


Step = Move | Hold


@dataclass(frozen=True)
class Sampling:
    """How samples are spaced over a cycle.

    Parameters
    ----------
    samples_per_stroke : int
        Even in time over each move.
    burst_rate_hz : float
        Least rate around each reversal, stop and restart: at both ends of every step; 0: no bursts.
    burst_before_s, burst_after_s : float
        How long the burst lasts before a step ends and after one begins.
    hold_rate_hz : float
        Rate while the axis stands (outside the bursts).

    See Also
    --------
    pneudrive.rig.sampling.schedule : the times themselves, and so their number.
    """

    samples_per_stroke: int = 5000
    burst_rate_hz: float = 5000.0
    burst_before_s: float = 0.05
    burst_after_s: float = 0.2
    hold_rate_hz: float = 20.0


@dataclass(frozen=True, eq=False)  # holds arrays: equal only to itself
class Samples:
    """Samples in the order in which they were taken, shape (n,) each.

    Attributes
    ----------
    time_s
        From the start of the cycle, never decreasing.
    position_m, force_n, pressure_a_pa, pressure_b_pa, temperature_k
    step
        int64, index of the step (move or hold) of the cycle during which a sample was taken.
    """

    time_s: Array
    position_m: Array
    force_n: Array
    pressure_a_pa: Array
    pressure_b_pa: Array
    temperature_k: Array
    step: NDArray[np.int64]

    def __len__(self) -> int:
        """Give the number of samples."""
        return self.time_s.size

    @classmethod
    def join(cls, parts: Sequence[Samples]) -> Samples:
        """Join parts end to end; no parts make no samples."""
        first: dict[str, NDArray[Any]] = {**dict.fromkeys(CHANNELS, np.zeros(0)), "step": np.zeros(0, dtype=np.int64)}
        return cls(**{name: np.concatenate([none, *(getattr(p, name) for p in parts)]) for name, none in first.items()})

    @classmethod
    def of(cls, given: Any) -> Samples:  # noqa: ANN401 - whatever a lab's own code yields
        """Bring what a rig gave to float64, in arrays of its own.

        Raises
        ------
        RigError
            A channel is missing or of another length.
        """
        try:
            channels = {name: np.array(getattr(given, name), dtype=np.float64) for name in CHANNELS}
            step = np.array(given.step, dtype=np.int64)
        except (AttributeError, TypeError, ValueError) as error:
            raise RigError("the rig gave something else than samples", value=str(error), rule="see Samples") from None
        lengths = {name: values.shape for name, values in (channels | {"step": step}).items()}
        if len(set(lengths.values())) != 1 or step.ndim != 1:
            raise RigError("the rig gave channels of different lengths", value=str(lengths), rule="one length for all")
        return cls(**channels, step=step)

    def rows(self, chosen: slice | NDArray[Any]) -> Samples:
        """Take some of them, by slice, mask or indices."""
        return Samples(**{name: values[chosen] for name, values in vars(self).items()})


@contextmanager
def closed_after(given: T) -> Iterator[T]:
    """Close something that can be closed, whatever happens: a connection; an acquisition, whose axis then rests."""
    try:
        yield given
    finally:
        close = getattr(given, "close", None)
        if close is not None:
            close()


def has_verbs(rig: object, of: type) -> bool:
    """Whether a rig has all verbs of a protocol; a wrapper that passes them on has them too."""
    return all(callable(getattr(rig, verb, None)) for verb in vars(of) if not verb.startswith("_"))


@dataclass(frozen=True)
class RigState:
    """What a rig shows between and during cycles.

    Attributes
    ----------
    position_m, force_n, pressure_a_pa, pressure_b_pa, supply_pressure_pa, temperature_k : float
    time_s : float
        The rig's own clock.
    moving : bool
    fault : str or None
        What is wrong, in words; None where nothing is.
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
    """What a rig can do and may be asked to do; the pre-flight check of a campaign holds the plan against it.

    Attributes
    ----------
    position_m : (float, float)
        Range in which the axis may move.
    speed_m_s, acceleration_m_s2, jerk_m_s3 : float
        Largest values of the axis.
    force_n : float
        Largest force of either sign that the sensor may see.
    pressure_pa : (float, float)
        Range of the absolute pressure in either chamber.
    separate_pressures : bool
        Whether the chambers can have different pressures.
    temperature_k : (float, float)
        Range in which measuring goes on.
    supply_pressure_pa : float
        Least absolute supply pressure; 0 where it is not watched.
    expected_friction_n : float
        Largest friction to be expected, for the check against the force range; 0 where it is not known.
    home_m : float
        Where the axis goes home.
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
    """Which rig and drive this is, and how its sensors are calibrated: kept with every campaign as ``rig.json``.

    Attributes
    ----------
    name : str
    area_a_m2, area_b_m2 : float
        Piston areas that the chamber pressures act on.
    ambient_pressure_pa : float
    mass_beyond_sensor_kg : float
        Mass between the force sensor and the seal, piston included.
    incline_rad : float
        Positive where +x points up.
    stiffness_n_m : float or None
        Between the axis and the piston.
    accuracy : dict
        Channel -> standard uncertainty in SI; ``bore_m`` or ``area`` (relative) for the piston.
    limits : dict
        Channel -> (lowest, highest) value that the sensor shows.
    resolution : dict
        Channel -> smallest step that the sensor shows.
    calibration : dict
        Channel -> free text: certificate, date; one that starts with "assumed" marks the accuracy as assumed.
    labels : dict
        Free text: drive, seal, grease, serial numbers.
    chambers : str
        ``open``, ``common`` (one regulator, common manifold), ``separate`` (a regulator each) or ``held``
        (pressures do not change with motion).
    pressure_measured_at : str
        ``chamber``, or ``regulator``: then the force of the air cannot be separated from that of the seal.
    synthetic : bool
        A simulated rig.
    bandwidth_hz : dict
        Channel -> frequency at which the sensor, of first order, shows 71 % of an amplitude; of ``force_n`` it is used.
    force_calibration : ForceCalibration or None
        Of the force sensor as a curve: applied to the force in analysis, in the place of the accuracy of ``force_n``.
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
        """Give plain data that JSON can hold."""
        return asdict(self)


@runtime_checkable
class Rig(Protocol):
    """A rig. Every method blocks until it is done and raises `pneudrive.errors.RigError` where it cannot be done."""

    def identity(self) -> Identity:
        """Tell which rig this is."""
        ...

    def limits(self) -> Envelope:
        """Tell what it may be asked to do."""
        ...

    def state(self) -> RigState:
        """Tell where it stands."""
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
        """Stand still without recording."""
        ...

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps one after the other and yield the samples in parts, as they come.

        Closing the iterator early means: come to rest now.
        """
        ...

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        ...


@runtime_checkable
class Reproducible(Protocol):
    """A rig whose past can be set, so that a resumed campaign is the undisturbed one: a simulated rig."""

    def begin_cycle(self, key: str) -> None:
        """Let the noise of the next cycle depend on the rig's seed and this key alone."""
        ...

    def memory(self) -> dict[str, Any]:
        """Give all that the past has left behind (clock, travel, temperature, age of the contact), as plain data."""
        ...

    def restore(self, memory: dict[str, Any]) -> None:
        """Take a past back that `memory` gave."""
        ...

    def truth(self) -> dict[str, Any]:
        """Give what was true of the last cycle, as plain data; kept beside the recording, never read by results."""
        ...


@runtime_checkable
class Changeable(Protocol):
    """A rig that can be told what the operator has changed by hand: a simulated rig."""

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Give the factors that take certain levels only, and which; every other factor takes any name."""
        ...

    def change(self, levels: dict[str, str]) -> None:
        """Take what has been mounted: factor -> level, as in `Cycle.levels`; factors left out stay as they are."""
        ...
