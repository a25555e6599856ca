"""The report of a drive compared with its recordings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import Quantity
from pneudrive.report import style
from pneudrive.report.page import Paragraph, Picture, Report
from pneudrive.report.topics import Topic
from pneudrive.report.validation import figures
from pneudrive.report.words import plural, sentence, spread_evenly
from pneudrive.validate.validation import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pneudrive.describe.drive import Drive
    from pneudrive.report.page import Block, Section
    from pneudrive.validate.validation import RecordResult, Validation

MOST_RECORDS, MOST_FAILURES, MOST_STOPS = 6, 4, 60
MARKS = {True: "Met.", False: "Missed.", None: ""}
SHOWN_ALONE = 12


@style.applied()
def write_validation_report(found: Validation, folder: str | Path) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : Validation
    folder : path-like
        Must be there.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    parts = [
        _metrics(found),
        _why(found),
        *(_record(found, r) for r in _shown(found)),
        _stops(found),
        _conditions(found),
        _whiteness(found),
        _provenance(found),
    ]
    title = f"{found.drive.name} against {plural(len(found.records), 'recording')}"
    return Report(title, _lines(found), parts, found.synthetic).write(folder)


def _shown(found: Validation) -> list[RecordResult]:
    return spread_evenly(found.records, MOST_RECORDS)


def _lines(found: Validation) -> list[str]:
    lines = [f"{sentence(v.text)} {MARKS[v.met]}".strip() for v in found.verdicts]
    return [*lines, *map(sentence, found.why()), *map(sentence, found.notes)]


def _metrics(found: Validation) -> Section:
    topic, rows = Topic("validation", "metrics"), []
    for r in found.records:
        for column, channel in r.channels.items():
            factor, unit = figures.scale(column)
            free, again = channel.free, channel.restarted
            sizes = (f"{factor * free.rms:.3g} {unit}", f"{factor * free.largest:.3g} {unit}")
            off = None if channel.off_s is None else f"{channel.off_s:.2f}"
            numbers = (free.fit_percent, 100 * free.nrmse, *sizes, again.fit_percent, 100 * again.nrmse, off)
            rows.append((r.recording.name, CHANNELS[column], *numbers))
    return topic.section(topic.text(window_s=found.window_s), topic.table(rows))


def _why(found: Validation) -> Section:
    topic, diagnosis = Topic("validation", "why"), found.diagnosis()
    pictures = []
    for i, r in enumerate(_shown(found)[:2], 1):
        where = next(k for k, own in enumerate(found.records) if own is r)
        drawn = figures.balance(found.drive, r.signals, diagnosis.scenes[where])
        pictures.append(Picture(f"balance-{i}", topic.say("caption", name=r.recording.name), drawn))
    sizes = topic.table(((name, f"{v:.2g}" if v == v else None) for name, v in diagnosis.size.items()), "sizes")
    if diagnosis.culprits:
        causes = (
            (c.key, 100 * c.share, c.text, ", ".join(name for name, _ in c.rivals) or None) for c in diagnosis.culprits
        )
        alone = ((key, amount, 100 * share) for key, amount, share in diagnosis.alone[:SHOWN_ALONE])
        blocks: list[Block] = [topic.table(causes, "causes"), topic.table(alone, "alone")]
    else:
        blocks = [Paragraph(sentence(str(diagnosis)), "holds" if diagnosis.is_clean else "fails")]
    return topic.section(topic.text(), sizes, *blocks, *pictures)


def _record(found: Validation, r: RecordResult) -> Section:
    topic, name = Topic("validation", "record"), r.recording.name
    number = [x is r for x in found.records].index(True) + 1
    failures = (*r.free.failures, *r.restarted.failures)[:MOST_FAILURES]
    part = topic.section(
        *topic.listed(topic.say("failure", failure=failure) for failure in failures),
        Picture(f"record-{number}", topic.say("channels", name=name, window_s=found.window_s), figures.channels(r)),
        Picture(f"residual-{number}", topic.say("residual", name=name), figures.correlation(r, found.window_s)),
        name=name,
    )
    return replace(part, key=f"record-{number}")


def _stops(found: Validation) -> Section | None:
    rows = [
        (r.recording.name, b.start_s, b.onset_s - b.start_s, b.measured_n, b.model_n, 100 * b.error)
        for r in found.records
        for b in r.breakaways
    ]
    topic = Topic("validation", "breakaway")
    return topic.section(topic.text(), topic.table(rows[:MOST_STOPS])) if rows else None


def _conditions(found: Validation) -> Section | None:
    rows = [
        (c.label, c.value, c.recordings, c.position_fit_percent, c.restarted_fit_percent, 100 * c.pressure_nrmse)
        for c in found.conditions
    ]
    topic = Topic("validation", "conditions")
    return topic.section(topic.table(rows)) if rows else None


def _whiteness(found: Validation) -> Section:
    topic, rows = Topic("validation", "whiteness"), []
    for r in found.records:
        for column, channel in r.channels.items():
            white = channel.whiteness
            strongest = ", ".join(f"{c.signal} {c.value:+.2f}" for c in channel.cross[:3])
            rows.append((r.recording.name, CHANNELS[column], 100 * white.outside, white.p, strongest))
    return topic.section(topic.text(), topic.table(rows))


def _identified(drive: Drive) -> Iterator[tuple[str | None, ...]]:
    """Return identified values, with their intervals from noise and from model error."""
    known = values(drive)
    for name, origin in drive.provenance.items():
        mark, si = known[name]
        shown = mark.show(si) if isinstance(mark, Quantity) else f"{si / 1e5:g} bar"
        low, high = origin.interval
        model = f"± {origin.model_error}" if origin.model_error else None
        yield name, str(shown), f"{low} … {high}", model, origin.source


def _provenance(found: Validation) -> Section:
    topic, identified = Topic("validation", "provenance"), list(_identified(found.drive))
    recordings = [r.recording for r in found.records]
    badges = [found.badge(r) or None for r in found.records]
    rows = (
        (r.name, badge, str(r.source) if r.source else None, len(r), r.sha256[:16])
        for r, badge in zip(recordings, badges, strict=True)
    )
    return topic.section(
        topic.text("synthetic" if found.synthetic else "measured"),
        topic.table(rows),
        topic.table(identified, "identified") if identified else None,
        Paragraph(found.drive.to_toml().strip(), "code"),
        synthetic=False,
    )
