"""Check of drives for a task: margins over samples of the spreads, ranking, and checks before an order.

Each check names its standard or the maker's rule. If the data sheet of a part does not give a needed value, the check
reports this.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from pneudrive.arrays import Array, Bools, Interval, NamedNumbers
from pneudrive.constants import ANR_LITRES_PER_KG, STANDARD_GRAVITY_M_S2, USUAL_PEAK_PA
from pneudrive.describe.components import USUAL, unusual_sizes
from pneudrive.errors import OPEN_CHECK
from pneudrive.numbers import plain as three
from pneudrive.sizing.strokes import COARSE, DRAWN, RTOL, DriveStrokes, Setting, StrokeResults
from pneudrive.sizing.task import WITHOUT, DriveChoice, PartChoice, SizingTask, energy_limit, peak_limit
from pneudrive.views import Finding

#: A number that may be infinite; a file stores infinity as null.
Number = Annotated[float, BeforeValidator(lambda value: math.inf if value is None else value)]

# --- Whether drives meet a task: margins in each sample, the worst 1 %, and the probability with its bound.

#: Required probability of meeting the task. A worst value is exceeded with the remaining probability.
PROBABILITY = 0.99
#: Confidence of the bound of Clopper and Pearson, one-sided.
CONFIDENCE = 0.95
#: Tolerance for rounding of a number of samples.
ROUNDING = 1e-9
#: Margin of a sample whose stroke does not end.
NEVER = -1.0
#: Name of the only limit from below.
HOLDING = "holding force"


class LimitMargin(NamedTuple):
    """Margins of all samples to one limit of a task.

    Attributes
    ----------
    name, unit : str
    limit : float
        Limit in SI, before the margin of the task is subtracted.
    values : ndarray, shape (n,)
        Values in SI.
    margins : ndarray, shape (n,)
        Margin of each sample as a fraction of the limit; below 0 if the sample exceeds the limit.
    """

    name: str
    unit: str
    limit: float
    values: Array
    margins: Array

    @property
    def worst(self) -> float:
        """Value in SI that 1 % of the samples exceed; for a limit from below, value that 99 % exceed."""
        return interval(self.values)[self.name != HOLDING]

    @property
    def margin(self) -> float:
        """Margin reached by 99 % of the samples."""
        return float(np.quantile(self.margins, 1.0 - PROBABILITY, method="lower"))


def limits(task: SizingTask, choice: DriveChoice, out: StrokeResults, back: StrokeResults) -> list[LimitMargin]:
    """Return the limits of a task with the margins of all samples.

    Parameters
    ----------
    task : SizingTask
    choice : DriveChoice
    out, back : StrokeResults
        Results for the same samples.
    """
    keep, energy = 1.0 - task.margin, energy_limit(task, choice)[0]
    found = []
    for name, unit, limit, values in (
        ("time out", "s", task.outward_s, out.time),
        ("time back", "s", task.back_s, back.time),
        ("end speed out", "m/s", task.end_speed_m_s, out.end_speed),
        ("energy out", "J", energy, out.energy),
        ("end speed back", "m/s", task.end_speed_m_s, back.end_speed),
        ("energy back", "J", energy, back.energy),
        ("peak pressure", "Pa", peak_limit(task, choice), np.maximum(out.peak_pressure, back.peak_pressure)),
    ):
        if limit is not None:
            margins = np.where(np.isfinite(values), 1.0 - values / (keep * limit), NEVER)
            found.append(LimitMargin(name, unit, limit, values, margins))
    if least := task.holding_force_n:
        margins = np.where(np.isfinite(out.time), out.force / least * keep - 1.0, NEVER)
        found.append(LimitMargin(HOLDING, "N", least, out.force, margins))
    return found


def passed(draws: int) -> int:
    """Return the number of samples that may exceed the worst value."""
    return math.floor((1.0 - PROBABILITY) * (draws - 1) + ROUNDING)


def interval(values: Array) -> Interval:
    """Return the values that 99 % and 1 % of the samples exceed."""
    lowest = np.quantile(values, 1.0 - PROBABILITY, method="lower")
    return float(lowest), float(np.quantile(values, PROBABILITY, method="higher"))


def is_met(found: list[LimitMargin]) -> Bools:
    """Return whether each sample meets all limits."""
    return np.all([one.margins >= 0.0 for one in found], axis=0)


def probability_bound(met: int, draws: int) -> float:
    """Return the one-sided lower bound of a probability at 95 % confidence, after Clopper and Pearson.

    The bound is valid for independent samples. Samples of a Sobol sequence are more evenly distributed.

    Examples
    --------
    >>> round(probability_bound(1024, 1024), 4)
    0.9971
    """
    from scipy.stats import beta

    return float(beta.ppf(1.0 - CONFIDENCE, met, draws - met + 1)) if met else 0.0


def explained(draws: Array, margins: Array) -> NamedNumbers:
    """Return, for each sampled number, which fraction of the variance of the ranked margins the number explains.

    Parameters
    ----------
    draws : ndarray, shape (n, len(DRAWN))
    margins : ndarray, shape (n,)
    """
    ranks = margins.argsort().argsort().astype(float)
    if np.ptp(margins) == 0.0:
        return dict.fromkeys(DRAWN, 0.0)
    columns = draws.argsort(axis=0).argsort(axis=0).astype(float)
    correlations = (np.corrcoef(column, ranks)[0, 1] for column in columns.T)
    return {name: float(correlation**2) for name, correlation in zip(DRAWN, correlations, strict=True)}


# --- Limits that a choice of parts misses, in numbers and in words.


class Shortage(NamedTuple):
    """Limit that some choices of parts cannot meet, and that excludes these choices.

    Attributes
    ----------
    limit : str
        Missed limit.
    share : float
        Largest possible value divided by the required value, below 1; 0 if no change to the task helps, or if unknown.
    said : str
        The shortage in words.
    parts : dict
        Slot -> part, or "*" for any.
    choices : int
        Number of choices.
    """

    limit: str
    share: float
    said: str
    parts: Mapping[str, str] = {}
    choices: int = 1


# --- Checks of the machine builder: side load, buckling of the rod, absorbers, holding force without supply.
#
# Each check names the standard or the maker's rule that it follows. If the data sheet of the part does not give a
# needed value, the check reports this.

#: Modulus of elasticity of a steel rod, Pa (assumed: usual for steel).
STEEL_PA = 210e9
#: Safety factor of the rod against buckling (assumed: usual in makers' diagrams for pneumatic cylinders).
BUCKLING_SAFETY = 5.0
#: Guide of the load -> effective buckling length divided by stroke, with the cylinder fixed at its front (Euler): 0.7
#: with a guided rod end, 2 with a free rod end.
EFFECTIVE = {"none": 2.0, "ball": 0.7, "plain": 0.7}
#: Smallest ratio of an actual rod diameter to an assumed one (assumed: the next smaller rod, as 10 mm below 12 mm).
THINNER = 0.83
#: Highest supply pressure of usual cylinders and valves, above ambient (assumed: 1.0 MPa in most catalogues).
USUAL_SUPPLY_PA = 1e6
#: Name of the check of flow controls. An open check does not count in the ranking: another flow control closes it.
NEEDLE = "opening of a needle"
#: Smallest opening at which the needle of a flow control can be set repeatably, as a fraction (assumed).
LEAST_OPENING = 0.1
#: Remedy for a value that no data sheet of the catalogue states.
CATALOGUE = "of the maker's sheet in a catalogue of your own (--catalogue)"


class MachineCheck(NamedTuple):
    """Check of a value of a sized drive against its limit.

    Attributes
    ----------
    name : str
    value : float
        Value in `unit`.
    limit : float or None
        None if no data sheet states it.
    unit : str
    is_kept : bool or None
        Whether the value is within its limit. None if no data sheet states the limit, or the limit is assumed.
    rule : str
        Standard or rule of the check.
    remedies : tuple of str
        Changes to task or catalogue. Each of them alone lets the drive pass the check.
    """

    name: str
    value: float
    limit: float | None
    unit: str
    is_kept: bool | None
    rule: str
    remedies: tuple[str, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether the drive must not be ordered yet: the check failed, or cannot be decided."""
        return self.is_kept is not True

    @property
    def numbers(self) -> str:
        """The value and its limit in words."""
        limit = "set by the machine" if self.is_kept else "not on the sheet"
        if self.limit is not None:
            limit = f"{three(self.limit)} {self.unit}"
        return f"{self.name}: {three(self.value)} {self.unit}, limit {limit}"

    @property
    def finding(self) -> Finding:
        """The check in words, with its remedies if it is open."""
        kept = "not decided" if self.is_kept is None else "kept" if self.is_kept else "NOT KEPT"
        line = f"{self.numbers}: {kept} ({self.rule})."
        if not self.is_open:
            return Finding(line)
        state = "open" if self.is_kept is None else "bad"
        return Finding(OPEN_CHECK + line, state, f"Remedy: {'; or '.join(self.remedies)}." if self.remedies else "")


def _check(
    name: str,
    value: float,
    limit: float | None,
    unit: str,
    rule: str,
    *remedies: str,
) -> MachineCheck:
    """Compare a value with its limit. The check is undecided if the limit is assumed or missing."""
    is_kept = None if limit is None or rule.startswith("assumed") else value <= limit
    return MachineCheck(name, value, limit, unit, is_kept, rule, remedies)


def mechanical_checks(cylinder: PartChoice, task: SizingTask, end_speed: float = 0.0) -> Iterator[MachineCheck]:
    """Yield the checks that depend only on cylinder and task: side load, supply pressure, buckling, stroke and speed.

    Without a guide, the cylinder carries the weight of the load across its axis. The speed in the checks is the larger
    of `end_speed` (m/s) and the mean speed of the task. The largest force on the rod results from the highest supply
    pressure on the whole piston.

    Buckling, after Euler: F = pi^2 E I / (k L)^2 over the safety factor, with I = pi d^4/64, L the stroke.
    """
    speed, sheet = max(end_speed, task.stroke_m / min(task.outward_s, task.back_s)), "maker's sheet of the cylinder"
    if task.guide == "none" and task.across_n:
        carried = 'guide = "ball" or "plain", if the machine carries the load'
        limit = cylinder.printed_si("max_load", "N")
        most = cylinder.printed_si("max_load_speed", "m/s") or math.inf
        rule = sheet
        if limit is not None and task.across_n <= limit and speed > most:
            rule = f"the sheet allows {three(limit)} N up to {three(most)} m/s, but the speed is {three(speed)} m/s"
            limit = None
        yield _check("side load", task.across_n, limit, "N", rule, carried, f"printed.max_load {CATALOGUE}")
    gauge = task.supply_pa + task.supply.spread_pa - task.ambient.pressure_pa
    if gauge > USUAL_SUPPLY_PA:
        rule = "usual cylinders and valves allow 10 bar gauge"
        regulator = "a regulator, and the lower supply.pressure behind it"
        yield _check("supply pressure", 1e-5 * gauge, None, "bar gauge", rule, regulator)
    if rod := cylinder.numbers.get("rod_diameter", 0.0):
        rule = f"Euler with a safety of {BUCKLING_SAFETY:g}, steel, effective length {EFFECTIVE[task.guide]:g} strokes"
        stiffness = math.pi**2 * STEEL_PA * (math.pi / 64.0 * rod**4)
        buckles = stiffness / (EFFECTIVE[task.guide] * task.stroke_m) ** 2 / BUCKLING_SAFETY
        push = gauge * math.pi / 4.0 * cylinder.numbers["bore"] ** 2
        if "rod_diameter" in cylinder.assumed and THINNER**4 * buckles < push <= buckles:
            rule = f"assumed rod of {1e3 * rod:g} mm; {rule}"
        yield _check("buckling of the rod", push, buckles, "N", rule, f"rod_diameter {CATALOGUE}")
    if isinstance(cylinder.table["stroke"], str):  # of the task: no stroke of the sheet
        longest = task.max_stroke_m or cylinder.printed_si("max_stroke", "m")
        offered = f'max_stroke = "{1e3 * task.stroke_m:g} mm", if the sheet has this stroke'
        yield _check("stroke", task.stroke_m, longest, "m", sheet, offered, f"printed.max_stroke {CATALOGUE}")
    fastest = cylinder.printed_si("max_speed", "m/s")
    if fastest is not None or task.end_speed_m_s is None:  # otherwise a limit of the search
        allowed = f'end_speed = "{math.ceil(1e2 * speed) / 1e2:g} m/s", if the sheet allows this speed'
        yield _check("speed", speed, fastest, "m/s", sheet, allowed, f"printed.max_speed {CATALOGUE}")


def machine_checks(choice: DriveChoice, task: SizingTask, drive: SizedDrive | None) -> list[MachineCheck]:
    """Return the checks of a choice of parts: failed ones first, then undecided, then passed ones.

    Without simulation results (`drive`), the checks of energy and peak pressure do not fail.
    """
    cylinder = choice.cylinder
    most_energy, peak, end_speed = (drive.energy, drive.peak_pressure, drive.end_speed) if drive else (0.0, 0.0, 0.0)
    found = list(mechanical_checks(cylinder, task, end_speed))
    limit, origin = energy_limit(task, choice)
    absorber = f"impact_energy, from the data sheet of cylinder or shock absorber: {three(most_energy)} J or more"
    found.append(_check("energy at the end", most_energy, limit, "J", origin, absorber))
    most = USUAL_PEAK_PA + task.ambient.pressure_pa
    if peak_limit(task, choice) is None and peak > most:
        stated = f"peak_pressure, from the data sheet of the cylinder: {1e-5 * peak:.0f} bar abs or more"
        rule = "assumed: usual cylinders withstand 1.5 times the usual limit of 10 bar gauge"
        found.append(_check("peak pressure", 1e-5 * peak, 1e-5 * most, "bar abs", rule, stated))
    if task.cycles_per_hour and (hourly := cylinder.printed_si("absorber_energy_per_hour", "J")):
        energy, rule = 2.0 * task.cycles_per_hour * most_energy, "maker's sheet of the absorber"
        found.append(_check("energy per hour", energy, hourly, "J", rule, "fewer cycles_per_hour"))
    if task.cycles is not None:
        lives = [part.printed_si("b10_cycles", "") for part in (cylinder, choice.valve)]
        life = min(one for one in lives if one is not None) if None not in lives else None
        rule = "B10 of cylinder and valve, ISO 19973"
        remedy = f"printed.b10_cycles of both {CATALOGUE}"
        found.append(_check("life", task.cycles, life, "cycles", rule, remedy))
    least = 1.0 if drive is None else min(drive.setting["needle_out"], drive.setting["needle_back"])
    if least < LEAST_OPENING:
        rule = "assumed: below this limit, a needle cannot be set repeatably"
        remedy = f"a smaller flow control than {choice.flow_control.name}: exclude it, or add one (--catalogue)"
        found.append(_check(NEEDLE, 1e2 * least, 1e2 * LEAST_OPENING, "%", rule, remedy))
    if math.sin(task.incline_rad) or task.external_force_n:  # also if they balance: the mass has a spread
        found.append(_hanging_load(choice, task))
    for key, size, end, rule in unusual_sizes(task, USUAL | {"mass": USUAL["moving_mass"]}):
        found.append(MachineCheck(key, size.si, end, size.si_unit, None, rule, (f"{key} of the task in a usual size",)))
    return sorted(found, key=lambda one: (one.is_kept is not False, one.is_kept is not None))


def open_names(choice: DriveChoice, task: SizingTask, drive: SizedDrive | None = None) -> tuple[str, ...]:
    """Return the names of the open `machine_checks`."""
    return tuple(check.name for check in machine_checks(choice, task, drive) if check.is_open)


def _hanging_load(choice: DriveChoice, task: SizingTask) -> MachineCheck:
    """Return the check whether load and piston are held against weight and external force when the pressure fails."""
    numbers = choice.cylinder.numbers
    along = STANDARD_GRAVITY_M_S2 * math.sin(task.incline_rad)
    nominal = task.static_force_n + numbers["moving_mass"] * along
    hangs = abs(nominal) + task.spread.mass * task.mass_kg * abs(along)
    name = "load that hangs at pressure loss"
    rule = "after ISO 4414: a loss of supply must cause no hazard"
    if task.held_by == "machine":
        return MachineCheck(name, hangs, None, "N", True, f'{rule}; held_by = "machine"')
    holds = task.clamp_force_n
    rule += "; held by the clamp of the task" if holds else "; without a clamp only friction holds the load"
    if holds is None:
        holds = numbers["friction.parameters.coulomb"] * task.spread.friction[0]
        is_assumed = any(key.startswith(("friction.coulomb", "friction.pressure")) for key in choice.cylinder.assumed)
        if holds >= hangs and (is_assumed or "pressure" not in choice.cylinder.table["friction"]):
            holds, rule = None, f"{rule}, and no measurement shows how much friction remains without pressure"
    remedies = (
        f'a clamp: held_by = "clamp", clamp_force = "{math.ceil(hangs)} N" or more',
        'held_by = "machine", if a lock or brake holds the load, or the external force ends with the pressure',
    )
    return _check(name, hangs, holds, "N", rule, *remedies)


# --- Simulation results of a choice of parts, over the spreads or from nominal runs, and the ranking key.

#: Unit -> factor from SI, and displayed unit.
READ = {"Pa": (1e-5, "bar abs")}


def read(value: float, unit: str, digits: int = 3) -> str:
    """Return a value in SI as text with its unit. An infinite value means that the stroke does not end."""
    factor, shown = READ.get(unit, (1.0, unit))
    return f"{factor * value:.{digits}g} {shown}" if value < math.inf else "the stroke does not end"


#: Ratio of air consumption below which choices rank by margin.
SAME_AIR = 1.02


def rank_of(open_checks: int, air: float, margin: float, *rest: Any) -> tuple[Any, ...]:  # noqa: ANN401 - sizes, name
    """Return the ranking key: open checks, air in steps of 2 %, then margin in steps of 1 %, then sizes."""
    step = round(math.log(air) / math.log(SAME_AIR)) if 0.0 < air < math.inf else 10**9
    return open_checks, step, -round(margin, 2), *rest


@dataclass(frozen=True)
class SizedDrive:
    """Simulation results of one choice of parts with its settings, in SI.

    Attributes
    ----------
    parts : dict
        Slot (cylinder, valve, tube, flow_control) -> part of the catalogue.
    setting : dict
        Openings of the needles as fractions of fully open.
    draws, met : int
        Number of samples, and number of samples that meet all limits.
    probability_bound : float
        One-sided lower bound of the probability that a drive meets all limits, at 95 % confidence.
    time_out, time_back, end_speed, energy, peak_pressure : float
        Values that 1 % of the samples exceed; the last three for the worse stroke. Infinite if a stroke does not end.
    air : float
        Mean mass drawn from the supply in a cycle, in kg.
    margins : dict
        Limit -> margin reached by 99 % of the samples.
    worst : dict
        Limit -> (value that 1 % of the samples exceed, limit, unit).
    measure : str
        Assumed value that explains most of the margin's variance; empty if nothing is assumed.
    sizes : tuple of float
        Bore, conductances of the valve and of the fully open needle (0 without a needle), bore of the tubes.
    intervals : dict
        Quantity -> pair of values that 99 % and 1 % of the samples exceed. Quantities are the limits by name, time_out,
        time_back, end_speed, energy, peak_pressure, air, load_ratio_out, load_ratio_back (`DriveStrokes.load_ratio`).
        Empty in folders of earlier versions.
    open_names : tuple of str
        Names of the open checks, which prevent an order (`machine_checks`). Empty in folders of earlier versions.
    """

    parts: Mapping[str, str]
    setting: Mapping[str, float]
    draws: int
    met: int
    probability_bound: float
    time_out: Number
    time_back: Number
    end_speed: Number
    energy: Number
    peak_pressure: Number
    air: Number
    margins: Mapping[str, float]
    worst: Mapping[str, tuple[Number, Number, str]]
    measure: str
    sizes: tuple[float, ...]
    intervals: Mapping[str, tuple[Number, Number]] = field(default_factory=dict)
    open_names: tuple[str, ...] = ()

    @property
    def open_checks(self) -> int:
        """Number of open checks that count in the ranking."""
        return len({*self.open_names} - {NEEDLE})

    @property
    def load_ratio(self) -> float | None:
        """Ratio of load to supply force that 1 % of the samples exceed, for the worse of both strokes."""
        ends = [self.intervals[name][1] for name in ("load_ratio_out", "load_ratio_back") if name in self.intervals]
        return max(ends, default=None)

    @property
    def name(self) -> str:
        """Names of the parts, joined by "+"."""
        return "+".join(self.parts.values())

    @property
    def part_names(self) -> str:
        """Names of the parts, without empty slots."""
        return " + ".join(name for name in self.parts.values() if name != WITHOUT)

    @property
    def needles(self) -> str:
        """Settings of the needles, in words."""
        closed = {name.replace("_", " "): share for name, share in self.setting.items() if share < 1.0}
        shares = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in closed.items())
        return f"needles: {shares} of fully open" if shares else "needles fully open"

    @property
    def missed_limits(self) -> list[str]:
        """Names of the missed limits."""
        return [name for name in self.worst if self.margins[name] < 0.0]

    @property
    def missed(self) -> str:
        """Missed limits in words, each with the value and the limit."""
        limits = []
        for name in self.missed_limits:
            value, limit, unit = self.worst[name]
            limits.append(f"{name}: {read(value, unit)}, limit {read(limit, unit)}")
        return "; ".join(limits) or f"{self.met} of {self.draws} samples meet all limits together"

    @property
    def is_feasible(self) -> bool:
        """Whether the choice meets the task with the required probability."""
        return self.met >= PROBABILITY * self.draws

    @property
    def binding(self) -> str:
        """Limit with the smallest margin."""
        return min(self.margins, key=lambda name: self.margins[name])

    @property
    def margin(self) -> float:
        """Smallest margin over all limits, each reached by 99 % of the samples."""
        return self.margins[self.binding]

    @property
    def air_litres_anr(self) -> float:
        """Air of a cycle, in litres at the standard reference atmosphere."""
        return self.air * ANR_LITRES_PER_KG

    @property
    def rank(self) -> tuple[Any, ...]:
        """Key of the ranking: open checks, air in steps of 2 %, then margin in steps of 1 %, then sizes."""
        return rank_of(self.open_checks, self.air, self.margin, self.sizes, self.name)


@dataclass(frozen=True)
class Provisional:
    """Choice of parts in the provisional ranking, which is based on nominal runs; SI units.

    Attributes
    ----------
    parts : dict
    air : float
        Mass drawn from the supply in a cycle, in kg.
    times : tuple of float
        Times of the strokes out and back.
    margin : float
        Least margin of the nominal, slow and fast cases, with rough settings. Tuning increases it.
    limit : str
        Limit with this margin. Empty in folders of earlier versions.
    """

    parts: Mapping[str, str]
    air: Number
    times: tuple[Number, ...]
    margin: float
    limit: str = ""


# --- One choice of parts with its settings over the spreads of a task.

#: Number of samples simulated for a limit in addition to those that may fail. A limit is considered if its estimated
#: margin is above the smallest margin by less than the second number.
HARD, NEAR = 16, 0.15


def simulated(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float = COARSE) -> tuple[SizedDrive, Array]:
    """Simulate a choice with its settings over samples of the spreads, and compare the results with the task.

    Also return an array: a column with the margins of the samples for each limit, and a last column with the air (kg).
    """
    out, back = (strokes.run(outward, draws, setting, rtol) for outward in (True, False))
    task, choice = strokes.task, strokes.choice
    found = limits(task, choice, out, back)
    met = int(is_met(found).sum())
    binding = min(found, key=lambda one: one.margin)
    shares = explained(draws, binding.margins)
    assumed = strokes.drawn_assumed()
    first = max(assumed, key=lambda name: shares[name], default="")
    air, worse = out.air + back.air, ("end_speed", "energy", "peak_pressure")
    figures = {one.name: one.values for one in found} | {
        "time_out": out.time,
        "time_back": back.time,
        **{name: np.maximum(getattr(out, name), getattr(back, name)) for name in worse},
        "air": air,
        "load_ratio_out": strokes.load_ratio(True, draws),
        "load_ratio_back": strokes.load_ratio(False, draws),
    }
    intervals = {name: interval(values) for name, values in figures.items()}
    drive = SizedDrive(
        parts=choice.parts,
        setting=setting._asdict(),
        draws=len(draws),
        met=met,
        probability_bound=probability_bound(met, len(draws)),
        **{name: intervals[name][1] for name in ("time_out", "time_back", *worse)},
        air=float(air.mean()),
        margins={one.name: one.margin for one in found},
        worst={one.name: (one.worst, one.limit, one.unit) for one in found},
        measure=f"{first} of {choice.parts[assumed[first]]}" if first else "",
        sizes=choice.sizes,
        intervals=intervals,
        open_names=(),
    )
    samples = np.column_stack([*(one.margins for one in found), air])
    return replace(drive, open_names=open_names(choice, task, drive)), samples


def hardest(strokes: DriveStrokes, setting: Setting, known: Array, draws: Array) -> tuple[float, float, int]:
    """Return the estimated air (kg), an upper bound of the margin, and a lower bound of the number of failing samples.

    Only a few of the samples are simulated.

    The first samples give a linear estimate of the margins of all samples. The samples with the smallest estimates are
    simulated. The bounds are always valid, because samples that are not simulated can only reduce the margin.

    Parameters
    ----------
    strokes : DriveStrokes
    setting : Setting
    known : ndarray
        Columns of the first samples, from `simulated`.
    draws : ndarray, shape (n, len(DRAWN))
        All samples.
    """
    allowed = passed(len(draws))
    design = np.column_stack([np.ones(len(draws)), draws])
    *estimates, air = (design @ np.linalg.lstsq(design[: len(known)], known, rcond=None)[0]).T
    lows = [float(np.partition(estimate, allowed)[allowed]) for estimate in estimates]
    near = [one for one, low in zip(estimates, lows, strict=True) if low < min(lows) + NEAR]
    places = np.unique(np.concatenate([one.argsort()[: HARD + allowed] for one in near]))
    out, back = (strokes.run(outward, draws[places], setting, RTOL) for outward in (True, False))
    found = limits(strokes.task, strokes.choice, out, back)
    margin = min(float(np.sort(one.margins)[allowed]) for one in found)
    return float(air.mean()), margin, int((~is_met(found)).sum())
