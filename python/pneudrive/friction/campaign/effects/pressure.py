"""Effects of both chamber pressures on friction: slopes at each speed, interaction, and determined effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.estimate.estimates import CHANCE
from pneudrive.estimate.mixed import MixedFit, MixedModel, RandomEffect, independent
from pneudrive.estimate.splines import centred_walk
from pneudrive.friction.campaign.curves.smooth import CARRIED, CYCLE_SCALE
from pneudrive.friction.campaign.effects.effect import PressureEffects
from pneudrive.friction.conditions import PA_PER_BAR, TOLD, classify_pressures
from pneudrive.friction.sentences import say_all

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate, FTest
    from pneudrive.friction.campaign.curves.curves import Fits
    from pneudrive.friction.sentences import Said

    Array = NDArray[np.float64]

#: Change of friction over a campaign, over its mean, that may be hidden in effects of pressure if the order of the
#: cycles follows pressure and nothing separates the two: a seal that runs in or wears (assumed standard uncertainty).
HIDDEN_CHANGE = 0.1
#: Least share of that change within the effect of a pressure for a warning.
FOLLOWS_TIME = 0.1


@dataclass(frozen=True, eq=False)
class _Design:
    """Cycles of one set of levels.

    Pressures are in bar, gauge. ``kind`` names the determined slopes: both, a, b, sum or line.
    ``beside`` has a column for each set of equal cycles at other speeds, such as control runs. They do not depend on
    pressure, and show the effect of time. Their ``level`` is -1.
    """

    kind: str
    speeds: Array
    level: NDArray[np.int64]
    a: Array
    b: Array
    place: Array
    beside: Array
    order: Array
    pairs: tuple[tuple[float, float], ...]

    @property
    def compared(self) -> NDArray[np.bool_]:
        """Return the cycles at speeds that were measured at all pressure pairs."""
        return self.level >= 0

    def centred(self, values: Array) -> Array:
        """Return the values minus their mean over the compared cycles, and zero for other cycles."""
        return np.where(self.compared, values - values[self.compared].mean(), 0.0)


def pressure_effects(fits: Fits, ambient_pa: float) -> tuple[PressureEffects, ...]:
    """Find the effects of pressure for each set of mounting, seal and drive with several pressure pairs."""
    points = fits.points
    found = []
    for levels in dict.fromkeys(c.levels for c in points.conditions):
        conditions = [i for i, c in enumerate(points.conditions) if c.levels == levels]
        title = points.conditions[conditions[0]].title
        effect = _effects(ambient_pa, fits, points.use & np.isin(points.condition, conditions), title)
        if effect is not None:
            found.append(effect)
    return tuple(found)


def _effects(ambient_pa: float, fits: Fits, members: NDArray[np.bool_], title: str) -> PressureEffects | None:
    design, members = _design(ambient_pa, fits, members)
    if design is None:
        return None
    speed = np.eye(design.speeds.size)[design.level] * design.compared[:, None]
    names = TOLD.get(design.kind, ("sum",))
    slopes = [design.b if name == "b" else design.a for name in names]
    count = design.speeds.size
    base = np.hstack([design.beside, speed])
    x = np.hstack([base, *(speed * p[:, None] for p in slopes)])
    if x.shape[0] <= x.shape[1] + 1:  # too few cycles for a slope at each speed: one common slope
        count = 1
        x = np.hstack([base, *(p[:, None] for p in slopes)])
    # An interaction is neither scatter nor drift: slopes are estimated with it, at the mean pressures.
    together = _together(design, x) if design.kind == "both" else np.zeros((x.shape[0], 0))
    x = np.hstack([together, x])
    fit = _fit(fits, members, x, design.order) if x.shape[0] > x.shape[1] + 1 else None
    if fit is None:
        return None
    u, hidden = accuracy_n(fits, members), _hidden(fits, fit.model, design)
    reach = [u / max(float(np.ptp(p)), 1e-12) for p in slopes]
    # The last columns are the slopes at each speed, one pressure after the other.
    rows_of = np.eye(x.shape[1])[-count * len(slopes) :].reshape(len(slopes), count, -1)
    each = [tuple(_slope(fit, row, r, hidden) for row in rows) for rows, r in zip(rows_of, reach, strict=True)]
    of_mean = rows_of.mean(axis=1)
    means = [_slope(fit, row, r, hidden) for row, r in zip(of_mean, reach, strict=True)]
    follows = [
        hidden is not None and hidden.share(r) * np.ptp(p) > FOLLOWS_TIME for r, p in zip(of_mean, slopes, strict=True)
    ]
    interaction, joint, curvature = None, None, None
    if together.shape[1] and hidden is None:
        rows = np.eye(x.shape[1])[: together.shape[1]]
        interaction, joint = fit.f_test(rows), fit.contrast(rows[0]).scaled(PA_PER_BAR**-2, "N/Pa2")
    if hidden is None:
        squares = [design.centred(p) ** 2 * design.compared for p in slopes]
        curvature = _curvature(fits, members, x, design, squares)
    said = [*_statements(design, means, interaction, joint, curvature, u), *_order(design, hidden, follows)]
    named: dict[str, Any] = {f"slope_{name}": slope for name, slope in zip(names, each, strict=True)}
    named |= {f"mean_{name}": mean for name, mean in zip(names, means, strict=True)}
    return PressureEffects(
        levels=title,
        speed_m_s=design.speeds if count > 1 else design.speeds.mean(keepdims=True),
        gauge_pa=tuple((PA_PER_BAR * a, PA_PER_BAR * b) for a, b in design.pairs),
        hidden_n=hidden.size_n if hidden is not None else 0.0,
        statement=" ".join(one.text for one in say_all(said)),
        interaction=interaction,
        interaction_n_pa2=joint,
        curvature=curvature,
        **named,
    )


def _design(ambient_pa: float, fits: Fits, members: NDArray[np.bool_]) -> tuple[_Design | None, NDArray[np.bool_]]:
    """Select the speeds that were measured at all pressure pairs, and classify the effects that the pairs determine."""
    points = fits.points
    absolute = np.array([(c.pressure_a_pa, c.pressure_b_pa) for c in points.conditions])
    gauge = np.round((absolute - ambient_pa) / PA_PER_BAR, 3) + 0.0
    of_cycle = gauge[points.condition]
    pairs = np.unique(of_cycle[members], axis=0)
    at = {int(k): np.unique(of_cycle[members & (points.level == k)], axis=0) for k in set(points.level[members])}
    kept = sorted(k for k, found in at.items() if len(found) == len(pairs))
    if len(pairs) < 2 or not kept:
        return None, members
    compared = members & np.isin(points.level, kept)
    # Equal cycles at other speeds, in one set each; a single cycle carries no information.
    cell = points.cell
    sets, counts = np.unique(cell[members & ~compared], return_counts=True)
    beside = members & ~compared & np.isin(cell, sets[counts > 1])
    used = compared | beside
    here = compared[used]
    design = _Design(
        kind=classify_pressures(pairs),
        speeds=points.level_speeds_m_s[kept],
        level=np.where(here, np.searchsorted(kept, points.level[used]), -1),
        a=np.where(here, of_cycle[used, 0], 0.0),
        b=np.where(here, of_cycle[used, 1], 0.0),
        place=np.log(points.reduced.speed_m_s[used]),
        beside=(cell[used][:, None] == sets[counts > 1]) & beside[used][:, None],
        order=points.order[used],
        pairs=tuple((float(a), float(b)) for a, b in pairs),
    )
    return design, used


def _fit(fits: Fits, members: NDArray[np.bool_], x: Array, order: Array) -> MixedFit | None:
    """Fit fixed effects with the random effects of the curves' model."""
    points, reduced = fits.points, fits.points.reduced
    y = reduced.friction_n[members]
    # A relative source is proportional to friction as predicted by the fixed effects, not to
    # the values themselves, which such a source would explain exactly.
    steady = x @ np.linalg.lstsq(x, y, rcond=None)[0]
    level = steady / steady.mean()
    share, relative = (level if fits.friction.logarithmic else np.ones(y.size)), fits.friction.relative
    usual = CYCLE_SCALE * max(float(np.abs(y).mean()), 1e-9)
    outer = np.outer(share, share)
    own = relative * level**2 + 1.0 - relative
    components = [RandomEffect("cycle", own / points.count[members], usual)]
    if fits.drift_share < CARRIED:
        components.append(RandomEffect("drift", outer * centred_walk(order), usual))
    if fits.blocks is not None:
        blocks = fits.blocks[members[points.use]]
        if blocks.any(axis=0).sum() > 1:
            components.append(RandomEffect("block", outer * (blocks @ blocks.T), usual))
    if independent(x).size < x.shape[1]:
        return None
    return MixedModel(y, x, reduced.friction_stderr_n[members] ** 2, tuple(components)).fit()


def accuracy_n(fits: Fits, members: NDArray[np.bool_]) -> float:
    """Return the standard uncertainty of a change of friction between pressures from the sensors, N."""
    return float(np.mean([np.hypot(d.u_gain_n, d.u_hysteresis_n) for d in fits.points.cycles(members)]))


@dataclass(frozen=True, eq=False)
class _Hidden:
    """A change of friction over the campaign that the design does not separate from the effects of pressure.

    ``size_n`` is its standard uncertainty. ``of_order`` are the coefficients of the pressure columns that look like a
    steady change by 1 N from the first cycle to the last.
    """

    size_n: float
    of_order: Array

    def share(self, row: Array) -> float:
        """Return the part of the change that a combination of pressure effects would contain."""
        return abs(float(row @ self.of_order))


def _hidden(fits: Fits, model: MixedModel, design: _Design) -> _Hidden | None:
    """Return the hidden change; None if the design determines a drift, which is then in the model."""
    if fits.drift_share < CARRIED:
        return None
    size = HIDDEN_CHANGE * float(np.abs(model.y).mean())
    return _Hidden(size, np.linalg.lstsq(model.x, design.order - design.order.mean(), rcond=None)[0])


def _slope(fit: MixedFit, row: Array, u: float, hidden: _Hidden | None) -> Estimate:
    doubt = u if hidden is None else float(np.hypot(u, hidden.size_n * hidden.share(row)))
    return fit.contrast(row).widened(doubt).scaled(1.0 / PA_PER_BAR, "N/Pa")


def _over_speed(design: _Design, columns: list[Array]) -> list[Array]:
    """Return the columns, and each of them with the logarithm of speed."""
    tilt = design.centred(design.place)
    return [*columns, *(c * tilt for c in columns)] if design.speeds.size > 1 else columns


def _together(design: _Design, x: Array) -> Array:
    """Return the columns of the product of both pressures, its mean over speeds and its change with their logarithm.

    The product is centred, so that the slopes are those at the mean of the other pressure. It is left out if the design
    does not determine it.
    """
    product = design.centred(design.a) * design.centred(design.b)
    columns = [c for c in _over_speed(design, [product]) if np.ptp(c) > 0.0]
    kept = [k - x.shape[1] for k in independent(np.column_stack([x, *columns])).tolist() if k >= x.shape[1]]
    if 0 not in kept or x.shape[0] <= x.shape[1] + len(kept) + 1:
        return np.zeros((x.shape[0], 0))
    return np.column_stack([columns[k] for k in kept])


def _curvature(fits: Fits, members: NDArray[np.bool_], x: Array, design: _Design, squares: list[Array]) -> FTest | None:
    """Test squares of pressures, their mean over speeds and their change with its logarithm."""
    columns = [p for p in squares if np.ptp(p) > 0.0]
    wide = np.column_stack([x, *_over_speed(design, columns)])
    kept = independent(wide)
    added = [k for k in kept.tolist() if k >= x.shape[1]]
    if len([k for k in added if k < x.shape[1] + len(columns)]) < len(columns) or not columns:
        return None
    wide = wide[:, kept]
    if wide.shape[0] <= wide.shape[1] + 1:
        return None
    fit = _fit(fits, members, wide, design.order)
    return None if fit is None else fit.f_test(np.eye(wide.shape[1])[x.shape[1] :])


def _statements(
    design: _Design,
    means: list[Estimate],
    interaction: FTest | None,
    joint: Estimate | None,
    curvature: FTest | None,
    u: float,
) -> Iterator[Said]:
    pairs = ", ".join(f"{a:.3g}/{b:.3g}" for a, b in design.pairs)
    of = zip(means, _names(design.kind, "both pressures together"), strict=True)
    slopes = " and ".join(f"{mean.scaled(PA_PER_BAR, 'N/bar'):.2f} of {name}" for mean, name in of)
    yield "pressure.slopes", {"pairs": pairs, "speeds": design.speeds.size, "slopes": slopes}
    if design.kind != "both":
        yield f"pressure.{design.kind if design.kind in {'sum', 'line'} else 'single'}", {}
    elif interaction is None or joint is None:
        yield "pressure.no_interaction", {}
    else:
        yield _interaction(design, interaction, joint, u)
    if curvature is not None and curvature.p < CHANCE:
        yield "pressure.curved", {"chance": _chance(curvature.p)}


def _names(kind: str, both: str) -> list[str]:
    return [f"p_{name}" for name in TOLD[kind]] if kind in TOLD else [both]


def _order(design: _Design, hidden: _Hidden | None, follows: list[bool]) -> Iterator[Said]:
    """Return the sentence on a pressure that changed with time, and on undetermined effects."""
    if hidden is not None and any(follows):
        of = zip(_names(design.kind, "the pressures"), follows, strict=True)
        names = " and ".join(name for name, with_time in of if with_time)
        yield "pressure.follows_time", {"names": names, "hidden": hidden.size_n, "share": 100 * HIDDEN_CHANGE}


def _interaction(design: _Design, test: FTest, joint: Estimate, u: float) -> Said:
    """Return the text on whether the effects of both pressures add.

    An interaction within the accuracy of the sensors does not count.
    """
    reach = max(abs(joint.low), abs(joint.high)) * PA_PER_BAR**2
    most = reach * float(np.abs(design.a * design.b).max())
    numbers = f"F({test.numerator:.0f}, {test.denominator:.0f}) = {test.f:.2f}, {_chance(test.p)}"
    if test.p >= CHANCE:
        return "pressure.add", {"test": numbers, "reach": reach}
    if most < 2.0 * u:
        return "pressure.add_within_accuracy", {"test": numbers, "most": most, "accuracy": 2.0 * u}
    return "pressure.interact", {"test": numbers, "joint": joint.scaled(PA_PER_BAR**2, "N/bar2")}


def _chance(p: float) -> str:
    """Return a probability as text; below 0.001 without digits."""
    return f"p = {p:.2g}" if p >= 0.001 else "p < 0.001"
