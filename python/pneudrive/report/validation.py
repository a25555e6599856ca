"""The report of a drive against recordings of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.base import Quantity
from pneudrive.describe.provenance import values
from pneudrive.report import style
from pneudrive.report import validation_figures as figures
from pneudrive.report.page import Items, Picture, Report, Section, Table, Text
from pneudrive.report.words import plural, sentence, spread_evenly
from pneudrive.validate.validation import CHANNELS

if TYPE_CHECKING:
    from pneudrive.describe import Drive
    from pneudrive.validate import RecordResult, Validation

MOST_RECORDS = 6
MARKS = {True: "Met.", False: "Missed.", None: ""}
SHOWN_ALONE = 12


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
    with style.applied():
        parts = [
            _verdicts(found),
            _why(found),
            *(_record(found, r) for r in _shown(found)),
            _stops(found),
            _conditions(found),
            _whiteness(found),
            _provenance(found),
        ]
        title = f"{found.drive.name} against {plural(len(found.records), 'recording')}"
        return Report(title, _lines(found), [p for p in parts if p is not None]).write(Path(folder))


def _shown(found: Validation) -> list[RecordResult]:
    return spread_evenly(found.records, MOST_RECORDS)


def _lines(found: Validation) -> list[str]:
    lines = [f"{sentence(v.text)} {MARKS[v.met]}".strip() for v in found.verdicts]
    lines += [sentence(line) for line in found.why()]
    return [*lines, *map(sentence, found.notes)]


def _verdicts(found: Validation) -> Section:
    head = (
        "recording",
        "channel",
        "free run: fit %",
        "NRMSE %",
        "rms",
        "largest",
        "from states: fit %",
        "NRMSE %",
        "off from s",
    )
    rows = []
    for r in found.records:
        for column, channel in r.channels.items():
            unit, factor = figures.UNITS[column]
            free, restarted = channel.free, channel.restarted
            off = "-" if channel.off_s is None else f"{channel.off_s:.2f}"
            numbers = (f"{free.fit_percent:.1f}", f"{100 * free.nrmse:.2g}")
            sizes = (f"{factor * free.rms:.3g} {unit}", f"{factor * free.largest:.3g} {unit}")
            again = (f"{restarted.fit_percent:.1f}", f"{100 * restarted.nrmse:.2g}")
            rows.append((r.recording.name, CHANNELS[column], *numbers, *sizes, *again, off))
    text = (
        "The free run starts from the first measured state and sees nothing but the recorded command. Position "
        "integrates whatever is wrong, so a small error grows: the runs from states are put back to the measured "
        f"state every {found.window_s:g} s. A free run is off where its error is beyond 10 % of the measured span. "
        "Fit is 100 (1 - |e|/|y - mean y|), NRMSE is rms(e)/(max y - min y)."
    )
    return Section("metrics", "Metrics", (Text(text), Table(head, tuple(rows), numbers_from=2)), found.synthetic)


def _why(found: Validation) -> Section:
    diagnosis = found.diagnosis()
    sizes = tuple((name, "-" if np.isnan(value) else f"{value:.2g}") for name, value in diagnosis.size.items())
    blocks: list = [
        Text(
            "Force balance and pressure rates are evaluated by the core at the measured states, in their weak form: no "
            "measured signal is differentiated. What is left is compared with what each possible cause would leave."
        ),
        Table(("balance", "residual over noise and 1 % of its terms"), sizes),
    ]
    if diagnosis.culprits:
        rows = tuple(
            (c.key, f"{100 * c.share:.0f}", c.text, ", ".join(name for name, _ in c.rivals) or "-")
            for c in diagnosis.culprits
        )
        blocks.append(Table(("cause", "explains %", "in words", "not told from"), rows, numbers_from=9))
        alone = tuple(
            (key, f"{amount:.3g}", f"{100 * share:.0f}") for key, amount, share in diagnosis.alone[:SHOWN_ALONE]
        )
        blocks.append(Table(("each cause by itself", "amount, SI", "explains %"), alone))
    else:
        blocks.append(Text(sentence(str(diagnosis)), "holds" if diagnosis.is_clean else "fails"))
    for i, r in enumerate(_shown(found)[:2]):
        caption = (
            f"{r.recording.name}: terms of the force balance, and what each balance lacks; the band is twice what "
            "noise, 1 % of the terms and velocities over a finite time leave."
        )
        where = next(k for k, own in enumerate(found.records) if own is r)
        drawn = figures.balance(found.drive, r.signals, diagnosis.residuals[where])
        blocks.append(Picture(f"balance-{i + 1}", caption, drawn, found.synthetic))
    return Section("why", "Why is the model off?", tuple(blocks), found.synthetic)


def _record(found: Validation, r: RecordResult) -> Section:
    name = r.recording.name
    number = [x is r for x in found.records].index(True) + 1
    blocks: list = [Items(tuple(f"the model: {failure}" for failure in (*r.free.failures, *r.restarted.failures)[:4]))]
    if not blocks[0].items:
        blocks = []
    caption = f"{name}: measured, free run, runs from measured states every {found.window_s:g} s, and what they leave."
    blocks.append(Picture(f"record-{number}", caption, figures.channels(r), found.synthetic))
    caption = (
        f"{name}: autocorrelation of the free run's residual, and root mean square of each run from a measured state."
    )
    blocks.append(Picture(f"residual-{number}", caption, figures.correlation(r, found.window_s), found.synthetic))
    return Section(f"record-{number}", f"Recording {name}", tuple(blocks), found.synthetic)


def _stops(found: Validation) -> Section | None:
    rows = [
        (
            r.recording.name,
            f"{b.start_s:.2f}",
            f"{b.onset_s - b.start_s:.2f}",
            f"{b.measured_n:.2f}",
            f"{b.model_n:.2f}",
            f"{100 * b.error:+.1f}",
        )
        for r in found.records
        for b in r.breakaways
    ]
    if not rows:
        return None
    head = ("recording", "stop at s", "rest s", "measured N", "model N", "error %")
    text = (
        "Peak of the force that friction carries before the piston runs, from pressures and acceleration; the model is "
        "started from the measured state in the stop. Bristles that bend count as rest where the speed is within its "
        "noise."
    )
    return Section("breakaway", "Breakaway after stops", (Text(text), Table(head, tuple(rows[:60]))), found.synthetic)


def _conditions(found: Validation) -> Section | None:
    if not found.conditions:
        return None
    rows = tuple(
        (
            c.label,
            c.value,
            str(c.recordings),
            f"{c.position_fit_percent:.1f}",
            f"{c.restarted_fit_percent:.1f}",
            f"{100 * c.pressure_nrmse:.2g}",
        )
        for c in found.conditions
    )
    head = ("label", "value", "recordings", "position fit %", "from states %", "pressure NRMSE %")
    return Section("conditions", "By condition", (Table(head, rows, numbers_from=2),), found.synthetic)


def _whiteness(found: Validation) -> Section:
    rows = []
    for r in found.records:
        for column, channel in r.channels.items():
            white = channel.whiteness
            strongest = ", ".join(f"{c.signal} {c.value:+.2f}" for c in channel.cross[:3])
            outside = f"{100 * white.outside:.0f}"
            rows.append((r.recording.name, CHANNELS[column], outside, f"{white.p:.2g}", strongest))
    head = ("recording", "channel", "lags outside 95 % %", "Ljung-Box p", "correlates most with")
    text = (
        "A residual that is nothing but sensor noise is white: 5 % of its autocorrelations lie outside 1.96/sqrt(N), "
        "and p is seldom small. With many samples every error of the model is seen; what it correlates with says where."
    )
    return Section(
        "whiteness", "Is the residual noise?", (Text(text), Table(head, tuple(rows), numbers_from=2)), found.synthetic
    )


def _identified(drive: Drive) -> tuple[Table, ...]:
    """List what was identified, with what noise and what a model that is not exact leave of it."""
    known, rows = values(drive), []
    for name, origin in drive.provenance.items():
        mark, si = known[name]
        shown = mark.show(si) if isinstance(mark, Quantity) else f"{si / 1e5:g} bar"
        low, high = origin.interval
        model = f"± {origin.model_error}" if origin.model_error else "-"
        rows.append((name, str(shown), f"{low} … {high}", model, origin.source))
    head = ("identified", "value", "95 % interval: noise", "each held number off by 1 %", "recordings")
    return (Table(head, tuple(rows), "Identified values of the drive", numbers_from=9),) if rows else ()


def _provenance(found: Validation) -> Section:
    rows = [
        (r.recording.name, str(r.recording.source or "-"), str(len(r.recording)), r.recording.sha256[:16])
        for r in found.records
    ]
    said = (
        "Synthetic: the recordings come from a simulation. Nothing here was measured on hardware."
        if found.synthetic
        else "The targets are assumed. The model is judged on these recordings only; its own data say less."
    )
    blocks = (
        Text(said),
        Table(("recording", "file", "samples", "SHA-256"), tuple(rows), numbers_from=2),
        *_identified(found.drive),
        Text(found.drive.to_toml().strip(), "code"),
    )
    return Section("provenance", "Provenance", blocks)
