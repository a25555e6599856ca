"""Benchmark of controllers along references: scored runs, their folder, and the view of the comparison."""

from __future__ import annotations

import hashlib
import json
import math
import re
import threading
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from pneudrive.arrays import Columns, Keyed, NamedIntervals, NamedNumbers, Plain, attributes_of
from pneudrive.batching import processors
from pneudrive.control.loop import RTOL, Prepared, deviating, prepare, run_prepared
from pneudrive.control.mismatch import Mismatch, MismatchOrFile, read_mismatch
from pneudrive.control.motion import NAMES, USUAL, Reference, ReferenceOrFile, named_or_read, reference
from pneudrive.control.own_law import is_own
from pneudrive.control.scores import SHOWN, SPREAD_SHOWN, Score, written
from pneudrive.control.setup import SetupOrFile, read_setup
from pneudrive.control.tuning import Tuning, laws, tune
from pneudrive.errors import CommandError, RecordingError, SimulationError
from pneudrive.files.content import read_json, read_text
from pneudrive.files.inputs import INPUTS, inputs_of, stored_beside
from pneudrive.files.tables import open_table
from pneudrive.files.writing import make_subfolder, open_to_append
from pneudrive.lazy_names import upper
from pneudrive.own_code import split
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.simulation.simulate import whole_number
from pneudrive.simulation.start import DriveOrCircuit
from pneudrive.simulation.trajectory import read_columns, save_columns, write_frame, write_whole
from pneudrive.views import ShownValue, View, Viewed

References = ReferenceOrFile | Sequence[ReferenceOrFile] | Mapping[str, ReferenceOrFile]


# --- Score card: runs of laws along references with the scores of each law, read from the folder of a comparison.

RUNS, SCORES, KEPT, ABOUT = "runs", "score.csv", "scores.jsonl", "comparison.json"
TABLE = "score.parquet"
SO_FAR = "so-far.jsonl"  # a line for each finished run; removed after the tables are written
SHARES = (0.5, 0.95, 1.0)  # quantiles over the members of a spread that are reported
LONGEST_NAME = 24  # letters of a reference in a table
_TRUE = "true_"  # prefix of the columns of true values in the tables


class ControlledRun(NamedTuple):
    """Run of a controller along a reference, with one seed.

    Attributes
    ----------
    law, reference : str
        Names in the comparison.
    seed : int
        Seed of the noise; in a spread, also the number of the member.
    score : Score or None
        None if the run failed.
    reason : str
        Reason of the failure; empty for a successful run.
    file : Path
        File of the run. A spread keeps only the file of its first member.
    truth : dict
        Name of each value that differs from the description -> the true value.
    """

    law: str
    reference: str
    seed: int
    score: Score | None
    reason: str
    file: Path
    truth: NamedNumbers

    def columns(self, *names: str) -> Columns:
        """Return columns from the file of the run, by name."""
        return read_columns(self.file, names)


@dataclass(frozen=True, repr=False)
class ControlComparison(Viewed):
    """Simulated comparison of controllers, as stored in its folder.

    Attributes
    ----------
    folder : Path
    drive : str
        Name of the drive.
    references : dict
        Name -> text.
    setup, mismatch, spread : str
        Names of instrumentation, mismatch and spread. If mismatch and spread are empty, runs differ only in the seed.
    count : int
        Number of seeds, or of members of the spread, for each law and reference.
    about : dict
        Content of ``comparison.json``: the gains and the assumed drive of each law, and the request.
    runs : tuple of ControlledRun
        The finished runs. Their `truth` is empty until the comparison is finished.
    """

    folder: Path
    drive: str
    references: dict[str, str]
    setup: str
    mismatch: str
    spread: str
    count: int
    about: Plain
    runs: tuple[ControlledRun, ...]

    @property
    def laws(self) -> list[str]:
        """Names of the compared laws."""
        return list(self.about["laws"])

    @property
    def is_finished(self) -> bool:
        """Whether all runs are done."""
        return (self.folder / TABLE).is_file()

    @property
    def truth(self) -> NamedIntervals:
        """Least and largest true value of each number that deviates from the description."""
        names = dict.fromkeys(name for run in self.runs for name in run.truth)
        each = {name: [run.truth[name] for run in self.runs if name in run.truth] for name in names}
        return {name: (min(values), max(values)) for name, values in each.items()}

    def of(self, law: str, along: str) -> list[ControlledRun]:
        """Return the runs of a law along a reference, sorted by seed."""
        return [run for run in self.runs if (run.law, run.reference) == (law, along)]

    def middle(self, law: str, along: str, measure: str) -> float | None:
        """Return the median of a measure over the seeds.

        A failed run has an infinite value. None if the measure does not apply to the reference, or if all runs failed.
        """
        return self.within(law, along, measure, 0.5)

    def within(self, law: str, along: str, measure: str, share: float) -> float | None:
        """Return the quantile `share` of a measure over the runs. A failed run has an infinite value.

        None if the measure does not apply to the reference, or if all runs failed.
        """
        scores = [run.score for run in self.of(law, along)]
        values = [math.inf if score is None else getattr(score, measure) for score in scores]
        if None in values or not any(scores):
            return None
        found = sorted(map(float, values))
        place = share * (len(found) - 1)
        low, high = found[math.floor(place)], found[math.ceil(place)]
        return low if low == high else low + (place - math.floor(place)) * (high - low)

    def best(self, along: str, measure: str = "max_error_m") -> str | None:
        """Return the controller with the smallest median of a measure along a reference; None if all failed."""
        known = {law: error for law in self.laws if (error := self.middle(law, along, measure)) is not None}
        return min(known, key=lambda law: known[law], default=None)

    def lost(self, law: str, along: str) -> int:
        """Return the number of runs that failed, or whose error exceeded 20 mm."""
        return sum(run.score is None or run.score.lost for run in self.of(law, along))

    def values(self, along: str, measures: Collection[str] = ()) -> list[ShownValue]:
        """Return each law's applicable measures along a reference: medians, or 50, 95 and 100 % quantiles of a spread.

        Parameters
        ----------
        along : str
        measures : collection of str
            Default: all measures; for a spread, those in `SPREAD_SHOWN`.
        """
        shares, empty = (SHARES, "-") if self.spread else (SHARES[:1], "")
        label = along if len(along) <= LONGEST_NAME else f"reference {list(self.references).index(along) + 1}"

        def text(law: str, name: str) -> str:
            return " / ".join(written(name, self.within(law, along, name, share)) or empty for share in shares)

        names = SPREAD_SHOWN if self.spread else measures or SHOWN
        columns = {name: (SHOWN[name][0], {law: text(law, name) for law in self.laws}) for name in names}
        lost = {law: (self.lost(law, along), len(self.of(law, along))) for law in self.laws}
        columns["lost"] = "lost", {law: f"{count} of {total}" * (count > 0) for law, (count, total) in lost.items()}
        return [
            ShownValue(f"{along}.{law}.{name}", f"{label}: {title}", law, text)
            for name, (title, texts) in columns.items()
            if any(text.strip("- /") for text in texts.values())
            for law, text in texts.items()
        ]

    def view(self) -> View:
        """Return a view: best law along each reference, measures and tracks of all laws, and true drive values."""
        return upper("controllers_view")(self)

    def save(self, path: str | Path) -> Path:
        """Write the score and true values of each run as CSV or Parquet: a row for each law, reference and seed.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        import polars as pl

        names, rows = [one.name for one in fields(Score)], []
        for run in self.runs:
            score = dict.fromkeys(names) if run.score is None else run.score.to_dict()
            about = attributes_of(run, "law", "reference", "seed", "reason")
            about |= {"reference": self.references[run.reference], **score}
            about |= {"run": run.file.name if run.file.is_file() else None}
            rows.append(about | {f"{_TRUE}{name}": value for name, value in run.truth.items()})
        write_frame(pl.DataFrame(rows, infer_schema_length=None), Path(path))
        return Path(path)


def assumptions(tunings: Mapping[str, Tuning]) -> Plain:
    """Return the model of the drive and the gains of each law as plain data."""
    first = next(iter(tunings.values()))
    laws = {
        name: {
            "law": tuning.law,
            "period_s": tuning.period_s,
            "believes": tuning.belief.name,
            "belief_hash": tuning.belief.description_hash,
            "adaptation": tuning.controller.adaptation,
            "gains": [
                {**gain._asdict(), "written": str(gain), "rule": "given" if gain.given else gain.rule}
                for gain in tuning.gains
            ],
            "limits": list(tuning.limits),
        }
        for name, tuning in tunings.items()
    }
    return {"laws": laws, "plant": [list(row) for row in first.plant.rows()]}


def store_about(folder: Path, about: Keyed) -> None:
    """Write the description of a comparison into a folder, and remove the scores of the previous comparison.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    path = folder / ABOUT
    try:
        for name in (SCORES, TABLE, SO_FAR):
            (folder / name).unlink(missing_ok=True)
        write_whole(path, json.dumps({"schema": 1, **about}, indent=1) + "\n")
    except OSError as error:
        raise CommandError(f"{path} cannot be written", value=str(error)) from None


def read_comparison(folder: str | Path) -> ControlComparison:
    """Read a comparison from the folder that `pneudrive.control.benchmark` wrote.

    Parameters
    ----------
    folder : path-like

    Raises
    ------
    CommandError
        The folder does not hold a comparison, or its content is damaged.

    Examples
    --------
    >>> import tempfile
    >>> import pneudrive as pn
    >>> drive, steps = pn.Drive.load("catalogue:reference"), "250 mm; 0.1 s: 260 mm in 0.2 s"
    >>> made = tempfile.mkdtemp()
    >>> _ = pn.control.benchmark(drive, ["pid", "inversion"], [steps], seeds=1, out=made)
    >>> pn.control.read_comparison(made).best(steps)
    'inversion'
    """
    place = Path(folder)
    path = place / ABOUT
    if not path.is_file():
        raise CommandError(f"{place} is not a comparison", rule=f"a folder with {ABOUT}", remedy="Give its folder.")
    about = read_json(path, CommandError)
    try:
        asked: Plain = {name: str(about[name]) for name in ("drive", "setup", "mismatch", "spread")}
        asked |= {"references": dict(about["references"]), "count": int(about["count"]), "about": dict(about)}
        if not isinstance(about["laws"], dict) or not isinstance(about["plant"], list):
            raise TypeError("laws or plant")
        runs = tuple((_finished if (place / TABLE).is_file() else _running)(place, about))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise CommandError(f"{path} is damaged", value=str(error), remedy="Run the comparison again.") from None
    return ControlComparison(place, runs=runs, **asked)


def _running(folder: Path, about: Keyed) -> list[ControlledRun]:
    """Return the runs that are finished so far."""
    text = ""
    with suppress(CommandError):  # no run is finished, or there are so many that they are reported at the end
        text = read_text(folder / SO_FAR, CommandError)
    lines = _logged(text, "law", "reference", "seed", "reason", "run")
    return [
        ControlledRun(law, along, seed, score, reason, folder / RUNS / Path(file).name, {})
        for score, (law, along, seed, reason, file) in lines
        if along in about["references"]
    ]


def _finished(folder: Path, about: Keyed) -> Iterator[ControlledRun]:
    """Yield the runs of a finished comparison. Its table has a row for each reference, law and seed in this order."""
    import polars as pl

    path = folder / TABLE
    if not open_table(path, "parquet", CommandError).is_sealed:  # its hash shows that this package wrote the bytes
        raise CommandError(f"{path} is damaged or was changed", remedy="Run the comparison again.")
    measures = [one.name for one in fields(Score)]
    keys = product(about["references"], about["laws"], range(1, about["count"] + 1))
    for (along, law, seed), row in zip(keys, pl.read_parquet(path).iter_rows(named=True), strict=True):
        score = None if row["reason"] else Score(**{name: row[name] for name in measures})
        truth = {name.removeprefix(_TRUE): value for name, value in row.items() if name.startswith(_TRUE)}
        truth = {name: value for name, value in truth.items() if value is not None}
        file = folder / RUNS / Path(row["run"] or "none.parquet").name
        yield ControlledRun(law, along, seed, score, row["reason"], file, truth)


def _log(path: Path, score: Score | None, entry: Plain) -> None:
    """Add the line of a finished run to a file."""
    with open_to_append(path) as file:
        file.write(json.dumps(entry | {"score": None if score is None else score.to_dict()}) + "\n")


def _logged(text: str, *keys: str) -> Iterator[tuple[Score | None, list[Any]]]:
    """Yield score and entries of each line that `_log` wrote."""
    for line in text.splitlines():
        with suppress(ValueError, LookupError, TypeError):  # an incomplete line: still being written, or cut by a kill
            entry = json.loads(line)
            yield None if entry["score"] is None else Score(**entry["score"]), [entry[key] for key in keys]


# --- Comparison of laws along references with seeds or members of a spread; each run is kept as a file or a score.

STEP_REPEATS = 3  # repeats of each step of kept runs, to measure its undisturbed time


@lru_cache(maxsize=1)
def core_hash() -> str:
    """Return the SHA-256 of the core in use. Results of another core may differ in their last bits."""
    from pneudrive import _core

    return hashlib.sha256(Path(_core.__file__).read_bytes()).hexdigest()


def mark_of(out: Path, tunings: Mapping[str, Tuning]) -> str:
    """Return an identifier for runs of custom laws: a new one if the comparison is finished or the code has changed.

    Input files of custom code are unknown and cannot be part of the identifier.
    """
    own = [split(tuning.own.name) for tuning in tunings.values() if tuning.own is not None]
    if not own:
        return ""
    about, folders = out / ABOUT, [Path(code[0]).parent for code in own if code is not None]
    with suppress(CommandError, OSError, LookupError, TypeError):  # there is no comparison, or it is damaged
        began = about.stat().st_mtime
        changed = any(path.stat().st_mtime > began for folder in folders for path in folder.glob("*.py"))
        if not changed and not (out / TABLE).exists():
            return str(read_json(about, CommandError)["mark"]) or uuid.uuid4().hex
    return uuid.uuid4().hex


def key_of(prepared: Prepared, seed: int, mark: str) -> str:
    """Return the SHA-256 of all inputs that determine a run and its score."""
    decides = {
        "core": core_hash(),
        "measures": list(Score.__dataclass_fields__),
        "drive": prepared.core_json,
        "controller": prepared.tuning.core(),
        "motion": prepared.reference.core(),
        "setup": prepared.setup.core(seed, prepared.circuit.ambient.pressure_pa),
        **attributes_of(prepared, "start", "duration_s"),
        "rtol": RTOL,
    }
    if prepared.tuning.own is not None:
        own = prepared.tuning.own
        decides["code"] = [own.digest, (split(own.name) or ("", own.name))[1], mark]  # a file may hold several laws
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


class Store:
    """Store of the runs of a comparison: a file for each kept run, and a line with the score for every other run.

    Attributes
    ----------
    known : dict
        Key of a run -> its score and the reason of its failure, from lines that the folder already has.
    """

    def __init__(self, out: Path, *, spread: Mismatch | None, mark: str) -> None:
        self.folder, self.lines, self.so_far = out / RUNS, out / KEPT, out / SO_FAR
        self.spread, self.mark = spread, mark
        self.lock = threading.Lock()
        make_subfolder(self.folder)
        try:
            text = self.lines.read_text("utf-8", "replace") if self.lines.exists() else ""
        except OSError as error:
            raise CommandError.of("control.not_readable", path=self.lines, value=error.strerror) from None
        self.known = {str(key): (score, str(reason)) for score, (key, reason) in _logged(text, "key", "reason")}
        if text and not text.endswith("\n"):
            with open_to_append(self.lines) as file:
                file.write("\n")

    def run(self, prepared: Prepared, along: str, law: str, seed: int) -> ControlledRun:
        """Return a stored run. If it is not stored, simulate and store it."""
        prepared = true_drive(prepared, self.spread, seed)
        key = key_of(prepared, seed, self.mark)
        plain = re.sub(r"[^A-Za-z0-9]+", "-", f"{law}_{along}").strip("-")[:60]
        file = self.folder / f"{plain}_{seed}_{key[:12]}.parquet"
        is_kept = self.spread is None or seed == 1
        score, reason = self.known.get(key, (None, ""))
        if is_kept and not reason:
            score = _score_in(file)
        if score is None and not reason:
            try:
                run = run_prepared(prepared._replace(step_repeats=STEP_REPEATS if is_kept else 1), seed)
            except SimulationError as error:
                reason = error.what
            else:
                score = Score(**run.provenance["score"])
                if is_kept:
                    save_columns(run.columns, run.provenance | {"key": key}, file)
            if reason or not is_kept:
                with self.lock:
                    _log(self.lines, score, {"key": key, "reason": reason})
        with self.lock:
            entry = {"law": law, "reference": along, "seed": seed, "reason": reason, "run": file.name}
            _log(self.so_far, score, entry)
        return ControlledRun(law, along, seed, score, reason, file, prepared.deviations)


def _score_in(file: Path) -> Score | None:
    """Return the score of a finished run; None if the file is missing or damaged."""
    with suppress(RecordingError):
        if file.exists() and (table := open_table(file, "parquet")).is_sealed:
            return Score(**json.loads(table.metadata["pneudrive"])["score"])
    return None


MOST_SEEDS = 100_000
MEMBERS = 200  # members of a spread by default
SPREAD_SEED = 0


def standard(drive: DriveOrCircuit) -> dict[str, Reference]:
    """Return the standard references for a drive, slowed if they exceed 85 % of its speeds at full opening.

    R1 and R2 are sines of 60 mm about mid stroke, at 0.5 and 1 Hz. R3 moves 60 mm forth and back in 0.3 s, then to 0.8
    and to 0.2 of the stroke. R4 has ramps of 1, 10 and 100 mm/s. R5 moves 60 mm in 0.3 s and rests for 40 s. R6 moves
    over 0.6 of the stroke in 0.25 s.
    For a stroke below 200 mm, 0.3 of the stroke replaces 60 mm. `feasibility` also checks whether the force suffices.

    Raises
    ------
    DescriptionError
        No law can command the drive.

    Examples
    --------
    >>> import pneudrive as pn
    >>> pn.control.standard(pn.Drive.load("catalogue:reference"))["R1"].text
    'sine 60 mm 0.5 Hz around 250 mm'
    """
    reach = tune(drive).reach
    return {name: named_or_read(name, *reach) for name in NAMES}


def benchmark(
    drive: DriveOrCircuit,
    laws: object = "all",
    references: References = "standard",
    *,
    out: str | Path,
    seeds: int = 5,
    setup: SetupOrFile = "real",
    mismatch: MismatchOrFile | None = None,
    spread: MismatchOrFile | None = None,
    members: int | None = None,
    threads: int | None = None,
    allow_code: str | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
    named: str = "",
) -> ControlComparison:
    """Run laws along references with several seeds, and score them.

    Each run is a file in ``out/runs``, written completely or not at all. Runs that are already in the folder are not
    repeated, so an interrupted comparison is resumed. Runs with the same seed are bit-identical, except for step times.
    Custom laws are run again after a finished comparison, because their code may read other files.

    Parameters
    ----------
    drive : Drive or Circuit
    laws : str or sequence
        ``"all"``, or names, controller files, tunings and custom laws, as for `pneudrive.control.run`.
    references : str, path-like, Reference, sequence or mapping
        ``"standard"``, names of standard references, or references as `pneudrive.control.reference` reads them: one
        reference, a sequence, or a mapping from names to references.
    out : path-like
        Folder; it is made if it does not exist.
    seeds : int
        Number of seeds. The seeds are 1, 2, 3 and so on.
    setup : Setup, str or path-like
    mismatch : Mismatch, str or path-like, optional
        Deviation of the simulated drive from `drive`, as for `pneudrive.control.run`.
    spread : Mismatch, str or path-like, optional
        ``"standard"``, or a TOML file with ranges. Members replace the seeds, and each member is a different drive.
    members : int, optional
        Number of members of the spread; 200 by default. Member 1, for example, is the same drive in every comparison.
    threads : int, optional
        Number of simultaneous runs; by default the number of processors. Results do not depend on this number. Custom
        laws run one after the other.
    allow_code : str, optional
        SHA-256 of the file of a custom law; required if only a controller file names this law.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.
    named : str
        Name of the drive on a command line. The folder stores it, so that the command can be repeated.

    Raises
    ------
    CommandError, DescriptionError
        As for `pneudrive.control.run`, before the first run.
    Cancelled
        `cancel` was set; finished runs are kept.
    """
    if spread is not None and mismatch is not None:
        raise CommandError.of("control.spread_and_mismatch")
    if spread is None and members is not None:
        raise CommandError(f"members = {members} needs a spread", remedy='Give a spread, for instance "standard".')
    folder = Path(out)
    given = ("seeds", seeds) if spread is None else ("members", MEMBERS if members is None else members)
    count = whole_number(*given, 1, MOST_SEEDS)
    own, of_spread = (None, "") if spread is None else read_mismatch(spread)
    read, name = read_setup(setup)
    tunings = _tunings(drive, laws, {"setup": read, "allow_code": allow_code})
    at_once = processors() if threads is None else whole_number("threads", threads, 1, MOST_SEEDS)
    if any(tuning.own is not None for tuning in tunings.values()):  # all runs share the object of a custom law
        at_once = 1
    to_follow = _references(drive, references)
    prepared = {
        (along, law): prepare(drive, None, one, setup=setup, controller=tuning, mismatch=mismatch)
        for along, one in to_follow.items()
        for law, tuning in tunings.items()
    }
    store = Store(folder, spread=own, mark=mark_of(folder, tunings))
    first = next(iter(prepared.values()))
    true_drive(first, own, 1)  # before the scores of another comparison go: does the spread fit the drive?
    about: Plain = {"drive": drive.name, "setup": name, "setup_about": read.about, "mismatch": first.mismatch}
    about |= {"spread": of_spread, "count": count, "rtol": RTOL, "mark": store.mark, **_assumed(to_follow, tunings)}
    asked = {"drive": named, "laws": laws, "references": references, "setup": setup, "mismatch": mismatch}
    asked |= {"spread": spread, "count": count}
    about |= {"asked": json.loads(json.dumps(asked, default=lambda _: None)) if named else None}
    store_about(folder, stored_beside(about, folder))
    with ThreadPoolExecutor(at_once) as pool:
        try:
            # Members outermost, so that each of their circuits is compiled once.
            each = product(range(1, count + 1), prepared)
            futures = {(seed, key): pool.submit(store.run, prepared[key], *key, seed) for seed, key in each}
            for future in Watch(progress, cancel).each(futures.values(), "runs"):
                future.result()
        finally:  # after an exception, runs that have not begun are cancelled
            pool.shutdown(wait=False, cancel_futures=True)
    runs = [futures[seed, key].result() for key in prepared for seed in range(1, count + 1)]
    made = replace(read_comparison(folder), runs=tuple(runs))
    for table in (SCORES, TABLE):
        made.save(folder / table)
    (folder / SO_FAR).unlink(missing_ok=True)
    return made


def true_drive(described: Prepared, spread: Mismatch | None, member: int) -> Prepared:
    """Return the inputs of a run, for one member of a spread or, without a spread, for the described drive."""
    return described if spread is None else deviating(described, spread, spread.drawn(SPREAD_SEED, member))


def _assumed(references: Mapping[str, Reference], tunings: Mapping[str, Tuning]) -> Plain:
    """Return references and assumptions of a comparison as plain data."""
    missed = {along: motion.points_missed_m for along, motion in references.items()}
    return assumptions(tunings) | {
        "references": {along: motion.text for along, motion in references.items()},
        "points_missed_m": {along: far for along, far in missed.items() if far is not None},
        INPUTS: [one for tuning in tunings.values() for one in inputs_of(tuning.belief)],
    }


def _tunings(drive: DriveOrCircuit, asked: object, options: Plain) -> dict[str, Tuning]:
    each = laws() if asked == "all" else list(asked) if isinstance(asked, list | tuple) else [asked]
    out: dict[str, Tuning] = {}
    for one in each:
        is_file = isinstance(one, str | Path) and str(one).endswith(".toml")
        source = {"controller": one} if is_file else {"law": one if is_own(one) else str(one)}
        tuning = one if isinstance(one, Tuning) else tune(drive, **source, **options)
        name = Path(str(one)).stem if is_file else tuning.law
        if name in out:
            raise CommandError(f"two laws are called {name}", remedy="Keep one of them, or rename its file.")
        out[name] = tuning
    if not out:
        raise CommandError("no law is given", remedy='Give for instance "pid, nmpc", or "all".')
    return out


def _references(drive: DriveOrCircuit, asked: References) -> dict[str, Reference]:
    if not asked:
        raise CommandError("no reference is given", remedy='Give for instance "standard".')
    if isinstance(asked, Mapping):
        return {name: reference(one) for name, one in asked.items()}
    if isinstance(asked, str) or not isinstance(asked, Iterable):
        asked = USUAL if asked == "standard" else [asked]
    reach = tune(drive).reach
    out: dict[str, Reference] = {}
    for one in asked:
        is_name = isinstance(one, str) and one in NAMES
        read = named_or_read(one, *reach) if is_name else reference(one)
        name = str(one) if is_name else read.text
        if out.setdefault(name, read) != read:
            raise CommandError(f'two references are called "{name}"', remedy='Give them names: {"first": ..., ...}.')
    return out
