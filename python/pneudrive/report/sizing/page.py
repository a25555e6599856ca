"""Page of a sizing: candidates and their limits, the best one with its values, the task, and the command."""

from __future__ import annotations

import platform
import re
from typing import TYPE_CHECKING

from pneudrive import __version__
from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.all_values import values_of
from pneudrive.describe.files import toml
from pneudrive.report import style
from pneudrive.report.circuit.drawing import draw_circuit
from pneudrive.report.page import Items, PageTable, Paragraph, Picture, Report, section
from pneudrive.report.provenance import reference
from pneudrive.report.sizing.figures import draw
from pneudrive.report.words import plural
from pneudrive.sizing.choices import WITHOUT
from pneudrive.sizing.result import HEAD, PARTS, READ, WRITTEN, row_of, sentences, set_to
from pneudrive.sizing.search import is_of_command
from pneudrive.sizing.task import GUIDES, follows_from
from pneudrive.sizing.task import values_of as task_values

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from pneudrive.report.page import Section
    from pneudrive.sizing.result import SizingResult
    from pneudrive.sizing.sized_drive import SizedDrive

#: How the page is to be read.
READING = (
    "Everything on this page is simulated. Times, speeds, energies and pressures are exceeded by 1 % of the samples, "
    "pressures are absolute, and air is the mean of a cycle in litres at 100 kPa, 20 °C and 65 % humidity. A time runs "
    "from the command to the first contact with the end; energy is that of all moving masses at this contact. A "
    "range (a … b) contains 98 % of the samples: 1 % are below, 1 % above."
)
MARGIN = (
    "The margin is the fraction of a limit that 99 % of the samples leave unused; below 0 the limit is missed. "
    "A choice meets the task if 99 % of the samples keep all limits. At least: lower bound of that probability at "
    "95 % confidence, after Clopper and Pearson, as if the samples were independent."
)
NOT_CHECKED = (
    "Guides are not checked for moments, and life only against a B10 that the catalogue states.",
    "The next stroke begins with one side full and the other empty; waves in long tubes are left out.",
)
#: What is told of the best choice: words, figure, factor from SI, unit.
FIGURES = (
    ("time out", "time_out", 1.0, "s"),
    ("time back", "time_back", 1.0, "s"),
    ("end speed, the worse stroke", "end_speed", 1.0, "m/s"),
    ("energy at the end, the worse stroke", "energy", 1.0, "J"),
    ("peak pressure", "peak_pressure", 1e-5, "bar abs"),
    ("air of a cycle", "air", ANR_LITRES_PER_KG, "l ANR"),
    ("load ratio out", "load_ratio_out", 100.0, "%"),
    ("load ratio back", "load_ratio_back", 100.0, "%"),
)
_KEY = re.compile(r"\[([\w-]+)\]")


@style.applied()
def write_sizing_report(found: SizingResult, folder: str | Path) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : SizingResult
        From `pneudrive.size`.
    folder : path-like
        Must be there.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    parts = [_candidates(found), _limits(found), *_best(found), _task(found), _method(found), *_sources(found)]
    return Report(f"{found.task.name}: sizing, simulated", _verdict(found), parts, synthetic=True).write(folder)


def _verdict(found: SizingResult) -> list[str]:
    """Return the answer in one sentence, its reasons, and the second-best choice."""
    lines, cheaper = sentences(found), _cheaper(found)
    if found.best is not None and cheaper:
        first = cheaper[0]
        said = f"{plural(len(cheaper), 'choice')} of less air missed a limit; {_called(first)}: {_missed(first)}."
        lines.insert(-1 - len(found.notes), said)
    return lines


def _ends(one: SizedDrive, name: str, factor: float) -> str:
    """Return the range of 98 % of the samples. Empty in folders of earlier versions."""
    if name not in one.intervals:
        return ""
    low, high = (f"{factor * end:.3g}" if end < float("inf") else "no end" for end in one.intervals[name])
    return f"{low} … {high}"


def _called(one: SizedDrive) -> str:
    return " + ".join(name for name in one.parts.values() if name != WITHOUT)


def _cheaper(found: SizingResult) -> list[SizedDrive]:
    """Return the simulated choices that miss a limit and use less air than the best one, least air first."""
    most = float("inf") if found.best is None else found.best.air
    ranked = {one.name for one in found.ranked}
    missed = (one for one in found.simulated if one.name not in ranked and one.air < most)
    return sorted(missed, key=lambda one: one.air)


def _missed(one: SizedDrive) -> str:
    """Return the limits that a choice misses, and the amounts, in words."""
    said = []
    for name, (value, limit, unit) in one.worst.items():
        if one.margins[name] < 0.0:
            said.append(f"{name} {_read(value, unit)}, limit {_read(limit, unit)}")
    return "; ".join(said) or f"{one.met} of {one.draws} draws keep all limits together"


def _read(value: float, unit: str) -> str:
    """Return a value, in SI, as a number. Infinite if the stroke does not end."""
    factor, read = READ.get(unit, (1.0, unit))
    return f"{factor * value:.3g} {read}" if value < float("inf") else "the stroke does not end"


def _candidates(found: SizingResult) -> Section:
    rows = [
        (str(place), _called(one), *row_of(one)[PARTS:-1]) for place, one in enumerate(found.by_cylinder[:WRITTEN], 1)
    ]
    heads = ("", "parts", *HEAD[PARTS:-1])
    ranking = PageTable(heads, tuple(rows), "Candidates that meet the task: the best of each cylinder", numbers_from=2)
    cheaper = _cheaper(found)[:WRITTEN]
    lost = tuple((_called(one), f"{one.air_litres_anr:.3g}", _missed(one)) for one in cheaper)
    title = (
        "Candidates that miss a limit but use less air than the best" if found.ranked else "Nearest candidates, by air"
    )
    caption = (
        "Time that 1 % of the samples exceed, against the air of a cycle, for every simulated choice. Lines contain "
        "98 % of the samples of the best choice."
    )
    return section(
        "candidates",
        "Candidates",
        Paragraph(READING),
        ranking if rows else None,
        PageTable(("parts", "air l ANR", "misses"), lost, title, numbers_from=9) if lost else None,
        Picture("candidates", caption, draw(found)) if found.simulated else None,
    )


def _limits(found: SizingResult) -> Section | None:
    shown = [*found.by_cylinder[:WRITTEN], *(_cheaper(found)[:WRITTEN] if not found.ranked else ())]
    if not shown:
        return None
    names = list(dict.fromkeys(name for one in shown for name in one.worst))
    rows = tuple((_called(one), *(_against(one, name) for name in names), one.binding) for one in shown)
    said = []
    for name in names:
        _, limit, unit = next(one.worst[name] for one in shown if name in one.worst)
        said.append(f"{name}, limit {_read(limit, unit)}")
    head = ("parts", *said, "binds")
    return section(
        "limits",
        "Limits of each",
        Paragraph(MARGIN),
        PageTable(head, rows, "Values of 98 % of the samples, and margin in brackets"),
    )


def _against(one: SizedDrive, name: str) -> str:
    if name not in one.worst:
        return "–"
    value, _, unit = one.worst[name]
    factor, _ = READ.get(unit, (1.0, unit))
    return f"{_ends(one, name, factor) or _read(value, unit)} ({100.0 * one.margins[name]:.0f} %)"


def _best(found: SizingResult) -> list[Section]:
    best = found.best
    if best is None:
        return []
    circuit = found.circuit()
    values = [
        (one.key.removeprefix("components."), str(one.value), _origin(one.kind, one.origin))
        for one in values_of(circuit)
        if not one.key.endswith(".kind")
    ]
    named = {f"{key} = " for key, *_ in values}
    rest = tuple(line for line in circuit.assumed() if not line.startswith(tuple(named)))
    said = [f"{slot.replace('_', ' ')}: {name}" for slot, name in best.parts.items()]
    drawn = Picture("circuit", f"Circuit of the best choice, {_called(best)}.", draw_circuit(circuit))
    figures = tuple((what, ends, unit) for what, name, factor, unit in FIGURES if (ends := _ends(best, name, factor)))
    does = PageTable(("", "98 % of the samples", ""), figures, "Simulated motion") if figures else None
    return [
        section("best", "The best choice", Items((*said, set_to(best))), drawn, does, synthetic=False),
        section(
            "values",
            "Its values and their sources",
            PageTable(("value", "", "from"), tuple(values), "In brackets: source, at the end", numbers_from=9),
            Items(rest),
            synthetic=False,
        ),
    ]


def _origin(kind: str, said: str) -> str:
    if kind in ("given", "default"):
        return {"given": "the task, or the choice of parts", "default": "default"}[kind]
    return said if kind == "source" or said.startswith("assumed") else f"{kind}: {said}"


def _task(found: SizingResult) -> Section:
    rows = tuple(
        (one.key, one.text, "given" if one.is_given else "default", one.meaning) for one in task_values(found.task)
    )
    follows = tuple(f"{what}: {value:.4g} {unit}" for what, value, unit in follows_from(found.task))
    guide = f"coefficient of friction of the guide {found.task.guide!r}: {GUIDES[found.task.guide]} (assumed)"
    return section(
        "task",
        "The task",
        PageTable(("key", "value", "", "meaning"), rows, "Samples are spread evenly over each range", numbers_from=9),
        Items((*follows, *((guide,) if GUIDES[found.task.guide] else ()))),
        synthetic=False,
    )


def _method(found: SizingResult) -> Section:
    asked = found.asked
    options = ", ".join(f"{name}={count}" for name, count in asked.items())
    lines = [f'import pneudrive as pn\n\nfound = pn.size("task.toml", {options})\nfound.report("out")']
    if is_of_command(asked):
        options = f"--min-candidates {asked['least']} --samples {asked['draws']}"
        lines.insert(0, f"pneudrive size task.toml {options} --out out")
    return section(
        "again",
        "Method, and commands to repeat the sizing",
        Items((sentences(found)[-1 - len(found.notes)], *NOT_CHECKED)),
        Paragraph(
            f"With the task below as task.toml, each gives the same numbers (pneudrive {__version__}, Python "
            f"{platform.python_version()}; the samples are points of a Sobol sequence, the same each time)."
        ),
        *(Paragraph(line, "code") for line in lines),
        Paragraph(toml.write(found.task.to_dict()).strip(), "code"),
        synthetic=False,
    )


def _sources(found: SizingResult) -> Iterable[Section]:
    if found.best is None:
        return
    keys = dict.fromkeys(key for one in values_of(found.circuit()) for key in _KEY.findall(one.origin))
    lines = tuple(line for key in keys if (line := reference(key)))
    yield section("sources", "Sources", Items(lines), synthetic=False)
