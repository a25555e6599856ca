"""Simulation of both strokes of a choice of parts: times, speeds and air of each sample; tuning of the settings.

Times and speeds are defined as in a datasheet (`pneudrive.datasheet.strokes`). The time runs from the command to the
first contact with the end. The speed at the end is that of the fastest contact. To save time, this module computes
these numbers in the core, without trajectories. A test checks that both methods agree within 1e-6.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Generator, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.arrays import Array, Bools, Columns, Keyed, NamedNumbers, Plain, by_name
from pneudrive.batching import processors
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K, STANDARD_GRAVITY_M_S2
from pneudrive.describe.circuit import Circuit
from pneudrive.describe.system import System
from pneudrive.ensemble.outputs import MemberPlans, Reduction
from pneudrive.ensemble.variation import DONE, CoreMembers, Starts, run_members
from pneudrive.sizing.task import PROPORTIONAL, DriveChoice, PartChoice, SizingTask, energy_limit, peak_limit

Search = Generator["StrokeRuns", "StrokeResults", Any]


#: Sampled quantities, in the order of the columns of a sample.
DRAWN = (
    "supply pressure",
    "load",
    "friction",
    "valve conductance",
    "tube conductance",
    "needle",
    "dead volume",
    "temperature",
    "mass of the piston",
    "valve time",
    "cushion",
    "heat transfer",
)
#: Random seed of the samples.
SEED = 0
#: Relative tolerances of runs of the ten best choices, and of all others. Compared with 1e-6, times differ by less than
#: 0.01 %. With the coarse tolerance, end speeds differ by less than 0.1 %, and air by less than 0.2 % (tested).
RTOL, COARSE = 1e-4, 1e-3
#: Keys of a task that a circuit keeps as labels, for its data sheet.
STATED = ("held_by", "clamp_force", "impact_energy")
#: Duration of a run: multiple of the longest time that the task allows, plus a time, s. Slower samples count as not
#: arriving.
LONGEST, LONGER_S = 1.4, 0.1
#: Exponent of the conductance of a tube over its bore, accurate enough for its spread.
BORE_POWER = 2.3
#: Letter of a chamber in the path of a number.
_CHAMBER = re.compile(r"_[ab](?=[._]|$)")
#: Exponent that converts the factor of heat transfer in chambers to that in tubes: 2 becomes 1.4.
TUBE_HEAT_POWER = 0.485


class Setting(NamedTuple):
    """Settings of the needles, as fractions of fully open.

    Attributes
    ----------
    needle_out, needle_back : float
        Needles of the flow controls at chambers b and a, which throttle the outward stroke and the return stroke.
    cushion_out, cushion_back : float
        Needles of the cushions at the ends of the outward stroke and of the return stroke.
    """

    needle_out: float = 1.0
    cushion_out: float = 1.0
    needle_back: float = 1.0
    cushion_back: float = 1.0


#: All needles fully open.
OPEN = Setting()


class StrokeResults(NamedTuple):
    """Results of n runs of one stroke, in SI units. Each array has the shape (n,).

    Attributes
    ----------
    time : ndarray
        Time from the command to the first contact with the end; infinite if the run ended before this contact.
    end_speed, energy : ndarray
        Greatest speed and energy at a contact with the end; 0 without a contact. After a rebound, a piston may be
        faster than at its first contact.
    peak_pressure : ndarray
        Largest pressure of both chambers, absolute.
    air : ndarray
        Mass drawn from the supply.
    force : ndarray
        Force of the piston on the end stop at the end of the run.
    """

    time: Array
    end_speed: Array
    energy: Array
    peak_pressure: Array
    air: Array
    force: Array


@dataclass(frozen=True)
class DriveStrokes:
    """Strokes of a choice of parts under a task.

    Attributes
    ----------
    choice : DriveChoice
    task : SizingTask
    return_share : float
        Gauge pressure for the return stroke divided by the gauge pressure of the supply; below 1 with a regulator.
    """

    choice: DriveChoice
    task: SizingTask
    return_share: float = 1.0

    def run(self, outward: bool, draws: Array, settings: Array | Setting, rtol: float = COARSE) -> StrokeResults:
        """Run one stroke of n members; see `StrokeRuns` for the parameters. All members may have one setting."""
        rows = np.broadcast_to(np.asarray(settings), (len(draws), len(OPEN)))
        return run_all([StrokeRuns(self, outward, draws, rows)], rtol)[0]

    def load_ratio(self, outward: bool, draws: Array) -> Array:
        """Return, for each sample, the ratio of load to supply force at rest. Above 1, the load does not move.

        The load is the weight of load and piston, the external force, and the friction of cylinder and guide. For the
        outward stroke, the load is at least the holding force. The supply force is the gauge pressure of the supply
        times the piston area, with the other chamber at ambient.

        Parameters
        ----------
        outward : bool
        draws : ndarray, shape (n, len(DRAWN))
        """
        task, numbers, factors = self.task, self._numbers, self._factors(draws)

        def drawn(path: str) -> Array:
            return numbers[path] * factors[path]

        mass = drawn("load.mass") + drawn("cylinder.moving_mass")
        weight = mass * STANDARD_GRAVITY_M_S2 * math.sin(task.incline_rad)
        against = (1.0 if outward else -1.0) * (weight + task.external_force_n)
        held = task.holding_force_n if outward else 0.0
        friction = np.maximum(drawn("cylinder.friction.parameters.coulomb"), held)
        gauge = task.supply_pa - task.ambient.pressure_pa + task.supply.spread_pa * (2.0 * draws[:, 0] - 1.0)
        gauge *= 1.0 if outward else self.return_share
        return (against + friction) / (gauge * self.choice.areas_m2[0 if outward else 1])

    def circuit(self, setting: Setting = OPEN) -> Circuit:
        """Return the circuit with these settings: supply, valve, tubes, flow controls, cylinder and load."""
        valve = {"valve": dict(self.choice.valve.table)}
        return self._around(valve, ("supply -> valve.1",), ("valve.4", "valve.2"), setting)

    def _around(
        self,
        valve: Keyed,
        joined: tuple[str, ...],
        ends: tuple[str, str],
        setting: Setting = OPEN,
    ) -> Circuit:
        """Return the circuit around a valve whose two `ends` are connected to chambers a and b."""
        choice, task = self.choice, self.task
        cylinder = dict(choice.cylinder.table)
        components: Plain = {
            "supply": {"kind": "reservoir", "pressure": str(task.supply.pressure)},
            **valve,
            "tube_a": dict(choice.tube.table),
            "tube_b": dict(choice.tube.table),
            "cylinder": cylinder,
            "load": {"kind": "load", "mass": f"{task.mass_kg!r} kg", "force": f"{-task.external_force_n!r} N"},
        }
        connections = list(joined)
        for side, start, (needle, cushion) in zip("ab", ends, (setting[2:], setting[:2]), strict=True):
            line = [start, f"tube_{side}"]
            if choice.is_throttled:
                of, key = choice.flow_control, "needle_conductance"
                table = {name: one for name, one in of.table.items() if not name.startswith("needle_")}
                components[f"flow_control_{side}"] = table | {key: _opened_value(of.numbers[key], needle)}
                line.append(f"flow_control_{side}")
            if choice.is_cushioned:
                key = f"cushion_{side}_needle_conductance"
                cylinder[key] = _opened_value(choice.cylinder.numbers[key], cushion)
            connections.append(" -> ".join((*line, f"cylinder.{side}")))
        return Circuit(
            name=f"{task.name}: {choice.name}",
            ambient=task.ambient,
            components=components,
            connections=(*connections, "cylinder.rod -> load"),
            labels={key: value for key, value in task.to_dict().items() if key in STATED},
            initial={"cylinder.position": "0 mm", "cylinder.b": str(task.supply.pressure)},
        )

    def template_key(self, outward: bool) -> tuple[Any, ...]:
        """Return a key for the structure of the circuit of a stroke. Numbers do not affect this key.

        Choices with equal keys run in one ensemble.
        """
        parts, task = (self.choice.cylinder, self.choice.tube, self.choice.flow_control), self.task
        numbers = f"{task.stroke_m!r} {task.incline_rad!r} {task.external_force_n!r}"
        return outward, f"{numbers} {task.supply} {task.ambient.to_dict()}", *(part.form for part in parts)

    def template(self, outward: bool) -> tuple[System, NamedNumbers]:
        """Return circuit and start state of a stroke in the core's form; both are equal for equal keys."""
        key = self.template_key(outward)
        if key not in _TEMPLATES:
            paths = {}  # the two paths that the valve opens
            for name, of in self.choice.valve_paths.items():
                conductance = f"{of['conductance']!r} m3/(s Pa)"
                paths[name] = {"kind": "fitting", **of, "conductance": conductance}
            ends = ("feed.2", "vent.1") if outward else ("vent.1", "feed.2")
            joined = ("supply -> feed.1", "vent.2 -> ambient")
            circuit = self._around(paths, joined, ends)
            at = units.UnitFloat(0.0 if outward else self.task.stroke_m, "m", "mm")
            full, empty = ("b", "a") if outward else ("a", "b")
            pressures = {full: self.task.supply_pa, empty: self.task.ambient.pressure_pa}
            begun = circuit.core_initial(
                {"cylinder.position": at} | {f"cylinder.{side}": f"{p!r} Pa abs" for side, p in pressures.items()}
            )
            _TEMPLATES[key] = circuit.system, begun
        return _TEMPLATES[key]

    def opens_after(self, outward: bool, draws: Array) -> Array:
        """Return the time (s) from the command until the valve is open, for each sample.

        The edges of a switching valve open over the second half of its travel. The result is the time until three
        quarters of the travel.
        """
        valve, factors = self.choice.valve, self._factors(draws)
        if valve.kind == PROPORTIONAL:  # a servo valve
            lag = valve.numbers.get("frequency", 0.0)
            lag = valve.numbers["damping_ratio"] / (math.pi * lag) if lag else 0.0
            return valve.numbers["delay"] * factors["valve.delay"] + lag
        key = "time_on" if outward or valve.kind != "valve/switching-5/2" else "time_off"
        return valve.numbers[key] * factors[f"valve.{key}"] * (1.0 + 0.25 * valve.numbers["travel_share"])

    @cached_property
    def _numbers(self) -> NamedNumbers:
        """Numbers (SI) of all components by their paths in the core's form."""
        choice = self.choice
        parts: dict[str, Mapping[str, float]] = {**choice.valve_paths, "cylinder": choice.cylinder.numbers}
        parts["load"] = {"mass": self.task.mass_kg}
        for end in "ab":
            parts |= {f"tube_{end}": choice.tube.numbers, f"flow_control_{end}": choice.flow_control.numbers}
        return {f"{name}.{key}": value for name, of in parts.items() for key, value in of.items()}

    def members(self, outward: bool, draws: Array, settings: Array) -> CoreMembers:
        """Return the numbers and the start state of each run in the core's form."""
        task, rows = self.task, len(draws)
        whole = task.supply_pa + task.supply.spread_pa * (2.0 * draws[:, 0] - 1.0)
        reduced = task.ambient.pressure_pa + self.return_share * (whole - task.ambient.pressure_pa)
        supply, begun = (whole, reduced) if outward else (reduced, whole)
        temperature = _between(task.temperatures_k, draws, "temperature")
        numbers = self._numbers | {"supply.pressure": 1.0, "ambient.temperature_k": 1.0}
        needles = ("flow_control_{}.needle_conductance", "cylinder.cushion_{}_needle_conductance")
        opened = [needle.format(end) for end in "ba" for needle in needles]  # in the order of `Setting`
        stated = by_name(opened, settings.T) | {"supply.pressure": supply, "ambient.temperature_k": temperature}
        factors, paths, values = self._factors(draws), list(numbers), np.tile(list(numbers.values()), (rows, 1))
        for place, path in enumerate(paths):
            values[:, place] *= factors.get(_CHAMBER.sub("", path), 1.0)
            values[:, place] *= stated.get(path, 1.0)
        starts: Starts = {}
        for name, value in self.template(outward)[1].items():
            is_full = name.endswith("pressure_pa") and value == task.supply_pa
            own = begun if is_full else temperature if name.endswith("temperature_k") else value
            starts[name] = np.broadcast_to(np.asarray(own, dtype=float), rows)
        return CoreMembers(paths, values, starts)

    def _factors(self, draws: Array) -> Columns:
        """Return the factors with which the samples scale numbers of the drive.

        Keys are paths in the core's form, without the letters of the chambers.
        """
        choice, spread = self.choice, self.task.spread
        share = {name: 2.0 * column - 1.0 for name, column in zip(DRAWN, draws.T, strict=True)}

        def flow(part: PartChoice, key: str, name: str) -> Array:
            wide = 2.0 if any(one.startswith(key) and _is_size(one) for one in part.assumed) else 1.0
            return 1.0 + wide * spread.conductance * share[name]

        def assumed(part: PartChoice, key: str, name: str) -> Array:
            return 1.0 + spread.assumed * share[name] * (key in part.assumed)

        friction = _between(spread.friction, draws, "friction")
        valve = flow(choice.valve, "", "valve conductance")
        dead = assumed(choice.cylinder, "dead_volume_a", "dead volume")  # a sheet has both volumes or none
        heat = _between(np.log(spread.heat_transfer), draws, "heat transfer")
        times = {f"valve.{key}": assumed(choice.valve, key, "valve time") for key in ("time_on", "time_off", "delay")}
        return times | {
            "cylinder.friction.parameters.coulomb": friction,
            "cylinder.friction.parameters.breakaway": friction,
            "cylinder.friction.parameters.viscous": friction,
            "load.mass": 1.0 + spread.mass * share["load"],
            "feed.conductance": valve,
            "vent.conductance": valve,
            "tube.diameter": flow(choice.tube, "", "tube conductance") ** (1.0 / BORE_POWER),
            "flow_control.needle_conductance": flow(choice.flow_control, "needle", "needle"),
            "cylinder.cushion_needle_conductance": 1.0 + 2.0 * spread.conductance * share["cushion"],
            "cylinder.dead_volume": dead,
            "cylinder.cushion_port_volume": dead,
            "cylinder.heat_transfer_scale": np.exp(heat),
            "tube.heat_transfer_scale": np.exp(TUBE_HEAT_POWER * heat),
            "cylinder.moving_mass": assumed(choice.cylinder, "moving_mass", "mass of the piston"),
        }

    def drawn_assumed(self) -> dict[str, str]:
        """Return the values that are sampled because they are assumed, each with its component."""
        named = {
            "friction": "friction",
            "dead volume": "dead_volume",
            "mass of the piston": "moving_mass",
            "cushion": "cushion",
        }
        assumed = " ".join(("", *self.choice.cylinder.assumed))
        found = {name: "cylinder" for name, key in named.items() if f" {key}" in assumed}
        sizes = {"valve": "valve conductance", "tube": "tube conductance", "flow_control": "needle"}
        found |= {name: slot for slot, name in sizes.items() if any(map(_is_size, getattr(self.choice, slot).assumed))}
        if self.choice.valve.assumed & {"time_on", "time_off", "delay"}:
            found["valve time"] = "valve"
        return found


class StrokeRuns(NamedTuple):
    """Runs of one stroke of one choice.

    Attributes
    ----------
    strokes : DriveStrokes
    outward : bool
        Whether the stroke is outward, towards the end of chamber b.
    draws : ndarray, shape (n, len(DRAWN))
        Position of each sampled number in its range, 0 to 1.
    settings : ndarray, shape (n, 4)
        Rows of `Setting`.
    """

    strokes: DriveStrokes
    outward: bool
    draws: Array
    settings: Array


def run_all(asked: Sequence[StrokeRuns], rtol: float = COARSE) -> list[StrokeResults]:
    """Run strokes of any choices of one task. Strokes that differ only in numbers run together in one ensemble.

    Parameters
    ----------
    asked : sequence of StrokeRuns
    rtol : float
        Relative tolerance.
    """
    keys = [one.strokes.template_key(one.outward) for one in asked]
    groups = defaultdict[Any, list[StrokeRuns]](list)
    for key, one in zip(keys, asked, strict=True):
        groups[key].append(one)
    with ThreadPoolExecutor(processors()) as pool:  # one group is often too small for all processors
        runs = pool.map(lambda alike: _run_alike(alike, rtol), groups.values())
        found = {key: iter(results) for key, results in zip(groups, runs, strict=True)}
    return [next(found[key]) for key in keys]


def _run_alike(asked: Sequence[StrokeRuns], rtol: float) -> list[StrokeResults]:
    """Run strokes whose circuits differ only in numbers.

    The command is constant. Each valve is therefore modelled by two paths that are open from the start of the run, and
    its opening time is added to the stroke time. Without a command schedule, members run in SIMD lanes.
    """
    first, outward = asked[0].strokes, asked[0].outward
    each = [one.strokes.members(outward, one.draws, one.settings) for one in asked]
    starts: Starts = {name: np.concatenate([one.starts[name] for one in each]) for name in each[0].starts}
    members = CoreMembers(each[0].paths, np.concatenate([one.values for one in each]), starts)
    plans = MemberPlans({}, np.array([held_s(first.task)[0 if outward else 1]]))
    end_m = first.task.stroke_m if outward else 0.0
    kept = {
        "cylinder.position_m": ("time_when", "rate_when"),
        "cylinder.a.pressure_pa": ("max",),
        "cylinder.b.pressure_pa": ("max",),
        "supply.mass_flow_kg_s": ("integral",),
        "cylinder.end_stop_force_n": ("final",),
    }
    reductions = [
        Reduction(word, (column,), column, "", "", end_m, above=outward) for column in kept for word in kept[column]
    ]
    seen, status, _ = run_members(first.template(outward)[0], members, plans, rtol, reductions)
    arrived, speed, *peaks, air, force = seen
    late = np.concatenate([one.strokes.opens_after(outward, one.draws) for one in asked])
    time = np.where(np.isnan(arrived), np.inf, arrived + late)
    speed = np.where(np.isfinite(time), speed, 0.0)
    columns = dict(zip(members.paths, members.values.T, strict=True))
    mass = columns["cylinder.moving_mass"] + columns["load.mass"]
    failed = status != DONE
    for values in (time, *peaks, air):
        values[failed] = np.inf
    force = np.where(np.isfinite(time), np.nan_to_num(force if outward else -force), 0.0)
    whole = StrokeResults(time, speed, 0.5 * mass * speed**2, np.maximum(*peaks), np.abs(air), force)
    ends = np.cumsum([0, *(len(one.draws) for one in asked)])
    return [StrokeResults(*(values[low:high] for values in whole)) for low, high in pairwise(ends)]


def held_s(task: SizingTask) -> tuple[float, float]:
    """Return the times (s) for which both commands are held; a stated cycle period extends these times."""
    out, back = (LONGEST * limit + LONGER_S for limit in (task.outward_s, task.back_s))
    longer = max(1.0, 3600.0 / (task.cycles_per_hour or math.inf) / (out + back))
    return longer * out, longer * back


def cycle_s(task: SizingTask) -> float:
    """Return the period (s) of the cycle for which the air is stated."""
    return sum(held_s(task))


def points(n: int) -> Array:
    """Return points of a scrambled Sobol sequence, with the shape (n, len(DRAWN)).

    A smaller n gives the first points of the same sequence.
    """
    from scipy.stats import qmc

    return qmc.Sobol(len(DRAWN), rng=SEED).random_base2(max(n - 1, 1).bit_length())[:n]


#: Structure of a circuit -> the circuit in the core's form, and its start state.
_TEMPLATES: dict[tuple[Any, ...], tuple[System, NamedNumbers]] = {}


def _is_size(key: str) -> bool:
    """Return whether a key is the size of a flow path."""
    return key.endswith(("conductance", "nominal_flow", "kv", "cv", "diameter"))


def _between(ends: Iterable[float], draws: Array, name: str) -> Array:
    """Return samples of a number that is uniformly distributed over a range."""
    low, high = ends
    return low + (high - low) * draws[:, DRAWN.index(name)]


def _opened_value(whole: float, share: float) -> dict[str, str]:
    return {
        "value": f"{1e8 * share * whole:.4g} dm3/(s bar)",
        "assumed": f"set to {100.0 * share:.3g} % of fully open by the sizing",
    }


# --- Tuning of needles and cushions of one choice of parts: maximises the smallest margin over a few cases.

#: First grid in the nominal case: conductances of the needle, relative to the one that is just sufficient with choked
#: flow; and openings of the cushion.
NEEDLES = (0.75, 0.92, 1.12, 1.4, 1.8, 2.5, 4.0)
CUSHIONS = (0.06, 0.25, 1.0)
#: Factors of needle and cushion in two refinements about the best settings, over all cases.
FINER = (((0.8, 1.0, 1.25), (0.5, 1.0, 2.0)), ((0.86, 0.93, 1.0, 1.07, 1.15), (0.8, 1.0, 1.22)))
#: Number of samples that are run before the last refinement, and number of worst samples per limit that become cases of
#: this refinement.
MORE, WORST = 24, 5
#: Largest number of rounds of this refinement, and worst-case margin at which it ends early.
ROUNDS, SETTLED = 3, 0.1
#: Only limits whose margin exceeds the smallest one by at most this value select the first cases of a pair (assumed).
DECIDES = 0.3
#: Time margin by which a smaller opening may be faster, due to solver errors and rebounds (assumed).
TIME_SLACK = 0.03
#: Nominal margin below which settings are not refined, and the other stroke is not considered.
SMALL = -0.15
#: Worst-case margin below which rough settings are not refined further.
FAR = -0.15
#: Position in each range for the slow and the fast case (assumed: about 1 % of the samples are more extreme).
SLOW, FAST = 0.15, 0.85
#: Sampled quantities of which a low value makes a stroke slow. For all others, a high value makes it slow.
_HELPS = ("supply pressure", "valve conductance", "tube conductance", "needle", "cushion")
#: Margin of a case whose stroke does not end.
NEVER = -10.0


class Tuned(NamedTuple):
    """Settings of the needles of a choice, and the margins that the choice reaches with them.

    Attributes
    ----------
    setting : Setting
    nominal : float
        Least margin of the nominal case over both strokes; below 0 if no setting does the task.
    short : tuple
        Limit with the smallest margin: name, limit and value (SI). It refers to the nominal case if this case misses
        the task, otherwise to all cases.
    least : float
        Least margin of all cases.
    air : float
        Mass drawn from the supply in both strokes of the nominal case, in kg.
    times : tuple of float
        Times of the strokes in the nominal case, in s. Empty if a stroke with fully open needles is too slow even in
        the fast case.
    """

    setting: Setting
    nominal: float
    short: tuple[str, float, float]
    least: float = NEVER
    air: float = 0.0
    times: tuple[float, ...] = ()


def cases(task: SizingTask, outward: bool) -> Array:
    """Return the sampled numbers of the nominal, the slow and the fast case, with the shape (3, len(DRAWN))."""
    rows = np.full((3, len(DRAWN)), 0.5)
    low, high = task.spread.friction
    rows[0, DRAWN.index("friction")] = (1.0 - low) / (high - low) if low < 1.0 < high else 0.5
    pulls = (task.static_force_n if outward else -task.static_force_n) < 0.0
    for row, share in ((1, SLOW), (2, FAST)):
        for name in _HELPS:
            rows[row, DRAWN.index(name)] = share
        for name in ("friction", "valve time", "mass of the piston", "heat transfer"):
            rows[row, DRAWN.index(name)] = 1.0 - share
        rows[row, DRAWN.index("load")] = share if pulls else FAST
    return rows


def tune(strokes: DriveStrokes) -> Tuned:
    """Find the settings of both strokes of one choice."""
    (rough,) = tune_all([(strokes, None)])
    return tune_all([(strokes, rough)])[0] if is_worth_more(rough) else rough


def is_worth_more(rough: Tuned) -> bool:
    """Return whether refined settings may meet the task."""
    return rough.nominal >= 0.0 and rough.least >= FAR


def tune_all(every: Sequence[tuple[DriveStrokes, Tuned | None]]) -> list[Tuned]:
    """Find the settings of choices of one task. The next runs of all choices are simulated together.

    Parameters
    ----------
    every : sequence of pairs
        Strokes of each choice, and its rough settings to be refined, or None to search rough settings.
    """
    searches = [_rough(strokes) if rough is None else _fine(strokes, rough) for strokes, rough in every]
    asked = {place: next(one) for place, one in enumerate(searches)}
    found: dict[int, Tuned] = {}
    while asked:
        results = run_all(list(asked.values()))
        due, asked = by_name(asked, results), {}
        for place, result in due.items():
            try:
                asked[place] = searches[place].send(result)
            except StopIteration as end:  # noqa: PERF203 - a run takes longer
                found[place] = end.value
    return [found[place] for place in range(len(every))]


def _rough(strokes: DriveStrokes) -> Search:
    """Search rough settings of a choice: yield runs, receive their results, return the settings.

    If a stroke with fully open needles is too slow even in the fast case, no search is made, because no setting is
    faster.
    """
    task = strokes.task
    for outward, limit in ((True, task.outward_s), (False, task.back_s)):
        opened = yield StrokeRuns(strokes, outward, cases(task, outward)[2:], np.ones((1, 4)))
        time = float(opened.time[0])
        if time > limit:
            margin = 1.0 - time / limit if np.isfinite(time) else NEVER
            return Tuned(Setting(), margin, (f"time {'out' if outward else 'back'}", limit, time), margin)
    every, setting = [], Setting()
    for outward in (True, False):
        rows, grid = cases(task, outward), product(*_grid(strokes, outward))
        best = yield from _best(strokes, outward, setting, grid, rows[:1])
        if best.nominal >= SMALL:
            setting = best.setting
            best = yield from _best(strokes, outward, setting, _near(strokes, outward, setting, FINER[0]), rows)
        every, setting = [*every, best], best.setting
        if best.nominal < SMALL:
            break
    return _joined(every)


def _fine(strokes: DriveStrokes, rough: Tuned) -> Search:
    """Refine rough settings of a choice with runs in more cases."""
    every, setting, draws = [], rough.setting, points(MORE)
    for outward in (True, False):
        best, rows = rough, cases(strokes.task, outward)
        for _ in range(ROUNDS):
            asked = StrokeRuns(strokes, outward, draws, np.tile(np.array(setting), (MORE, 1)))
            named = _margins(strokes, outward, (yield asked))
            worst = np.unique([margins.argsort()[:WORST] for *_, margins in named])
            rows = np.unique(np.vstack([rows[3:], draws[worst]]), axis=0)  # with the openings of the previous round
            rows = np.vstack([cases(strokes.task, outward), rows])
            near = _near(strokes, outward, setting, FINER[1])
            best = yield from _best(strokes, outward, setting, near, rows)
            is_settled, setting = best.setting == setting, best.setting
            if is_settled or best.least >= SETTLED:
                break
        every.append(best)
    return _joined(every)


def _joined(every: Sequence[Tuned]) -> Tuned:
    """Return the settings of both strokes as one result."""
    nominal, least = min(one.nominal for one in every), min(one.least for one in every)
    worse = min(every, key=lambda one: one.nominal if nominal < 0.0 else one.least)
    air, times = sum(one.air for one in every), tuple(one.times[0] for one in every)
    return Tuned(every[-1].setting, nominal, worse.short, least, air, times)


def _grid(strokes: DriveStrokes, outward: bool) -> tuple[Sequence[float], Sequence[float]]:
    """Return the first grid of openings of needle and cushion."""
    task, choice, needles = strokes.task, strokes.choice, [1.0]
    if choice.is_throttled:  # about C = A L / (t rho0 R (T0 T)^0.5), and fully open
        limit = task.outward_s if outward else task.back_s
        flow = ANR_DENSITY_KG_M3 * AIR_GAS_CONSTANT_J_KG_K * math.sqrt(ANR_TEMPERATURE_K * task.ambient.temperature_k)
        needed = choice.areas_m2[1 if outward else 0] * task.stroke_m / (limit * flow)
        whole = choice.flow_control.numbers["needle_conductance"]
        needles = sorted({min(one * needed / whole, 1.0) for one in NEEDLES} | {1.0})
    return needles, CUSHIONS if choice.is_cushioned else (1.0,)


def _near(
    strokes: DriveStrokes, outward: bool, setting: Setting, finer: tuple[tuple[float, ...], ...]
) -> Iterable[tuple[float, ...]]:
    """Return openings near the openings of a setting."""
    grid = _grid(strokes, outward)
    factors = [each if len(one) > 1 else (1.0,) for each, one in zip(finer, grid, strict=True)]
    own = setting[:2] if outward else setting[2:]
    scaled = ([a * b for a, b in zip(own, pair, strict=True)] for pair in product(*factors))
    return dict.fromkeys(tuple(min(value, 1.0) for value in values) for values in scaled)


def _best(
    strokes: DriveStrokes,
    outward: bool,
    setting: Setting,
    pairs: Iterable[tuple[float, ...]],
    rows: Array,
) -> Search:
    """Return the pair of needle and cushion whose worst case has the largest margin.

    Pairs that cannot be the best are not run in all cases. The result is the same as with all runs, as long as no
    smaller opening is faster by more than `TIME_SLACK`.
    """
    places = ("needle_out", "cushion_out") if outward else ("needle_back", "cushion_back")
    openings = np.array(list(pairs))
    settings = [setting._replace(**by_name(places, pair)) for pair in openings.tolist()]
    shares, shape = np.array(settings), (len(settings), len(rows))
    known = StrokeResults(*np.full((len(StrokeResults._fields), len(settings) * len(rows)), np.nan))
    is_run, named, table = np.zeros(shape, bool), [], np.array([])
    todo = np.array([one == setting for one in settings])[:, None] | is_run
    if len(rows) == 1:
        todo = (openings[:, 1] == openings[:, 1].max())[:, None]
    while todo.any():
        one, row = np.nonzero(todo)
        found = yield StrokeRuns(strokes, outward, rows[row], shares[one])
        for column, values in zip(known, found, strict=True):
            column[todo.ravel()] = values
        is_run |= todo
        named = _margins(strokes, outward, known)
        table = np.where(is_run, [margins.reshape(shape) for *_, margins in named], np.inf)
        todo = _next_runs(table, is_run, openings)
    whole = np.flatnonzero(is_run.all(axis=1)).tolist()
    best = max(whole, key=lambda one: (table[:, one].min(), table[:, one, 0].min()))
    if outward and (held := strokes.task.holding_force_n):  # no setting changes it
        named.append(("holding force", held, known.force, known.force / held - 1.0))
    of_best = np.array([margins.reshape(shape)[best] for *_, margins in named])
    at = best * len(rows)
    nominal, least = float(of_best[:, 0].min()), float(of_best.min())
    shown = of_best[:, :1] if nominal < 0.0 else of_best
    worst, case = np.unravel_index(shown.argmin(), shown.shape)
    name, limit, values, _ = named[worst]
    short = (name, limit, float(values[at + case]))
    return Tuned(settings[best], nominal, short, least, float(known.air[at]), (float(known.time[at]),))


def _next_runs(table: Array, is_run: Bools, openings: Array) -> Bools:
    """Return which cases of which pairs have to be run to find the best pair, with the shape (pairs, cases).

    The bound of a pair is its smallest margin in the cases that have run. In the nominal case, the time margin of a
    pair with wider cushion and needle is also a bound. This does not hold for a half-closed cushion: a needle that
    slows the piston down before the cushion may shorten the stroke.

    Parameters
    ----------
    table : ndarray, shape (limits, pairs, cases)
        Margins, the time first; infinite for cases that have not run.
    is_run : ndarray, shape (pairs, cases)
    openings : ndarray, shape (pairs, 2)
    """
    bounds, is_whole = table.min(axis=(0, 2)), is_run.all(axis=1)
    if is_run.shape[1] == 1:
        needle, cushion = openings.T
        is_wider = (needle[:, None] <= needle) & (cushion == cushion.max())
        bounds = np.minimum(bounds, np.where(is_wider, table[0, :, 0], np.inf).min(axis=1) + TIME_SLACK)
    least = bounds[is_whole].max()
    left = ~is_run & (~is_whole & (bounds >= least))[:, None]
    if is_run.any(axis=1).sum() == 1:  # the others run the cases first that decide about this one
        of_first = table[:, is_whole][:, 0]
        deciding = of_first[of_first.min(axis=1) <= least + DECIDES].argmin(axis=1)
        left[:, np.setdiff1d(np.arange(is_run.shape[1]), deciding)] = False
    return left


def _margins(strokes: DriveStrokes, outward: bool, found: StrokeResults) -> list[tuple[str, float, Array, Array]]:
    """Return name, limit, values and margins of the limits that the needles affect."""
    task, choice = strokes.task, strokes.choice
    way, limit = ("out", task.outward_s) if outward else ("back", task.back_s)
    rows = (
        (f"time {way}", limit, found.time),
        ("peak pressure", peak_limit(task, choice), found.peak_pressure),
        (f"end speed {way}", task.end_speed_m_s, found.end_speed),
        (f"energy {way}", energy_limit(task, choice)[0], found.energy),
    )
    arrived = np.isfinite(found.time)
    return [(name, most, values, np.where(arrived, 1.0 - values / most, NEVER)) for name, most, values in rows if most]
