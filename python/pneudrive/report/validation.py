"""Views and reports of validations: a drive against recordings, and a friction law against measured friction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import polars as pl

from pneudrive import figures as drawing
from pneudrive.arrays import Keyed
from pneudrive.figures import MODEL, Figure, Line, Markers, Panel, look, stack, thin
from pneudrive.identify.follow.fit import fitted_pressures
from pneudrive.identify.identified import comparison_figure
from pneudrive.report import page
from pneudrive.report.page import MOST_SHOWN, Paragraph, Topic, figure_of, plural, quantity, spread_evenly, view_report
from pneudrive.validate import motion
from pneudrive.validate.motion import STATIC_FIT_PERCENT, FrictionValidation, MotionValidation
from pneudrive.validate.validation import CHANNELS, Validation
from pneudrive.views import Finding, ShownFigure, ShownTable, ShownValue, State, View, worst

MOST_RECORDS, MOST_STOPS = 6, 60
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
        Function of the index of a record. It returns the columns of its run, or None if the file is missing.
    """
    records, diagnosis = content["record"], content["diagnosis"]
    leading, causes = [], diagnosis.get("culprit", [])
    for verdict in content["verdict"]:
        (words, factor), met = Topic("validation", "verdicts").texts[verdict["what"]], verdict.get("met")
        if met is None:
            leading.append(ShownValue(verdict["what"], "", "", verdict["text"], state="open"))
        else:
            value, limit = (factor * verdict[key] for key in ("value", "target"))
            leading.append(ShownValue(verdict["what"], "", words, value, "%", limit=limit, state=MET[met]))
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
    answer = f"misses {missed} of {len(tested)} targets" if missed else "meets its tested targets"
    answer = answer if tested else "is not tested"
    return View(
        f"{content['provenance']['drive']} {answer} on {plural(len(records), 'recording')}",
        [row for record in records for row in _rows(record)],
        notes=content["notes"],
        state="bad" if any(value.state == "bad" for value in leading) else state,
        leading=leading,
        findings=findings,
        tables=[table for table in _tables(content) if table.rows],
        figures=figures,
    )


def _rows(record: Keyed) -> Iterator[ShownValue]:
    """Yield the agreement of each channel of a record."""
    badge = f" ({record['badge']})" if record.get("badge") else ""
    for column, title in CHANNELS.items():
        found, label, key = record[column], f"{record['name']}{badge}: {title}", f"{record['name']}: {title}"
        for name, (words, run, measure, percent) in Topic("validation", "agreement").texts.items():
            value = (percent or 1.0) * float(found[run].get(measure, math.nan))
            unit = "" if percent else "m" if column.endswith("_m") else "Pa"
            yield ShownValue(f"{key}.{name}", label, words, value, unit)
        if found.get("off_s") is not None:
            yield ShownValue(f"{key}.off", label, "deviates from time, s", float(found["off_s"]))


def _tables(content: Keyed) -> Iterator[ShownTable]:
    """Yield the tables of causes, sizes of residuals, breakaway after stops, and conditions."""
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
        rest = Line(t, measured - again, "from measured states", drawing.RESIDUAL, 0.7)
        panels.append(Panel([rest, Line(t, measured - free, look=MODEL)], y=f"residual / {unit}"))
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
    about = (Topic("validation", key) for key in ("metrics", "why", "breakaway"))
    words = (topic.text(window_s=found.window_s) for topic in about)
    parts = page.sections_of("validation", {"whiteness": _noise}, found)
    topic, rows = Topic("validation", "provenance"), []
    for record in found.records:
        r, badge = record.recording, found.badge(record) or None
        rows.append((r.name, badge, str(r.source) if r.source else None, len(r), r.sha256[:16]))
    origin = topic.text("synthetic" if found.synthetic else "measured")
    drive = Paragraph(found.drive.to_toml().strip(), "code")
    provenance = topic.section(origin, topic.table(rows), drive, synthetic=False)
    parts += [Topic("validation", "about").section(*words), provenance]
    return view_report(found.view(), *parts, synthetic=found.synthetic).write(folder)


def _noise(topic: Topic, found: Validation) -> page.Blocks:
    rows = []
    for record in found.records:
        for column, channel in record.channels.items():
            white, strongest = channel.whiteness, list(channel.correlated_with.items())[:3]
            words = ", ".join(f"{signal} {value:+.2f}" for signal, value in strongest)
            rows.append((record.recording.name, CHANNELS[column], white["outside"], white["p"], words))
    yield topic.text()
    yield topic.table(rows)


# --- friction --------------------------------------------------------------------------------------------------------


def friction_view(found: FrictionValidation) -> View:
    """Return the view of a friction law against measured friction: agreement in total and for each condition."""
    m, curves = found.metrics, found.curves
    leading = (
        ShownValue("fit", "", "fit", m.fit_percent, "%", limit=STATIC_FIT_PERCENT, state=MET[found.met]),
        ShownValue("NRMSE", "", "NRMSE", 100 * m.nrmse, "%"),
        ShownValue("largest", "", "largest difference", m.largest, "N"),
        ShownValue("inside", "", "the law is within the band of", 100 * found.inside, "% of the points"),
    )
    law, rows = Topic("validation", "curves"), []
    for points in curves:
        whole, mean = motion.agreement(points), (points["model_n"] - points["friction_n"]).mean()
        about = (points[0, 0], DIRECTIONS[points[0, 1]], points.height)
        rows.append((*about, mean, whole.largest, whole.nrmse, motion.fraction_inside(points)))
    return View(
        f"friction of {found.drive.name} against {found.source.name}",
        state=MET[found.met],
        leading=leading,
        tables=(Topic("validation", "friction-conditions").table(rows),),
        figures=(ShownFigure("friction", law.texts["pictures"]["friction"], friction_figure(curves)),),
        notes=(law.say(),),
    )


def friction_figure(curves: list[pl.DataFrame]) -> Figure:
    """Draw measured points and the lines of the law, a panel for each condition, for at most `MOST_SHOWN` curves."""
    panels: dict[str, list[Markers | Line]] = {}
    for points in curves[:MOST_SHOWN]:
        speed, friction, low, high, model = points[:, 2:].to_numpy().T
        marks = panels.setdefault(points[0, 0], [])
        own, label = look(len(marks) // 2), f"measured, {DIRECTIONS[points[0, 1]]}; line: law"
        marks.append(Markers(speed, friction, label, own, low, high, filled=True))
        marks.append(Line(speed, model, look=own))
    return figure_of("law", [Panel(marks, name) for name, marks in panels.items()])


# --- a circuit along recorded motions ---------------------------------------------------------------------------------


def motion_view(found: MotionValidation) -> View:
    """Return the view of a circuit along recorded motions: verdicts, force balances, and pressures."""
    findings = [Finding(text, "good" if met else "bad") for met, text in found.verdicts]
    findings += [Finding(doubt, "open") for doubt in found.doubts]
    notes = [f"{record.name}: {record}" for record in found.records]
    notes += [f"{name}: its chambers are open, so its pressures test neither volumes nor heat" for name in found.open]
    topic, figures = Topic("motion", "forces"), []
    if found.solution is not None:
        figure = comparison_figure(fitted_pressures(found.solution))
        figures.append(ShownFigure("pressures", topic.say("pressures"), figure))
    panels, rows = [], []
    for c in found.closures:
        residual = Markers(c.time_s, c.residual_n / c.range_n, look=drawing.RESIDUAL, size=1.0)
        panels.append(Panel([residual], c.name))
        gains = "; ".join(f"{name} {g.value:.3f} [{g.low:.3f}, {g.high:.3f}]" for name, g in c.gains.items())
        viscous = f"{c.viscous.value:.0f} [{c.viscous.low:.0f}, {c.viscous.high:.0f}]"
        rows.append((c.name, c.rms_n, c.share, c.offset_n, gains or None, viscous, c.correlation))
    if found.closures:
        figures.append(ShownFigure("closure", topic.say("residual"), figure_of("closure", panels)))
        notes += [*map(str, found.closures), topic.say()]
    return View(
        f"{found.circuit.name} along recorded motions",
        notes=notes,
        state=worst(findings),
        findings=findings,
        tables=(topic.table(rows),) if found.closures else (),
        figures=figures,
    )
