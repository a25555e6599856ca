"""Multiple shooting: simulated segments of a recording, and their exact derivatives."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pneudrive.errors import FitError
from pneudrive.progress import UNWATCHED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Shooting
    from pneudrive._core import Shot as CoreShot
    from pneudrive.free.parameters import DriveFamily
    from pneudrive.progress import Watch

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shot:
    """Result of a run of all segments.

    Attributes
    ----------
    outputs : ndarray, shape (n, o)
        Outputs at the samples. The first sample of a segment has the outputs of its start.
    by_parameter : ndarray, shape (n, o, p)
        Derivatives by the free values of the drive, SI; p = 0 without derivatives.
    by_start : ndarray, shape (n, o, s)
        Derivatives by the start of the sample's segment; s = 0 without derivatives.
    ends : ndarray, shape (k, s)
        State at the end of each segment.
    ends_by_parameter, ends_by_start : ndarray, shapes (k, s, p), (k, s, s)
    failures : dict
        Segment -> reason of its failure.
    """

    outputs: Array
    by_parameter: Array
    by_start: Array
    ends: Array
    ends_by_parameter: Array
    ends_by_start: Array
    failures: dict[int, str]


class Recorded(Protocol):
    """Protocol of a recording for shooting."""

    @property
    def name(self) -> str:
        """Name in messages."""
        ...

    @property
    def time_s(self) -> Array:
        """Times of the samples, shape (n,)."""
        ...

    def __getitem__(self, column: str) -> Array:
        """Return a column, SI."""
        ...

    @property
    def steps(self) -> tuple[Array, Array]:
        """Return the times at which the command changes, and its new values."""
        ...


#: Half of the difference for derivatives by the delay of the command, s: above the effect of the solver's error, below
#: the time in which a valve's flow changes.
DELAY_STEP_S = 1e-4


class Shooter:
    """Runner of the segments of one recording.

    Parameters
    ----------
    recording : Recorded
    outputs : sequence of str
        Wanted columns of the core.
    starts : ndarray of int, shape (k,)
        Samples at which segments begin.
    family : DriveFamily
    rtol : float
    threads : int
    delay_s : float
        Default delay of the valve after the command, s.
    watch : Watch
        Checked during each run.
    """

    def __init__(
        self,
        recording: Recorded,
        outputs: Sequence[str],
        starts: NDArray[np.int64],
        family: DriveFamily,
        rtol: float,
        threads: int,
        delay_s: float = 0.0,
        watch: Watch = UNWATCHED,
    ) -> None:
        self.recording, self.outputs, self.starts = recording, list(outputs), starts
        self.family, self._rtol, self._threads = family, rtol, threads
        self._delay_s, self.watch = delay_s, watch

    def inner_states(self, values: Array) -> list[str]:
        """Names of the start states other than piston and chambers: states of friction, gas of tubes."""
        return list(self.family.core(values).segment_names[6:])

    def with_starts(self, starts: NDArray[np.int64]) -> Shooter:
        """Return a shooter whose segments begin at other samples."""
        return self._with(starts=starts)

    def with_outputs(self, outputs: Sequence[str]) -> Shooter:
        """Return a shooter that computes other columns of the core."""
        return self._with(outputs=list(outputs))

    def _with(self, **changed: object) -> Shooter:
        other = copy(self)
        vars(other).update(changed)
        return other

    def run(
        self,
        values: Array,
        initial: Array,
        *,
        derivatives: bool = True,
        by_start: NDArray[np.int64] | None = None,
        delay_s: float | None = None,
    ) -> Shot:
        """Run all segments.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Free values of the drive, SI.
        initial : ndarray, shape (k, s)
            Starts of the segments.
        derivatives : bool
            Whether to compute derivatives by the values and by the starts.
        by_start : ndarray of int, optional
            Columns of the starts for derivatives, default: all; others are zero.
        delay_s : float, optional
            Free delay of the command: its derivatives follow those by the values.

        Raises
        ------
        FitError
            The core rejects the drive.
        """
        try:
            core = self.family.core(values)
            found = self._shoot(core, initial, delay_s, derivatives=derivatives, by_start=by_start)
            beside = [] if delay_s is None or not derivatives else [delay_s + DELAY_STEP_S, delay_s - DELAY_STEP_S]
            shifted = [self._shoot(core, initial, delay) for delay in beside]
        except ValueError as error:
            raise FitError(f"the core rejects a drive of the search: {error}") from None
        p = self.family.size if derivatives else 0
        sensitivities, ends = found["sensitivities"], found["end_sensitivities"]
        if derivatives:
            paths = len(self.family.paths)
            if by_start is not None:
                sensitivities, ends = (_spread(d, paths, by_start, initial.shape[1]) for d in (sensitivities, ends))
            if paths > p:
                by_free = self.family.by_free(values)
                sensitivities, ends = (_chained(d, by_free) for d in (sensitivities, ends))
        if shifted:
            later, sooner = shifted
            by_delay, ends_by_delay = ((later[k] - sooner[k]) / (2.0 * DELAY_STEP_S) for k in ("values", "ends"))
            sensitivities = np.insert(sensitivities, p, by_delay, axis=2)
            ends = np.insert(ends, p, ends_by_delay, axis=2)
            p += 1
        return Shot(
            outputs=found["values"],
            by_parameter=sensitivities[:, :, :p],
            by_start=sensitivities[:, :, p:],
            ends=found["ends"],
            ends_by_parameter=ends[:, :, :p],
            ends_by_start=ends[:, :, p:],
            failures={j: why for j, why in enumerate(found["failures"]) if why is not None},
        )

    def _shoot(
        self,
        core: Any,  # noqa: ANN401 - the core's drive
        initial: Array,
        delay_s: float | None,
        *,
        derivatives: bool = False,
        by_start: NDArray[np.int64] | None = None,
    ) -> CoreShot:
        times, commands = delayed(*self.recording.steps, self._delay_s if delay_s is None else delay_s)
        asked: Shooting = {
            "times": times.tolist(),
            "commands": commands.tolist(),
            "sample_times": self.recording.time_s,
            "starts": self.starts.tolist(),
            "initial": np.ascontiguousarray(initial),
            "parameters": self.family.paths if derivatives else [],
            "with_initial": derivatives if by_start is None or not derivatives else by_start.tolist(),
            "outputs": self.outputs,
            "rtol": self._rtol,
            "threads": self._threads,
        }
        return self.family.shoot(core, asked, lambda _: self.watch.look())


def delayed(times: Array, commands: Array, delay_s: float) -> tuple[Array, Array]:
    """Shift the steps of a command. The first time is kept, with the command at that time."""
    if delay_s == 0.0:
        return times, commands
    shifted = times + delay_s
    first = max(int(np.searchsorted(shifted, times[0], side="right")) - 1, 0)
    return np.r_[times[0], shifted[first + 1 :]], commands[first:]


def _chained(derivatives: Array, by_free: Array) -> Array:
    """Convert derivatives by all paths of the drive (first on the last axis) to its free values."""
    paths = len(by_free)
    return np.concatenate([derivatives[..., :paths] @ by_free, derivatives[..., paths:]], axis=-1)


def _spread(derivatives: Array, p: int, columns: NDArray[np.int64], states: int) -> Array:
    """Expand derivatives by some columns of the starts to all columns."""
    out = np.zeros((*derivatives.shape[:-1], p + states))
    out[..., :p] = derivatives[..., :p]
    out[..., p + columns] = derivatives[..., p:]
    return out


def segment_starts(time_s: Array, length_s: float | None) -> NDArray[np.int64]:
    """Return the first samples of segments of about a length; None: one segment.

    All segments have at least two samples, and none is shorter than half of another.
    """
    total = float(time_s[-1] - time_s[0])
    count = 1 if length_s is None else max(1, round(total / length_s))
    wanted = time_s[0] + total * np.arange(count) / count
    starts = np.unique(np.searchsorted(time_s, wanted - 1e-9 * total))
    return starts[starts < time_s.size - 1].astype(np.int64)
