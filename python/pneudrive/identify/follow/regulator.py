"""Lag and gain from the command of a pressure regulator to its outlet pressure, from recordings of both.

The model is a grey box: p' = (g u(t - d) + o - p) / T. Filling and venting have separate times T. Volume, conductance
and leak act only through T, so such recordings do not determine them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from pneudrive import __version__
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import Bounds, Quantity, StatedPressure
from pneudrive.errors import DescriptionError, FitError
from pneudrive.identify.base import CardFit
from pneudrive.numbers import plain
from pneudrive.repr_tables import Card
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.simulation.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.drive_recording import VolumeRecording
    from pneudrive.signals.layout import Layout

    Array = NDArray[np.float64]

NAMES = ("gain_pa", "offset_pa", "filling_s", "venting_s")
KIND = "regulator-fit"  # of its file
SHARES = ("rms", "held", "predicted")  # in percent in the file
TABLES = (
    "correlation",
    "dead_time_s",
    "undetermined",
    "values",
    "intervals",
    "spread",
    "runs",
    "sha256",
)  # as they are
BLOCK_S = 1.0  # blocks of time for the covariance
TIED = 0.95  # correlation of gain and offset above which the recordings do not separate them
TURNED = 0.2  # relative spread from run to run above which a number differs between runs
DELAYS = np.linspace(0.0, 3.0, 7)  # dead times that are tried, in sampling intervals
NEVER = (
    "volume, area, conductance, leak, moving mass, friction and the kind of actuator are not determined by command and "
    "pressure: they act only together, through the lag"
)


class RegulatorTable(Described):
    """``[regulator]``: start values of a regulator; `full_pressure` belongs to the command 1."""

    table_name: ClassVar[str] = "regulator"
    full_pressure: Annotated[Any, StatedPressure()]
    zero_pressure: Annotated[Any, StatedPressure()] = None
    lag_s: Annotated[float, Quantity("s", "ms", Bounds(above=0.0))] = 0.1


class Regulator(Described):
    """A pressure regulator between a command of 0 to 1 and a pressure, with start values."""

    name: str = "unnamed regulator"
    regulator: RegulatorTable

    @classmethod
    def is_file(cls, path: str | Path) -> bool:
        """Whether a path is a TOML file with a table ``[regulator]``."""
        if Path(path).suffix != ".toml" or not Path(path).is_file():
            return False
        return isinstance(toml.read(path, DescriptionError)[0].get("regulator"), dict)

    @classmethod
    def load(cls, path: str | Path) -> Regulator:
        """Read a file."""
        tables, text = toml.read(path, DescriptionError)
        with toml.locating(str(path), text):
            return cls.model_validate(tables)

    def start(self, ambient_pa: float) -> Array:
        """Return the start point of the search: gain, offset, and logarithms of both lags."""
        table = self.regulator
        full = table.full_pressure.absolute_pa(ambient_pa)
        zero = ambient_pa if table.zero_pressure is None else table.zero_pressure.absolute_pa(ambient_pa)
        return np.array([(full - zero) / 1e5, zero / 1e5, np.log(table.lag_s), np.log(table.lag_s)])


@dataclass(frozen=True, eq=False, repr=False)
class RegulatorFit(CardFit):
    """Lag and gain of a regulator.

    Attributes
    ----------
    name : str
    values : dict
        ``gain_pa`` (for the whole range of the command), ``offset_pa`` (absolute, at the command 0), ``filling_s``,
        ``venting_s``.
    intervals : dict
        95 %: of correlated residuals and of the spread from run to run.
    runs : dict
        Name of each recording -> the separate values of the recording.
    spread : dict
        Relative standard deviation from run to run.
    rms, predicted : float
        Residual of the fit, and of each run predicted from the other runs, relative to the range.
    held : float
        Residual with gain and offset of the description held.
    correlation : float
        Of gain and offset.
    dead_time_s : tuple of float
        Dead times that fit within 2 % of the best residual.
    undetermined : tuple of str
    sha256 : dict
        Name of each recording -> hash of its data.
    """

    name: str
    values: dict[str, float]
    runs: dict[str, dict[str, float]]
    rms: float
    predicted: float
    held: float
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    correlation: float = np.nan
    dead_time_s: tuple[float, float] = (0.0, 0.0)
    undetermined: tuple[str, ...] = ()
    series: dict[str, tuple[Array, Array, Array]] = field(default_factory=dict, repr=False)
    sha256: dict[str, str] = field(default_factory=dict, repr=False)

    def _card(self) -> Card:
        rows = []
        for name, value in self.values.items():
            low, high = self.intervals[name]
            text = f"{plain(value)} [{plain(low)}, {plain(high)}]"
            if name in self.spread:
                text += f", run to run {100 * self.spread[name]:.0f} %"
            rows.append((name, text))
        rows.append(("rms", f"{100 * self.rms:.2f} % of the range; {100 * self.held:.2f} % with the stated gain held"))
        if np.isfinite(self.predicted):
            rows.append(("predicted runs", f"{100 * self.predicted:.2f} % of the range"))
        return Card(f"{self.name}: {len(self.runs)} runs", rows=rows, notes=list(self.undetermined))

    def to_toml(self, path: str | Path) -> Path:
        """Write the fit."""
        head = {"kind": KIND, "name": self.name, "version": __version__}
        shares = {f"{key}_percent": 100.0 * getattr(self, key) for key in SHARES if np.isfinite(getattr(self, key))}
        with whole(Path(path)) as temporary:
            tables = head | shares | {key: getattr(self, key) for key in TABLES}
            temporary.write_text(toml.write(tables), encoding="utf-8")
        return Path(path)

    def simulate(self, record: VolumeRecording) -> Array:
        """Return the pressure of a recording from its command and its first pressure, absolute, Pa."""
        values = [self.values[name] for name in NAMES]
        return 1e5 * _simulate(np.r_[np.array(values[:2]) / 1e5, np.log(values[2:])], record, 0.0)


def read_regulator_fit(path: str | Path) -> RegulatorFit | None:
    """Read a file of `RegulatorFit.to_toml`; None for another file."""
    if Path(path).suffix != ".toml" or not Path(path).is_file():
        return None
    tables, _ = toml.read(path, FitError, "`pneudrive identify --out` writes it.")
    if tables.get("kind") != KIND:
        return None
    missing = [key for key in ("rms_percent", "values", "runs") if key not in tables]
    missing += [f"values.{name}" for name in NAMES if name not in tables.get("values", NAMES)]
    if missing:
        raise FitError("the fit of a regulator is not complete", where=str(path), value=f"missing: {missing[0]}")
    known = {key: tables[key] for key in TABLES if key in tables}
    known |= {key: tuple(known[key]) for key in ("dead_time_s", "undetermined") if key in known}
    shares = {key: tables.get(f"{key}_percent", np.nan) / 100.0 for key in SHARES}
    return RegulatorFit(str(tables.get("name", Path(path).stem)), **shares, **known)


def identify_regulator(
    regulator: Regulator | str | Path, recordings: Sequence[Any], layout: Layout | str | Path | None = None
) -> RegulatorFit:
    """Identify lag and gain from the command of a regulator to its outlet pressure.

    Parameters
    ----------
    regulator : Regulator or path
    recordings : sequence of path
        Time, command and pressure; each begins anywhere.
    layout : Layout or path, optional
        Of the kind ``fixed-volume``; the range of the command is 0 to 1.

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
    start = described.start(STANDARD_ATMOSPHERE_PA)
    solved = _fit(records, start)
    span = float(np.mean([np.ptp(r.pressure_pa) for r in records]))
    rms = float(np.sqrt(np.mean(_residual(solved, records) ** 2)))
    own = {r.name: _fit([r], solved) for r in records}
    runs = {name: _named(point) for name, point in own.items()}
    intervals, correlation = _intervals(records, solved, own)
    spread = {}
    if len(records) > 1:
        spread = {n: float(np.std([run[n] for run in runs.values()], ddof=1) / abs(_named(solved)[n])) for n in NAMES}
    predicted = [_residual(_fit([o for o in records if o is not r], solved), [r]) for r in records if len(records) > 1]
    held = least_squares(lambda lags: _residual(np.r_[start[:2], lags], records).ravel(), solved[2:])
    dead = _dead_time(records, solved)
    step = float(np.median(np.diff(records[0].time_s)))
    lost = [NEVER]
    if abs(correlation) > TIED:
        words = f"gain and offset are not separated: they correlate at {correlation:.2f}"
        lost.insert(0, f"{words}. Add a run at rest, or hold the stated gain")
    if dead[0] == 0.0:
        lost.insert(0, f"the dead time is not determined: 0 to {dead[1]:.3f} s fit, at a sample each {step:.3f} s")
    for name, value in spread.items():
        if value > TURNED:
            lost.append(f"{name} differs from run to run by {100 * value:.0f} %")
    return RegulatorFit(
        name=described.name,
        values=_named(solved),
        runs=runs,
        rms=1e5 * rms / span,
        predicted=1e5 * float(np.sqrt(np.mean(np.concatenate(predicted) ** 2))) / span if predicted else float("nan"),
        held=1e5 * float(np.sqrt(np.mean(held.fun**2))) / span,
        intervals=intervals,
        spread=spread,
        correlation=correlation,
        dead_time_s=dead,
        undetermined=tuple(lost),
        series={r.name: (r.time_s, r.pressure_pa, r.pressure_pa - 1e5 * _residual(solved, [r])) for r in records},
        sha256={r.name: r.sha256 for r in records},
    )


def _values(point: Array) -> Array:
    return np.r_[1e5 * point[:2], np.exp(point[2:4])]


def _named(point: Array) -> dict[str, float]:
    return {str(name): float(value) for name, value in zip(NAMES, _values(point), strict=True)}


def _fit(records: Sequence[VolumeRecording], start: Array) -> Array:
    return least_squares(lambda point: _residual(point, records), start, x_scale=[1.0, 1.0, 0.3, 0.3]).x


def _residual(point: Array, records: Sequence[VolumeRecording], dead_s: float = 0.0) -> Array:
    """Return measured minus simulated pressures of all recordings in bar."""
    return np.concatenate([r.pressure_pa / 1e5 - _simulate(point, r, dead_s) for r in records])


def _simulate(point: Array, record: VolumeRecording, dead_s: float) -> Array:
    """Return the pressure in bar: an exact step of the lag per sample, towards the mean of both set pressures."""
    goal = point[0] * np.interp(record.time_s - dead_s, record.time_s, record.opening) + point[1]
    between, step = 0.5 * (goal[1:] + goal[:-1]), np.diff(record.time_s)
    filling, venting = (1.0 - np.exp(-step / lag) for lag in np.exp(point[2:4]))
    out = np.empty(record.time_s.size)
    out[0] = p = record.pressure_pa[0] / 1e5
    for k, target in enumerate(between):
        p += (filling[k] if target > p else venting[k]) * (target - p)
        out[k + 1] = p
    return out


def _intervals(
    records: Sequence[VolumeRecording], point: Array, own: dict[str, Array]
) -> tuple[dict[str, tuple[float, float]], float]:
    """Return the wider interval, by blocks of time or by runs, and the correlation of gain and offset."""
    steps = np.array([1e-4, 1e-4, 1e-3, 1e-3])
    base = _residual(point, records)
    moved = [
        (_residual(point + steps * unit, records) - base) / step for unit, step in zip(np.eye(4), steps, strict=True)
    ]
    jacobian = np.array(moved).T
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    times = np.concatenate([i * 1e6 + r.time_s for i, r in enumerate(records)])
    edges = np.unique(np.floor(times / BLOCK_S), return_index=True)[1]
    scores = np.add.reduceat(jacobian * base[:, None], edges, axis=0)
    covariance = inverse @ (scores.T @ scores) @ inverse
    deviation = student.ppf(0.975, max(len(edges) - 4, 3)) * np.sqrt(np.diag(covariance))
    if len(own) > 1:
        between = np.std([p[:4] for p in own.values()], axis=0, ddof=1) / np.sqrt(len(own))
        deviation = np.maximum(deviation, student.ppf(0.975, len(own) - 1) * between)
    low, high = _values(point - deviation), _values(point + deviation)
    ends = {name: (float(low[i]), float(high[i])) for i, name in enumerate(NAMES)}
    return ends, float(inverse[0, 1] / np.sqrt(inverse[0, 0] * inverse[1, 1]))


def _dead_time(records: Sequence[VolumeRecording], point: Array) -> tuple[float, float]:
    """Return the smallest and the largest dead time that fit within 2 % of the best residual."""
    step = float(np.median(np.diff(records[0].time_s)))
    sizes = []
    for delay in DELAYS * step:
        found = least_squares(lambda p, d=delay: _residual(p, records, d), point, x_scale=[1.0, 1.0, 0.3, 0.3])
        sizes.append(float(np.sqrt(2.0 * found.cost)))
    fits = DELAYS[np.array(sizes) < 1.02 * min(sizes)] * step
    return float(fits.min()), float(fits.max())
