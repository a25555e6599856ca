"""Fit problem: free values of the drive and its sensors, recordings, and residuals at a point."""

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
    """Recording in the fit; `noise` are the standard deviations that weight its channels."""

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
    """Point of the search: global coordinates (drive, then sensors) and the starts of all segments."""

    eta: Array
    states: list[Array]


class FitProblem:
    """Constant data of a fit, and the noise and weights of the samples.

    Parameters
    ----------
    parameters : list of Parameter
        Free values of the drive.
    sensors : list of SensorParameter
        Free values of the sensors.
    transforms : Transforms
        Transforms of both to coordinates.
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
        #: Prior precision of the coordinates: 0 without prior knowledge.
        self.prior_mean = np.zeros(self.size)
        self.prior = np.zeros(self.size)
        for i, s in enumerate(sensors, start=self.drive_size):
            if np.isfinite(s.uncertainty) and s.uncertainty > 0.0:
                self.prior[i] = (s.size / s.uncertainty) ** 2
        self.huber_k = np.inf
        #: Coordinates that are held for now.
        self.held = np.zeros(self.size, dtype=bool)

    @property
    def offsets(self) -> NDArray[np.bool_]:
        """Mask of coordinates that are offsets of sensors."""
        return np.array([False] * self.drive_size + [s.kind == "offset" for s in self.sensors])

    @property
    def names(self) -> list[str]:
        """Names of the global coordinates."""
        return [p.name for p in (*self.parameters, *self.sensors)]

    def values(self, eta: Array) -> Array:
        """Return the free values of the drive and the sensors, SI."""
        return self.transforms.natural(eta)

    def prior_cost(self, eta: Array) -> float:
        """Return the cost of the deviation from prior knowledge."""
        return float(self.prior @ (eta - self.prior_mean) ** 2)

    def robust_weight(self, residual: Array) -> Array:
        """Return the square roots of Huber's weights; 1 for plain least squares."""
        if not np.isfinite(self.huber_k):
            return np.ones_like(residual)
        return np.sqrt(np.minimum(1.0, self.huber_k / np.maximum(np.abs(residual), 1e-300)))

    def loss(self, residual: Array) -> float:
        """Return the sum of squares, or twice Huber's rho [huber2009]."""
        size, k = np.abs(residual), self.huber_k
        return float(np.sum(np.where(size <= k, size**2, 2.0 * k * size - k**2 if np.isfinite(k) else 0.0)))

    def rms(self, residuals: list[Array]) -> dict[str, float]:
        """Return the root mean square of each channel's residuals, SI."""
        power: dict[str, float] = {}
        count: dict[str, float] = {}
        for experiment, residual in zip(self.experiments, residuals, strict=True):
            for c, channel in enumerate(experiment.channels):
                own = float(np.sum((residual[:, c] * experiment.noise[c]) ** 2))
                power[channel.name] = power.get(channel.name, 0.0) + own
                count[channel.name] = count.get(channel.name, 0.0) + float(experiment.weight[:, c].sum())
        return {name: float(np.sqrt(power[name] / max(count[name], 1.0))) for name in power}

    def run(self, point: Iterate, *, derivatives: bool = True, reset: bool = False) -> list[Shot] | str:
        """Run all recordings; a text in the result is the reason of a failed segment.

        With `reset`, only unmeasured states continue from the previous segment, and derivatives by the starts cover
        only these.
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
        """Project unmeasured states onto their bounds."""
        states = [np.clip(s, *e.starts.limits) for s, e in zip(point.states, self.experiments, strict=True)]
        return Iterate(point.eta, states)

    def by_coordinates(self, index: int, shot_by_parameter: Array, eta: Array) -> Array:
        """Convert derivatives of a recording by the drive's values and the delay (last axis) to coordinates."""
        p = self.drive_size
        jacobian = self.transforms.jacobian(eta)[:p, :p]
        out = np.zeros((*shot_by_parameter.shape[:-1], self.size))
        out[..., :p] = shot_by_parameter[..., :p] @ jacobian
        if (place := self._delay_of(index)) is not None:
            out[..., place] = shot_by_parameter[..., p] * self.sensors[place - p].size
        return out

    def _delay_of(self, index: int) -> int | None:
        """Return the index of the free delay of a recording's command among the coordinates."""
        places = (i for i, s in enumerate(self.sensors, start=self.drive_size) if s.kind == "delay")
        return next((i for i in places if self.sensors[i - self.drive_size].recording == index), None)

    def measure(self, index: int, eta: Array, where: slice, outputs: Array, derivatives: Array) -> tuple[Array, Array]:
        """Pass outputs through the sensors and compare them with the measurements, in units of the noise.

        Parameters
        ----------
        index : int
            Recording.
        eta : ndarray, shape (P,)
        where : slice
            Samples.
        outputs : ndarray, shape (n, c)
        derivatives : ndarray, shape (n, c, P + more)
            Derivatives by the global coordinates (zeros for the sensors), then by others.

        Returns
        -------
        residual : ndarray, shape (n, c)
            (measured - model) / noise; 0 for missing measurements.
        derivatives : ndarray, shape (n, c, P + more)
            Derivatives of the model, over the noise.
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
