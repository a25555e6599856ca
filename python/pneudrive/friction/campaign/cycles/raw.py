"""A cycle's raw samples as a recording: damaged ones left out and counted."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pneudrive.errors import CampaignError, PneudriveError, RecordingError
from pneudrive.friction.campaign.basics import Skipped
from pneudrive.rig.interface import SHARED, Move
from pneudrive.signals.impossible import refuse_channels
from pneudrive.signals.recording import Recording
from pneudrive.signals.samples import clean

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.campaign.folder import CycleFile
    from pneudrive.rig.interface import Identity, Samples

T = TypeVar("T")
LOST_SHARE = 0.5  # of a cycle's samples: largest share of damaged ones


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
        # Unforeseen samples spoil their own cycle, not the campaign.
        reason = f"{type(error).__name__}: {error}"
    return Skipped(file.head.cycle.key, file.path.name, reason)
