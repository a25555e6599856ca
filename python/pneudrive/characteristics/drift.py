"""What passes: drift with time, run-in with travel, temperature, interruptions; and how well a cycle repeats."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.curves import Fits, shares_of
from pneudrive.characteristics.effects import Drift, Repeatability
from pneudrive.characteristics.smooth import CARRIED
from pneudrive.estimate.estimates import NORMAL_95, Estimate
from pneudrive.estimate.groups import cells
from pneudrive.estimate.mixed import MixedModel, independent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.reading import Reading

    Array = NDArray[np.float64]

HOUR_S = 3600.0
LEAST_KELVIN = 0.5  # of a temperature's range: less tells nothing of its effect
LEAST_DECADES = 0.5  # of travel
FIRST_TRAVEL_M = 1.0  # below which the logarithm of travel means nothing
LONG_REST_S, LONG_REST_RATIO = 30.0, 5.0  # a rest is an interruption beyond both, the ratio to the usual rest
FEWEST_INTERRUPTED = 3
ENOUGH_FOR_LINE = 3  # degrees of freedom beyond which a line over the campaign is taken out of repeats
TOGETHER = 0.95  # correlation of two causes beyond which they cannot be told apart


@dataclass(frozen=True, eq=False)
class Causes:
    """What may make friction change over a campaign, shape (n,) each for the cycles that are points of F(v).

    ``together`` names pairs that cannot be told apart, as correlation says.
    """

    hours: Array
    decades: Array
    kelvin: Array
    interrupted: NDArray[np.bool_]
    together: tuple[tuple[str, str, float], ...]


def causes(reading: Reading, fits: Fits) -> Causes:
    """Collect the possible causes of a drift."""
    data = fits.points.cycles(fits.points.use)
    hours = np.array([d.head.began_s for d in data]) / HOUR_S
    travel = np.array([reading.travel_m[d.head.cycle.key] for d in data])
    kelvin = np.array([d.temperature_k for d in data])
    decades = np.log10(travel + FIRST_TRAVEL_M)
    columns = {"time": hours}
    if np.ptp(decades) >= LEAST_DECADES:
        columns["travel"] = decades
    if np.isfinite(kelvin).all() and np.ptp(kelvin) >= LEAST_KELVIN:
        columns["temperature"] = kelvin
    names = list(columns)
    together = []
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if np.ptp(columns[a]) > 0 and np.ptp(columns[b]) > 0:
                r = float(np.corrcoef(columns[a], columns[b])[0, 1])
                if abs(r) > TOGETHER:
                    together.append((a, b, r))
    return Causes(hours, decades, kelvin, _interrupted(reading, data), tuple(together))


def _interrupted(reading: Reading, data: list) -> NDArray[np.bool_]:
    """Cycles that follow a long rest, or a cycle with a stop."""
    heads = {head.cycle.key: i for i, head in enumerate(reading.heads)}
    durations = {d.head.cycle.key: d.duration_s for d in (*reading.sliding, *reading.tares)}
    rests = []
    for d in data:
        place = heads[d.head.cycle.key]
        before = reading.heads[place - 1] if place else None
        if before is None:
            rests.append(float("nan"))
        elif before.cycle.kind == "stop":
            rests.append(float(before.cycle.stop_s or 0.0))
        elif before.cycle.key in durations:
            rests.append(d.head.began_s - before.began_s - durations[before.cycle.key])
        else:
            rests.append(float("nan"))
    rest = np.array(rests)
    usual = float(np.nanmedian(rest)) if np.isfinite(rest).any() else 0.0
    return np.nan_to_num(rest) > max(LONG_REST_S, LONG_REST_RATIO * usual)


def drift_of(reading: Reading, fits: Fits, found: Causes) -> Drift:
    """Describe the drift; effects are None where the design does not carry them."""
    points, fit = fits.points, fits.friction
    use = points.use
    data = points.cycles(use)
    level = float(points.reduced.friction_n[use].mean())
    scale = level if fit.logarithmic else 1.0
    first = min(head.began_s for head in reading.heads)
    carried = fits.drift_share < CARRIED
    sentinel = np.array([d.head.cycle.kind == "sentinel" for d in points.reduced.data])
    per_hour = per_decade = per_kelvin = interrupted = None
    if carried:
        per_hour = _effect(fits, found.hours, scale, "N/h")
        if np.ptp(found.decades) >= LEAST_DECADES:
            per_decade = _effect(fits, found.decades, scale, "N/decade")
        if np.isfinite(found.kelvin).all() and np.ptp(found.kelvin) >= LEAST_KELVIN:
            per_kelvin = _effect(fits, found.kelvin, scale, "N/K")
    number = int(found.interrupted.sum())
    if FEWEST_INTERRUPTED <= number <= found.interrupted.size - FEWEST_INTERRUPTED:
        interrupted = _effect(fits, found.interrupted.astype(float), scale, "N")
    value, half = fit.drift * scale, fit.drift_half * scale
    return Drift(
        time_s=np.array([d.head.began_s - first for d in data]),
        drift_n=value,
        low_n=value - half,
        high_n=value + half,
        sentinel_time_s=np.array([d.head.began_s - first for d in points.reduced.data])[sentinel],
        sentinel_n=points.reduced.friction_n[sentinel],
        per_hour=per_hour,
        per_decade_of_travel=per_decade,
        per_kelvin=per_kelvin,
        interrupted=interrupted,
        basis=_basis(fits, bool(sentinel.any())) if carried else "not determined",
        spread_n=float(np.std(value)),
    )


def _effect(fits: Fits, column: Array, scale: float, unit: str) -> Estimate | None:
    """Effect of one cause on friction at its mean, the smooth drift being part of what is unknown."""
    model = fits.friction.fit.model
    x = np.column_stack([model.x, column - column.mean()])
    if independent(x).size < x.shape[1] or x.shape[0] <= x.shape[1] + 1:
        return None
    row = np.zeros(x.shape[1])
    row[-1] = scale
    return MixedModel(model.y, x, model.noise, model.components).fit().contrast(row, unit)


def _basis(fits: Fits, sentinels: bool) -> str:
    if sentinels:
        return "sentinels"
    return "repeats" if _repeated(fits) else "smooth curve"


def _repeated(fits: Fits) -> bool:
    return bool((np.bincount(fits.points.cell[fits.points.use]) > 1).any())


def repeatability(fits: Fits) -> Repeatability:
    """Give the standard deviations of a cycle's friction: of repeats and sentinels themselves, where there are any."""
    points, fit = fits.points, fits.friction
    level = float(points.reduced.friction_n[points.use].mean())
    pure = pure_scatter(fits)
    if pure is not None:
        level = pure.level_n
        within = pure.estimate.scaled(level if fit.logarithmic else 1.0)
    else:
        scale = level if fit.logarithmic else 1.0
        noise = float(np.sqrt(np.mean(fit.data.noise))) * scale
        within = fit.fit.deviation("cycle").scaled(scale)
        ends = (float(np.hypot(v, noise)) for v in (within.value, within.low, within.high))
        within = replace(within, **dict(zip(("value", "low", "high"), ends, strict=True)))
    between = total = None
    if fits.blocks is not None:
        between = fit.fit.deviation("block").scaled(level if fit.logarithmic else 1.0)
        value = float(np.hypot(within.value, between.value))
        stderr = float(np.hypot(within.stderr * within.value, between.stderr * between.value)) / max(value, 1e-12)
        reach = NORMAL_95 * stderr / max(value, 1e-12)
        total = replace(within, value=value, low=value * np.exp(-reach), high=value * np.exp(reach), stderr=stderr)
    return Repeatability(within, between, total, fit.relative > 0.5, pure.basis if pure is not None else "smooth curve")


@dataclass(frozen=True)
class Pure:
    """Scatter of cycles that were run again at one condition and speed, in the unit of the curves' response.

    ``level_n`` is their mean friction.
    """

    estimate: Estimate
    level_n: float
    basis: str


def pure_scatter(fits: Fits) -> Pure | None:
    """Estimate the standard deviation of a cycle from repeats and sentinels alone, whatever the curves make of them.

    What is left of cycles at one condition and speed when their mean, a line over the campaign and the means of the
    blocks are taken out. A point that stands for several cycles scatters less, and weighs as many. None where nothing
    was repeated.
    """
    from scipy.special import chdtri

    points, fit = fits.points, fits.friction
    use = np.flatnonzero(points.use)
    cell = points.cell[use]
    again = np.bincount(cell)[cell] > 1
    if not again.any():
        return None
    use, cell, y, order = use[again], cells(cell[again]), fit.data.y[again], fit.data.order[again]
    weight = fit.data.count[again]
    data = [points.reduced.data[i] for i in use]
    blocks = shares_of([[d.head.cycle.block for d in points.members[i]] for i in use])
    columns = np.column_stack([order, blocks[:, :-1]])

    def within(values: Array) -> Array:
        total = np.zeros((int(cell.max()) + 1, values.shape[1]))
        np.add.at(total, cell, weight[:, None] * values)
        return np.sqrt(weight)[:, None] * (values - total[cell] / np.bincount(cell, weight)[cell, None])

    groups = np.unique(cell).size
    kept = within(columns) if y.size - groups > ENOUGH_FOR_LINE else np.zeros((y.size, 0))
    kept = kept[:, independent(kept)] if kept.size else kept
    rest = within(y[:, None])[:, 0]
    rest = rest - kept @ np.linalg.lstsq(kept, rest, rcond=None)[0] if kept.size else rest
    free = y.size - groups - kept.shape[1]
    if free < 1:
        return None
    value = float(np.sqrt(rest @ rest / free))
    low, high = (value * float(np.sqrt(free / chdtri(free, p))) for p in (0.025, 0.975))
    sentinel = np.array([d.head.cycle.kind == "sentinel" for d in data])
    others = np.bincount(cell[~sentinel], minlength=int(cell.max()) + 1)  # one sweep more at the place of the sentinels
    kinds = (["repeats"] if others.max() > 1 else []) + (["sentinels"] if sentinel.any() else [])
    basis = " and ".join(kinds)
    estimate = Estimate(value, low, high, value / float(np.sqrt(2.0 * free)), "N", free)
    return Pure(estimate, float(points.reduced.friction_n[use].mean()), basis)
