"""Identification of a circuit that follows a recorded motion, and comparison with alternative models."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.arrays import Interval, NamedIntervals, NamedNumbers, Pair, Plain, by_name
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe.circuit import Circuit
from pneudrive.errors import FitError, RecordingError
from pneudrive.estimate.estimates import rms
from pneudrive.files.inputs import origin
from pneudrive.identify.base import Fit, FitFile, Undetermined
from pneudrive.identify.follow.driven import GROUPS, SIDES, UNITS, DrivenCircuit, DrivenRecording, driven_recordings
from pneudrive.identify.follow.problem import LOCAL, FollowPoint, FollowProblem, FollowSolution, simulated, solve_follow
from pneudrive.identify.identified import FittedData, number_table, remedy_for, sentence, stated
from pneudrive.numbers import plain
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.signals.recording import Recording
from pneudrive.views import ShownTable, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.identify.follow.driven import MotionRecordings
    from pneudrive.signals.layout import AnyLayout

BEYOND = 0.03  # of the stroke: largest excess of a position
LEAST_TRAVEL = 0.1  # of the stroke: less travel than this is probably another unit
LEAST_LEVEL = 0.3  # of the ambient pressure: a closed chamber below it is read with another unit, or as gauge
TOGETHER = 0.5  # least correlation of a pressure with the position that counts
BETTER = 0.8  # another reading is named if its residuals are below this ratio
POOR = 0.03  # of the range: larger residuals mean that the model or the reading is wrong
OPEN_TOGETHER = 0.2  # least correlation of an open chamber's pressure with the rate of its volume that counts (assumed)
NEAR_AMBIENT = 0.1  # of the ambient pressure: largest distance of an open chamber from it (assumed)


def check_readings(
    driven: DrivenCircuit, records: Sequence[DrivenRecording]
) -> tuple[list[DrivenRecording], list[str]]:
    """Reject recordings that cannot belong to the circuit; return recordings with open chambers, and warnings.

    Raises
    ------
    RecordingError
        The position leaves the stroke, a pressure is impossible, or the chambers are swapped.
    """
    idle, doubts = [], []
    for record in records:
        x, stroke = record.positions_m, driven.stroke_m
        low, high = float(x.min()), float(x.max())
        if low < -BEYOND * stroke or high > (1.0 + BEYOND) * stroke:
            raise RecordingError(where=record.name, **stated("readings", "beyond", low=low, high=high, stroke=stroke))
        small = ""
        if high - low < LEAST_TRAVEL * stroke:
            small = sentence("notes", "small", travel=1e3 * (high - low), stroke=1e3 * stroke)
            doubts.append(f"{record.name}: {small}")
        if record.is_open(np.array([*driven.volumes_m3(x).values()])):
            idle.append(record)
            doubts += [f"{record.name}: {text}" for text in _open_doubts(driven, record)]
            continue
        for side, pressure in zip(SIDES, record.pressures_pa, strict=True):
            if np.ptp(pressure) == 0.0:
                said = stated("readings", "constant", side=side)
                raise RecordingError(where=record.name, remedy=small or None, **said)
            if (lowest := pressure.min()) < LEAST_LEVEL * STANDARD_ATMOSPHERE_PA:
                raise RecordingError(where=record.name, **stated("readings", "low", side=side, value=lowest))
        # The pressure of a chamber must not rise while its gas expands.
        ranges = record.ranges_pa / record.pressures_pa.mean(axis=1)
        together = [np.corrcoef(p, record.positions_m)[0, 1] for p in record.pressures_pa]
        wrong = [together[0] > TOGETHER and ranges[0] > BEYOND, together[1] < -TOGETHER and ranges[1] > BEYOND]
        if any(wrong):
            said = stated("readings", "swapped" if all(wrong) else "reversed", side="a" if wrong[0] else "b")
            raise RecordingError(where=record.name, **said)
    return idle, doubts


def _open_doubts(driven: DrivenCircuit, record: DrivenRecording) -> list[str]:
    """Return warnings on chambers that seem open: pressure not near ambient, or higher during expansion."""
    ambient = float(driven.form["ambient"]["pressure_pa"])
    means, found = record.pressures_pa.mean(axis=1), []
    far = np.abs(means - ambient) > NEAR_AMBIENT * ambient
    if far.any():
        twice = (np.abs(means - 2.0 * ambient) < NEAR_AMBIENT * ambient).all()
        shown = " and ".join(f"{mean / 1e5:.4g} bar in {'ab'[k]}" for k, mean in enumerate(means) if far[k])
        cause = "the pressures are read as gauge, but seem to be absolute" if twice else "check the unit"
        found.append(f"the chambers are open, but have {shown}, not the ambient {ambient / 1e5:.4g} bar: {cause}")
    speed = np.gradient(record.positions_m, record.grid_s)
    ways = zip(SIDES, record.pressures_pa, (speed, -speed), strict=True)
    moving = [side for side, p, rate in ways if np.ptp(p) > 0.0 and np.corrcoef(p, rate)[0, 1] > OPEN_TOGETHER]
    if moving:
        found.append(sentence("notes", "open_swapped", sides=" and ".join(moving)))
    return found


def misfit_notes(solution: FollowSolution) -> list[str]:
    """Return the likely causes of residuals that are too large for this model.

    A possible cause is a confusion of gauge and absolute pressures. This cause is returned if the recordings fit better
    with the other reading.
    """
    problem, point = solution.problem, solution.point
    ambient = problem.driven.form["ambient"]["pressure_pa"]
    base, worst = rms(solution.every_rms), np.max(solution.every_rms)
    found = [] if worst < POOR else [sentence("notes", "poor", percent=100 * worst)]
    for shift, words in ((ambient, "absolute, but seem to be gauge"), (-ambient, "gauge, but seem to be absolute")):
        records = [replace(r, pressures_pa=r.pressures_pa + shift) for r in problem.records]
        if min(r.pressures_pa.min() for r in records) < LEAST_LEVEL * ambient:
            continue
        try:
            size = rms(solve_follow(replace(problem, records=records), point, passes=1).every_rms)
        except FitError:
            continue
        # A reading is the cause only if the model fits with it. A wrong model says nothing about sensors.
        if size < min(BETTER * base, POOR):
            found.append(sentence("notes", "other_reading", words=words, bar=shift / 1e5, percent=100 * size / base))
    return found


FIRST = ("volumes", "heat")  # groups that are fitted alone at first
WORTH = 0.9  # a model that lowers the sum of squares of the fit less than to this ratio adds nothing
EARNS = 0.95  # a model earns its place if it lowers that of each prediction to this ratio
AS_WELL = 2.0  # a model fits as well if its sum of squares is below this ratio (assumed)
LARGEST_REACH = 0.5  # a number is determined if half its interval is below this share of it


@dataclass(frozen=True)
class Rival:
    """An alternative model, compared with the requested model.

    Attributes
    ----------
    name, words : str
    fit_percent : float
        Largest rms residual of the fit, in % of the range of the pressure.
    gain : float
        Sum of squared residuals of the fit, divided by that of the requested model.
    predictions : tuple of float
        The same ratio for each held-out part of the recordings. Empty if the fit is not better.
    values, intervals : dict
        Values and 95 % intervals of the parameters common to both models.
    """

    name: str
    words: str
    fit_percent: float
    gain: float
    predictions: tuple[float, ...]
    values: NamedNumbers
    intervals: NamedIntervals = field(default_factory=dict)

    @property
    def earns(self) -> bool:
        """Whether the model predicts each held-out part better."""
        return bool(self.predictions) and max(self.predictions) < EARNS

    @property
    def verdict(self) -> str:
        """Conclusion in words."""
        if self.name == "held":
            return f"sum of squares {self.gain:.2f} times that of the fit with free start and delay"
        if not self.predictions:
            return f"not determined; the sum of squares changes to {100 * self.gain:.0f} %"
        shown = ", ".join(f"{100 * p:.0f} %" for p in self.predictions)
        last = "accepted" if self.earns else "not accepted"
        return f"sum of squares {100 * self.gain:.0f} % in the fit, {shown} in predictions: {last}"


@dataclass(frozen=True)
class FollowRecord:
    """Start, delay and residuals of one recording; each pair is (value, half width of the 95 % interval).

    Attributes
    ----------
    name : str
    rms : tuple of float
        Residuals of both pressures, relative to their range.
    temperature_a_k, temperature_b_k, delay_s : tuple of float
    file, sha256 : str
    """

    name: str
    rms: Pair
    temperature_a_k: Pair
    temperature_b_k: Pair
    delay_s: Pair
    file: str = ""
    sha256: str = ""

    @classmethod
    def of_table(cls, table: Plain) -> FollowRecord:
        """Return the record from a table of a file. Older files have residuals in percent."""
        known: Plain = {field.name: table[field.name] for field in fields(cls) if field.name in table}
        known["rms"] = tuple(table.get("rms") or (share / 100.0 for share in table["rms_percent"]))
        return cls(**known)

    def __str__(self) -> str:
        """Return residuals, start and delay."""
        a, b = (100.0 * value for value in self.rms)
        (ta, ua), (tb, ub), (tau, u) = self.temperature_a_k, self.temperature_b_k, self.delay_s
        return (
            f"rms {a:.2f} % and {b:.2f} % of the range of a and b; start {ta:.1f} ± {ua:.1f} K and {tb:.1f} ± "
            f"{ub:.1f} K; delay of the pressures {tau:.3f} ± {u:.3f} s"
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FollowFit(Fit, kind="motion"):
    """A circuit identified along recorded motions.

    Attributes
    ----------
    circuit : Circuit
        Circuit with the identified values.
    intervals : dict
        Name -> 95 % interval: union over all models that fit equally well, at least as wide as the differences between
        parts of the recordings.
    details : dict
        Name -> ``model_interval``: 95 % interval for this model alone, from noise and correlated residuals. ``spread``:
        lowest and highest value over all models that fit equally well. ``parts``: values from each recording alone, or
        from each half of a single recording.
    rivals : tuple of Rival
        Alternative models that were fitted.
    solution : FollowSolution or None
        Solution for figures; None if the fit was read from a file.
    """

    circuit: Circuit
    rivals: tuple[Rival, ...] = ()
    solution: FollowSolution | None = field(default=None, repr=False)

    @property
    def records(self) -> tuple[FollowRecord, ...]:
        """Start, delay and residuals of each recording."""
        return tuple(map(FollowRecord.of_table, self.provenance["recordings"]))

    def apply(self) -> Circuit:
        """Return the circuit with the identified values."""
        return self.circuit

    def _residual_lines(self) -> list[str]:
        return [f"{record.name}: {record}" for record in self.records]

    def view(self) -> View:
        """Return the view of a fit, with a table of the other models."""
        rows = tuple((rival.words, f"{rival.fit_percent:.2f}", rival.verdict) for rival in self.rivals)
        table = ShownTable("Other models", ("model", "worst rms % of range", "verdict"), rows)
        return replace(super().view(), tables=(table,) if rows else ())

    def _first(self) -> Plain:
        return super()._first() | {"circuit": self.circuit.to_toml()}

    def _last(self) -> Plain:
        return {"rivals": {rival.name: vars(rival) for rival in self.rivals}} if self.rivals else {}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        content = file.content
        return super()._fields(file) | {
            "circuit": Circuit.load(str(content["circuit"])),
            "rivals": tuple(Rival(**rival) for rival in content.get("rivals", {}).values()),
        }


def identify_motion(
    circuit: Circuit | str | Path,
    recordings: MotionRecordings,
    free: Sequence[str] = ("volumes", "heat"),
    *,
    layout: AnyLayout = None,
    rivals: bool = True,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> FollowFit:
    """Identify parameters of a circuit from its chamber pressures along a recorded motion.

    Start pressures, start temperatures and the delay of the pressures are free in each recording. If a recording starts
    at rest, the prior of its start temperatures is the wall temperature with a standard uncertainty of 2 K.

    Parameters
    ----------
    circuit : Circuit or path
        One piston between two chambers; a motor at its rod may be left out.
    recordings : path or Recording, or several
        Time, position and both chamber pressures.
    free : sequence of str
        Groups ``volumes``, ``heat``, ``wall``, ``leak``, ... (`driven.GROUPS`), or names such as ``upper.volume``.
    layout : Layout or path, optional
    rivals : bool
        Whether to fit alternative models, too: walls, leaks, held start and delay. They take most of the time.
    progress, cancel
        See `pneudrive.progress.Watch`.

    Returns
    -------
    FollowFit

    Raises
    ------
    FitError, RecordingError, LayoutError, DescriptionError
        Input is not valid; the message gives value, rule and remedy.
    """
    watch = Watch(progress, cancel)
    if not free:
        raise FitError("no parameter is free", remedy=f"Name some of {', '.join(GROUPS)}.")
    described = circuit if isinstance(circuit, Circuit) else Circuit.load(circuit)
    records = driven_recordings(recordings, layout)
    driven = DrivenCircuit(described)
    idle, notes = check_readings(driven, records)
    notes += [f"{r.name} is not used: its chambers are open" for r in idle]
    used = [record for record in records if record not in idle]
    if not used:
        raise FitError(value=", ".join(record.name for record in idle), **stated("readings", "open"))
    problem = FollowProblem(driven, used, driven.numbers_of(free), watch=watch)
    first, begin = [name for name in free if name in FIRST], None
    if 0 < len(first) < len(free):  # the solution without walls and leaks is a safe start for the full fit
        small = DrivenCircuit(described)
        own = FollowProblem(small, used, small.numbers_of(first), watch=watch)
        point = solve_follow(own, passes=1).point
        values = by_name([n.name for n in own.numbers], point.shared)
        begin = FollowPoint(np.array([values.get(n.name, np.log(n.start)) for n in problem.numbers]), point.local)
    solution = solve_follow(problem, begin)
    notes += misfit_notes(solution)
    others, parts = (_rivals(described, solution, list(free)), _parts(solution)) if rivals else ((), {})
    return _result(described, solution, notes, others, parts)


def _result(
    described: Circuit,
    solution: FollowSolution,
    notes: list[str],
    beside: tuple[Rival, ...],
    parts: dict[str, tuple[float, ...]],
) -> FollowFit:
    problem, values = solution.problem, solution.values
    intervals, details, lost = {}, {}, []
    for place, (name, value) in enumerate(values.items()):
        alike = [r for r in beside if name in r.values and r.gain < AS_WELL]
        near = [value, *(r.values[name] for r in alike)]
        own = solution.intervals[name]
        lows, highs = zip(own, *(r.intervals[name] for r in alike), strict=True)
        change = max((max(part / value, value / part) for part in parts.get(name, ())), default=1.0)
        low, high = intervals[name] = (min(*lows, value / change), max(*highs, value * change))
        spread = (min(near), max(near)) if alike else None
        details[name] = {"model_interval": own, "spread": spread, "parts": parts.get(name)}
        if solution.deviation(place) > np.log1p(LARGEST_REACH):
            reason = f"anything from {plain(low)} to {plain(high)} {problem.numbers[place].unit} fits"
            lost.append(Undetermined(name, reason, remedy_for(name)))
    records = [vars(follow_record(solution, at)) for at in range(len(problem.records))]
    problem.driven.values_form(problem.numbers, np.exp(solution.point.shared))
    heat = {side: problem.driven.heat_w_k(side) for side in SIDES}
    passed = [f"{plain(value)} W/K in chamber {side}" for side, value in heat.items() if value]
    if passed and any(name.endswith("heat_transfer") for name in values):
        notes = [*notes, f"heat transfer between gas and wall, for dead volume and piston faces: {', '.join(passed)}"]
    if not solution.converged:
        notes = [*notes, "the search did not converge: give other start values"]
    return FollowFit(
        circuit=with_values(described, problem, values),
        values=values,
        units={n.name: n.unit for n in problem.numbers},
        free=tuple(values),
        covariance=np.zeros((0, 0)),
        intervals=intervals,
        undetermined=tuple(lost),
        statistics={"recordings": float(len(records))},
        provenance=origin(described, [record.recording for record in problem.records], recordings=records),
        fitted=fitted_pressures(solution),
        rivals=beside,
        notes=tuple(notes),
        converged=solution.converged,
        solution=solution,
        details=details,
    )


def _parts(solution: FollowSolution) -> dict[str, tuple[float, ...]]:
    """Return the determined values from each recording alone, or from each half of a single recording.

    These values show changes from run to run, which the interval from one recording does not contain.
    """
    problem, point = replace(solution.problem, model="part of the recordings"), solution.point
    pieces = [(replace(problem, parts=own), point) for own, _ in _folds(problem)]
    if len(problem.records) > 1:
        each = zip(problem.records, problem.parts, problem.weights, point.local, strict=True)
        pieces = [
            (replace(problem, records=[record], parts=[part], weights=[weight]), FollowPoint(point.shared, local[None]))
            for record, part, weight, local in each
        ]
    found: dict[str, list[float]] = {}
    for piece, start in pieces:
        try:
            solved = solve_follow(piece, start, passes=1)
        except FitError:
            continue  # this part does not depend on a number
        for place, (name, value) in enumerate(solved.values.items()):
            if solved.deviation(place) < np.log1p(LARGEST_REACH):
                found.setdefault(name, []).append(value)
    return {name: tuple(values) for name, values in found.items()}


def follow_record(solution: FollowSolution, at: int) -> FollowRecord:
    """Return start, delay and residuals of a recording of a solution."""
    problem = solution.problem
    recording, place = problem.records[at].recording, len(problem.numbers) + LOCAL * at
    found = solution.point.local[at, 2:] + [*problem.driven.wall_k.values(), 0.0]
    half = map(solution.deviation, range(place + 2, place + LOCAL))
    a_k, b_k, delay_s = zip(found.tolist(), half, strict=True)
    a, b = solution.rms(at).tolist()
    file, sha256 = str(recording.source or ""), recording.sha256 or ""
    return FollowRecord(recording.name, (a, b), a_k, b_k, delay_s, file, sha256)


def with_values(described: Circuit, problem: FollowProblem, values: NamedNumbers) -> Circuit:
    """Return the circuit with fitted values, including added components and keys."""
    tables, driven = described.to_dict(), problem.driven
    connections = list(tables.get("connections", ()))
    for number in problem.numbers:
        own = tables["components"].get(number.component)
        if own is None:
            own = tables["components"][number.component] = {"kind": driven.parts[number.component]["kind"]}
            side = number.component.partition("_")[2]
            homes = {one: driven.tanks[one] or f"{driven.piston}.{one}" for one in SIDES}
            ends = (homes[side or "a"], "ambient" if side else homes["b"])
            connections.append(f"{ends[0]} -> {number.component} -> {ends[1]}")
        held = driven.parts[number.component]["numbers"]
        if number.key in ("heat_transfer", "wall_capacity", "wall_outer_heat_transfer"):
            for key in ("wall_area", "heat_transfer", "wall_capacity", "wall_outer_area", "wall_outer_heat_transfer"):
                if key in held and key not in own:
                    own[key] = _written(key, held[key])
        own[number.key] = _written(number.key, values[number.name])
    return Circuit.model_validate(tables | {"connections": connections})


def _written(key: str, value: float) -> str | float:
    unit = UNITS.get(key, "m2")  # others are areas
    return f"{float(value)!r} {unit}" if unit else float(value)


def _rivals(described: Circuit, solution: FollowSolution, free: list[str]) -> tuple[Rival, ...]:
    """Fit the alternative models, and test the predictions of better-fitting models."""
    problem, found = solution.problem, []
    base_fit = _squares(solution)
    folds = _folds(problem)
    base_folds = [_predict(problem, solution.point, fold) for fold in folds]
    for name, (extra, words) in number_table("rivals").items():
        if extra and (set(extra) <= set(free) or ("wall" in free and name.startswith("wall"))):
            continue
        try:
            driven = DrivenCircuit(described)
            numbers = driven.numbers_of([*free, *extra])
            if len(numbers) < len(problem.numbers):
                continue
            rival = replace(problem, driven=driven, numbers=numbers, model=words)
            begin = FollowPoint(rival.begin().shared, solution.point.local.copy())
            begin.shared[: solution.point.shared.size] = solution.point.shared
            if name == "held":
                rival = replace(rival, is_held=True)
                begin.local[:, 2:] = 0.0
            solved = solve_follow(rival, begin, passes=1)
            gain = _squares(solved) / base_fit
            predictions: tuple[float, ...] = ()
            if name != "held" and gain < WORTH:
                pairs = zip(folds, base_folds, strict=True)
                predictions = tuple(_predict(rival, solved.point, fold) / base for fold, base in pairs)
        except FitError:
            continue  # the circuit has no such number, or the recordings do not depend on it
        worst = 100.0 * float(np.max(solved.every_rms))
        found.append(Rival(name, words, worst, gain, predictions, solved.values, solved.intervals))
    return tuple(found)


def _squares(solution: FollowSolution) -> float:
    return float(np.sum(np.square(solution.every_rms)))


def _folds(problem: FollowProblem) -> list[tuple[list[Interval], list[Interval]]]:
    """Return parts to fit and parts to predict: first and second halves of all recordings, and the reverse."""
    ends = [float(record.grid_s[-1]) for record in problem.records]
    first, second = [(0.0, end / 2.0) for end in ends], [(end / 2.0, end) for end in ends]
    return [(first, second), (second, first)]


def _predict(problem: FollowProblem, point: FollowPoint, fold: tuple[list[Interval], list[Interval]]) -> float:
    """Fit one part of the recordings, and return the squared residuals of the other part, relative to the range."""
    own = replace(problem, parts=fold[0])
    solved = solve_follow(own, point, passes=1)
    every = replace(own, parts=[(0.0, np.inf)] * len(problem.records))
    whole_run = simulated(every, solved.point)
    return float(np.sum([np.square(whole_run.rms(at, part)) for at, part in enumerate(fold[1])]))


def fitted_pressures(solution: FollowSolution) -> dict[str, FittedData]:
    """Return measured and simulated pressures of each recording."""
    out = {}
    for at, record in enumerate(solution.problem.records):
        for side, measured, model in zip(SIDES, record.pressures_pa, solution.shown(at), strict=True):
            out[f"{record.name}, {side}"] = FittedData("time_s", "pressure_pa", record.grid_s, measured, model)
    return out


def described_circuit(circuit: FollowFit | Circuit | str | Path) -> tuple[Circuit, FollowFit | None]:
    """Return the circuit of a fit along motions, and this fit; for a circuit, the circuit and None."""
    fit = FollowFit.from_toml(str(circuit)) if FollowFit.is_file(circuit) else circuit
    if isinstance(fit, FollowFit):
        return fit.circuit, fit
    return (circuit, None) if isinstance(circuit, Circuit) else (Circuit.load(str(circuit)), None)


def simulate_motion(
    circuit: FollowFit | Circuit | str | Path,
    recording: str | Path | Recording,
    *,
    layout: AnyLayout = None,
) -> tuple[dict[str, NDArray[Any]], Plain]:
    """Simulate a circuit whose piston follows the position of a recording.

    The run starts with the measured pressures at the temperature of the walls. The piston follows the motion exactly.

    Parameters
    ----------
    circuit : FollowFit, Circuit or path
        A path leads to a circuit file, or to the file of a fit along motions.
    recording : path or Recording
    layout : Layout or path, optional

    Returns
    -------
    dict, dict
        Columns of the trajectory in SI, by name; provenance for `pneudrive.simulation.trajectory.save_columns`.

    Raises
    ------
    RecordingError, LayoutError, DescriptionError, FitError
        Input is not valid.
    """
    described = described_circuit(circuit)[0]
    driven, (record,) = DrivenCircuit(described), driven_recordings([recording], layout)
    check_readings(driven, [record])
    provenance = origin(
        described,
        [record.recording],
        title=described.name,
        description_hash=described.description_hash,
        motion=record.name,
        motion_sha256=record.recording.sha256,
        assumed=described.assumed(),
    )
    start = np.array([*record.pressures_pa[:, 0], *driven.wall_k.values()])
    columns = driven.run(driven.values_form((), ()), record, start, float(record.grid_s[-1]))
    return {"time_s": record.grid_s, **columns}, provenance
