"""Sentences on determined and undetermined values of the stops of a series."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import mean_estimate
from pneudrive.friction.campaign.stops.dwell_curve import CONFOUNDED
from pneudrive.friction.campaign.stops.dwell_forms import CONCLUSIVE, LEAST_DURATIONS, UNCERTAIN
from pneudrive.friction.campaign.stops.dwell_series import durations_of, inertia_of
from pneudrive.friction.campaign.stops.stop import SPOILING
from pneudrive.friction.sentences import say

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.stops.dwell_curve import DwellCurve
    from pneudrive.friction.campaign.stops.dwell_series import DwellSeries
    from pneudrive.friction.campaign.stops.stop import Stop
    from pneudrive.friction.sentences import Statement

FEWEST_PAIRS = 4  # share of durations and conditions with restarts in both directions
#: Stops up to this leave the time of saturation open for every law (of the order of hours to days
#: for elastomers: assumed).
LONG_S = 1000.0
RATE_SPREAD, RATE_CORRELATION = 0.2, 0.5


def dwell_statements(series: DwellSeries, stops: list[Stop]) -> Iterator[Statement]:
    """Return statements on the values that the stops of a series determine."""
    where = f"Stops ({series.name})"
    yield from _spoiled(where, stops)
    durations = series.curve.data.durations if series.curve is not None else 0
    if series.curve is None or durations < 2:
        yield from _one_duration(where, [s for s in stops if s.usable])
        return
    slope = series.slope
    if slope is not None:
        share = f"; {100 * series.share.value:.2g} % of running friction" if series.share is not None else ""
        numbers = {"slope": slope, "reference": series.reference_s, "stops": len(series.stops), "durations": durations}
        yield say(f"stops.{'slope' if slope.differs else 'slope_not_shown'}", where=where, share=share, **numbers)
    yield from _directions(where, series)
    if slope is None or slope.differs:  # else there is no effect
        yield from _laws(where, series, durations)
    yield from _confounding(where, series, series.curve)
    yield say("stops.peaks", where=where)


def _spoiled(where: str, stops: list[Stop]) -> Iterator[Statement]:
    flags = Counter(flag for s in stops for flag in s.flags if flag in SPOILING)
    if flags:
        kind = next((f"spoiled_{flag}" for flag in ("negative_friction", "undersampled") if flags[flag]), "spoiled")
        counts = ", ".join(f"{flag.replace('_', ' ')} {count}" for flag, count in flags.most_common())
        yield say(f"stops.{kind}", where=where, count=sum(not s.usable for s in stops), stops=len(stops), flags=counts)


def _one_duration(where: str, stops: list[Stop]) -> Iterator[Statement]:
    """Return statements on the increment after stops of one duration, without a law over duration."""
    durations = durations_of(stops)
    if len(stops) > 1 and durations == 1:
        inertia = inertia_of(stops)
        found = mean_estimate(np.array([s.increment_n for s in stops])).widened(inertia)
        duration = np.median([s.dwell_s for s in stops])
        kind = "stops.increment_and_mass" if inertia > 0.0 else "stops.increment"
        yield say(kind, where=where, duration=duration, found=found, count=len(stops))
    of = "one duration" if durations == 1 else f"{durations} durations"
    yield say("stops.too_few_durations", where=where, count=len(stops), durations=of)


def _directions(where: str, series: DwellSeries) -> Iterator[Statement]:
    """Return statements on the difference of peaks between directions, from cells with both."""
    cells: dict[tuple, dict[int, list[float]]] = {}
    for s in series.stops:
        cells.setdefault((s.condition, round(s.stop_s, 6)), {1: [], -1: []})[s.direction].append(s.increment_n)
    pairs = np.array([float(np.mean(c[1]) - np.mean(c[-1])) for c in cells.values() if c[1] and c[-1]])
    if pairs.size >= FEWEST_PAIRS and (found := mean_estimate(pairs)).differs:
        yield say("stops.directions", where=where, found=found)


def _laws(where: str, series: DwellSeries, durations: int) -> Iterator[Statement]:
    if durations < LEAST_DURATIONS or not series.laws:
        yield say("stops.no_law", where=where, durations=durations)
        return
    best = series.laws[0]
    if not np.isfinite(best.aicc):
        yield say("stops.laws_not_compared", where=where)
        return
    equal = [law.form.title for law in series.laws[1:] if law.delta < UNCERTAIN]
    refuted = [law.form.title for law in series.laws if law.delta > CONCLUSIVE]
    text = best.form.title + (f"; as good: {', '.join(equal)}" if equal else "")
    text += f"; without support: {', '.join(refuted)}" if refuted else ""
    yield say("stops.laws" if equal else "stops.law", where=where, laws=text)
    longest = max(s.dwell_s for s in series.stops)
    open_end = best.name == "log" or any(law.form.saturates and law.delta < CONCLUSIVE for law in series.laws)
    if best.name != "none" and longest <= LONG_S * 1.01 and open_end:
        yield say("stops.saturation", where=where, longest=longest)


def _confounding(where: str, series: DwellSeries, curve: DwellCurve) -> Iterator[Statement]:
    if curve.inflation >= CONFOUNDED:
        yield say("stops.drift", where=where)
    rate = np.array([s.loading_rate_n_s for s in series.stops])
    known = np.isfinite(rate) & (rate > 0)
    if known.sum() > 5:
        logs, durations = np.log(rate[known]), curve.data.log_s[known]
        spread = float(np.subtract(*np.quantile(logs, [0.9, 0.1])))
        together = float(np.corrcoef(logs, durations)[0, 1]) if spread > 0 and np.ptp(durations) > 0 else 0.0
        if spread > RATE_SPREAD and abs(together) > RATE_CORRELATION:
            yield say("stops.loading_rate", where=where, together=together)
    numbers = {"where": where, "stops": len(series.stops), "inertia": series.inertia_n}
    for flag in ("long_loading", "inertia", "slow_samples"):
        count = sum(flag in s.flags for s in series.stops)
        if count:
            yield say(f"stops.{flag}", count=count, **numbers)
