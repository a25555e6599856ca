"""A study: everything that determines the results of its members.

A chunk of it is a pure function of its first and last member.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import __version__
from pneudrive.ensemble import engine
from pneudrive.ensemble.outputs import Reduction
from pneudrive.errors import SimulationError
from pneudrive.simulation.trajectory import meaning

if TYPE_CHECKING:
    from collections.abc import Callable

    import polars as pl
    from numpy.typing import NDArray

    from pneudrive.ensemble.plans import MemberPlans
    from pneudrive.ensemble.rows import Rows
    from pneudrive.ensemble.variation import Variation

    Array = NDArray[np.float64]

#: Members of a chunk by default.
CHUNK = 16384
#: Samples, of all signals that a chunk keeps or a function of the user's sees, that are in memory at a time.
MOST_SAMPLES = 20_000_000


class Chunk(NamedTuple):
    """Members from `first` to before `last`."""

    first: int
    last: int


class ChunkResult(NamedTuple):
    """Result of a chunk.

    Attributes
    ----------
    chunk : Chunk
    varied : ndarray, shape (n, names)
        Rows of the design, SI.
    values : list of ndarray
        One array for each output, shape (n,) or (n, samples).
    status : ndarray of uint8, shape (n,)
    reasons : dict
        Index in the chunk -> reason of that member's failure.
    """

    chunk: Chunk
    varied: Array
    values: list[Array]
    status: NDArray[np.uint8]
    reasons: dict[int, str]


@dataclass(frozen=True, eq=False)
class EnsembleStudy:
    """The work of a study, in SI and checked. It can be pickled and sent to another machine.

    Attributes
    ----------
    variation : Variation
        The drive and which of its numbers vary.
    rows : Rows
    plans : MemberPlans
    rtol : float
    outputs : tuple of Reduction
    threads : int, optional
    begin : int
        The first member of `plans`.
    """

    variation: Variation
    rows: Rows
    plans: MemberPlans
    rtol: float
    outputs: tuple[Reduction, ...]
    threads: int | None = None
    begin: int = 0

    def about(self) -> dict[str, Any]:
        """Describe everything that determines the results, as plain data."""
        return {
            "description_hash": self.variation.drive.description_hash,
            "initial": self.variation.start_said(),
            **self.plans.about(),
            "rtol": self.rtol,
            "vary": self.rows.about(),
            "outputs": [output.about() for output in self.outputs],
            "version": __version__,
        }

    @property
    def study_hash(self) -> str:
        """SHA-256 of everything that determines the results."""
        return hashlib.sha256(json.dumps(self.about(), sort_keys=True).encode()).hexdigest()

    def chunks(self, members: int | None = None) -> list[Chunk]:
        """Return the chunks of this number of members."""
        size, step = self.rows.size, members or self._usual_chunk()
        return [Chunk(first, min(first + step, size)) for first in range(0, size, step)]

    def _usual_chunk(self) -> int:
        sampled = sum(len(one.columns) * (round(self.plans.duration_s * one.rate_hz) + 1) for one in self._sampled())
        return max(1, min(CHUNK, MOST_SAMPLES // max(sampled, 1)))

    def _sampled(self) -> list[Reduction]:
        return [output for output in self.outputs if output.word in ("samples", "own")]

    def part(self, chunk: Chunk) -> EnsembleStudy:
        """Return the object that runs a chunk, without other data, to be sent to another machine."""
        return replace(self, rows=self.rows.part(*chunk), plans=self.plans.part(*chunk), begin=chunk.first)

    def sample_times(self, rate_hz: float) -> Array:
        """Return the times of samples, s."""
        return np.arange(round(self.plans.duration_s * rate_hz) + 1) / rate_hz

    def run(self, chunk: Chunk, look: Callable[[float], object] | None = None) -> ChunkResult:
        """Run a chunk.

        Parameters
        ----------
        chunk : Chunk
        look : callable, optional
            Receives the number of finished members.

        Raises
        ------
        SimulationError
            A user function fails, or returns something other than a number for each member.
        """
        rows = self.rows.take(*chunk)
        asked: list[Reduction] = []
        for output in self.outputs:
            asked += self._seen(output) if output.function is not None else [output]
        plans = self.plans.part(chunk.first - self.begin, chunk.last - self.begin)
        members = self.variation.members(rows)
        found = engine.run(self.variation.drive.system, members, plans, self.rtol, asked, self.threads, look)
        given = iter(found.values)
        values = [
            next(given)
            if output.function is None
            else self._own(output, [next(given) for _ in output.columns], found.status)
            for output in self.outputs
        ]
        return ChunkResult(chunk, rows, values, found.status, found.reasons)

    @staticmethod
    def _seen(output: Reduction) -> list[Reduction]:
        return [replace(output, word="samples", columns=(column,), function=None) for column in output.columns]

    def _own(self, output: Reduction, seen: list[Array], status: NDArray[np.uint8]) -> Array:
        """Call a user function for the finished members."""
        assert output.function is not None
        done = status == engine.DONE
        out = np.full(len(status), np.nan)
        if not done.any():
            return out
        signals = {meaning(column)[0]: x[done] for column, x in zip(output.columns, seen, strict=True)}
        try:
            made = output.function(signals, self.sample_times(output.rate_hz))
            out[done] = np.broadcast_to(np.asarray(made, dtype=np.float64), (int(done.sum()),))
        except Exception as error:
            raise SimulationError(
                f"output {output.name}: {type(error).__name__}: {error}",
                rule="your function returns one number for each member, an array of shape (members,)",
            ) from error
        return out

    def frame(self, result: ChunkResult) -> pl.DataFrame:
        """Return a chunk as a table: member, status, reason, varied numbers, outputs. Columns carry their units."""
        import polars as pl

        chunk = result.chunk
        columns: dict[str, Any] = {"member": np.arange(chunk.first, chunk.last), "status": result.status}
        columns["reason"] = pl.Series(
            [result.reasons.get(k, "") for k in range(chunk.last - chunk.first)], dtype=pl.String
        )
        for number, values in zip(self.variation.numbers, result.varied.T, strict=True):
            columns[number.file_name] = np.ascontiguousarray(values)
        for output, values in zip(self.outputs, result.values, strict=True):
            columns[output.file_name] = values
        return pl.DataFrame(columns)
