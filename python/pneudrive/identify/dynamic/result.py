"""Result of a dynamic identification: values of a drive with their uncertainty, notes, statistics, model error.

An interval covers only sensor noise and becomes smaller with every sample, while the model is never exact. For a lower
limit of the model error, each held number (bore, supply pressure, conductance, ...) is given the relative error
`MODEL_SHARE`. The resulting change of the free values follows by least squares on the balances along the recordings
(force in sliding, both pressure rates):

    d theta_h = - (Phi^T W Phi)^-1 Phi^T W d e_h,    floor = sqrt(sum over h of d theta_h^2)

Phi are the derivatives of the balances' residuals with respect to the free values. The error of the held number h
changes these residuals by d e_h. W weights each balance by one over the mean square of its terms. The formula uses the
motion of the recordings, but not their noise.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from pneudrive import __version__, _core
from pneudrive.arrays import Array, NamedIntervals, NamedNumbers, Pair, Plain, by_name
from pneudrive.describe import Circuit, Drive
from pneudrive.errors import FitError, PneudriveError, warn
from pneudrive.estimate.estimates import intervals as intervals_at
from pneudrive.estimate.estimates import rms, student
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.free.parameters import DriveFamily, Parameter, family_of, numbers_of
from pneudrive.identify.base import HASH_DIGITS, SIMULATED, Fit, FitFile, Undetermined, recording_tables
from pneudrive.identify.dynamic.problem import FitProblem, Iterate
from pneudrive.identify.dynamic.search import SearchOptions, Solved, profile
from pneudrive.identify.dynamic.sensors import CHANNELS
from pneudrive.identify.export import SlidingCurve, curve_of_drive
from pneudrive.identify.identified import FittedData, apply_identified, remedy_for, sentence, stated
from pneudrive.numbers import plain
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

#: First words of the note on kept start values.
KEPT = "apply keeps the start value of "


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DriveFit(Fit, kind="drive"):
    """Values of a drive's description with their uncertainty.

    Attributes
    ----------
    values : dict
        Name in the drive file -> value in SI (pressures absolute), at the last point of the search.
    units : dict
        Name of a value or sensor -> unit.
    sensors : dict
        ``position.offset [recording]``, ``pressure_a.gain``, ... -> value in SI.
    free : tuple of str
        Order of `covariance`: values, then sensors.
    covariance : ndarray, shape (p, p)
        First-order covariance in SI. It includes variance and autocorrelation of the residuals, but no directions that
        the recordings do not determine.
    intervals : dict
        Determined value or sensor -> (lower, upper), 95 %, from sensor noise. Empty if the search did not converge.
    model_errors : dict
        Value or sensor -> lower limit of the model error: change for errors of 1 % in each held number, added in
        quadrature (`pneudrive.identify.dynamic.result`).
    undetermined : tuple of Undetermined
        Undetermined values, each with reason and remedy.
    notes : tuple of str
        Notes on omissions, held values and assumptions.
    statistics : dict
        samples, iterations, cost, gap; ``rms.CHANNEL``, ``noise.CHANNEL`` in SI, ``fit_percent.CHANNEL``.
    converged : bool
        False if the search was interrupted or stopped early; the values are then the best so far.
    fits : bool
        False if residuals exceed the sample-to-sample noise of a channel, i.e. the model is incomplete.
    provenance : dict
        Version, hash of the drive, recordings with their hashes, options.
    start : Drive or Circuit
        Description with the start values of the search.
    """

    sensors: NamedNumbers
    start: Drive | Circuit = field(repr=False)
    fits: bool = True

    @property
    def state(self) -> str:
        """State of the search at its end, as text."""
        if not self.converged:
            return "not converged: best values so far, without intervals"
        return "converged" if self.fits else "converged, but the model does not fit"

    def sensors_of(self, recording: str) -> dict[str, NamedNumbers]:
        """Return the fitted errors of the sensors of a recording, in the form for `pn.validate`.

        Parameters
        ----------
        recording : str
            Name of the recording. A recording outside the fit gets the common gains and lags, and the mean offsets and
            delays of the fitted recordings.

        Returns
        -------
        dict
            Channel -> ``offset``, ``gain``, ``lag`` or ``delay`` -> value in SI.
        """
        lost = {u.parameter for u in self.undetermined}
        found: dict[str, dict[str, list[float]]] = {}
        for name, value in self.sensors.items():
            plain_name, _, which = name.partition(" [")
            if name not in lost and (not which or which == f"{recording}]" or recording not in self.recordings):
                channel, _, kind = plain_name.rpartition(".")
                found.setdefault(channel, {}).setdefault(kind, []).append(value)
        return {channel: {kind: float(np.mean(v)) for kind, v in kinds.items()} for channel, kinds in found.items()}

    def apply(self, drive: Drive | Circuit | None = None) -> Any:  # noqa: ANN401 - a drive or a circuit
        """Return a drive or a circuit with the determined values of this fit, each with interval and recordings.

        The drive is unchanged if the recordings determine no value.

        Parameters
        ----------
        drive : Drive or Circuit, optional
            Default: the description at the start of the search.

        Raises
        ------
        FitError, DescriptionError
            The drive has no parameter with the name of a fitted value, or the values are not valid together.

        Warns
        -----
        PneudriveWarning
            The search did not converge; or undetermined values keep the value of the drive. In the second case, the
            warning states the error of this combination.
        """
        if not self.converged:
            warn("the search did not converge: the drive gets the best values so far, without intervals")
        warn_of_mixture(self, drive)
        return apply_identified(
            self.identified_as({n: n for n in self.determined}), self.start if drive is None else drive
        )

    def _curve(self, speeds_m_s: Any, gauges_pa: Pair) -> SlidingCurve:  # noqa: ANN401 - checked
        if isinstance(self.start, Circuit):
            raise FitError(**stated("application", "circuit"))
        return curve_of_drive(self.apply(), speeds_m_s, *gauges_pa)

    def _groups(self) -> tuple[NamedNumbers, ...]:
        return self.values, self.sensors

    def _first(self) -> Plain:
        return super()._first() | {"fits": self.fits}

    def _last(self) -> Plain:
        return {"drive": self.start.with_origins()}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        start = file.content["drive"]
        described = Circuit if "components" in start else Drive
        return super()._fields(file) | {
            "sensors": {name: entry.value for name, entry in file.groups[1].items()},
            "start": described.model_validate(start),
            "fits": bool(file.content.get("fits", True)),
        }

    @property
    def seconds(self) -> float:
        """Duration of all recordings."""
        return sum(float(r["seconds"]) for r in self.provenance.get("recordings", []))

    def _residual_lines(self) -> list[str]:
        lines = []
        for key, size in self.statistics.items():
            what, _, channel = key.partition(".")
            if what == "rms":
                factor, unit = readable(meaning(CHANNELS[channel])[1])
                fit = self.statistics[f"fit_percent.{channel}"]
                lines.append(f"residuals of {channel}: {plain(size / factor)} {unit}, fit {fit:.2f} %")
        return lines


def warn_of_mixture(fit: Any, described: object) -> None:  # noqa: ANN401 - of two modules
    """Warn that a description combines its own values with fitted values; state the error of this combination if known.

    Parameters
    ----------
    fit : DriveFit or VolumeFit
    described : object
        Description that gets the fitted values; None: the description with the start values of the search.
    """
    kept = sorted(set(fit.values).difference(fit.determined))
    note = next((note for note in fit.notes if note.startswith(KEPT)), None)
    if note is not None and described in (None, fit.start):
        warn(note)
    elif kept and fit.determined:
        warn(sentence("notes", "mixture", kept=", ".join(kept)))


def applied_note(solved: Solved, kept: Collection[str]) -> list[str]:
    """Return a note with the errors of two free runs: one with the applied values, one with the fitted values.

    Free runs use the starts and sensor errors of the fit. The list is empty if all values or no values were determined.

    Parameters
    ----------
    solved : Solved
        End of the search.
    kept : collection of str
        Undetermined values, which keep their start value.
    """
    problem = solved.problem
    places = [i for i, p in enumerate(problem.parameters) if p.name in kept]
    if not places or len(places) == problem.drive_size:
        return []
    fitted = solved.values
    mixed = fitted.copy()
    mixed[places] = [problem.parameters[i].value for i in places]
    before, after = _free_run(solved, fitted), _free_run(solved, mixed)
    words = f"{KEPT}{', '.join(problem.parameters[i].name for i in places)} together with the fitted values: "
    if not after:
        return [f"{words}this combination cannot be simulated"]
    shown = {c.name: readable(c.unit) for e in problem.experiments for c in e.channels}
    errors = []
    for name, error in after.items():
        factor, unit = shown[name]
        fitted_words = f" (fitted values: {plain(before[name] / factor)} {unit})" if before else ""
        errors.append(f"{plain(error / factor)} {unit} in {name}{fitted_words}")
    return [f"{words}the rms error of a free run is then {', '.join(errors)}"]


def _free_run(solved: Solved, values: Array) -> NamedNumbers:
    """Return the root mean square error of each channel of free runs in SI; empty if a run fails."""
    problem = solved.problem
    whole = [replace(experiment, starts=np.zeros(1, dtype=np.int64)) for experiment in problem.experiments]
    free = FitProblem(problem.parameters, problem.sensors, problem.transforms, whole)
    point = Iterate(problem.transforms.internal(values), [states[:1] for states in solved.at.point.states])
    try:
        shots = free.run(point, "end", derivatives=False)
    except FitError:  # such a drive is rejected, or cannot be simulated
        return {}
    return free.rms([free.measure(i, point.eta, shot.outputs)[0] for i, shot in enumerate(shots)])


#: Relative error of each term of a model of a drive (assumed).
MODEL_SHARE = 0.01
#: Fraction of the highest speed below which the piston does not count as sliding.
SLIDES = 0.01
#: Fraction of the largest scaled derivative below which a direction is not determined.
SINGULAR_SHARE = 1e-3
#: Balances of a recording: a function of the drive's numbers, values at the fitted numbers, and terms of these values.
Along = tuple[Callable[[Array], list[Array]], list[Array], list[Array]]
_STATES = ("position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa")
_TERMS = ("force_n", "friction_n", "end_stop_force_n", "pressure_rate_a_pa_s", "pressure_rate_b_pa_s")


def model_errors(drive: Drive | Circuit, solved: Solved) -> NamedNumbers:
    """Return the lower limit of the model error of each free value that affects the balances, in SI."""
    if not drive.is_plain:  # the balances of the chambers differ
        return {}
    found = zip(solved.problem.parameters, solved.values.tolist(), strict=False)
    free = [replace(p, value=value) for p, value in found]
    own = solved.problem.experiments[0].family  # held: numbers of the drive that are not derived from free ones
    known = {*own.paths, *(one.path for one in own.settled)}
    held = [replace(p, value=own.get(p.core)) for p in numbers_of(drive).values() if p.core not in known]
    held = [p for p in held if p.value != 0.0 and not p.name.startswith(("gas.", "valve.linear_above"))]
    family = family_of(drive, [*free, *held])
    numbers = (*free, *held)
    values = np.array([p.value for p in numbers])
    sizes = [max(abs(p.value), p.size if np.isinf(p.lower) else 0.0) for p in numbers]
    steps = MODEL_SHARE * np.array(sizes)
    try:
        every = [_balances(solved, index, family, values) for index in range(len(solved.problem.experiments))]
        scale = np.sqrt([sum(np.sum(terms[b] ** 2) for _, _, terms in every) for b in range(3)])
        columns = np.column_stack([_change(every, values, k, steps[k], scale) for k in range(values.size)])
    except (PneudriveError, ValueError):
        return {}
    if not np.isfinite(columns).all():
        return {}
    own, off = columns[:, : len(free)], columns[:, len(free) :]
    size = np.linalg.norm(own, axis=0)
    shown = size > 0.0
    inverse = np.linalg.pinv(own[:, shown] / size[shown], rcond=SINGULAR_SHARE) / size[shown][:, None]
    floor = np.linalg.norm(inverse @ off, axis=1) * steps[: len(free)][shown]
    return by_name(np.array([p.name for p in free])[shown].tolist(), floor)


def _balances(solved: Solved, index: int, family: DriveFamily, values: Array) -> Along:
    """Return the balances along the fitted motion of a recording, which is free of noise.

    The balances are the force balance in sliding (in N) and the balances of both pressure rates (in Pa/s).
    """
    experiment, starts = solved.problem.experiments[index], solved.at.point.states[index]
    fitted = solved.values[: solved.problem.drive_size]
    states = experiment.run(fitted, starts, derivatives=False, outputs=_STATES).outputs.T
    recording = experiment.recording
    openings, temperatures = _core.valve_openings(recording["command"]), starts[0, [3, 5]].tolist()
    along: Any = (recording.time_s, *map(np.ascontiguousarray, states), openings, temperatures)

    def terms(numbers: Array) -> list[Any]:
        out = family.core(numbers).along(*along)
        mass = family.get("cylinder.moving_mass") + family.get("load.mass")
        return [mass, *(out[name] for name in _TERMS)]

    def balances(mass: float, pushed: Array, friction: Array, _: Array, *rates: Array) -> list[Array]:
        return [mass * inertia_n_kg - pushed * slides + friction * slides, *rates]

    here = mass, pushed, friction, stop, *rates = terms(values)
    speed = np.abs(states[1])
    slides = (speed > SLIDES * speed.max()) & (stop == 0.0)
    inertia_n_kg = (pushed - friction) * slides / mass
    sizes = [np.hypot(pushed, friction) * slides, *rates]
    return lambda numbers: balances(*terms(numbers)), balances(*here), sizes


def _change(every: list[Along], values: Array, k: int, step: float, scale: Array) -> Array:
    """Return the change of all balances, relative to their terms, for a step of one number of the drive."""
    parts = []
    for balances, here, _ in every:
        for sign in (1.0, -1.0):  # a number at a bound is changed in the other direction
            beside = values.copy()
            beside[k] += sign * step
            try:
                there = balances(beside)
            except PneudriveError:
                if sign < 0.0:
                    raise
                continue
            parts += [sign * (b - a) / s for a, b, s in zip(here, there, scale, strict=True)]
            break
    return np.concatenate(parts)


#: Largest half width of the 95 % interval of a determined value, as a fraction of the value.
LARGEST_REACH = 0.5
#: Ratio of the ends of an interval beyond which a value has no effect.
NO_EFFECT = 1e6
#: Component of an undetermined direction above which a parameter counts as undetermined.
TAKES_PART = 0.3
#: Correlation above which two values are only determined together.
TOGETHER = 0.95
#: An encoder resolves bristles whose deflection before breakaway, Fs/sigma0, is at least ten of its steps.
RESOLVED_SHARE = 0.1


def _lost(fit: DriveFit, ends: NamedIntervals, sizes: Array, weak: Array) -> list[Undetermined]:
    """Return statements on values that the recordings do not determine.

    For an offset and similar values of sensors, the relative width of the interval has no meaning. Such a value is
    undetermined only if it is part of an undetermined direction.

    Parameters
    ----------
    fit : DriveFit
    ends : dict
        95 % intervals.
    sizes : ndarray, shape (P,)
        Reference for the width of each interval: the value, or a typical change if the value may be zero.
    weak : ndarray, shape (w, P)
        Undetermined directions in scaled coordinates.
    """
    names, values, correlation = fit.free, fit.free_values(), fit.correlation
    out: dict[str, Undetermined] = {}
    for direction in weak:
        part = [n for n, share in zip(names, direction, strict=True) if abs(share) > TAKES_PART]
        for n in part:
            if others := [m for m in part if m != n]:
                reason = f"this value can change together with {', '.join(others)} without an effect on the recordings"
                rest = f"{remedy_for(n)}; or fix {' or '.join(others)}"
            else:
                reason, rest = "the recordings do not depend on this value", remedy_for(n)
            out.setdefault(n, Undetermined(n, reason, rest))
    for i, n in enumerate(names):
        lower, upper = ends[n]
        if n in out or n in fit.sensors or not max(values[n] - lower, upper - values[n]) > LARGEST_REACH * sizes[i]:
            continue
        factor, unit = readable(fit.units[n])
        reason = f"anything from {plain(lower / factor)} to {plain(upper / factor)} {unit}".rstrip() + " fits"
        if upper > NO_EFFECT * lower > 0.0:
            reason = "the recordings do not depend on this value"
        partners = [m for j, m in enumerate(names) if j != i and abs(correlation[i, j]) > TOGETHER]
        if partners:
            reason += f"; this value is determined only together with {', '.join(partners)}"
        out[n] = Undetermined(n, reason, remedy_for(n))
    return [out[n] for n in names if n in out]


def unresolved_damping(step_m: float, breakaway_n: float, stiffness_n_m: float) -> Undetermined | None:
    """Return a statement on undetermined damping if the encoder does not resolve the bristles.

    Parameters
    ----------
    step_m : float
        Resolution of the position sensor: the larger of its step and its noise.
    breakaway_n, stiffness_n_m : float
        Breakaway force and bristle stiffness.
    """
    deflection = breakaway_n / stiffness_n_m
    if step_m <= RESOLVED_SHARE * deflection:
        return None
    sizes = {"step": 1e6 * step_m, "deflection": 1e6 * deflection, "needed": 1e6 * RESOLVED_SHARE * deflection}
    return Undetermined("friction.bristle_damping", **stated("undetermined", "damping", **sizes))


#: Correlation length of residuals, in samples, and variance of residuals. A note is given above both limits. Solver
#: errors explain a smaller variance.
CORRELATED, SOLVER_SHARE = 10.0, 0.1


def assembled(drive: Drive | Circuit, solved: Solved, options: SearchOptions) -> DriveFit:
    """Return the fit from the best solution of a search."""
    problem, parameters, records = solved.problem, solved.problem.parameters, solved.problem.records
    values, names, size = solved.values, problem.names, problem.drive_size
    covariance, reach = solved.covariance, student(solved.freedom)
    every = [*parameters, *problem.sensors]
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    lower = np.array([p.lower if isinstance(p, Parameter) else -np.inf for p in every])
    low, high = intervals_at(values, reach * spread, lower, [p.upper for p in every])
    usual = np.where(np.isinf(lower), [p.size for p in every], 0.0)
    sizes = np.maximum(np.abs(values), usual)
    for k, p in enumerate(parameters):  # next to nothing: no share of itself, but the data exclude the start value
        end = values[k] + reach * spread[k]
        is_wide = high[k] - values[k] > LARGEST_REACH * sizes[k]
        if np.isfinite(p.lower) and is_wide and end < LARGEST_REACH * p.value:
            low[k] = max(p.lower, values[k] - reach * spread[k])
            high[k] = end
            sizes[k] = p.value
    intervals = by_name(names, zip(low.tolist(), high.tolist(), strict=True))
    fit = DriveFit(
        values=by_name(names[:size], values[:size]),
        units={p.name: p.unit for p in every},
        sensors=by_name(names[size:], values[size:]),
        free=tuple(names),
        covariance=covariance,
        intervals=intervals,
        details={n: {"sources": [r.name for r in records]} for n in names[:size]},
        undetermined=(),
        notes=tuple(_notes(drive, options, solved)),
        statistics=_statistics(solved, options.count),
        converged=solved.converged,
        fits=not solved.missed,
        model_errors=model_errors(drive, solved),
        provenance={
            "version": __version__,
            "method": "output error",
            "drive": drive.name,
            "description_hash": drive.description_hash,
            "recordings": recording_tables(records),
            "start": {p.name: p.value for p in parameters},
            "segment_s": solved.segment_s,
            "rtol": options.rtol,
        },
        start=drive,
        fitted=_fitted(solved),
        profiler=partial(profile, solved),
    )
    lost = [] if options.interrupted else _lost(fit, intervals, sizes, solved.weak)
    text = json.dumps({"provenance": fit.provenance, "values": fit.values}, sort_keys=True, default=str)
    fit.provenance["fit_hash"] = hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]
    fit.provenance[INPUTS] = inputs_of(drive, records)
    notes = (*fit.notes, *applied_note(solved, {u.parameter for u in lost}))
    return replace(fit, undetermined=(*options.lost, *lost), notes=notes)


def _notes(drive: Drive | Circuit, options: SearchOptions, solved: Solved) -> list[str]:
    notes, problem = list(options.notes), solved.problem
    if not solved.converged:
        if not options.interrupted:
            blind = not any(c.name.startswith("pressure") for one in problem.experiments for c in one.channels)
            more = "; a position alone does not determine the gas: record the chamber pressures" if blind else ""
            notes.append(f"the search did not converge: check the residuals, or try other segments{more}")
        notes.append("there are no intervals, because they are valid only at a minimum")
    elif not drive.is_plain:
        notes.append("intervals cover noise only: the model error of a drive simulated as a circuit is unknown")
    units = numbers_of(drive)
    moved = problem.experiments[0].family.derived_values(solved.values)
    notes += [
        f"{named_value(name, value, units[name].unit)} is derived from free values, because the drive does not state it"
        for name, value in moved.items()
    ]
    coloured = [
        f"{problem.experiments[i].channels[c].name} of {problem.records[i].name} ({tau:.0f} samples)"
        for (i, c), (variance, tau) in solved.inflation.items()
        if tau > CORRELATED and variance > SOLVER_SHARE
    ]
    if coloured and solved.converged:
        notes.append(f"residuals are correlated over time: {', '.join(coloured)}; the intervals allow for this")
    if solved.missed:
        for record in problem.records:
            if not {"pressure_a_pa", "pressure_b_pa"} <= record.columns.keys():
                continue
            command = record["command"][:-1]
            rise_a, rise_b = (np.nansum(command * np.diff(record[f"pressure_{side}_pa"])) for side in "ab")
            if rise_a < 0.0 < rise_b:  # pressure a falls and pressure b rises where the command is above 0
                notes.append(sentence("notes", "opposed", name=record.name))
        off = ", ".join(f"{name} is off by {ratio:.2g} times its noise" for name, ratio in solved.missed.items())
        notes.append(sentence("notes", "misfit", missed=off))
    if any(r.synthetic for r in problem.records):
        notes.append(SIMULATED)
    return notes


def named_value(name: str, si: float, unit: str, digits: int = 4) -> str:
    """Return a name with its value in the common unit."""
    factor, shown = readable(unit)
    return f"{name} = {plain(si / factor, digits)} {shown}".strip()


def _statistics(solved: Solved, steps: int) -> NamedNumbers:
    problem, at = solved.problem, solved.at
    samples = sum(len(e.measured) for e in problem.experiments)
    out = {"samples": float(samples), "iterations": float(steps), "cost": at.cost, "gap": at.gap}
    for name, size in problem.rms(at.residuals).items():
        out[f"rms.{name}"] = size
        own = [(e, i) for e in problem.experiments for i, c in enumerate(e.channels) if c.name == name]
        out[f"noise.{name}"] = rms([e.noise[i] for e, i in own])
        power = np.mean([np.nanvar(e.measured[:, i]) for e, i in own])
        out[f"fit_percent.{name}"] = float(100.0 * (1.0 - size / np.sqrt(power))) if power > 0.0 else np.nan
    return out


def _fitted(solved: Solved) -> dict[str, FittedData]:
    out = {}
    for experiment, residual in zip(solved.problem.experiments, solved.at.residuals, strict=True):
        record = experiment.recording
        models = experiment.measured - residual * experiment.noise
        for channel, measured, model in zip(experiment.channels, experiment.measured.T, models.T, strict=True):
            name = f"{record.name}, {channel.name}"
            out[name] = FittedData("time_s", channel.column, record.time_s, measured, model)
    return out
