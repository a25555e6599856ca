"""The problem: free values of the drive and its sensors, recordings, and the residuals at a point."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.dynamic.sensors import lagged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.estimate.transforms import Transforms
    from pneudrive.free.parameters import Parameter
    from pneudrive.identify.dynamic.sensors import Channel, SensorParameter
    from pneudrive.identify.dynamic.shooting import Shooter, Shot
    from pneudrive.identify.dynamic.states import SegmentStarts

    Array = NDArray[np.float64]


@dataclass
class FittedRecording:
    """One recording in the fit; `noise` are the standard deviations that weigh its channels."""

    shooter: Shooter
    channels: list[Channel]
    starts: SegmentStarts
    noise: Array
    measured: Array = field(init=False)
    weight: Array = field(init=False)

    def __post_init__(self) -> None:
        recording = self.shooter.recording
        self.measured = np.stack([recording[c.column] for c in self.channels], axis=1)
        self.weight = np.isfinite(self.measured).astype(float)

    @property
    def segments(self) -> list[slice]:
        """Samples of each segment."""
        edges = [*self.shooter.starts.tolist(), self.measured.shape[0]]
        return [slice(a, b) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class Iterate:
    """A point of the search: global coordinates (drive, then sensors) and the starts of all segments."""

    eta: Array
    states: list[Array]


class FitProblem:
    """Everything that does not change during a fit but the noise and the weights of the samples.

    Parameters
    ----------
    parameters : list of Parameter
        Free values of the drive.
    sensors : list of SensorParameter
        Free values of its sensors.
    transforms : Transforms
        Coordinates of both.
    experiments : list of FittedRecording
    """

    def __init__(
        self,
        parameters: list[Parameter],
        sensors: list[SensorParameter],
        transforms: Transforms,
        experiments: list[FittedRecording],
    ) -> None:
        self.parameters, self.sensors, self.transforms = parameters, sensors, transforms
        self.experiments = experiments
        self.drive_size = len(parameters)
        self.size = self.drive_size + len(sensors)
        #: Coordinates that are known before the fit, and how precisely: 0 where nothing is known.
        self.prior_mean = np.zeros(self.size)
        self.prior = np.zeros(self.size)
        for i, s in enumerate(sensors, start=self.drive_size):
            if np.isfinite(s.uncertainty) and s.uncertainty > 0.0:
                self.prior[i] = (s.size / s.uncertainty) ** 2
        self.huber_k = np.inf
        #: Coordinates that stay as they are, for a while.
        self.held = np.zeros(self.size, dtype=bool)

    @property
    def offsets(self) -> NDArray[np.bool_]:
        """Coordinates that are offsets of sensors."""
        return np.array([False] * self.drive_size + [s.kind == "offset" for s in self.sensors])

    @property
    def names(self) -> list[str]:
        """Of the global coordinates."""
        return [p.name for p in (*self.parameters, *self.sensors)]

    def values(self, eta: Array) -> Array:
        """Free values of the drive and the sensors, SI."""
        return self.transforms.natural(eta)

    def prior_cost(self, eta: Array) -> float:
        """Cost of being away from what is known before the fit."""
        return float(self.prior @ (eta - self.prior_mean) ** 2)

    def robust_weight(self, residual: Array) -> Array:
        """Square roots of Huber's weights; 1 where the fit is plain least squares."""
        if not np.isfinite(self.huber_k):
            return np.ones_like(residual)
        return np.sqrt(np.minimum(1.0, self.huber_k / np.maximum(np.abs(residual), 1e-300)))

    def loss(self, residual: Array) -> float:
        """Sum of squares, or twice Huber's rho [huber2009]."""
        size, k = np.abs(residual), self.huber_k
        return float(np.sum(np.where(size <= k, size**2, 2.0 * k * size - k**2 if np.isfinite(k) else 0.0)))

    def rms(self, residuals: list[Array]) -> dict[str, float]:
        """Root mean square of each channel's residuals, SI."""
        power: dict[str, float] = {}
        count: dict[str, float] = {}
        for experiment, residual in zip(self.experiments, residuals, strict=True):
            for c, channel in enumerate(experiment.channels):
                own = float(np.sum((residual[:, c] * experiment.noise[c]) ** 2))
                power[channel.name] = power.get(channel.name, 0.0) + own
                count[channel.name] = count.get(channel.name, 0.0) + float(experiment.weight[:, c].sum())
        return {name: float(np.sqrt(power[name] / max(count[name], 1.0))) for name in power}

    def run(self, point: Iterate, *, derivatives: bool = True, reset: bool = False) -> list[Shot] | str:
        """Run all recordings; a text says why a segment could not be run.

        With `reset`, derivatives by the starts are by what nothing measures, as only that is carried over.
        """
        values = self.values(point.eta)
        shots = []
        for i, (experiment, states) in enumerate(zip(self.experiments, point.states, strict=True)):
            place = self._delay_of(i)
            delay_s = None if place is None else float(values[place])
            hidden = np.flatnonzero(~experiment.starts.measured) if reset else None
            shot = experiment.shooter.run(
                values[: self.drive_size], states, derivatives=derivatives, by_start=hidden, delay_s=delay_s
            )
            if shot.failures:
                j, why = next(iter(shot.failures.items()))
                record = experiment.shooter.recording
                return f"{record.name}, segment from {record.time_s[experiment.shooter.starts[j]]:g} s: {why}"
            shots.append(shot)
        return shots

    def possible(self, point: Iterate) -> Iterate:
        """Keep what nothing measures within what is possible."""
        states = [np.clip(s, *e.starts.limits) for s, e in zip(point.states, self.experiments, strict=True)]
        return Iterate(point.eta, states)

    def by_coordinates(self, index: int, shot_by_parameter: Array, eta: Array) -> Array:
        """Turn derivatives of a recording by the drive's values and the delay (last axis) into such by coordinates."""
        p = self.drive_size
        jacobian = self.transforms.jacobian(eta)[:p, :p]
        out = np.zeros((*shot_by_parameter.shape[:-1], self.size))
        out[..., :p] = shot_by_parameter[..., :p] @ jacobian
        if (place := self._delay_of(index)) is not None:
            out[..., place] = shot_by_parameter[..., p] * self.sensors[place - p].size
        return out

    def _delay_of(self, index: int) -> int | None:
        """Place of the free delay of a recording's command among the coordinates."""
        places = (i for i, s in enumerate(self.sensors, start=self.drive_size) if s.kind == "delay")
        return next((i for i in places if self.sensors[i - self.drive_size].recording == index), None)

    def measure(self, index: int, eta: Array, where: slice, outputs: Array, derivatives: Array) -> tuple[Array, Array]:
        """Pass outputs through the sensors and compare them with what was measured, in units of the noise.

        Parameters
        ----------
        index : int
            Recording.
        eta : ndarray, shape (P,)
        where : slice
            Samples.
        outputs : ndarray, shape (n, c)
        derivatives : ndarray, shape (n, c, P + more)
            By the global coordinates (of the sensors: zeros), then by whatever else.

        Returns
        -------
        residual : ndarray, shape (n, c)
            (measured - model) / noise; 0 where nothing was measured.
        derivatives : ndarray, shape (n, c, P + more)
            Of the model, over the noise.
        """
        experiment, values = self.experiments[index], self.values(eta)
        time = experiment.shooter.recording.time_s[where]
        model, slopes = np.empty_like(outputs), np.empty_like(derivatives)
        for c, channel in enumerate(experiment.channels):
            number = {s.kind: i for i, s in enumerate(self.sensors) if self._is_of(s, channel.name, index)}
            gain, lag, offset = (
                float(values[self.drive_size + number[k]]) if k in number else getattr(channel, k)
                for k in ("gain", "lag", "offset")
            )
            h = lagged(time, outputs[:, c], lag)
            model[:, c] = gain * h + offset
            slopes[:, c] = gain * lagged(time, derivatives[:, c], lag)
            if "offset" in number:
                i = self.drive_size + number["offset"]
                slopes[:, c, i] += self.sensors[number["offset"]].size
            if "gain" in number:
                slopes[:, c, self.drive_size + number["gain"]] += h
            if "lag" in number:  # differentiate lag h' + h = u by the lag
                rate = (outputs[:, c] - h) / lag
                slopes[:, c, self.drive_size + number["lag"]] -= gain * lag * lagged(time, rate, lag)
        weight = experiment.weight[where] / experiment.noise
        residual = np.where(weight > 0.0, experiment.measured[where] - model, 0.0) * weight
        return residual, slopes * weight[:, :, None]

    @staticmethod
    def _is_of(s: SensorParameter, channel: str, index: int) -> bool:
        return s.channel == channel and s.recording in (None, index)
