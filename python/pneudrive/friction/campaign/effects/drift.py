"""Changes: drift with time, run-in with travel, temperature, interruptions; and repeatability of a cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95, Estimate
from pneudrive.estimate.groups import cells
from pneudrive.estimate.mixed import independent
from pneudrive.friction.campaign.curves.points import shares_of
from pneudrive.friction.campaign.curves.smooth import CARRIED
from pneudrive.friction.campaign.effects.effect import Drift, Repeatability

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.curves.curves import Fits
    from pneudrive.friction.cycle import CycleData

    Array = NDArray[np.float64]

HOUR_S = 3600.0
UNITS = {"time": "N/h", "travel": "N/decade", "temperature": "N/K"}  # of the effects of these causes
LEAST_KELVIN = 0.5  # least range of temperature for an effect
LEAST_DECADES = 0.5  # of travel
FIRST_TRAVEL_M = 1.0  # least travel for its logarithm
LONG_REST_S, LONG_REST_RATIO = 30.0, 5.0  # a rest is an interruption beyond both, the ratio to the usual rest
FEWEST_INTERRUPTED = 3
ENOUGH_FOR_LINE = 3  # degrees of freedom above which a line over the campaign is removed from repeats
TOGETHER = 0.95  # correlation above which two causes cannot be separated


@dataclass(frozen=True, eq=False)
class Causes:
    """Possible causes of a change of friction over a campaign, shape (n,) each, for the cycles that are points of F(v).

    Attributes
    ----------
    columns : dict
        time (h), travel (decades), temperature (K), if they change enough to have an effect.
    interrupted : ndarray of bool
        Cycles that follow a long rest, or a cycle with a stop.
    together : tuple of (str, str, float)
        Pairs that cannot be separated, and their correlation.
    """

    columns: dict[str, Array]
    interrupted: NDArray[np.bool_]
    together: tuple[tuple[str, str, float], ...]


def causes(fits: Fits) -> Causes:
    """Collect the possible causes of a drift."""
    data = fits.points.cycles(fits.points.use)
    columns = {"time": np.array([d.plan.began_s for d in data]) / HOUR_S}
    decades = np.log10(np.array([d.plan.travel_m for d in data]) + FIRST_TRAVEL_M)
    kelvin = np.array([d.temperature_k for d in data])
    if np.ptp(decades) >= LEAST_DECADES:
        columns["travel"] = decades
    if np.isfinite(kelvin).all() and np.ptp(kelvin) >= LEAST_KELVIN:
        columns["temperature"] = kelvin
    changing = {name: column for name, column in columns.items() if np.ptp(column) > 0}
    pairs = [(a, b, float(np.corrcoef(changing[a], changing[b])[0, 1])) for a, b in combinations(changing, 2)]
    return Causes(columns, _interrupted(data), tuple(pair for pair in pairs if abs(pair[2]) > TOGETHER))


def _interrupted(data: list[CycleData]) -> NDArray[np.bool_]:
    rest = np.array([d.plan.rest_s for d in data])
    usual = float(np.nanmedian(rest)) if np.isfinite(rest).any() else 0.0
    return np.nan_to_num(rest) > max(LONG_REST_S, LONG_REST_RATIO * usual)


def drift_of(fits: Fits, found: Causes) -> Drift:
    """Describe the drift. Undetermined effects have the value None."""
    points, fit, scale = fits.points, fits.friction, fits.scale_n
    carried = fits.drift_share < CARRIED
    effects = {name: _effect(fits, column, UNITS[name]) for name, column in found.columns.items()} if carried else {}
    number, interrupted = int(found.interrupted.sum()), None
    if FEWEST_INTERRUPTED <= number <= found.interrupted.size - FEWEST_INTERRUPTED:
        interrupted = _effect(fits, found.interrupted.astype(float), "N")
    time = np.array([d.plan.elapsed_s for d in points.reduced.data])
    sentinel = np.array([d.plan.kind == "sentinel" for d in points.reduced.data])
    basis = "sentinels" if sentinel.any() else "repeats" if _repeated(fits) else "smooth curve"
    value, half = fit.drift * scale, fit.drift_half * scale
    return Drift(
        time_s=time[points.use],
        drift_n=value,
        low_n=value - half,
        high_n=value + half,
        sentinel_time_s=time[sentinel],
        sentinel_n=points.reduced.friction_n[sentinel],
        per_hour=effects.get("time"),
        per_decade_of_travel=effects.get("travel"),
        per_kelvin=effects.get("temperature"),
        interrupted=interrupted,
        basis=basis if carried else "not determined",
        spread_n=float(np.std(value)),
    )


def _effect(fits: Fits, column: Array, unit: str) -> Estimate | None:
    """Return the effect of one cause on mean friction; a smooth drift is estimated at the same time."""
    model = fits.friction.fit.model
    x = np.column_stack([model.x, column - column.mean()])
    if independent(x).size < x.shape[1] or x.shape[0] <= x.shape[1] + 1:
        return None
    return replace(model, x=x).fit().contrast(fits.scale_n * np.eye(x.shape[1])[-1], unit)


def _repeated(fits: Fits) -> bool:
    return bool((np.bincount(fits.points.cell[fits.points.use]) > 1).any())


def repeatability(fits: Fits, pure: Pure | None) -> Repeatability:
    """Return the standard deviations of a cycle's friction, from repeats and control runs if there are any."""
    fit = fits.friction
    scale = pure.level_n if pure is not None and fit.logarithmic else fits.scale_n
    if pure is not None:
        within = pure.estimate.scaled(scale)
    else:
        noise = float(np.sqrt(np.mean(fit.data.noise))) * scale
        within = fit.fit.deviation("cycle").scaled(scale)
        ends = {name: float(np.hypot(getattr(within, name), noise)) for name in ("value", "low", "high")}
        within = replace(within, **ends)
    between = total = None
    if fits.blocks is not None:
        between = fit.fit.deviation("block").scaled(scale)
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
    """Estimate the standard deviation of a cycle from repeats and control runs, independent of the curves.

    Cycles at one condition and speed are used, after subtracting their mean, a line over the campaign and the means of
    the blocks. The mean of several cycles scatters less and has a larger weight. None if nothing
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
    blocks = shares_of([[d.plan.block for d in points.members[i]] for i in use])
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
    sentinel = np.array([d.plan.kind == "sentinel" for d in data])
    others = np.bincount(cell[~sentinel], minlength=int(cell.max()) + 1)  # one more sweep at the point of the sentinels
    kinds = (["repeats"] if others.max() > 1 else []) + (["sentinels"] if sentinel.any() else [])
    basis = " and ".join(kinds)
    estimate = Estimate(value, low, high, value / float(np.sqrt(2.0 * free)), "N", free)
    return Pure(estimate, float(points.reduced.friction_n[use].mean()), basis)
