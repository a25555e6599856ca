"""Results of a sizing: the result of each choice of parts, the ranking, and the nearest miss."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import NOT_READY
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain as three
from pneudrive.repr_tables import Card, Shown
from pneudrive.simulation.trajectory import whole
from pneudrive.sizing.checks import Provisional, SizedDrive
from pneudrive.sizing.choices import SLOTS, WITHOUT, choices
from pneudrive.sizing.spreads import sized
from pneudrive.sizing.strokes import Setting, circuit_of, cycle_s
from pneudrive.sizing.tune import tune

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.sizing.candidate import Dropped
    from pneudrive.sizing.checks import MachineCheck, Shortage
    from pneudrive.sizing.strokes import DriveStrokes
    from pneudrive.sizing.task import SizingTask


# --- The answer to a task in one sentence, its air and energy in a year, and ways to save air.

#: Electricity for a cubic metre of air (ANR) at 6 to 8 bar gauge, kWh, lowest, usual, highest (assumed: screw
#: compressors with 6 to 7.5 kW for a cubic metre in a minute, without leaks of the mains).
KWH_PER_M3 = (0.10, 0.11, 0.125)
LITRES_PER_M3 = 1e3


def named(parts: Mapping[str, str]) -> dict[str, str]:
    """Return maker and type of the parts of a drive, without empty slots."""
    return {slot: maker_type(name) for slot, name in parts.items() if name not in (WITHOUT, "*")}


def maker_type(name: str) -> str:
    """Return maker and type of a part: its title up to the first word with a figure.

    Examples
    --------
    >>> maker_type("festo-gr-qs-8")
    'Festo GR-QS-8'
    """
    known = entries()
    if name not in known:
        return name
    words = known[name].title.split()
    last = next((place for place, word in enumerate(words) if any(map(str.isdigit, word))), len(words) - 1)
    return " ".join(words[: last + 1]).rstrip(",")


def in_words(parts: Mapping[str, str]) -> str:
    """Return the parts of a drive, in words."""
    words = {"valve": "valve", "tube": "tube", "flow_control": "flow control"}
    own = named(parts)
    rest = [f"{word} {own[slot]}" for slot, word in words.items() if slot in own]
    return f"{own['cylinder']} with " + ", ".join(rest)


def sentence(
    task: SizingTask, best: SizedDrive | None, checks: Sequence[MachineCheck], provisional: Sequence[Provisional]
) -> str:
    """Return the answer in one sentence.

    Parameters
    ----------
    task : SizingTask
    best : SizedDrive or None
        The first of the ranking.
    checks : sequence of MachineCheck
        Its checks.
    provisional : sequence of Provisional
        Results of nominal runs, while there is no ranking; empty if nothing meets the task.
    """
    if best is not None:
        figures = [f"{three(best.time_out)} s of {three(task.outward_s)} s out"]
        figures.append(f"{three(best.time_back)} s of {three(task.back_s)} s back")
        figures.append(f"{three(best.air_litres_anr)} l ANR a cycle of {three(cycle_s(task))} s")
        if task.end_speed_m_s is not None:
            figures.append(f"end speed {three(best.end_speed)} of {three(task.end_speed_m_s)} m/s")
        figures.append(f"impact {three(best.energy)} of {three(best.worst['energy out'][1])} J")
        figures[-1] += " (assumed limit)" if any(check.rule.startswith("assumed") for check in checks) else ""
        figures.append(f"margin {three(100.0 * best.margin)} %")
        first = f"; measure the {best.measure} first" if best.measure else ""
        drive = f"{in_words(best.parts)}: {', '.join(figures)}; limited by {best.binding}{first}."
        left = [check for check in checks if check.is_open]
        number = "one check of the best choice is" if len(left) == 1 else f"{len(left)} checks of the best choice are"
        return f"{NOT_READY}{number} open. {drive}" if left else f"Take {drive}"
    if provisional:
        one = provisional[0]
        times = " s and ".join(map(three, one.times))
        air = three(one.air * ANR_LITRES_PER_KG)
        return (
            f"Provisional, by nominal runs: {in_words(one.parts)}: {times} s out and back, "
            f"{air} l ANR a cycle of {three(cycle_s(task))} s, "
            f"margin {three(100.0 * one.margin)} %."
        )
    return "Nothing in the catalogue meets the task."


def yearly(drive: SizedDrive, task: SizingTask) -> list[str]:
    """Return air, energy and cost of a year, in words; empty if the task does not give the cycles per hour."""
    if task.cycles_per_hour is None:
        return []
    cycles = task.cycles_per_hour * task.hours_per_year
    low, high = drive.intervals.get("air", (drive.air, drive.air))
    air = [one * ANR_LITRES_PER_KG / LITRES_PER_M3 * cycles for one in (low, drive.air, high)]
    energy = [volume * own for volume, own in zip(air, KWH_PER_M3, strict=True)]
    said = (
        f"A year ({three(task.cycles_per_hour)} cycles an hour, {three(task.hours_per_year)} h): "
        f"{three(air[1])} m3 ANR, {three(energy[1])} kWh ({three(energy[0])} … {three(energy[2])} kWh"
    )
    if task.price_per_kwh is not None:
        low_, usual, high_ = (three(one * task.price_per_kwh) for one in energy)
        said += f"), {usual} {task.currency} ({low_} … {high_} {task.currency}"
    said += f"). A compressor takes {KWH_PER_M3[0]:.3g} … {KWH_PER_M3[2]:.3g} kWh for a cubic metre (assumed)."
    return [said]


def notes(most: int | None, interrupted: bool) -> list[str]:
    """Return remarks on a search.

    Parameters
    ----------
    most : int or None
        Tuned choices that ended it; None if it came to its end.
    interrupted : bool
    """
    said = []
    if interrupted:
        said.append("The search was interrupted: the ranking is that of the results so far.")
    elif most is not None:
        more = f"--max-candidates {2 * most} (in Python: most={2 * most})"
        said.append(f"The search ended after {most} tuned choices; other choices may rank before these: {more}.")
    return said


# --- Results of a sizing: the result of each choice of parts, the ranking, and the nearest miss.

#: Places of the ranking whose files are written.
WRITTEN = 10
TABLE, SUMMARY, REASONS = "ranking.csv", "result.json", "left_out.csv"
#: Limit -> factor from SI and unit in which people read it.
_UNITS = {"speed": "m/s", "energy": "J", "pressure": "Pa"}
READ = {"Pa": (1e-5, "bar abs")}


@dataclass(frozen=True)
class NearestMiss:
    """Choice that comes nearest to an infeasible task, and the change that would make it feasible.

    Attributes
    ----------
    parts : dict
    limit : str
        Missed limit.
    gives : str
        Change that would make the task feasible, in words.
    possible : tuple of str
        The nearest possible value of each quantity of the task, changed alone.
    """

    parts: Mapping[str, str]
    limit: str
    gives: str
    possible: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class SizingResult(Shown):
    """Result of `pneudrive.size`.

    Attributes
    ----------
    task : SizingTask
    enumerated, left : int
        Choices of parts before and after pruning.
    pruned : dict
        Limit -> number of choices that cannot keep it whatever their settings.
    tuned : int
        Choices whose settings were searched.
    simulated : tuple of SizedDrive
        Those that were simulated over the spreads.
    ranked : tuple of SizedDrive
        Those that meet the task, best first. All that might be the first have 1,024 draws.
    miss : NearestMiss or None
        Where nothing meets the task.
    complete : bool
        Whether no choice that was left out can rank before those shown.
    provisional : tuple of Provisional
        Ranking by nominal runs, before the spreads were simulated.
    dropped : tuple of Dropped
        What was left out, with its reason.
    savings : tuple of Saving
        Changes that were tried on the best to save air.
    checks : tuple of MachineCheck
        Of the best, open ones first: side load, buckling, energy, life, load that hangs.
    interrupted : bool
        Whether the search was cancelled before its end.
    notes : tuple of str
    asked : dict
        Numbers of the search by the names of `pneudrive.size`: least, most, draws, draws_best.
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
    dropped: tuple[Dropped, ...] = ()
    savings: tuple[Saving, ...] = ()
    checks: tuple[MachineCheck, ...] = ()
    interrupted: bool = False
    notes: tuple[str, ...] = field(default=())
    asked: Mapping[str, int] = field(default_factory=dict)

    @property
    def feasible(self) -> bool:
        """Whether any choice meets the limits of the task; see `ready`."""
        return bool(self.ranked)

    @property
    def open_checks(self) -> list[MachineCheck]:
        """Checks of the best drive that are not kept or not decided."""
        return [check for check in self.checks if check.is_open]

    @property
    def ready(self) -> bool:
        """Whether the best drive can be ordered: it meets the task, and each of its checks is kept."""
        return self.feasible and not self.open_checks

    @property
    def state(self) -> str:
        """Feasible and ready, in words."""
        if not self.feasible or self.ready:
            return f"feasible = {str(self.feasible).lower()}, ready = {str(self.ready).lower()}"
        return f"feasible = true, but ready = false (open checks: {len(self.open_checks)})"

    @property
    def best(self) -> SizedDrive | None:
        """First drive of the ranking."""
        return self.ranked[0] if self.ranked else None

    @property
    def by_cylinder(self) -> list[SizedDrive]:
        """Best drive of each cylinder, in the order of the ranking."""
        first: dict[str, SizedDrive] = {}
        for one in self.ranked:
            first.setdefault(one.parts["cylinder"], one)
        return list(first.values())

    def circuit(self, place: int = 0) -> Circuit:
        """Return the circuit at a place of the ranking, with its settings, ready to run."""
        drive = self.ranked[place]
        return circuit_of(self.task, drive.parts, Setting(**drive.setting))

    def save(self, folder: str | Path) -> list[Path]:
        """Write table, summary and the files of the ten best into a folder."""
        return write(self, Path(folder))

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw time against air with the limits; see `pneudrive.report.sizing.plot_sizing`."""
        return upper("plot_sizing")(self, path)

    def report(self, folder: str | Path) -> Path:
        """Write report.html into a folder; see `pneudrive.report.sizing.write_sizing_report`."""
        return upper("write_sizing_report")(self, folder)

    def _card(self) -> Card:
        title = f"sizing of {self.task.name}: {self.state}"
        return Card(title, HEAD, [row_of(one) for one in self.ranked[:WRITTEN]], sentences(self))


HEAD = (
    *("cylinder", "valve", "tube", "flow control", "time out s", "back s", "end m/s", "energy J", "peak bar abs"),
    *("air l ANR", "met", "at least", "margin", "binds"),
)

#: Columns of `HEAD` that name parts.
PARTS = 4


def set_to(one: SizedDrive) -> str:
    """Return the settings of a drive's needles, in words."""
    said = [f"{name.replace('_', ' ')} {100.0 * share:.3g} %" for name, share in one.setting.items() if share < 1.0]
    return f"needles: {', '.join(said)} of fully open" if said else "needles fully open"


def row_of(one: SizedDrive) -> tuple[str, ...]:
    """Write a drive as a row of a table under `HEAD`."""
    figures = (one.time_out, one.time_back, one.end_speed, one.energy, 1e-5 * one.peak_pressure, one.air_litres_anr)
    return (
        *one.parts.values(),
        *map(three, figures),
        f"{one.met} of {one.draws}",
        f"{one.probability_bound:.4f}",
        f"{100.0 * one.margin:.0f} %",
        one.binding,
    )


def sentences(result: SizingResult) -> list[str]:
    """Return the answer, open checks, its reasons, the second-best cylinder, and the size of the search."""
    cut = ", ".join(f"{name} {count}" for name, count in sorted(result.pruned.items(), key=lambda one: -one[1]))
    said = [sentence(result.task, result.best, result.checks, () if result.miss else result.provisional)]
    best = result.best
    if best is not None:
        said += [f"{one}." for one in result.open_checks]
        said += yearly(best, result.task)
        said += [f"{one}." for one in (*result.savings, *(check for check in result.checks if not check.is_open))]
        said += [
            f"Next best cylinder: {in_words(one.parts)}, {three(one.air_litres_anr)} l ANR a cycle, "
            f"margin {three(100.0 * one.margin)} %."
            for one in result.by_cylinder[1:2]
        ]
    if result.miss is not None:
        parts = " + ".join(name for name in result.miss.parts.values() if name != "*")
        said.append(f"Nearest miss: {parts}; it misses: {result.miss.limit}. {result.miss.gives}")
        said += [f"Nearest possible {one}." for one in result.miss.possible]
    said.append(
        f"{result.enumerated} choices of parts, {result.left} left after pruning ({cut or 'none pruned'}); "
        f"{result.tuned} tuned, {len(result.simulated)} simulated over the spreads, {len(result.ranked)} meet the task."
    )
    return said + list(result.notes)


def answer_of(stored: Mapping[str, Any]) -> str:
    """Return the answer of a stored result. Earlier versions wrote "Take" although a check was open."""
    answer = str((stored.get("said") or [""])[0])
    is_open = any(check.get("is_kept") is not True for check in stored.get("checks", ()))
    return NOT_READY + answer.removeprefix("Take ") if is_open and answer.startswith("Take ") else answer


def nearest_miss(
    task: SizingTask,
    simulated: list[SizedDrive],
    short: list[tuple[Any, Any]],
    pruned: list[tuple[dict[str, str], Shortage]],
) -> NearestMiss:
    """Return the nearest choice: from the simulated, else the tuned, else the pruned choices.

    Parameters
    ----------
    task : SizingTask
    simulated : list of SizedDrive
    short : list of (DriveChoice, Tuned)
        Tuned, but short of the task even in the nominal case.
    pruned : list of (dict, Shortage)
        By the safe bounds.
    """
    if simulated:
        one = max(simulated, key=lambda drive: (drive.met / drive.draws, drive.margin))
        value, limit, unit = one.worst[one.binding]
        return NearestMiss(one.parts, one.binding, _gives(one.binding, limit, value, unit, "1 % of the draws pass"))
    if short:
        choice, tuned = max(short, key=lambda one: one[1].nominal)
        name, limit, value = tuned.short
        unit = next((unit for word, unit in _UNITS.items() if word in name), "s")
        return NearestMiss(choice.parts, name, _gives(name, limit, value, unit, "the nominal case gives"))
    parts, bound = max(pruned, key=lambda one: one[1].share)
    gives = f"{bound.said[0].upper()}{bound.said[1:]}."
    if bound.limit == "force" and bound.share > 0.0:
        spread = task.supply.spread_pa  # the bound uses its upper end
        gauge = 1e-5 * ((task.supply_pa + spread - task.ambient.pressure_pa) / bound.share - spread)
        gives += f" The force needed would have to fall to {100.0 * bound.share:.0f} %, or the supply to rise to "
        gives += f"{math.ceil(10.0 * gauge) / 10.0:g} bar gauge at least."
    elif bound.share > 0.0:
        gives += f" The required value would have to fall to {100.0 * bound.share:.0f} %."
    return NearestMiss(parts, bound.limit, gives)


def _gives(name: str, limit: float, value: float, unit: str, what: str) -> str:
    factor, read = READ.get(unit, (1.0, unit))
    if not math.isfinite(value):
        return f"The limit of {name} is {factor * limit:.3g} {read}; the stroke does not end within the run."
    # As many digits as distinguish the two values.
    digits = next((n for n in range(3, 17) if f"{limit:.{n}g}" != f"{value:.{n}g}"), 3)
    return (
        f"The limit of {name} is {factor * limit:.{digits}g} {read}; {what} {factor * value:.{digits}g} {read}: "
        "relax it to this value, or change supply pressure, tubes or catalogue."
    )


def write(result: SizingResult, folder: Path) -> list[Path]:
    """Write ranking, summary and the circuit files of the ten best; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [",".join(HEAD), *(",".join(row_of(one)) for one in result.ranked)]
    files = {TABLE: "\n".join(rows) + "\n", SUMMARY: json.dumps(_strict(summary(result)), indent=1) + "\n"}
    lost = [",".join((*one.parts.values(), str(one.choices), one.limit, f'"{one.said}"')) for one in result.dropped]
    files[REASONS] = "\n".join((",".join((*SLOTS, "choices", "limit", "reason")), *lost)) + "\n"
    for place in range(min(len(result.ranked), WRITTEN)):
        files[f"{place + 1:02d}.toml"] = result.circuit(place).to_toml()
    for name, text in files.items():
        with whole(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in files]


def summary(result: SizingResult) -> dict[str, Any]:
    """Return the result as plain data."""
    best = result.best
    return {
        "task": result.task.to_dict(),
        "feasible": result.feasible,
        "ready": result.ready,
        "complete": result.complete,
        "enumerated": result.enumerated,
        "left": result.left,
        "pruned": dict(result.pruned),
        "provisional": [vars(one) for one in result.provisional],
        "tuned": result.tuned,
        "simulated": len(result.simulated),
        "ranked": [one.to_dict() for one in result.ranked],
        "miss": None if result.miss is None else vars(result.miss),
        "assumed": result.circuit().assumed() if best is not None else [],
        "savings": [saving._asdict() for saving in result.savings],
        "checks": [check._asdict() for check in result.checks],
        "interrupted": result.interrupted,
        "notes": list(result.notes),
        "asked": dict(result.asked),
        "said": sentences(result),
    }


def _strict(given: Any) -> Any:  # noqa: ANN401 - plain data
    """Return plain data that any reader of JSON accepts, with null for values that are not finite."""
    if isinstance(given, dict):
        return {key: _strict(one) for key, one in given.items()}
    if isinstance(given, list | tuple):
        return [_strict(one) for one in given]
    return None if isinstance(given, float) and not math.isfinite(given) else given


# --- Changes of the best drive that save air: a lower pressure for the return stroke, shorter tubes.

#: Shares of the gauge pressure that the way back is tried with, and of the length of the tubes.
RETURN_SHARES, TUBE_SHARE = (0.5, 0.7), 0.5


class Saving(NamedTuple):
    """A change that keeps the task and saves air.

    Attributes
    ----------
    change : str
    share : float
        Share of the air that it saves; 0 where the change does not keep the task.
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


def savings(best: DriveStrokes, sized_best: SizedDrive, draws: NDArray[np.float64]) -> Iterator[Saving]:
    """Try changes of the best drive; each is tuned and simulated over samples of the spreads."""
    task, half = best.task, best.task.tube_length_m * TUBE_SHARE
    shorter = task.model_copy(update={"tube_length_m": half})
    tube = next(part for part in choices(shorter)["tube"] if part.name == best.choice.tube.name)
    tried = {
        f"{100.0 * share:.0f} % of the supply's gauge pressure for the way back": replace(best, return_share=share)
        for share in RETURN_SHARES
    }
    short = replace(best, choice=replace(best.choice, tube=tube), task=shorter)
    tried[f"tubes of {half:.3g} m in place of {task.tube_length_m:.3g} m"] = short
    for change, strokes in tried.items():
        tuned = tune(strokes)
        made = None if tuned.nominal < 0.0 else sized(strokes, tuned.setting, draws)
        is_kept = made is not None and made.is_feasible
        yield Saving(change, 1.0 - made.air / sized_best.air if is_kept and made else 0.0, is_kept)
