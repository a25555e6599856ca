"""The search: a provisional ranking by nominal runs, then spreads for the choices that may still be the best.

Every choice has a bound, its best possible rank. The search advances the choices whose bound is better than the best
result, and ends when no such choice is left. All results are pure functions of the task and the parts, so an
interrupted search resumes with the missing choices.
"""

from __future__ import annotations

import math
from collections import Counter
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import Cancelled, CommandError
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.sizing.candidate import MARGIN_SLACK, Pruning, Rank, SizingCandidate, TubedCylinder, nearest_possible
from pneudrive.sizing.checks import PROBABILITY, SAME_AIR, Provisional, hardest, machine_checks, simulated
from pneudrive.sizing.result import Saving, SizingFolder, SizingResult, nearest_miss, savings
from pneudrive.sizing.strokes import COARSE, RTOL, points, run_all, tune_all
from pneudrive.sizing.task import SizingTask

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from pneudrive.arrays import Array, Keyed, NamedNumbers
    from pneudrive.sizing.checks import MachineCheck, SizedDrive

#: Number of samples of each leading choice, and of choices that may be the best.
DRAWS, DRAWS_BEST = 256, 1024
#: Ratio of both numbers, which the command line uses for any number of samples.
DRAWS_BEST_OF = DRAWS_BEST // DRAWS
#: Divisor for a first part of the samples, and smallest number of samples for which a first part is worthwhile.
FIRST_OF, FIRST_LEAST = 4, 32
#: Largest number of choices that are tuned.
MOST = 160
#: Number of choices that advance together, and number of pairs that are probed together.
TOGETHER, PROBED = 16, 48
#: Provisional ranking, in the order of air: number of cylinders per batch, number of promising cylinders at which it
#: stops, and number of tubes per cylinder.
BATCH, PROMISING, TUBES = 6, 6, 2
#: Worst-case margin with rough settings above which a choice counts as promising: tuning adds about as much.
PROMISES = -0.08
#: If all samples are at least this multiple of the first samples, the hardest samples of a choice are simulated first.
WORTH = 8
#: Number of cylinders to rank, if enough of them do the task; number of failed choices that exclude a cylinder.
LISTED, TRIED = 4, 4
#: Number of standard deviations by which failures in a part of the samples may exceed the allowed number.
DOUBT = 3.0
#: Margin above which choices that were not run yet rank equally, and typical loss of a nominal margin by the spreads.
ENOUGH, RESERVE = 0.3, 0.1


def is_of_command(asked: Mapping[str, int]) -> bool:
    """Return whether the command line can set these parameters.

    The command has no option for `draws_best`.
    """
    return asked["draws_best"] == DRAWS_BEST_OF * asked["draws"]


def size(
    task: SizingTask | Keyed | str | Path,
    *,
    most: int = MOST,
    draws: int = DRAWS,
    draws_best: int = DRAWS_BEST,
    out: str | Path | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
    provisional: Callable[[SizingResult], None] | None = None,
) -> SizingResult:
    """Find the drives of the catalogue that do a task, by simulation over the spreads of the task.

    Parameters
    ----------
    task : SizingTask, dict or path-like
        The task, its keys as a dict, or its TOML file.
    most : int
        Largest number of choices that are tuned. The result states whether this limit ended the search.
    draws, draws_best : int
        Numbers of samples (powers of 2) of each leading choice, and of each choice that may be the best. Samples are
        points of a scrambled Sobol sequence, the same for all choices.
    out : path-like, optional
        Folder for the results. An interrupted search is resumed from it.
    progress, cancel : optional
        See `pneudrive.progress.Watch`. A search that is cancelled, or ended by Ctrl-C, after the provisional ranking
        returns its results so far (`complete` is false).
    provisional : callable, optional
        Called with the provisional ranking when the first choice is ranked, and when the leading choice changes.

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
        `cancel` was set before there was a provisional ranking.

    Examples
    --------
    >>> import pneudrive as pn
    >>> task = {"mass": "2 kg", "stroke": "100 mm", "time": "0.5 s", "supply": {"pressure": "6 bar gauge"}}
    >>> task["exclude"] = ["parker*", "pneumax*", "smc-[cm]*", "ckd*", "festo-gr*", "smc-tu0[48]*", "smc-tu1*"]
    >>> found = pn.size(task, draws=16, draws_best=16)
    >>> found.best.parts["cylinder"]
    'festo-dsbg-32-100'
    """
    for name, value in (("draws", draws), ("draws_best", draws_best), ("most", most)):
        if value < 1:
            raise CommandError(f"{name} = {value} is out of bounds", rule="at least 1")
    if not isinstance(task, SizingTask):
        task = SizingTask.load(task) if isinstance(task, str | Path) else SizingTask.model_validate(task)
    asked = draws, draws_best
    with nullcontext() if out is None else closing(SizingFolder(Path(out), task, asked)) as folder:
        return Search(task, most, asked, Watch(progress, cancel), folder).result(provisional or (lambda _: None))


class Search:
    """Search for the drives that do one task.

    Parameters
    ----------
    task : SizingTask
    most : int
    asked : tuple of int
        Numbers of samples of each leading choice, and of each choice that may be the best.
    watch : Watch
    folder : SizingFolder or None
    """

    def __init__(
        self,
        task: SizingTask,
        most: int,
        asked: tuple[int, int],
        watch: Watch,
        folder: SizingFolder | None,
    ) -> None:
        """Prune the catalogue, without simulation."""
        self.task, self.most, self.watch, self.folder = task, most, watch, folder
        first = asked[0] // FIRST_OF
        self.draws = [count for count in (first, *asked) if count >= FIRST_LEAST or count != first]
        self.final = self.draws[-1]
        self.pruning = Pruning(task)
        self.unseen = list(self.pruning.pairs)
        self.candidates: list[SizingCandidate] = []
        self.of_cylinder: NamedNumbers = {}
        self.dropped = list(self.pruning.dropped)
        self.tuned = 0
        self.provisional: tuple[Provisional, ...] = ()
        self.savings: list[Saving] = []

    @cached_property
    def points(self) -> Array:
        """Samples of the spreads, which are the same for all choices."""
        return points(max(self.draws))

    @property
    def left(self) -> list[SizingCandidate]:
        """Candidates that may still do the task."""
        return [one for one in self.candidates if not one.lost]

    def result(self, tell: Callable[[SizingResult], None]) -> SizingResult:
        """Run the search and return its result. `tell` receives the provisional rankings."""
        interrupted = complete = False
        try:
            self._first_ranking(tell)
            complete = self._converge()
            if (best := self._best()) is not None:  # a lower return pressure and shorter tubes may save air
                for saving in savings(self._candidate(best).strokes, best, self.points[: self.draws[-2]]):
                    self.savings.append(saving)
                    self.watch.look()
        except (KeyboardInterrupt, Cancelled):
            if not self.provisional:
                raise
            interrupted = True
        made = self._made(complete, interrupted)
        if self.folder is not None:
            made.save(self.folder.folder)
        return made

    def _made(self, complete: bool, interrupted: bool) -> SizingResult:
        simulated = [one.drive for one in self.candidates if one.drive is not None]
        last = [one.drive for one in self.left if one.drive is not None and one.draws >= self.draws[-2]]
        ranked = sorted((one for one in last if one.is_feasible), key=lambda drive: drive.rank)
        counts = Counter[str]()
        for one in self.dropped:
            counts[one.limit] += one.choices
        left = self.pruning.enumerated - sum(counts.values())
        short = [(one.choice, known) for one in self.candidates if (known := one.settings) and one.lost]
        miss = None
        if not ranked and (self.dropped or short or simulated) and (complete or not self.provisional):
            probed = self.dropped[len(self.pruning.dropped) :]  # these keep the safe bounds
            miss = nearest_miss(self.task, simulated, short, probed or self.dropped)
            if not left and not probed:
                miss = replace(miss, possible=nearest_possible(self.task, self.pruning.found, self.pruning.bounds))
        more = f"--max-candidates {2 * self.most} (in Python: most={2 * self.most})"
        note = f"The search ended after {self.most} tuned choices; other choices may rank before these: {more}."
        notes = () if complete else (note,)
        if interrupted:
            notes = ("The search was interrupted: the ranking contains only the results so far.",)
        return SizingResult(
            *(self.task, self.pruning.enumerated, left, counts, self.tuned, tuple(simulated), tuple(ranked)),
            miss=miss,
            complete=complete,
            provisional=self.provisional,
            dropped=(*self.dropped, *(one.lost for one in self.candidates if one.lost)),
            savings=tuple(self.savings),
            checks=tuple(self._checks(ranked)) if ranked else (),
            interrupted=interrupted,
            notes=notes,
            asked={"most": self.most, "draws": self.draws[-2], "draws_best": self.final},
        )

    def _checks(self, ranked: Sequence[SizedDrive]) -> Iterator[MachineCheck]:
        """Yield the checks of the best drive. An assumed energy limit states how many cylinders it excludes."""
        best, met = ranked[0], {drive.parts["cylinder"] for drive in ranked}
        thrifty = ((one, one.settings) for one in self.candidates if one.lost and one.settings)
        excluded = {
            one.cylinder
            for one, settings in thrifty
            if settings.short[0].startswith("energy") and settings.air * SAME_AIR < best.air
        } - met
        decides = f"; this limit decides the bore: it excludes cylinders that take less air ({len(excluded)})"
        for check in machine_checks(self._candidate(best).choice, self.task, best):
            is_assumed = check.name == "energy at the end" and check.rule.startswith("assumed")
            yield check._replace(rule=check.rule + decides) if is_assumed and excluded else check

    def _candidate(self, drive: SizedDrive) -> SizingCandidate:
        return next(one for one in self.candidates if one.choice.name == drive.name)

    def _probe(self, pairs: Sequence[TubedCylinder]) -> None:
        """Probe pairs, and add the choices of pairs that can do the task."""
        found = run_all([run for pair in pairs for run in pair.probe(self.task)])
        for pair, out, back in zip(pairs, found[::2], found[1::2], strict=True):
            self.candidates += pair.take(self.task, out, back)
            self.dropped += [pair.late] if pair.late else []
        self.unseen = [one for one in self.unseen if one not in pairs]

    def _first_ranking(self, tell: Callable[[SizingResult], None]) -> None:
        """Rank cylinders by nominal runs, and report the ranking each time its first choice changes."""
        waiting: dict[str, list[TubedCylinder]] = {}
        for pair in self.unseen:
            waiting.setdefault(pair.cylinder.name, []).append(pair)
        best: dict[str, SizingCandidate] = {}
        while waiting and sum((one.known or 0.0) >= PROMISES for one in best.values()) < PROMISING:
            self.watch.look()
            names = list(waiting)[:BATCH]
            self._probe([pair for name in names for pair in waiting.pop(name)])
            own = {name: [one for one in self.candidates if one.cylinder == name] for name in names}
            for _ in range(TUBES):
                following = []  # the most promising choice of each cylinder with a tube that was not yet run with it
                for every in own.values():
                    run = {one.choice.tube.name for one in every if one.settings}
                    left = [one for one in every if not one.lost and one.choice.tube.name not in run]
                    following += sorted(left, key=self._promise)[:1]
                self._tune(following)
                for name, every in own.items():
                    if left := [one for one in every if one.settings and not one.lost]:
                        best[name] = min(left, key=self._promise)
                before = self.provisional[:1]
                self.provisional = tuple(
                    Provisional(one.choice.parts, known.air, known.times, known.least, known.short[0])
                    for one in sorted(best.values(), key=self._promise)
                    if (known := one.settings)
                )
                if self.provisional[:1] != before:
                    made = self._made(False, False)
                    tell(made)
                    if self.folder is not None:
                        self.folder.tell(made.answer)

    def _promise(self, one: SizingCandidate) -> tuple[bool, Rank]:
        """Return the key that sorts choices for simulation. Before the first run, the key contains an estimate."""
        known = one.drive or one.settings
        air = one.hardest[0] if one.hardest is not None else known.air if known else 0.0
        margin = one.known
        if margin is None:
            of_lead = ENOUGH if one.lead is None or one.lead.known is None else one.lead.known
            margin = min(one.guess, of_lead, self.of_cylinder.get(one.cylinder, ENOUGH) + MARGIN_SLACK["tuned"])
            margin -= RESERVE + (not one.choice.is_throttled)
        return margin < 0.0, one.rank_at(air or one.pair.air or one.pair.fill, margin)

    def _learn(self, every: Iterable[SizingCandidate]) -> None:
        """Store the best margin of each cylinder."""
        for one in every:
            if (known := one.known) is not None:
                name = one.cylinder
                self.of_cylinder[name] = max(known, self.of_cylinder.get(name, known))

    def _best(self) -> SizedDrive | None:
        final = [one.drive for one in self.left if one.drive is not None and one.draws >= self.final]
        return min(final, key=lambda drive: drive.rank, default=None)

    def _open(self) -> tuple[list[TubedCylinder], list[SizingCandidate]]:
        """Return the pairs and candidates that may still rank above the best drive.

        The lead of a group of similar candidates is tuned first, because its result often excludes the others as well.
        """
        best = self._best()
        pairs = [one for one in self.unseen if best is None or one.rank <= best.rank[:3]]
        for one in self.left:  # its runs, or runs with the widest valve, may show that it cannot do the task
            _, most = one.outlook(self.final)
            if most < 0.0:
                of = "" if one.settings or one.lead is None else f" with {one.lead.choice.valve.name}"
                one.lose("spreads", f"margin of {100.0 * most:.0f} % at most{of}")
        left = [one for one in self.left if one.draws < self.final]
        left = [one for one in left if best is None or one.rank_at(*one.outlook(self.final)) < best.rank]
        leading = {one for one in left if not one.is_tuned}
        return pairs, [one for one in left if one.known is not None or one.lead not in leading]

    def _converge(self) -> bool:
        """Advance all candidates that may become the best, then those of other cylinders."""
        while True:
            pairs, left = self._open()
            best = self._best()
            state = "no final best yet" if best is None else f"best so far {best.parts['cylinder']}"
            self.watch.tell(self.tuned, self.most, f"choices tuned ({state}, {len(left)} may be better)")
            if self.tuned >= self.most:
                left = [one for one in left if one.is_tuned]
            if pairs and (not left or best is not None):
                self._probe(pairs[:PROBED])
            elif left:
                left.sort(key=lambda one: (self._promise(one), one.rank_at(*one.outlook(self.final))))
                together = TOGETHER if best is not None or not left[0].is_tuned else 2
                self._advance(left[:together])
            elif not self._others():
                return self.tuned < self.most or not self._open()[1]

    def _others(self) -> bool:
        """Advance choices of cylinders other than the best until enough are ranked.

        Return False if there is nothing to advance.
        """
        lost = Counter(one.cylinder for one in self.candidates if one.lost and one.known is not None)
        met = {one.cylinder for one in self.left if one.draws >= self.draws[-2]}
        if len(met) >= LISTED:
            return False
        waiting = [one for one in self.left if one.draws < self.draws[-2]]
        waiting.sort(key=lambda one: (-one.draws, one.known is None, self._promise(one)))
        others = [one for one in waiting if one.cylinder not in met and lost[one.cylinder] < TRIED]
        if not others and self.unseen:
            name = self.unseen[0].cylinder.name
            self._probe([pair for pair in self.unseen if pair.cylinder.name == name])
            return True
        first: dict[str, SizingCandidate] = {}
        for one in others:
            if one.is_tuned or self.tuned < self.most:
                first.setdefault(one.cylinder, one)
        chosen = list(first.values())[:TOGETHER]
        self._advance(chosen, is_leading=False)
        return bool(chosen)

    def _advance(self, every: Sequence[SizingCandidate], is_leading: bool = True) -> None:
        """Bring each choice to its next stage.

        Parameters
        ----------
        every : sequence of SizingCandidate
        is_leading : bool
            Whether the choices may be the best. Such choices run the samples with the smallest margins next, then all
            samples.
        """
        tuned = [one for one in every if one.is_tuned]
        rough = [one for one in every if one.settings is not None and not one.is_tuned]
        self._tune([one for one in every if one.settings is None])
        # Tuned settings in the folder are used; others are refined, up to the largest number of tuned choices.
        for one in rough:
            if self.folder is not None and (settings := self.folder.stored(one.choice.name)) is not None:
                one.take_settings(settings, is_tuned=True)
                self.tuned += 1
        left = [one for one in rough if not one.is_tuned][: max(self.most - self.tuned, 0)]
        self.tuned += len(left)
        self._tune(left, is_tuned=True)
        for one in tuned:
            self.watch.look()
            assert one.settings is not None
            if is_leading and one.draws and one.hardest is None and self.final >= WORTH * one.draws:
                setting = one.settings.setting
                known = one.samples
                if known is None:  # the folder stores only the drive
                    _, known = simulated(one.strokes, setting, self.points[: one.draws])
                air, margin, failed = hardest(one.strokes, setting, known, self.points[: self.final])
                one.hardest = air, margin
                if failed > (1.0 - PROBABILITY) * self.final:
                    one.lose("spreads", f"{failed} of {self.final} samples miss a limit")
            else:
                following = next(count for count in self.draws if count > one.draws)
                self._simulate(one, self.final if is_leading and one.draws else following)
        self._learn(every)

    def _tune(self, every: Sequence[SizingCandidate], *, is_tuned: bool = False) -> None:
        """Search rough settings, or refine them."""
        found = tune_all([(one.strokes, one.settings) for one in every])
        for one, settings in zip(every, found, strict=True):
            one.take_settings(settings, is_tuned=is_tuned)
            if is_tuned and self.folder is not None:
                self.folder.store(one.choice.name, settings)
        self._learn(every)

    def _simulate(self, one: SizingCandidate, draws: int) -> None:
        """Simulate a choice over the first points of the sequence.

        The candidate is rejected if more samples fail than the task allows, or so many that it is unlikely to pass.
        """
        drive = None if self.folder is None else self.folder.stored(one.choice.name, draws)
        if drive is None:
            assert one.settings is not None
            rtol = RTOL if draws == self.final else COARSE
            drive, one.samples = simulated(one.strokes, one.settings.setting, self.points[:draws], rtol)
            if self.folder is not None:
                self.folder.store(one.choice.name, drive)
        one.drive = drive
        allowed, failed = 1.0 - PROBABILITY, drive.draws - drive.met
        likely = allowed + DOUBT * math.sqrt(allowed / drive.draws)
        is_lost = not drive.is_feasible if drive.draws >= self.final else failed > likely * drive.draws + 1.0
        if failed > allowed * self.final or is_lost:
            one.lose(drive.binding, f"{failed} of {drive.draws} samples miss it")
