"""The page of two campaigns against each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.basics import PA_PER_BAR
from pneudrive.report import style
from pneudrive.report.campaign_curves import MM, estimate, speed_axis
from pneudrive.report.page import Items, Picture, Report, Section, Table, Text
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characteristics.compare.comparison import Comparison, Test
    from pneudrive.characteristics.compare.curves import CurveComparison
    from pneudrive.characteristics.stops.dwell_law import DwellSeries

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
        Must be there.

    Returns
    -------
    pathlib.Path
        Of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    with style.applied():
        title = f"{comparison.first.name} against {comparison.second.name}"
        return Report(title, list(_verdict(comparison)), _sections(comparison)).write(Path(folder))


def synthetic(comparison: Comparison) -> bool:
    """Whether any of the two rests on a simulated rig."""
    return comparison.first.synthetic or comparison.second.synthetic


def _verdict(c: Comparison) -> Iterator[str]:
    yield f"{c}{' Synthetic: simulated rigs are among them.' if synthetic(c) else ''}"
    for test in c.tests:
        if test.different and test.difference is not None:
            beyond = {True: ", more than two cycles of either campaign do", False: "", None: ""}
            yield f"{_first_upper(test.what)}: {_size(test)}{beyond[test.beyond_repeatability]} ({test.note})."
    unlike = [check.what for check in c.checks if not check.comparable]
    if unlike:
        yield f"Rigs or protocols differ in {', '.join(unlike)}: read what follows with that in mind."
    else:
        yield "Rigs and protocols agree as far as they are told."


def _first_upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def _size(test: Test) -> str:
    return estimate(test.difference) if test.difference is not None else "–"


def _sections(c: Comparison) -> list[Section]:
    parts = [_questions(c), _comparable(c)]
    if c.curves is not None:
        parts.append(_curves(c, c.curves))
    if c.dwell:
        parts.append(_dwell(c))
    return parts


def _questions(c: Comparison) -> Section:
    rows = tuple(
        (
            t.what,
            t.note,
            _size(t),
            _p(t.p),
            _p(t.adjusted_p),
            "yes" if t.different else "not shown",
            {True: "yes", False: "no", None: "–"}[t.beyond_repeatability],
        )
        for t in c.tests
    )
    head = ("question", "what", "second less first (95 %)", "p", "p, corrected", "different", "beyond repeatability")
    text = (
        "Each question is one test; the corrected p keeps the chance that equal campaigns are called different at 5 % "
        "for all of them together (Holm). Beyond repeatability: the difference is larger than two cycles of either "
        "campaign differ by, 19 times of 20."
    )
    blocks: list = [Text(text), Table(head, rows, numbers_from=3)]
    if c.statements:
        blocks += [Text("To be kept in mind:", "note"), Items(tuple(str(s) for s in c.statements))]
    return Section("questions", "What differs", tuple(blocks), synthetic=synthetic(c))


def _p(p: float) -> str:
    return "–" if not np.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def _comparable(c: Comparison) -> Section:
    rows = tuple(
        (k.what, k.first, k.second, "yes" if k.comparable else "no", "" if k.comparable else k.consequence)
        for k in c.checks
    )
    head = ("", c.first.name, c.second.name, "agree", "otherwise")
    labels = []
    for found in (c.first, c.second):
        own = {**found.identity.labels, **{k: v for cycle in found.cycles[:1] for k, v in _levels(cycle.condition)}}
        labels.append(", ".join(f"{k} {v}" for k, v in own.items()) or "none")
    blocks = (
        Text(f"Labels: {labels[0]}; {labels[1]}."),
        Table(head, rows, "Rig and protocol of both campaigns", numbers_from=9),
    )
    return Section("comparable", "Can they be compared", blocks, synthetic=synthetic(c))


def _levels(condition: object) -> list[tuple[str, str]]:
    return [(name, level) for name in ("mounting", "seal", "drive") if (level := getattr(condition, name))]


# --- curves --------------------------------------------------------------------------------------------------------


def _curves(c: Comparison, curves: CurveComparison) -> Section:
    points = curves.points
    rows = []
    for i in list(range(points.speed_m_s.size))[:MOST_ROWS]:
        d = curves.difference[i]
        mean = float(curves.friction_n[:, i].mean())
        rows.append(
            (
                _gauge(points.gauge_pa[i], points.levels[i]),
                f"{MM * points.speed_m_s[i]:.4g}",
                f"{curves.friction_n[0, i]:.3f}",
                f"{curves.friction_n[1, i]:.3f}",
                estimate(d, mean, "N"),
                _p(float(curves.adjusted_p[i])),
            )
        )
    head = ("pressures", "speed, mm/s", "first, N", "second, N", "second less first (95 %)", "p, corrected")
    blocks: list = [
        Text(
            f"{plural(points.speed_m_s.size, 'point')} of speed and pressure are common; "
            f"{plural(int(points.count[points.campaign == 0].sum()), 'cycle')} of the first and "
            f"{int(points.count[points.campaign == 1].sum())} of the second campaign lie on them."
        ),
        Picture(
            "compare-curves",
            f"Above: friction over speed of {c.first.name} (solid) and {c.second.name} (dashed), 95 % bands. Below: "
            "second less first at common points; filled where it is beyond chance after correction for their number.",
            draw_curves(c, curves),
            synthetic=synthetic(c),
        ),
        Table(head, tuple(rows), "Differences at common points"),
    ]
    return Section("curves", "Friction over speed", tuple(blocks), synthetic=synthetic(c))


def _gauge(pair: np.ndarray, levels: str) -> str:
    a, b = (round(float(v) / PA_PER_BAR, 3) + 0.0 for v in pair)
    text = f"{a:.3g} bar in both" if a == b else f"a {a:.3g} bar, b {b:.3g} bar"
    return f"{text}, {levels}" if levels else text


def draw_curves(c: Comparison, curves: CurveComparison) -> Figure:
    """Curves of both campaigns above their differences, a column for each pair of pressures."""
    points = curves.points
    groups = list(dict.fromkeys(zip(map(tuple, points.gauge_pa.round(-2)), points.levels, strict=True)))
    shown = spread_evenly(groups, MOST_PANELS)
    figure = style.new_figure(4.4)
    axes = figure.subplots(2, len(shown), squeeze=False, sharex="col", sharey="row", height_ratios=[3, 2])
    for column, (gauge, levels) in zip(axes.T, shown, strict=True):
        chosen = [
            i
            for i in range(points.speed_m_s.size)
            if tuple(points.gauge_pa[i].round(-2)) == gauge and points.levels[i] == levels
        ]
        chosen.sort(key=lambda i: points.speed_m_s[i])
        _both(column[0], c, curves, chosen)
        _less(column[1], curves, chosen)
        column[0].set_title(_gauge(np.array(gauge), levels))
    axes[0][0].set_ylabel("friction / N")
    axes[1][0].set_ylabel("second less first / N")
    style.legend_above(figure, axes[0][0].get_legend_handles_labels()[0])
    _stamp(figure, c)
    return figure


def _stamp(figure: Figure, c: Comparison) -> None:
    if synthetic(c):
        figure.text(0.998, 0.004, "synthetic", ha="right", va="bottom", fontsize=6.5, color="#8a4b00")


def _both(axis: Axes, c: Comparison, curves: CurveComparison, chosen: list[int]) -> None:
    speed = MM * curves.points.speed_m_s[chosen]
    for k, (found, look) in enumerate(zip((c.first, c.second), (style.look(0), style.look(1)), strict=True)):
        ambient = found.identity.ambient_pressure_pa
        wanted = curves.points.gauge_pa[chosen[0]]
        for curve in found.curves:
            pair = (curve.condition.pressure_a_pa - ambient, curve.condition.pressure_b_pa - ambient)
            if curve.direction == 0 and np.allclose(pair, wanted, atol=2000.0):
                axis.fill_between(MM * curve.speed_m_s, curve.low_n, curve.high_n, color=look.color, alpha=0.12, lw=0)
                axis.plot(MM * curve.speed_m_s, curve.friction_n, ls=look.linestyle, color=look.color, lw=1.0)
                break
        axis.plot(
            speed,
            curves.friction_n[k, chosen],
            look.marker,
            ls=look.linestyle,
            lw=0,
            color=look.color,
            mfc="white",
            ms=3.6,
            label=found.name if c.first.name != c.second.name else f"{found.name} ({NAMES[k]})",
        )


def _less(axis: Axes, curves: CurveComparison, chosen: list[int]) -> None:
    for i in chosen:
        d, mean = curves.difference[i], float(curves.friction_n[:, i].mean())
        beyond = curves.adjusted_p[i] < CHANCE
        axis.errorbar(
            MM * curves.points.speed_m_s[i],
            mean * d.value,
            yerr=[[mean * (d.value - d.low)], [mean * (d.high - d.value)]],
            fmt="D",
            color=style.ORANGE if beyond else style.GREY,
            mfc=style.ORANGE if beyond else "white",
            ms=4,
            elinewidth=0.8,
        )
    axis.axhline(0.0, color=style.BLACK, lw=0.7)
    speed_axis(axis, MM * curves.points.speed_m_s[chosen])


# --- stops ---------------------------------------------------------------------------------------------------------


def _dwell(c: Comparison) -> Section:
    rows = []
    for a, b in c.dwell:
        for name, series in zip((c.first.name, c.second.name), (a, b), strict=True):
            rows.append(
                (
                    series.name,
                    name,
                    str(len(series.stops)),
                    f"{series.reference_s:g}",
                    estimate(series.increment, unit=""),
                    estimate(series.slope, unit=""),
                    series.laws[0].form.title if series.laws else "–",
                )
            )
    head = ("series", "campaign", "stops", "at, s", "increment, N", "slope, N per decade", "best law")
    blocks = (
        Picture(
            "compare-dwell",
            f"Breakaway increment against stop duration, mean over the conditions: {c.first.name} (solid, circles) and "
            f"{c.second.name} (dashed, squares), with 95 % bands.",
            draw_dwell(c),
            synthetic=synthetic(c),
        ),
        Table(head, tuple(rows), "Breakaway after stops", numbers_from=2),
    )
    return Section("dwell", "Breakaway after stops", blocks, synthetic=synthetic(c))


def draw_dwell(c: Comparison) -> Figure:
    """Both campaigns' curves of breakaway over duration, a panel for each series."""
    shown = list(c.dwell)[:MOST_PANELS]
    columns = min(2, len(shown))
    figure = style.new_figure(2.8 * -(-len(shown) // columns) + 0.3)
    axes = style.panels(figure, len(shown), columns)
    for axis, pair in zip(axes, shown, strict=True):
        for k, series in enumerate(pair):
            _series(axis, series, k, (c.first.name, c.second.name)[k])
        style.logarithmic(axis)
        axis.set_title(pair[0].name)
        axis.set_xlabel("stop duration / s")
        axis.set_ylabel("breakaway increment / N")
    style.legend_above(figure, axes[0].get_legend_handles_labels()[0])
    _stamp(figure, c)
    return figure


def _series(axis: Axes, series: DwellSeries, k: int, name: str) -> None:
    look = style.look(k)
    assert series.curve is not None
    conditions = len(series.conditions)
    log_s = np.log10(series.duration_s)
    rows = np.kron(np.full((1, conditions), 1.0 / conditions), np.eye(log_s.size))
    mean = series.curve.values(log_s).combine(rows.astype(np.float64)).estimates()
    low, high = (np.array([getattr(e, n) for e in mean]) for n in ("low", "high"))
    axis.fill_between(series.duration_s, low, high, color=look.color, alpha=0.15, lw=0)
    label = f"{name} ({NAMES[k]})"
    axis.plot(series.duration_s, [e.value for e in mean], ls=look.linestyle, color=look.color, lw=1.1, label=label)
    shift = 1.0 + 0.05 * k
    axis.plot(
        [s.dwell_s * shift for s in series.stops],
        [s.increment_n for s in series.stops],
        look.marker,
        ls="none",
        color=look.color,
        mfc="white",
        ms=3.0,
    )
