"""Comparison of two campaigns: new and worn, one seal and another, before and after grease.

Each compared property is one statistical test. Holm's correction [holm1979] keeps the probability of a false difference
at 5 % for all tests together. A check of comparability comes first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.campaign.storage.folder import Campaign
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import CHANCE, Estimate
from pneudrive.friction.campaign.compare.checks import Check, checks_of
from pneudrive.friction.campaign.compare.curves import SAME_PRESSURE_PA, CurveComparison, compare_curves, holm
from pneudrive.friction.campaign.sensors import stated_gain
from pneudrive.friction.sentences import capitalised, say
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_series import DwellSeries
    from pneudrive.friction.sentences import Statement

#: Two cycles of one campaign differ by less than this many standard deviations, 19 times of 20.
REPEATABILITY_FACTOR = 2.77


@dataclass(frozen=True)
class Test:
    """Statistical test of one property.

    Attributes
    ----------
    what : str
    difference : Estimate or None
        Second less first; None if it has several parts.
    p : float
        Probability of such a large difference by chance. NaN without a test.
    adjusted_p : float
        After Holm's correction for the number of tests.
    different : bool
    beyond_repeatability : bool or None
        The difference exceeds that of two cycles of either campaign; None if not applicable.
    note : str
    """

    what: str
    difference: Estimate | None
    p: float
    adjusted_p: float = float("nan")
    different: bool = False
    beyond_repeatability: bool | None = None
    note: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Shown):
    """Two campaigns, compared.

    Attributes
    ----------
    first, second : CampaignCharacteristics
    checks : tuple of Check
    tests : tuple of Test
    curves : CurveComparison or None
    dwell : tuple of (DwellSeries, DwellSeries)
        Series that were compared.
    different : bool
        Any test is different.
    statements : tuple of Statement
    """

    first: CampaignCharacteristics
    second: CampaignCharacteristics
    checks: tuple[Check, ...]
    tests: tuple[Test, ...]
    curves: CurveComparison | None
    dwell: tuple[tuple[DwellSeries, DwellSeries], ...]
    different: bool
    statements: tuple[Statement, ...]

    @property
    def attributable(self) -> bool:
        """Whether a difference of curves can be separated from mounting and day: both have several blocks."""
        return self.curves is None or self.curves.several_blocks

    def _card(self) -> Card:
        """Return the result, then a line for each question."""
        rows = []
        for test in self.tests:
            e = test.difference
            size = f"{e.value:+.3g} ({e.low:+.3g} .. {e.high:+.3g}) {e.unit}" if e is not None else "-"
            rows.append((test.what, size, f"{test.adjusted_p:.2g}", "yes" if test.different else "not shown"))
        title = f"{self.second.name} less {self.first.name}: {self}"
        head = ("question", "difference (95 %)", "p corrected", "different")
        return Card(title, head, rows, [str(statement) for statement in self.statements])

    def __str__(self) -> str:
        """Return the result in a sentence."""
        if not self.tests:
            return "Nothing can be compared."
        if not self.different:
            count = f"{len(self.tests)} test{'s' if len(self.tests) > 1 else ''}"
            return f"No difference is shown in {count}: the campaigns may be equal, or too short."
        what = ", ".join(dict.fromkeys(test.what for test in self.tests if test.different))
        text = f"The campaigns differ by more than their cycles scatter: {what}."
        if not self.attributable:
            text += " With a single block in a campaign this may be the mounting or the day."
        return text


def compare_campaigns(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Comparison:
    """Compare two campaigns.

    Parameters
    ----------
    first, second : CampaignCharacteristics
        Results of `characteristics`. Differences are second less first.

    Returns
    -------
    Comparison
    """
    abouts = [about_of(found) for found in (first, second)]
    curves = compare_curves(first, second, _gain(first, second, abouts))
    pairs = tuple(_pairs(first, second))
    tests = _adjusted(
        [
            *(_curve_tests(first, second, curves) if isinstance(curves, CurveComparison) else ()),
            *(test for pair in pairs for test in _dwell_tests(*pair)),
            *_drift_test(first, second),
            *_repeatability_test(first, second),
        ]
    )
    found = Comparison(
        first=first,
        second=second,
        checks=tuple(checks_of(first, second, *abouts)),
        tests=tests,
        curves=curves if isinstance(curves, CurveComparison) else None,
        dwell=pairs,
        different=any(test.different for test in tests),
        statements=(),
    )
    return replace(found, statements=tuple(_statements(found, curves if isinstance(curves, str) else "")))


def about_of(found: CampaignCharacteristics) -> dict[str, Any]:
    """Return ``campaign.json`` of a campaign; empty if the folder cannot be opened."""
    try:
        return Campaign.open(found.folder).about
    except CampaignError:
        return {}


def _gain(first: CampaignCharacteristics, second: CampaignCharacteristics, abouts: list[dict[str, Any]]) -> float:
    """Return the relative uncertainty of the ratio of both force sensors' gains; 0 for the same sensor.

    Simulated sensors differ between seeds.
    """
    a, b = first.identity, second.identity
    drawn = a.synthetic and abouts[0].get("seed") != abouts[1].get("seed")
    same = a.name == b.name and a.calibration == b.calibration and a.force_calibration == b.force_calibration
    if same and not drawn:
        return 0.0
    return float(np.hypot(stated_gain(a) or 0.0, stated_gain(b) or 0.0) / np.sqrt(2.0))


# --- tests ---------------------------------------------------------------------------------------------------------


def _curve_tests(
    first: CampaignCharacteristics, second: CampaignCharacteristics, curves: CurveComparison
) -> Iterator[Test]:
    mean_n = float(curves.friction_n.mean())
    mean = curves.mean.scaled(mean_n, "N")
    within = [found.repeatability.within for found in (first, second) if found.repeatability is not None]
    limits = [REPEATABILITY_FACTOR * r.value for r in within if r is not None]
    beyond = abs(mean.value) > max(limits) if len(limits) == 2 else None
    note = f"mean of {curves.points.speed_m_s.size} common points, {100 * curves.mean.value:+.2g} % of friction"
    yield Test("friction over speed", mean, curves.shape.p, beyond_repeatability=beyond, note=note)
    if curves.pressure is not None:
        note = "growth of friction with pressure, as a fraction of friction"
        yield Test("relative effect of pressure", None, curves.pressure.p, note=note)


def _pairs(
    first: CampaignCharacteristics, second: CampaignCharacteristics
) -> Iterator[tuple[DwellSeries, DwellSeries]]:
    """Return the series of stops with one restart speed and way of holding in each campaign."""
    single = all(len({series.levels for series in found.dwell}) == 1 for found in (first, second))
    for a, b in product(first.dwell, second.dwell):
        same = a.released == b.released and abs(a.speed_m_s - b.speed_m_s) < 0.01 * a.speed_m_s
        if same and (single or a.levels == b.levels) and a.curve is not None and b.curve is not None and _common(a, b):
            yield a, b


def _common(a: DwellSeries, b: DwellSeries) -> list[tuple[int, int]]:
    """Return the conditions of both series with the same pressures."""
    pressures = (np.array([(c.pressure_a_pa, c.pressure_b_pa) for c in s.conditions]) for s in (a, b))
    one, two = (p.reshape(-1, 1, 2) for p in pressures)
    near = (np.abs(one - two.swapaxes(0, 1)) < SAME_PRESSURE_PA).all(axis=2)
    return [(int(i), int(j)) for i, j in np.argwhere(near)]


def _dwell_tests(a: DwellSeries, b: DwellSeries) -> Iterator[Test]:
    low = max(min(s.dwell_s for s in series.stops) for series in (a, b))
    high = min(max(s.dwell_s for s in series.stops) for series in (a, b))
    if not high > low:
        return
    at = a.reference_s if low < a.reference_s < high else float(np.sqrt(low * high))
    slopes, levels = [], []
    for series, of in zip((a, b), zip(*_common(a, b), strict=True), strict=True):
        assert series.curve is not None
        row = np.zeros((1, len(series.conditions)))
        row[0, list(of)] = 1.0 / len(of)
        slopes.append(series.curve.gains(float(np.log10(low)), float(np.log10(high))).combine(row).estimates()[0])
        levels.append(series.curve.values(np.log10([at])).combine(row).estimates()[0])
    level, slope = levels[1] - levels[0], slopes[1] - slopes[0]
    beyond = abs(level.value) > REPEATABILITY_FACTOR * max(a.scatter_n, b.scatter_n)
    where, span = f"{a.name}, at {at:.3g} s", f"{a.name}, mean from {low:.3g} to {high:.3g} s"
    yield Test("breakaway after a stop", level, level.p, beyond_repeatability=beyond, note=where)
    yield Test("slope of breakaway per decade of stop", slope, slope.p, note=span)


def _drift_test(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Iterator[Test]:
    before, after = (found.drift.per_hour if found.drift is not None else None for found in (first, second))
    if before is not None and after is not None:
        difference = after - before
        yield Test("drift over time", difference, difference.p, note="change of friction, linear in time")


def _repeatability_test(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Iterator[Test]:
    """Compare the scatter of repeated cycles by an F test, if both campaigns have repeats.

    Residuals of a smooth curve contain more than scatter and are not tested.
    """
    from scipy.special import fdtr, fdtrc, fdtri

    both = [found.repeatability for found in (first, second)]
    a, b = (r.within if r is not None and r.basis != "smooth curve" else None for r in both)
    if a is None or b is None or not (a.value > 0 and b.value > 0):
        return
    free = b.degrees_of_freedom, a.degrees_of_freedom
    ratio = (b.value / a.value) ** 2
    p = min(1.0, 2.0 * min(float(fdtr(*free, ratio)), float(fdtrc(*free, ratio))))
    low, high = (float(np.sqrt(ratio / fdtri(*free, share))) for share in (0.975, 0.025))
    value = float(np.sqrt(ratio))
    error = value * float(np.sqrt(0.5 / free[0] + 0.5 / free[1]))
    estimate = Estimate(value, low, high, error, "", min(free), p)
    yield Test("repeatability of a cycle", estimate, p, note="ratio of the standard deviations, second over first")


def _adjusted(tests: list[Test]) -> tuple[Test, ...]:
    known = [i for i, test in enumerate(tests) if np.isfinite(test.p)]
    adjusted = holm(np.array([tests[i].p for i in known]))
    for i, p in zip(known, adjusted, strict=True):
        tests[i] = replace(tests[i], adjusted_p=float(p), different=bool(p < CHANCE))
    return tuple(tests)


def _statements(found: Comparison, not_comparable: str) -> Iterator[Statement]:
    """Return cautions on the tests. `not_comparable` is the reason for missing curves."""
    for check in found.checks:
        if not check.comparable:
            yield say("data.rigs_differ", what=capitalised(check.what), check=check)
    if found.curves is None:
        yield say("curve.not_comparable", why=not_comparable)
    else:
        size, left = found.curves.points.speed_m_s.size, found.curves.points.left_out
        if left:
            yield say("curve.thinned", all=size + left, compared=size)
        if not found.curves.several_blocks:
            yield say("repeatability.not_in_tests")
    if (found.first.dwell or found.second.dwell) and not found.dwell:
        yield say("stops.not_comparable")
    for test in found.tests:
        if test.different and test.beyond_repeatability is False:
            yield say("repeatability.small_difference", what=capitalised(test.what))
    mean = next((t.difference for t in found.tests if t.what == "friction over speed" and t.different), None)
    for one in (found.first, found.second):
        moved = float(np.ptp(one.drift.drift_n)) if one.drift is not None else 0.0
        if mean is not None and moved > abs(mean.value):
            yield say("drift.more_than_difference", name=one.name, moved=moved)
