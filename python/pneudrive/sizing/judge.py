"""Whether drives meet a task: margins in each sample, the worst 1 %, and the probability with its bound."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.constants import IMPACT_ENERGY_J_M2
from pneudrive.sizing.strokes import DRAWN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.sizing.choices import DriveChoice
    from pneudrive.sizing.strokes import StrokeResults
    from pneudrive.sizing.task import SizingTask

    Array = NDArray[np.float64]

#: The requirement is met with this probability; what is called worst is passed by the rest of the draws.
PROBABILITY = 0.99
#: Confidence of the bound of Clopper and Pearson, one-sided.
CONFIDENCE = 0.95
#: Of a number of draws.
ROUNDING = 1e-9
#: Margin of a draw that does not arrive.
NEVER = -1.0


class LimitMargin(NamedTuple):
    """One limit of a task, and how the samples keep it.

    Attributes
    ----------
    name, unit : str
    limit : float
        SI, without the margin that the task keeps.
    worst : float
        Value that 1 % of the draws pass, SI.
    margins : ndarray, shape (n,)
        Share of the limit that each draw leaves; below 0 where it does not keep the limit.
    values : ndarray, shape (n,)
    """

    name: str
    unit: str
    limit: float
    worst: float
    margins: Array
    values: Array

    @property
    def margin(self) -> float:
        """Margin that 99 % of the samples reach."""
        return float(np.quantile(self.margins, 1.0 - PROBABILITY, method="lower"))


def limits(task: SizingTask, choice: DriveChoice, out: StrokeResults, back: StrokeResults) -> list[LimitMargin]:
    """Return the limits of a task with the margins of the draws.

    Parameters
    ----------
    task : SizingTask
    choice : DriveChoice
    out, back : StrokeResults
        Of the same draws.
    """
    keep = 1.0 - task.margin
    found = []

    def most(name: str, unit: str, limit: float | None, values: Array) -> None:
        if limit is not None:
            with np.errstate(invalid="ignore"):
                margins = np.where(np.isfinite(values), 1.0 - values / (keep * limit), NEVER)
            found.append(LimitMargin(name, unit, limit, worst(values), margins, values))

    most("time out", "s", task.outward_s, out.time)
    most("time back", "s", task.back_s, back.time)
    for way, one in (("out", out), ("back", back)):
        most(f"end speed {way}", "m/s", task.end_speed_m_s, one.end_speed)
        most(f"energy {way}", "J", energy_limit(task, choice)[0], one.energy)
    peak = np.maximum(out.peak_pressure, back.peak_pressure)
    most("peak pressure", "Pa", peak_limit(task, choice), peak)
    if task.holding_force_n:
        held = out.force / task.holding_force_n
        margins = np.where(np.isfinite(out.time), held * keep - 1.0, NEVER)
        found.append(LimitMargin("holding force", "N", task.holding_force_n, -worst(-out.force), margins, out.force))
    return found


def peak_limit(task: SizingTask, choice: DriveChoice) -> float | None:
    """Return the largest allowed absolute pressure in the cylinder: from the task, or from its sheet."""
    ambient = task.ambient.pressure_pa
    if task.peak_pressure is not None:
        return task.peak_pressure.absolute_pa(ambient)
    printed = choice.cylinder.printed_si("maximum_pressure", "Pa")
    return None if printed is None else printed + ambient


def energy_limit(task: SizingTask, choice: DriveChoice) -> tuple[float, str]:
    """Return the largest allowed energy at an end, J, and its origin: task and data sheet, or else an assumed rule."""
    stated = {"task": task.impact_energy_j, "data sheet": choice.cylinder.printed_si("cushion_energy", "J")}
    known = {origin: limit for origin, limit in stated.items() if limit is not None}
    if known:
        origin = min(known, key=lambda name: known[name])
        return known[origin], origin
    rule = f"assumed: {1e-3 * IMPACT_ENERGY_J_M2:g} mJ for each mm2 of piston; neither task nor data sheet has a limit"
    return IMPACT_ENERGY_J_M2 * max(choice.areas_m2), rule


def worst(values: Array) -> float:
    """Return the value that at most 1 % of the samples exceed."""
    return float(np.quantile(values, PROBABILITY, method="higher"))


def passed(draws: int) -> int:
    """Return the number of samples that may exceed the worst value."""
    return math.floor((1.0 - PROBABILITY) * (draws - 1) + ROUNDING)


def interval(values: Array) -> tuple[float, float]:
    """Return the 1 % and 99 % quantiles over the samples."""
    return float(np.quantile(values, 1.0 - PROBABILITY, method="lower")), worst(values)


def is_met(found: list[LimitMargin]) -> NDArray[np.bool_]:
    """Return which samples keep all limits."""
    return np.all([one.margins >= 0.0 for one in found], axis=0)


def probability_bound(met: int, draws: int) -> float:
    """Return the one-sided lower bound of a probability at 95 % confidence, after Clopper and Pearson.

    The bound is valid for independent samples; samples of a Sobol sequence are more even.

    Examples
    --------
    >>> round(probability_bound(1024, 1024), 4)
    0.9971
    """
    from scipy.stats import beta

    return float(beta.ppf(1.0 - CONFIDENCE, met, draws - met + 1)) if met else 0.0


def explained(draws: Array, margins: Array) -> dict[str, float]:
    """Return the fraction of the variance of the margins' ranks that each sampled number explains.

    Parameters
    ----------
    draws : ndarray, shape (n, len(DRAWN))
    margins : ndarray, shape (n,)
    """
    ranks = margins.argsort().argsort().astype(float)
    if np.ptp(margins) == 0.0:
        return dict.fromkeys(DRAWN, 0.0)
    columns = draws.argsort(axis=0).argsort(axis=0).astype(float)
    return {name: float(np.corrcoef(column, ranks)[0, 1] ** 2) for name, column in zip(DRAWN, columns.T, strict=True)}
