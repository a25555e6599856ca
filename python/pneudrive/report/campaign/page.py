"""The report of a campaign: verdict, sections, files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import PA_PER_BAR
from pneudrive.numbers import with_interval, with_u
from pneudrive.report import style
from pneudrive.report.campaign import course, curves, run
from pneudrive.report.campaign.curves import MM, condition_names
from pneudrive.report.campaign.stops import stops
from pneudrive.report.page import Report
from pneudrive.report.words import plural

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries

#: The sections in their order; a section without data is None.
SECTIONS = (
    run.what,
    curves.curves,
    curves.air,
    curves.pressure,
    curves.direction,
    course.position,
    stops,
    course.drift,
    course.repeatability,
    course.loops,
    course.stick_slip,
    run.said,
    run.flags,
    run.budget,
    run.provenance,
)


@style.applied()
def write_campaign_report(found: CampaignCharacteristics, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : CampaignCharacteristics
    folder : path-like
        An existing folder; figures go into its folder ``figures``.

    Returns
    -------
    pathlib.Path
        Path of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    title = f"{'Synthetic friction' if found.synthetic else 'Friction'} campaign: {found.name}"
    return Report(title, verdict(found), [part(found) for part in SECTIONS], found.synthetic).write(folder)


def verdict(found: CampaignCharacteristics) -> Iterator[str]:
    """Return the results in a few lines."""
    made = "on a simulated rig (synthetic)" if found.synthetic else f"on {found.identity.name}"
    read = len(found.cycles) + len(found.stops)
    lost = f"; {plural(len(found.skipped), 'cycle')} could not be used" if found.skipped else ""
    yield f"{plural(read, 'cycle')} {made}{lost}."
    yield from _friction(found)
    yield from _air(found)
    for series in found.dwell:
        if series.slope is not None:
            best = f"; best law: {series.laws[0].form.title}" if series.laws else ""
            yield (
                f"Breakaway after a stop ({series.name}) changes by {with_interval(series.slope, unit='N')} per decade "
                f"of duration at {series.reference_s:g} s{_with_pressure(series)}{best}."
            )
    yield from _course(found)
    missing = sum(not s.carried for s in found.statements)
    if missing:
        count = plural(missing, "question is", "questions are")
        yield f"{count} not answered by these data; the sections name them and the data they need."


def _friction(found: CampaignCharacteristics) -> Iterator[str]:
    both = [c for c in found.curves if c.direction == 0]
    if not both:
        yield "These cycles do not give friction over speed."
        return
    first = both[0]
    ends = [int(i) for i in np.flatnonzero(first.measured)[[0, -1]]]
    half = [float(v) for v in (first.high_n - first.low_n) / 2.0]
    said = " and ".join(
        f"{with_u(float(first.friction_n[i]), half[i])} at {MM * first.speed_m_s[i]:.3g} mm/s"
        for i in dict.fromkeys(ends)
    )
    where = condition_names(found)(first.condition)
    yield f"Friction at {where}: {said} (± half of the 95 % interval); {plural(len(both), 'condition')} in all."
    for effects in found.pressure:
        slopes = _effects(effects, "mean", " ({})", ("a", "b", "both chambers together"))
        if slopes:
            name = f" ({effects.levels})" if effects.levels else ""
            joint = effects.interaction_n_pa2
            both = f"; interaction {with_interval(joint, PA_PER_BAR**2, 'N/bar²')}" if joint is not None else ""
            yield f"Friction changes with pressure{name}, mean over speeds: {', '.join(slopes)}{both}."


def _effects(of: object, name: str, words: str, chambers: tuple[str, str, str]) -> list[str]:
    """Return the known effects of both pressures as text."""
    each = zip((getattr(of, f"{name}_{side}") for side in ("a", "b", "sum")), chambers, strict=True)
    return [with_interval(e, PA_PER_BAR, "N/bar") + words.format(chamber) for e, chamber in each if e is not None]


def _air(found: CampaignCharacteristics) -> Iterator[str]:
    separated = [a for a in found.air if a.separated]
    if separated:
        a = max(separated, key=lambda share: share.air_n[-1])
        half = float(a.air_high_n[-1] - a.air_low_n[-1]) / 2.0
        air = f"{a.air_n[-1]:.2g} of {a.total_n[-1]:.3g} N are air, not seal"
        if abs(a.air_n[-1]) < half:
            air = f"no force of the air is visible in {a.total_n[-1]:.3g} N (± {half:.2g} N)"
        yield f"At {MM * a.speed_m_s[-1]:.3g} mm/s and {condition_names(found)(a.condition)}, {air}."
    elif found.air:
        yield "Air and seal cannot be separated: pressures were not measured in the chambers."


def _with_pressure(series: DwellSeries) -> str:
    """Return the text on the change of the slope with pressure; "" at one pressure."""
    slopes = (
        _effects(series.pressure, "slope", " of {}", ("p_a", "p_b", "both pressures together"))
        if series.pressure
        else []
    )
    return f", and that slope by {' and '.join(slopes)}" if slopes else ""


def _course(found: CampaignCharacteristics) -> Iterator[str]:
    r, d = found.repeatability, found.drift
    if r is not None and r.within is not None:
        between = f", between blocks and days {r.between.value:.2g} N" if r.between is not None else ""
        drift = f"; friction drifted by {np.ptp(d.drift_n):.2g} N" if d is not None and d.drift_n.size else ""
        yield f"One cycle repeats within {r.within.value:.2g} N (standard deviation){between}{drift}."
