"""Report of a benchmark of controllers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.control.measures import SHOWN, SPREAD_SHOWN, written
from pneudrive.report import style
from pneudrive.report.control.figures import boxes, tracks
from pneudrive.report.page import Items, PageTable, Paragraph, Picture, Report, section
from pneudrive.report.words import plural

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.control.comparison import ControlComparison
    from pneudrive.report.page import Section

SAID = (
    "Simulated: controllers and drive share the equations of the simulation. Only the controllers' parameters can be "
    "wrong. Each number is the median of the seeds. Errors are reference minus true position. For a sine they cover "
    "the last 4 s, or the last period if that is longer. Step times depend on the machine that made this page."
)


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
    setup = found.setup
    count = len({run.seed for run in found.runs})
    each = plural(count, "member") if found.spread else f"{plural(count, 'seed')} of noise"
    lines = [f"{each} for each law and reference"]
    lines.append(f"setup {found.setup_name}: {setup.about}" if setup.about else f"setup {found.setup_name}")
    for name, tuning in found.tunings.items():
        if tuning.belief.name != found.drive:
            lines.append(f"{name} believes that it commands {tuning.belief.name}")
    if found.mismatch:
        lines.append(f"the drive differs from the assumed drive by the mismatch {found.mismatch}")
    if found.spread:
        lines.append(f"each member is a different drive, drawn from the spread {found.spread} with a different seed")
    return section("method", "Comparison", Paragraph(SAID), Items(tuple(lines)))


def _spread(found: ControlComparison, number: int) -> Section:
    """Show the members of a spread: a table of fractions, boxes, and the first member's tracks."""
    name = list(found.references)[number]
    called = _called(name, found.references[name].text)
    heads = ("law", *(SHOWN[one][0] for one in SPREAD_SHOWN), "lost")
    title = f"Along {called}, simulated: 50 / 95 / 100 % of the members of {found.spread} stay below"
    table = PageTable(heads, tuple(found.spread_rows(name)), title)
    boxes_said = f"Largest error along {called} over the members of {found.spread}, simulated: box from 25 to 75 %, "
    boxes_said += "whiskers from 5 to 95 %, dots beyond. Members that failed are not drawn."
    tracks_said = f"Tracks and errors along {called}, simulated; member 1 of each law."
    pictures = (
        Picture(f"boxes-{number + 1}", boxes_said, boxes(found, name)),
        Picture(f"tracks-{number + 1}", tracks_said, tracks(found, name)),
    )
    return section(f"reference-{number + 1}", called, table, *pictures)


def _reference(found: ControlComparison, number: int) -> Section:
    if found.spread:
        return _spread(found, number)
    name = list(found.references)[number]
    called = _called(name, found.references[name].text)
    rows = found.rows(name)
    heads = ["law", *(title for title, *_ in SHOWN.values()), "lost"]
    used = [i for i in range(len(heads)) if i == 0 or any(row[i] for row in rows)]
    table = PageTable(
        tuple(heads[i] for i in used),
        tuple(tuple(row[i] for i in used) for row in rows),
        f"Along {called}, simulated, median of the seeds",
    )
    caption = f"Tracks and errors along {called}, simulated; first seed of each law."
    picture = Picture(f"tracks-{number + 1}", caption, tracks(found, name))
    return section(f"reference-{number + 1}", called, table, picture)


def _true(found: ControlComparison) -> list[Section]:
    """Describe the true values that differ from the assumed ones: least and largest over all members."""
    each: dict[str, list[float]] = {}
    for run in found.runs:
        for name, value in run.truth.items():
            each.setdefault(name, []).append(value)
    if not each:
        return []
    rows = tuple((name, f"{min(values):.4g}", f"{max(values):.4g}") for name, values in each.items())
    heads = ("deviation of the true drive", "least", "largest")
    text = "Factors of the described values, and values in SI. The file score.csv has those of each member."
    return [section("true", "True drive", Paragraph(text), PageTable(heads, rows, "True drive"))]


def _told(found: ControlComparison) -> Section:
    """Describe each controller: its gains with their rules, and the drive that it assumes."""
    rows = [
        (name, gain.key, str(gain), gain.meaning, "given" if gain.given else gain.rule)
        for name, tuning in found.tunings.items()
        for gain in tuning.gains
    ]
    gains = PageTable(("law", "gain", "value", "meaning", "follows from"), tuple(rows), "Gains", numbers_from=9)
    first = next(iter(found.tunings.values()))
    plant = PageTable(
        ("", ""), tuple(first.plant.rows()), "Drive as assumed by the controllers, near mid-stroke", numbers_from=9
    )
    return section("told", "Assumed drive and gains", plant, gains, synthetic=False)
