"""The next cycle, from the plan and the finished cycles.

`next_cycle` is a pure function of plan and finished cycles: a resumed campaign needs nothing else
and runs the same cycles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.planning.points import Builder
from pneudrive.campaign.running.checks import serious
from pneudrive.campaign.storage.folder import read_samples
from pneudrive.errors import CampaignError, RecordingError
from pneudrive.rig.interface import SHARED, Hold

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.plan import Plan, Planned
    from pneudrive.campaign.planning.protocol import Adaptive
    from pneudrive.campaign.storage.folder import CycleFile
    from pneudrive.rig.interface import Identity, Samples

    Array = NDArray[np.float64]

#: Kinds with a mean friction.
LEVELS = ("sweep", "sentinel")
#: Kinds with a quick estimate.
MEASURED = (*LEVELS, "stop")
#: Least ratio of an added speed to the measured ones: nearer speeds would count as one level.
APART = 1.05
#: Number of speeds that are tried, and digits of the chosen speed.
CANDIDATES, DIGITS = 400, 4
#: Least number of speeds for a choice by the Stribeck curve: two more than its parameters.
LEAST_FOR_FIT = 6
#: Condition number of the scaled information matrix above which the fit chooses no speed.
WORST_CONDITION = 1e8


@dataclass(frozen=True)
class QuickPoint:
    """Quick estimate of one cycle, for decisions and the live map, not for results.

    Attributes
    ----------
    friction_n, stderr_n : float
        Mean friction of a sweep, or greatest force after a stop. NaN if it cannot be estimated.
    settled_s : float
        Settled time in the direction with less of it.
    why : str
        Reason for a missing estimate.
    """

    friction_n: float = float("nan")
    stderr_n: float = float("nan")
    settled_s: float = 0.0
    why: str = ""


@dataclass(frozen=True)
class Finished:
    """A finished cycle with its quick estimate."""

    cycle: Cycle
    flags: dict[str, int]
    point: QuickPoint


def finished_of(files: Sequence[CycleFile], identity: Identity, *, measured: bool) -> list[Finished]:
    """Return finished cycles from their files.

    Parameters
    ----------
    files : sequence of CycleFile
    identity : Identity
        Values of the rig.
    measured : bool
        Whether to read the samples and estimate the points.

    Raises
    ------
    CampaignError
        If a file is damaged.
    """
    wanted = [file for file in files if measured and file.head.cycle.kind in MEASURED]
    points = {}
    for file, samples in zip(wanted, read_samples(wanted), strict=True):
        if isinstance(samples, CampaignError):
            raise samples
        points[file.path] = measure(samples, file.head.cycle, identity)
    return [Finished(file.head.cycle, file.head.flags, points.get(file.path, QuickPoint())) for file in files]


def measure(samples: Samples, cycle: Cycle, identity: Identity) -> QuickPoint:
    """Return the quick estimate of a cycle; None for kinds that are not points of a characteristic."""
    from pneudrive.friction.reduction.level import extract
    from pneudrive.friction.reduction.settling import Settled

    if cycle.kind not in MEASURED:
        return QuickPoint()
    try:
        recording = _recording(samples, cycle, identity)
        if cycle.kind == "stop":
            return _after_stop(samples, cycle, identity)
        found = extract(recording, Settled())
    except RecordingError as error:
        return QuickPoint(why=error.what)
    wanted = cycle.speed_m_s or 0.0
    level = min(found.levels, key=lambda one: abs(one.speed_m_s - wanted))
    steps = np.diff(found.recording.time_s, append=found.recording.time_s[-1])
    times = {
        direction: sum(
            float(steps[s.samples][found.settled[s.samples]].sum()) for s in level.strokes if s.direction == direction
        )
        for direction in {s.direction for s in level.strokes}
    }
    return QuickPoint(level.friction_n, level.stderr_n, min(times.values()))


def _recording(samples: Samples, cycle: Cycle, identity: Identity):  # noqa: ANN202 - see Recording
    from pneudrive.signals.recording import Recording

    with np.errstate(invalid="ignore"):
        time = np.where(np.isfinite(samples.time_s), samples.time_s, -np.inf)
        good = (time >= np.maximum.accumulate(time)) & np.isfinite(time)
    channels = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
    return Recording(
        name=cycle.key,
        **{name: getattr(samples, name)[good] for name in channels},
        **{name: getattr(identity, name) for name in SHARED},
        accuracy=dict(identity.accuracy),
        limits=dict(identity.limits),
    )


def _after_stop(samples: Samples, cycle: Cycle, identity: Identity) -> QuickPoint:
    """Return the largest force against the motion in the move after the longest hold."""
    holds = [(step.duration_s, number) for number, step in enumerate(cycle.steps) if isinstance(step, Hold)]
    number = max(holds)[1] + 1 if holds else len(cycle.steps) - 2
    part = np.flatnonzero((samples.step == number) & np.isfinite(samples.force_n) & np.isfinite(samples.position_m))
    if part.size < 2:
        return QuickPoint(why="there are no samples after the stop")
    ambient = identity.ambient_pressure_pa
    force = (
        samples.force_n[part]
        + (samples.pressure_a_pa[part] - ambient) * identity.area_a_m2
        - (samples.pressure_b_pa[part] - ambient) * identity.area_b_m2
    )
    way = samples.position_m[part[-1]] - samples.position_m[part[0]]
    return QuickPoint(float(np.max(np.sign(way) * force)), settled_s=float("inf"))


def next_cycle(plan: Plan, finished: Sequence[Finished]) -> tuple[Cycle, str] | None:
    """Return the next cycle, and the reason if the protocol does not list it.

    Parameters
    ----------
    plan : Plan
    finished : sequence of Finished
        In the order in which they were run.

    Returns
    -------
    (Cycle, str) or None
        None if the campaign is done.
    """
    rules = plan.protocol.adaptive
    if rules is not None and finished:
        again = _again(plan, finished, rules) or _added(plan, finished, rules)
        if again is not None:
            return again
    done = {one.cycle.key for one in finished}
    for planned in plan.planned:
        if planned.cycle.key not in done and not (rules is not None and _is_tight(planned, finished, rules)):
            return planned.cycle, ""
    return None


def needless(plan: Plan, finished: Sequence[Finished]) -> set[str]:
    """Return the keys of planned cycles that are no longer needed, because their point is known well enough."""
    rules = plan.protocol.adaptive
    if rules is None or rules.interval_n is None:
        return set()
    done = {one.cycle.key for one in finished}
    return {p.cycle.key for p in plan.planned if p.cycle.key not in done and _is_tight(p, finished, rules)}


def fault_of(one: Finished, rules: Adaptive) -> str:
    """Return the reason why a cycle is not a good point, in words; empty if it is good."""
    flags = serious(one.flags)
    if flags:
        return f"flagged {', '.join(flags)}"
    if one.cycle.kind not in LEVELS:
        return ""
    if one.point.why:
        return one.point.why
    if rules.settled_time_s is not None and one.point.settled_s < rules.settled_time_s:
        return f"settled for {one.point.settled_s:.3g} s, less than {rules.settled_time_s:g} s"
    if rules.noise_n is not None and not one.point.stderr_n <= rules.noise_n:
        return f"standard error {one.point.stderr_n:.3g} N, more than {rules.noise_n:g} N"
    return ""


def _cell(cycle: Cycle) -> str:
    """Return the key of a point without its repeat."""
    return cycle.key.partition("+again")[0] if cycle.kind == "sentinel" else cycle.key.rpartition("/")[0]


def _again(plan: Plan, finished: Sequence[Finished], rules: Adaptive) -> tuple[Cycle, str] | None:
    """Return a repeat of the last cycle if this cycle is not a good point."""
    last = finished[-1]
    if last.cycle.kind not in MEASURED or not rules.repeats:
        return None
    bad = fault_of(last, rules)
    if not bad:
        return None
    cell = _cell(last.cycle)
    planned = {p.cycle.key for p in plan.planned}
    here = [one.cycle for one in finished if one.cycle.kind == last.cycle.kind and _cell(one.cycle) == cell]
    further = sum("again" in cycle.key.rpartition("/")[2] for cycle in here)
    if further >= rules.repeats:
        return None
    key = f"{cell}+again{further + 1}" if last.cycle.kind == "sentinel" else f"{cell}/again{further + 1}"
    repeat = max([c.repeat for c in here] + [p.cycle.repeat for p in plan.planned if _cell(p.cycle) == cell])
    assert key not in planned
    return replace(last.cycle, key=key, repeat=repeat + 1), f"repeats {last.cycle.key}: {bad}"


def _is_tight(planned: Planned, finished: Sequence[Finished], rules: Adaptive) -> bool:
    """Return whether the mean of a point is known well enough without this repeat."""
    from pneudrive.estimate.estimates import student

    if rules.interval_n is None or planned.cell is None:
        return False
    cell = _cell(planned.cycle)
    values = [
        one.point.friction_n
        for one in finished
        if one.cycle.kind == planned.cycle.kind and _cell(one.cycle) == cell and not fault_of(one, rules)
    ]
    values = [value for value in values if np.isfinite(value)]
    if len(values) < rules.least_repeats:
        return False
    half = student(len(values) - 1) * float(np.std(values, ddof=1)) / len(values) ** 0.5
    return half <= rules.interval_n


def _added(plan: Plan, finished: Sequence[Finished], rules: Adaptive) -> tuple[Cycle, str] | None:
    """Return an added speed once all planned speeds of a block are done."""
    if not rules.added_speeds or plan.protocol.speed is None:
        return None
    block = finished[-1].cycle.block
    done = {one.cycle.key for one in finished}
    here = [p for p in plan.planned if p.cycle.block == block and p.cycle.kind == "sweep" and p.cell is not None]
    if any(p.cycle.key not in done and not _is_tight(p, finished, rules) for p in here):
        return None
    planned_keys = {_cell(p.cycle) for p in plan.planned}
    builder = Builder(plan.protocol, plan.identity, plan.envelope)
    for pair in dict.fromkeys((p.cycle.pressure_a_pa, p.cycle.pressure_b_pa) for p in here):
        members = [one for one in finished if one.cycle.block == block and one.cycle.kind == "sweep"]
        members = [member for member in members if (member.cycle.pressure_a_pa, member.cycle.pressure_b_pa) == pair]
        added = {_cell(member.cycle) for member in members} - planned_keys
        if len(added) >= rules.added_speeds:
            continue
        taken = [member.cycle.speed_m_s for member in members if member.cycle.speed_m_s]
        chosen = choose_speed([member for member in members if not fault_of(member, rules)], taken)
        if chosen is None:
            continue
        speed, why = chosen
        model = next(p for p in here if (p.cycle.pressure_a_pa, p.cycle.pressure_b_pa) == pair)
        assert model.cell is not None
        builder.begin_block(block, model.cycle.levels)
        return builder.point(replace(model.cell, speed_m_s=speed, turn=""), 1), why
    return None


def choose_speed(members: Sequence[Finished], taken: Sequence[float] = ()) -> tuple[float, str] | None:
    """Choose the next speed of a characteristic.

    If a Stribeck curve can be fitted, this is the speed with the largest variance of the prediction. It raises the
    determinant of the information most (sequential D-optimal design [fedorov1972]). Otherwise it is the middle, on a
    logarithmic scale, of the interval in which the measured curve bends most.

    Parameters
    ----------
    members : sequence of Finished
        Good sweeps at one pair of pressures.
    taken : sequence of float
        Other speeds that must not be chosen again, m/s.

    Returns
    -------
    (float, str) or None
        Speed in m/s and the reason; None if every speed lies too near a measured one.
    """
    usable = [m for m in members if np.isfinite(m.point.friction_n) and m.cycle.speed_m_s]
    speed = np.array([m.cycle.speed_m_s or np.nan for m in usable])
    levels = np.unique(speed)
    if levels.size < 3:
        return None
    candidates = np.geomspace(levels[0], levels[-1], CANDIDATES)
    avoided = np.union1d(levels, np.asarray(taken, dtype=np.float64))
    ratio = np.exp(np.min(np.abs(np.log(candidates[:, None] / avoided)), axis=1))
    candidates = candidates[ratio >= APART]
    if not candidates.size:
        return None
    gain = None
    if levels.size >= LEAST_FOR_FIT:
        gain = _prediction_variance(speed, usable, candidates)
    if gain is not None:
        return _rounded(candidates[int(np.argmax(gain))]), "adds the D-optimal speed of the Stribeck curve so far"
    means = np.array(
        [np.mean([m.point.friction_n for m in usable if m.cycle.speed_m_s == v]) for v in levels], dtype=np.float64
    )
    gaps = _bend(np.log(levels), means)
    for gap in np.argsort(-gaps, kind="stable"):
        middle = float(np.sqrt(levels[gap] * levels[gap + 1]))
        if np.exp(np.min(np.abs(np.log(middle / avoided)))) >= APART:
            return _rounded(middle), "adds a speed where the curve bends most"
    return None


def _bend(x: Array, y: Array) -> Array:
    """Estimate the error of a straight line across each interval: its width squared times the second derivative."""
    second = np.zeros(x.size)
    slopes = np.diff(y) / np.diff(x)
    second[1:-1] = 2.0 * np.diff(slopes) / (x[2:] - x[:-2])
    bent = np.maximum(np.abs(second[:-1]), np.abs(second[1:]))
    return bent * np.diff(x) ** 2


def _prediction_variance(speed: Array, usable: Sequence[Finished], candidates: Array) -> Array | None:
    """Return the variance of the fitted Stribeck curve at the candidates, except for a constant factor.

    None without a fit.
    """
    from pneudrive.errors import FitError
    from pneudrive.estimate.design import DesignSpace, prediction_variance
    from pneudrive.identify.static.model import FrictionModel, Observations
    from pneudrive.identify.static.robust import estimate

    friction = np.array([m.point.friction_n for m in usable])
    stated = np.array([m.point.stderr_n for m in usable])
    known = stated[np.isfinite(stated) & (stated > 0.0)]
    stderr = np.full(speed.size, float(np.median(known)) if known.size else 1.0)

    def observations(at: Array, value: Array, error: Array) -> Observations:
        zero = np.zeros(at.size)
        return Observations(at, value, error, zero, zero, zero, np.arange(at.size))

    model = FrictionModel("stribeck")
    data = observations(speed, friction, stderr)
    try:
        found = estimate(model, data)
    except (FitError, ValueError, np.linalg.LinAlgError):
        return None
    size = np.linalg.norm(found.jacobian, axis=0)
    if found.active.any() or (size == 0.0).any():
        return None
    information = (found.jacobian / size).T @ (found.jacobian / size)
    if not np.linalg.cond(information) < WORST_CONDITION:
        return None
    ones = np.ones(candidates.size)
    gradient = model.value_and_jacobian(found.q, observations(candidates, ones, ones))[1] / size
    return prediction_variance(DesignSpace(gradient[None], information[None]), information[None])


def _rounded(speed: float) -> float:
    return float(f"{speed:.{DIGITS}g}")
