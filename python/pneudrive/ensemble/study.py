"""A study: everything that determines the results of its members, and the results of members.

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
from pneudrive.errors import SimulationError
from pneudrive.lazy_names import upper
from pneudrive.simulation.simulate import SOLVER
from pneudrive.simulation.start import ready
from pneudrive.simulation.trajectory import meaning, save, write_frame
from pneudrive.views import View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    import polars as pl
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.ensemble.engine import Rows
    from pneudrive.ensemble.outputs import Reduction
    from pneudrive.ensemble.plans import MemberPlans
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
            "vary": self.rows.about,
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

    def run(self, chunk: Chunk, look: Callable[[float], object] | None = None) -> pl.DataFrame:
        """Run a chunk.

        Parameters
        ----------
        chunk : Chunk
        look : callable, optional
            Receives the number of finished members.

        Returns
        -------
        polars.DataFrame
            A row for each member: member, status, reason, varied numbers, outputs. Columns carry their units.

        Raises
        ------
        SimulationError
            A user function fails, or returns something other than a number for each member.
        """
        import polars as pl

        rows = self.rows.take(*chunk)
        requests: list[Reduction] = []
        for output in self.outputs:
            seen = [replace(output, word="samples", columns=(one,), function=None) for one in output.columns]
            requests += seen if output.function is not None else [output]
        plans = self.plans.part(chunk.first - self.begin, chunk.last - self.begin)
        members = self.variation.members(rows)
        found = engine.run(self.variation.drive.system, members, plans, self.rtol, requests, self.threads, look)
        values = iter(found.values)
        reasons = [found.reasons.get(k, "") for k in range(len(rows))]
        columns: dict[str, Any] = {"member": np.arange(*chunk), "status": found.status}
        columns["reason"] = pl.Series(reasons, dtype=pl.String)
        for number, column in zip(self.variation.numbers, rows.T, strict=True):
            columns[number.file_name] = np.ascontiguousarray(column)
        for output in self.outputs:
            own = [next(values) for _ in (output.columns if output.function is not None else "1")]
            columns[output.file_name] = own[0] if output.function is None else self._own(output, own, found.status)
        return pl.DataFrame(columns)

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


@dataclass(frozen=True, eq=False)
class Members:
    """The results of members as a frame, see `EnsembleStudy.run`. `failed` counts all members of the study."""

    study: EnsembleStudy
    frame: pl.DataFrame
    failed: int

    @classmethod
    def of(cls, study: EnsembleStudy, frames: Iterable[pl.DataFrame]) -> Members:
        """Return the members of chunks in any order."""
        import polars as pl

        frame = pl.concat(frames).sort("member")
        return cls(study, frame, int((frame["status"] != engine.DONE).sum()))

    @property
    def values(self) -> list[Array]:
        """One array for each output, shape (members,) or (members, samples)."""
        return [self.frame[output.file_name].to_numpy(writable=True) for output in self.study.outputs]

    def view(self) -> View:
        """Return the spread of each output over the members that have it, and the first failure."""
        return upper("ensemble_view")(self.dataset())

    def save(self, path: Path) -> None:
        """Write all members as .parquet, .csv or .nc.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        if path.suffix.lower() == ".nc":
            save(self.dataset(), path)
        else:
            write_frame(self.frame, path, {"pneudrive": json.dumps(self.provenance(), default=str)})

    def dataset(self) -> xr.Dataset:
        """Label the arrays: dimension member, a unit and a long name for each variable."""
        import xarray as xr

        upper("Pneu")  # registers `dataset.pneu`

        columns = {name: self.frame[name].to_numpy(writable=True) for name in self.frame.columns}
        variables: dict[str, Any] = {}
        coordinates: dict[str, Any] = {"member": ("member", columns["member"], {"long_name": "member"})}
        for number in self.study.variation.numbers:
            attrs = {"units": number.unit, "long_name": number.name}
            coordinates[number.name] = ("member", columns[number.file_name], attrs)
        for output in self.study.outputs:
            values, attrs = columns[output.file_name], {"units": output.unit, "long_name": output.long_name}
            variables[output.name] = (("member", "time")[: values.ndim], values, attrs)
            if output.word == "samples":
                times = self.study.sample_times(output.rate_hz)
                coordinates["time"] = ("time", times, {"units": "s", "long_name": "time"})
        variables["status"] = ("member", columns["status"], {"units": "1", "long_name": "0: done, else failed"})
        variables["reason"] = ("member", columns["reason"], {"units": "1", "long_name": "why a member failed"})
        return xr.Dataset(variables, coordinates, self.provenance())

    def provenance(self) -> dict[str, Any]:
        """Describe the source of the results."""
        study, drive = self.study, self.study.variation.drive
        core, _ = ready(drive, study.variation.initial)
        return {
            "title": drive.name,
            **study.about(),
            "study_hash": study.study_hash,
            "version": __version__,
            "solver": SOLVER,
            "statistics": {"members": study.rows.size, "failed": self.failed},
            "warnings": [*drive.notes, *core.warnings],
            "citations": list(dict.fromkeys([*core.citations, *drive.cited])),
            "assumed": drive.assumed(),
            "labels": dict(drive.labels),
        }
