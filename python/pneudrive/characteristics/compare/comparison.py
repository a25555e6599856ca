"""Two campaigns against each other: new and worn, one seal and another, before and after grease.

Each question is one test; Holm's correction [holm1979] keeps the chance that equal campaigns are called different at
5 % for all questions together. Whether the campaigns can be compared at all is said first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.campaign.folder import Campaign
from pneudrive.characteristics.compare.checks import Check, checks_of
from pneudrive.characteristics.compare.curves import SAME_PRESSURE_PA, CurveComparison, compare_curves, holm
from pneudrive.characteristics.sentences import capitalised, say
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import CHANCE, Estimate
from pneudrive.show import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.characteristics.basics import Statement
    from pneudrive.characteristics.result import CampaignCharacteristics
    from pneudrive.characteristics.stops.dwell_law import DwellSeries

#: Two cycles of one campaign differ by less than this many of its standard deviations, 19 times of 20.
REPEATABILITY_FACTOR = 2.77


@dataclass(frozen=True)
class Test:
    """One question.

    Attributes
    ----------
    what : str
    difference : Estimate or None
        Second less first; None where it has several parts.
    p : float
        Probability of as large a difference by chance; NaN where there is no test.
    adjusted_p : float
        After Holm's correction for the number of tests.
    different : bool
    beyond_repeatability : bool or None
        The difference exceeds what two cycles of either campaign differ by; None where that is no question.
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
        """Whether a difference of curves can be told from one of mounting and day: both have several blocks."""
        return self.curves is None or self.curves.several_blocks

    def _card(self) -> Card:
        """Show what it comes to, then a line for each question."""
        rows = []
        for test in self.tests:
            e = test.difference
            size = f"{e.value:+.3g} ({e.low:+.3g} .. {e.high:+.3g}) {e.unit}" if e is not None else "-"
            rows.append((test.what, size, f"{test.adjusted_p:.2g}", "yes" if test.different else "not shown"))
        title = f"{self.second.name} less {self.first.name}: {self}"
        head = ("question", "difference (95 %)", "p corrected", "different")
        return Card(title, head, rows, [str(statement) for statement in self.statements])

    def __str__(self) -> str:
        """Say in a sentence what it comes to."""
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


def compare(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Comparison:
    """Compare two campaigns.

    Parameters
    ----------
    first, second : CampaignCharacteristics
        As `characteristics` gives them. Differences are second less first.

    Returns
    -------
    Comparison
    """
    abouts = [_about(found) for found in (first, second)]
    checks = tuple(checks_of(first, second, *abouts))
    curves = compare_curves(first, second, _gain(first, second, abouts))
    pairs = tuple(_pairs(first, second))
    tests: list[Test] = []
    if isinstance(curves, CurveComparison):
        tests += _curve_tests(first, second, curves)
    tests += [test for pair in pairs for test in _dwell_tests(*pair)]
    tests += [test for test in (_drift_test(first, second), _repeatability_test(first, second)) if test is not None]
    tests = _adjusted(tests)
    statements = tuple(_statements(first, second, checks, tests, curves, pairs))
    return Comparison(
        first=first,
        second=second,
        checks=checks,
        tests=tuple(tests),
        curves=curves if isinstance(curves, CurveComparison) else None,
        dwell=pairs,
        different=any(test.different for test in tests),
        statements=statements,
    )


def _about(found: CampaignCharacteristics) -> dict[str, Any]:
    try:
        return Campaign.open(found.folder).about
    except CampaignError:
        return {}


def _gain(first: CampaignCharacteristics, second: CampaignCharacteristics, abouts: list[dict[str, Any]]) -> float:
    """How far the gains of both force sensors may differ, relative; one sensor has one gain.

    Simulated sensors are drawn anew for each seed.
    """
    a, b = first.identity, second.identity
    drawn = a.synthetic and abouts[0].get("seed") != abouts[1].get("seed")
    same = a.name == b.name and a.calibration == b.calibration and a.force_calibration == b.force_calibration
    if same and not drawn:
        return 0.0
    gains = []
    for identity in (a, b):
        span = identity.limits.get("force_n")
        reach = max(abs(v) for v in span) if span else float("nan")
        if identity.force_calibration is not None:
            gains.append(identity.force_calibration.u_gain)
            continue
        gains.append(identity.accuracy.get("force_n", 0.0) / reach if np.isfinite(reach) and reach > 0 else 0.0)
    return float(np.hypot(*gains) / np.sqrt(2.0))


# --- tests ---------------------------------------------------------------------------------------------------------


def _curve_tests(
    first: CampaignCharacteristics, second: CampaignCharacteristics, curves: CurveComparison
) -> Iterator[Test]:
    mean_n = float(curves.friction_n.mean())
    limits = [REPEATABILITY_FACTOR * s for s in (_within(first), _within(second)) if np.isfinite(s)]
    beyond = abs(curves.mean.value) * mean_n > max(limits) if len(limits) == 2 else None
    note = f"mean of {curves.points.speed_m_s.size} common points, {100 * curves.mean.value:+.2g} % of friction"
    yield Test(
        "friction over speed", curves.mean.scaled(mean_n, "N"), curves.shape.p, beyond_repeatability=beyond, note=note
    )
    if curves.pressure is not None:
        note = "how much friction grows with pressure, relative to friction"
        yield Test("effect of pressure", None, curves.pressure.p, note=note)


def _within(found: CampaignCharacteristics) -> float:
    r = found.repeatability
    return r.within.value if r is not None and r.within is not None else float("nan")


def _pairs(
    first: CampaignCharacteristics, second: CampaignCharacteristics
) -> Iterator[tuple[DwellSeries, DwellSeries]]:
    """Series of stops with one restart speed and way of holding in each campaign."""
    for a in first.dwell:
        for b in second.dwell:
            same = a.released == b.released and abs(a.speed_m_s - b.speed_m_s) < 0.01 * a.speed_m_s
            fits = a.levels == b.levels or (len(_levels(first)) == 1 and len(_levels(second)) == 1)
            if same and fits and a.curve is not None and b.curve is not None and _common(a, b):
                yield a, b


def _levels(found: CampaignCharacteristics) -> set[str]:
    return {series.levels for series in found.dwell}


def _common(a: DwellSeries, b: DwellSeries) -> list[tuple[int, int]]:
    """Conditions of both series with the same pressures."""
    out = []
    for i, p in enumerate(a.conditions):
        for j, q in enumerate(b.conditions):
            near = abs(p.pressure_a_pa - q.pressure_a_pa) < SAME_PRESSURE_PA
            if near and abs(p.pressure_b_pa - q.pressure_b_pa) < SAME_PRESSURE_PA:
                out.append((i, j))
    return out


def _dwell_tests(a: DwellSeries, b: DwellSeries) -> Iterator[Test]:
    common = _common(a, b)
    low = max(min(s.dwell_s for s in series.stops) for series in (a, b))
    high = min(max(s.dwell_s for s in series.stops) for series in (a, b))
    if not high > low:
        return
    at = a.reference_s if low < a.reference_s < high else float(np.sqrt(low * high))
    slopes, levels = [], []
    for series, of in ((a, [i for i, _ in common]), (b, [j for _, j in common])):
        assert series.curve is not None
        row = np.zeros((1, len(series.conditions)))
        row[0, of] = 1.0 / len(of)
        slopes.append(series.curve.gains(float(np.log10(low)), float(np.log10(high))).combine(row).estimates()[0])
        levels.append(series.curve.values(np.log10([at])).combine(row).estimates()[0])
    where = f"{a.name}, at {at:.3g} s"
    level = levels[1] - levels[0]
    limits = [REPEATABILITY_FACTOR * s.scatter_n for s in (a, b)]
    beyond = abs(level.value) > max(limits)
    yield Test("breakaway after a stop", level, level.p, beyond_repeatability=beyond, note=where)
    slope = slopes[1] - slopes[0]
    span = f"{a.name}, mean from {low:.3g} to {high:.3g} s"
    yield Test("slope of breakaway per decade of stop", slope, slope.p, note=span)


def _drift_test(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Test | None:
    rates = [found.drift.per_hour if found.drift is not None else None for found in (first, second)]
    if rates[0] is None or rates[1] is None:
        return None
    difference = rates[1] - rates[0]
    return Test("drift over time", difference, difference.p, note="of friction, linear in time")


def _repeatability_test(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Test | None:
    """Compare the scatter of repeated cycles by an F test; None where a campaign repeats nothing.

    What cycles leave of a smooth curve is no scatter alone: no test is made of that.
    """
    from scipy.special import fdtr, fdtrc, fdtri

    both = [found.repeatability for found in (first, second)]
    a, b = (r.within if r is not None and r.basis != "smooth curve" else None for r in both)
    if a is None or b is None or not (a.value > 0 and b.value > 0):
        return None
    free = b.degrees_of_freedom, a.degrees_of_freedom
    ratio = (b.value / a.value) ** 2
    p = min(1.0, 2.0 * min(float(fdtr(*free, ratio)), float(fdtrc(*free, ratio))))
    low, high = (float(np.sqrt(ratio / fdtri(*free, share))) for share in (0.975, 0.025))
    value = float(np.sqrt(ratio))
    error = value * float(np.sqrt(0.5 / free[0] + 0.5 / free[1]))
    estimate = Estimate(value, low, high, error, "", min(free), p)
    return Test("repeatability of a cycle", estimate, p, note="ratio of the standard deviations, second over first")


def _adjusted(tests: list[Test]) -> list[Test]:
    known = [i for i, test in enumerate(tests) if np.isfinite(test.p)]
    adjusted = holm(np.array([tests[i].p for i in known]))
    out = list(tests)
    for i, p in zip(known, adjusted, strict=True):
        out[i] = replace(tests[i], adjusted_p=float(p), different=bool(p < CHANCE))
    return out


# --- what it comes to ------------------------------------------------------------------------------------------------


def _statements(
    first: CampaignCharacteristics,
    second: CampaignCharacteristics,
    checks: tuple[Check, ...],
    tests: list[Test],
    curves: CurveComparison | str,
    pairs: tuple[tuple[DwellSeries, DwellSeries], ...],
) -> Iterator[Statement]:
    for check in checks:
        if not check.comparable:
            yield say("data.rigs_differ", what=capitalised(check.what), check=check)
    if isinstance(curves, str):
        yield say("curve.not_comparable", why=curves)
    else:
        size, left = curves.points.speed_m_s.size, curves.points.left_out
        if left:
            yield say("curve.thinned", all=size + left, compared=size)
        if not curves.several_blocks:
            yield say("repeatability.not_in_tests")
    if (first.dwell or second.dwell) and not pairs:
        yield say("stops.not_comparable")
    for test in tests:
        if test.different and test.beyond_repeatability is False:
            yield say("repeatability.small_difference", what=capitalised(test.what))
    mean = next((t.difference for t in tests if t.what == "friction over speed" and t.different), None)
    for found in (first, second):
        moved = float(np.ptp(found.drift.drift_n)) if found.drift is not None else 0.0
        if mean is not None and moved > abs(mean.value):
            yield say("drift.more_than_difference", name=found.name, moved=moved)
