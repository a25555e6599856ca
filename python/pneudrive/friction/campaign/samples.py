"""A file of a cycle as a recording with a plan. Damaged samples are left out and counted. Cycles at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pneudrive.errors import CampaignError, PneudriveError, RecordingError
from pneudrive.estimate.autocorrelation import stderr_of_mean
from pneudrive.friction.conditions import Condition, Skipped
from pneudrive.friction.cycle import MINIMUM_SAMPLES, CycleData, CyclePlan, OpenPressure
from pneudrive.rig.interface import SHARED, Hold, Move
from pneudrive.signals.impossible import refuse_channels
from pneudrive.signals.recording import Recording
from pneudrive.signals.samples import clean

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.campaign.storage.folder import CycleFile, Head
    from pneudrive.rig.interface import Identity, Samples

T = TypeVar("T")
LOST_SHARE = 0.5  # of a cycle's samples: largest share of damaged ones
PRESSURE_STEP_PA = 100.0  # difference at which a pressure is a separate level: 1 mbar
TARE_SETTLING = 0.5  # initial share of a tare that is left out: seals relax after the release
SIDES = ("a", "b")


def condition_of(head: Head) -> Condition:
    """Return the condition of a cycle: planned pressures in steps of 1 mbar, and the levels of its block."""
    cycle = head.cycle
    a, b = (PRESSURE_STEP_PA * round(p / PRESSURE_STEP_PA) for p in (cycle.pressure_a_pa, cycle.pressure_b_pa))
    levels = {name: str(cycle.levels.get(name, "")) for name in ("mounting", "seal", "drive")}
    return Condition(a, b, **levels)


def plan_of(head: Head, first: Head, last: Head, day: int, began_s: float) -> CyclePlan:
    """Return the plan of a cycle.

    Parameters
    ----------
    head, first, last : Head
        Index of the cycle, and of the first and the last cycle of the campaign.
    day : int
    began_s : float
        Beginning of the campaign by the rig's clock.
    """
    cycle = head.cycle
    return CyclePlan(
        key=cycle.key,
        kind=cycle.kind,
        index=head.index,
        block=cycle.block,
        repeat=cycle.repeat,
        condition=condition_of(head),
        speed_m_s=cycle.speed_m_s,
        pressures_pa={"a": cycle.pressure_a_pa, "b": cycle.pressure_b_pa},
        began_s=head.began_s,
        elapsed_s=head.began_s - began_s,
        day=day,
        order=(head.index - first.index) / max(last.index - first.index, 1),
        weight_n=next((s.weight_n for s in cycle.steps if isinstance(s, Hold) and s.weight_n), 0.0),
    )


def recording_of(file: CycleFile, identity: Identity, samples: Samples) -> tuple[Recording, dict[str, int]]:
    """Make a cleaned recording of a cycle; damaged samples are left out and counted by kind.

    Raises
    ------
    RecordingError
        If more than half of the samples are damaged, or have impossible values.
    """
    name = file.head.cycle.key
    count = len(samples)
    flags = {kind: int(number) for kind, number in file.head.flags.items() if number}
    good, backwards = _forwards(samples)
    if backwards:
        flags["time_backwards"] = backwards
    # A released axis creeps by single counts: this is not a stuck sensor.
    stands = bool(file.head.cycle.steps) and not any(isinstance(step, Move) for step in file.head.cycle.steps)
    position = samples.position_m[good]
    if stands and np.isfinite(position).any():
        position = np.full(position.size, float(np.nanmedian(position)))
    known = identity.force_calibration
    limits = {channel: (float(low), float(high)) for channel, (low, high) in identity.limits.items()}
    force = samples.force_n[good]
    if known is not None:
        force = known.force_n(force)
        if "force_n" in limits:
            low, high = known.force_n(np.array(limits["force_n"]))
            limits["force_n"] = (float(low), float(high))
    recording = clean(
        Recording(
            name=name,
            time_s=samples.time_s[good],
            position_m=position,
            force_n=force,
            pressure_a_pa=samples.pressure_a_pa[good],
            pressure_b_pa=samples.pressure_b_pa[good],
            **{name: getattr(identity, name) for name in SHARED},
            accuracy=dict(identity.accuracy),
            labels=dict(file.head.cycle.levels),
            source=file.path,
            synthetic=identity.synthetic,
            stiffness_n_m=identity.stiffness_n_m,
            limits=limits,
            calibration=dict(identity.calibration),
            force_calibration=known,
        )
    )
    if len(recording) < (1.0 - LOST_SHARE) * count:
        found = ", ".join(f"{kind} {number}" for kind, number in {**flags, **recording.flags}.items())
        raise RecordingError("more than half of the samples are damaged", where=name, value=f"{found} of {count}")
    refuse_channels(recording)
    for kind, number in recording.flags.items():
        if kind != "gap":  # bursts are denser than the rest: the length of an interval means nothing
            flags[kind] = max(flags.get(kind, 0), number)
    return recording, flags


def _forwards(samples: Samples) -> tuple[NDArray[np.bool_], int]:
    """Mark the samples with increasing time, and count the others.

    Repeated samples are dropped. After a clock jumped back, times are wrong:
    the longest stretch without a jump is kept.
    """
    finite = np.isfinite(samples.time_s)
    time = np.where(finite, samples.time_s, -np.inf)
    good = finite & (time >= np.maximum.accumulate(time))
    back = np.flatnonzero(finite & ~good)
    if not back.size:
        return good, 0
    order = np.flatnonzero(good)
    twin = order[np.minimum(np.searchsorted(time[order], time[back]), order.size - 1)]
    same = (time[twin] == time[back]) & (samples.force_n[twin] == samples.force_n[back])
    if same.all():
        return good, back.size
    known = np.flatnonzero(finite)
    pieces = np.split(known, np.flatnonzero(np.diff(time[known]) < 0) + 1)
    longest = max(pieces, key=len)
    mask = np.zeros(time.size, dtype=bool)
    mask[longest] = True
    return mask, int(finite.sum()) - longest.size


def steps_of(recording: Recording, samples: Samples) -> NDArray[np.int64]:
    """Return the step of the cycle to which each cleaned sample belongs."""
    order = np.argsort(samples.time_s, kind="stable")
    place = np.searchsorted(samples.time_s[order], recording.time_s)
    return samples.step[order[np.minimum(place, order.size - 1)]]


def read_or_skip(
    read: Callable[[CycleFile, Samples], T], file: CycleFile, samples: Samples | CampaignError
) -> T | Skipped:
    """Read a cycle, or return the reason why it cannot be read.

    Parameters
    ----------
    read : callable
        Makes a result of file and samples.
    file : CycleFile
    samples : Samples or CampaignError
        Its raw samples, or the error of reading them.
    """
    try:
        if isinstance(samples, CampaignError):
            raise samples
        return read(file, samples)
    except PneudriveError as error:
        reason = f"{error.what} ({error.value})" if error.value is not None else error.what
    except (ValueError, IndexError, ArithmeticError, np.linalg.LinAlgError) as error:
        # Unexpected samples spoil only their cycle, not the campaign.
        reason = f"{type(error).__name__}: {error}"
    return Skipped(file.head.cycle.key, file.path.name, reason)


def read_standing(
    file: CycleFile, recording: Recording, samples: Samples, plan: CyclePlan, identity: Identity
) -> CycleData:
    """Read a zero run or a known weight: mean force while the axis is released at rest, and its uncertainty.

    Raises
    ------
    RecordingError
        If it has too few samples.
    """
    steps = steps_of(recording, samples)
    holds = [(i, step) for i, step in enumerate(file.head.cycle.steps) if isinstance(step, Hold)]
    meant = [i for i, step in holds if step.released or step.weight_n]
    standing = np.isin(steps, meant) if meant else np.ones(len(recording), dtype=bool)
    begin, end = (float(t) for t in np.quantile(recording.time_s[standing], [0.0, 1.0]))
    standing &= recording.time_s >= begin + TARE_SETTLING * (end - begin)
    if standing.sum() < MINIMUM_SAMPLES:
        raise RecordingError("too few samples at rest", where=recording.name, value=int(standing.sum()))
    vented = max(abs(p - identity.ambient_pressure_pa) for p in plan.pressures_pa.values()) < PRESSURE_STEP_PA
    force = (recording.balance_n() + recording.weight_n if vented else recording.force_n)[standing]
    shown = {c: OpenPressure.of(getattr(recording, f"pressure_{c}_pa")[standing]) for c in SIDES} if vented else {}
    return CycleData(
        plan=plan,
        duration_s=float(recording.time_s[-1] - recording.time_s[0]),
        standing_n=float(force.mean()),
        standing_stderr_n=stderr_of_mean(force),
        standing_sd_n=float(force.std()),
        standing_pressures={c: known for c, known in shown.items() if known is not None},
    )
