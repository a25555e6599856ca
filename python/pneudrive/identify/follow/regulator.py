"""Lag and gain from the command of a pressure regulator to its outlet pressure, from recordings of both.

The model is a grey box: p' = (g u(t - d) + o - p) / T. Filling and venting have separate times T. Volume, conductance
and leak act only through T, so such recordings do not determine them.
"""

from __future__ import annotations

from dataclasses import dataclass
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
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.identify.base import Fit
from pneudrive.identify.compared import FittedData
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.views import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.identify.base import FitFile
    from pneudrive.signals.drive_recording import VolumeRecording
    from pneudrive.signals.layout import Layout

    Array = NDArray[np.float64]

NAMES = ("gain_pa", "offset_pa", "filling_s", "venting_s")
UNITS = dict(zip(NAMES, ("Pa", "Pa", "s", "s"), strict=True))
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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RegulatorFit(Fit):
    """Lag and gain of a regulator.

    Attributes
    ----------
    name : str
    values : dict
        ``gain_pa`` (for the whole range of the command), ``offset_pa`` (absolute, at the command 0), ``filling_s``,
        ``venting_s``.
    intervals : dict
        95 %: of correlated residuals and of the spread from run to run.
    undetermined : tuple of str
        Sentences.
    statistics : dict
        ``rms``, ``predicted``, ``held``: residual of the fit, of each run predicted from the other runs, and with gain
        and offset of the description held, relative to the range. ``correlation`` of gain and offset.
        ``least_dead_time_s``, ``largest_dead_time_s``: dead times that fit within 2 % of the best residual.
    runs : dict
        Name of each recording -> the separate values of the recording.
    details : dict
        Name -> ``run_to_run``: relative standard deviation from run to run.
    """

    KIND: ClassVar[str] = "regulator-fit"
    TITLE: ClassVar[str] = "fit of a regulator"
    HEAD: ClassVar[str] = "# Identified pressure regulator. SI units, pressures absolute; intervals are 95 %."
    DETAILS: ClassVar[dict[str, str]] = {"run_to_run": "run to run"}

    name: str
    runs: dict[str, dict[str, float]]

    def findings(self) -> tuple[Finding, ...]:
        """Return the undetermined values."""
        return tuple(Finding(sentence, "open") for sentence in self.undetermined)

    def simulate(self, record: VolumeRecording) -> Array:
        """Return the pressure of a recording from its command and its first pressure, absolute, Pa."""
        values = [self.values[name] for name in NAMES]
        return 1e5 * _simulate(np.r_[np.array(values[:2]) / 1e5, np.log(values[2:])], record, 0.0)

    def _title(self) -> str:
        return f"{self.name}: {len(self.runs)} runs"

    def _residual_lines(self) -> list[str]:
        rms, held, predicted = (100.0 * self.statistics.get(key, np.nan) for key in ("rms", "held", "predicted"))
        lines = [f"rms {rms:.2f} % of the range; {held:.2f} % with the stated gain held"]
        return [*lines, f"predicted runs: {predicted:.2f} % of the range"] if np.isfinite(predicted) else lines

    def _first(self) -> dict[str, Any]:
        return super()._first() | {"name": self.name}

    def _last(self) -> dict[str, Any]:
        return {"runs": self.runs}

    @classmethod
    def _present(cls, content: dict[str, Any]) -> dict[str, Any]:
        """Return the tables of a file; an older one has a table for each property of the values."""
        if "provenance" in content:
            return content
        tables = {"unit": "units", "interval": "intervals", "run_to_run": "spread"}
        values = cls._joined({"units": UNITS, **content}, tables)
        statistics = {
            key: content[f"{key}_percent"] / 100.0
            for key in ("rms", "held", "predicted")
            if f"{key}_percent" in content
        }
        statistics |= {"correlation": content.get("correlation", np.nan)}
        recordings = [{"name": name, "sha256": digest} for name, digest in content.get("sha256", {}).items()]
        return content | {
            "values": values,
            "statistics": statistics,
            "provenance": {"recordings": recordings or list(content["runs"])},
        }

    @classmethod
    def _fields(cls, file: FitFile) -> dict[str, Any]:
        name = str(file.content.get("name", cls.TITLE))
        return super()._fields(file) | {"name": name, "runs": file.content["runs"]}


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
    statistics = {"rms": 1e5 * rms / span, "held": 1e5 * float(np.sqrt(np.mean(held.fun**2))) / span}
    if predicted:
        statistics["predicted"] = 1e5 * float(np.sqrt(np.mean(np.concatenate(predicted) ** 2))) / span
    statistics |= {"correlation": correlation, "least_dead_time_s": dead[0], "largest_dead_time_s": dead[1]}
    return RegulatorFit(
        name=described.name,
        values=_named(solved),
        units={**UNITS},
        free=NAMES,
        covariance=np.zeros((0, 0)),
        intervals=intervals,
        undetermined=tuple(lost),
        statistics=statistics,
        provenance={
            "version": __version__,
            "recordings": [{"name": r.name, "sha256": r.sha256} for r in records],
            INPUTS: inputs_of(described, records),
        },
        runs=runs,
        details={name: {"run_to_run": value} for name, value in spread.items()},
        fitted={
            r.name: FittedData(
                "time_s", "pressure_pa", r.time_s, r.pressure_pa, r.pressure_pa - 1e5 * _residual(solved, [r])
            )
            for r in records
        },
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
