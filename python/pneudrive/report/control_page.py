"""The page of laws beside each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.control.measures import SHOWN, written
from pneudrive.report import style
from pneudrive.report.control import tracks
from pneudrive.report.page import Items, PageTable, Paragraph, Picture, Report, section
from pneudrive.report.words import plural

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.control.comparison import ControlComparison
    from pneudrive.report.page import Section

SAID = (
    "Simulated: the laws predict with the equations by which the drive is simulated, so that only what they were told "
    "of it can be wrong. Each number is the median of the seeds. Errors are reference less true position; of a sine "
    "they are those of its last 4 s. Times of a step are of the machine that made this page."
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
    parts = [_method(found), *(_reference(found, number) for number in range(len(found.references))), _told(found)]
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
    lines = [f"{plural(len({run.seed for run in found.runs}), 'seed')} of noise for each law and reference"]
    lines.append(f"setup {found.setup_name}: {setup.about}" if setup.about else f"setup {found.setup_name}")
    for name, tuning in found.tunings.items():
        if tuning.belief.name != found.drive:
            lines.append(f"{name} believes that it commands {tuning.belief.name}")
    return section("method", "What was compared", Paragraph(SAID), Items(tuple(lines)))


def _reference(found: ControlComparison, number: int) -> Section:
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
    caption = f"Tracks and errors along {called}, simulated; of each law its first seed."
    picture = Picture(f"tracks-{number + 1}", caption, tracks(found, name))
    return section(f"reference-{number + 1}", called, table, picture)


def _told(found: ControlComparison) -> Section:
    """Say what each law was told: its gains with their rules, and what the drive is to it."""
    rows = [
        (name, gain.key, str(gain), gain.meaning, "given" if gain.given else gain.rule)
        for name, tuning in found.tunings.items()
        for gain in tuning.gains
    ]
    gains = PageTable(("law", "gain", "value", "meaning", "follows from"), tuple(rows), "Gains", numbers_from=9)
    first = next(iter(found.tunings.values()))
    plant = PageTable(("", ""), tuple(first.plant.rows()), "The drive to its laws, about mid stroke", numbers_from=9)
    return section("told", "What the laws were told", plant, gains, synthetic=False)
