"""Conditions for measuring, and faults in the samples of a cycle on arrival: counted and named, never repaired.

The samples stay as recorded, and the counts go into the header of the cycle (``flags``). The analysis drops unusable
samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.rig.interface import CHANNELS, Move
from pneudrive.signals.recording import clipped, equal_runs, stuck_position, stuck_runs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Identity, Rig, RigState, Samples, Sampling

    Array = NDArray[np.float64]

#: Samples in a row with a force near its limit after which a cycle is given up: a single one is a disturbance.
IN_A_ROW = 3
#: Messages for a fault and for a rig that does not answer.
FAULT, NO_ANSWER = "fault of the rig", "the rig does not answer"


@dataclass(frozen=True)
class MeasuringBounds:
    """Conditions for measuring.

    Parameters
    ----------
    supply_pressure_pa : float
        Least absolute supply pressure; 0: not watched.
    temperature_k : (float, float)
    force_n : float
        Magnitude at which a cycle is given up, to protect sensor and rig.
    resume_force_n : float
        Magnitude below which the next attempt begins.
    """

    supply_pressure_pa: float
    temperature_k: tuple[float, float]
    force_n: float
    resume_force_n: float

    @classmethod
    def of(cls, protocol: Protocol, envelope: Envelope, ambient_pa: float) -> MeasuringBounds:
        """Return the tighter bounds of protocol and rig."""
        asked = protocol.conditions
        supply = asked.supply_pressure.absolute_pa(ambient_pa) if asked.supply_pressure is not None else 0.0
        low, high = envelope.temperature_k
        if asked.temperature_k is not None:
            low, high = max(low, asked.temperature_k[0]), min(high, asked.temperature_k[1])
        force = asked.force_share * min(envelope.force_n, protocol.limits.force_n or math.inf)
        return cls(max(supply, envelope.supply_pressure_pa), (low, high), force, 0.9 * force)

    def broken_by(self, state: RigState) -> str:
        """Return the condition that is not met, in words; empty if all are met. NaN meets none."""
        if state.fault:
            return f"{FAULT}: {state.fault}"
        if self.supply_pressure_pa > 0.0 and not state.supply_pressure_pa >= self.supply_pressure_pa:
            return (
                f"the supply pressure is {state.supply_pressure_pa / 1e5:.3g} bar absolute, "
                f"less than {self.supply_pressure_pa / 1e5:.3g} bar"
            )
        low, high = self.temperature_k
        if math.isfinite(high - low) and not low <= state.temperature_k <= high:
            return f"the temperature is {_celsius(state.temperature_k)}, not {_celsius(low)} to {_celsius(high)}"
        if not abs(state.force_n) < self.resume_force_n:
            return f"the force is {state.force_n:.4g} N, near the limit of {self.force_n:.4g} N"
        return ""

    def broken_by_samples(self, samples: Samples) -> str:
        """Return the condition that the samples of a running cycle violate; NaN is not checked."""
        with np.errstate(invalid="ignore"):
            force = np.abs(samples.force_n)
            high = force >= self.force_n
            if np.convolve(high, np.ones(IN_A_ROW), "valid").max(initial=0.0) >= IN_A_ROW:
                return f"the force reached {float(force[high].max()):.4g} N, near the limit of {self.force_n:.4g} N"
            temperature = samples.temperature_k
            outside = (temperature < self.temperature_k[0]) | (temperature > self.temperature_k[1])
            if outside.any():
                low, top = (_celsius(limit) for limit in self.temperature_k)
                return f"the temperature reached {_celsius(float(temperature[outside][0]))}, not {low} to {top}"
        return ""

    def during(self, samples: Samples, rig: Rig) -> str:
        """Check a running cycle by its latest samples and by the rig's state."""
        state = rig.state()
        if state.fault:
            return f"{FAULT}: {state.fault}"
        if self.supply_pressure_pa > 0.0 and state.supply_pressure_pa < self.supply_pressure_pa:
            return self.broken_by(state)
        return self.broken_by_samples(samples)


def look(rig: Rig, bounds: MeasuringBounds) -> str:
    """Query the state of the rig, and return the reason why measuring cannot continue, in words."""
    try:
        return bounds.broken_by(rig.state())
    except Exception as error:  # a laboratory's code may raise anything if the connection is lost
        return f"{NO_ANSWER}: {str(error).splitlines()[0] if str(error) else type(error).__name__}"


def _celsius(kelvin: float) -> str:
    return f"{kelvin - ZERO_CELSIUS_K:.4g} degC"


#: Flags and what they count.
FLAGS = {
    "non_finite": "samples with a value that is not a number",
    "duplicated": "samples that arrived twice, equal in every channel",
    "repeated_time": "samples with the time of the previous sample, but other values",
    "time_runs_back": "samples earlier than the previous sample: the clock jumped back",
    "dropped": "samples that are missing between two others",
    "saturated": "samples at an end of the sensor's range",
    "stuck": "samples at which a reading did not change while the axis moved",
    "too_few_samples": "samples missing in moves with less than a tenth of the requested samples",
    "steps_missing": "moves and holds without a sample",
    "target_missed": "moves that missed their target",
}
#: Serious flags: they make a cycle unusable, and a campaign stops after some such cycles in a row.
SERIOUS = frozenset(FLAGS) - {"duplicated", "dropped", "repeated_time"}

NEIGHBOURS = 8  # intervals on each side from which the usual one is found
LATE = 1.75  # gap in usual intervals at which a sample is missing
JITTER = 6.0  # median deviations of the intervals that are allowed in addition
LEAST_SHARE, LEAST_SAMPLES = 0.1, 20  # share of the requested samples in each move
MISSED_SHARE, MISSED_M = 0.05, 1e-3  # share of the length of a move, and addition


def arrival_flags(samples: Samples, cycle: Cycle, identity: Identity) -> dict[str, int]:
    """Count the faults in samples.

    Parameters
    ----------
    samples : Samples
        As recorded.
    cycle : Cycle
        As planned: its steps and sampling.
    identity : Identity
        Values of the rig: ``limits`` are the ranges of its sensors.

    Returns
    -------
    dict
        Flag of `FLAGS` -> count; flags with count 0 are absent.
    """
    table = np.stack([getattr(samples, name) for name in CHANNELS])
    timed = np.isfinite(table[0])
    counts = {"non_finite": int((~np.isfinite(table[:-1]).all(axis=0)).sum())}
    table, step = table[:, timed], samples.step[timed]
    fresh, counts["duplicated"] = _first_of_each(table, step)
    table, step = table[:, fresh], step[fresh]
    intervals = np.diff(table[0])
    counts["time_runs_back"] = int((intervals < 0.0).sum())
    counts["repeated_time"] = int((intervals == 0.0).sum())
    counts["dropped"] = _dropped(table[0], step, cycle)
    finite = np.isfinite(table[:-1]).all(axis=0)
    table, step = table[:, finite], step[finite]
    counts["saturated"], counts["stuck"] = _sensors(table, step, cycle, identity)
    counts |= _steps(table, step, cycle)
    return {name: counts[name] for name in FLAGS if counts.get(name)}


def _first_of_each(table: Array, step: NDArray[np.int64]) -> tuple[NDArray[np.bool_], int]:
    """Mark all samples except repetitions of an earlier sample in every channel."""
    order = np.argsort(table[0], kind="stable")
    ordered = table[:, order]
    with np.errstate(invalid="ignore"):
        same = (ordered[:, 1:] == ordered[:, :-1]) | (np.isnan(ordered[:, 1:]) & np.isnan(ordered[:, :-1]))
    again = same.all(axis=0) & (step[order][1:] == step[order][:-1])
    fresh = np.ones(step.size, dtype=bool)
    fresh[order[1:][again]] = False
    return fresh, int(again.sum())


def _dropped(time: Array, step: NDArray[np.int64], cycle: Cycle) -> int:
    """Count missing samples within steps, from intervals longer than usual in the step and than planned."""
    intervals = np.maximum(np.diff(time), 0.0)  # undefined if the clock jumps back
    if intervals.size < 2 * NEIGHBOURS:
        return 0
    usual = _usual_interval(intervals)
    deviation = float(np.median(np.abs(intervals - usual)))
    expected = np.maximum(usual, _planned_interval(time, step, cycle))
    late = (intervals > LATE * expected + JITTER * deviation) & (step[1:] == step[:-1]) & (expected > 0.0)
    return int(np.sum(np.maximum(np.rint(intervals[late] / expected[late]) - 1.0, 1.0)))


def _usual_interval(intervals: Array) -> Array:
    """Return the median of the intervals before or after each interval, whichever is longer.

    The rate may change between steps.
    """
    padded = np.pad(intervals, NEIGHBOURS, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    medians = np.median(windows, axis=1)
    return np.maximum(medians[: intervals.size], medians[NEIGHBOURS + 1 : NEIGHBOURS + 1 + intervals.size])


def _planned_interval(time: Array, step: NDArray[np.int64], cycle: Cycle) -> Array:
    """Return the interval between samples that the plan allows; 0 inside bursts and without a plan."""
    planned = np.zeros(time.size - 1)
    sampling: Sampling = cycle.sampling
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(step == number)
        if members.size < 2:
            continue
        begin, end = time[members[0]], time[members[-1]]
        moving = isinstance(one, Move)
        planned_s = (end - begin) / sampling.samples_per_stroke if moving else 1.0 / sampling.hold_rate_hz
        inside = members[:-1]
        early = time[inside + 1] - begin <= sampling.burst_after_s
        late = end - time[inside] <= sampling.burst_before_s
        burst = (early | late) if sampling.burst_rate_hz > 0.0 else np.zeros(inside.size, dtype=bool)
        planned[inside[~burst]] = planned_s
    return planned


def _sensors(table: Array, step: NDArray[np.int64], cycle: Cycle, identity: Identity) -> tuple[int, int]:
    """Count saturated and stuck samples over all sensors."""
    saturated, stuck = np.zeros(step.size, dtype=bool), np.zeros(step.size, dtype=bool)
    if not step.size:
        return 0, 0
    position = table[CHANNELS.index("position_m")]
    moves = [number for number, one in enumerate(cycle.steps) if isinstance(one, Move)]
    moving = np.isin(step, moves)
    travels = moving.any() and np.ptp(position[moving]) > 0.0
    for name, values in zip(CHANNELS[1:-1], table[1:-1], strict=True):
        runs = equal_runs(values)
        full = np.zeros(step.size, dtype=bool)
        if name in identity.limits:
            low, high = identity.limits[name]
            margin = 0.5 * identity.resolution.get(name, 0.0)
            full = (values <= low + margin) | (values >= high - margin)
        elif name == "force_n":
            full = clipped(values, runs)
        saturated |= full
        if name == "position_m":
            stuck |= stuck_position(position, runs) & travels
            for members in (step == number for number in moves):  # constant over a whole move
                stuck |= members & (members.any() and np.ptp(values[members]) == 0.0)
        elif travels and (name == "force_n" or np.ptp(values) > 0.0):  # an unmeasured pressure never changes
            stuck |= stuck_runs(position, runs) & moving & ~full
    return int(saturated.sum()), int(stuck.sum())


def _steps(table: Array, step: NDArray[np.int64], cycle: Cycle) -> dict[str, int]:
    """Compare the samples with the requested steps."""
    counts = {"steps_missing": 0, "too_few_samples": 0, "target_missed": 0}
    asked, at = cycle.sampling.samples_per_stroke, cycle.start_m
    position = table[CHANNELS.index("position_m")]
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(step == number)
        begin = at
        if isinstance(one, Move):
            at = one.to_m
            if members.size < max(LEAST_SHARE * asked, LEAST_SAMPLES):
                counts["too_few_samples"] += max(asked - members.size, 1)
            way = abs(one.to_m - begin) if begin is not None else 0.0
            if members.size and abs(position[members[-1]] - one.to_m) > MISSED_SHARE * way + MISSED_M:
                counts["target_missed"] += 1
        elif one.duration_s * cycle.sampling.hold_rate_hz < 1.0:
            continue
        counts["steps_missing"] += not members.size
    return counts


def serious(flags: Sequence[str] | dict[str, int]) -> list[str]:
    """Return the serious flags among these."""
    return [name for name in flags if name in SERIOUS]
