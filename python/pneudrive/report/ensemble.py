"""Views of an ensemble (spread of each output, fans over time) and of sensitivities (bars of each number)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.figures import Axis, Band, Bars, Figure, Line, Look, Panel
from pneudrive.report.tables import plural
from pneudrive.units import readable
from pneudrive.views import MOST_LEADING, Finding, LeadingValue, ShownFigure, ShownValue, View

if TYPE_CHECKING:
    import xarray as xr

#: Column of the view of an ensemble -> part of the members below it.
QUANTILES = {"lowest": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "highest": 1.0}
MOST_PANELS, BINS = 6, 24
#: Variables of a sensitivity that are drawn -> look.
DRAWN = {"total": Look("blue"), "first": Look("orange"), "mu_star": Look("blue"), "sigma": Look("orange")}


def ensemble_view(found: xr.Dataset) -> View:
    """Return the view of an ensemble: the spread of each output over the members that have it, and failures."""
    rows, missing, fans, counts = [], [], [], []
    for name, column in ((str(name), found[name]) for name in found.data_vars if name not in ("status", "reason")):
        values, (size, unit) = column.to_numpy(), readable(str(column.attrs.get("units", "1")))
        label = Axis(f"{name} / {f'({unit})' if '/' in unit else unit}" if unit else name)
        finite = values[np.isfinite(values)]
        if values.ndim > 1:
            low, first, middle, last, high = np.nanquantile(values, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0)
            time, tints = found["time"].to_numpy(), (Look("grey"), Look("blue"))
            bands = [Band(time, low, high, "5 to 95 %", tints[0]), Band(time, first, last, "25 to 75 %", tints[1])]
            fans.append(Panel([*bands, Line(time, middle, "median")], "", "time / s", label))
            continue
        ends = np.quantile(finite, list(QUANTILES.values())) / size if finite.size else ()
        texts = [f"{end:.5g} {unit}".strip() for end in ends] or ["-"] * len(QUANTILES)
        rows += [ShownValue(f"{name}, {q}", name, q, text) for q, text in zip(QUANTILES, texts, strict=True)]
        if finite.size < values.size:
            missed = f"{name} has no value in {values.size - finite.size} of {values.size} members"
            missing.append(Finding(f"{missed}: its row is of the others.", "open"))
        if finite.size and np.ptp(finite) > 0.0:
            number, edges = np.histogram(finite, BINS)
            bars = Bars(0.5 * (edges[1:] + edges[:-1]), number, thickness=float(edges[1] - edges[0]))
            counts.append(Panel([bars], "", label, "members"))
    status = found["status"].to_numpy() if "status" in found else np.zeros(found.sizes["member"])
    failed = np.flatnonzero(status)[:1]
    words = (str(found["reason"].to_numpy()[i]) if "reason" in found else "see the table of members" for i in failed)
    reasons = [Finding(f"member {i}: {reason}", "bad") for i, reason in zip(failed, words, strict=True)]
    panels = {"fan": fans[:MOST_PANELS], "members": counts[:MOST_PANELS]}
    captions = {"fan": "Median of the members over time, and the ranges of 50 and 90 % of them.",
                "members": "Distribution of each output over the members."}  # fmt: skip
    before = f"{found.attrs['title']}: " if "title" in found.attrs else ""
    return View(
        f"{before}{found.sizes['member']} members, {np.count_nonzero(status)} failed",
        tuple(rows),
        state="bad" if failed.size else "open" if missing else "good",
        findings=(*reasons, *missing),
        figures=tuple(
            ShownFigure(key, captions[key], Figure(each, columns=2, row_in=1.9, rest_in=0.5))
            for key, each in panels.items()
            if each
        ),
    )


def sensitivity_view(found: xr.Dataset) -> View:
    """Return the view of sensitivities: each number's effect on each output, with intervals, and bars."""
    numbers, drawn = [str(name) for name in found["number"].to_numpy()], [name for name in DRAWN if name in found]
    names = [*drawn, *(["mu"] if "mu" in found else [])]
    rows, leading, findings, panels = [], [], [], []
    for output in map(str, found["output"].to_numpy()):
        own = found.sel(output=output)
        unit = "" if "total" in found else str(own["unit"].item())
        if not np.isfinite(own[drawn[0]]).any():
            findings.append(Finding(f"{output} does not vary with these numbers.", "open"))
            continue
        marks, positions = [], np.arange(len(numbers), dtype=float)
        for place, name in enumerate(names):
            at = positions + 0.2 - 0.4 * place
            ends = own[f"{name}_interval"].to_numpy() if f"{name}_interval" in own else None
            if name in DRAWN:
                marks.append(Bars(at, own[name].to_numpy(), name.replace("_", " "), DRAWN[name], 0.35, across=True))
            marks += [Line(ends[:, k], (y, y)) for k, y in enumerate(at)] if ends is not None else []
            words = name.replace("_", " ")
            for k, number in enumerate(numbers):
                interval = None if ends is None else (float(ends[0, k]), float(ends[1, k]))
                value = (float(own[name][k]), unit, interval)
                rows.append(ShownValue(f"{output}, {number}, {name}", f"{output}: {number}", words, *value))
        column = own[drawn[0]].to_numpy()
        most = rows[int(np.nanargmax(column)) - len(names) * len(numbers)]
        words = f"{output}, most by {most.label.removeprefix(f'{output}: ')}: {most.quantity}"
        leading.append(LeadingValue(ShownValue(most.key, most.label, words, most.value, unit, most.interval)))
        axis = Axis(f"effect / {unit}" if unit else "fraction of the variance", is_si=not unit)
        panels.append(Panel(marks, output, axis, Axis(names=numbers)))
    points = zip(found["output"].values, found["used"].values, strict=True)
    used = ", ".join(f"{int(count)} for {name}" for name, count in points)
    figure = Figure(panels[:MOST_PANELS], columns=2, row_in=0.7 + 0.3 * len(numbers), rest_in=0.5)
    count = f"{plural(len(numbers), 'number')}, {plural(found.sizes['output'], 'output')}"
    return View(
        f"{found.attrs.get('title', 'Sensitivities')}: {count}",
        tuple(rows),
        notes=(f"points used: {used}",),
        state="open" if findings else "good",
        leading=tuple(leading[:MOST_LEADING]),
        findings=tuple(findings),
        figures=(ShownFigure("sensitivity", "Effect of each number, with 95 % intervals.", figure),) if panels else (),
    )
