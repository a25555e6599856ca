"""Simulated rig: true motion from the core, recordings from sensor models."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import CommandError, SimulationError
from pneudrive.repr_tables import Shown
from pneudrive.rig.core import core_friction, core_rig, steady_friction_n
from pneudrive.rig.description import DEFAULT, RigDescription, read_description
from pneudrive.rig.motion import Limits, Motion, cycles
from pneudrive.signals.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.rig.sensors import EncoderClock, TimeClock
    from pneudrive.rig.session import RigSession

    Array = NDArray[np.float64]

#: Tolerance of the core: errors of force far below the noise of any force sensor.
DEFAULT_RTOL = 1e-6


@dataclass(frozen=True, repr=False)
class Trace(Shown):
    """True signals of the rig at the sample times, before the sensors.

    Attributes
    ----------
    columns : dict
        Columns of the core: time_s, carriage_position_m, ..., sensor_force_n, friction_force_n.
    motion : Motion
        Motion of the servo carriage.
    speed_m_s : float
        Commanded speed.
    pressure_a_pa, pressure_b_pa : float
        Absolute pressures at which the chambers are held.
    statistics : dict
        Counts of the integration.
    """

    columns: dict[str, Array]
    motion: Motion
    speed_m_s: float
    pressure_a_pa: float
    pressure_b_pa: float
    statistics: dict


@dataclass(frozen=True)
class SimulatedRig:
    """Simulated rig: a linear servo drags the piston through a stiff force sensor at constant pressures.

    Parameters
    ----------
    description : RigDescription

    Examples
    --------
    >>> rig = SimulatedRig.default()
    >>> recording = rig.measure(0.05, gauge_pa=0.5e5, seed=1)
    >>> len(recording), recording.synthetic
    (5000, True)
    """

    description: RigDescription

    @classmethod
    def default(cls) -> SimulatedRig:
        """Return the rig with the package's default values, all assumed."""
        return cls(read_description(DEFAULT))

    @classmethod
    def load(cls, path: str | Path) -> SimulatedRig:
        """Return the rig of a TOML file."""
        return cls(read_description(path))

    def session(self, seed: int = 0, pace: float | None = None) -> RigSession:
        """Start a session with the verbs of a campaign; see `RigSession`."""
        from pneudrive.rig.session import RigSession

        return RigSession(self, seed, pace)

    def with_friction(self, law: str | None = None, **parameters: float) -> SimulatedRig:
        """Return a rig with another friction law or other parameters (SI, names as in the drive file)."""
        known = dict(self.description.parameters)
        known.update(parameters)
        return SimulatedRig(replace(self.description, law=law or self.description.law, parameters=known))

    def drag(
        self,
        speed_m_s: float,
        gauge_pa: float | tuple[float, float] = 0.0,
        *,
        count: int = 1,
        dwell_s: float = 0.0,
        clock: TimeClock | EncoderClock | None = None,
        limits: Limits | None = None,
        rtol: float = DEFAULT_RTOL,
    ) -> Trace:
        """Drag the piston out and back, and return the true signals.

        Parameters
        ----------
        speed_m_s : float
            Speed between the ramps, > 0.
        gauge_pa : float or (float, float)
            Gauge pressure in both chambers, or in a and b.
        count : int
            Cycles (out and back).
        dwell_s : float
            Stop at each reversal.
        clock : TimeClock or EncoderClock, optional
            Sample clock; default: the rig's.
        limits : Limits, optional
            Limits of the servo; default: the rig's.
        rtol : float
            Relative tolerance of the integration.

        Returns
        -------
        Trace

        Raises
        ------
        CommandError
            The speed is not reached within the stroke, or a pressure is below vacuum.
        SimulationError
            The core rejects the rig or cannot finish.
        """
        d = self.description
        motion = cycles(
            d.margin_m, d.stroke_m - d.margin_m, speed_m_s, limits or d.limits, count=count, dwell_s=dwell_s
        )
        pressure_a, pressure_b = self._absolute(gauge_pa)
        times = (clock or d.clock).times(motion, count)
        try:
            rig = core_rig(d, (pressure_a, pressure_b))
            result = rig.run(motion.durations_s, motion.jerks_m_s3, times, motion.start_m, rtol)
        except (ValueError, RuntimeError) as error:
            raise SimulationError("the simulated rig cannot run", value=str(error)) from error
        return Trace(result.columns, motion, speed_m_s, pressure_a, pressure_b, result.statistics)

    def record(self, trace: Trace, seed: int | Sequence[int] = 0, *, name: str | None = None) -> Recording:
        """Read a trace with the rig's sensors.

        Parameters
        ----------
        trace : Trace
        seed : int or sequence of int
            Seed of the noise; equal seeds give equal recordings.
        name : str, optional
            Name of the recording.

        Returns
        -------
        Recording
            ``synthetic`` with its ``truth``: friction law and parameters, zeros of the sensors, speed, true pressures.
        """
        d = self.description
        rng = np.random.default_rng(seed)
        true = trace.columns
        force = d.force_sensor.read(true["sensor_force_n"], rng)
        pressures = [d.pressure_sensor.read(true[f"pressure_{side}_pa"], rng) for side in "ab"]
        area_a, area_b = d.areas_m2
        gauges = [1e-5 * (p - d.ambient_pressure_pa) for p in (trace.pressure_a_pa, trace.pressure_b_pa)]
        shown = f"{gauges[0]:.3g} bar" if gauges[0] == gauges[1] else f"{gauges[0]:.3g} and {gauges[1]:.3g} bar"
        return Recording(
            name=name or f"{1e3 * trace.speed_m_s:.4g} mm/s, {shown}",
            time_s=true["time_s"],
            position_m=d.encoder.read(true["carriage_position_m"]),
            force_n=force,
            pressure_a_pa=pressures[0],
            pressure_b_pa=pressures[1],
            area_a_m2=area_a,
            area_b_m2=area_b,
            ambient_pressure_pa=d.ambient_pressure_pa,
            mass_beyond_sensor_kg=d.moving_mass_kg,
            incline_rad=d.incline_rad,
            accuracy={
                "position_m": d.encoder.resolution_m / 12.0**0.5,
                "force_n": d.force_accuracy_n,
                "pressure_a_pa": d.pressure_accuracy_pa,
                "pressure_b_pa": d.pressure_accuracy_pa,
            },
            labels={"rig": d.name, "speed": f"{1e3 * trace.speed_m_s:.4g} mm/s", "pressure": f"{shown} gauge"},
            synthetic=True,
            truth={
                "law": d.law,
                "parameters": dict(d.parameters),
                "pressure": dict(d.pressure) if d.pressure else None,
                "speed_m_s": trace.speed_m_s,
                "pressure_a_pa": trace.pressure_a_pa,
                "pressure_b_pa": trace.pressure_b_pa,
                "force_zero_n": d.force_sensor.zero,
                "friction_n": float(self.true_friction(trace.speed_m_s, trace.pressure_a_pa, trace.pressure_b_pa)),
            },
            stiffness_n_m=d.stiffness_n_m,
            limits={"force_n": (d.force_sensor.low, d.force_sensor.high)},
        )

    def measure(
        self,
        speed_m_s: float,
        gauge_pa: float | tuple[float, float] = 0.0,
        *,
        count: int = 1,
        dwell_s: float = 0.0,
        seed: int | Sequence[int] = 0,
        name: str | None = None,
    ) -> Recording:
        """Drag and record in one step; see :meth:`drag` and :meth:`record`."""
        return self.record(self.drag(speed_m_s, gauge_pa, count=count, dwell_s=dwell_s), seed, name=name)

    def true_friction(
        self, speed_m_s: float | Array, pressure_a_pa: float | None = None, pressure_b_pa: float | None = None
    ) -> Array:
        """Return the friction of steady sliding at speeds and absolute pressures (None: ambient), at mid stroke, N."""
        d = self.description
        a, b = (d.ambient_pressure_pa if p is None else p for p in (pressure_a_pa, pressure_b_pa))
        gauges = (a - d.ambient_pressure_pa, b - d.ambient_pressure_pa)
        friction = steady_friction_n(core_friction(d), speed_m_s, gauges, 0.5 * d.stroke_m)
        return friction if np.ndim(speed_m_s) else friction[0]

    def _absolute(self, gauge_pa: float | tuple[float, float]) -> tuple[float, float]:
        pair = gauge_pa if isinstance(gauge_pa, tuple) else (gauge_pa, gauge_pa)
        absolute = tuple(float(p) + self.description.ambient_pressure_pa for p in pair)
        if len(absolute) != 2 or not all(np.isfinite(p) and p > 0.0 for p in absolute):
            raise CommandError(
                f"the chambers cannot be held at {pair} Pa gauge",
                rule="one gauge pressure for both chambers or a pair, above vacuum",
            )
        return absolute[0], absolute[1]


def sweep(
    rig: SimulatedRig,
    speeds_m_s: Iterable[float],
    gauges_pa: Iterable[float | tuple[float, float]] = (0.0,),
    *,
    count: int = 1,
    seed: int = 0,
) -> list[Recording]:
    """Measure every speed at every pressure.

    Parameters
    ----------
    rig : SimulatedRig
    speeds_m_s : iterable of float
    gauges_pa : iterable of float or (float, float)
        Gauge pressure in both chambers, or in a and b.
    count : int
        Cycles at each point; two or more show the scatter between strokes.
    seed : int
        Seed of the noise; each recording has an independent stream.

    Returns
    -------
    list of Recording
        Recordings in the given order, speeds varying fastest.
    """
    speeds = list(speeds_m_s)
    return [
        rig.measure(speed, gauge, count=count, seed=(seed, i, j))
        for i, gauge in enumerate(gauges_pa)
        for j, speed in enumerate(speeds)
    ]


def load_session(source: str, seed: int, pace: float | None) -> RigSession:
    """Return the session of a rig file; see `pneudrive.rig.load_rig`."""
    return SimulatedRig.load(source).session(seed, pace)
