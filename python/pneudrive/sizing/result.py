"""Result of a sizing: answer, open checks, nearest miss, air savings, and folder."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from pneudrive import __version__
from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import NOT_READY, CommandError
from pneudrive.files.content import read_json, read_text
from pneudrive.files.writing import NO_FOLLOW, make_result_folder, open_to_append, take
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain as three
from pneudrive.simulation.trajectory import write_whole
from pneudrive.sizing.checks import MachineCheck, Provisional, Shortage, SizedDrive, read, simulated
from pneudrive.sizing.strokes import DriveStrokes, Setting, Tuned, cycle_s, tune
from pneudrive.sizing.task import SLOTS, WITHOUT, DriveChoice, SizingTask, choices
from pneudrive.views import Finding, ShownValue, View, Viewed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.arrays import Array, Plain
    from pneudrive.describe.circuit import Circuit


#: Electricity per cubic metre of air (ANR) at 6 to 8 bar gauge, kWh: lowest, usual, highest (assumed: screw compressors
#: with 6 to 7.5 kW per m3/min, without leaks of the network).
KWH_PER_M3 = (0.10, 0.11, 0.125)
LITRES_PER_M3 = 1e3
#: Number of drives of the ranking, and of cylinders, whose files are written.
WRITTEN = 10
TABLE, SUMMARY, REASONS = "ranking.csv", "result.json", "left_out.csv"
#: Column heads of the numbers in ranking.csv, in the order of `values_of`.
RANKING = ("time out s", "back s", "end m/s", "energy J", "peak bar abs", "air l ANR")
RANKING += ("met", "at least", "margin", "binds")
#: Word in the name of a limit -> unit.
_UNITS = {"speed": "m/s", "energy": "J", "pressure": "Pa", "force": "N"}


# --- A sized drive in words and values.


def maker_type(name: str) -> str:
    """Return maker and type of a part: its title up to the first word with a digit.

    Examples
    --------
    >>> maker_type("festo-gr-qs-8")
    'Festo GR-QS-8'
    """
    if name not in entries():
        return name
    title = entries()[name].title
    found = re.match(r"\D*\d\S*", title)
    return (found[0] if found else title).rstrip(",")


def in_words(parts: Mapping[str, str]) -> str:
    """Return the parts of a drive, in words."""
    titles = {slot: maker_type(name) for slot, name in parts.items() if name not in (WITHOUT, "*")}
    cylinder = titles.pop("cylinder")
    return f"{cylinder} with " + ", ".join(f"{slot.replace('_', ' ')} {title}" for slot, title in titles.items())


def values_of(drive: SizedDrive, place: int) -> list[ShownValue]:
    """Return the values of a drive, with names that begin with its rank (1 for the best)."""
    values = {
        "time out": (drive.time_out, "s"),
        "time back": (drive.time_back, "s"),
        "end speed, m/s": (drive.end_speed, ""),
        "impact": (drive.energy, "J"),
        "peak pressure, absolute": (drive.peak_pressure, "Pa"),
        "air of a cycle, l ANR": (drive.air_litres_anr, ""),
        "met": (f"{drive.met} of {drive.draws}", ""),
        "at least": (f"{drive.probability_bound:.4f}", ""),
        "margin": (f"{100.0 * drive.margin:.0f} %", ""),
        "binds": (drive.binding, ""),
    }
    return [ShownValue(f"rank {place}.{name}", str(place), name, *value) for name, value in values.items()]


# --- The result.


@dataclass(frozen=True)
class NearestMiss:
    """Choice that comes closest to an infeasible task, and the change that would make the task feasible.

    Attributes
    ----------
    parts : dict
    limit : str
        Missed limits.
    gives : str
        Change that would make the task feasible, in words.
    possible : tuple of str
        Nearest possible value of each quantity of the task if only this quantity is changed.
    """

    parts: Mapping[str, str]
    limit: str
    gives: str
    possible: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class SizingResult(Viewed):
    """Result of `pneudrive.size`.

    Attributes
    ----------
    task : SizingTask
    enumerated, left : int
        Choices of parts before and after pruning.
    pruned : dict
        Limit -> number of choices that cannot meet it with any settings.
    tuned : int
        Choices whose settings were searched.
    simulated : tuple of SizedDrive
        Choices that were simulated over the spreads.
    ranked : tuple of SizedDrive
        Choices that meet the task, best first. All choices that may rank first have 1,024 samples.
    miss : NearestMiss or None
        Nearest miss, if nothing meets the task.
    complete : bool
        Whether it is certain that no other choice ranks before the best one.
    provisional : tuple of Provisional
        Ranking by nominal runs, before the spreads were simulated.
    dropped : tuple of Shortage
        Choices that were left out, with the reason.
    savings : tuple of Saving
        Changes to the best choice that were tried to save air.
    checks : tuple of MachineCheck
        Checks of the best choice, open ones first: side load, buckling, energy, life, hanging load.
    interrupted : bool
        Whether the search was cancelled before its end.
    notes : tuple of str
    asked : dict
        Arguments of `pneudrive.size` by name: least, most, draws, draws_best.
    """

    task: SizingTask
    enumerated: int
    left: int
    pruned: Mapping[str, int]
    tuned: int
    simulated: tuple[SizedDrive, ...]
    ranked: tuple[SizedDrive, ...]
    miss: NearestMiss | None = None
    complete: bool = True
    provisional: tuple[Provisional, ...] = ()
    dropped: tuple[Shortage, ...] = ()
    savings: tuple[Saving, ...] = ()
    checks: tuple[MachineCheck, ...] = ()
    interrupted: bool = False
    notes: tuple[str, ...] = ()
    asked: Mapping[str, int] = field(default_factory=dict)

    #: Kind of the result in words.
    kind = "sizing"

    @property
    def feasible(self) -> bool:
        """Whether any choice meets the limits of the task; see `ready`."""
        return bool(self.ranked)

    @property
    def open_checks(self) -> list[MachineCheck]:
        """Checks of the best drive that failed or cannot be decided."""
        return [check for check in self.checks if check.is_open]

    @property
    def ready(self) -> bool:
        """Whether the best drive can be ordered: it meets the task and passes every check."""
        return self.feasible and not self.open_checks

    @property
    def state(self) -> str:
        """Whether the task is feasible and the best drive ready, in words."""
        if not self.feasible and not self.complete:
            return "not decided: the search ended before all choices were examined"
        if not self.feasible or self.ready:
            return f"feasible = {str(self.feasible).lower()}, ready = {str(self.ready).lower()}"
        return f"feasible = true, but ready = false (open checks: {len(self.open_checks)})"

    @property
    def best(self) -> SizedDrive | None:
        """First drive of the ranking."""
        return self.ranked[0] if self.ranked else None

    @property
    def by_cylinder(self) -> list[SizedDrive]:
        """Best drives of up to ten cylinders, in the order of the ranking."""
        first: dict[str, SizedDrive] = {}
        for drive in self.ranked:
            first.setdefault(drive.parts["cylinder"], drive)
        return list(first.values())[:WRITTEN]

    @property
    def written(self) -> dict[str, SizedDrive]:
        """Circuit file -> drive, for the ten best drives and the best of each cylinder. The file name is the rank."""
        first = [drive.name for drive in self.by_cylinder]
        ranked = enumerate(self.ranked, 1)
        return {f"{k:02d}.toml": one for k, one in ranked if k <= WRITTEN or one.name in first}

    @property
    def cheaper(self) -> list[SizedDrive]:
        """Simulated choices that miss a limit but use less air than the best choice, sorted by air."""
        most = math.inf if self.best is None else self.best.air
        missed = (drive for drive in self.simulated if not drive.is_feasible and drive.air < most)
        return sorted(missed, key=lambda drive: drive.air)

    @property
    def answer(self) -> str:
        """Answer in one sentence. Without a ranking, it is a provisional answer from nominal runs."""
        task, best = self.task, self.best
        if best is not None:
            figures = [f"{three(best.time_out)} s of {three(task.outward_s)} s out"]
            figures.append(f"{three(best.time_back)} s of {three(task.back_s)} s back")
            figures.append(f"{three(best.air_litres_anr)} l ANR a cycle of {three(cycle_s(task))} s")
            if task.end_speed_m_s is not None:
                figures.append(f"end speed {three(best.end_speed)} of {three(task.end_speed_m_s)} m/s")
            is_assumed = any(check.rule.startswith("assumed") for check in self.checks if "energy" in check.name)
            limit = f"{three(best.worst['energy out'][1])} J{' (assumed limit)' if is_assumed else ''}"
            figures += [f"impact {three(best.energy)} of {limit}", f"margin {three(100.0 * best.margin)} %"]
            first = f"; measure the {best.measure} first" if best.measure else ""
            drive = f"{in_words(best.parts)}: {', '.join(figures)}; limited by {best.binding}{first}."
            left = len(self.open_checks)
            number = "one check of the best choice is" if left == 1 else f"{left} checks of the best choice are"
            return f"{NOT_READY}{number} open. {drive}" if left else f"Take {drive}"
        if self.provisional and self.miss is None:
            drive = self.provisional[0]
            return (
                f"Provisional, by nominal runs: {in_words(drive.parts)}: {' s and '.join(map(three, drive.times))} s "
                f"out and back, {three(drive.air * ANR_LITRES_PER_KG)} l ANR a cycle of {three(cycle_s(task))} s, "
                f"margin {three(100.0 * drive.margin)} %{f' of {drive.limit}' if drive.limit else ''}"
                f"{', which tuned settings may meet' if drive.margin < 0.0 else ''}."
            )
        return f"Nothing {'in the catalogue' if self.complete else 'that was examined'} meets the task."

    @property
    def findings(self) -> list[Finding]:
        """Checks of the best drive with their remedies, or the nearest miss."""
        findings = [check.finding for check in self.checks]
        if self.miss is not None:
            parts = " + ".join(name for name in self.miss.parts.values() if name != "*")
            text = f"Nearest miss: {parts}; it misses: {self.miss.limit}."
            findings.append(Finding(text, "bad", self.miss.gives))
        return findings

    @property
    def remarks(self) -> list[str]:
        """State, yearly air, savings, a cylinder with less air but more open checks, possible values, and search."""
        lines = [f"{self.task.name}: {self.state}", *yearly(self)]
        lines += [f"{saving}." for saving in self.savings]
        lines += [
            f"Less air, but further open checks ({', '.join(more)}): {in_words(drive.parts)}, "
            f"{three(drive.air_litres_anr)} l ANR a cycle."
            for drive in sorted(self.by_cylinder, key=lambda drive: drive.air)[:1]
            if (more := [name for name in drive.open_names if name not in self.ranked[0].open_names])
        ]
        lines += [f"Nearest possible {value}." for value in (self.miss.possible if self.miss else ())]
        return [*lines, self.extent, *self.notes]

    @property
    def extent(self) -> str:
        """Number of remaining choices after each stage of the search."""
        cut = ", ".join(f"{name} {count}" for name, count in sorted(self.pruned.items(), key=lambda cut: -cut[1]))
        return (
            f"{self.enumerated} choices of parts, {self.left} left after pruning ({cut or 'none pruned'}); "
            f"{self.tuned} tuned, {len(self.simulated)} simulated over the spreads, {len(self.ranked)} meet the task."
        )

    @property
    def sentences(self) -> list[str]:
        """The answer, the findings with their remedies, and the remarks."""
        return [self.answer, *(f"{f.text} {f.remedy}".rstrip() for f in self.findings), *self.remarks]

    def circuit(self, place: int = 0) -> Circuit:
        """Return the circuit of a ranked drive (0 for the best) with its settings, ready to run."""
        drive, known = self.ranked[place], choices(self.task)
        parts = {slot: next(one for one in known[slot] if one.name == name) for slot, name in drive.parts.items()}
        return DriveStrokes(DriveChoice(**parts), self.task).circuit(Setting(**drive.setting))

    def view(self) -> View:
        """Return answer, open checks and candidates; see `pneudrive.report.sizing.sizing_view`."""
        return upper("sizing_view")(self)

    def save(self, folder: str | Path) -> list[Path]:
        """Write table, summary and circuit files (`written`) into a folder."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        ranking = [(*drive.parts.values(), *(value.text for value in values_of(drive, 1))) for drive in self.ranked]
        reasons = [(*one.parts.values(), str(one.choices), one.limit, f'"{one.said}"') for one in self.dropped]
        tables = {TABLE: [(*(slot.replace("_", " ") for slot in SLOTS), *RANKING), *ranking]}
        tables[REASONS] = [(*SLOTS, "choices", "limit", "reason"), *reasons]
        files = {name: "".join(",".join(row) + "\n" for row in rows) for name, rows in tables.items()}
        summary = {
            "task": self.task.to_dict(),
            **{name: getattr(self, name) for name in _STORED},
            "provisional": [vars(drive) for drive in self.provisional],
            "simulated": len(self.simulated),
            "ranked": [asdict(drive) for drive in self.ranked],
            "miss": None if self.miss is None else vars(self.miss),
            "assumed": self.circuit().assumed() if self.feasible else [],
            "savings": [saving._asdict() for saving in self.savings],
            "checks": [check._asdict() for check in self.checks],
            "said": self.sentences,
        }
        strict = json.loads(json.dumps(summary), parse_constant=lambda _: None)  # null for infinity
        files[SUMMARY] = json.dumps(strict, indent=1) + "\n"
        files |= {name: self.circuit(self.ranked.index(one)).to_toml() for name, one in self.written.items()}
        return [write_whole(folder / name, text) for name, text in files.items()]

    @classmethod
    def load(cls, folder: str | Path) -> SizingResult:
        """Read the result from the folder of a search; `dropped` is then empty.

        Raises
        ------
        CommandError
            The folder does not contain a result, or the result is damaged.
        """
        folder = Path(folder)
        stored = read_json(folder / SUMMARY, CommandError)
        try:
            task = SizingTask.model_validate(stored["task"])
            found: SizingResult = _reader(cls).validate_python(stored | {"task": task, "simulated": ()})
            simulated = read_choices(folder / LINES)
            asked = {name: count for name, count in found.asked.items() if name != "least"}  # of earlier versions
            return replace(found, simulated=tuple(simulated) or found.ranked, asked=asked)
        except (KeyError, TypeError, ValueError) as error:
            fault = error.errors()[0] if isinstance(error, ValidationError) else None
            why = str(error) if fault is None else f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}"
            raise CommandError(f"{folder / SUMMARY} is damaged: {why}", remedy="Size the task again.") from None

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw time against air with the limits; see `pneudrive.report.sizing.plot_sizing`."""
        return upper("plot_sizing")(self, path)

    def report(self, folder: str | Path) -> Path:
        """Write report.html into a folder; see `pneudrive.report.sizing.write_sizing_report`."""
        return upper("write_sizing_report")(self, folder)


def yearly(found: SizingResult) -> list[str]:
    """Return yearly air, energy and cost; empty if the task does not give the cycles per hour."""
    task, best = found.task, found.best
    if task.cycles_per_hour is None or best is None:
        return []
    cycles = task.cycles_per_hour * task.hours_per_year
    low, high = best.intervals.get("air", (best.air, best.air))
    air = [mass * ANR_LITRES_PER_KG / LITRES_PER_M3 * cycles for mass in (low, best.air, high)]
    energy = [volume * need for volume, need in zip(air, KWH_PER_M3, strict=True)]
    text = (
        f"A year ({three(task.cycles_per_hour)} cycles an hour, {three(task.hours_per_year)} h): "
        f"{three(air[1])} m3 ANR, {three(energy[1])} kWh ({three(energy[0])} … {three(energy[2])} kWh"
    )
    if task.price_per_kwh is not None:
        least, usual, most = (three(each * task.price_per_kwh) for each in energy)
        text += f"), {usual} {task.currency} ({least} … {most} {task.currency}"
    text += f"). A compressor takes {KWH_PER_M3[0]:.3g} … {KWH_PER_M3[2]:.3g} kWh for a cubic metre (assumed)."
    return [text]


# --- The nearest miss.


def nearest_miss(
    task: SizingTask,
    simulated: list[SizedDrive],
    short: list[tuple[Any, Any]],
    pruned: list[Shortage],
) -> NearestMiss:
    """Return the choice closest to the task: a simulated choice if there is one, then a tuned, then a pruned choice.

    Parameters
    ----------
    task : SizingTask
    simulated : list of SizedDrive
    short : list of (DriveChoice, Tuned)
        Tuned choices that miss the task even in the nominal case.
    pruned : list of Shortage
        Choices that the safe bounds exclude.
    """
    if simulated:
        drive = max(simulated, key=lambda drive: (drive.met / drive.draws, drive.margin))
        value, limit, unit = drive.worst[drive.binding]
        gives = _gives(drive.binding, limit, value, unit, "1 % of the samples exceed")
        if drive.margin >= 0.0:
            gives = f"Each limit alone is met, but only {drive.missed}: change supply pressure, tubes or catalogue."
        if len(drive.missed_limits) > 1:
            gives = f"Relax each limit to its value, which 1 % of the samples exceed: {drive.missed}."
        return NearestMiss(drive.parts, ", ".join(drive.missed_limits) or drive.binding, gives)
    if short:
        choice, tuned = max(short, key=lambda pair: (pair[1].nominal >= 0.0, pair[1].least))
        name, limit, value = tuned.short
        unit = next((unit for word, unit in _UNITS.items() if word in name), "s")
        if tuned.nominal >= 0.0:
            gives = _gives(name, limit, value, unit, "the nominal case meets it, the worst case of the spreads gives")
            gives += " Narrower [spread] and supply.spread help as well."
            return NearestMiss(choice.parts, f"{name}, over the spreads", gives)
        return NearestMiss(choice.parts, name, _gives(name, limit, value, unit, "the nominal case gives"))
    counts = Counter[str]()
    for one in pruned:  # the limit of most choices, if possible one that a change of the task relaxes
        counts[one.limit] += one.choices if one.share > 0.0 else 0
    bound = max(pruned, key=lambda shortage: (counts[shortage.limit], shortage.share))
    gives = f"{bound.said[0].upper()}{bound.said[1:]}."
    if bound.share > 0.0:
        gives += f" This is {100.0 * bound.share:.0f} % of what the task needs."
    return NearestMiss(bound.parts, bound.limit, gives)


def _gives(name: str, limit: float, value: float, unit: str, source: str) -> str:
    if not math.isfinite(value):
        return f"The limit of {name} is {read(limit, unit)}; the stroke does not end within the run."
    # As many digits as distinguish the two values.
    digits = next((n for n in range(3, 17) if f"{limit:.{n}g}" != f"{value:.{n}g}"), 3)
    return (
        f"The limit of {name} is {read(limit, unit, digits)}; {source} {read(value, unit, digits)}: "
        "relax it to this value, or change supply pressure, tubes or catalogue."
    )


# --- Files of the result.

#: Kind of a record -> its reader from plain data. Fields that earlier versions did not have get their defaults.
_reader: Any = cache(TypeAdapter)
#: Fields of a result that its file stores unchanged.
_STORED = ("feasible", "ready", "complete", "enumerated", "left", "pruned", "tuned", "interrupted", "notes", "asked")


# --- Changes of the best drive that save air: a lower pressure for the return stroke, shorter tubes.

#: Tried fractions of the gauge pressure for the return stroke, and of the tube length.
RETURN_SHARES, TUBE_SHARE = (0.5, 0.7), 0.5


class Saving(NamedTuple):
    """A change to the best drive that was tried to save air.

    Attributes
    ----------
    change : str
    share : float
        Fraction of the air that the change saves; 0 if the task is then not met.
    is_kept : bool
        Whether the task is met with the change.
    """

    change: str
    share: float
    is_kept: bool

    def __str__(self) -> str:
        if not self.is_kept:
            return f"{self.change}: the task is not met"
        return f"{self.change}: saves {100.0 * self.share:.3g} % of the air"


def savings(best: DriveStrokes, sized_best: SizedDrive, draws: Array) -> Iterator[Saving]:
    """Try changes to the best drive that may save air. Each changed drive is tuned, and simulated over the spreads."""
    task, half = best.task, best.task.tube_length_m * TUBE_SHARE
    shorter = task.model_copy(update={"tube_length_m": half})
    tube = next(part for part in choices(shorter)["tube"] if part.name == best.choice.tube.name)
    tried = {
        f"{100.0 * share:.0f} % of the supply's gauge pressure for the return": replace(best, return_share=share)
        for share in RETURN_SHARES
    }
    short = replace(best, choice=replace(best.choice, tube=tube), task=shorter)
    tried[f"tubes of {half:.3g} m in place of {task.tube_length_m:.3g} m"] = short
    for change, strokes in tried.items():
        tuned = tune(strokes)
        made = None if tuned.nominal < 0.0 else simulated(strokes, tuned.setting, draws)[0]
        is_kept = made is not None and made.is_feasible
        yield Saving(change, 1.0 - made.air / sized_best.air if is_kept and made else 0.0, is_kept)


# --- Folder of a sizing with a line for each finished choice, so that an interrupted search can be resumed.

ABOUT, LINES, LOCK, PROVISIONAL = "sizing.json", "choices.jsonl", "sizing.lock", "provisional.txt"


#: Version of the ranking rules. From 2 on, every choice has a limit of the energy. From 3 on, open checks count. From 4
#: on, open checks of stroke, speed and needles also count, and friction does not hold a load.
RULES = 4


class SizingFolder:
    """Finished choices of one task, in a folder that is locked until it is closed.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    task : SizingTask
    draws : tuple of int

    Raises
    ------
    CommandError
        The folder holds another task or other files, cannot be written to, or is used by another process.
    """

    def __init__(self, folder: Path, task: SizingTask, draws: tuple[int, int]) -> None:
        self.folder = folder
        self._stages: dict[tuple[str, int], Any] = {}
        self._file: int | None = None
        known = (one for one in entries().values() if not one.is_drive)
        parts = sorted(f"{one.name} {one.kind} {one.values} {one.printed}" for one in known)
        said = {
            "version": __version__,
            "task": task.to_dict(),
            "draws": draws,
            "catalogue": hashlib.sha256("\n".join(parts).encode()).hexdigest(),
            "rules": RULES,
        }
        about = json.loads(json.dumps(said))
        path = folder / ABOUT
        if path.exists():
            begun = read_json(path, CommandError)
            if differ := [key for key in about if begun.get(key) != about[key]]:
                raise CommandError.of("sizing.other_task", where=str(path), folder=folder, differ=", ".join(differ))
            self._lock()
            self._stages = read_stages(folder / LINES)
            if (folder / LINES).is_file():
                self._append("")  # ends a line that is incomplete
        elif folder.is_dir() and any(one.name != LOCK for one in folder.iterdir()):
            raise CommandError(f"{folder} is not empty and holds no sizing", remedy="Choose a new folder.")
        else:
            make_result_folder(folder)
            self._lock()
            write_whole(path, json.dumps(about, indent=1))

    def _lock(self) -> None:
        """Lock the folder; continue without a lock if the file system has no locks."""
        with suppress(OSError):
            self._file = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | NO_FOLLOW, 0o666)
            if take(self._file):
                return
            self.close()
            raise CommandError.of("sizing.locked", folder=self.folder)

    def close(self) -> None:
        """Release the folder for other processes."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def stored(self, name: str, draws: int = 0) -> Any:  # noqa: ANN401 - SizedDrive, or Tuned for 0 draws
        """Return the stored drive of a choice for a number of samples, or its tuned settings; None if not stored."""
        return self._stages.get((name, draws))

    def store(self, name: str, stage: SizedDrive | Tuned) -> None:
        """Store a simulated drive, or the tuned settings of a choice."""
        self._append(json.dumps(asdict(stage) if isinstance(stage, SizedDrive) else {"name": name, **stage._asdict()}))

    def _append(self, line: str) -> None:
        try:
            with open_to_append(self.folder / LINES) as file:
                file.write(line + "\n")
        except OSError as error:
            raise CommandError(f"{self.folder / LINES} cannot be written: {error.strerror}") from None

    def tell(self, sentence: str) -> None:
        """Write the provisional answer."""
        write_whole(self.folder / PROVISIONAL, sentence + "\n")


def read_stages(path: Path) -> dict[tuple[str, int], Any]:
    """Return the finished stages of choices: name and number of samples -> drive, or `Tuned` for 0 samples.

    An incomplete line is left out: the search was killed while writing it, or is still writing it.
    """
    stages: dict[tuple[str, int], Any] = {}
    for line in read_text(path, CommandError).splitlines() if path.is_file() else ():
        with suppress(ValueError, KeyError, TypeError):
            content: Plain = json.loads(line)
            if "short" in content:
                known = {key: content[key] for key in Tuned._fields if key in content}
                stages[content["name"], 0] = _reader(Tuned).validate_python(known)
            else:
                drive = _reader(SizedDrive).validate_python(content)
                stages[drive.name, drive.draws] = drive
    return stages


def read_choices(path: Path) -> list[SizedDrive]:
    """Return the simulated drives, each with its largest number of samples."""
    stages = sorted(read_stages(path).items(), key=lambda stage: stage[0][1])
    return list({name: drive for (name, draws), drive in stages if draws}.values())
