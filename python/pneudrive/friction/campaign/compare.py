"""Comparison of two campaigns, such as new and worn, two seals, before and after lubrication.

First, the properties of rig and protocol in checks.toml are checked for comparability. Friction over speed is then
compared cycle by cycle in one model:

  log F = point + campaign (level + slope u + bend u^2 + pressures) + block + drift + cycle,   u = log10 speed

A point is a speed and a pair of pressures measured in both campaigns. The scatter of cycles may differ between
campaigns. Each compared property is one statistical test. Holm's correction [holm1979] keeps the probability of a false
difference at 5 % for all tests together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.storage.folder import Campaign
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.describe.files.toml import read
from pneudrive.errors import CampaignError
from pneudrive.estimate.autocorrelation import cells, centred_walk, levels
from pneudrive.estimate.estimates import CHANCE, Estimate, FTest, one_thread
from pneudrive.estimate.mixed import MixedModel, RandomEffect, independent
from pneudrive.friction.campaign.cycles import stated_gain
from pneudrive.friction.campaign.points import MOST_CELLS, MOST_CYCLES, grouped, shares_of
from pneudrive.friction.friction_map import LEVELS, PA_PER_BAR
from pneudrive.friction.sentences import Statement, say
from pneudrive.lazy_names import upper
from pneudrive.views import View, Viewed

if TYPE_CHECKING:
    from collections.abc import Iterator

    import polars as pl
    from numpy.typing import NDArray

    from pneudrive.arrays import Array, Row
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries

    Both = tuple[CampaignCharacteristics, CampaignCharacteristics]


TABLE = Path(__file__).with_name("checks.toml")


@dataclass(frozen=True)
class Check:
    """A property of rig or protocol that both campaigns should share.

    Attributes
    ----------
    what, first, second : str
    comparable : bool
    consequence : str
        Consequence of a difference.
    """

    what: str
    first: str
    second: str
    comparable: bool
    consequence: str = ""


def checks_of(both: Both, abouts: list[Row]) -> Iterator[Check]:
    """Compare rigs and protocols of two campaigns; values that were not measured are left out."""
    computed = list(map(_shared, both, abouts))
    for what, row in read(TABLE)[0].items():
        ends = zip(both, computed, strict=True)
        a, b = (attrgetter(row["of"])(found) if "of" in row else own[what] for found, own in ends)
        same = a == b
        if isinstance(a, float) and isinstance(b, float):
            if not np.isfinite([a, b]).all():
                continue
            same = abs(a - b) <= max(row.get("share", 0.0) * max(abs(a), abs(b)), row.get("by", 0.0))
        shown, other_shown = ("not stated" if v is None else row.get("written", "{}").format(v) for v in (a, b))
        yield Check(what, shown, other_shown, same, row["consequence"])


def _shared(found: CampaignCharacteristics, about: Row) -> dict[str, str | float | None]:
    """Return the compared values; NaN if not measured."""
    rig, stated = found.identity, about.get("filter")
    rates = found.stops["sample_rate_hz"].to_numpy() if len(found.stops) else np.zeros(0)
    rates = rates[np.isfinite(rates)]
    average = stated.get("average", 1) if isinstance(stated, dict) else 1
    return {
        "data": "simulated" if rig.synthetic else "real",
        "stiffness": rig.stiffness_n_m or None,
        "area a": 1e4 * rig.area_a_m2,
        "area b": 1e4 * rig.area_b_m2,
        "ambient pressure": rig.ambient_pressure_pa / PA_PER_BAR,
        "filter": "none" if average == 1 else f"moving average of {average}",
        "temperature": sum(found.ranges.temperature_k) / 2.0 - ZERO_CELSIUS_K,
        "samples at restarts": float(np.median(rates)) if rates.size else np.nan,
    }


SAME_SPEED = 0.03
SAME_PRESSURE_PA = 2000.0  # planned pressures that differ by less are one point
FEWEST_CYCLES = 6  # of both campaigns at common points
BEND_SPEEDS = 4  # least number of speeds for a bend over speed
DRIFT_CYCLES = 8  # least number of cycles of a campaign for a drift
USUAL = 0.02  # relative scatter that is usual
MOST_POINTS = 300  # points that are tested: more are thinned evenly
KINDS = ("sweep", "sentinel")
KEY = ("title", "gauge_a_pa", "gauge_b_pa", "speed_m_s")  # what a point is, apart from tolerances


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Cycles of both campaigns at common points.

    Attributes
    ----------
    cycles : polars.DataFrame
        A row for each cycle; in large campaigns, for neighbouring repeats at one point. Columns: ``campaign`` (0 or 1),
        ``point``, ``log_n`` (logarithm of friction), ``noise`` (its variance), ``count`` (cycles of the row), ``order``
        (relative position in the campaign, 0 to 1).
    block : ndarray, shape (rows, blocks)
        Fraction of the cycles of a row that belong to each block of both campaigns.
    points : polars.DataFrame
        A row for each point: `KEY`. The title names mounting, seal and drive.
    left_out : int
        Number of further common points.
    """

    cycles: pl.DataFrame
    block: Array
    points: pl.DataFrame
    left_out: int

    def __getitem__(self, name: str) -> NDArray:
        """Return a column of the cycles."""
        return self.cycles[name].to_numpy()

    @property
    def blocks(self) -> list[int]:
        """Number of blocks of each campaign."""
        return [int((self.block[self["campaign"] == k] > 0.0).any(axis=0).sum()) for k in (0, 1)]

    @property
    def several_blocks(self) -> bool:
        """Whether both campaigns have more than one block: the tests then include differences of blocks."""
        return min(self.blocks) > 1


@dataclass(frozen=True, eq=False)
class CurveComparison(CommonPoints):
    """Difference of friction: second campaign minus first.

    Further columns of ``points`` are ``first_n``, ``second_n`` and ``corrected_p``. The first two are the mean of each
    campaign. The third is the probability of the difference after Holm's correction for the number of points
    [holm1979].

    Attributes
    ----------
    difference : tuple of Estimate
        Relative difference of friction at each common point.
    mean : Estimate
        Mean difference over the common points, relative.
    shape : FTest
        Probability for the difference over all speeds: level, slope and bend together.
    pressure : FTest or None
        Probability for a difference in the effect of pressure.
    """

    difference: tuple[Estimate, ...]
    mean: Estimate
    shape: FTest
    pressure: FTest | None

    @property
    def friction_n(self) -> Array:
        """Mean of each campaign at the points, shape (2, m)."""
        return self.points.select("first_n", "second_n").to_numpy().T


def compare_curves(
    first: CampaignCharacteristics, second: CampaignCharacteristics, gain: float = 0.0
) -> CurveComparison | str:
    """Test the curves of two campaigns against each other.

    Parameters
    ----------
    first, second : CampaignCharacteristics
    gain : float
        Relative standard uncertainty of the ratio of both force sensors' gains; 0 for the same sensor.

    Returns
    -------
    CurveComparison or str
        A string gives the reason if they cannot be compared.
    """
    common = common_points(first, second)
    point, campaign, count = (common[name] for name in ("point", "campaign", "count"))
    m = common.points.height
    if not m:
        return "no speed at the same pressures was run in both campaigns"
    cycles = [count[campaign == k].sum() for k in (0, 1)]
    if min(cycles) < FEWEST_CYCLES // 2 or sum(cycles) < FEWEST_CYCLES:
        return "too few cycles at common speeds and pressures"
    u, u_log = np.sqrt(2.0) * gain, np.log10(common.points["speed_m_s"].to_numpy())
    sign = (campaign.astype(float) - 0.5)[:, None]
    dummies = np.eye(m)[point]
    away = u_log - u_log.mean()
    speeds, bar = np.unique(np.round(away, 2)).size, common.points.select(KEY[1:3]).to_numpy(order="c") / 1e5
    # Level, slope and bend over log speed; pressures of both chambers, or their sum if they are always equal.
    shape = np.column_stack([np.ones(m), away, away**2 - np.mean(away**2)])
    shape = shape[:, : 1 + (speeds > 1) + (speeds >= BEND_SPEEDS)]
    always_equal = np.allclose(bar[:, 0], bar[:, 1], atol=0.02)
    pressure = (bar - bar.mean(axis=0))[:, : 1 if always_equal else 2]
    x = np.c_[dummies, shape[point] * sign, pressure[point] * sign]
    kept = independent(x)
    rows = np.eye(x.shape[1])[:, kept]
    of_shape, of_pressure = kept[(kept >= m) & (kept < m + shape.shape[1])], kept[kept >= m + shape.shape[1]]
    cell = m * campaign + point
    total, number = (np.bincount(cell, count * v, 2 * m) for v in (common["log_n"], np.ones(cell.size)))
    means = np.exp(total / number).reshape(2, m)
    with one_thread():
        fit, each = (_model(common, columns).fit() for columns in (x[:, kept], np.c_[dummies, dummies * sign]))
        difference = tuple(each.contrast(row, unit="").widened(u) for row in np.eye(2 * m)[m:])
        p = holm(np.array([e.p for e in difference]))
        points = common.points.with_columns(first_n=means[0], second_n=means[1], corrected_p=p)
        return CurveComparison(
            **vars(replace(common, points=points)),
            difference=difference,
            mean=fit.contrast(rows[m], unit="").widened(u),
            shape=fit.f_test(rows[of_shape], u**2),
            pressure=fit.f_test(rows[of_pressure]) if of_pressure.size else None,
        )


def _model(common: CommonPoints, x: Array) -> MixedModel:
    components = []
    for k in (0, 1):
        own = (common["campaign"] == k).astype(float)
        components.append(RandomEffect(f"cycle {k + 1}", own / common["count"], USUAL))
        if own.sum() >= DRIFT_CYCLES:
            kernel, members = np.zeros((own.size, own.size)), np.flatnonzero(own)
            kernel[np.ix_(members, members)] = centred_walk(common["order"][members])
            components.append(RandomEffect(f"drift {k + 1}", kernel, USUAL))
    if max(common.blocks) > 1:
        components.append(RandomEffect("block", common.block @ common.block.T, USUAL))
    return MixedModel(common["log_n"], x, common["noise"], tuple(components))


def holm(p: Array) -> Array:
    """Correct probabilities for their number (Holm) [holm1979].

    Examples
    --------
    >>> holm(np.array([0.01, 0.04, 0.03])).tolist()
    [0.03, 0.06, 0.06]
    """
    order = np.argsort(p)
    steps = np.maximum.accumulate(p[order] * (p.size - np.arange(p.size)))
    out = np.empty(p.size)
    out[order] = np.minimum(steps, 1.0)
    return out


def common_points(first: CampaignCharacteristics, second: CampaignCharacteristics) -> CommonPoints:
    """Collect the cycles at speeds and pressures that both campaigns have."""
    import polars as pl

    parts = [_usable(found, k) for k, found in enumerate((first, second))]
    titles = [set(part["title"]) for part in parts]
    cycles = pl.concat(parts)
    if not titles[0] & titles[1] or max(map(len, titles)) == 1:  # levels in common are no question
        cycles = cycles.with_columns(title=pl.lit(""))
    place = np.zeros(0, dtype=np.int64)
    if cycles.height:  # equal numbers for cycles at the same levels, pressures and speed
        near = (levels(cycles[side].to_numpy(), SAME_PRESSURE_PA) for side in ("gauge_a_pa", "gauge_b_pa"))
        speeds = levels(np.log(cycles["speed_m_s"].to_numpy()), np.log1p(SAME_SPEED))
        place = cells(np.unique(cycles["title"].to_list(), return_inverse=True)[1], *near, speeds)
    cycles = cycles.with_columns(place=pl.Series(place, dtype=pl.Int64))
    of_point = cycles.group_by("place", maintain_order=True).agg(pl.col(KEY).first(), pl.col("campaign").n_unique())
    common = of_point.filter(campaign=2).drop("campaign").sort(KEY)
    chosen = np.linspace(0, common.height - 1, min(common.height, MOST_POINTS)).round().astype(int)
    points = common[chosen].with_row_index("point")
    cycles = cycles.join(points.select("place", "point"), on="place", maintain_order="left")
    campaign, point = (cycles[name].to_numpy().astype(np.int64) for name in ("campaign", "point"))
    blocks = cycles.select(pl.struct("campaign", "block").rank("dense")).to_series().to_numpy().astype(np.int64)
    groups = [[i] for i in range(cycles.height)]
    if cycles.height > MOST_CELLS:  # a row for several neighbouring repeats at one point
        begin = np.array([blocks[campaign == k].min() for k in (0, 1)])
        where = (2 * point + campaign, blocks - begin[campaign], np.zeros_like(point))
        groups = grouped(*where, rows=MOST_CYCLES, most=MOST_CELLS)[0]
    heads, count = [group[0] for group in groups], np.array([len(group) for group in groups], dtype=float)
    friction, stderr = cycles["friction_n"].to_numpy(), cycles["stderr_n"].to_numpy()

    def mean(values: Array) -> Array:
        return np.array([np.mean(values[group]) for group in groups], dtype=float)

    rows = {
        "campaign": campaign[heads],
        "point": point[heads],
        "log_n": mean(np.log(friction)),
        "noise": mean((stderr / friction) ** 2) / count,
        "count": count,
        "order": mean(cycles["order"].to_numpy()),
    }
    shares = shares_of([blocks[group].tolist() for group in groups])
    return CommonPoints(pl.DataFrame(rows), shares, points.select(KEY), common.height - points.height)


def _usable(found: CampaignCharacteristics, campaign: int) -> pl.DataFrame:
    """Return the cycles for F(v): positive friction, both directions, not excluded from the curves."""
    import polars as pl

    reasons, ambient = {p.reason for c in found.curves for p in c.excluded}, found.identity.ambient_pressure_pa
    finite = pl.col("friction_n", "stderr_n").is_finite()
    cycles = found.cycles.filter(pl.col("kind").is_in(KINDS), pl.col("friction_n") > 0.0, finite)
    cycles = cycles.filter([not reasons.intersection(flags) for flags in cycles["flags"].to_list()])
    sides = {f"gauge_{side}_pa": [round(p - ambient, -2) for p in cycles[f"pressure_{side}_pa"]] for side in "ab"}
    titles = [", ".join(filter(None, row)) for row in cycles.select(LEVELS).iter_rows()]
    return cycles.with_columns(
        campaign=pl.lit(campaign, pl.Int64),
        title=pl.Series(titles, dtype=pl.String),
        order=pl.Series(cycles["index"].to_numpy() / (cycles["index"].max() or 1), dtype=pl.Float64),
        **{name: pl.Series(values, dtype=pl.Float64) for name, values in sides.items()},
    )


@dataclass(frozen=True)
class Test:
    """Statistical test of one property.

    Attributes
    ----------
    what : str
    difference : Estimate or None
        Second minus first; None if the test has several parts.
    p : float
        Probability of such a large difference by chance. NaN without a test.
    adjusted_p : float
        After Holm's correction for the number of tests.
    different : bool
    note : str
    """

    what: str
    difference: Estimate | None
    p: float
    adjusted_p: float = np.nan
    different: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Viewed):
    """Two campaigns, compared.

    Attributes
    ----------
    first, second : CampaignCharacteristics
    checks : tuple of Check
    tests : tuple of Test
    curves : CurveComparison or None
    dwell : tuple of (DwellSeries, DwellSeries)
        Series that were compared.
    statements : tuple of Statement
    """

    first: CampaignCharacteristics
    second: CampaignCharacteristics
    checks: tuple[Check, ...]
    tests: tuple[Test, ...]
    curves: CurveComparison | None
    dwell: tuple[tuple[DwellSeries, DwellSeries], ...]
    statements: tuple[Statement, ...] = ()

    @property
    def different(self) -> bool:
        """Whether any test is different."""
        return any(test.different for test in self.tests)

    def view(self) -> View:
        """Return a row for each test, cautions, and the figures of both campaigns."""
        return upper("comparison_view")(self)

    def __str__(self) -> str:
        """Return the result in a sentence."""
        if not self.tests:
            return "Nothing can be compared."
        if not self.different:
            count = f"{len(self.tests)} test{'s' if len(self.tests) > 1 else ''}"
            return f"No difference is shown in {count}: the campaigns may be equal, or too short."
        what = ", ".join(dict.fromkeys(test.what for test in self.tests if test.different))
        text = f"The campaigns differ by more than their cycles scatter: {what}."
        if self.curves is not None and not self.curves.several_blocks:
            text += " With a single block in a campaign this may be the mounting or the day."
        return text


def compare_campaigns(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Comparison:
    """Compare two campaigns.

    Parameters
    ----------
    first, second : CampaignCharacteristics
        Results of `pneudrive.campaign_friction`. Differences are second minus first.

    Returns
    -------
    Comparison
    """
    both, abouts = (first, second), [about_of(found) for found in (first, second)]
    found, pairs = compare_curves(*both, _gain(both, abouts)), tuple(_pairs(both))
    why, curves = (found, None) if isinstance(found, str) else ("", found)
    tests = [
        *(() if curves is None else _curve_tests(curves)),
        *(test for pair in pairs for test in _dwell_tests(*pair)),
        *_drift_test(both),
    ]
    known = [i for i, test in enumerate(tests) if np.isfinite(test.p)]
    for i, p in zip(known, holm(np.array([tests[i].p for i in known])).tolist(), strict=True):
        tests[i] = replace(tests[i], adjusted_p=p, different=p < CHANCE)
    compared = Comparison(first, second, tuple(checks_of(both, abouts)), tuple(tests), curves, pairs)
    return replace(compared, statements=tuple(_statements(compared, why)))


def about_of(found: CampaignCharacteristics) -> Row:
    """Return ``campaign.json`` of a campaign; empty if the folder cannot be opened."""
    try:
        return Campaign.open(found.folder).about
    except CampaignError:
        return {}


def _gain(both: Both, abouts: list[Row]) -> float:
    """Return the relative uncertainty of the ratio of both force sensors' gains; 0 for the same sensor.

    Simulated sensors differ between seeds.
    """
    a, b = (found.identity for found in both)
    drawn = a.synthetic and abouts[0].get("seed") != abouts[1].get("seed")
    same = a.name == b.name and a.calibration == b.calibration and a.force_calibration == b.force_calibration
    if same and not drawn:
        return 0.0
    return float(np.hypot(stated_gain(a) or 0.0, stated_gain(b) or 0.0) / np.sqrt(2.0))


# --- tests ---------------------------------------------------------------------------------------------------------


def _curve_tests(curves: CurveComparison) -> Iterator[Test]:
    mean = curves.mean.scaled(float(curves.friction_n.mean()), "N")
    note = f"mean of {curves.points.height} common points, {100 * curves.mean.value:+.2g} % of friction"
    yield Test("friction over speed", mean, curves.shape.p, note=note)
    if curves.pressure is not None:
        note = "growth of friction with pressure, as a fraction of friction"
        yield Test("relative effect of pressure", None, curves.pressure.p, note=note)


def _pairs(both: Both) -> Iterator[tuple[DwellSeries, DwellSeries]]:
    """Return the pairs of stop series with the same restart speed and kind of hold in both campaigns."""
    single = all(len({series.levels for series in found.dwell}) == 1 for found in both)
    for a, b in product(*(found.dwell for found in both)):
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
    low = max(float(np.min(series.stops["dwell_s"].to_numpy())) for series in (a, b))
    high = min(float(np.max(series.stops["dwell_s"].to_numpy())) for series in (a, b))
    if not high > low:
        return
    at = a.reference_s if low < a.reference_s < high else float(np.sqrt(low * high))
    slopes, levels = [], []
    for series, of in zip((a, b), zip(*_common(a, b), strict=True), strict=True):
        assert series.curve is not None
        row = np.zeros((1, len(series.conditions)))
        row[0, list(of)] = 1.0 / len(of)
        slopes.append(series.curve.gains(np.log10(low), np.log10(high)).combine(row).estimates()[0])
        levels.append(series.curve.values(np.log10([at])).combine(row).estimates()[0])
    level, slope = levels[1] - levels[0], slopes[1] - slopes[0]
    where, span = f"{a.name}, at {at:.3g} s", f"{a.name}, mean from {low:.3g} to {high:.3g} s"
    yield Test("breakaway after a stop", level, level.p, note=where)
    yield Test("slope of breakaway per decade of stop", slope, slope.p, note=span)


def _drift_test(both: Both) -> Iterator[Test]:
    before, after = (found.drift.per_hour if found.drift is not None else None for found in both)
    if before is not None and after is not None:
        difference = after - before
        yield Test("drift over time", difference, difference.p, note="change of friction, linear in time")


def _statements(found: Comparison, not_comparable: str) -> Iterator[Statement]:
    """Return cautions on the tests. `not_comparable` is the reason for missing curves."""
    for check in found.checks:
        if not check.comparable:
            yield say("data.rigs_differ", what=check.what[:1].upper() + check.what[1:], check=check)
    if found.curves is None:
        yield say("curve.not_comparable", why=not_comparable)
    else:
        size, left = found.curves.points.height, found.curves.left_out
        if left:
            yield say("curve.thinned", all=size + left, compared=size)
        if not found.curves.several_blocks:
            yield say("repeatability.not_in_tests")
    if (found.first.dwell or found.second.dwell) and not found.dwell:
        yield say("stops.not_comparable")
