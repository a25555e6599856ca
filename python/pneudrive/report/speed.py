"""Friction over speed: views of friction maps and of characterised recordings, and recovered truth."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pneudrive.figures import SPEED, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ramp
from pneudrive.friction.friction_map import ALL_RECORDINGS, PA_PER_BAR, bar, groups_of
from pneudrive.friction.sentences import flag_findings
from pneudrive.identify.static.model import unit_of
from pneudrive.numbers import with_u
from pneudrive.report.tables import Topic, spread_evenly
from pneudrive.units import readable
from pneudrive.views import Finding, LeadingValue, ShownTable, ShownValue, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.friction_map import MapGroup
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.fit import Fits
    from pneudrive.report.page import Section
    from pneudrive.views import ShownCurve

MOST_PANELS = 9
MOST_CURVES = 8  # of one assembly
MANY = 60  # points beyond which markers get smaller
SHOWN_ERRORS = 4.0  # standard errors to either side
STRIBECK = "stribeck"
DETERMINED = "Fitted parameters (± half of the 95 % interval); these data do not determine missing parameters"
UNDETERMINED = "Values that these data cannot determine"


def map_view(table: xr.Dataset, fits: Fits | None = None) -> View:
    """Return friction over speed with U (k = 2), the lowest and the highest friction, and the flags with remedies.

    Parameters
    ----------
    table : Dataset
        Friction map.
    fits : mapping, optional
        Assembly -> law -> fit: laws that the data determine are drawn, and undetermined values are findings.
    """
    groups = [(group, group.curves(table)) for group in groups_of(table)]
    curves = tuple(curve for _, own in groups for curve in own)
    names = table["recording"].to_numpy().astype(str).tolist()
    raised: dict[str, list[str]] = {}
    for name, flags in zip(names, table["flags"].to_numpy(), strict=True):
        for flag in str(flags).split(","):
            raised.setdefault(flag, []).append(name)
    findings, tables = flag_findings(raised, len(set(names))), ()
    topic = Topic("recordings", "speed")
    labels = topic.say("with_labels") if len({group.assembly for group, _ in groups}) > 1 else ""
    law = topic.say("with_law") if any(map(_is_curve, (fits or {}).values())) else ""
    if fits is not None:
        about = _fitted(fits)
        findings += about.findings or [Finding(topic.say("no_law"), "open")]
        tables = about.tables
    return View(
        f"{table.sizes['row']} points of friction",
        curves=curves,
        state=worst(findings),
        leading=tuple(_ends(table)),
        findings=tuple(findings),
        tables=tables,
        figures=(topic.figure("friction-speed", speed_figure(groups, fits or {}), law=law, labels=labels),),
    )


def _ends(table: xr.Dataset) -> Iterator[LeadingValue]:
    """Yield the lowest and the highest friction with U (k = 2)."""
    frame = pl.DataFrame({name: table[name].to_numpy() for name in ("friction_n", "stderr_n", "u_systematic_n")})
    order = np.argsort(frame["friction_n"].to_numpy(), kind="stable")
    for word, row in (("lowest", order[0]), ("highest", order[-1])):
        friction, stderr, systematic = frame.row(int(row))
        reach = 2.0 * float(np.hypot(np.nan_to_num(stderr), systematic))
        where = f"{table['recording'].to_numpy()[row]}, {1e3 * abs(table['velocity_m_s'].to_numpy()[row]):.3g} mm/s"
        name = f"{word} friction ({where})"
        yield LeadingValue(ShownValue(word, word, name, friction, "N", (friction - reach, friction + reach)))


def richest(by_law: Mapping[str, FrictionFit]) -> FrictionFit:
    """Return the fit of the law with the most parameters."""
    return by_law.get(STRIBECK) or next(iter(by_law.values()))


def _is_curve(by_law: Mapping[str, FrictionFit] | None) -> bool:
    """Return whether the data determine how friction depends on speed."""
    return STRIBECK in (by_law or {}) and "stribeck_velocity" in by_law[STRIBECK].determined  # type: ignore[index]


def _fitted(fits: Fits) -> View:
    """Return determined and undetermined values of the richest fit of each assembly, and notes on the fits."""
    values, lost, notes = [], dict[Finding, list[str]](), []
    for group, by_law in fits.items():
        fit = richest(by_law)
        view = fit.view()
        values += [replace(v, label=f"{group}: {v.label}") for v in view.rows if v.label in fit.intervals]
        notes += [Finding(f"{group}: {note}.", "open") for note in fit.notes]
        for finding in view.findings:
            lost.setdefault(finding, []).append(group)
    head, rows = View("", tuple(values)).table()
    tables = [ShownTable(DETERMINED, head, tuple(rows))] if rows else []
    if lost:
        cells = ((", ".join(groups), f.text, f.remedy.removeprefix("Remedy: ")) for f, groups in lost.items())
        tables.append(ShownTable(UNDETERMINED, ("group", "value", "measure"), tuple(cells)))
        names = dict.fromkeys(item.parameter for by_law in fits.values() for item in richest(by_law).undetermined)
        notes.append(Finding(f"{UNDETERMINED}: {', '.join(names)}.", "open", "The table states what to measure."))
    return View("", findings=tuple(notes), tables=tuple(tables))


def speed_figure(groups: list[tuple[MapGroup, list[ShownCurve]]], fits: Fits) -> Figure:
    """Draw friction over speed: a panel for each assembly, a look for each pair of pressures, and determined laws."""
    panels: dict[str, list[tuple[MapGroup, ShownCurve]]] = {}
    for group, curves in groups:
        panels.setdefault(group.assembly, []).extend((group, curve) for curve in curves)
    is_single, count = len(panels) == 1, sum(curve.x.size for _, curves in groups for curve in curves)
    drawn = []
    for assembly, members in spread_evenly(list(panels.items()), MOST_PANELS):
        by_pressure = sorted(members, key=lambda member: tuple(member[0].gauges))
        shown, marks = spread_evenly(by_pressure, MOST_CURVES), []
        for index, (group, curve) in enumerate(by_pressure):
            at = next((place for place, member in enumerate(shown) if member[1] is curve), None)
            if at is None:
                marks.append(Markers(curve.x, curve.y, look=Look("grey", "-", "."), size=1.5))
                continue
            own, ends = ramp(at, len(shown)), curve.band or (curve.y, curve.y)
            label = curve.label.removeprefix(f"{assembly}: ") if is_single else ""
            names = () if is_single else (*[""] * (curve.x.size - 1), bar(max(group.gauges, key=abs)))
            size = 2.2 if count > MANY else 4.0
            look = {"size": size, "filled": not index % 2, "names": names}
            marks.append(Markers(curve.x, curve.y, label, own, *ends, **look))
            marks += _law(group, curve, fits.get(assembly) or fits.get(ALL_RECORDINGS), own)
        drawn.append(Panel(marks, "" if is_single else assembly))
    y = Axis("friction / N", low=0.0) if all((c.y >= 0.0).all() for _, own in groups for c in own) else "friction / N"
    if is_single:
        return Figure(drawn, SPEED, y, row_in=3.6, rest_in=0.0, entries=3)
    return Figure(drawn, SPEED, y, columns=3, row_in=2.0, rest_in=0.4, share_x="all", share_y="all")


def _law(group: MapGroup, curve: ShownCurve, by_law: Mapping[str, FrictionFit] | None, own: Look) -> list[Band | Line]:
    """Draw the fitted law at the pressures of a group if the data determine how it depends on speed."""
    if by_law is None or not _is_curve(by_law):
        return []
    grid = np.geomspace(curve.x.min(), curve.x.max(), 200)
    law = by_law[STRIBECK].predict(grid, *map(float, group.gauges))
    return [Band(grid, law.lower_n, law.upper_n), Line(grid, law.friction_n, look=own, width=0.9)]


# --- Recovered truth of simulated recordings.


def recovered(found: Characterisation) -> pl.DataFrame | None:
    """Return friction with the ground truth of each simulated recording, SI; None without one."""
    rows = []
    for result in found.results:
        truth = result.recording.truth
        if truth is None or "friction_n" not in truth or len(result.levels) != 1:
            continue
        (level,) = result.levels
        rows.append(
            {
                "speed_m_s": truth["speed_m_s"],
                "gauge_pa": max(truth["pressure_a_pa"], truth["pressure_b_pa"]) - level.ambient_pressure_pa,
                "friction_n": level.friction_n,
                "stderr_n": level.stderr_n,
                "error_n": level.friction_n - truth["friction_n"],
                "is_inside": abs(level.friction_n - truth["friction_n"]) <= level.expanded_n,
                "expanded_n": level.expanded_n,
                "true_n": truth["friction_n"],
            }
        )
    return pl.DataFrame(rows) if rows else None


def recovered_section(found: Characterisation, fits: Fits) -> Section | None:
    """Return the section on recovered friction and parameters; None without simulated recordings."""
    pairs = recovered(found)
    if pairs is None:
        return None
    topic, rows = Topic("recordings", "recovered"), list(_recovered_parameters(found, fits))
    errors_n, expanded = np.abs(pairs["error_n"].to_numpy()), pairs["expanded_n"]
    ends = dict.fromkeys(f"{value:.2f}" for value in (expanded.min(), expanded.max()))
    within = int(np.sum(errors_n <= 2 * np.nan_to_num(pairs["stderr_n"].to_numpy())))
    counts = {"all": pairs.height, "inside": pairs["is_inside"].sum(), "within": within}
    return topic.section(
        topic.text(**counts, reach=" to ".join(ends), worst=1e3 * float(errors_n.max())),
        topic.picture("recovered", errors(pairs)),
        topic.table(rows) if rows else None,
        synthetic=True,
    )


def _recovered_parameters(found: Characterisation, fits: Fits) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield true and recovered value of each parameter of the fit that covers all recordings."""
    fit = next(iter(fits.values()), {}).get(STRIBECK) if fits else None
    truth = next((r.truth for r in found.recordings if r.truth), None)
    if fit is None or truth is None or truth["law"] != STRIBECK:
        return
    known = dict(truth["parameters"]) | (truth["pressure"] or {})
    for name in fit.free:
        single = name.removesuffix("b") if name.endswith("_ab") else name
        if single in known and name in fit.intervals:
            size, unit = readable(unit_of(name))
            inside = abs(fit.parameters[single] - known[single]) / size <= fit.expanded_uncertainty(name) / size
            words = single.replace("_", " ") + (" and b" if name.endswith("_ab") else "")
            low, high = (bound / size for bound in fit.intervals[name])
            estimate = with_u(fit.parameters[single] / size, fit.expanded_uncertainty(name) / size, unit)
            interval = f"{low:.4g} … {high:.4g} {unit}".strip()
            yield words, f"{known[single] / size:.4g} {unit}".strip(), estimate, interval, "yes" if inside else "no"


def errors(pairs: pl.DataFrame) -> Figure:
    """Draw curves over speed, and errors with their statistical part."""
    left: list[Any] = []
    right: list[Any] = [Rule(y=(-2.0, 2.0), label="two standard errors", look=Look("band"))]
    gauges = np.unique(pairs["gauge_pa"].to_numpy().round(-2))
    for index, gauge in enumerate(gauges[:MOST_CURVES]):
        own = ramp(index, min(gauges.size, MOST_CURVES))
        chosen = pairs.filter((pl.col("gauge_pa") - gauge).abs() < 100.0).sort("speed_m_s")
        speed, friction, true, error_n, stderr = (
            chosen[name].to_numpy() for name in ("speed_m_s", "friction_n", "true_n", "error_n", "stderr_n")
        )
        with np.errstate(divide="ignore", invalid="ignore"):  # one further off is drawn on the frame
            error = np.clip(error_n / stderr, -SHOWN_ERRORS, SHOWN_ERRORS)
        left.append(Line(speed, true, look=own, width=0.9))
        left.append(Markers(speed, friction, f"{gauge / PA_PER_BAR:.2g} bar gauge", own, size=3.2))
        right.append(Markers(speed, error, look=own, size=3.2))
    ends = Axis("error / standard error", low=-SHOWN_ERRORS, high=SHOWN_ERRORS)
    panels = [Panel(left, y="friction / N"), Panel([*right, Rule(y=0.0, look=Look("black"), width=0.8)], y=ends)]
    return Figure(panels, Axis("speed / (mm/s)", "log"), columns=2, row_in=3.0, rest_in=0.0)
