"""Candidates of a search: preliminary results of a choice of parts, and their uncertainty.

A pair is a cylinder with a tube, which determine the air consumption of a cycle. A probe simulates a pair with the
widest valve and without flow control. Its air consumption applies to all choices with this pair, and its stroke time is
a lower bound. A choice then passes three stages: nominal runs on a coarse grid of settings, tuned settings, and spreads
with an increasing number of samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneudrive.arrays import Array, NamedNumbers, Pair
from pneudrive.sizing.checks import Shortage, SizedDrive, rank_of
from pneudrive.sizing.strokes import NEVER, DriveStrokes, StrokeResults, StrokeRuns, Tuned, cases, is_worth_more
from pneudrive.sizing.task import DriveChoice, PartChoice, SizingTask

#: Key of the ranking: see `SizedDrive.rank`.
Rank = tuple[Any, ...]

#: Lower bound of the air of a cycle before a pair is probed, as a fraction of the air that fills both sides (assumed).
LEAST_AIR = 0.7
#: Uncertainty of the estimated air and margin after the probe, the nominal grid and the tuning (assumed, checked by a
#: study of random tasks). That of simulated spreads falls with the root of the number of samples.
AIR_SLACK = {"probed": 0.04, "rough": 0.02, "tuned": 0.015}
MARGIN_SLACK = {"rough": 0.05, "tuned": 0.03}
SPREAD_SLACK, SPREAD_AIR, HARDEST_AIR = 0.4, 0.1, 0.002
#: Largest gain in margin by a narrower valve or flow control, compared with the widest one with a tuned needle
#: (assumed, as above).
VALVE_SLACK = 0.04


@dataclass(eq=False)
class TubedCylinder:
    """A cylinder with a tube, and the valves and flow controls that pass the safe bounds.

    Attributes
    ----------
    cylinder, tube : PartChoice
    valves, flow_controls : list of PartChoice
    fill : float
        Air that fills both sides, in kg.
    tube_flow : float
        Conductance of the tube, in m3/(s Pa).
    open_checks : int
        Smallest number of open checks over all choices with the pair.
    air : float or None
        Air (kg) of a nominal cycle with the widest valve; None before the probe.
    times : tuple of float
        Times of the nominal strokes out and back, in s.
    late : Shortage or None
        Reason why no choice with the pair can do the task; None if this is not known.
    """

    cylinder: PartChoice
    tube: PartChoice
    valves: list[PartChoice]
    flow_controls: list[PartChoice]
    fill: float
    tube_flow: float
    open_checks: int = 0
    air: float | None = None
    times: Pair = (math.inf, math.inf)
    late: Shortage | None = None

    @property
    def least_air(self) -> float:
        """Least air of a cycle over all choices with the pair, in kg."""
        return LEAST_AIR * self.fill if self.air is None else (1.0 - AIR_SLACK["probed"]) * self.air

    @property
    def rank(self) -> Rank:
        """Lower bound of the first part of the ranking key, over all choices with the pair."""
        return rank_of(self.open_checks, self.least_air, 1.0)

    def probe(self, task: SizingTask) -> list[StrokeRuns]:
        """Return both strokes in the nominal and the fast case, with the widest and earliest opening of all valves."""
        numbers: NamedNumbers = dict(self.valves[0].numbers)
        for valve in self.valves:
            paths = DriveChoice(self.cylinder, valve, self.tube).valve_paths
            for before, path in (("", paths["feed"]), ("exhaust_", paths["vent"])):
                for key in ("conductance", "critical_pressure_ratio"):
                    numbers[before + key] = max(path[key], numbers.get(before + key, 0.0))
        early = {
            key: min((one.numbers[key] for one in self.valves if key in one.numbers), default=0.0)
            for key in ("time_on", "time_off", "delay", "travel_share")
        }
        kinds = {one.kind for one in self.valves}
        first = self.valves[0] if len(kinds) == 1 else replace(self.valves[0], table={"kind": "valve/switching-5/2"})
        if len(kinds) > 1:  # any valve may open first
            early["time_on"] = early["time_off"] = min(value for key, value in early.items() if key != "travel_share")
        assumed = frozenset().union(*(one.assumed for one in self.valves))
        widest = replace(first, numbers=numbers | early, assumed=assumed)
        strokes = DriveStrokes(DriveChoice(self.cylinder, widest, self.tube), task)
        ones = np.ones((2, 4))
        return [StrokeRuns(strokes, way, cases(task, way)[[0, 2]], ones) for way in (True, False)]

    def take(self, task: SizingTask, out: StrokeResults, back: StrokeResults) -> list[SizingCandidate]:
        """Store the results of the probe, and return the candidates with the pair; empty if a stroke is too slow."""
        self.air = float(out.air[0] + back.air[0])
        self.times = float(out.time[0]), float(back.time[0])
        for way, (_, time), limit in (("out", out.time, task.outward_s), ("back", back.time, task.back_s)):
            if time > limit:
                least = f"{time:.4g} s" if time < math.inf else "no arrival"
                reason = f"time {way}: {least} with the widest valve in the fast case, {limit:.4g} s allowed"
                parts = {"cylinder": self.cylinder.name, "valve": "*", "tube": self.tube.name, "flow_control": "*"}
                count = len(self.valves) * len(self.flow_controls)
                self.late = Shortage("time", limit / time, reason, parts, count)
        if self.late:
            return []
        valves = sorted(self.valves, key=lambda one: (-one.exhaust_conductance, -one.numbers["conductance"], one.name))
        wide = self._opened(DriveChoice(self.cylinder, valves[0], self.tube))
        limits = task.outward_s, task.back_s
        made, widest = [], None
        for control in sorted(self.flow_controls, key=lambda one: -one.numbers.get("needle_conductance", 0.0)):
            first = None
            for valve in valves:
                choice = DriveChoice(self.cylinder, valve, self.tube, control)
                opened = self._opened(choice)
                slower = wide / opened
                margins = [1.0 - slower * time / limit for time, limit in zip(self.times, limits, strict=True)]
                lead = first or widest
                if not choice.is_throttled:  # a needle imitates a narrower valve
                    lead = widest if widest is not None and self._opened(widest.choice) >= opened else None
                made.append(SizingCandidate(DriveStrokes(choice, task), self, min(margins), lead))
                first = first or made[-1]
            widest = widest or first
        return made

    def _opened(self, choice: DriveChoice) -> float:
        """Return the conductance of the exhaust path with open needles, from its parts in series."""
        return sum(size**-2.0 for size in choice.exhaust_sizes(self.tube_flow)) ** -0.5


@dataclass(eq=False)
class SizingCandidate:
    """A choice of parts in the stages of the search.

    Attributes
    ----------
    strokes : DriveStrokes
    pair : TubedCylinder
    guess : float
        Margin of the stroke time, estimated from the conductances in series.
    lead : SizingCandidate or None
        A choice that is run first: the same parts with the widest valve or flow control, because a needle limits the
        flow anyway. Without flow controls, a choice has a lead only if the lead's exhaust path is at least as wide.
    settings : Tuned or None
        Rough settings, or refined ones.
    is_tuned : bool
        Whether the settings are refined.
    drive : SizedDrive or None
        Results of the spreads with the most samples.
    samples : ndarray or None
        Margins and air of the samples that were simulated last in this process (`checks.simulated`).
    hardest : tuple of float or None
        Air (kg) and largest margin, from the samples with the smallest margins.
    lost : Shortage or None
        Reason why the choice cannot do the task; None while it may.
    """

    strokes: DriveStrokes
    pair: TubedCylinder
    guess: float
    lead: SizingCandidate | None = None
    settings: Tuned | None = None
    is_tuned: bool = False
    drive: SizedDrive | None = None
    samples: Array | None = None
    hardest: Pair | None = None
    lost: Shortage | None = None

    @property
    def choice(self) -> DriveChoice:
        """Parts of the candidate."""
        return self.strokes.choice

    @property
    def cylinder(self) -> str:
        """Name of the cylinder."""
        return self.choice.cylinder.name

    @property
    def open_checks(self) -> int:
        """Number of open checks of this candidate; a lower bound until the spreads are simulated."""
        return self.pair.open_checks if self.drive is None else self.drive.open_checks

    @property
    def draws(self) -> int:
        """Number of samples that are simulated."""
        return 0 if self.drive is None else self.drive.draws

    def rank_at(self, air: float, margin: float) -> Rank:
        """Return the ranking key for an air (kg) and a margin; for those of `outlook`, the best possible key."""
        return rank_of(self.open_checks, air, margin, self.choice.sizes, self.choice.name)

    def outlook(self, final: int) -> Pair:
        """Return the least air (kg) and the largest margin that are possible after `final` samples."""
        if self.hardest is not None:
            air, margin = self.hardest
            return air * (1.0 - HARDEST_AIR), margin
        if (drive := self.drive) is not None:
            spread = drive.draws**-0.5 - final**-0.5
            return drive.air * (1.0 - SPREAD_AIR * spread), drive.margin + SPREAD_SLACK * spread
        if self.is_slow:
            return self.pair.least_air, self.settings.least if self.settings else NEVER
        if self.settings is not None:
            stage = "tuned" if self.is_tuned else "rough"
            return self.settings.air * (1.0 - AIR_SLACK[stage]), self.settings.least + MARGIN_SLACK[stage]
        if self.lead is None:
            return self.pair.least_air, 1.0
        return self.pair.least_air, self.lead.outlook(final)[1] + (0.0 if self.lead.is_slow else VALVE_SLACK)

    @property
    def is_slow(self) -> bool:
        """Whether this candidate or its wider lead is too slow even with open needles in the fast case."""
        if self.settings is None:
            return self.lead is not None and self.lead.is_slow
        return not self.settings.times

    def lose(self, limit: str, reason: str) -> None:
        """Reject the candidate because of a limit that it misses."""
        self.lost = Shortage(limit, 0.0, reason, self.choice.parts)

    @property
    def known(self) -> float | None:
        """Expected margin over the spreads, from the last runs; None before the first run."""
        if self.drive is not None:
            return self.drive.margin if self.hardest is None else self.hardest[1]
        return None if self.settings is None else min(self.settings.least, self.settings.nominal)

    def take_settings(self, found: Tuned, *, is_tuned: bool) -> None:
        """Store rough or tuned settings."""
        self.settings, self.is_tuned = found, is_tuned
        name, limit, value = found.short
        if found.nominal < 0.0:
            self.lose(name, f"{value:.3g} in the nominal case, limit {limit:.3g} (SI)")
        elif not is_tuned and not is_worth_more(found):
            self.lose("spreads", f"margin of {100.0 * found.least:.0f} % in the worst case")
