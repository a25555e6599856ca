"""Identification from the pressure of a volume: a fixed volume, or the outlet of a pressure regulator.

For a fixed volume, conductance, critical ratio, heat transfer, leak and tube friction are identified. The core
simulates the tank under the recorded opening of its line. The search of `identify` fits the free values and the
pressure at the start of each recording. The coordinates are logarithms, or the logit of the critical pressure ratio.
Intervals come from the profile of the cost (its minimum over all other values). They end where the profile has
increased by Student's t squared times the variance of the residuals. If the profile never reaches this limit on one
side, the interval is open and the value is not determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from pneudrive.arrays import Array, Columns, NamedIntervals, NamedNumbers, Plain, by_name
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe.base import Described
from pneudrive.describe.files import provenance, toml
from pneudrive.describe.marks import Bounds, Quantity, StatedPressure
from pneudrive.describe.tank import Tank
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.estimates import Transforms, rms, student
from pneudrive.files.inputs import origin
from pneudrive.free.parameters import DriveFamily, Parameter
from pneudrive.identify.base import Fit, FitFile, Undetermined, recording_tables
from pneudrive.identify.dynamic.fit import noise_of, solve
from pneudrive.identify.dynamic.problem import FitProblem, FittedRecording, Iterate
from pneudrive.identify.dynamic.result import CORRELATED, LARGEST_REACH, applied_note, named_value, warn_of_mixture
from pneudrive.identify.dynamic.search import Misfit, SearchOptions, Solved, join_segments, profile, solution
from pneudrive.identify.dynamic.sensors import Channel
from pneudrive.identify.identified import FittedData, number_table, sentence, sentences, written_as
from pneudrive.numbers import plain
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.signals.drive_recording import VolumeRecording, read_volume_recordings
from pneudrive.signals.layout import AnyLayout
from pneudrive.units import readable
from pneudrive.views import Finding

# --- Identification of a fixed volume from pressures: conductance, critical ratio, heat transfer, leak, tube friction.


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class VolumeFit(Fit, kind="volume"):
    """Values of a tank with their uncertainty.

    Attributes
    ----------
    values : dict
        Name in the tank file -> value in SI; pressures are absolute.
    units : dict
        Name -> SI unit.
    intervals : dict
        Name of a determined value -> (lower, upper), 95 %, by profile. Empty if the search did not converge.
    undetermined : tuple of Undetermined
        Undetermined values, each with reason and remedy.
    notes : tuple of str
    statistics : dict
        ``samples``. ``rms.pressure`` and ``noise.pressure``, Pa. ``rms_share.pressure``: rms of the worst recording,
        relative to the range of its pressure. ``correlation_time.samples``.
    converged : bool
    provenance : dict
    start : Tank or None
        Tank at the start of the search; None if read from a file without it.
    """

    start: Tank | None = field(repr=False)

    def _is_determined(self, name: str) -> bool:
        """Return whether the recordings determine a value; False if the search did not converge."""
        return name in self.intervals

    def apply(self, tank: Tank | None = None) -> Tank:
        """Return a tank with the determined values.

        Parameters
        ----------
        tank : Tank, optional
            Default: the tank at the start of the search.

        Raises
        ------
        FitError
            The fit was read from a file without the tank.

        Warns
        -----
        PneudriveWarning
            Undetermined values keep the values of the tank. The warning states the error of this combination.
        """
        start = self.start if tank is None else tank
        if start is None:
            raise FitError("the file of this fit has no tank", remedy="Fit again.")
        warn_of_mixture(self, tank)
        marks = provenance.marks(start)
        return start.replace({name: written_as(self.values[name], marks.get(name)) for name in self.determined})

    def _last(self) -> Plain:
        return {} if self.start is None else {"tank": self.start.to_dict()}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        tank = file.content.get("tank")
        return super()._fields(file) | {"start": None if tank is None else Tank.model_validate(tank)}

    def _residual_lines(self) -> list[str]:
        size, share = self.statistics["rms.pressure"], self.statistics["rms_share.pressure"]
        return [f"residuals of the pressure: {size / 1e5:.3g} bar rms, {100 * share:.2g} % of its range"]


#: Name in the file -> name in the circuit of the tank, SI unit.
NUMBERS: dict[str, tuple[str, str]] = number_table("tank")
#: Start value of a leak given as zero, as a fraction of the line's conductance, or of volume / (time * pressure).
LEAK_SHARE = 1e-3
RTOL = 1e-7
BENDS: dict[str, list[float]] = number_table("tank_starts")
ENOUGH_TO_START = 500
#: Distance in coordinates above which two minima count as different.
APART = 0.05
#: Pressure ratio at which a shorter linear region begins (assumed), and number of samples at the end of a recording
#: that are checked.
SHORT_REGION, LAST_SAMPLES = 0.99999, 10
#: Prior standard deviations of a start: pressure, Pa (practically free), and temperature, K (practically held).
BELIEF = np.array([1e5, 1e-6])
#: Sizes of a start, which scale gaps: pressure, Pa, and temperature, K.
SIZE = np.array([1e4, 10.0])


def identify_volume(
    tank: Tank,
    recordings: Any,  # noqa: ANN401 - one or several recordings of several types
    free: Sequence[str] | None = None,
    *,
    layout: AnyLayout = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> VolumeFit:
    """Identify parameters of a tank from recordings of its pressure.

    Parameters
    ----------
    tank : Tank
        Tank with start values of free parameters; all other values are known.
    recordings
        One or several recordings. Each is a file with a layout of ``kind = "fixed-volume"``, a `VolumeRecording`, or a
        mapping of SI columns. The columns are ``time_s``, ``pressure_pa`` absolute, ``command`` (the opening fraction
        of the line), and ``inlet_pressure_pa`` (absolute, between line and tube). The sampling may have any rate.
    free : sequence of str, optional
        Names in the tank file: ``line.conductance``, ``line.critical_pressure_ratio``, ``line.pressure``,
        ``volume.heat_transfer``, ``volume.leakage``, ``volume.value``, ``tube.friction_scale``. Default: all of
        these that the tank has, except ``line.pressure`` and ``volume.value``; the leak only if a recording can
        distinguish the leak from the line.
    layout : Layout or path, optional
        Layout of files.
    progress, cancel
        See `pneudrive.progress.Watch`.

    Returns
    -------
    VolumeFit
        Values, intervals, undetermined values.

    Raises
    ------
    FitError, RecordingError, LayoutError
        Input is not valid; the message gives value, rule and remedy.
    """
    watch = Watch(progress, cancel)
    records = read_volume_recordings(recordings, layout)
    names, held = _free(tank, records, free)
    search = SearchOptions(watch, 0.0, RTOL)
    variants, line = [tank], tank.line
    if line is not None and "linear_above" not in line.to_dict():
        highest = max(np.median(ratio[-LAST_SAMPLES:]) for ratio in _pressure_ratios(tank, records))
        if highest > line.linear_above:  # a recording reaches the linear region, which is assumed: try a shorter one
            variants.append(tank.replace({"line.linear_above": SHORT_REGION}))
    tried = [(_minima(variant, records, names, search), variant) for variant in variants]
    minima, tank = min(tried, key=lambda found: found[0][0].cost)
    problem, _ = _problem(tank, records, names, watch)
    solved = solve(problem, minima[0].point, search)
    others: list[Solved] = []  # further minima that the recordings cannot distinguish from the best one
    for minimum in minima[1:] if solved.converged else ():
        try:
            at, converged = join_segments(solved.problem, minimum.point, None)
        except FitError:
            continue
        is_new = all(_is_apart(at, other.at) for other in (solved, *others))
        if converged and is_new and at.cost - solved.at.cost < student(solved.freedom) ** 2:
            others.append(solution(solved.problem, at))
    return _result(tank, records, solved, others, held, search.notes)


def _pressure_ratios(tank: Tank, records: list[VolumeRecording]) -> list[Array]:
    """Return the ratio of the pressures on both sides of the line in each recording, at most 1."""
    assert tank.line is not None
    other = tank.line.core(tank.ambient)["pressure_pa"]
    return [np.minimum(r.pressure_pa / other, other / r.pressure_pa) for r in records]


def _free(
    tank: Tank, records: list[VolumeRecording], asked: Sequence[str] | None
) -> tuple[list[str], list[Undetermined]]:
    """Return the names of free values, and statements on values that are held because no recording determines them."""
    known = [name for name in NUMBERS if getattr(tank, name.partition(".")[0]) is not None]
    if asked is not None:
        if not asked:
            raise FitError("no parameter is free", remedy='Name free parameters, e.g. free=["line.conductance"].')
        for name in asked:
            if name not in known:
                raise FitError(f"{name} cannot be a free number of this tank", remedy=nearest(name, known))
        if len(set(asked)) < len(asked):
            raise FitError("a parameter is given twice", value=", ".join(asked))
        return list(asked), []
    names = [n for n in known if n not in ("line.pressure", "volume.value")]
    room = tank.ambient
    into_ambient = tank.line is not None and abs(tank.line.core(room)["pressure_pa"] / room.pressure_pa - 1.0) < 0.01
    if into_ambient and all((r.opening > 0.0).all() for r in records):
        names.remove("volume.leakage")
        reason = "the line is always open and leads to the ambient air, like the leak"
        return names, [Undetermined("volume.leakage", reason, "record with the line shut")]
    return names, []


class TankFamily(DriveFamily):
    """Circuits of a tank as a function of the free parameters. Gas of all parts starts in the state of the volume."""

    def __init__(self, tank: Tank, names: Sequence[str], longest_s: float) -> None:
        volume, line = tank.volume, tank.line
        leak = volume.leakage_m3_s_pa
        if leak == 0.0 and "volume.leakage" in names:  # a value of zero has no logarithm
            is_shut = line is None
            leak = 0.1 * volume.volume_m3 / (1e5 * longest_s) if is_shut else LEAK_SHARE * line.conductance_m3_s_pa
        super().__init__(tank.expanded(leak), [NUMBERS[name][0] for name in names])
        self._command = None if line is None else "line.opening"
        inlet = "volume" if tank.tube is None else "line.2"
        self._columns = {"pressure_pa": "volume.pressure_pa", "inlet_pressure_pa": f"{inlet}.pressure_pa"}
        for path in self.paths:
            if self.get(path) <= 0.0:
                self.put(path, 1e-2)

    def shoot(self, core: Any, asked: Any, look: Any) -> Any:  # noqa: ANN401 - the core's
        """Run segments under the opening of the line. A start consists of pressure and temperature of the volume."""
        of = [0 if name.endswith(".pressure_pa") else 1 for name in core.segment_names]
        together = [[i for i, own in enumerate(of) if own == quantity] for quantity in (0, 1)]
        asked = asked | {
            "initial": np.ascontiguousarray(asked["initial"][:, of]),
            "with_initial": together if asked["with_initial"] else False,
            "outputs": [self._columns[column] for column in asked["outputs"]],
        }
        found = core.shoot(self._command, asked, look)
        first = [core.segment_names.index(f"volume.{name}") for name in ("pressure_pa", "temperature_k")]
        return found | {name: found[name][:, first] for name in ("ends", "end_sensitivities")}


def _problem(
    tank: Tank,
    records: list[VolumeRecording],
    names: list[str],
    watch: Watch,
) -> tuple[FitProblem, Iterate]:
    """Return the fit problem, and the start point from the tank's values."""
    family = TankFamily(tank, names, max(r.duration_s for r in records))
    values = [family.get(path) for path in family.paths]
    upper = {} if tank.line is None else {"line.critical_pressure_ratio": tank.line.linear_above}
    parameters = [
        Parameter(name, path, NUMBERS[name][1], value, 0.0, upper.get(name, np.inf), value)
        for name, path, value in zip(names, family.paths, values, strict=True)
    ]
    experiments, nowhere = [], np.full(2, np.inf)
    for record in records:
        channels = [Channel(column.removesuffix("_pa"), column, "Pa") for column in record.measured]
        noise = np.array([noise_of(c, record, RTOL) for c in channels])
        one = FittedRecording(record, channels, np.zeros(1, np.int64), family, noise, RTOL, 1, watch=watch)
        one.belief, one.size, one.hidden, one.limits = BELIEF, SIZE, np.ones(2, dtype=bool), (-nowhere, nowhere)
        experiments.append(one)
    transforms = Transforms([p.lower for p in parameters], [p.upper for p in parameters])
    starts = [np.array([[np.median(r.pressure_pa[:3]), tank.start_temperature_k]]) for r in records]
    return FitProblem(parameters, [], transforms, experiments), Iterate(transforms.internal(values), starts)


def _is_apart(one: Misfit, other: Misfit) -> bool:
    return bool(np.abs(one.point.eta - other.point.eta).max() > APART)


def _minima(tank: Tank, records: list[VolumeRecording], names: list[str], search: SearchOptions) -> list[Misfit]:
    """Search from several starts on thinned samples; return the minima of the cost, best first."""
    bends, thinned = [i for i, name in enumerate(names) if name in BENDS], []
    for record in records:  # at most about a thousand samples, and those at which the line opens or shuts
        keep = np.zeros(record.time_s.size, dtype=bool)
        keep[:: max(record.time_s.size // ENOUGH_TO_START, 1)] = True
        keep[1:] |= np.diff(record.opening) != 0.0
        thinned.append(record.at(keep))
    problem, first = _problem(tank, thinned, names, search.watch)
    problem.believed = first.states
    found: list[Misfit] = []
    for apart in [(0.0,) * len(bends), *product(*(BENDS[names[i]] for i in bends))]:
        eta = first.eta.copy()
        eta[bends] += apart
        try:
            found.append(join_segments(problem, Iterate(eta, first.states), search)[0])
        except FitError:
            continue
    if not found:
        raise FitError("the tank cannot be simulated at the start values", remedy="Give other start values.")
    distinct: list[Misfit] = []
    for minimum in sorted(found, key=lambda one: one.cost):
        if all(_is_apart(minimum, known) for known in distinct):
            distinct.append(minimum)
    return distinct


def _result(
    tank: Tank,
    records: list[VolumeRecording],
    solved: Solved,
    others: list[Solved],
    held: list[Undetermined],
    interrupted: list[str],
) -> VolumeFit:
    problem = solved.problem
    values = by_name(problem.names, solved.values)
    intervals: NamedIntervals = {}
    for name in problem.names if solved.converged else ():  # over all minima, relative to the cost of the best one
        ends = [profile(minimum, name, least=solved.at.cost) for minimum in (solved, *others)]
        intervals[name] = min(low for low, _ in ends), max(high for _, high in ends)
    known = [p for p in problem.parameters if p.name in intervals]
    lost = [u for p in known if (u := _lost(tank, records, p, values[p.name], *intervals[p.name]))]
    fitted, rests, shares = {}, [], []
    for experiment, residual, record in zip(problem.experiments, solved.at.residuals, records, strict=True):
        experiment.watch = UNWATCHED
        for c, pressure in enumerate(record.measured.values()):
            rest = residual[:, c] * experiment.noise[c]
            name = record.name if pressure is record.pressure_pa else f"{record.name}, inlet"
            fitted[name] = FittedData("time_s", "pressure_pa", record.time_s, pressure, pressure - rest)
            rests.append(rest)
            shares.append(rms(rest) / float(np.ptp(pressure) or 1.0))
    off = np.concatenate(rests)
    tau = float(np.median([tau for _, tau in solved.inflation.values()]))
    return VolumeFit(
        values=values,
        units={p.name: p.unit for p in problem.parameters},
        free=tuple(values),
        covariance=solved.covariance,
        intervals=intervals,
        undetermined=(*held, *lost),
        notes=(*_notes(tank, solved, others, tau, interrupted), *applied_note(solved, {u.parameter for u in lost})),
        statistics={
            "samples": float(off.size),
            "rms.pressure": rms(off),
            "rms_share.pressure": max(shares),
            "noise.pressure": float(np.sqrt(np.sum(off**2) / solved.freedom)),
            "correlation_time.samples": tau,
        },
        converged=solved.converged,
        provenance=origin(
            tank,
            records,
            method="output error, profile likelihood",
            tank=tank.name,
            recordings=recording_tables(records),
        ),
        start=tank,
        fitted=fitted,
        profiler=intervals.__getitem__,
    )


def _lost(
    tank: Tank,
    records: list[VolumeRecording],
    number: Parameter,
    value: float,
    low: float,
    high: float,
) -> Undetermined | None:
    """Return a statement on an undetermined value, with its limit if known; None if the value is determined."""
    name, upper = number.name, number.upper
    is_ratio = name == "line.critical_pressure_ratio"
    if max(value - low, high - value) <= LARGEST_REACH * (1.0 if is_ratio else value):
        return None
    part, _, key = NUMBERS[name][0].partition(".")
    components = tank.expanded(tank.volume.leakage_m3_s_pa)["components"]
    stated = next((one["numbers"][key] for one in components if one["name"] == part), 0.0)  # 0 without a leak
    if low == 0.0 and high < LARGEST_REACH * stated:
        return None  # next to nothing: the recordings exclude the start value, which must not stay
    factor, unit = readable(number.unit)
    ends = {"below": plain(low / factor), "above": plain(high / factor), "unit": unit}
    known = "upper" if low == 0.0 else "lower"  # limit that the recordings give, if they give only one
    key = "both" if low > 0.0 and high < upper else "none" if low == 0.0 and high == upper else known
    reason = sentence("limits", key, **ends) + sentences("limits").get(f"{key} {name}", "")
    if is_ratio:
        reason += sentence("limits", "ratio", most=max(float(x.max()) for x in _pressure_ratios(tank, records)))
    return Undetermined(name, reason, sentences("tank")[name])


def _notes(
    tank: Tank,
    solved: Solved,
    others: list[Solved],
    tau: float,
    interrupted: list[str],
) -> list[str]:
    notes = []
    if tank.line is not None and tank.line.linear_above == SHORT_REGION:
        notes.append(f"line.linear_above = {SHORT_REGION:g} fits the end of the recordings better than the default")
    if not solved.converged:
        notes += interrupted or ["the search did not converge, so there are no intervals; give other start values"]
    if tank.volume.start_temperature_k is None:
        notes.append(sentence("notes", "wall_start", kelvin=tank.start_temperature_k))
    if solved.missed:
        notes.append(sentence("notes", "tank_misfit", ratio=max(solved.missed.values())))
    elif tau > CORRELATED:
        notes.append(f"residuals are correlated over {tau:.0f} samples; the intervals allow for this")
    for minimum in others:
        values = zip(minimum.problem.parameters, minimum.values, strict=True)
        words = ", ".join(named_value(p.name, value, p.unit, 3) for p, value in values)
        notes.append(f"other values fit as well: {words}. The intervals include both: record with the line shut, too")
    return notes


# --- Lag and gain from the command of a pressure regulator to its outlet pressure, from recordings of both.
#
# The model is a grey box: p' = (g u(t - d) + o - p) / T. Filling and venting have separate times T. Volume,
# conductance and leak act only through T, so such recordings do not determine them.

#: Coordinates of the search: gain and offset in bar, logarithms of both lags.
REGULATOR_SCALES = Transforms([-np.inf, -np.inf, 0.0, 0.0], size=[1e5, 1e5, 1.0, 1.0])

BLOCK_S = 1.0  # blocks of time for the covariance
TIED = 0.95  # correlation of gain and offset above which the recordings do not separate them
TURNED = 0.2  # relative spread from run to run above which a number differs between runs
DELAYS = np.linspace(0.0, 3.0, 7)  # dead times that are tried, in sampling intervals


class RegulatorTable(Described):
    """``[regulator]``: start values of a regulator; `full_pressure` is the pressure at command 1."""

    table_name = "regulator"
    full_pressure: Annotated[Any, StatedPressure()]
    zero_pressure: Annotated[Any, StatedPressure()] = None
    lag_s: Annotated[float, Quantity("s", "ms", Bounds(above=0.0))] = 0.1


class Regulator(Described):
    """Model of a pressure regulator from a command of 0 to 1 to a pressure, with start values."""

    name: str = "unnamed regulator"
    regulator: RegulatorTable

    @classmethod
    def load(cls, path: str | Path) -> Regulator:
        """Read a regulator from a TOML file."""
        return toml.load(cls.model_validate, path)

    @property
    def start(self) -> Array:
        """Start point of the search: gain, offset, and logarithms of both lags."""
        table, zero = self.regulator, STANDARD_ATMOSPHERE_PA
        full = table.full_pressure.absolute_pa(STANDARD_ATMOSPHERE_PA)
        if table.zero_pressure is not None:
            zero = table.zero_pressure.absolute_pa(STANDARD_ATMOSPHERE_PA)
        return REGULATOR_SCALES.internal([full - zero, zero, table.lag_s, table.lag_s])


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RegulatorFit(Fit, kind="regulator-fit"):
    """Lag and gain of a regulator.

    Attributes
    ----------
    name : str
    values : dict
        ``gain_pa`` (for the whole range of the command), ``offset_pa`` (absolute, at the command 0), ``filling_s``,
        ``venting_s``.
    intervals : dict
        95 % intervals, from correlated residuals and from differences between runs.
    undetermined : tuple of str
        Sentences on undetermined values.
    statistics : dict
        Rms residuals relative to the range of the pressure: ``rms`` of the fit, ``predicted`` of runs predicted from
        the other runs, ``held`` with gain and offset of the description. ``correlation`` of gain and offset.
        ``least_dead_time_s``, ``largest_dead_time_s``: dead times that fit within 2 % of the best residual.
    runs : dict
        Name of a recording -> values from this recording alone.
    details : dict
        Name -> ``run_to_run``: relative standard deviation from run to run.
    """

    name: str
    runs: dict[str, NamedNumbers]

    def findings(self) -> tuple[Finding, ...]:
        """Return the undetermined values."""
        return tuple(Finding(sentence, "open") for sentence in self.undetermined)

    def simulate(self, record: VolumeRecording) -> Array:
        """Return the absolute pressure in Pa, simulated from command and first pressure of a recording."""
        return 1e5 * _simulate(REGULATOR_SCALES.internal([*self.values.values()]), record, 0.0)

    def _residual_lines(self) -> list[str]:
        size, held, predicted = (100.0 * self.statistics.get(key, np.nan) for key in ("rms", "held", "predicted"))
        lines = [f"rms {size:.2f} % of the range; {held:.2f} % with the stated gain held"]
        return [*lines, f"predicted runs: {predicted:.2f} % of the range"] if np.isfinite(predicted) else lines

    def _first(self) -> Plain:
        return super()._first() | {"name": self.name}

    def _last(self) -> Plain:
        return {"runs": self.runs}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        name = str(file.content.get("name", cls.TITLE))
        return super()._fields(file) | {"name": name, "runs": file.content["runs"]}


REGULATOR_UNITS: dict[str, str] = RegulatorFit.WORDS["older_units"]


def identify_regulator(
    regulator: Regulator | str | Path, recordings: Sequence[Any], layout: AnyLayout = None
) -> RegulatorFit:
    """Identify gain and lag of a regulator from its command and its outlet pressure.

    Parameters
    ----------
    regulator : Regulator or path
    recordings : sequence of path
        Recordings of time, command and pressure, starting in any state.
    layout : Layout or path, optional
        Layout of the kind ``fixed-volume``; the range of the command is 0 to 1.

    Raises
    ------
    FitError, RecordingError, LayoutError, DescriptionError
        Input is not valid, or the command does not change.
    """
    described = regulator if isinstance(regulator, Regulator) else Regulator.load(regulator)
    records = read_volume_recordings(list(recordings), layout)
    idle = [r.name for r in records if np.ptp(r.opening) == 0.0]
    if idle:
        raise FitError("the command does not change", value=", ".join(idle), remedy="record steps of the command")
    start = described.start
    best, lost, spread = _fit(records, start), [], {}
    values = _named(best.x)
    span = float(np.mean([np.ptp(r.pressure_pa) for r in records]))
    own = {r.name: _fit([r], best.x).x for r in records}
    runs = {name: _named(point) for name, point in own.items()}
    intervals, correlation = _intervals(records, best, own)
    step = float(np.median(np.diff(records[0].time_s)))
    sizes = np.sqrt([2.0 * _fit(records, best.x, delay).cost for delay in DELAYS * step])
    fits = DELAYS[sizes < 1.02 * sizes.min()] * step  # dead times that fit within 2 % of the best residual
    least_s, largest_s = float(fits.min()), float(fits.max())
    if least_s == 0.0:
        lost.append(sentence("regulator", "dead_time", most=largest_s, step=step))
    if abs(correlation) > TIED:
        lost.append(sentence("regulator", "tied", correlation=correlation))
    lost.append(sentence("regulator", "never"))
    held = least_squares(lambda lags: _residual(np.r_[start[:2], lags], records), best.x[2:])
    rests = {"rms": best.fun, "held": held.fun}
    if len(records) > 1:
        predicted = [_residual(_fit([other for other in records if other is not r], best.x).x, [r]) for r in records]
        rests["predicted"] = np.concatenate(predicted)
        for name, value in values.items():
            spread[name] = float(np.std([run[name] for run in runs.values()], ddof=1) / abs(value))
            if spread[name] > TURNED:
                lost.append(sentence("regulator", "turned", name=name, percent=100 * spread[name]))
    statistics = {key: 1e5 * rms(rest) / span for key, rest in rests.items()}
    statistics |= {"correlation": correlation, "least_dead_time_s": least_s, "largest_dead_time_s": largest_s}
    return RegulatorFit(
        name=described.name,
        values=values,
        units={**REGULATOR_UNITS},
        free=tuple(REGULATOR_UNITS),
        covariance=np.zeros((0, 0)),
        intervals=intervals,
        undetermined=tuple(lost),
        statistics=statistics,
        provenance=origin(described, records, recordings=[{"name": r.name, "sha256": r.sha256} for r in records]),
        runs=runs,
        details={name: {"run_to_run": value} for name, value in spread.items()},
        fitted={
            r.name: FittedData(
                "time_s", "pressure_pa", r.time_s, r.pressure_pa, r.pressure_pa - 1e5 * _residual(best.x, [r])
            )
            for r in records
        },
    )


def _named(point: Array) -> NamedNumbers:
    return by_name(REGULATOR_UNITS, REGULATOR_SCALES.natural(point))


def _fit(records: Sequence[VolumeRecording], start: Array, dead_s: float = 0.0) -> OptimizeResult:
    return least_squares(lambda point: _residual(point, records, dead_s), start, x_scale=[1.0, 1.0, 0.3, 0.3])


def _residual(point: Array, records: Sequence[VolumeRecording], dead_s: float = 0.0) -> Array:
    """Return measured minus simulated pressures of all recordings in bar."""
    return np.concatenate([r.pressure_pa / 1e5 - _simulate(point, r, dead_s) for r in records])


def _simulate(point: Array, record: VolumeRecording, dead_s: float) -> Array:
    """Return the pressure in bar. Each step of the lag is exact for the mean setpoint of two neighbouring samples."""
    goal = point[0] * np.interp(record.time_s - dead_s, record.time_s, record.opening) + point[1]
    between, step = 0.5 * (goal[1:] + goal[:-1]), np.diff(record.time_s)
    filling, venting = (1.0 - np.exp(-step / lag) for lag in np.exp(point[2:4]))
    out = np.empty(record.time_s.size)
    out[0] = p = record.pressure_pa[0] / 1e5
    for k, target in enumerate(between):
        p += (filling[k] if target > p else venting[k]) * (target - p)
        out[k + 1] = p
    return out


def _intervals(records: Sequence[VolumeRecording], best: OptimizeResult, own: Columns) -> tuple[NamedIntervals, float]:
    """Return the wider intervals, by blocks of time or by runs, and the correlation of gain and offset."""
    inverse = np.linalg.pinv(best.jac.T @ best.jac)
    times = np.concatenate([i * 1e6 + r.time_s for i, r in enumerate(records)])
    edges = np.unique(np.floor(times / BLOCK_S), return_index=True)[1]
    scores = np.add.reduceat(best.jac * best.fun[:, None], edges, axis=0)
    covariance = inverse @ (scores.T @ scores) @ inverse
    deviation = student(max(len(edges) - 4, 3)) * np.sqrt(np.diag(covariance))
    if len(own) > 1:
        between = np.std([*own.values()], axis=0, ddof=1) / np.sqrt(len(own))
        deviation = np.maximum(deviation, student(len(own) - 1) * between)
    low, high = (REGULATOR_SCALES.natural(best.x + sign * deviation) for sign in (-1.0, 1.0))
    ends = by_name(REGULATOR_UNITS, zip(low.tolist(), high.tolist(), strict=True))
    return ends, float(inverse[0, 1] / np.sqrt(inverse[0, 0] * inverse[1, 1]))
