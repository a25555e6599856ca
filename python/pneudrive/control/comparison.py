"""Laws beside each other: each along each reference with each seed, kept run by run in a folder."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import __version__
from pneudrive.control.loop import RTOL, Prepared, prepare, run_prepared
from pneudrive.control.measures import SHOWN, Score, written
from pneudrive.control.own_law import is_own
from pneudrive.control.references import Reference, reference, standard_references
from pneudrive.control.setup import Setup, read_setup
from pneudrive.control.tuning import Tuning, laws, tune
from pneudrive.errors import CommandError, RecordingError, SimulationError
from pneudrive.files.tables import open_table
from pneudrive.show import Card, Shown
from pneudrive.trajectory import read_columns, save_columns, write_frame
from pneudrive.watch import UNWATCHED, Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.watch import Flag

RUNS, SCORES = "runs", "score.csv"
MOST_SEEDS = 1000


class ControlledRun(NamedTuple):
    """One law along one reference with one seed.

    Attributes
    ----------
    law, reference : str
        Names in the comparison.
    seed : int
    score : Score or None
        None where the drive could not go on.
    reason : str
        Why it could not; empty where it could.
    file : Path
        Of the run; it is there where it has a score.
    """

    law: str
    reference: str
    seed: int
    score: Score | None
    reason: str
    file: Path

    def columns(self, *names: str) -> dict[str, np.ndarray]:
        """Read columns of the run's file."""
        return read_columns(self.file, names)


@dataclass(frozen=True, repr=False)
class ControlComparison(Shown):
    """Laws beside each other, simulated.

    Attributes
    ----------
    drive : str
        Name of the drive.
    tunings : dict
        Name of a law -> `Tuning`.
    references : dict
        Name -> `Reference`.
    setup : Setup
    setup_name : str
    runs : tuple of ControlledRun
    """

    drive: str
    tunings: dict[str, Tuning]
    references: dict[str, Reference]
    setup: Setup
    setup_name: str
    runs: tuple[ControlledRun, ...]

    def of(self, law: str, along: str) -> list[ControlledRun]:
        """Return the runs of a law along a reference, by seed."""
        return [run for run in self.runs if (run.law, run.reference) == (law, along)]

    def middle(self, law: str, along: str, measure: str) -> float | None:
        """Return the median of a measure over the seeds; None where the reference has no such part, or a run failed."""
        each = [None if run.score is None else getattr(run.score, measure) for run in self.of(law, along)]
        known = [float(value) for value in each if value is not None]
        return float(np.median(known)) if known and len(known) == len(each) else None

    def rows(self, along: str) -> list[tuple[str, ...]]:
        """Return a row for each law: its name and the medians, with units."""
        return [
            (law, *(written(name, self.middle(law, along, name)) for name in SHOWN), self._lost(law, along))
            for law in self.tunings
        ]

    def best(self, along: str) -> str | None:
        """Return the law with the smallest largest error along a reference; None where each law failed."""
        errors = {law: self.middle(law, along, "max_error_m") for law in self.tunings}
        known = {law: error for law, error in errors.items() if error is not None}
        return min(known, key=lambda law: known[law]) if known else None

    def _lost(self, law: str, along: str) -> str:
        lost = sum(run.score is None or run.score.lost for run in self.of(law, along))
        return f"{lost} of {len(self.of(law, along))}" if lost else ""

    def save(self, path: str | Path) -> Path:
        """Write the score of each run as CSV, a row for each law, reference and seed.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        import polars as pl

        names = list(Score.__dataclass_fields__)
        rows = [
            {"law": run.law, "reference": self.references[run.reference].text, "seed": run.seed, "reason": run.reason}
            | (dict.fromkeys(names) if run.score is None else run.score.to_dict())
            for run in self.runs
        ]
        write_frame(pl.DataFrame(rows, infer_schema_length=None), Path(path))
        return Path(path)

    def _card(self) -> Card:
        head = ("", *self.references)
        shown = "max_error_m"
        rows = [
            (law, *(written(shown, self.middle(law, one, shown)) for one in self.references)) for law in self.tunings
        ]
        return Card(f"{self.drive}, largest error, median of the seeds, simulated", head, rows)


def standard(drive: Drive | Circuit) -> dict[str, Reference]:
    """Return the standard references for a drive: R1 and R2 sines, R3 stairs, R5 a step and rest, R6 a long fast move.

    They are slowed where the drive could not follow.

    Raises
    ------
    DescriptionError
        The drive is none that a law can command.

    Examples
    --------
    >>> import pneudrive as pn
    >>> pn.control.standard(pn.Drive.load("catalogue:reference"))["R1"].text
    'sine 60 mm 0.5 Hz around 250 mm'
    """
    plant = tune(drive).plant
    return standard_references(plant.stroke_m, plant.speed_m_s)


def compare(
    drive: Drive | Circuit,
    laws: str | object | Sequence[str | Path | Tuning | object] = "all",
    references: str | Sequence[str | Path | Reference] | Mapping[str, Reference] = "standard",
    *,
    out: str | Path,
    seeds: int = 5,
    setup: Setup | str | Path = "real",
    believes: Drive | Circuit | None = None,
    rtol: float = RTOL,
    allow_code: str | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> ControlComparison:
    """Run laws along references with several seeds, and score them.

    Each run is a file in ``out/runs``, written whole or not at all; one that is there already is not run again, so that
    an interrupted comparison is resumed. Equal seeds give equal bits, but for the time of a step.

    Parameters
    ----------
    drive : Drive or Circuit
    laws : str or sequence
        ``"all"``, or words, controller files, tunings and laws of one's own, as for `pneudrive.control.run`.
    references : str, sequence or mapping
        ``"standard"``, names of standard references, or references as `pneudrive.control.reference` reads them.
    out : path-like
        Folder; it is made where it is not there.
    seeds : int
        Number of seeds, from 1 on.
    setup : Setup, str or path-like
    believes : Drive or Circuit, optional
        What the laws believe of the drive.
    rtol : float
    allow_code : str, optional
        SHA-256 of the file of a law of one's own that only a controller's file names.
    progress, cancel : optional
        See `pneudrive.watch.Watch`.

    Raises
    ------
    CommandError, DescriptionError
        As for `pneudrive.control.run`; the comparison has not begun then.
    Cancelled
        `cancel` was set; finished runs are kept.
    """
    watch = Watch(progress, cancel)
    told: dict[str, Any] = {"setup": setup, "believes": believes, "rtol": rtol, "allow_code": allow_code}
    return compare_watched(drive, laws, references, out=out, seeds=seeds, watch=watch, **told)


def compare_watched(
    drive: Drive | Circuit,
    asked_laws: str | object | Sequence[str | Path | Tuning | object],
    references: str | Sequence[str | Path | Reference] | Mapping[str, Reference],
    *,
    out: str | Path,
    seeds: int = 5,
    setup: Setup | str | Path = "real",
    believes: Drive | Circuit | None = None,
    rtol: float = RTOL,
    allow_code: str | None = None,
    watch: Watch = UNWATCHED,
) -> ControlComparison:
    """Compare, and report progress to a watch. Arguments and errors are those of `compare`."""
    if isinstance(seeds, bool) or not 1 <= seeds <= MOST_SEEDS:
        raise CommandError(f"seeds = {seeds} is out of bounds", rule=f"1 to {MOST_SEEDS}")
    read, name = read_setup(setup)
    tunings = _tunings(drive, asked_laws, {"setup": read, "believes": believes, "allow_code": allow_code})
    to_follow = _references(drive if believes is None else believes, references)
    prepared = {
        (law, along): prepare(drive, None, one, setup=read, controller=tuning, rtol=rtol)._replace(setup_name=name)
        for law, tuning in tunings.items()
        for along, one in to_follow.items()
    }
    folder = Path(out) / RUNS
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"the folder {folder} cannot be made", value=error.strerror) from None
    asked = [(law, along, seed) for along in to_follow for law in tunings for seed in range(1, seeds + 1)]
    runs = tuple(_kept(folder, prepared[one[:2]], *one) for one in watch.each(asked, "runs"))
    found = ControlComparison(drive.name, tunings, to_follow, read, name, runs)
    found.save(Path(out) / SCORES)
    return found


def _tunings(
    drive: Drive | Circuit, asked: str | object | Sequence[str | Path | Tuning | object], told: dict[str, Any]
) -> dict[str, Tuning]:
    each = laws() if asked == "all" else list(asked) if isinstance(asked, list | tuple) else [asked]
    out: dict[str, Tuning] = {}
    for one in each:
        if isinstance(one, Tuning):
            name, tuning = one.law, one
        elif is_own(one):
            tuning = tune(drive, one, **told)
            name = tuning.law
        elif str(one).endswith(".toml"):
            name, tuning = Path(str(one)).stem, tune(drive, controller=str(one), **told)
        else:
            name, tuning = str(one), tune(drive, str(one), **told)
        if name in out:
            raise CommandError(f"two laws are called {name}", remedy="Keep one of them, or rename its file.")
        out[name] = tuning
    if not out:
        raise CommandError("no law is given", remedy='For instance "pid, nmpc", or "all".')
    return out


def _references(
    drive: Drive | Circuit, asked: str | Sequence[str | Path | Reference] | Mapping[str, Reference]
) -> dict[str, Reference]:
    if isinstance(asked, Mapping):
        return dict(asked)
    usual = standard(drive)
    if asked == "standard":
        return usual
    out: dict[str, Reference] = {}
    for one in [asked] if isinstance(asked, str) else asked:
        read = usual[one] if isinstance(one, str) and one in usual else reference(one)
        out[one if isinstance(one, str) and one in usual else read.text] = read
    if not out:
        raise CommandError("no reference is given", remedy='For instance "standard".')
    return out


def _key(prepared: Prepared, seed: int) -> str:
    """Return the SHA-256 of all that decides a run."""
    decides = {
        "version": __version__,
        "drive": prepared.circuit.core_json(),
        "controller": prepared.tuning.core(),
        "motion": prepared.reference.core(),
        "setup": prepared.setup.core(seed, prepared.circuit.ambient.pressure_pa),
        "start": prepared.start,
        "duration_s": prepared.duration_s,
        "rtol": prepared.rtol,
    }
    if prepared.tuning.own is not None:
        decides["code"] = prepared.tuning.own.digest
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


def _kept(folder: Path, prepared: Prepared, law: str, along: str, seed: int) -> ControlledRun:
    """Return a run from its file, or run it and keep it."""
    key = _key(prepared, seed)
    plain = re.sub(r"[^A-Za-z0-9]+", "-", f"{law}_{along}").strip("-")[:60]
    file = folder / f"{plain}_{seed}_{key[:12]}.parquet"
    score = _score_in(file, key)
    if score is None:
        try:
            run = run_prepared(prepared, seed)
        except SimulationError as error:
            return ControlledRun(law, along, seed, None, error.what, file)
        save_columns(run.columns, run.provenance | {"key": key}, file)
        score = Score(**run.provenance["score"])
    return ControlledRun(law, along, seed, score, "", file)


def _score_in(file: Path, key: str) -> Score | None:
    """Return the score of a finished run; None where the file is not there, is damaged, or is of another run."""
    if not file.exists():
        return None
    try:
        table = open_table(file, "parquet")
    except RecordingError:
        return None
    said = json.loads(table.metadata.get("pneudrive", "{}"))
    if table.own is None or said.get("key") != key:
        return None
    return Score(**said["score"])
