"""Report of a benchmark of controllers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pneudrive.control.results.measures import written
from pneudrive.report import style
from pneudrive.report.control.figures import boxes, tracks
from pneudrive.report.page import Items, PageTable, Picture, Report
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.control.results.comparison import ControlComparison
    from pneudrive.report.page import Section


@style.applied()
def write_control_report(found: ControlComparison, folder: str | Path) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : ControlComparison
    folder : path-like
        Must be there.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    each = [_reference(found, number) for number in range(len(found.references))]
    parts = [_method(found), *each, _told(found), *_true(found)]
    title = f"{found.drive} under {plural(len(found.tunings), 'law')} of control"
    return Report(title, _verdict(found), parts, synthetic=True).write(folder)


def _verdict(found: ControlComparison) -> list[str]:
    lines = []
    for name, one in found.references.items():
        best = found.best(name)
        if best is not None:
            error = written("max_error_m", found.middle(best, name, "max_error_m"))
            lines.append(f"{_called(name, one.text)}: {best} has the smallest largest error, {error} (simulated).")
    failed = [run for run in found.runs if run.score is None]
    lines += [f"{run.law} along {run.reference}, seed {run.seed}, failed: {run.reason}" for run in failed[:3]]
    return lines


def _called(name: str, text: str) -> str:
    return text if name == text else f"{name} ({text})"


def _method(found: ControlComparison) -> Section:
    topic, setup = Topic("control", "method"), found.setup
    count = len({run.seed for run in found.runs})
    each = plural(count, "member") if found.spread else f"{plural(count, 'seed')} of noise"
    lines = [f"{each} for each law and reference"]
    lines.append(topic.say("about" if setup.about else "setup", name=found.setup_name, about=setup.about))
    for name, tuning in found.tunings.items():
        if tuning.belief.name != found.drive:
            lines.append(topic.say("believes", law=name, drive=tuning.belief.name))
    if found.mismatch:
        lines.append(topic.say("mismatch", mismatch=found.mismatch))
    if found.spread:
        lines.append(topic.say("spread", spread=found.spread))
    return topic.section(topic.text(), Items(tuple(lines)))


def _reference(found: ControlComparison, number: int) -> Section:
    """Show the scores along one reference; of a spread the fractions of its members, and a box for each law."""
    topic, name = Topic("control", "reference"), list(found.references)[number]
    said: dict[str, Any] = {"called": _called(name, found.references[name].text), "spread": found.spread}
    pictures = []
    if found.spread:
        pictures.append(Picture(f"boxes-{number + 1}", topic.say("boxes", **said), boxes(found, name)))
    heads, rows = found.table(name, spread=bool(found.spread))
    table = PageTable(tuple(heads), tuple(map(tuple, rows)), topic.say("members" if found.spread else "seeds", **said))
    caption = topic.say("tracks", which="member 1" if found.spread else "first seed", **said)
    pictures.append(Picture(f"tracks-{number + 1}", caption, tracks(found, name)))
    return replace(topic.section(table, *pictures, **said), key=f"reference-{number + 1}")


def _true(found: ControlComparison) -> list[Section]:
    """Describe the true values that differ from the assumed ones: least and largest over all members."""
    each: dict[str, list[float]] = {}
    for run in found.runs:
        for name, value in run.truth.items():
            each.setdefault(name, []).append(value)
    topic, rows = Topic("control", "true"), ((name, min(values), max(values)) for name, values in each.items())
    return [topic.section(topic.text(), topic.table(rows))] if each else []


def _told(found: ControlComparison) -> Section:
    """Describe each controller: its gains with their rules, and the drive that it assumes."""
    rows = (
        (name, gain.key, str(gain), gain.meaning, "given" if gain.given else gain.rule)
        for name, tuning in found.tunings.items()
        for gain in tuning.gains
    )
    topic, first = Topic("control", "told"), next(iter(found.tunings.values()))
    return topic.section(topic.table(first.plant.rows(), "plant"), topic.table(rows, "gains"), synthetic=False)
