"""Force balance of a dragged piston: closure of measured force, pressures and parallel forces, and likely errors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.estimate.estimates import Estimate
from pneudrive.signals.motion import NOISE_FACTOR, local_slope, noise_level
from pneudrive.signals.pressure_delay import pressure_delay

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.pressure_delay import PressureDelay
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

INSIDE = 0.12  # of the travel, at both ends, where the motion turns
SLOWEST = 0.03  # of the largest speed: slower samples do not slide
SLOPE_S = 0.06  # half width of the slope that is the speed, s
ONE_SPEED = 1.3  # speeds of a direction within this ratio do not determine a slope
BLOCK_S = 5.0  # blocks of time for the covariance
TARGET = 0.01  # of the force range (assumed)
CLEARLY = 0.5  # another reading is the cause if its residual is below this share
VISIBLE = 3.0  # the gas force must change by this multiple of the friction for its gain to count


@dataclass(frozen=True)
class Closure:
    """Balance of one recording.

    Attributes
    ----------
    name : str
    rms_n, share : float
        Residual at declared areas, with an offset and friction ``d + e |v|`` per direction: N, share of the range.
    friction_n : dict
        Direction -> friction at rest and its slope over speed, N and N s/m.
    offset_n : float
    gains : dict
        Parallel force -> its gain if it is free, with its 95 % interval; ``gas`` that of the gas force.
    viscous : Estimate
        Slope of the friction in +x while the gains are free, N s/m.
    correlation : float or None
        Of the first parallel force's gain with that slope.
    range_n, fastest_m_s : float
        Range of the measured force; largest speed in sliding.
    time_s, residual_n : ndarray
        Residuals of the samples in sliding.
    doubts : tuple of str
        Likely causes of a balance that does not close.
    delay : PressureDelay or None
        Delay of the pressures of closed chambers after the motion. A clear delay was removed before the balance.
    recorded : Closure or None
        Balance with the delay of the recording, if a clear delay was removed.
    """

    name: str
    rms_n: float
    share: float
    friction_n: dict[int, tuple[float, float]]
    offset_n: float
    gains: dict[str, Estimate]
    viscous: Estimate
    correlation: float | None
    range_n: float
    fastest_m_s: float
    time_s: Array = field(repr=False)
    residual_n: Array = field(repr=False)
    doubts: tuple[str, ...] = ()
    delay: PressureDelay | None = None
    recorded: Closure | None = field(default=None, repr=False)

    def friction_at(self, speed_m_s: float) -> float:
        """Return the friction at a speed in its direction, N, positive if it opposes the motion."""
        at_rest, slope = self.friction_n[1 if speed_m_s > 0.0 else -1]
        return at_rest + slope * abs(speed_m_s)

    def __str__(self) -> str:
        """Return the result in sentences."""
        lines = [
            f"{self.name}: the balance closes within {self.rms_n:.3g} N, {100 * self.share:.2f} % of the force range"
        ]
        if self.recorded is not None:
            lines.append(f"{self.delay}: this delay is removed")
            for way in self.friction_n:
                speed = way * self.fastest_m_s
                lines.append(
                    f"friction at {speed:.2g} m/s: {self.friction_at(speed):.4g} N, with the delay as recorded "
                    f"{self.recorded.friction_at(speed):.4g} N"
                )
        for name, gain in self.gains.items():
            lines.append(f"gain of {name}, if free: {gain.value:.3f} [{gain.low:.3f}, {gain.high:.3f}]")
        if self.correlation is not None:
            lines.append(
                f"this gain and the viscous friction correlate at {self.correlation:.2f}: friction over speed depends "
                "on the stated area"
            )
        return "; ".join([*lines, *self.doubts])


def close_balance(recording: Recording) -> Closure:
    """Return the force balance of a recording.

    A clear delay between the pressures of closed chambers and the motion is removed first. Force and position are
    assumed to have one clock.

    Parameters
    ----------
    recording : Recording
        With force, pressures and parallel forces.
    """
    delay, begin = pressure_delay(recording), float(recording.time_s[0])
    if delay is None or not delay.is_clear:
        return replace(_balance(recording, begin), delay=delay)
    return replace(_balance(delay.removed(recording), begin), delay=delay, recorded=_balance(recording, begin))


def _balance(recording: Recording, begin_s: float) -> Closure:
    """Return the balance of a recording as it is; times count from `begin_s`."""
    time = recording.time_s - begin_s
    sliding = _sliding(recording, time)
    base, balance = sliding.base, recording.balance_n()[sliding.use]
    found, *_ = np.linalg.lstsq(base, balance, rcond=None)
    residual = balance - base @ found
    span, rms = float(np.ptp(recording.force_n)) or 1.0, float(np.sqrt(np.mean(residual**2)))
    value = dict(zip(sliding.names, found.tolist(), strict=True))
    friction, offset = _friction(value)
    extra = {force.name: -force.force_n[sliding.use] for force in recording.parallel}
    gas = _gas(recording)[sliding.use]
    least = [abs(d) for d, _ in friction.values() if np.isfinite(d)]
    if np.ptp(gas) > VISIBLE * max(*least, NOISE_FACTOR * noise_level(recording.force_n)):
        extra["gas"] = -gas
    gains, viscous, correlation = _free_gains(time[sliding.use], sliding, balance, extra)
    doubts = tuple(_doubts(recording, sliding, rms / span))
    return Closure(
        recording.name, rms, rms / span, friction, offset, gains, viscous, correlation, span,
        float(np.abs(sliding.speed).max()), time[sliding.use], residual, doubts,
    )  # fmt: skip


class _Sliding(NamedTuple):
    """Samples in sliding, the columns of friction with their names, and the signed speed."""

    use: NDArray[np.bool_]
    base: Array
    names: list[str]
    speed: Array


def _sliding(recording: Recording, time: Array) -> _Sliding:
    usual = float(np.median(np.diff(time)))
    speed = local_slope(time, recording.position_m, max(int(SLOPE_S / usual), 1))
    inside = (recording.position_m - recording.position_m.min()) / np.ptp(recording.position_m)
    use = (inside > INSIDE) & (inside < 1.0 - INSIDE) & (np.abs(speed) > SLOWEST * np.abs(speed).max())
    v, columns = speed[use], {}
    for way in (1, -1):
        there = np.sign(v) == way
        if there.any():
            columns[f"d{way}"] = there * 1.0
            low, high = np.quantile(np.abs(v[there]), (0.05, 0.95))
            if high > ONE_SPEED * low:
                columns[f"e{way}"] = np.where(there, v, 0.0)
    return _Sliding(use, np.column_stack([*columns.values()]), list(columns), v)


def _friction(value: dict[str, float]) -> tuple[dict[int, tuple[float, float]], float]:
    """Return friction at rest and its slope by direction, and the offset: half the sum of both directions."""
    both = "d1" in value and "d-1" in value
    offset = 0.5 * (value["d1"] + value["d-1"]) if both else 0.0
    found = {
        way: (way * (value[f"d{way}"] - offset), value.get(f"e{way}", 0.0)) for way in (1, -1) if f"d{way}" in value
    }
    return found, offset


def _gas(recording: Recording) -> Array:
    ambient = recording.ambient_pressure_pa
    a = recording.area_a_m2 * (recording.pressure_a_pa - ambient)
    return a - recording.area_b_m2 * (recording.pressure_b_pa - ambient)


def _free_gains(
    time_s: Array, sliding: _Sliding, balance: Array, extra: dict[str, Array]
) -> tuple[dict[str, Estimate], Estimate, float | None]:
    """Return gains of forces relative to their stated areas, with blocks of time for their covariance."""
    base, names = sliding.base, sliding.names
    matrix = np.column_stack([base, *extra.values()])
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    inverse = np.linalg.pinv((matrix / scale).T @ (matrix / scale))
    solution = inverse @ ((matrix / scale).T @ balance)
    rest = balance - (matrix / scale) @ solution
    edges = np.unique(np.floor(time_s / BLOCK_S), return_index=True)[1]
    scores = np.add.reduceat((matrix / scale) * rest[:, None], edges, axis=0)
    blocks = len(edges)
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / max(blocks - matrix.shape[1], 1)
    value, deviation = solution / scale, np.sqrt(np.diag(covariance)) / scale
    freedom, n = max(blocks - matrix.shape[1], 3), base.shape[1]
    gains = {
        name: Estimate.of(1.0 + float(value[n + i]), float(deviation[n + i]), freedom, "")
        for i, name in enumerate(extra)
    }
    place = names.index("e1") if "e1" in names else len(names) - 1
    viscous = Estimate.of(float(value[place]), float(deviation[place]), freedom, "N s/m")
    if not extra or next(iter(extra)) == "gas":
        return gains, viscous, None
    correlation = covariance[place, n] / np.sqrt(covariance[place, place] * covariance[n, n])
    return gains, viscous, float(correlation)


def _doubts(recording: Recording, sliding: _Sliding, share: float) -> list[str]:
    """Return likely causes of a balance that does not close, or in which friction drives the motion."""
    at, base = sliding.use, sliding.base
    if share < TARGET and _drives(base, recording.balance_n()[at], sliding) > 0.0:
        return []
    turned = replace(recording, force_n=-recording.force_n)
    swapped = replace(recording, pressure_a_pa=recording.pressure_b_pa, pressure_b_pa=recording.pressure_a_pa)
    others = {'the force has the other sign: change its "positive" in the layout': turned}
    others["pressure_a and pressure_b are swapped"] = swapped
    for place, force in enumerate(recording.parallel):
        parallel = list(recording.parallel)
        parallel[place] = force._replace(force_n=-force.force_n)
        others[f'the {force.name} acts in the other direction: change its "positive" in the layout'] = replace(
            recording, parallel=tuple(parallel)
        )
    span, sizes = float(np.ptp(recording.force_n)) or 1.0, {}
    for words, other in others.items():
        balance = other.balance_n()[at]
        if _drives(base, balance, sliding) > 0.0:
            rest = balance - base @ np.linalg.lstsq(base, balance, rcond=None)[0]
            sizes[words] = float(np.sqrt(np.mean(rest**2))) / span
    best = min(sizes, key=lambda words: sizes[words], default="")
    if best and (sizes[best] < CLEARLY * share or share < TARGET):
        return [f"{best}: the balance would close within {100 * sizes[best]:.2f} % of the force range"]
    if share < TARGET:
        return ["friction would drive the motion: check the signs of force and position"]
    return [
        "the residual depends on speed and direction like a force in parallel that the layout lacks, such as that of a "
        "hydraulic ram: describe it as [[force]]"
    ]


def _drives(base: Array, balance: Array, sliding: _Sliding) -> float:
    """Return the mean power of the fitted friction, positive if it brakes."""
    found, *_ = np.linalg.lstsq(base, balance, rcond=None)
    return float(np.mean((base @ found) * sliding.speed))
