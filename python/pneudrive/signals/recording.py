"""A recording: measurements of a real or simulated rig while a piston moves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA, STANDARD_GRAVITY_M_S2
from pneudrive.errors import RecordingError
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.signals.force_calibration import ForceCalibration

CHANNELS = ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")


class ParallelForce(NamedTuple):
    """A force in parallel with the rig's, computed from measured pressures.

    Attributes
    ----------
    name : str
    area_m2 : float
        Area that the pressures act on.
    uncertainty : float
        Relative standard uncertainty of the area.
    force_n : ndarray
        Force on the piston at each sample, positive in +x, shape (n,).
    """

    name: str
    area_m2: float
    uncertainty: float
    force_n: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Recording(Shown):
    """One measured run: synchronous samples in SI with absolute pressures.

    Parameters
    ----------
    name
        Unique name within a set; for a file, its name without suffix.
    time_s, position_m, force_n, pressure_a_pa, pressure_b_pa
        float64 arrays of one length n. Position grows as chamber a grows. ``force_n`` is the force of the rig on the
        piston, positive in +x. A pressure that was not measured is constant.
    area_a_m2, area_b_m2
        Piston areas that the chamber pressures act on.
    ambient_pressure_pa
        Absolute pressure around the rod.
    mass_beyond_sensor_kg
        Mass that moves between the force sensor and the piston, piston included.
    incline_rad
        Positive where +x points up.
    accuracy
        Standard uncertainty for each channel in SI (``position_m``, ``force_n``, ``pressure_a_pa``, ``pressure_b_pa``),
        and of ``bore_m`` or ``area`` (relative). A missing key is replaced by an assumed value, which the uncertainty
        budget marks as assumed.
    labels
        Free text such as seal, run, pressure.
    window_m
        Positions between which friction is averaged; None: the middle 60 % of the stroke.
    source, sha256
        File and hash of its bytes, if there is one.
    synthetic, truth
        Simulated rigs mark their recordings and keep their parameters.
    stiffness_n_m
        Stiffness of the rig between its carriage and the piston, if known.
    flags
        Counts of faults on reading: unreadable rows, repeated times, ...
    limits
        Channel -> (lowest, highest) value of the sensor, if known.
    calibration
        Channel -> free text. A text that starts with "assumed" marks the accuracy as assumed in the budget.
    force_calibration
        Calibration of the force sensor, already applied to ``force_n``: its uncertainties go into the budget.
    parallel
        Forces in parallel with the rig's, such as that of a hydraulic ram; `balance_n` contains them.
    """

    name: str
    time_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    force_n: NDArray[np.float64]
    pressure_a_pa: NDArray[np.float64]
    pressure_b_pa: NDArray[np.float64]
    area_a_m2: float
    area_b_m2: float
    ambient_pressure_pa: float = STANDARD_ATMOSPHERE_PA
    mass_beyond_sensor_kg: float = 0.0
    incline_rad: float = 0.0
    accuracy: dict[str, float] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    window_m: tuple[float, float] | None = None
    source: Path | None = None
    sha256: str | None = None
    synthetic: bool = False
    truth: dict | None = None
    stiffness_n_m: float | None = None
    flags: dict[str, int] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    calibration: dict[str, str] = field(default_factory=dict)
    force_calibration: ForceCalibration | None = None
    parallel: tuple[ParallelForce, ...] = ()

    def __post_init__(self) -> None:
        """Convert the channels to float64 and refuse an invalid recording."""
        size = np.size(self.time_s)
        for channel in ("time_s", *CHANNELS):
            values = np.asarray(getattr(self, channel), dtype=np.float64)
            if values.ndim == 0:
                values = np.full(size, float(values))
            if values.shape != (size,):
                raise RecordingError(
                    f"{channel} has {values.size} samples, but time_s has {size}",
                    where=self.name,
                    rule="all channels must be one-dimensional and of one length",
                )
            object.__setattr__(self, channel, values)
        with np.errstate(invalid="ignore"):  # times that are not finite are counted later
            backwards = np.flatnonzero(np.diff(self.time_s) < 0)
        if backwards.size:
            at = int(backwards[0]) + 1
            raise RecordingError(
                "time runs backwards",
                where=f"{self.name}, sample {at}",
                value=f"{self.time_s[at]:.6g} s after {self.time_s[at - 1]:.6g} s",
                rule="time must not decrease",
                remedy="check the time column and its unit, or split the file at the reset of the clock; several runs "
                'in one Parquet file need the column of their number, cycle = { column = "..." }',
            )
        for area in ("area_a_m2", "area_b_m2"):
            if not (np.isfinite(getattr(self, area)) and getattr(self, area) >= 0):
                raise RecordingError(f"{area} must not be negative", where=self.name, value=getattr(self, area))

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time_s.size

    def at(self, keep: NDArray[np.bool_]) -> Recording:
        """Return the recording at some of its samples."""
        channels = {name: getattr(self, name)[keep] for name in ("time_s", *CHANNELS)}
        forces = tuple(force._replace(force_n=force.force_n[keep]) for force in self.parallel)
        return replace(self, **channels, parallel=forces)

    @property
    def weight_n(self) -> float:
        """Weight of the mass beyond the sensor along the axis, positive if it pulls towards -x."""
        return self.mass_beyond_sensor_kg * STANDARD_GRAVITY_M_S2 * float(np.sin(self.incline_rad))

    def balance_n(self, acceleration_m_s2: NDArray[np.float64] | float = 0.0) -> NDArray[np.float64]:
        """Return the force that remains for friction and for errors, positive if it opposes motion in +x.

          balance = F + F_parallel + p_a A_a - p_b A_b - p_ambient (A_a - A_b) - m a - m g sin(incline)

        Parameters
        ----------
        acceleration_m_s2
            Acceleration of the piston, shape (n,) or a scalar.

        Returns
        -------
        ndarray
            Shape (n,), N.
        """
        ambient = self.ambient_pressure_pa
        # In place, term by term: fresh memory for each would take longer than the sum.
        balance = self.pressure_a_pa - ambient
        balance *= self.area_a_m2
        balance += self.force_n
        for force in self.parallel:
            balance += force.force_n
        side_b = self.pressure_b_pa - ambient
        side_b *= self.area_b_m2
        balance -= side_b
        balance -= self.mass_beyond_sensor_kg * acceleration_m_s2
        balance -= self.weight_n
        return balance
