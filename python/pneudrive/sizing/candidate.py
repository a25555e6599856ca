"""Candidates of a search: choices of parts that pass safe bounds, their preliminary results, and the uncertainty.

Safe bounds exclude choices that cannot do the task with any setting, without simulation. Every bound uses the
favourable end of each spread, so a removed choice fails in all samples.

A pair is a cylinder with a tube. The pair determines the air consumption of a cycle. A probe simulates a pair with the
widest valve and without flow control. The air consumption of the probe applies to all choices with this pair, and its
stroke time is a lower bound. A choice then passes three stages: nominal runs on a coarse grid of settings, tuned
settings, and spreads with an increasing number of samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from pneudrive import units
from pneudrive.arrays import Array, Keyed, NamedNumbers, Pair, Plain
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K
from pneudrive.describe.tables.parts import Gas
from pneudrive.simulation.bench_circuit import VACUUM, steady_flow
from pneudrive.sizing.checks import Shortage, SizedDrive, mechanical_checks, open_names, rank_of
from pneudrive.sizing.strokes import NEVER, DriveStrokes, StrokeResults, StrokeRuns, Tuned, cases, is_worth_more
from pneudrive.sizing.task import SAME_STROKE, SLOTS, DriveChoice, PartChoice, Parts, SizingTask, choices, grouped

#: Key of the ranking: see `SizedDrive.rank`.
Rank = tuple[Any, ...]

#: Lower bound of the air of a cycle before a pair is probed, as a fraction of the air that fills both sides (assumed).
LEAST_AIR = 0.7
#: Uncertainty of the estimated air and margin after the probe, the nominal grid and the tuning (assumed, checked by a
#: study of random tasks). The uncertainty of simulated spreads falls with the root of the number of samples.
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
        Rough or refined settings.
    is_tuned : bool
        Whether the settings are refined.
    drive : SizedDrive or None
        Results of the spreads with the most samples.
    samples : ndarray or None
        Margins and air of the samples that were simulated last in this process (`checks.simulated`).
    hardest : tuple of float or None
        Estimated air (kg), and upper bound of the margin from the samples with the smallest margins.
    lost : Shortage or None
        Reason why the choice cannot do the task; None if this is not known.
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
        """Return the ranking key for an air mass (kg) and a margin; with values of `outlook`, the best possible key."""
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


# --- Safe bounds without simulation.

#: Largest factor by which the gas ahead of a piston is compressed over a whole stroke (assumed): 1.5 allows for drives
#: faster than their choked speed.
COMPRESSED = 1.5
WAYS = "outwards", "back"


class SafeBounds:
    """Bounds that a choice of parts must pass to be able to do the task.

    Parameters
    ----------
    task : SizingTask
    tubes : sequence of PartChoice
        All tubes of the search.
    conductances : dict, optional
        Known conductances of the tubes, in m3/(s Pa).
    """

    def __init__(
        self, task: SizingTask, tubes: Sequence[PartChoice], conductances: Mapping[str, float] | None = None
    ) -> None:
        self.task = task
        self.tubes = dict(conductances or {})
        if not conductances:
            pressure = task.supply_pa
            for tube in tubes:  # the sonic conductance, from the choked flow
                path = [("tube", "1", "2")]
                flow = steady_flow({"tube": dict(tube.table)}, path, pressure, VACUUM * pressure, Gas())
                self.tubes[tube.name] = flow / (ANR_DENSITY_KG_M3 * pressure)
        ambient = task.ambient.pressure_pa
        self.low = task.supply_pa - task.supply.spread_pa
        self.gauge = task.supply_pa + task.supply.spread_pa - ambient
        weight = task.static_force_n - task.external_force_n
        light, heavy = 1.0 - task.spread.mass, 1.0 + task.spread.mass
        forces = ((weight, task.external_force_n), (-weight, -task.external_force_n))
        self.against = [min(light * own, heavy * own) + external for own, external in forces]  # out, back

    def part(self, part: PartChoice) -> Shortage | None:
        """Compare the task with the limits on the data sheet of a part."""
        most = part.printed_si("maximum_pressure", "Pa")
        if most is not None and self.gauge > most:
            return Shortage("supply pressure", 0.0, f"{part.name} allows at most {1e-5 * most:g} bar gauge")
        life = part.printed_si("b10_cycles", "")
        if life is not None and life < (needed := self.task.cycles or 0.0):
            return Shortage("life", life / needed, f"{part.name} has a B10 of {life:g} cycles")
        return None

    def cylinder(self, part: PartChoice) -> Shortage | None:
        """Return the reason why a cylinder cannot do the task with any valve, tube and flow control."""
        task, gauge, stroke = self.task, self.gauge, part.numbers["stroke"]
        areas = DriveChoice(part).areas_m2
        if abs(stroke - task.stroke_m) > SAME_STROKE * task.stroke_m:
            return Shortage("stroke", 0.0, f"the stroke of the part is {1e3 * stroke:g} mm")
        least = task.spread.friction[0] * part.numbers["friction.parameters.coulomb"]
        held = max(least, task.holding_force_n), least
        for way, against, more, area in zip(WAYS, self.against, held, areas, strict=True):
            if (most := gauge * area) < (needed := against + more):
                return Shortage("force", max(most, 0.0) / needed, f"{way}: {most:.0f} N at most, {needed:.0f} N needed")
        if (shortage := self.part(part)) is not None:
            return shortage
        for check in mechanical_checks(part, task):
            if check.is_kept is False:
                return Shortage(check.name, (check.limit or 0.0) / check.value, check.numbers)
        holding, push = part.printed_si("coupling_holding_force", "N"), gauge * areas[0]
        if holding is not None and push > holding:
            said = f"the coupling holds {holding:g} N, the piston pushes {push:.0f} N"
            return Shortage("coupling", holding / push, said)
        # Time of a stroke under constant full force, without friction.
        piston = part.numbers["moving_mass"] * (1.0 - task.spread.assumed * ("moving_mass" in part.assumed))
        mass = piston + task.mass_kg * (1.0 - task.spread.mass)
        forces = (gauge * area - against for against, area in zip(self.against, areas, strict=True))
        return self._late(math.sqrt(2.0 * task.stroke_m * mass / f) if f > 0.0 else math.inf for f in forces)

    def fits(self, choice: DriveChoice) -> Shortage | None:
        """Return the reason why a part does not fit the tube, or why the gas cannot leave the cylinder in time.

        A missing part counts as ideal. A part without a tube diameter fits.
        """
        tube = choice.tube.tube_diameter_m
        for part in (choice.cylinder, choice.valve, choice.flow_control):
            takes = part.tube_diameter_m
            if tube is not None and takes is not None and not math.isclose(takes, tube):
                said = f"{part.name} fits tubes of {1e3 * takes:g} mm, {choice.tube.name} has {1e3 * tube:g} mm"
                return Shortage("connection", 0.0, said)
        return self.vents(choice)

    def vents(self, choice: DriveChoice) -> Shortage | None:
        """Return the reason why the gas cannot leave the cylinder in time, with choked flow ahead of the piston."""
        spread = self.task.spread
        wide = 1.0 + 2.0 * spread.conductance
        sizes = choice.exhaust_sizes(self.tubes[choice.tube.name])
        hot = self.task.temperatures_k[1]
        speed = min(sizes) * wide * ANR_DENSITY_KG_M3 * AIR_GAS_CONSTANT_J_KG_K * math.sqrt(ANR_TEMPERATURE_K * hot)
        times = []
        for against, end, area in zip(self.against, "ba", choice.areas_m2[::-1], strict=True):
            driven = max(-against, 0.0)  # a load that pulls compresses the gas as well
            compressed = COMPRESSED + driven / (self.low * area)
            kept = (compressed - 1.0) * (1.0 + spread.assumed) * _dead(choice, end)
            times.append(max(area * self.task.stroke_m - kept, 0.0) / (compressed * speed))
        return self._late(times)

    def _late(self, times: Iterable[float]) -> Shortage | None:
        """Compare the least times of the strokes out and back with the task."""
        for way, limit, least in zip(WAYS, (self.task.outward_s, self.task.back_s), times, strict=True):
            if least > limit:
                return Shortage("time", limit / least, f"{way}: {least:.3g} s at least, {limit:.3g} s allowed")
        return None


#: Search for a nearest possible value: largest factor on the quantity, number of tried factors, number of bisections.
FARTHEST, TRIED, HALVINGS = 100.0, 48, 8


def nearest_possible(task: SizingTask, found: Parts, bounds: SafeBounds) -> tuple[str, ...]:
    """Return as text, for each quantity of the task, its nearest possible value if only this quantity is changed.

    With this value, a choice passes the safe bounds. A smaller change cannot suffice. Spreads may need a larger change.
    """
    gauge = task.supply_pa - task.ambient.pressure_pa
    back = task.return_time_s

    def later(f: float) -> Plain:
        return {"time_s": task.outward_s * f, "speed_m_s": None, "return_time_s": None if back is None else back * f}

    def supplied(f: float) -> Plain:
        pressure = units.parse_pressure(f"{gauge * f!r} Pa gauge")
        return {"supply": task.supply.model_copy(update={"pressure": pressure})}

    quantities: dict[str, tuple[str, float, float, Callable[[float], Plain]]] = {
        "time": ("s", task.outward_s, FARTHEST, later),
        "mass": ("kg", task.mass_kg, 1.0 / FARTHEST, lambda f: {"mass_kg": task.mass_kg * f}),
        "supply pressure": ("bar gauge", 1e-5 * gauge, FARTHEST, supplied),
    }
    for name, key in (("external force", "external_force_n"), ("holding force", "holding_force_n")):
        force: float = getattr(task, key)
        if force > 0.0:
            quantities[name] = "N", force, 1.0 / FARTHEST, lambda f, key=key, force=force: {key: force * f}
    said = []
    for name, (unit, value, farthest, changed) in quantities.items():
        factor = _nearest_factor(lambda f, changed=changed: _is_possible(task, changed(f), found, bounds), farthest)
        if factor is None:
            said.append(f"{name}: no value of this quantity alone suffices")
            continue
        word = "at least" if farthest > 1.0 else "at most"
        said.append(f"{name}: {word} {value * factor:.3g} {unit} (asked: {value:.3g} {unit})")
    return tuple(said)


def _nearest_factor(is_possible: Callable[[float], bool], farthest: float) -> float | None:
    """Return the smallest factor above 1 that makes the task possible. Larger factors may fail, because rods buckle."""
    step = math.log(farthest) / TRIED
    far = next((k * step for k in range(1, TRIED + 1) if is_possible(math.exp(k * step))), None)
    if far is None:
        return None
    near = far - step
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (near, middle) if is_possible(math.exp(middle)) else (middle, far)
    return math.exp(far)


def _is_possible(task: SizingTask, change: Keyed, found: Parts, bounds: SafeBounds) -> bool:
    """Return whether a choice passes the safe bounds of a changed task, with the widest parts."""

    def width(part: PartChoice) -> float:
        numbers = part.numbers
        needle = numbers.get("needle_conductance", math.inf)
        return bounds.tubes.get(part.name) or numbers.get("exhaust_conductance", numbers.get("conductance", needle))

    own = SafeBounds(task.model_copy(update=dict(change)), (), bounds.tubes)
    rest = [[one for one in found[slot] if own.part(one) is None] for slot in ("valve", "tube", "flow_control")]
    valve, tube, control = (max(parts, key=width, default=None) for parts in rest)
    if valve is None or tube is None or control is None:
        return False
    return any(
        own.cylinder(one) is None and own.vents(DriveChoice(one, valve, tube, control)) is None
        for one in found["cylinder"]
    )


def air_estimate_kg(cylinder: PartChoice, tube: PartChoice, task: SizingTask) -> float:
    """Return the air (kg) of a cycle in which both sides fill completely."""
    choice = DriveChoice(cylinder, tube=tube)
    volume = sum(choice.areas_m2) * task.stroke_m + _dead(choice, "a") + _dead(choice, "b")
    gauge = task.supply_pa - task.ambient.pressure_pa
    return gauge * volume / (AIR_GAS_CONSTANT_J_KG_K * task.ambient.temperature_k)


def _dead(choice: DriveChoice, end: str) -> float:
    """Return the volume (m3) on one side beyond the swept volume: dead volume, port of the cushion, tube."""
    numbers, tube = choice.cylinder.numbers, choice.tube.numbers
    own = numbers[f"dead_volume_{end}"] + numbers.get(f"cushion_{end}_port_volume", 0.0)
    return own + math.pi / 4.0 * tube["diameter"] ** 2 * tube["length"]


# --- Choices of parts that pass the safe bounds, as cylinders with tubes, and the reason for each removed choice.


class Pruning:
    """Parts of the catalogue for a task, without parts that cannot do the task with any settings.

    Parameters
    ----------
    task : SizingTask
    """

    def __init__(self, task: SizingTask) -> None:
        self.task = task
        self.pairs: list[TubedCylinder] = []
        self.dropped: list[Shortage] = []
        self.found = found = choices(task)
        self.bounds = bounds = SafeBounds(task, found["tube"])
        self.enumerated = math.prod(len(found[slot]) for slot in SLOTS)
        kept: Parts = {}
        for slot in SLOTS:
            lacks = {one.name: bounds.cylinder(one) if slot == "cylinder" else bounds.part(one) for one in found[slot]}
            kept[slot] = grouped([one for one in found[slot] if lacks[one.name] is None])
            for name, shortage in lacks.items():
                if shortage is not None:
                    self._drop({slot: name}, self.enumerated // len(found[slot]), shortage)
        for cylinder, tube in product(kept["cylinder"], kept["tube"]):
            # Leave out valves and flow controls that do not fit, or through which the gas cannot leave in time.
            valves, controls = kept["valve"], kept["flow_control"]
            slow = {one.name: bounds.fits(DriveChoice(cylinder, one, tube)) for one in valves}
            slow |= {one.name: bounds.fits(DriveChoice(cylinder, tube=tube, flow_control=one)) for one in controls}
            wide, open_ = ([one for one in every if slow[one.name] is None] for every in (valves, controls))
            for slot, every, others in (("valve", valves, len(controls)), ("flow_control", controls, len(wide))):
                for one in every:
                    if others and (shortage := slow[one.name]) is not None:
                        self._drop({"cylinder": cylinder.name, "tube": tube.name, slot: one.name}, others, shortage)
            if wide and open_:
                fill = air_estimate_kg(cylinder, tube, task)
                left = min(len(open_names(DriveChoice(cylinder, valve, tube), task)) for valve in wide)
                self.pairs.append(TubedCylinder(cylinder, tube, wide, open_, fill, bounds.tubes[tube.name], left))
        self.pairs.sort(key=lambda one: (one.open_checks, one.fill, one.cylinder.name, one.tube.name))

    def _drop(self, parts: dict[str, str], count: int, shortage: Shortage) -> None:
        self.dropped.append(shortage._replace(parts={slot: parts.get(slot, "*") for slot in SLOTS}, choices=count))
