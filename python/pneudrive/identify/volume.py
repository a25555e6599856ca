"""Identification of a fixed volume from pressures: conductance, critical ratio, heat transfer, leak, tube friction.

The core simulates the tank under the recorded opening of its line; weighted least squares find what is free and the
pressure at the start of each recording. Derivatives are exact (dual numbers through the integrator). Every value is
estimated as its logarithm, the critical pressure ratio as the logarithm of its odds. An interval comes from the
profile of the cost: how far the value can go, all others following, until the cost has grown by Student's t squared
times the variance of the residuals; a side on which it never does is open, and the value is not determined there.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__, _core
from pneudrive.characterise.motion import noise_level
from pneudrive.characterise.spread import student
from pneudrive.characterise.volume_recording import VolumeRecording, read_volume_recordings
from pneudrive.errors import FitError, nearest
from pneudrive.identify.base import Undetermined
from pneudrive.identify.volume_result import VolumeFit
from pneudrive.numbers import plain
from pneudrive.units import readable
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.characterise.layout import Layout
    from pneudrive.describe.tank import Tank
    from pneudrive.watch import Flag

    Array = NDArray[np.float64]

#: Name in the file -> path in the core's form, SI unit, what to record where it is not determined.
NUMBERS: dict[str, tuple[str, str, str]] = {
    "line.conductance": (
        "line.conductance_m3_s_pa",
        "m^3/(s Pa)",
        "record a faster change of pressure through the line",
    ),
    "line.critical_pressure_ratio": (
        "line.critical_pressure_ratio",
        "1",
        "record until the pressures on both sides of the line are nearly equal",
    ),
    "line.pressure": ("line.pressure_pa", "Pa", "record until the pressure stays, or measure it"),
    "tube.friction_scale": (
        "tube.friction_scale",
        "1",
        "record a pressure on each side of the tube, or a volume that is small beside the tube's",
    ),
    "volume.value": ("volume.volume_m3", "m^3", "measure it: the pressure shows conductance over volume alone"),
    "volume.heat_transfer": (
        "volume.heat_transfer_w_k",
        "W/K",
        "record a fast change of pressure, and with the line shut after it until the pressure has settled",
    ),
    "volume.leakage": ("volume.leakage_m3_s_pa", "m^3/(s Pa)", "record with the line shut for longer"),
}
#: A leak that is given as none begins here, as a share of the line's conductance, or of volume over time and pressure.
LEAK_SHARE = 1e-3
RTOL = 1e-7
#: A profile is followed so far, as a factor on the value; in this many halvings it is found to 1 % of that.
FARTHEST, HALVINGS = 1e4, 12
#: Steps of one search; where a step would gain less than this share of the variance of one sample, it ends.
MOST_STEPS, SMALL_GAIN = 60, 1e-2
#: What bends the course of the pressure, and how far apart its starts are, as logarithms.
BENDS = ("line.critical_pressure_ratio", "volume.heat_transfer", "volume.leakage")
STARTS_APART = 1.5
ENOUGH_TO_START = 500
#: Directions of the scaled normal equations below this are rounding.
ROUNDING = 1e-10
#: A value whose interval reaches further than this share of it is not determined.
LARGEST_REACH = 0.5
#: Residuals above this multiple of the noise from sample to sample are no noise (assumed).
MISFIT = 2.0
#: Correlation time of the residuals, in samples, of which a note is made.
CORRELATED = 10.0


def identify_volume(
    tank: Tank,
    recordings: Any,  # noqa: ANN401 - one or several, of several kinds
    free: Sequence[str] | None = None,
    *,
    layout: Layout | str | Path | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> VolumeFit:
    """Identify numbers of a tank from recordings of its pressure.

    Parameters
    ----------
    tank : Tank
        Start values of what is free; everything else is taken as known.
    recordings
        One or several of: a file that a layout with ``kind = "fixed-volume"`` reads, a mapping of SI columns
        (``time_s``, ``pressure_pa`` absolute, ``command``: the share of the line's opening, ``inlet_pressure_pa``:
        absolute, between line and tube), a `VolumeRecording`. Any rate of sampling will do.
    free : sequence of str, optional
        Names as in the file: ``line.conductance``, ``line.critical_pressure_ratio``, ``line.pressure``,
        ``volume.heat_transfer``, ``volume.leakage``, ``volume.value``, ``tube.friction_scale``. Where nothing is said:
        conductance, critical pressure ratio, heat transfer, friction of a tube and, where a recording can tell it from
        the line, the leak.
    layout : Layout or path, optional
        How files are read.
    progress, cancel
        As of `pneudrive.watch.Watch`.

    Returns
    -------
    VolumeFit
        Values, intervals, what is not determined.

    Raises
    ------
    FitError, RecordingError, LayoutError
        With what, value, rule and remedy.
    """
    watch = Watch(progress, cancel)
    records = read_volume_recordings(recordings, layout)
    names, held = _free(tank, records, free)
    problem = _Problem(tank, records, names)
    found = problem.solve(_best_start(tank, records, names, watch), watch)
    return _result(problem, found, held, watch)


def _free(
    tank: Tank, records: list[VolumeRecording], asked: Sequence[str] | None
) -> tuple[list[str], list[Undetermined]]:
    """Names of what is free, and what is held since nothing can tell it."""
    form = tank.core_form()
    known = [name for name in NUMBERS if form[name.partition(".")[0]] is not None]
    if asked is not None:
        if not asked:
            raise FitError("nothing is free", remedy='Name what is sought, e.g. free=["line.conductance"].')
        for name in asked:
            if name not in known:
                raise FitError(f"{name} is no number of this tank that can be free", remedy=nearest(name, known))
        if len(set(asked)) < len(asked):
            raise FitError("a parameter is named twice", value=", ".join(asked))
        return list(asked), []
    names = [n for n in known if n not in ("line.pressure", "volume.value")]
    line = form["line"]
    into_ambient = line is not None and abs(line["pressure_pa"] / tank.ambient.pressure_pa - 1.0) < 0.01
    if into_ambient and all((r.opening > 0.0).all() for r in records):
        names.remove("volume.leakage")
        reason = "the line is open all the time and leads to the ambient air, as the leak does"
        return names, [Undetermined("volume.leakage", reason, "record with the line shut")]
    return names, []


def _best_start(tank: Tank, records: list[VolumeRecording], names: list[str], watch: Watch) -> Array:
    """Search from several starts over some of the samples: what bends the curve has more than one minimum."""
    few = [_thinned(r) for r in records]
    problem = _Problem(tank, few, names)
    start = problem.start()
    bends = [i for i, name in enumerate(names) if name in BENDS]
    found = []
    for signs in [(0,) * len(bends), *product((-1, 1), repeat=len(bends))]:
        q = start.copy()
        q[bends] += STARTS_APART * np.array(signs)
        if problem.at(q, watch) is not None:
            found.append(problem.solve(q, watch))
    if not found:
        raise FitError("the tank cannot be simulated at the start values", remedy="give other start values")
    return min(found, key=lambda one: one.cost).q


def _thinned(record: VolumeRecording) -> VolumeRecording:
    """Every k-th sample, so that at most about a thousand are left, and those at which the line opens or shuts."""
    step = max(record.time_s.size // ENOUGH_TO_START, 1)
    keep = np.zeros(record.time_s.size, dtype=bool)
    keep[::step] = True
    keep[1:] |= np.diff(record.opening) != 0.0
    return record.at(keep)


@dataclass
class _Found:
    """A solution: coordinates, residuals in Pa one recording after the other, and their derivatives."""

    q: Array
    residual: Array
    jacobian: Array
    converged: bool

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


class _Problem:
    """Free values and the starts of the recordings, as coordinates; residuals at a point."""

    def __init__(self, tank: Tank, records: list[VolumeRecording], names: list[str]) -> None:
        self.tank, self.records, self.names = tank, records, names
        self.form = tank.core_form()
        self.paths = [NUMBERS[name][0] for name in names]
        for path in self.paths:  # a value of zero has no logarithm: a small one begins the search
            table, key = path.split(".")
            if self.form[table][key] <= 0.0:
                self.form[table][key] = self._smallest(path)

    def _smallest(self, path: str) -> float:
        line = self.form["line"]
        if path.endswith("heat_transfer_w_k"):
            return 1e-2
        if line is not None:
            return LEAK_SHARE * line["conductance_m3_s_pa"]
        longest = max(r.duration_s for r in self.records)
        return 0.1 * self.form["volume"]["volume_m3"] / (1e5 * longest)

    def start(self) -> Array:
        """Coordinates of the start: free values, then the logarithm of each recording's first pressure."""
        values = [self.form[table][key] for table, key in (path.split(".") for path in self.paths)]
        first = [float(np.median(r.pressure_pa[:3])) for r in self.records]
        return np.array([self._inward(n, v) for n, v in zip(self.names, values, strict=True)] + list(np.log(first)))

    def _upper(self, name: str) -> float:
        return self.form["line"]["linear_above"] if name == "line.critical_pressure_ratio" else np.inf

    def _inward(self, name: str, value: float) -> float:
        upper = self._upper(name)
        return float(np.log(value / (upper - value)) if np.isfinite(upper) else np.log(value))

    def value(self, i: int, q: float) -> float:
        """Value of a free number at a coordinate, SI."""
        upper = self._upper(self.names[i])
        return float(upper / (1.0 + np.exp(-q)) if np.isfinite(upper) else np.exp(q))

    def _slope(self, i: int, q: float) -> float:
        value, upper = self.value(i, q), self._upper(self.names[i])
        return value * (1.0 - value / upper) if np.isfinite(upper) else value

    def values(self, q: Array) -> Array:
        """Free values, SI."""
        return np.array([self.value(i, q[i]) for i in range(len(self.names))])

    def at(self, q: Array, watch: Watch) -> _Found | None:
        """Residuals (measured - model), Pa, and their derivatives by the coordinates; None where no run is possible."""
        p = len(self.names)
        for path, value in zip(self.paths, self.values(q), strict=True):
            table, key = path.split(".")
            self.form[table][key] = float(value)
        core = _core.Tank(_json(self.form))
        by_value = np.array([self._slope(i, q[i]) for i in range(p)])
        residuals, slopes = [], []
        for j, record in enumerate(self.records):
            times, openings = record.steps
            initial = np.array([[np.exp(q[p + j]), self.tank.start_temperature_k]])
            asked: _core.Shooting = {
                "times": times,
                "commands": openings,
                "sample_times": record.time_s,
                "starts": [0],
                "initial": initial,
                "parameters": self.paths,
                "with_initial": [0],
                "outputs": list(record.measured),
                "rtol": RTOL,
                "threads": 1,
            }
            shot = core.shoot(asked, lambda _: watch.look())
            if shot["failures"][0] is not None:
                return None
            for place, measured in enumerate(record.measured.values()):
                by = shot["sensitivities"][:, place, :]
                slope = np.zeros((len(by), q.size))
                slope[:, :p] = by[:, :p] * by_value
                slope[:, p + j] = by[:, p] * initial[0, 0]
                residuals.append(measured - shot["values"][:, place])
                slopes.append(slope)
        return _Found(q, np.concatenate(residuals), np.concatenate(slopes), converged=False)

    def solve(self, q: Array, watch: Watch, held: int | None = None) -> _Found:
        """Gauss-Newton with Levenberg's and Marquardt's damping; one coordinate may be held."""
        at = self.at(q, watch)
        if at is None:
            raise FitError("the tank cannot be simulated at the start values", remedy="give other start values")
        use = np.array([i != held for i in range(q.size)])
        damping = 1e-3
        for step in range(MOST_STEPS):
            watch.tell(step, 0, "steps of the search")
            scale = np.linalg.norm(at.jacobian[:, use], axis=0) + 1e-12 * np.linalg.norm(at.residual)
            scaled = at.jacobian[:, use] / np.where(scale > 0.0, scale, 1.0)
            normal, gradient = scaled.T @ scaled, scaled.T @ at.residual
            # What an undamped step would gain: a step that is short for its damping alone ends nothing.
            to_gain = float(gradient @ np.linalg.solve(normal + ROUNDING * np.eye(len(gradient)), gradient))
            if to_gain <= SMALL_GAIN * at.cost / max(at.residual.size, 1):
                at.converged = True
                return at
            while True:
                move = np.zeros(q.size)
                move[use] = np.linalg.solve(normal + damping * np.eye(len(gradient)), gradient) / scale
                move = np.clip(move, -1.0, 1.0)
                after = self.at(at.q + move, watch)
                if after is not None and after.cost <= at.cost:
                    break
                damping *= 10.0
                if damping > 1e8:
                    at.converged = True  # no step lowers the cost any more
                    return at
            at, damping = after, max(damping / 10.0, ROUNDING)
        return at


def _json(form: dict[str, Any]) -> str:
    import json

    return json.dumps(form, sort_keys=True)


def _intervals(problem: _Problem, found: _Found, reach: float, watch: Watch) -> dict[str, tuple[float, float]]:
    """Intervals by profile, SI: a bound that is not found within `FARTHEST` is 0 or infinite."""
    out = {}
    for i, name in enumerate(problem.names):
        ends = [_end(problem, found, i, sign, reach, watch) for sign in (-1.0, 1.0)]
        upper = problem._upper(name)
        low, high = (problem.value(i, q) if np.isfinite(q) else (0.0 if q < 0 else upper) for q in ends)
        out[name] = (low, high)
    return out


def _end(problem: _Problem, found: _Found, i: int, sign: float, reach: float, watch: Watch) -> float:
    """Coordinate at which the profile of the cost has grown by `reach`, on one side; infinite where it never does."""

    def too_far(distance: float) -> bool:
        nonlocal near
        q = near.q.copy()
        q[i] = found.q[i] + sign * distance
        try:
            at = problem.solve(q, watch, held=i)
        except FitError:
            return True
        grown = at.cost - found.cost > reach
        near = at if not grown else near
        return grown

    near = found
    usual = np.sqrt(reach / max(float(found.jacobian[:, i] @ found.jacobian[:, i]), 1e-300))
    inside, outside = 0.0, float(np.clip(usual, 1e-6, np.log(FARTHEST)))
    while not too_far(outside):
        if outside >= np.log(FARTHEST):
            return sign * np.inf
        inside, outside = outside, min(2.0 * outside, float(np.log(FARTHEST)))
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (inside, middle) if too_far(middle) else (middle, outside)
        if outside - inside < 0.01 * outside:
            break
    return float(found.q[i] + sign * outside)


def _correlation_time(residual: Array) -> float:
    """Return the samples after which residuals are independent.

    1 + 2 sum of the autocorrelation until it first falls below zero.
    """
    away = residual - residual.mean()
    power = float(away @ away)
    total = 1.0
    for lag in range(1, away.size // 2):
        r = float(away[lag:] @ away[:-lag]) / power if power > 0.0 else 0.0
        if r <= 0.0:
            break
        total += 2.0 * r
    return total


def _result(problem: _Problem, found: _Found, held: list[Undetermined], watch: Watch) -> VolumeFit:
    measured = [(record, pressure) for record in problem.records for pressure in record.measured.values()]
    samples = [slice(a, b) for a, b in _bounds([pressure.size for _, pressure in measured])]
    parts = [found.residual[part] for part in samples]
    freedom = max(found.residual.size - found.q.size, 1)
    tau = float(np.median([_correlation_time(part) for part in parts]))
    variance = found.cost / freedom * tau
    exact = max(float(pressure.max()) for _, pressure in measured) * RTOL
    reach = student(max(freedom / tau, 1.0)) ** 2 * max(variance, exact**2)
    intervals = _intervals(problem, found, reach, watch) if found.converged else {}
    values = dict(zip(problem.names, problem.values(found.q).tolist(), strict=True))
    undetermined = [
        *held,
        *(u for n in problem.names if n in intervals if (u := _lost(problem, n, values[n], *intervals[n]))),
    ]
    notes = _notes(problem, [(*one, part) for one, part in zip(measured, parts, strict=True)], tau)
    if not found.converged:
        notes.insert(0, "the search has not converged: there are no intervals; give other start values")
    return VolumeFit(
        values=values,
        units={name: NUMBERS[name][1] for name in values},
        free=tuple(values),
        covariance=np.zeros((0, 0)),
        intervals=intervals,
        undetermined=tuple(undetermined),
        notes=tuple(notes),
        statistics={
            "samples": float(found.residual.size),
            "rms.pressure": float(np.sqrt(found.cost / found.residual.size)),
            "rms_share.pressure": max(
                float(np.sqrt(np.mean(part**2))) / float(np.ptp(pressure) or 1.0)
                for part, (_, pressure) in zip(parts, measured, strict=True)
            ),
            "noise.pressure": float(np.sqrt(found.cost / freedom)),
            "correlation_time.samples": tau,
        },
        converged=found.converged,
        starts_pa={r.name: float(np.exp(found.q[len(values) + j])) for j, r in enumerate(problem.records)},
        provenance={
            "version": __version__,
            "method": "output error, profile likelihood",
            "tank": problem.tank.name,
            "recordings": [
                {"name": r.name, "sha256": r.sha256, "file": str(r.source or ""), "seconds": r.duration_s}
                for r in problem.records
            ],
        },
        start=problem.tank,
        series={
            r.name if pressure is r.pressure_pa else f"{r.name}, inlet": (r.time_s, pressure, pressure - part)
            for part, (r, pressure) in zip(parts, measured, strict=True)
        },
    )


def _bounds(sizes: list[int]) -> list[tuple[int, int]]:
    edges = np.cumsum([0, *sizes]).tolist()
    return list(pairwise(edges))


def _lost(problem: _Problem, name: str, value: float, low: float, high: float) -> Undetermined | None:
    """Say that a value is not determined, and which limit the recordings give all the same."""
    upper = problem._upper(name)
    is_ratio = name == "line.critical_pressure_ratio"
    if max(value - low, high - value) <= LARGEST_REACH * (1.0 if is_ratio else value):
        return None
    factor, unit = readable(NUMBERS[name][1])
    below, above = plain(low / factor), plain(high / factor)
    open_below, open_above = low == 0.0, high == upper
    if open_below and open_above:
        reason = "the recordings do not depend on it"
    elif open_above:
        reason = f"only a lower limit is known, {below} {unit}"
        reason += ": the gas keeps the temperature of the wall" if name == "volume.heat_transfer" else ""
    elif open_below:
        reason = f"only an upper limit is known, {above} {unit}"
        reason += ": none can be told from little" if name in ("volume.leakage", "volume.heat_transfer") else ""
    else:
        reason = f"anything from {below} to {above} {unit} fits"
    if is_ratio and problem.form["line"] is not None:
        other = problem.form["line"]["pressure_pa"]
        ratios = [np.minimum(r.pressure_pa / other, other / r.pressure_pa) for r in problem.records]
        reason += (
            f"; the pressures on both sides of the line were in ratios up to {max(float(x.max()) for x in ratios):.2f}"
        )
    return Undetermined(name, reason, NUMBERS[name][2])


def _notes(problem: _Problem, measured: list[tuple[VolumeRecording, Array, Array]], tau: float) -> list[str]:
    notes = []
    if problem.tank.volume.start_temperature_k is None:
        notes.append(
            f"assumed: the gas has {problem.tank.start_temperature_k:g} K, that of the wall, where a recording begins"
        )
    ratios = [float(np.sqrt(np.mean(part**2))) / max(noise_level(p), 1e-300) for _, p, part in measured]
    if max(ratios) > MISFIT:
        worst = measured[int(np.argmax(ratios))][0].name
        notes.append(
            f"the model does not fit {worst}: residuals are {max(ratios):.2g} times the noise from sample to sample. "
            "Values and intervals make up for what it lacks: look at the opening, the volume, the pressure on the "
            "other side, and the zero of the transducer"
        )
    elif tau > CORRELATED:
        notes.append(f"residuals are correlated over {tau:.0f} samples; intervals are widened for it")
    return notes
