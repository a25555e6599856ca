"""The reports of a drive compared with its recordings, and of a friction law compared with measured friction."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import Quantity
from pneudrive.figures import (
    MODEL,
    RESIDUAL,
    Axis,
    Band,
    Bars,
    Figure,
    Line,
    Look,
    Markers,
    Panel,
    Rule,
    look,
    stack,
    thin,
)
from pneudrive.report.page import Paragraph, Picture, Report
from pneudrive.report.tables import MOST_SHOWN, plural, quantity, sentence, spread_evenly
from pneudrive.report.topics import Topic
from pneudrive.validate.balance import BALANCES, moving_mass
from pneudrive.validate.validation import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pneudrive.describe.drive import Drive
    from pneudrive.report.page import Block, Section
    from pneudrive.validate.balance import Scene
    from pneudrive.validate.signals import Signals
    from pneudrive.validate.static import FrictionCurve, FrictionValidation
    from pneudrive.validate.validation import RecordResult, Validation

MOST_RECORDS, MOST_FAILURES, MOST_STOPS = 6, 4, 60
MARKS = {True: "Met.", False: "Missed.", None: ""}
SHOWN_ALONE = 12
DIRECTIONS = {0: "both", 1: "+x", -1: "-x"}


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
    lines = [f"{sentence(v.text)} {MARKS[v.met]}".strip() for v in found.verdicts]
    lines += [*map(sentence, found.why()), *map(sentence, found.notes)]
    records = [_record(found, r) for r in spread_evenly(found.records, MOST_RECORDS)]
    parts = [_metrics(found), _why(found), *records, _stops(found), _conditions(found), _whiteness(found)]
    title = f"{found.drive.name} against {plural(len(found.records), 'recording')}"
    return Report(title, lines, [*parts, _provenance(found)], found.synthetic).write(folder)


def _metrics(found: Validation) -> Section:
    topic, rows = Topic("validation", "metrics"), []
    for r in found.records:
        for column, channel in r.channels.items():
            size, unit = quantity(column)
            factor = 1.0 / size
            free, again = channel.free, channel.restarted
            sizes = (f"{factor * free.rms:.3g} {unit}", f"{factor * free.largest:.3g} {unit}")
            off = None if channel.off_s is None else f"{channel.off_s:.2f}"
            numbers = (free.fit_percent, 100 * free.nrmse, *sizes, again.fit_percent, 100 * again.nrmse, off)
            rows.append((r.recording.name, CHANNELS[column], *numbers))
    return topic.section(topic.text(window_s=found.window_s), topic.table(rows))


def _why(found: Validation) -> Section:
    topic, diagnosis = Topic("validation", "why"), found.diagnosis()
    pictures = []
    for i, r in enumerate(spread_evenly(found.records, MOST_RECORDS)[:2], 1):
        where = next(k for k, own in enumerate(found.records) if own is r)
        figure = balance_figure(found.drive, r.signals, diagnosis.scenes[where])
        pictures.append(Picture(f"balance-{i}", topic.say("caption", name=r.recording.name), figure))
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


def balance_figure(drive: Drive, signals: Signals, scene: Scene) -> Figure:
    """Draw terms of the force balance, and residuals of all three balances."""
    part, terms = thin(signals.time_s), scene.terms
    lines = (
        ("forces but friction", terms.force_n, Look()),
        ("m a", moving_mass(drive) * signals.acceleration_m_s2, Look("blue", "--")),
        ("friction of the model", np.where(signals.moving, terms.friction_n, np.nan), Look("orange", "-.")),
    )
    marks = [Line(signals.time_s[part], values[part], label, own, 0.9) for label, values, own in lines]
    panels, some = [Panel(marks, y="force / N")], thin(scene.time_s)
    each = zip(BALANCES, scene.residuals, scene.used, scene.scale, ("N", "(bar/s)", "(bar/s)"), strict=True)
    for name, residual, used, scale, unit in each:
        rest, time = np.where(used, residual, np.nan)[some], scene.time_s[some]
        size = 1e5 if "bar" in unit else 1.0
        band = Band(time, -2.0 * scale[some] / size, 2.0 * scale[some] / size)
        panels.append(Panel([band, Line(time, rest / size, width=0.8)], y=f"residual of\n{name} /\n{unit}"))
    return stack(panels, 5.2, (2, 1, 1, 1))


def _record(found: Validation, r: RecordResult) -> Section:
    topic, name = Topic("validation", "record"), r.recording.name
    number = [x is r for x in found.records].index(True) + 1
    failures = (*r.free.failures, *r.restarted.failures)[:MOST_FAILURES]
    part = topic.section(
        *topic.listed(topic.say("failure", failure=failure) for failure in failures),
        Picture(f"record-{number}", topic.say("channels", name=name, window_s=found.window_s), channel_figure(r)),
        Picture(f"residual-{number}", topic.say("residual", name=name), residual_figure(r, found.window_s)),
        name=name,
    )
    return replace(part, key=f"record-{number}")


def _name(column: str) -> str:
    return column.rpartition("_")[0].replace("_", " ")


def channel_figure(r: RecordResult) -> Figure:
    """Draw measured and modelled channels, each over its residual."""
    panels, part = [], thin(r.signals.time_s)
    t = r.signals.time_s[part]
    for column in r.channels:
        measured, free, again = getattr(r.signals, column)[part], r.free[column][part], r.restarted[column][part]
        unit = quantity(column)[1]
        lines = [Line(t, measured, "measured"), Line(t, free, "free run", MODEL)]
        panels.append(Panel(lines, y=f"{_name(column)} / {unit}"))
        rests = [Line(t, measured - again, "from measured states", RESIDUAL, 0.7), Line(t, measured - free, look=MODEL)]
        panels.append(Panel(rests, y=f"residual / {unit}"))
    return stack(panels, 7.2, (2, 1, 2, 1, 2, 1))


def residual_figure(r: RecordResult, window_s: float) -> Figure:
    """Draw the autocorrelation of the free run's residuals, and the residual of each run from a measured state."""
    above, below = [], []
    for column, channel in r.channels.items():
        values, bound = channel.whiteness.autocorrelation, channel.whiteness.bound
        lags = Bars(np.arange(1, values.size + 1), values, look=Look(), thickness=0.2)
        y = Axis("autocorrelation" if not above else "", low=-1.05, high=1.05)
        noise = Rule(y=(-bound, bound), look=Look("band"))
        above.append(Panel([noise, lags], _name(column), "lag / samples", y))
        middle = (np.arange(channel.window_rms.size) + 0.5) * window_s
        bars = Bars(middle, channel.window_rms, thickness=0.8 * window_s)
        below.append(Panel([bars], "", "start at / s", f"rms / {quantity(column)[1]}"))
    return Figure([*above, *below], columns=len(above), row_in=1.8, rest_in=0.0)


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
    recordings = ((r.recording, found.badge(r) or None) for r in found.records)
    rows = ((r.name, badge, str(r.source) if r.source else None, len(r), r.sha256[:16]) for r, badge in recordings)
    return topic.section(
        topic.text("synthetic" if found.synthetic else "measured"),
        topic.table(rows),
        topic.table(identified, "identified") if identified else None,
        Paragraph(found.drive.to_toml().strip(), "code"),
        synthetic=False,
    )


# --- friction --------------------------------------------------------------------------------------------------------


def write_friction_report(found: FrictionValidation, folder: str | Path) -> Path:
    """Write report.html with curves, bands and differences.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    lines = (sentence(line.strip(" +!")) for line in str(found).splitlines()[:2])
    law, table, model = (Topic("validation", key) for key in ("curves", "friction-conditions", "model"))
    rows = (_of_curve(c) for c in found.curves)
    parts = (
        law.section(law.text(), law.picture("friction", friction_figure(list(found.curves)[:MOST_SHOWN]))),
        table.section(table.table(rows)),
        model.section(Paragraph(found.drive.to_toml().strip(), "code")),
    )
    return Report(f"Friction of {found.drive.name} against {found.source.name}", lines, parts).write(folder)


def _of_curve(c: FrictionCurve) -> tuple[object, ...]:
    mean, largest = float(np.mean(c.model_n - c.friction_n)), float(c.metrics.largest)
    shares = (100 * c.metrics.nrmse, 100 * c.inside)
    return c.condition, DIRECTIONS[c.direction], c.speed_m_s.size, mean, largest, *shares


def friction_figure(curves: list[FrictionCurve]) -> Figure:
    """Draw one panel for each condition: measured points and the law's lines."""
    panels: dict[str, list[Markers | Line]] = {}
    for c in curves:
        marks = panels.setdefault(c.condition, [])
        own, label = look(len(marks) // 2), f"measured, {DIRECTIONS[c.direction]}; line: law"
        marks.append(Markers(c.speed_m_s, c.friction_n, label, own, c.low_n, c.high_n, filled=True))
        marks.append(Line(c.speed_m_s, c.model_n, look=own))
    x = Axis("speed / (mm/s)", "log")
    shown = [Panel(marks, name) for name, marks in panels.items()]
    return Figure(shown, x, "friction / N", columns=2, row_in=1.9, rest_in=0.6, legend="panel", text_scale=0.9)
