"""Page of a sizing: candidates and their limits, the best one with its values, the task, and the command."""

from __future__ import annotations

import platform
import re
from typing import TYPE_CHECKING

from pneudrive import __version__
from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.all_values import values_of
from pneudrive.describe.files import toml
from pneudrive.figures import Figure, Line, Look, Markers, Panel, Rule
from pneudrive.report.circuit.svg import draw_circuit
from pneudrive.report.page import Items, PageTable, Paragraph, Report
from pneudrive.report.provenance import references
from pneudrive.report.render import draw_figure
from pneudrive.report.tables import plural
from pneudrive.report.topics import Topic
from pneudrive.sizing.choices import WITHOUT
from pneudrive.sizing.result import HEAD, PARTS, READ, WRITTEN, row_of, sentences, set_to
from pneudrive.sizing.search import MOST, is_of_command
from pneudrive.sizing.task import GUIDES, follows_from
from pneudrive.sizing.task import values_of as task_values

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    import matplotlib.figure

    from pneudrive.report.page import Section
    from pneudrive.sizing.checks import SizedDrive
    from pneudrive.sizing.result import SizingResult

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


def plot_sizing(result: SizingResult, path: str | Path | None = None) -> matplotlib.figure.Figure:
    """Draw the time that 1 % of the samples exceed over the air of a cycle: a point for each choice, and the limits.

    The lines of the best candidate cover 98 % of its samples.

    Parameters
    ----------
    result : SizingResult
        From `pneudrive.size`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        If the suffix is unknown, or the file cannot be written.
    """
    return draw_figure(candidate_figure(result), path, synthetic=True)


def candidate_figure(result: SizingResult) -> Figure:
    """Draw a panel for each stroke."""
    task, panels = result.task, []
    for way, limit in (("out", task.outward_s), ("back", task.back_s)):
        longest = Rule(y=limit * (1.0 - task.margin), label="longest time", look=Look("black", "--"), width=1.1)
        panels.append(Panel([*_points(result, way), longest], f"stroke {way}", y=f"time {way}, worst 1 % / s"))
    return Figure(panels, "air of a cycle / l ANR", columns=2, row_in=3.1, rest_in=0.0, share_x="all")


def _points(result: SizingResult, way: str) -> Iterator[Markers | Line]:
    best = result.best
    if best is not None:
        air, time, own = best.air_litres_anr, _time(best, way), Look("orange")
        yield Markers([air], [time], "best", own, size=9.0)
        if best.intervals:  # the range of 98 % of the samples
            yield Line([ANR_LITRES_PER_KG * end for end in best.intervals["air"]], [time, time], look=own, width=1.2)
            yield Line([air, air], [best.intervals[f"time_{way}"][0], time], look=own, width=1.2)
    names = {drive.name for drive in result.ranked}
    rest = [drive for drive in result.simulated if drive.name not in names]
    for chosen, own, label in (
        ([drive for drive in rest if not drive.is_feasible], Look("grey", "-", "x"), "misses a limit"),
        ([drive for drive in rest if drive.is_feasible], Look("grey", "-", "."), "not simulated to the end"),
        (result.ranked, Look("blue"), "meets the task"),
    ):
        shown = [(drive.air_litres_anr, t) for drive in chosen if (t := _time(drive, way)) < float("inf")]
        if shown:
            air, times = zip(*shown, strict=True)
            yield Markers(air, times, label, own, filled=True)


def _time(drive: SizedDrive, way: str) -> float:
    return drive.time_out if way == "out" else drive.time_back


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
    return [f"{line[:1].upper()}{line[1:]}" for line in lines]


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
    topic, cheaper = Topic("sizing", "candidates"), _cheaper(found)[:WRITTEN]
    rows = [
        (str(place), _called(one), *row_of(one)[PARTS:-1]) for place, one in enumerate(found.by_cylinder[:WRITTEN], 1)
    ]
    heads = ("", "parts", *HEAD[PARTS:-1])
    lost = ((_called(one), f"{one.air_litres_anr:.3g}", _missed(one)) for one in cheaper)
    what = topic.say("cheaper" if found.ranked else "nearest")
    return topic.section(
        topic.text(),
        PageTable(heads, tuple(rows), topic.say("ranking"), numbers_from=2) if rows else None,
        topic.table(lost, "missed", what=what) if cheaper else None,
        topic.picture("candidates", candidate_figure(found)) if found.simulated else None,
    )


def _limits(found: SizingResult) -> Section | None:
    shown = [*found.by_cylinder[:WRITTEN], *(_cheaper(found)[:WRITTEN] if not found.ranked else ())]
    if not shown:
        return None
    topic, names = Topic("sizing", "limits"), list(dict.fromkeys(name for one in shown for name in one.worst))
    limits = {name: {_read(*one.worst[name][1:]) for one in shown if name in one.worst} for name in names}
    common = {name: one.pop() for name, one in limits.items() if len(one) == 1}  # others stand in the cells
    rows = tuple((_called(one), *(_against(one, name, name in common) for name in names), one.binding) for one in shown)
    heads = [f"{name}, limit {common[name]}" if name in common else name for name in names]
    return topic.section(topic.text(), PageTable(("parts", *heads, "binds"), rows, topic.say("table")))


def _against(one: SizedDrive, name: str, is_common: bool) -> str:
    """Return the range of a value, its limit unless it is common to all rows, and its margin."""
    if name not in one.worst:
        return "–"
    value, limit, unit = one.worst[name]
    factor, _ = READ.get(unit, (1.0, unit))
    of = "" if is_common else f" of {_read(limit, unit)}"
    return f"{_ends(one, name, factor) or _read(value, unit)}{of} ({100.0 * one.margins[name]:.0f}\u00a0%)"


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
    figures = [(what, ends, unit) for what, name, factor, unit in FIGURES if (ends := _ends(best, name, factor))]
    topic, sourced = Topic("sizing", "best"), Topic("sizing", "values")
    return [
        topic.section(
            Items((*said, set_to(best))),
            topic.picture("circuit", draw_circuit(circuit), parts=_called(best)),
            topic.table(figures) if figures else None,
            synthetic=False,
        ),
        sourced.section(sourced.table(values), Items(rest), synthetic=False),
    ]


def _origin(kind: str, said: str) -> str:
    if kind in ("given", "default"):
        return {"given": "the task, or the choice of parts", "default": "default"}[kind]
    return said if kind == "source" or said.startswith("assumed") else f"{kind}: {said}"


def _task(found: SizingResult) -> Section:
    topic, guide = Topic("sizing", "task"), found.task.guide
    rows = ((one.key, one.text, "given" if one.is_given else "default", one.meaning) for one in task_values(found.task))
    follows = [f"{what}: {value:.4g} {unit}" for what, value, unit in follows_from(found.task)]
    follows += [topic.say("guide", name=guide, friction=GUIDES[guide])] if GUIDES[guide] else []
    return topic.section(topic.table(rows), Items(tuple(follows)), synthetic=False)


def _method(found: SizingResult) -> Section:
    topic, asked = Topic("sizing", "again"), found.asked
    options = ", ".join(f"{name}={count}" for name, count in asked.items())
    lines = [f'import pneudrive as pn\n\nfound = pn.size("task.toml", {options})\nfound.report("out")']
    if is_of_command(asked):
        options = f"--min-candidates {asked['least']} --samples {asked['draws']}"
        options += f" --max-candidates {asked['most']}" if asked["most"] != MOST else ""
        lines.insert(0, f"pneudrive size task.toml {options} --out out")
    return topic.section(
        Items((sentences(found)[-1 - len(found.notes)], topic.say("moments"), topic.say("stroke"))),
        topic.text(version=__version__, python=platform.python_version()),
        *(Paragraph(line, "code") for line in (*lines, toml.write(found.task.to_dict()).strip())),
        synthetic=False,
    )


def _sources(found: SizingResult) -> Iterable[Section]:
    if found.best is None:
        return
    keys = dict.fromkeys(key for one in values_of(found.circuit()) for key in _KEY.findall(one.origin))
    yield Topic("sizing", "sources").section(Items(references(keys)), synthetic=False)
