"""The search: choices of parts in the order of the air that they need, tuned, simulated over the spreads, ranked.

Each choice is a pure function of the task and its parts, so a folder of finished ones is resumed by what is missing.
The search ends when none of the rest can rank among the ten best: a cycle needs at least a known share of the air that
fills both sides.
"""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError
from pneudrive.sizing import judge
from pneudrive.sizing.choices import choices, combined
from pneudrive.sizing.folder import SizingFolder
from pneudrive.sizing.prune import SafeBounds, air_estimate_kg
from pneudrive.sizing.result import WRITTEN, SizedDrive, SizingResult, nearest_miss
from pneudrive.sizing.strokes import COARSE, RTOL, DriveStrokes, Setting, points
from pneudrive.sizing.task import SizingTask
from pneudrive.sizing.tune import HOPELESS, Tuned, tune
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.sizing.choices import DriveChoice
    from pneudrive.sizing.prune import Shortage
    from pneudrive.watch import Flag

    Array = NDArray[np.float64]

#: Draws of each choice, and of the ten best.
DRAWS, DRAWS_BEST = 256, 1024
#: The same as a factor, which the command takes for any number of draws.
DRAWS_BEST_OF = DRAWS_BEST // DRAWS
#: Choices that are simulated at least, where there are so many.
LEAST = 100
#: Choices that are tuned at most.
MOST = 3000
#: Before the air of any choice is known, a cycle takes at least this share of the air that fills both sides (assumed);
#: afterwards the least share that was found, less a reserve.
LEAST_AIR, RESERVE = 0.75, 0.95


def is_of_command(asked: Mapping[str, int]) -> bool:
    """Whether the command can ask for these numbers of a search: it leaves `most` and the draws of the best alone."""
    return asked["draws_best"] == DRAWS_BEST_OF * asked["draws"] and asked["most"] == MOST


def size(
    task: SizingTask | Mapping[str, Any] | str | Path,
    *,
    least: int = LEAST,
    most: int = MOST,
    draws: int = DRAWS,
    draws_best: int = DRAWS_BEST,
    out: str | Path | None = None,
    threads: int | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> SizingResult:
    """Find the drives of the catalogue that do a task, by simulation over the spreads that it gives.

    Parameters
    ----------
    task : SizingTask, dict or path-like
        Or a TOML file.
    least : int
        Choices of parts that are simulated at least, those of least air first, also where the best are known before.
    most : int
        Choices that are tuned at most; the result says where that ended the search.
    draws, draws_best : int
        Draws of each choice and of the ten best: points of a scrambled Sobol sequence, the same for all; powers of 2.
    out : path-like, optional
        Folder for the results. A search that was interrupted goes on there.
    threads : int, optional
        Default: all processors.
    progress, cancel : optional
        See `pneudrive.watch.Watch`.

    Returns
    -------
    SizingResult

    Raises
    ------
    DescriptionError
        The task is not valid.
    CommandError
        A number is not positive, or `out` holds another task or cannot be written to.
    Cancelled
        `cancel` was set; finished choices in `out` are kept.

    Examples
    --------
    >>> import pneudrive as pn
    >>> task = {"mass": "2 kg", "stroke": "100 mm", "time": "0.5 s", "supply": {"pressure": "6 bar gauge"}}
    >>> task["exclude"] = ["parker*", "pneumax*", "smc-c*", "ckd*", "festo-gr*", "smc-tu0[48]*", "smc-tu1*"]
    >>> found = pn.size(task, draws=16, draws_best=16)
    >>> found.best.parts["cylinder"]
    'festo-dsbg-32-100'
    """
    options: dict[str, Any] = {"least": least, "most": most, "draws": draws, "draws_best": draws_best}
    return watched(task, Watch(progress, cancel), **options, out=out, threads=threads)


def watched(
    task: SizingTask | Mapping[str, Any] | str | Path,
    watch: Watch,
    *,
    least: int = LEAST,
    most: int = MOST,
    draws: int = DRAWS,
    draws_best: int = DRAWS_BEST,
    out: str | Path | None = None,
    threads: int | None = None,
) -> SizingResult:
    """Run `size` under a watch."""
    for name, value in (("least", least), ("draws", draws), ("draws_best", draws_best), ("most", most)):
        if value < 1:
            raise CommandError(f"{name} = {value} is out of bounds", rule="at least 1")
    read = _read(task)
    with nullcontext() if out is None else SizingFolder(Path(out), read, (draws, draws_best)) as folder:
        return Search(read, least, most, (draws, draws_best), threads, watch, folder).result()


def _read(task: SizingTask | Mapping[str, Any] | str | Path) -> SizingTask:
    if isinstance(task, SizingTask):
        return task
    return SizingTask.load(task) if isinstance(task, str | Path) else SizingTask.model_validate(task)


class Search:
    """One search.

    Parameters
    ----------
    task : SizingTask
    least, most : int
    draws : tuple of int
        Of each choice and of the ten best.
    threads : int or None
    watch : Watch
    folder : SizingFolder or None
    """

    def __init__(
        self,
        task: SizingTask,
        least: int,
        most: int,
        draws: tuple[int, int],
        threads: int | None,
        watch: Watch,
        folder: SizingFolder | None,
    ) -> None:
        self.task, self.least, self.most, self.draws = task, least, most, draws
        self.threads, self.watch, self.folder = threads, watch, folder
        self.points = points(max(draws))
        self.simulated: list[SizedDrive] = []
        self.short: list[tuple[DriveChoice, Tuned]] = []
        self.outdone = 0
        self._slow: dict[tuple[str, str], list[tuple[float, ...]]] = {}
        self._fast: dict[tuple[str, str], list[tuple[float, ...]]] = {}

    def result(self) -> SizingResult:
        """Run the search."""
        found = choices(self.task)
        every = combined(found)
        left, pruned = self._pruned(every, found)
        left.sort(key=lambda one: (one[0], *_order(one[1])))
        complete = self._simulate(left)
        ranked = self._ranked()
        counts: dict[str, int] = {}
        for _, bound in pruned:
            counts[bound.limit] = counts.get(bound.limit, 0) + 1
        miss = None if ranked or not every else nearest_miss(self.task, self.simulated, self.short, pruned)
        tuned = len(self.simulated) + len(self.short)
        made = SizingResult(
            *(self.task, len(every), len(left), counts, self.outdone, tuned, tuple(self.simulated), tuple(ranked)),
            miss=miss,
            complete=complete,
            notes=tuple(self._notes(complete, len(left))),
            asked={"least": self.least, "most": self.most, "draws": self.draws[0], "draws_best": self.draws[1]},
        )
        if self.folder is not None:
            made.save(self.folder.folder)
        return made

    def _pruned(
        self, every: Sequence[DriveChoice], found: Mapping[str, Sequence[Any]]
    ) -> tuple[list[tuple[float, DriveChoice]], list[tuple[DriveChoice, Shortage]]]:
        bounds = SafeBounds(self.task, found["tube"])
        left, pruned = [], []
        for choice in every:
            lacks = bounds.lacks(choice)
            if lacks is None:
                left.append((air_estimate_kg(choice, self.task), choice))
            else:
                pruned.append((choice, lacks))
        return left, pruned

    def _simulate(self, left: Sequence[tuple[float, DriveChoice]]) -> bool:
        """Tune and simulate choices in the order of their air; return whether none that could rank is left."""
        self._choices = {choice.name: choice for _, choice in left}
        self._fills = {choice.name: air for air, choice in left}
        for place, (air, choice) in enumerate(left):
            self.watch.tell(place, len(left), f"choices of parts, {len(self.simulated)} simulated")
            if len(self.simulated) >= self.least and self._share() * air > self._tenth():
                return True
            if len(self.simulated) + len(self.short) >= self.most:
                return False
            if self._is_outdone(choice):
                self.outdone += 1
            else:
                self._look(choice)
        self.watch.tell(len(left), len(left), f"choices of parts, {len(self.simulated)} simulated")
        return True

    def _share(self) -> float:
        """Return the least air of a cycle over that which fills both sides."""
        found = [one.air / self._fills[one.name] for one in self.simulated]
        return RESERVE * min(found) if found else LEAST_AIR

    def _tenth(self) -> float:
        """Return the air of the tenth of those that meet the task, kg."""
        airs = sorted(one.air for one in self.simulated if one.is_feasible)
        return airs[WRITTEN - 1] if len(airs) >= WRITTEN else np.inf

    def _is_outdone(self, choice: DriveChoice) -> bool:
        """Whether one on the same cylinder and tubes falls short for a reason that holds for this one as well."""
        key = (choice.cylinder.name, choice.tube.name)
        own = choice.swiftness
        if any(all(a >= b for a, b in zip(one, own, strict=True)) for one in self._slow.get(key, ())):
            return True
        fast = () if choice.is_throttled else self._fast.get(key, ())
        return any(all(a <= b for a, b in zip(one, own, strict=True)) for one in fast)

    def _falls_short(self, choice: DriveChoice, tuned: Tuned) -> None:
        """Keep what is short even in the nominal case, and what follows from it for others.

        What is no wider and no earlier than one that is too slow fully open, or that no setting helps, is no better;
        nor is, without flow controls, what is no narrower and no later than one that hits the end far too fast. One
        that is short by a share stands for others that are wider, or narrower, by half that share.
        """
        self.short.append((choice, tuned))
        key = (choice.cylinder.name, choice.tube.name)
        *sizes, late = choice.swiftness
        share = 0.5 * min(-tuned.nominal, 1.0)
        if choice.is_throttled or tuned.short[0].startswith("time"):
            wider = (*(size * (1.0 + share) for size in sizes), late + share * self.task.outward_s)
            self._slow.setdefault(key, []).append(wider)
        elif tuned.nominal < HOPELESS:
            narrower = (*(size / (1.0 + share) for size in sizes), late - share * self.task.outward_s)
            self._fast.setdefault(key, []).append(narrower)

    def _look(self, choice: DriveChoice) -> None:
        """Tune one choice, and simulate it over the spreads where it does the nominal task."""
        kept = None if self.folder is None else self.folder.kept(choice.name, self.draws[0])
        if isinstance(kept, SizedDrive):
            self.simulated.append(kept)
            return
        if kept is not None:
            self._falls_short(choice, kept)
            return
        strokes = DriveStrokes(choice, self.task, self.threads)
        tuned = tune(strokes)
        if tuned.nominal < 0.0:
            self._falls_short(choice, tuned)
            if self.folder is not None:
                self.folder.keep_short(choice.name, tuned)
            return
        self.simulated.append(self._judged(strokes, tuned.setting, self.draws[0]))

    def _judged(self, strokes: DriveStrokes, setting: Setting, draws: int) -> SizedDrive:
        """Simulate a choice over the first points of the sequence."""
        made = sized(strokes, setting, self.points[:draws], RTOL if draws == self.draws[1] else COARSE)
        if self.folder is not None:
            self.folder.keep(made)
        return made

    def _ranked(self) -> list[SizedDrive]:
        """Rank those that meet the task; the ten best have to do so with more draws."""
        first = sorted((one for one in self.simulated if one.is_feasible), key=lambda one: one.rank)
        best: list[SizedDrive] = []
        while first and len(best) < WRITTEN:
            one = first.pop(0)
            self.watch.tell(len(best), WRITTEN, f"the best with {self.draws[1]} draws")
            kept = None if self.folder is None else self.folder.kept(one.name, self.draws[1])
            if not isinstance(kept, SizedDrive):
                strokes = DriveStrokes(self._choices[one.name], self.task, self.threads)
                kept = self._judged(strokes, Setting(**one.setting), self.draws[1])
            if kept.is_feasible:
                best.append(kept)
        return sorted(best, key=lambda one: one.rank) + first

    def _notes(self, complete: bool, left: int) -> list[str]:
        notes = []
        if not complete:
            notes.append(f"The search ended after {self.most} of {left} choices: raise `most` to look at all.")
        if self.task.end_speed_m_s is None and self.task.impact_energy_j is None:
            notes.append("The task limits neither speed nor energy at the ends: look at them before ordering.")
        if self.task.cycles is not None:
            notes.append("Life is held against B10 where a part of the catalogue states it; most sheets do not.")
        return notes


def sized(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float = COARSE) -> SizedDrive:
    """Simulate a choice with its settings over draws and say what it makes of its task."""
    rows = np.tile(np.array(setting), (len(draws), 1))
    out, back = (strokes.run(outward, draws, rows, rtol) for outward in (True, False))
    task, choice = strokes.task, strokes.choice
    found = judge.limits(task, choice, out, back)
    met = int(judge.is_met(found).sum())
    binding = min(found, key=lambda one: one.margin)
    explained = judge.explained(draws, binding.margins)
    assumed = strokes.drawn_assumed()
    first = max(assumed, key=lambda name: explained[name], default="")
    air = out.air + back.air
    figures = {one.name: one.values for one in found} | {
        "time_out": out.time,
        "time_back": back.time,
        "end_speed": np.maximum(out.end_speed, back.end_speed),
        "energy": np.maximum(out.energy, back.energy),
        "peak_pressure": np.maximum(out.peak_pressure, back.peak_pressure),
        "air": air,
        "load_ratio_out": strokes.load_ratio(True, draws),
        "load_ratio_back": strokes.load_ratio(False, draws),
    }
    intervals = {name: judge.interval(values) for name, values in figures.items()}
    return SizedDrive(
        parts=choice.parts,
        setting=setting._asdict(),
        draws=len(draws),
        met=met,
        probability_bound=judge.probability_bound(met, len(draws)),
        **{name: intervals[name][1] for name in ("time_out", "time_back", "end_speed", "energy", "peak_pressure")},
        air=float(air.mean()),
        margins={one.name: one.margin for one in found},
        worst={one.name: (one.worst, one.limit, one.unit) for one in found},
        measure=f"{first} of {choice.parts[assumed[first]]}" if first else "",
        explains=explained[first] if first else 0.0,
        sizes=choice.sizes,
        intervals=intervals,
    )


def _order(choice: DriveChoice) -> tuple[bool, list[float], str]:
    """Return the key of the order on one cylinder: those from which most follows for others where they fall short."""
    sign = -1.0 if choice.is_throttled else 1.0
    return not choice.is_throttled, [sign * size for size in choice.swiftness], choice.name
