"""Score card: runs of laws along references with the scores of each law, read from the folder of a comparison."""

from __future__ import annotations

import json
import math
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.control.results.measures import SHOWN, SPREAD_SHOWN, Score, written
from pneudrive.errors import CommandError
from pneudrive.files.content import read_json, read_text
from pneudrive.files.tables import open_table
from pneudrive.files.writing import open_to_append
from pneudrive.lazy_names import upper
from pneudrive.simulation.trajectory import read_columns, whole, write_frame
from pneudrive.views import ShownValue, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    import numpy as np

    from pneudrive.control.tuning import Tuning

RUNS, SCORES, KEPT, ABOUT = "runs", "score.csv", "scores.jsonl", "comparison.json"
TABLE = "score.parquet"
SO_FAR = "so-far.jsonl"  # a line for each finished run; removed after the tables are written
SHARES = (0.5, 0.95, 1.0)  # quantiles over the members of a spread that are reported
LONGEST_NAME = 24  # letters of a reference in a table
_TRUE = "true_"  # prefix of the columns of true values in the tables


class ControlledRun(NamedTuple):
    """One law along one reference with one seed.

    Attributes
    ----------
    law, reference : str
        Names in the comparison.
    seed : int
        Of the noise; in a spread also the member.
    score : Score or None
        None where the drive could not go on.
    reason : str
        Why it could not; empty where it could.
    file : Path
        Of the run; of a spread only the first member's is there, unless all were asked for.
    truth : dict
        Name of what differs from the description -> its value.
    """

    law: str
    reference: str
    seed: int
    score: Score | None
    reason: str
    file: Path
    truth: Mapping[str, float]

    def columns(self, *names: str) -> dict[str, np.ndarray]:
        """Read columns of the run's file."""
        return read_columns(self.file, names)


@dataclass(frozen=True, repr=False)
class ControlComparison(Viewed):
    """Simulated comparison of laws, as its folder holds it.

    Attributes
    ----------
    folder : Path
    drive : str
        Name of the drive.
    references : dict
        Name -> text.
    setup, mismatch, spread : str
        Names. An empty one: the drive is as described, and each run has its own seed.
    count : int
        Seeds, or members of the spread, of each law along each reference.
    about : dict
        All of ``comparison.json``: the gains and the assumed drive of each law, and the request.
    runs : tuple of ControlledRun
        As long as the comparison is not finished those that are done, without their true values.
    """

    folder: Path
    drive: str
    references: dict[str, str]
    setup: str
    mismatch: str
    spread: str
    count: int
    about: dict[str, Any]
    runs: tuple[ControlledRun, ...]

    @property
    def laws(self) -> list[str]:
        """Names of the laws."""
        return list(self.about["laws"])

    @property
    def is_finished(self) -> bool:
        """Whether all runs are done."""
        return (self.folder / TABLE).is_file()

    @property
    def truth(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of each deviation of the true drive."""
        each: dict[str, list[float]] = {}
        for run in self.runs:
            for name, value in run.truth.items():
                each.setdefault(name, []).append(value)
        return {name: (min(values), max(values)) for name, values in each.items()}

    def of(self, law: str, along: str) -> list[ControlledRun]:
        """Return the runs of a law along a reference, by seed."""
        return [run for run in self.runs if (run.law, run.reference) == (law, along)]

    def middle(self, law: str, along: str, measure: str) -> float | None:
        """Return the median of a measure over the seeds.

        None if the measure does not apply to the reference, or a run failed.
        """
        return self.within(law, along, measure, 0.5)

    def within(self, law: str, along: str, measure: str, share: float) -> float | None:
        """Return a quantile of a measure over the runs; a run that failed counts as infinite.

        None if the measure does not apply to the reference, or each run failed.
        """
        each = [None if run.score is None else getattr(run.score, measure) for run in self.of(law, along)]
        failed = sum(run.score is None for run in self.of(law, along))
        known = [float(value) for value in each if value is not None]
        if not known or len(known) + failed < len(each):
            return None
        found = sorted([*known, *[math.inf] * failed])
        place = share * (len(found) - 1)
        low, high = found[math.floor(place)], found[math.ceil(place)]
        return low if low == high else low + (place - math.floor(place)) * (high - low)

    def best(self, along: str, measure: str = "max_error_m") -> str | None:
        """Return the law with the smallest measure along a reference; None where each law failed."""
        errors = {law: self.middle(law, along, measure) for law in self.laws}
        known = {law: error for law, error in errors.items() if error is not None}
        return min(known, key=lambda law: known[law]) if known else None

    def lost(self, law: str, along: str) -> int:
        """Return the number of runs that failed or were lost."""
        return sum(run.score is None or run.score.lost for run in self.of(law, along))

    def values(self, along: str, measures: Collection[str] = ()) -> list[ShownValue]:
        """Return the measures that apply to a reference for each law: medians, or 50, 95 and 100 % of a spread.

        Parameters
        ----------
        along : str
        measures : collection of str
            Default: all, and of a spread those in `SPREAD_SHOWN`.
        """
        shares = SHARES if self.spread else SHARES[:1]
        label = along if len(along) <= LONGEST_NAME else f"reference {list(self.references).index(along) + 1}"
        out = []
        for name in SPREAD_SHOWN if self.spread else measures or SHOWN:
            cells = {
                law: [written(name, self.within(law, along, name, share)) for share in shares] for law in self.laws
            }
            if any(map(any, cells.values())):
                texts = (
                    (law, " / ".join(cell or "-" * (len(shares) > 1) for cell in each)) for law, each in cells.items()
                )
                out += [
                    ShownValue(f"{along}.{law}.{name}", f"{label}: {SHOWN[name][0]}", law, text) for law, text in texts
                ]
        lost = {law: (self.lost(law, along), len(self.of(law, along))) for law in self.laws}
        texts = ((law, f"{count} of {total}" if count else "") for law, (count, total) in lost.items())
        rows = [ShownValue(f"{along}.{law}.lost", f"{label}: lost", law, text) for law, text in texts]
        return out + (rows if any(count for count, _ in lost.values()) else [])

    def view(self) -> View:
        """Return the best law along each reference, the measures of all laws, their tracks, and the true drive."""
        return upper("controllers_view")(self)

    def save(self, path: str | Path) -> Path:
        """Write the score and true values of each run as CSV or Parquet: a row for each law, reference and seed.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        import polars as pl

        rows = [row_of(run, self.references[run.reference]) for run in self.runs]
        write_frame(pl.DataFrame(rows, infer_schema_length=None), Path(path))
        return Path(path)


def told(tunings: Mapping[str, Tuning]) -> dict[str, Any]:
    """Return the model of the drive and the gains of each law as plain data."""
    first = next(iter(tunings.values()))
    laws = {
        name: {
            "law": tuning.law,
            "period_s": tuning.period_s,
            "believes": tuning.belief.name,
            "belief_hash": tuning.belief.description_hash,
            "adaptation": tuning.adaptation,
            "gains": [
                {**gain._asdict(), "written": str(gain), "rule": "given" if gain.given else gain.rule}
                for gain in tuning.gains
            ],
            "limits": list(tuning.limits),
        }
        for name, tuning in tunings.items()
    }
    return {"laws": laws, "plant": [list(row) for row in first.plant.rows()]}


def begin(folder: Path, about: Mapping[str, Any]) -> None:
    """Write the compared laws into a folder; scores of another comparison are removed from it.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    text = json.dumps({"schema": 1, **about}, indent=1) + "\n"
    path = folder / ABOUT
    try:
        if path.exists() and path.read_text("utf-8") == text:
            return
        for name in (SCORES, TABLE):
            (folder / name).unlink(missing_ok=True)
        with whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError(f"{path} cannot be written", value=str(error)) from None


def row_of(run: ControlledRun, reference: str) -> dict[str, Any]:
    """Return the row of a run in the tables: law, reference, seed, reason, its score, its file, true values."""
    names = [one.name for one in fields(Score)]
    row: dict[str, Any] = {"law": run.law, "reference": reference, "seed": run.seed, "reason": run.reason}
    row |= dict.fromkeys(names) if run.score is None else run.score.to_dict()
    row["run"] = run.file.name if run.file.is_file() else None
    return row | {f"{_TRUE}{name}": value for name, value in run.truth.items()}


def read_comparison(folder: str | Path) -> ControlComparison:
    """Read the folder of a comparison that `compare` made.

    Parameters
    ----------
    folder : path-like

    Raises
    ------
    CommandError
        The folder is none of a comparison, or what is in it is damaged.

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
        raise CommandError(f"{place} is no comparison", rule=f"a folder with {ABOUT}", remedy="Name its --out.")
    about = read_json(path, CommandError)
    try:
        asked: dict[str, Any] = {name: str(about[name]) for name in ("drive", "setup", "mismatch", "spread")}
        asked |= {"references": dict(about["references"]), "count": int(about["count"]), "about": dict(about)}
        runs = _runs(place, asked["references"])
        if not isinstance(about["laws"], dict) or not isinstance(about["plant"], list):
            raise TypeError("laws or plant")
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise CommandError(f"{path} is damaged", value=str(error), remedy="Run the comparison again.") from None
    return ControlComparison(place, runs=runs, **asked)


def _runs(folder: Path, references: Mapping[str, str]) -> tuple[ControlledRun, ...]:
    import polars as pl

    path = folder / TABLE
    if not path.is_file():
        return tuple(_so_far(folder, references))
    if not open_table(path, "parquet", CommandError).is_sealed:  # its hash shows that this package wrote the bytes
        raise CommandError(f"{path} is damaged or was changed", remedy="Run the comparison again.")
    table = pl.read_parquet(path)
    measures = [one.name for one in fields(Score)]
    true = [name for name in table.columns if name.startswith(_TRUE)]
    out, times = [], Counter[tuple[str, str, int]]()  # two names may have equal texts: their runs come in this order
    for row in table.iter_rows(named=True):
        score = None if row["reason"] else Score(**{name: row[name] for name in measures})
        truth = {name.removeprefix(_TRUE): row[name] for name in true if row[name] is not None}
        file = folder / RUNS / Path(row["run"] or "none.parquet").name
        law, text, seed = row["law"], row["reference"], row["seed"]
        along = [name for name, own in references.items() if own == text][times[law, text, seed]]
        times[law, text, seed] += 1
        out.append(ControlledRun(law, along, seed, score, row["reason"], file, truth))
    return tuple(out)


def tell(folder: Path, run: ControlledRun) -> None:
    """Add a finished run to the results."""
    said = {"law": run.law, "reference": run.reference, "seed": run.seed, "reason": run.reason, "run": run.file.name}
    said["score"] = None if run.score is None else run.score.to_dict()
    with open_to_append(folder / SO_FAR) as file:
        file.write(json.dumps(said) + "\n")


def _so_far(folder: Path, references: Mapping[str, str]) -> Iterator[ControlledRun]:
    text = ""
    with suppress(CommandError):  # no run is finished, or there are so many that they are reported at the end
        text = read_text(folder / SO_FAR, CommandError)
    for line in text.splitlines():
        with suppress(ValueError, LookupError, TypeError):  # an incomplete line: still being written, or cut by a kill
            one = json.loads(line)
            score = None if one["score"] is None else Score(**one["score"])
            file = folder / RUNS / Path(one["run"]).name
            if one["reference"] in references:
                yield ControlledRun(one["law"], one["reference"], int(one["seed"]), score, one["reason"], file, {})


def finished(folder: Path) -> int:
    """Count the runs in the folder of this comparison, or of an earlier one."""
    files = sum(1 for _ in (folder / RUNS).glob("[!.]*.parquet"))
    with suppress(OSError):
        files += (folder / KEPT).read_bytes().count(b"\n")
    return files
