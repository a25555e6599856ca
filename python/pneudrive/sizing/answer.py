"""The answer to a task in one sentence, its air and energy in a year, and ways to save air."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import NOT_READY
from pneudrive.numbers import plain as three
from pneudrive.sizing.choices import WITHOUT
from pneudrive.sizing.strokes import cycle_s

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pneudrive.sizing.checks import MachineCheck
    from pneudrive.sizing.sized_drive import Provisional, SizedDrive
    from pneudrive.sizing.task import SizingTask

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
