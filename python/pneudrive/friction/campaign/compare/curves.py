"""Comparison of friction over speed of two campaigns, cycle by cycle in one model.

  log F = point + campaign (level + slope u + bend u^2 + pressures) + block + drift + cycle,   u = log10 speed

A point is a speed at a pair of pressures that both campaigns have. The scatter of cycles may differ between campaigns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import Estimate, FTest
from pneudrive.estimate.groups import cells, levels
from pneudrive.estimate.mixed import MixedModel, RandomEffect, independent
from pneudrive.estimate.splines import centred_walk
from pneudrive.estimate.threads import one_thread
from pneudrive.friction.campaign.curves.points import MOST_CELLS, MOST_CYCLES, grouped, shares_of
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.result import CampaignCharacteristics, CycleResult

    Array = NDArray[np.float64]

SAME_SPEED = 0.03
SAME_PRESSURE_PA = 2000.0  # planned pressures that differ by less are one point
FEWEST_CYCLES = 6  # of both campaigns at common points
BEND_SPEEDS = 4  # least number of speeds for a bend over speed
DRIFT_CYCLES = 8  # least number of cycles of a campaign for a drift
USUAL = 0.02  # relative scatter that is usual
MOST_POINTS = 300  # points that are tested: more are thinned evenly
KINDS = ("sweep", "sentinel")


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Cycles of both campaigns at common points, shape (n,) each.

    In large campaigns, neighbouring repeats at one point form one row.

    Attributes
    ----------
    log_n, noise : ndarray
        Logarithm of friction, variance of its noise.
    count : ndarray
        Number of cycles in a row.
    campaign : ndarray of int
        0 or 1.
    point : ndarray of int
    block : ndarray, shape (n, blocks)
        Share of each block of both campaigns.
    order : ndarray
        Place in the campaign, 0 to 1.
    speed_m_s : ndarray, shape (m,)
    gauge_pa : ndarray, shape (m, 2)
    levels : tuple of str, length m
        Standard errors of the points.
    left_out : int
        Further common points.
    """

    log_n: Array
    noise: Array
    count: Array
    campaign: NDArray[np.int64]
    point: NDArray[np.int64]
    block: Array
    order: Array
    speed_m_s: Array
    gauge_pa: Array
    levels: tuple[str, ...]
    left_out: int = 0

    def blocks_of(self, campaign: int) -> int:
        """Count the blocks of a campaign."""
        return int((self.block[self.campaign == campaign] > 0.0).any(axis=0).sum())


@dataclass(frozen=True, eq=False, repr=False)
class CurveComparison(Shown):
    """Difference of friction: second campaign minus first.

    Attributes
    ----------
    points : CommonPoints
    shape : FTest
        Probability for the difference over all speeds: level, slope and bend together.
    pressure : FTest or None
        Probability for a difference in the effect of pressure.
    mean : Estimate
        Mean difference over the common points, relative to friction.
    difference : tuple of Estimate
        At each common point, relative.
    adjusted_p : ndarray, shape (m,)
        The same probabilities after Holm's correction for their number [holm1979].
    friction_n : ndarray, shape (2, m)
        Mean of each campaign at the points.
    several_blocks : bool
        Both campaigns have more than one block, so the tests include differences of blocks.
    """

    points: CommonPoints
    shape: FTest
    pressure: FTest | None
    mean: Estimate
    difference: tuple[Estimate, ...]
    adjusted_p: Array
    friction_n: Array
    several_blocks: bool


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
    points = common_points(first, second)
    if points.speed_m_s.size == 0:
        return "no speed at the same pressures was run in both campaigns"
    cycles = [points.count[points.campaign == k].sum() for k in (0, 1)]
    if min(cycles) < FEWEST_CYCLES // 2 or sum(cycles) < FEWEST_CYCLES:
        return "too few cycles at common speeds and pressures"
    with one_thread():
        return _compared(points, float(np.sqrt(2.0)) * gain)


def _compared(points: CommonPoints, u: float) -> CurveComparison:
    """Test for a difference; `u` adds to the uncertainty of means."""
    sign = points.campaign.astype(np.float64) - 0.5
    m = points.speed_m_s.size
    dummies = (points.point[:, None] == np.arange(m)[None, :]).astype(float)
    shape = _shape_columns(points)
    pressure = _pressure_columns(points)
    x = np.c_[dummies, shape[points.point] * sign[:, None], pressure[points.point] * sign[:, None]]
    kept = independent(x)
    fit = _model(points, x[:, kept]).fit()
    rows = np.eye(x.shape[1])[:, kept]
    level = np.zeros(x.shape[1])
    level[m] = 1.0
    shapes = [i for i in range(m, m + shape.shape[1]) if i in kept]
    pressures = [i for i in range(m + shape.shape[1], x.shape[1]) if i in kept]
    each = _each(points, dummies, sign, u)
    return CurveComparison(
        points=points,
        shape=fit.f_test(rows[shapes], u**2),
        pressure=fit.f_test(rows[pressures]) if pressures else None,
        mean=fit.contrast(level[kept], unit="").widened(u),
        difference=each,
        adjusted_p=holm(np.array([e.p for e in each])),
        friction_n=_means(points),
        several_blocks=all(points.blocks_of(k) > 1 for k in (0, 1)),
    )


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
    usable = [_usable(found) for found in (first, second)]
    titles = [{c.condition.title for c in cycles} for cycles in usable]
    with_levels = bool(titles[0] & titles[1]) and max(len(found) for found in titles) > 1
    ambient = [found.identity.ambient_pressure_pa for found in (first, second)]
    rows = [(k, c) for k, cycles in enumerate(usable) for c in cycles]
    keys = [
        (
            c.condition.title if with_levels else "",
            round(c.condition.pressure_a_pa - ambient[k], -2),
            round(c.condition.pressure_b_pa - ambient[k], -2),
            c.speed_m_s,
        )
        for k, c in rows
    ]
    campaign = np.array([k for k, _ in rows], dtype=np.int64)
    place = _places(keys)
    common = np.intersect1d(place[campaign == 0], place[campaign == 1])
    at = sorted((int(np.argmax(place == one)) for one in common), key=lambda i: keys[i])  # the first cycle of each
    both = [at[i] for i in np.linspace(0, len(at) - 1, min(len(at), MOST_POINTS)).round().astype(int)]
    number = {int(place[i]): n for n, i in enumerate(both)}
    used = [i for i in range(len(rows)) if int(place[i]) in number]
    cycles = [rows[i][1] for i in used]
    campaign, point = campaign[used], np.array([number[int(place[i])] for i in used], dtype=np.int64)
    named = [(rows[i][0], rows[i][1].block) for i in used]
    known = {block: i for i, block in enumerate(dict.fromkeys(named))}
    blocks = [known[block] for block in named]
    groups = _groups(campaign, point, blocks)
    heads = [group[0] for group in groups]

    def mean(values: list[float]) -> Array:
        return np.array([np.mean([values[i] for i in group]) for group in groups], dtype=np.float64)

    last = [max((c.index for c in found), default=1) for found in usable]
    count = np.array([len(group) for group in groups], dtype=float)
    return CommonPoints(
        log_n=mean([float(np.log(c.friction_n)) for c in cycles]),
        noise=mean([(c.stderr_n / c.friction_n) ** 2 for c in cycles]) / count,
        count=count,
        campaign=campaign[heads],
        point=point[heads],
        block=shares_of([[blocks[i] for i in group] for group in groups]),
        order=mean([c.index / last[k] for c, k in zip(cycles, campaign, strict=True)]),
        speed_m_s=np.array([keys[i][3] for i in both]),
        gauge_pa=np.array([keys[i][1:3] for i in both]).reshape(-1, 2),
        levels=tuple(keys[i][0] for i in both),
        left_out=len(at) - len(both),
    )


def _places(keys: list[tuple[str, float, float, float]]) -> NDArray[np.int64]:
    """Return a number for each cycle, equal for cycles at the same levels, pressures and speed."""
    if not keys:
        return np.zeros(0, dtype=np.int64)
    title, a, b, speed = zip(*keys, strict=True)
    pressures = (levels(np.array(side), SAME_PRESSURE_PA) for side in (a, b))
    return cells(np.unique(title, return_inverse=True)[1], *pressures, levels(np.log(speed), np.log1p(SAME_SPEED)))


def _groups(campaign: NDArray[np.int64], point: NDArray[np.int64], blocks: list[int]) -> list[list[int]]:
    """Return the cycles of each row: one cycle, or in large campaigns several neighbouring repeats at one point."""
    if campaign.size <= MOST_CELLS:
        return [[i] for i in range(campaign.size)]
    stretch = np.array(blocks, dtype=np.int64)
    stretch -= np.array([stretch[campaign == k].min() for k in (0, 1)])[campaign]
    return grouped(2 * point + campaign, stretch, np.zeros_like(point), rows=MOST_CYCLES, cells=MOST_CELLS)[0]


def _usable(found: CampaignCharacteristics) -> list[CycleResult]:
    """Return the cycles that are points of F(v): both directions, positive, not excluded from the curves."""
    reasons = {p.reason for curve in found.curves for p in curve.excluded}
    return [
        c
        for c in found.cycles
        if c.kind in KINDS
        and np.isfinite(c.friction_n)
        and c.friction_n > 0
        and np.isfinite(c.stderr_n)
        and not reasons.intersection(c.flags)
    ]


def _shape_columns(points: CommonPoints) -> Array:
    """Return the level, slope and bend over log speed, centred over the points, shape (m, 1 to 3)."""
    u = np.log10(points.speed_m_s)
    u = u - u.mean()
    columns = [np.ones(u.size)]
    speeds = np.unique(np.round(u, 2)).size
    if speeds > 1:
        columns.append(u)
    if speeds >= BEND_SPEEDS:
        columns.append(u**2 - np.mean(u**2))
    return np.column_stack(columns)


def _pressure_columns(points: CommonPoints) -> Array:
    """Return the pressures of both chambers, or their sum if they are always equal; per bar, centred."""
    bar = points.gauge_pa / 1e5
    if np.allclose(bar[:, 0], bar[:, 1], atol=0.02):
        bar = bar[:, :1]
    return bar - bar.mean(axis=0)


def _model(points: CommonPoints, x: Array) -> MixedModel:
    components = []
    for k in (0, 1):
        own = (points.campaign == k).astype(float)
        components.append(RandomEffect(f"cycle {k + 1}", own / points.count, USUAL))
        if own.sum() >= DRIFT_CYCLES:
            kernel = np.zeros((own.size, own.size))
            members = np.flatnonzero(own)
            kernel[np.ix_(members, members)] = centred_walk(points.order[members])
            components.append(RandomEffect(f"drift {k + 1}", kernel, USUAL))
    if any(points.blocks_of(k) > 1 for k in (0, 1)):
        components.append(RandomEffect("block", points.block @ points.block.T, USUAL))
    return MixedModel(points.log_n, x, points.noise, tuple(components))


def _each(points: CommonPoints, dummies: Array, sign: Array, u: float) -> tuple[Estimate, ...]:
    """Return the separate difference at each point."""
    m = dummies.shape[1]
    x = np.c_[dummies, dummies * sign[:, None]]
    fit = _model(points, x).fit()
    return tuple(fit.contrast(row, unit="").widened(u) for row in np.eye(2 * m)[m:])


def _means(points: CommonPoints) -> Array:
    """Return the mean of each campaign at the points, shape (2, m)."""
    m = points.speed_m_s.size
    cell = m * points.campaign + points.point
    total = np.bincount(cell, points.count * points.log_n, 2 * m)
    return np.exp(total / np.bincount(cell, points.count, 2 * m)).reshape(2, m)
