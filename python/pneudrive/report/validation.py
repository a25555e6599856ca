"""Views and reports of validations: a drive against recordings, and a friction law against measured friction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import figures as drawing
from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import Quantity
from pneudrive.figures import MODEL, Axis, Band, Bars, Figure, Line, Look, Markers, Panel, Rule, look, stack, thin
from pneudrive.report import page
from pneudrive.report.page import MOST_SHOWN, Paragraph, Topic, figure_of, plural, quantity, spread_evenly, view_report
from pneudrive.validate.balance import BALANCES, Scene, Signals, moving_mass
from pneudrive.validate.motion import STATIC_FIT_PERCENT, FrictionCurve, FrictionValidation
from pneudrive.validate.validation import CHANNELS, RecordResult, Validation
from pneudrive.views import Finding, ShownFigure, ShownTable, ShownValue, State, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from pneudrive.arrays import Keyed
    from pneudrive.describe.drive import Drive
    from pneudrive.report.page import Blocks, Section

MOST_RECORDS, MOST_STOPS = 6, 60
SHOWN_ALONE = 12
DIRECTIONS = {0: "both", 1: "+x", -1: "-x"}
#: State of a target: missed, met, or not tested.
MET: dict[bool | None, State] = {False: "bad", True: "good", None: "open"}


def validation_view(content: Keyed, run: Callable[[int], Keyed | None]) -> View:
    """Return the view of a validation of a drive, live or stored.

    Parameters
    ----------
    content : mapping
        Tables of validation.toml.
    run : callable
        Function from the index of a record to the columns of its run, or None if the file is missing.
    """
    records, diagnosis = content["record"], content["diagnosis"]
    leading, causes = tuple(map(_leading, content["verdict"])), diagnosis.get("culprit", [])
    why = diagnosis.get("why", [cause["text"] for cause in causes])
    state: State = "good" if diagnosis["clean"] and not causes else "open"
    findings = [Finding(text, state, f"Remedy: {remedy}" if remedy else "") for text, _, remedy in
                (sentence.partition(" Remedy: ") for sentence in why)]  # fmt: skip
    topic, figures = Topic("validation", "record"), []
    for number, record in spread_evenly(enumerate(records), MOST_RECORDS):
        if (columns := run(number)) is not None:
            caption = topic.say("channels", name=record["name"], window_s=content["window_s"])
            figures.append(ShownFigure(f"record-{number + 1}", caption, channel_figure(columns)))
    tested = [value.state for value in leading if value.limit is not None]
    missed = tested.count("bad")
    verdict = f"misses {missed} of {len(tested)} targets" if missed else "meets its tested targets"
    words = verdict if tested else "is not tested"
    return View(
        f"{content['provenance']['drive']} {words} on {plural(len(records), 'recording')}",
        [row for record in records for row in _rows(record)],
        notes=content["notes"],
        state="bad" if any(value.state == "bad" for value in leading) else state,
        leading=leading,
        findings=findings,
        tables=[table for table in _tables(content) if table.rows],
        figures=figures,
    )


def _leading(verdict: Keyed) -> ShownValue:
    (words, factor), met = Topic("validation", "verdicts").texts[verdict["what"]], verdict.get("met")
    if met is None:
        return ShownValue(verdict["what"], "", "", verdict["text"], state="open")
    value, limit = (factor * verdict[key] for key in ("value", "target"))
    return ShownValue(verdict["what"], "", words, value, "%", limit=limit, state=MET[met])


def _rows(record: Keyed) -> Iterator[ShownValue]:
    """Yield the agreement of each channel of a record."""
    badge = f" ({record['badge']})" if record.get("badge") else ""
    for column, title in CHANNELS.items():
        found, label, key = record[column], f"{record['name']}{badge}: {title}", f"{record['name']}: {title}"
        for name, (words, run, measure, percent) in Topic("validation", "agreement").texts.items():
            value = percent * float(found[run].get(measure, math.nan)) if percent else float(found[run][measure])
            unit = "" if percent else "m" if column.endswith("_m") else "Pa"
            yield ShownValue(f"{key}.{name}", label, words, value, unit)
        if found.get("off_s") is not None:
            yield ShownValue(f"{key}.off", label, "off from s", float(found["off_s"]))


def _tables(content: Keyed) -> Iterator[ShownTable]:
    """Yield causes, sizes of residuals, stops and conditions."""
    diagnosis, records = content["diagnosis"], content["record"]
    why = Topic("validation", "why")
    yield why.table(
        ((c["what"], c["share"], c["amount"], *c["interval"], c["unit"], ", ".join(c["rivals"]) or None)
         for c in diagnosis.get("culprit", ())), "causes",
    )  # fmt: skip
    yield why.table(((k.replace("_", " "), v) for k, v in diagnosis["residual_over_noise"].items()), "sizes")
    stops = [
        (r["name"], b["start_s"], b["onset_s"] - b["start_s"], b["measured_n"], b["model_n"], 100 * b["error"])
        for r in records
        for b in r.get("breakaway", ())
    ]
    yield Topic("validation", "breakaway").table(stops[:MOST_STOPS])
    yield Topic("validation", "conditions").table(content.get("condition", ()))


def channel_figure(columns: Keyed) -> Figure:
    """Draw measured and modelled channels, each with its residual below."""
    panels, part = [], thin(columns["time_s"])
    t = columns["time_s"][part]
    for column in CHANNELS:
        measured, free, again = (columns[name][part] for name in (column, f"free.{column}", f"restarted.{column}"))
        unit = quantity(column)[1]
        lines = [Line(t, measured, "measured"), Line(t, free, "free run", MODEL)]
        panels.append(Panel(lines, y=f"{CHANNELS[column]} / {unit}"))
        rests = [
            Line(t, measured - again, "from measured states", drawing.RESIDUAL, 0.7),
            Line(t, measured - free, look=MODEL),
        ]
        panels.append(Panel(rests, y=f"residual / {unit}"))
    return stack(panels, 7.2, (2, 1, 2, 1, 2, 1))


def write_validation_report(found: Validation, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : Validation
    folder : path-like
        An existing folder.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    about = (Topic("validation", key) for key in ("metrics", "breakaway"))
    words = (topic.text(window_s=found.window_s) for topic in about)
    parts = page.sections_of("validation", {"why": _why, "whiteness": _noise}, found)
    parts += [Topic("validation", "about").section(*words), _provenance(found)]
    return view_report(found.view(), *parts, synthetic=found.synthetic).write(folder)


def _why(topic: Topic, found: Validation) -> Blocks:
    diagnosis = found.diagnosis()
    yield topic.text()
    if diagnosis.alone:
        yield topic.table(diagnosis.alone[:SHOWN_ALONE], "alone")
    for number, r in spread_evenly(enumerate(found.records), MOST_RECORDS)[:2]:
        figure = balance_figure(found.drive, r.signals, diagnosis.scenes[number])
        yield ShownFigure(f"balance-{number + 1}", topic.say("caption", name=r.recording.name), figure)


def _noise(topic: Topic, found: Validation) -> Blocks:
    rows = []
    for record in found.records:
        for column, channel in record.channels.items():
            white = channel.whiteness
            strongest = ", ".join(f"{signal} {value:+.2f}" for signal, value in list(channel.cross.items())[:3])
            rows.append((record.recording.name, CHANNELS[column], white.outside, white.p, strongest))
    yield topic.text()
    yield topic.table(rows)
    for n, r in spread_evenly(enumerate(found.records, 1), MOST_RECORDS):
        caption = topic.say("residual", name=r.recording.name)
        yield ShownFigure(f"residual-{n}", caption, residual_figure(r, found.window_s))


def balance_figure(drive: Drive, signals: Signals, scene: Scene) -> Figure:
    """Draw terms of the force balance, and residuals of all three balances."""
    part, terms = thin(signals.time_s), scene.terms
    lines = (
        ("forces but friction", terms["force_n"], Look()),
        ("m a", moving_mass(drive) * signals.acceleration_m_s2, Look("blue", "--")),
        ("friction of the model", np.where(signals.moving, terms["friction_n"], np.nan), Look("orange", "-.")),
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


def residual_figure(r: RecordResult, window_s: float) -> Figure:
    """Draw the autocorrelation of the free run's residuals, and the residual of each run from a measured state."""
    above, below = [], []
    for column, channel in r.channels.items():
        values, bound = channel.whiteness.autocorrelation, channel.whiteness.bound
        lags = Bars(np.arange(1, values.size + 1), values, look=Look(), thickness=0.2)
        y = Axis("autocorrelation" if not above else "", low=-1.05, high=1.05)
        noise = Rule(y=(-bound, bound), look=Look("band"))
        above.append(Panel([noise, lags], CHANNELS[column], "lag / samples", y))
        middle = (np.arange(channel.window_rms.size) + 0.5) * window_s
        bars = Bars(middle, channel.window_rms, thickness=0.8 * window_s)
        below.append(Panel([bars], "", "start at / s", f"rms / {quantity(column)[1]}"))
    return Figure([*above, *below], columns=len(above), row_in=1.8, rest_in=0.0)


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
    rows = (
        (r.name, badge, str(r.source) if r.source else None, len(r), r.sha256[:16])
        for r, badge in recordings
    )  # fmt: skip
    return topic.section(
        topic.text("synthetic" if found.synthetic else "measured"),
        topic.table(rows),
        topic.table(identified, "identified") if identified else None,
        Paragraph(found.drive.to_toml().strip(), "code"),
        synthetic=False,
    )


# --- friction --------------------------------------------------------------------------------------------------------


def friction_view(found: FrictionValidation) -> View:
    """Return the view of a friction law compared with measured friction: agreement in total, and for each condition."""
    m, curves = found.metrics, list(found.curves)[:MOST_SHOWN]
    leading = (
        ShownValue("fit", "", "fit", m.fit_percent, "%", limit=STATIC_FIT_PERCENT, state=MET[found.met]),
        ShownValue("NRMSE", "", "NRMSE", 100 * m.nrmse, "%"),
        ShownValue("largest", "", "largest difference", m.largest, "N"),
        ShownValue("inside", "", "the law is within the band of", 100 * found.inside, "% of the points"),
    )
    law = Topic("validation", "curves")
    return View(
        f"friction of {found.drive.name} against {found.source.name}",
        state=MET[found.met],
        leading=leading,
        tables=(Topic("validation", "friction-conditions").table(map(_of_curve, found.curves)),),
        figures=(ShownFigure("friction", law.texts["pictures"]["friction"], friction_figure(curves)),),
        notes=(law.say(),),
    )


def write_friction_report(found: FrictionValidation, folder: str | Path) -> Path:
    """Write report.html with curves, bands and differences.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    drive = Topic("validation", "model").section(Paragraph(found.drive.to_toml().strip(), "code"))
    return view_report(found.view(), drive).write(folder)


def _of_curve(c: FrictionCurve) -> tuple[object, ...]:
    mean = np.mean(c.model_n - c.friction_n)
    return c.condition, DIRECTIONS[c.direction], c.speed_m_s.size, mean, c.metrics.largest, c.metrics.nrmse, c.inside


def friction_figure(curves: list[FrictionCurve]) -> Figure:
    """Draw one panel for each condition: measured points and the law's lines."""
    panels: dict[str, list[Markers | Line]] = {}
    for c in curves:
        marks = panels.setdefault(c.condition, [])
        own, label = look(len(marks) // 2), f"measured, {DIRECTIONS[c.direction]}; line: law"
        marks.append(Markers(c.speed_m_s, c.friction_n, label, own, c.low_n, c.high_n, filled=True))
        marks.append(Line(c.speed_m_s, c.model_n, look=own))
    return figure_of("law", [Panel(marks, name) for name, marks in panels.items()])
