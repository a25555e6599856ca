"""The page that compares two campaigns."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.figures import MEASURED, Figure, Look, Markers, Panel, Rule, banded, ends, look
from pneudrive.friction.friction_map import LEVELS, Condition
from pneudrive.numbers import with_interval
from pneudrive.report.campaign import findings_of, shown_figures
from pneudrive.report.page import Topic, chance, figure_of, plural, sections_of, sentence, spread_evenly, view_report
from pneudrive.views import MOST_LEADING, ShownValue, View, worst

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.friction.campaign.compare import Comparison, CurveComparison, Test
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.report.page import Blocks

MOST_PANELS = 4
MOST_ROWS = 60
CHANCE = 0.05
NAMES = ("first", "second")


def write_comparison_report(comparison: Comparison, folder: str | Path) -> Path:
    """Write report.html of a comparison, and its figures as PNG and SVG.

    Parameters
    ----------
    comparison : Comparison
    folder : path-like
        An existing folder.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    c, topic, view = comparison, Topic("comparison", "verdict"), comparison.view()
    synthetic = c.first.synthetic or c.second.synthetic
    unlike = [check.what for check in c.checks if not check.comparable]
    last = topic.say("unlike", what=", ".join(unlike)) if unlike else topic.say("alike")
    title, notes = f"{c.first.name} against {c.second.name}", (topic.say("questions"), *view.notes)
    parts = sections_of("comparison", {"comparable": _comparable, **FIGURED}, c)
    report = view_report(replace(view, title=title, notes=notes, figures=()), *parts, synthetic=synthetic)
    report.verdict = [f"{view.title}{topic.say('synthetic') if synthetic else ''}", *report.verdict, last]
    return report.write(folder)


def comparison_view(c: Comparison) -> View:
    """Return the view of a comparison: a row for each test, and the figures of both campaigns."""
    times = Counter(test.what for test in c.tests)
    rows = [(_values(test, repeated=times[test.what] > 1), test) for test in c.tests]
    values = tuple(value for of_test, _ in rows for value in of_test)
    sizes = [of_test[0] for of_test, test in rows if test.different and test.difference is not None]
    findings = findings_of(c.statements)
    return View(
        title=f"{c.second.name} less {c.first.name}: {c}",
        rows=values,
        state=worst(findings),
        leading=tuple(replace(v, quantity=f"{v.label}:") for v in sizes[:MOST_LEADING]),
        findings=findings,
        notes=[sentence(f"{test.what}: {test.note}") for test in c.tests],
        figures=shown_figures(sections_of("comparison", FIGURED, c)),
    )


def _values(test: Test, *, repeated: bool) -> list[ShownValue]:
    """Return the difference of a test with its interval, its probabilities, and whether it is significant.

    If several series of stops have the same test, the note of the series is added to its name.
    """
    name, e = f"{test.what}, {test.note}" if repeated else test.what, test.difference
    differs = "yes" if test.different else "not shown"
    texts = {"p": chance(test.p), "p corrected": chance(test.adjusted_p), "different": differs}
    size = [] if e is None else [ShownValue(name, name, "second minus first", e.value, e.unit, (e.low, e.high))]
    return [*size, *(ShownValue(f"{name}, {quantity}", name, quantity, text) for quantity, text in texts.items())]


def _comparable(topic: Topic, c: Comparison) -> Blocks:
    rows = ((k.what, k.first, k.second, k.comparable, "" if k.comparable else k.consequence) for k in c.checks)
    yield topic.text(first=_labels(c.first), second=_labels(c.second))
    yield topic.table(rows, first=c.first.name, second=c.second.name)


def _labels(found: CampaignCharacteristics) -> str:
    labels = dict(found.identity.labels)
    for row in found.cycles.head(1).select(LEVELS).iter_rows(named=True):
        labels |= {name: level for name, level in row.items() if level}
    return ", ".join(f"{k} {v}" for k, v in labels.items()) or "none"


def _curves(topic: Topic, c: Comparison) -> Blocks:
    curves = c.curves
    if curves is None:
        return
    first, second = (int(curves.cycles.filter(campaign=k)["count"].sum()) for k in (0, 1))
    rows = curves.points.head(MOST_ROWS).to_dicts()
    for i, row in enumerate(rows):
        row["pressures"] = Condition(row["gauge_a_pa"], row["gauge_b_pa"], row["title"]).label(0.0)
        row["difference"] = with_interval(curves.difference[i], _mean(curves, i), "N")
    points = plural(curves.points.height, "point")
    yield topic.text(points=points, first=plural(first, "cycle"), second=second)
    yield topic.figure("compare-curves", curve_figure(c, curves), first=c.first.name, second=c.second.name)
    yield topic.table(rows)


def _mean(curves: CurveComparison, point: int) -> float:
    return float(curves.friction_n[:, point].mean())


def curve_figure(c: Comparison, curves: CurveComparison) -> Figure:
    """Draw curves of both campaigns above their differences, a column for each pair of pressures."""
    gauges, speed = curves.points.select("gauge_a_pa", "gauge_b_pa").to_numpy(), curves.points["speed_m_s"]
    groups: dict[tuple, list[int]] = {}
    for i, at in enumerate(zip(*gauges.round(-2).T, curves.points["title"], strict=True)):
        groups.setdefault(at, []).append(i)
    above, below = [], []
    for at, members in spread_evenly(groups.items(), MOST_PANELS):
        chosen = sorted(members, key=lambda i: speed[i])
        above.append(Panel(_both(c, curves, chosen), Condition(*at).label(0.0), y="friction / N"))
        below.append(Panel(_differences(curves, chosen), y="second minus first / N"))
    return figure_of("both-curves", [*above, *below], columns=len(above))


def _both(c: Comparison, curves: CurveComparison, chosen: list[int]) -> list[Any]:
    gauge, marks = curves.points.row(chosen[0], named=True), []
    gauge, speed = (gauge["gauge_a_pa"], gauge["gauge_b_pa"]), curves.points["speed_m_s"].to_numpy()
    for k, found in enumerate((c.first, c.second)):
        own, ambient = look(k), found.identity.ambient_pressure_pa
        for curve in found.curves:
            pair = (curve.condition.pressure_a_pa - ambient, curve.condition.pressure_b_pa - ambient)
            if curve.direction == 0 and np.allclose(pair, gauge, atol=2000.0):
                marks += banded(curve.speed_m_s, curve.friction_n, curve.low_n, curve.high_n, look=own, width=1.0)
                break
        label = found.name if c.first.name != c.second.name else f"{found.name} ({NAMES[k]})"
        marks.append(Markers(speed[chosen], curves.friction_n[k, chosen], label, own, size=3.6))
    return marks


def _differences(curves: CurveComparison, chosen: list[int]) -> list[Any]:
    """Draw differences with their intervals. Markers of significant differences are filled."""
    marks: list[Any] = [Rule(y=0.0, look=MEASURED)]
    for i in chosen:
        differs = curves.points["corrected_p"][i] < CHANCE
        own = Look("orange" if differs else "grey", "-", "D")
        value, low, high = ends([curves.difference[i]], _mean(curves, i))
        marks.append(Markers([curves.points["speed_m_s"][i]], value, "", own, low, high, filled=differs))
    return marks


def _dwell(topic: Topic, c: Comparison) -> Blocks:
    names = c.first.name, c.second.name
    rows = (
        (s.name, name, len(s.stops), s.reference_s, s.increment, s.slope, s.laws[0].form.title if s.laws else None)
        for pair in c.dwell
        for name, s in zip(names, pair, strict=True)
    )
    panels = [
        Panel([m for k, s in enumerate(pair) for m in _series(s, k, f"{names[k]} ({NAMES[k]})")], pair[0].name)
        for pair in list(c.dwell)[:MOST_PANELS]
    ]
    if panels:
        yield topic.figure("compare-dwell", figure_of("both-dwell", panels), first=names[0], second=names[1])
        yield topic.table(rows)


#: Parts with figures by the key of their section.
FIGURED = {"curves": _curves, "dwell": _dwell}


def _series(series: DwellSeries, k: int, label: str) -> list[Any]:
    """Draw a campaign's curve of breakaway over duration: the mean of its conditions."""
    assert series.curve is not None
    conditions, log_s = len(series.conditions), np.log10(series.duration_s)
    rows = np.kron(np.full((1, conditions), 1.0 / conditions), np.eye(log_s.size))
    mean, low, high = ends(series.curve.values(log_s).combine(rows.astype(float)).estimates())
    durations = series.stops["dwell_s"].to_numpy() * (1.0 + 0.05 * k)
    points = Markers(durations, series.stops["increment_n"].to_numpy(), look=look(k), size=3.0)
    return [*banded(series.duration_s, mean, low, high, label, look(k)), points]
