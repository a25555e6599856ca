"""One attempt at a cycle on the rig's thread: move to the start, run the steps, return the samples.

The module also checks the measuring conditions and counts faults in new samples.

The samples stay as recorded, and the counts go into the header of the cycle (``flags``). The analysis drops unusable
samples.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any

import numpy as np

from pneudrive.arrays import Array, Bools, Ints, Pair, Plain
from pneudrive.campaign.cycle import WORDS, Cycle, Head
from pneudrive.campaign.storage.control import now
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import PneudriveError, RigError
from pneudrive.own_code import place_of
from pneudrive.rig import Changeable, Envelope, Identity, Reproducible, Rig, RigState
from pneudrive.rig.interface import CHANNELS, JobThread, Move, Samples, as_json, closed_after, has_verbs
from pneudrive.signals.recording import clipped, equal_runs, stuck_position, stuck_runs

#: Longest wait for a rig to come to rest, s. After this time, the campaign ends although the rig may still move.
STOP_S = 30.0


def _stopped(rig: Rig) -> str:
    """Stop a rig within `STOP_S`. Return the error in words, or an empty text."""
    thread = JobThread("pneudrive-stop")
    answer = thread.start(rig.stop)
    thread.close()
    try:
        answer.result(STOP_S)
    except Exception as error:  # no error of a laboratory's code may stop this
        silent = f"the rig did not answer within {STOP_S:g} s"
        return (str(error) or type(error).__name__) if answer.done() else silent
    return ""


#: Distance to the start of a cycle below which the axis is not moved, m: a short move would disturb the seal.
AT_START_M = 1e-4
#: Speed of the move to the start of a cycle, m/s; lower on a slower rig.
TO_START_M_S = 0.05


class GiveUpError(Exception):
    """The cycle was abandoned; the message states the reason."""


class Attempts:
    """Attempts at cycles, and the state of the rig between two cycles.

    The rig's methods run on one thread, one job after the other. Other threads may only call `Rig.stop`, at any time.

    Parameters
    ----------
    rig : Rig
    bounds : Envelope
        Conditions for measuring.
    show : callable
        Called with each part of the samples.
    """

    def __init__(self, rig: Rig, bounds: Envelope, show: Callable[[Samples], None]) -> None:
        self.rig, self._bounds, self._show = rig, bounds, show
        self._interrupted, self._at_rest = threading.Event(), False  # whether the present job must end soon
        self._thread = JobThread("pneudrive-rig")
        self._last: Future[Any] = self._thread.start(lambda: None)
        self._memory: Plain = {}  # snapshot after the last finished cycle, or before the first one
        self._pressures_after: Pair | None = None  # after the last finished cycle
        self._pressures: Pair | None = None  # in the chambers now, if known
        self.homed = self._whole = False  # whether the axis is homed; whether the last cycle was completed

    def start(self, job: Callable[[Rig], Any], *, moves: bool = True) -> Future[Any]:
        """Run a job on the rig's thread after the previous job.

        Parameters
        ----------
        job : callable
            Function of the rig.
        moves : bool
            Whether the job may move the axis or change the pressure.
        """
        self._interrupted.clear()
        self._at_rest = self._at_rest and not moves
        self._last = self._thread.start(lambda: job(self.rig))
        return self._last

    def rest(self) -> str:
        """Bring the axis to rest and release the pressure immediately.

        Returns
        -------
        str
            Reason why the rig may not be at rest, in words; empty if it is at rest.
        """
        trouble = "" if self._at_rest else self._stop()
        self._at_rest = not trouble
        self._pressures = None
        self.homed = self.homed and self._whole
        return trouble

    def _stop(self) -> str:
        self._interrupted.set()
        trouble = _stopped(self.rig)
        if self._last.done():
            return trouble
        wait([self._last], STOP_S)
        if not self._last.done():
            return trouble or f"the rig did not return within {STOP_S:g} s"
        return _stopped(self.rig)  # a verb under way may have started the axis again

    def close(self) -> None:
        """End the rig's thread after its work."""
        self._thread.close()

    def run(self, rig: Rig, cycle: Cycle, settling_s: float, number: int) -> tuple[Head, Samples]:
        """Bring the rig to the start of a cycle, run its steps and return header and samples.

        For an operator's step, inform the rig of the changed level. Index and flags of the header are filled in later.
        `number` counts the attempts at the cycle.

        Raises
        ------
        GiveUpError
            If samples or the state of the rig are out of bounds, or the axis was stopped.
        """
        self._whole, started = False, now()
        if not self.homed:
            rig.home()
            self.homed = True
        if has_verbs(rig, Reproducible):
            self._memory = self._memory or as_plain(rig.memory())
            rig.restore(as_plain(self._memory))
            self._pressures = self._pressures_after
            rig.begin_cycle(cycle.key)
        if cycle.start_m is not None and abs(rig.state().position_m - cycle.start_m) > AT_START_M:
            rig.move(cycle.start_m, min(TO_START_M_S, rig.limits().speed_m_s))
        if cycle.steps:
            wanted = cycle.pressures_pa
            rig.set_pressure(*wanted)
            if settling_s > 0.0 and wanted != self._pressures:  # they settle after a change
                rig.hold(settling_s)
            self._pressures = wanted
            began_s = rig.state().time_s
            samples = self._acquire(rig, cycle)
        else:
            factor = cycle.key.rpartition("/")[2]  # b2/operator/seal: other factors stay unchanged
            if has_verbs(rig, Changeable) and factor in cycle.levels:
                rig.change({factor: cycle.levels[factor]})
            began_s, samples = rig.state().time_s, Samples.join([])
        memory = as_plain(rig.memory()) if has_verbs(rig, Reproducible) else {}
        self._whole = True
        return Head(0, cycle, began_s, started, memory=memory, attempts=number), samples

    def _acquire(self, rig: Rig, cycle: Cycle) -> Samples:
        parts: list[Samples] = []
        with closed_after(rig.acquire(cycle.steps, cycle.sampling)) as acquired:
            for given in acquired:
                parts.append(Samples.of(given))
                self._go_on()
                if wrong := broken_during(self._bounds, parts[-1], rig):
                    raise GiveUpError(wrong)
                self._show(parts[-1])
            self._go_on()  # the rig may have ended early on a request
        return Samples.join(parts)

    def _go_on(self) -> None:
        if self._interrupted.is_set():
            raise GiveUpError("the axis was stopped")

    def finished(self, head: Head) -> None:
        """Record that a cycle is finished, now or in an earlier run.

        The next cycle starts from the end state of this cycle.
        """
        self._memory = dict(head.memory)
        self._pressures_after = head.cycle.pressures_pa


def as_plain(memory: Plain) -> Plain:
    """Return the saved state after conversion to JSON and back, so that a resumed campaign equals an uninterrupted one.

    Raises
    ------
    RigError
        If JSON cannot represent the saved state.
    """
    try:
        return as_json(memory)
    except (TypeError, ValueError) as error:
        raise RigError(
            "the saved state of the rig cannot be stored",
            value=str(error),
            rule="a saved state must be plain data that JSON supports",
        ) from None


def rig_error(error: BaseException) -> PneudriveError:
    """Return an error of pneudrive unchanged; convert an error of custom code to a RigError."""
    if isinstance(error, PneudriveError):
        return error
    what = f"the custom code of the rig failed: {type(error).__name__}: {error}"
    wrapped = RigError(what, where=place_of(error))
    wrapped.__cause__ = error
    return wrapped


# --- Conditions for measuring, and faults in the samples of a cycle on arrival.

#: Number of consecutive samples near the force limit that abandons a cycle. A single sample may be a disturbance.
IN_A_ROW = 3
#: Fraction of the largest force below which an attempt may begin.
RESUME_SHARE = 0.9
#: Beginnings of reasons that state a failure of the rig, not a condition that is not met.
FAILURES = FAULT, NO_ANSWER = "fault of the rig", "the rig does not answer"


def broken_condition(bounds: Envelope, state: RigState) -> str:
    """Return, in words, a condition for measuring that is not met; empty if all are met.

    NaN does not meet a condition. The largest force is that at which a cycle is abandoned, to protect sensor and rig.
    """
    if state.fault:
        return f"{FAULT}: {state.fault}"
    if bounds.supply_pressure_pa > 0.0 and not state.supply_pressure_pa >= bounds.supply_pressure_pa:
        return (
            f"the supply pressure is {state.supply_pressure_pa / 1e5:.3g} bar absolute, "
            f"less than {bounds.supply_pressure_pa / 1e5:.3g} bar"
        )
    low, high = bounds.temperature_k
    if math.isfinite(high - low) and not low <= state.temperature_k <= high:
        return f"the temperature is {_celsius(state.temperature_k)}, not {_celsius(low)} to {_celsius(high)}"
    if not abs(state.force_n) < RESUME_SHARE * bounds.force_n:
        return f"the force is {state.force_n:.4g} N, near the limit of {bounds.force_n:.4g} N"
    return ""


def broken_during(bounds: Envelope, samples: Samples, rig: Rig) -> str:
    """Return the condition that the state or the new samples of a running cycle violate. NaN violates no condition."""
    state = rig.state()
    if state.fault or (bounds.supply_pressure_pa > 0.0 and state.supply_pressure_pa < bounds.supply_pressure_pa):
        return broken_condition(bounds, state)
    with np.errstate(invalid="ignore"):
        force = np.abs(samples.force_n)
        high = force >= bounds.force_n
        if np.convolve(high, np.ones(IN_A_ROW), "valid").max(initial=0.0) >= IN_A_ROW:
            return f"the force reached {float(force[high].max()):.4g} N; the limit is {bounds.force_n:.4g} N"
        (low, top), temperature = bounds.temperature_k, samples.temperature_k
        outside = (temperature < low) | (temperature > top)
        if outside.any():
            reached = _celsius(float(temperature[outside][0]))
            return f"the temperature reached {reached}, not {_celsius(low)} to {_celsius(top)}"
    return ""


def trouble_of(bounds: Envelope, rig: Rig) -> str:
    """Query the state of the rig. Return the reason why measuring cannot continue; empty if it can."""
    try:
        return broken_condition(bounds, rig.state())
    except Exception as error:  # a laboratory's code may raise anything if the connection is lost
        return f"{NO_ANSWER}: {str(error).splitlines()[0] if str(error) else type(error).__name__}"


def _celsius(kelvin: float) -> str:
    return f"{kelvin - ZERO_CELSIUS_K:.4g} degC"


#: Meaning of each flag.
FLAGS = WORDS["flags"]
#: Serious flags: they make a cycle unusable, and several such cycles in a row end the campaign.
SERIOUS = frozenset(FLAGS) - {"duplicated", "dropped", "repeated_time"}

NEIGHBOURS = 8  # intervals on each side from which the usual one is found
LATE = 1.75  # gap in usual intervals at which a sample is missing
JITTER = 6.0  # median deviations of the intervals that are allowed in addition
LEAST_SHARE, LEAST_SAMPLES = 0.1, 20  # share of the requested samples in each move
MISSED_SHARE, MISSED_M = 0.05, 1e-3  # share of the length of a move, and addition


def arrival_flags(samples: Samples, cycle: Cycle, identity: Identity) -> dict[str, int]:
    """Count the faults in the samples of a cycle.

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
    import polars as pl

    counts = {"non_finite": int((~_measured(samples)).sum())}
    samples = samples.rows(np.isfinite(samples.time_s))
    # A sample that repeats an earlier one in every channel was sent twice.
    is_first = pl.struct(pl.all()).is_first_distinct()
    fresh = pl.DataFrame(vars(samples)).select(is_first).to_series().to_numpy()
    counts["duplicated"], samples = int((~fresh).sum()), samples.rows(fresh)
    intervals = np.diff(samples.time_s)
    counts["time_runs_back"] = int((intervals < 0.0).sum())
    counts["repeated_time"] = int((intervals == 0.0).sum())
    counts["dropped"] = _dropped(samples.time_s, samples.step, cycle)
    samples = samples.rows(_measured(samples))
    counts["saturated"], counts["stuck"] = _sensors(samples, cycle, identity)
    counts |= _steps(samples, cycle)
    return {name: counts[name] for name in FLAGS if counts.get(name)}


def _measured(samples: Samples) -> Bools:
    """Mark the samples that are finite in all channels except temperature, which not every rig measures."""
    return np.all([np.isfinite(getattr(samples, name)) for name in CHANNELS[:-1]], axis=0)


def _dropped(time: Array, step: Ints, cycle: Cycle) -> int:
    """Count missing samples within steps, from intervals that exceed both the usual and the planned interval."""
    intervals = np.maximum(np.diff(time), 0.0)  # undefined if the clock jumps back
    if intervals.size < 2 * NEIGHBOURS:
        return 0
    # The larger of the medians of the intervals before and after each interval: the rate may change between steps.
    padded = np.pad(intervals, NEIGHBOURS, mode="edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS), axis=1)
    after = medians[NEIGHBOURS + 1 : NEIGHBOURS + 1 + intervals.size]
    usual = np.maximum(medians[: intervals.size], after)
    deviation = float(np.median(np.abs(intervals - usual)))
    planned, sampling = np.zeros(time.size - 1), cycle.sampling  # 0 inside bursts and without a plan
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(step == number)
        if members.size < 2:
            continue
        begin = time[members[0]]
        end = time[members[-1]]
        inside = members[:-1]
        moving = isinstance(one, Move)
        planned_s = (end - begin) / sampling.samples_per_stroke if moving else 1.0 / sampling.hold_rate_hz
        early = time[inside + 1] - begin <= sampling.burst_after_s
        late = end - time[inside] <= sampling.burst_before_s
        planned[inside[~((early | late) & (sampling.burst_rate_hz > 0.0))]] = planned_s
    expected = np.maximum(usual, planned)
    within_step = (step[1:] == step[:-1]) & (expected > 0.0)
    late = within_step & (intervals > LATE * expected + JITTER * deviation)
    return int(np.sum(np.maximum(np.rint(intervals[late] / expected[late]) - 1.0, 1.0)))


def _sensors(samples: Samples, cycle: Cycle, identity: Identity) -> tuple[int, int]:
    """Count saturated and stuck samples over all sensors."""
    step, position = samples.step, samples.position_m
    saturated, stuck = np.zeros((2, step.size), dtype=bool)
    if not step.size:
        return 0, 0
    moves = [number for number, one in enumerate(cycle.steps) if isinstance(one, Move)]
    moving = np.isin(step, moves)
    travels = moving.any() and np.ptp(position[moving]) > 0.0
    for name in CHANNELS[1:-1]:
        values = getattr(samples, name)
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


def _steps(samples: Samples, cycle: Cycle) -> dict[str, int]:
    """Count steps without samples, missing samples of moves with too few samples, and missed targets."""
    counts = {"steps_missing": 0, "too_few_samples": 0, "target_missed": 0}
    asked, at = cycle.sampling.samples_per_stroke, cycle.start_m
    for number, one in enumerate(cycle.steps):
        members = np.flatnonzero(samples.step == number)
        begin = at
        if isinstance(one, Move):
            at = one.to_m
            if members.size < max(LEAST_SHARE * asked, LEAST_SAMPLES):
                counts["too_few_samples"] += max(asked - members.size, 1)
            way = abs(one.to_m - begin) if begin is not None else 0.0
            if members.size and abs(samples.position_m[members[-1]] - one.to_m) > MISSED_SHARE * way + MISSED_M:
                counts["target_missed"] += 1
        elif one.duration_s * cycle.sampling.hold_rate_hz < 1.0:
            continue
        counts["steps_missing"] += not members.size
    return counts
