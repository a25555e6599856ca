"""Simulation results of a choice of parts, over the spreads or from nominal runs, and the ranking key."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.sizing.judge import PROBABILITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

#: Airs that differ by less than this factor rank by margin.
SAME_AIR = 1.02


def rank_of(air: float, margin: float, *rest: Any) -> tuple[Any, ...]:  # noqa: ANN401 - what decides between equals
    """Return the ranking key: air in steps of 2 %, then margin in steps of 1 %, then sizes."""
    step = round(math.log(air) / math.log(SAME_AIR)) if 0.0 < air < math.inf else 10**9
    return step, -round(margin, 2), *rest


@dataclass(frozen=True)
class SizedDrive:
    """Simulation results of one choice of parts with its settings; SI.

    Attributes
    ----------
    parts : dict
        Slot (cylinder, valve, tube, flow_control) -> part of the catalogue.
    setting : dict
        Openings of the needles, shares of fully open.
    draws, met : int
        Draws, and those that keep all limits.
    probability_bound : float
        Lower bound of the probability, one-sided, 95 % confidence.
    time_out, time_back, end_speed, energy, peak_pressure : float
        Values that 1 % of the draws pass; the last three the worse of both strokes. Infinite: the stroke does not end.
    air : float
        Mean mass drawn from the supply in a cycle, kg.
    margins : dict
        Limit -> margin that 99 % of the draws have.
    worst : dict
        Limit -> (value that 1 % of the draws pass, limit, unit).
    measure : str
        The assumed value that most of the margin goes with; empty where none does.
    explains : float
        Share of the variance of the margin's ranks that goes with it.
    sizes : tuple of float
        Bore, conductance of the valve, of the needle fully open (0 without), bore of the tubes.
    intervals : dict
        Figure -> values that 99 % and that 1 % of the draws pass: each limit by its name, and time_out, time_back,
        end_speed, energy, peak_pressure, air, load_ratio_out, load_ratio_back (`DriveStrokes.load_ratio`). Empty in
        folders of earlier versions.
    """

    parts: Mapping[str, str]
    setting: Mapping[str, float]
    draws: int
    met: int
    probability_bound: float
    time_out: float
    time_back: float
    end_speed: float
    energy: float
    peak_pressure: float
    air: float
    margins: Mapping[str, float]
    worst: Mapping[str, tuple[float, float, str]]
    measure: str
    explains: float
    sizes: Sequence[float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def load_ratio(self) -> float | None:
        """Ratio of load to supply force that 1 % of the samples exceed; the worse of both strokes."""
        ends = [self.intervals[name][1] for name in ("load_ratio_out", "load_ratio_back") if name in self.intervals]
        return max(ends, default=None)

    @property
    def name(self) -> str:
        """Names of its parts in one word."""
        return "+".join(self.parts.values())

    @property
    def is_feasible(self) -> bool:
        """Whether it meets the task with the required probability."""
        return self.met >= PROBABILITY * self.draws

    @property
    def binding(self) -> str:
        """Limit with the least margin."""
        return min(self.margins, key=lambda name: self.margins[name])

    @property
    def margin(self) -> float:
        """Least margin that 99 % of the samples reach."""
        return self.margins[self.binding]

    @property
    def air_litres_anr(self) -> float:
        """Air of a cycle, litres at the standard reference atmosphere."""
        return self.air * ANR_LITRES_PER_KG

    @property
    def rank(self) -> tuple[Any, ...]:
        """Key of the ranking: air in steps of 2 %, then margin in steps of 1 %, then sizes."""
        return rank_of(self.air, self.margin, tuple(self.sizes), self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)


@dataclass(frozen=True)
class Provisional:
    """A place in the provisional ranking, by nominal runs; SI.

    Attributes
    ----------
    parts : dict
    air : float
        Mass drawn from the supply in a cycle, kg.
    times : tuple of float
        Of the strokes out and back.
    margin : float
        Least margin of the cases nominal, slow and fast. Settings are rough: tuning finds larger ones.
    """

    parts: Mapping[str, str]
    air: float
    times: tuple[float, ...]
    margin: float

    @property
    def name(self) -> str:
        """Names of its parts in one word."""
        return "+".join(self.parts.values())
