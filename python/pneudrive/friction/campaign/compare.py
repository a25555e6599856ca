"""Comparison of two campaigns, such as new and worn, two seals, before and after lubrication.

First, the properties of rig and protocol in checks.toml are checked for comparability. Friction over speed is then
compared cycle by cycle in one model:

  log F = point + campaign (level + slope u + bend u^2 + pressures) + block + drift + cycle,   u = log10 speed

A point is a speed and a pair of pressures measured in both campaigns. The scatter of cycles may differ between
campaigns. Each compared property is one statistical test. Holm's correction [holm1979] keeps the probability of a false
difference at 5 % for all tests together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import isclose
from operator import attrgetter
from pathlib import Path

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Ints, Row
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import package_table
from pneudrive.estimate.autocorrelation import cells, centred_walk, levels
from pneudrive.estimate.estimates import CHANCE, Estimate, FTest, one_thread
from pneudrive.estimate.mixed import MixedModel, RandomEffect, independent
from pneudrive.friction.campaign.points import MOST_CELLS, MOST_CYCLES, grouped, shares_of
from pneudrive.friction.campaign.reading import stated_gain
from pneudrive.friction.campaign.result import CampaignCharacteristics, write_tables
from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
from pneudrive.friction.friction_map import LEVELS, PA_PER_BAR
from pneudrive.friction.sentences import Statement, say
from pneudrive.lazy_names import upper
from pneudrive.views import View, Viewed


@dataclass(frozen=True)
class Check:
    """A property of rig or protocol that should be equal in both campaigns.

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


Both = tuple[CampaignCharacteristics, CampaignCharacteristics]
Pairs = tuple[tuple[DwellSeries, DwellSeries], ...]


def _checks(both: Both) -> Iterator[Check]:
    """Compare rigs and protocols of two campaigns; values that were not measured (NaN) are left out."""
    derived: list[dict[str, str | float | None]] = []
    for found in both:
        rig, stated = found.identity, found.about.get("filter")
        rates = found.stops["sample_rate_hz"].to_numpy() if len(found.stops) else np.zeros(0)
        rates = rates[np.isfinite(rates)]
        average = stated.get("average", 1) if isinstance(stated, dict) else 1
        derived.append(
            {
                "data": "simulated" if rig.synthetic else "real",
                "stiffness": rig.stiffness_n_m or None,
                "area a": 1e4 * rig.area_a_m2,
                "area b": 1e4 * rig.area_b_m2,
                "ambient pressure": rig.ambient_pressure_pa / PA_PER_BAR,
                "filter": "none" if average == 1 else f"moving average of {average}",
                "temperature": sum(found.ranges.temperature_k) / 2.0 - ZERO_CELSIUS_K,
                "samples at restarts": np.median(rates) if rates.size else np.nan,
            }
        )
    for what, row in package_table(__file__, "checks.toml").items():
        values = [attrgetter(row["of"])(found) for found in both] if "of" in row else [of[what] for of in derived]
        a, b = values
        same = a == b
        if isinstance(a, float) and isinstance(b, float):
            if not np.isfinite([a, b]).all():
                continue
            same = isclose(a, b, rel_tol=row.get("share", 0.0), abs_tol=row.get("by", 0.0))
        shown, other_shown = ("not stated" if v is None else row.get("written", "{}").format(v) for v in (a, b))
        yield Check(what, shown, other_shown, same, row["consequence"])


SAME_SPEED = 0.03
SAME_PRESSURE_PA = 2000.0  # planned pressures that differ by less are one point
FEWEST_CYCLES = 6  # of both campaigns at common points
BEND_SPEEDS = 4  # least number of speeds for a bend over speed
DRIFT_CYCLES = 8  # least number of cycles of a campaign for a drift
USUAL = 0.02  # relative scatter that is usual
MOST_POINTS = 300  # points that are tested: more are thinned evenly
KEY = ("title", "gauge_a_pa", "gauge_b_pa", "speed_m_s")  # what a point is, apart from tolerances


@dataclass(frozen=True, eq=False)
class CurveComparison:
    """Difference of friction at common points: second campaign minus first.

    Attributes
    ----------
    cycles : polars.DataFrame
        A row for each cycle at common points. In large campaigns, neighbouring repeats at one point share a row.
        Columns: ``campaign`` (0 or 1), ``point``, ``log_n`` (logarithm of friction), ``noise`` (its variance),
        ``count`` (cycles of the row), ``order`` (relative position in the campaign, 0 to 1).
    points : polars.DataFrame
        A row for each point: `KEY`, ``first_n``, ``second_n`` and ``corrected_p``. The title names mounting, seal and
        drive. Forces are the means of each campaign. ``corrected_p`` is the probability of the difference after Holm's
        correction for the number of points [holm1979].
    left_out : int
        Number of common points that were not tested.
    several_blocks : bool
        Whether both campaigns have more than one block. The tests then include differences between blocks.
    difference : tuple of Estimate
        Relative difference of friction at each common point.
    mean : Estimate
        Relative mean difference over the common points.
    shape : FTest
        Test of the difference over all speeds: level, slope and bend together.
    pressure : FTest or None
        Test of the difference in the effect of pressure.
    """

    cycles: pl.DataFrame
    points: pl.DataFrame
    left_out: int
    several_blocks: bool
    difference: tuple[Estimate, ...]
    mean: Estimate
    shape: FTest
    pressure: FTest | None

    @property
    def friction_n(self) -> Array:
        """Mean friction of each campaign at the points, in N (shape (2, m))."""
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
        A text with the reason if the curves cannot be compared.
    """
    cycles, points, left_out = _common_points((first, second))
    m, parts = points.height, cycles.partition_by("campaign")
    if not m:
        return "no speed was measured at the same pressures in both campaigns"
    if min(part.height for part in parts) < FEWEST_CYCLES // 2 or cycles.height < FEWEST_CYCLES:
        return "too few cycles at common speeds and pressures"
    table, blocks = _condensed(cycles)
    names = ("point", "campaign", "count", "log_n", "noise")
    point, campaign, count, log_n, noise = (table[name].to_numpy() for name in names)
    u, u_log = np.sqrt(2.0) * gain, np.log10(points["speed_m_s"].to_numpy())
    sign = (campaign - 0.5)[:, None]
    dummies = np.eye(m)[point]
    away = u_log - u_log.mean()
    speeds = np.unique(np.round(away, 2)).size
    bar = points.select(KEY[1:3]).to_numpy(order="c") / 1e5
    # Level, slope and bend over log speed; pressures of both chambers, or their sum if they are always equal.
    shape = np.column_stack([np.ones(m), away, away**2 - np.mean(away**2)])
    shape = shape[:, : 1 + (speeds > 1) + (speeds >= BEND_SPEEDS)]
    always_equal = np.allclose(bar[:, 0], bar[:, 1], atol=0.02)
    pressure = (bar - bar.mean(axis=0))[:, : 1 if always_equal else 2]
    x = np.c_[dummies, shape[point] * sign, pressure[point] * sign]
    kept = independent(x)
    rows, of_pressure = np.eye(kept.size), kept >= m + shape.shape[1]
    cell = m * campaign + point
    sums, counts = (np.bincount(cell, weight, 2 * m) for weight in (count * log_n, count))
    means = np.exp(sums / counts).reshape(2, m)
    with one_thread():
        model = MixedModel(log_n, x[:, kept], noise, tuple(_scatter(table, blocks)))
        fit = model.fit()
        each = replace(model, x=np.c_[dummies, dummies * sign]).fit()
        difference = tuple(each.contrast(row, unit="").widened(u) for row in np.eye(2 * m)[m:])
        p = holm(np.array([e.p for e in difference]))
        return CurveComparison(
            cycles=table,
            points=points.with_columns(first_n=means[0], second_n=means[1], corrected_p=p),
            left_out=left_out,
            several_blocks=min(part["block"].n_unique() for part in parts) > 1,
            difference=difference,
            mean=fit.contrast(rows[m], unit="").widened(u),
            shape=fit.f_test(rows[(kept >= m) & ~of_pressure], u**2),
            pressure=fit.f_test(rows[of_pressure]) if of_pressure.any() else None,
        )


def _scatter(table: pl.DataFrame, blocks: Array) -> Iterator[RandomEffect]:
    """Yield the random effects of the table: scatter of cycles and drift in each campaign, and scatter of blocks."""
    campaign, count, order = (table[name].to_numpy() for name in ("campaign", "count", "order"))
    for k in (0, 1):
        yield RandomEffect(f"cycle {k + 1}", np.diag((campaign == k) / count), USUAL)
        members = np.flatnonzero(campaign == k)
        if members.size >= DRIFT_CYCLES:
            kernel = np.zeros((campaign.size, campaign.size))
            kernel[np.ix_(members, members)] = centred_walk(order[members])
            yield RandomEffect(f"drift {k + 1}", kernel, USUAL)
    if blocks.shape[1] > 2:  # at least one campaign has several
        yield RandomEffect("block", blocks @ blocks.T, USUAL)


def holm(p: Array) -> Array:
    """Correct p-values for the number of tests by Holm's method [holm1979]. NaN, without a test, stays NaN.

    Examples
    --------
    >>> holm(np.array([0.01, 0.04, 0.03])).tolist()
    [0.03, 0.06, 0.06]
    """
    order = np.argsort(p)
    steps = np.maximum.accumulate(p[order] * (np.isfinite(p).sum() - np.arange(p.size)))
    return np.minimum(steps, 1.0)[np.argsort(order)]


def _common_points(both: Both) -> tuple[pl.DataFrame, pl.DataFrame, int]:
    """Return the cycles at points that both campaigns have, these points, and the number of points left out."""
    cycles = pl.concat([_usable(found, k) for k, found in enumerate(both)])
    titles = [set(cycles.filter(campaign=k)["title"]) for k in (0, 1)]
    if not titles[0] & titles[1] or max(map(len, titles)) == 1:  # levels in common are no question
        cycles = cycles.with_columns(title=pl.lit(""))
    # Equal numbers for cycles at the same levels, pressures and speed.
    near = (levels(cycles[side].to_numpy(), SAME_PRESSURE_PA) for side in KEY[1:3])
    speeds = levels(np.log(cycles["speed_m_s"].to_numpy()), np.log1p(SAME_SPEED))
    place = cells(np.unique(cycles["title"], return_inverse=True)[1], *near, speeds)
    cycles = cycles.with_columns(place=pl.Series(place, dtype=pl.Int64))
    cycles = cycles.filter(pl.col("campaign").n_unique().over("place") == 2)
    common = cycles.group_by("place", maintain_order=True).agg(pl.col(KEY).first()).sort(KEY)
    chosen = np.linspace(0, common.height - 1, min(common.height, MOST_POINTS)).round().astype(int)
    points = common[chosen].with_row_index("point")
    cycles = cycles.join(points.select("place", "point"), on="place", maintain_order="left")
    return cycles, points.select(KEY), common.height - points.height


def _condensed(cycles: pl.DataFrame) -> tuple[pl.DataFrame, Array]:
    """Return `CurveComparison.cycles`, and for each row the fraction of its cycles in each block."""
    campaign, point = (cycles[name].to_numpy().astype(np.int64) for name in ("campaign", "point"))
    block = cells(campaign, cycles["block"].to_numpy())
    stretch = block - campaign * block[campaign == 1].min()  # from 0 in each campaign
    rows = MOST_CYCLES if cycles.height > MOST_CELLS else cycles.height
    groups = grouped(2 * point + campaign, stretch, rows, MOST_CELLS)
    heads = [group[0] for group in groups]
    count = np.array([len(group) for group in groups], dtype=float)
    friction, stderr, order = (cycles[name].to_numpy() for name in ("friction_n", "stderr_n", "order"))
    columns = {"log_n": np.log(friction), "noise": (stderr / friction) ** 2, "order": order}
    means = {name: np.array([np.mean(values[group]) for group in groups]) for name, values in columns.items()}
    means |= {"noise": means["noise"] / count, "count": count}
    table = pl.DataFrame({"campaign": campaign[heads], "point": point[heads]} | means)
    return table, shares_of([block[group].tolist() for group in groups])


def _usable(found: CampaignCharacteristics, campaign: int) -> pl.DataFrame:
    """Return the cycles used for F(v).

    They have positive friction and both directions, and the curves do not exclude them.
    """
    reasons, ambient = {why for c in found.curves for why in c.excluded["reason"]}, found.identity.ambient_pressure_pa
    cycles = found.cycles.filter(pl.col("friction_n") > 0.0, pl.col("friction_n", "stderr_n").is_finite())
    cycles = cycles.filter([not reasons.intersection(flags) for flags in cycles["flags"].to_list()])
    columns = {f"gauge_{side}_pa": np.round(cycles[f"pressure_{side}_pa"].to_numpy() - ambient, -2) for side in "ab"}
    columns["order"] = cycles["index"].to_numpy() / (cycles["index"].max() or 1)
    title = pl.concat_str(pl.col(LEVELS).replace("", None), separator=", ", ignore_nulls=True)
    return cycles.hstack(pl.DataFrame(columns)).with_columns(title=title, campaign=pl.lit(campaign, pl.Int64))


@dataclass(frozen=True)
class Test:
    """Statistical test of one property.

    Attributes
    ----------
    what : str
    difference : Estimate or None
        Second minus first; None if the test has several parts.
    p : float
        Probability of such a large difference by chance.
    adjusted_p : float
        `p` after Holm's correction for the number of tests.
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
    """Comparison of two campaigns: checks, tests and cautions.

    Attributes
    ----------
    first, second : CampaignCharacteristics
    checks : tuple of Check
    tests : tuple of Test
    curves : CurveComparison or None
    dwell : tuple of (DwellSeries, DwellSeries)
        Pairs of stop series (first, second campaign) that were compared.
    statements : tuple of Statement
    """

    first: CampaignCharacteristics
    second: CampaignCharacteristics
    checks: tuple[Check, ...]
    tests: tuple[Test, ...]
    curves: CurveComparison | None
    dwell: Pairs
    statements: tuple[Statement, ...] = ()

    @property
    def different(self) -> bool:
        """Whether any test shows a difference."""
        return any(test.different for test in self.tests)

    def view(self) -> View:
        """Return a row for each test, cautions, and the figures of both campaigns."""
        return upper("comparison_view")(self)

    def __str__(self) -> str:
        """Return the result in a sentence."""
        if not self.tests:
            return "Nothing can be compared."
        if not self.different:
            return f"No difference is shown in {len(self.tests)} test(s): the campaigns may be equal, or too short."
        what = ", ".join(dict.fromkeys(test.what for test in self.tests if test.different))
        text = f"The campaigns differ by more than their cycles scatter: {what}."
        if self.curves is not None and not self.curves.several_blocks:
            text += " If a campaign has a single block, the cause may be the mounting or the day."
        return text


def compare_campaigns(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Comparison:
    """Compare sliding friction, stops and drift of two campaigns by statistical tests.

    Parameters
    ----------
    first, second : CampaignCharacteristics
        Results of `pneudrive.campaign_friction`. Differences are second minus first.

    Returns
    -------
    Comparison
    """
    both = first, second
    found, pairs = compare_curves(*both, _gain(both)), tuple(_pairs(both))
    why, curves = (found, None) if isinstance(found, str) else ("", found)
    tests = list(_tests(both, curves, pairs))
    adjusted = zip(tests, holm(np.array([test.p for test in tests])).tolist(), strict=True)
    tests = tuple(replace(test, adjusted_p=p, different=p < CHANCE) for test, p in adjusted)
    compared = Comparison(first, second, tuple(_checks(both)), tests, curves, pairs)
    return replace(compared, statements=tuple(_statements(compared, why)))


def write_comparison(compared: Comparison, path: str | Path) -> Path:
    """Write the tests of a comparison, its cautions, and the differences at common points as TOML."""
    tables: Row = {
        "first": compared.first.name,
        "second": compared.second.name,
        "synthetic": compared.first.synthetic or compared.second.synthetic,
        "different": compared.different,
        "test": compared.tests,
        "check": compared.checks,
        "statement": compared.statements,
    }
    if compared.curves is not None:
        ends = [(e.value, e.low, e.high) for e in compared.curves.difference]
        differences = pl.DataFrame(ends, schema=("relative_difference", "low", "high"), orient="row")
        tables["curves"] = compared.curves.points.drop("title").hstack(differences).to_dict(as_series=False)
    return write_tables(tables, path)


def _gain(both: Both) -> float:
    """Return the relative uncertainty of the ratio of both force sensors' gains; 0 for the same sensor.

    Simulated rigs with different seeds have different sensors.
    """
    a, b = (found.identity for found in both)
    drawn = a.synthetic and both[0].about.get("seed") != both[1].about.get("seed")
    same = a.name == b.name and a.calibration == b.calibration and a.force_calibration == b.force_calibration
    if same and not drawn:
        return 0.0
    return np.hypot(stated_gain(a) or 0.0, stated_gain(b) or 0.0) / np.sqrt(2.0)


def _tests(both: Both, curves: CurveComparison | None, dwell: Pairs) -> Iterator[Test]:
    """Yield the tests of sliding friction, of each pair of stop series, and of drift."""
    if curves is not None:
        mean = curves.mean.scaled(float(curves.friction_n.mean()), "N")
        note = f"mean of {curves.points.height} common points, {100 * curves.mean.value:+.2g} % of friction"
        yield Test("friction over speed", mean, curves.shape.p, note=note)
        if curves.pressure is not None:
            note = "growth of friction with pressure, as a fraction of friction"
            yield Test("relative effect of pressure", None, curves.pressure.p, note=note)
    for a, b in dwell:
        durations = [series.stops["dwell_s"].to_numpy() for series in (a, b)]
        low, high = max(some.min() for some in durations), min(some.max() for some in durations)
        if not high > low:
            continue
        at = a.reference_s if low < a.reference_s < high else np.sqrt(low * high)
        found = []
        for series, of in zip((a, b), _common(a, b), strict=True):
            assert series.curve is not None
            row, curve = np.isin(np.arange(len(series.conditions)), of)[None] / len(of), series.curve
            parts = curve.values(np.log10([at])), curve.gains(np.log10(low), np.log10(high))
            found.append([part.combine(row).estimates()[0] for part in parts])
        level, slope = (after - before for before, after in zip(*found, strict=True))
        span = f"mean from {low:.3g} to {high:.3g} s"
        yield Test("breakaway after a stop", level, level.p, note=f"{a.name}, at {at:.3g} s")
        yield Test("slope of breakaway per decade of stop", slope, slope.p, note=f"{a.name}, {span}")
    drifts = [found.drift.per_hour for found in both if found.drift and found.drift.per_hour]
    if len(drifts) == 2:
        difference = drifts[1] - drifts[0]
        yield Test("drift over time", difference, difference.p, note="change of friction, linear in time")


def _pairs(both: Both) -> Iterator[tuple[DwellSeries, DwellSeries]]:
    """Yield the pairs of stop series with equal restart speed and equal state of the axis (held, released)."""
    single = all(len({series.levels for series in found.dwell}) == 1 for found in both)
    for a, b in product(*(found.dwell for found in both)):
        same = a.released == b.released and abs(a.speed_m_s - b.speed_m_s) < 0.01 * a.speed_m_s
        if same and (single or a.levels == b.levels) and a.curve and b.curve and _common(a, b)[0].size:
            yield a, b


def _common(a: DwellSeries, b: DwellSeries) -> tuple[Ints, ...]:
    """Return for each series the indices of the conditions whose pressures occur in both series."""
    pairs = ([(c.pressure_a_pa, c.pressure_b_pa) for c in series.conditions] for series in (a, b))
    one, two = (np.array(pair).reshape(-1, 2) for pair in pairs)
    return np.nonzero((np.abs(one[:, None] - two) < SAME_PRESSURE_PA).all(axis=2))


def _statements(found: Comparison, not_comparable: str) -> Iterator[Statement]:
    """Yield cautions on the tests. `not_comparable` is the reason why the curves were not compared."""
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
