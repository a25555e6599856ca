"""Validation of a friction law, of a circuit along recorded motions, and of a regulator; balance of measured forces.

In the validation of a circuit along motions, only start state and pressure delay of each recording are fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Pair, Plain, by_name
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError, RecordingError
from pneudrive.estimate.estimates import NORMAL_95, Estimate, rms
from pneudrive.identify.export import steady_friction
from pneudrive.identify.follow import fit as motions
from pneudrive.identify.follow.driven import DrivenCircuit, MotionRecordings, driven_recordings
from pneudrive.identify.follow.problem import FollowProblem, FollowSolution, solve_follow
from pneudrive.identify.identified import FittedData, comparison_figure
from pneudrive.identify.volume import RegulatorFit
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.signals.layout import AnyLayout
from pneudrive.signals.motion import NOISE_FACTOR, local_slope, noise_level
from pneudrive.signals.recording import PressureDelay, Recording, pressure_delay
from pneudrive.simulation.trajectory import check_target, columns_in, write_frame, write_whole
from pneudrive.validate.balance import HELD_OUT, MADE, NONE_HELD_OUT, Metrics, badge_of, held_out_notes, metrics
from pneudrive.views import Reported, ShownFigure, ShownValue, View

# --- Validation of a friction law against measured sliding friction: a friction map or the curves of a campaign.

OF_MAPS = ("friction_n", "velocity_m_s", "balance_n")
#: Flag of a map row whose speed level has only one direction.
UNPAIRED = "unpaired"
#: Target of the fit, % (assumed, as for free runs).
STATIC_FIT_PERCENT = 98.0


@dataclass(frozen=True, eq=False, repr=False)
class FrictionValidation(Reported):
    """Validation of a friction law against measured sliding friction.

    Attributes
    ----------
    drive : Drive
    source : Path
    points : polars.DataFrame
        A row for each measured point: ``condition``, ``direction`` (+1, -1, or 0 for the mean of both), ``speed_m_s``,
        ``friction_n`` with its 95 % band ``low_n`` to ``high_n``, and ``model_n``, the friction of the law.
    """

    drive: Drive
    source: Path
    points: pl.DataFrame

    @property
    def curves(self) -> list[pl.DataFrame]:
        """Points of each condition and direction."""
        return self.points.partition_by("condition", "direction", maintain_order=True)

    @cached_property
    def metrics(self) -> Metrics:
        """Metrics over all points."""
        return agreement(self.points)

    @property
    def inside(self) -> float:
        """Fraction of all points whose 95 % band contains the friction of the law."""
        return fraction_inside(self.points)

    @property
    def met(self) -> bool:
        """Whether the fit of the law to all points is above `STATIC_FIT_PERCENT`."""
        return self.metrics.fit_percent > STATIC_FIT_PERCENT

    def write(self, folder: str | Path) -> list[Path]:
        """Write friction.csv, with a row for each measured point, into an existing folder."""
        target = check_target(Path(folder) / "friction.csv", (".csv",))
        write_frame(self.points, target)
        return [target]

    def view(self) -> View:
        """Return the agreement over all conditions and for each condition, with a figure."""
        return upper("friction_view")(self)


def agreement(points: pl.DataFrame) -> Metrics:
    """Return the metrics of the law's friction compared with measured friction."""
    return metrics(points["friction_n"].to_numpy(), points["model_n"].to_numpy())


def fraction_inside(points: pl.DataFrame) -> float:
    """Return the fraction of the points whose 95 % band contains the friction of the law."""
    return float(points["model_n"].is_between(points["low_n"], points["high_n"]).to_numpy().mean())


def is_friction(path: str | Path) -> bool:
    """Return whether a path is a friction map or a campaign folder, not a recording of a drive.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    """
    path = Path(path)
    return path.is_dir() or (path.suffix in (".parquet", ".csv") and len(columns_in(path, OF_MAPS)) == len(OF_MAPS))


def validate_friction(drive: Drive, path: str | Path) -> FrictionValidation:
    """Compare the steady curve of a drive's friction law with measured friction.

    Parameters
    ----------
    drive : Drive
    path : path-like
        Friction map (map.parquet, map.csv) or campaign folder.

    Raises
    ------
    RecordingError, CampaignError
        The data cannot be read, or contain no sliding friction.
    """
    path = Path(path)
    curves = list(_of_campaign(drive, path) if path.is_dir() else _of_map(drive, path))
    if not curves:
        raise RecordingError("the data contain no sliding friction", where=str(path))
    return FrictionValidation(drive, path, pl.concat(curves))


def _curve(
    drive: Drive, condition: str, direction: int, gauges_pa: Iterable[float], speed_m_s: Array, *measured_n: Array
) -> pl.DataFrame:
    """Return measured friction with its band, and the law's friction (direction 0: its mean over both directions)."""
    core, (gauge_a_pa, gauge_b_pa), middle_m = drive.friction.core(), gauges_pa, 0.5 * drive.cylinder.stroke_m
    signs = (direction,) if direction else (1, -1)
    sides = [steady_friction(core, sign * speed_m_s, gauge_a_pa, gauge_b_pa, middle_m) for sign in signs]
    model = np.mean(sides, axis=0)
    names = ("speed_m_s", "friction_n", "low_n", "high_n", "model_n")
    columns = dict(zip(names, (speed_m_s, *measured_n, model), strict=True))
    return pl.DataFrame({"condition": condition, "direction": direction, **columns})


def _of_map(drive: Drive, path: Path) -> Iterator[pl.DataFrame]:
    """Yield the curves of a friction map. Rows with the same pressures, rounded to 0.1 bar, form a curve."""
    from pneudrive.friction.friction_map import AMBIENT, read_map

    rows = read_map(path)
    ambient = drive.ambient.pressure_pa  # the law counts from the air around the seal: each row has that of its day
    if AMBIENT in rows:
        ambient = np.nan_to_num(rows[AMBIENT].to_numpy(), nan=ambient)
    velocity, friction = rows["velocity_m_s"].to_numpy(), rows["friction_n"].to_numpy()
    band = NORMAL_95 * np.hypot(rows["stderr_n"].to_numpy(), rows["u_systematic_n"].to_numpy())
    flags = rows["flags"].to_numpy()
    stuck, alone = (np.array([word in flag for flag in flags]) for word in ("stick_slip", UNPAIRED))
    good = np.isfinite(friction) & (velocity != 0.0) & ~stuck
    direction_of = np.where(alone, np.sign(velocity), 0.0)  # otherwise friction_n is the mean of both directions
    gauges = [rows[f"pressure_{c}_pa"].to_numpy() - ambient for c in "ab"]
    rounded = np.round(np.column_stack(gauges) / 1e4).astype(int)
    for (a, b), direction in product(np.unique(rounded[good], axis=0), (0, 1, -1)):
        mine = np.flatnonzero(good & (rounded == (a, b)).all(axis=1) & (direction_of == direction))
        order = mine[np.argsort(np.abs(velocity[mine]))]
        if order.size:
            means = (g[order].mean() for g in gauges)
            measured = (friction[order], friction[order] - band[order], friction[order] + band[order])
            name = f"a {a / 10:g} bar, b {b / 10:g} bar gauge"
            yield _curve(drive, name, direction, means, np.abs(velocity[order]), *measured)


def _of_campaign(drive: Drive, path: Path) -> Iterator[pl.DataFrame]:
    """Yield a curve for each direction, or a curve of the mean if the campaign has only the mean of both directions."""
    from pneudrive.friction.campaign.characteristics import campaign_friction

    found = campaign_friction(path)
    ambient = found.identity.ambient_pressure_pa
    signed = {curve.condition for curve in found.curves if curve.direction != 0}
    for curve in found.curves:
        at, where = curve.measured, curve.condition
        if at.any() and (curve.direction or where not in signed):
            gauges = (where.pressure_a_pa - ambient, where.pressure_b_pa - ambient)
            measured = (values[at] for values in (curve.friction_n, curve.low_n, curve.high_n))
            yield _curve(drive, where.label(ambient), curve.direction, gauges, curve.speed_m_s[at], *measured)


# --- Force balance of a dragged piston: closure of measured force, pressures and parallel forces, and likely errors.

INSIDE = 0.12  # of the travel, at both ends, where the motion turns
SLOWEST = 0.03  # of the largest speed: slower samples do not slide
SLOPE_S = 0.06  # half width of the slope that is the speed, s
ONE_SPEED = 1.3  # speeds of a direction within this ratio do not determine a slope
BLOCK_S = 5.0  # blocks of time for the covariance
TARGET = 0.01  # of the force range (assumed)
CLEARLY = 0.5  # another reading is the cause if its residual is below this share
VISIBLE = 3.0  # the gas force must change by this multiple of the friction for its gain to count


@dataclass(frozen=True)
class Closure:
    """Force balance of one recording.

    Attributes
    ----------
    name : str
    rms_n, share : float
        RMS residual in N, and as a fraction of the range of the measured force. The areas have their stated values.
        Offset and friction ``d + e |v|`` of each direction are fitted.
    friction_n : dict
        Direction -> friction at zero speed in N, and slope over speed in N s/m.
    offset_n : float
    gains : dict
        Parallel force -> its gain, fitted as a free parameter, with 95 % interval. ``gas`` is the gas force.
    viscous : Estimate
        Slope of friction over speed in +x in N s/m, fitted together with the gains.
    correlation : float or None
        Correlation between the gain of the first parallel force and `viscous`.
    range_n, fastest_m_s : float
        Range of the measured force; largest speed in sliding.
    time_s, residual_n : ndarray
        Residuals of the samples in sliding.
    doubts : tuple of str
        Likely causes of a large residual.
    delay : PressureDelay or None
        Delay of the pressures of closed chambers relative to the motion. A significant delay was removed before the
        balance.
    recorded : Closure or None
        Balance without this correction, if a delay was removed.
    """

    name: str
    rms_n: float
    share: float
    friction_n: dict[int, Pair]
    offset_n: float
    gains: dict[str, Estimate]
    viscous: Estimate
    correlation: float | None
    range_n: float
    fastest_m_s: float
    time_s: Array = field(repr=False)
    residual_n: Array = field(repr=False)
    doubts: tuple[str, ...] = ()
    delay: PressureDelay | None = None
    recorded: Closure | None = field(default=None, repr=False)

    def friction_at(self, speed_m_s: float) -> float:
        """Return the friction in N at a signed velocity, positive if it opposes the motion."""
        at_rest, slope = self.friction_n[1 if speed_m_s > 0.0 else -1]
        return at_rest + slope * abs(speed_m_s)

    def __str__(self) -> str:
        """Return the result in sentences."""
        lines = [
            f"{self.name}: the balance closes within {self.rms_n:.3g} N, {100 * self.share:.2f} % of the force range"
        ]
        if self.recorded is not None:
            lines.append(f"{self.delay}: this delay is removed")
            for way in self.friction_n:
                speed = way * self.fastest_m_s
                lines.append(
                    f"friction at {speed:.2g} m/s: {self.friction_at(speed):.4g} N; with the recorded delay: "
                    f"{self.recorded.friction_at(speed):.4g} N"
                )
        for name, gain in self.gains.items():
            lines.append(f"gain of {name}, if free: {gain.value:.3f} [{gain.low:.3f}, {gain.high:.3f}]")
        if self.correlation is not None:
            lines.append(
                f"this gain and the viscous friction correlate at {self.correlation:.2f}: friction over speed depends "
                "on the stated area"
            )
        return "; ".join([*lines, *self.doubts])


def close_balance(recording: Recording) -> Closure:
    """Return the force balance of a recording.

    A significant delay between the pressures of closed chambers and the motion is removed first. Force and position are
    assumed to have the same clock.

    Parameters
    ----------
    recording : Recording
        Recording with force, pressures and parallel forces.
    """
    delay, begin = pressure_delay(recording), recording.time_s[0]
    if delay is None or not delay.is_clear:
        return replace(_balance(recording, begin), delay=delay)
    return replace(_balance(delay.removed(recording), begin), delay=delay, recorded=_balance(recording, begin))


def _balance(recording: Recording, begin_s: float) -> Closure:
    """Return the balance of a recording without a correction of delays. Times are relative to `begin_s`."""
    time = recording.time_s - begin_s
    sliding = _Sliding(recording, time)
    found, residual, power = sliding.closed(recording)
    span, size_n = float(np.ptp(recording.force_n)) or 1.0, rms(residual)
    value = by_name(sliding.names, found)
    offset = 0.5 * (value["d1"] + value["d-1"]) if "d1" in value and "d-1" in value else 0.0
    friction = {
        way: (way * (value[f"d{way}"] - offset), value.get(f"e{way}", 0.0)) for way in (1, -1) if f"d{way}" in value
    }
    extra = {force.name: -force.force_n[sliding.use] for force in recording.parallel}
    gauge_a, gauge_b = (p - recording.ambient_pressure_pa for p in (recording.pressure_a_pa, recording.pressure_b_pa))
    gas = (recording.area_a_m2 * gauge_a - recording.area_b_m2 * gauge_b)[sliding.use]
    least = [abs(d) for d, _ in friction.values() if np.isfinite(d)]
    if np.ptp(gas) > VISIBLE * max(*least, NOISE_FACTOR * noise_level(recording.force_n)):
        extra["gas"] = -gas
    matrix = np.column_stack([sliding.base, *extra.values()])  # gains of forces relative to their stated areas
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    scaled, balance = matrix / scale, recording.balance_n()[sliding.use]
    other = scaled.copy()  # the product of an array with itself rounds otherwise
    inverse = np.linalg.pinv(scaled.T @ other)
    solution = inverse @ (scaled.T @ balance)
    edges = np.unique(np.floor(time[sliding.use] / BLOCK_S), return_index=True)[1]  # covariance from blocks of time
    scores = np.add.reduceat(scaled * (balance - scaled @ solution)[:, None], edges, axis=0)
    blocks, n = len(edges), len(sliding.names)
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / max(blocks - matrix.shape[1], 1)
    values = (solution / scale).tolist()
    deviations = (np.sqrt(np.diag(covariance)) / scale).tolist()
    freedom = max(blocks - matrix.shape[1], 3)
    place = sliding.names.index("e1") if "e1" in sliding.names else n - 1
    gains = {}
    for i, name in enumerate(extra, n):
        gains[name] = Estimate.of(1.0 + values[i], deviations[i], freedom, "")
    viscous, correlation = Estimate.of(values[place], deviations[place], freedom, "N s/m"), None
    if next(iter(extra), "gas") != "gas":
        correlation = float(covariance[place, n] / np.sqrt(covariance[place, place] * covariance[n, n]))
    doubts = tuple(_doubts(recording, sliding, size_n / span, brakes=power > 0.0))
    return Closure(
        recording.name, size_n, size_n / span, friction, offset, gains, viscous, correlation, span,
        float(np.abs(sliding.speed).max()), time[sliding.use], residual, doubts,
    )  # fmt: skip


class _Sliding:
    """Samples in sliding (mask `use`), named regression columns of friction (`names`, `base`), and signed speed."""

    def __init__(self, recording: Recording, time: Array) -> None:
        usual = np.median(np.diff(time))
        speed = local_slope(time, recording.position_m, max(int(SLOPE_S / usual), 1))
        inside = (recording.position_m - recording.position_m.min()) / np.ptp(recording.position_m)
        pace = np.abs(speed)
        self.use = (inside > INSIDE) & (inside < 1.0 - INSIDE) & (pace > SLOWEST * pace.max())
        self.speed, columns = speed[self.use], {}
        for way in (1, -1):
            there = np.sign(self.speed) == way
            if there.any():
                columns[f"d{way}"] = there * 1.0
                low, high = np.quantile(np.abs(self.speed[there]), (0.05, 0.95))
                if high > ONE_SPEED * low:
                    columns[f"e{way}"] = np.where(there, self.speed, 0.0)
        self.names, self.base = list(columns), np.column_stack([*columns.values()])

    def closed(self, recording: Recording) -> tuple[Array, Array, float]:
        """Return the coefficients of friction, the residual, and the mean power of friction (positive: braking)."""
        balance = recording.balance_n()[self.use]
        found = np.asarray(np.linalg.lstsq(self.base, balance, rcond=None)[0], dtype=float)
        friction = self.base @ found
        return found, balance - friction, float(np.mean(friction * self.speed))


def _doubts(recording: Recording, sliding: _Sliding, share: float, *, brakes: bool) -> list[str]:
    """Return likely causes of a balance with a large residual, or with friction that drives the motion."""
    if share < TARGET and brakes:
        return []
    turned = replace(recording, force_n=-recording.force_n)
    swapped = replace(recording, pressure_a_pa=recording.pressure_b_pa, pressure_b_pa=recording.pressure_a_pa)
    others = {'the force has the wrong sign: change its "positive" in the layout': turned}
    others["pressure_a and pressure_b are swapped"] = swapped
    for place, force in enumerate(recording.parallel):
        parallel = list(recording.parallel)
        parallel[place] = force._replace(force_n=-force.force_n)
        others[f'the {force.name} acts in the opposite direction: change its "positive" in the layout'] = replace(
            recording, parallel=tuple(parallel)
        )
    span, sizes = np.ptp(recording.force_n) or 1.0, {}
    for words, other in others.items():
        _, rest, power = sliding.closed(other)
        if power > 0.0:
            sizes[words] = rms(rest) / span
    best = min(sizes, key=lambda words: sizes[words], default="")
    if best and (sizes[best] < CLEARLY * share or share < TARGET):
        return [f"{best}: the balance would close within {100 * sizes[best]:.2f} % of the force range"]
    if share < TARGET:
        return ["friction would drive the motion: check the signs of force and position"]
    return [
        "the residual depends on speed and direction like a parallel force that the layout does not describe, such as "
        "that of a hydraulic ram: describe it as [[force]]"
    ]


# --- Validation of a circuit along recorded motions: only start and delay of each recording are fitted.

PRESSURE, CLOSURE = 0.01, 0.01  # targets: shares of the ranges of pressure and force (assumed)


@dataclass(frozen=True, eq=False, repr=False)
class MotionValidation(Reported):
    """A circuit compared with recordings of its driven piston.

    Attributes
    ----------
    circuit : Circuit
    records : tuple of FollowRecord
        Recordings with closed chambers: residuals, start and delay.
    closures : tuple of Closure
        Force balance of each recording with a force.
    open : tuple of str
        Recordings with open chambers, whose pressures are not compared.
    doubts : tuple of str
        Likely causes of differences.
    solution : FollowSolution or None
    badges : dict
        Recording -> ``made the fit``, ``held out``, or empty if it is not known.
    """

    circuit: Circuit
    records: tuple[motions.FollowRecord, ...]
    closures: tuple[Closure, ...]
    open: tuple[str, ...]
    doubts: tuple[str, ...]
    solution: FollowSolution | None = field(default=None, repr=False)
    badges: dict[str, str] = field(default_factory=dict)

    @property
    def verdicts(self) -> tuple[tuple[bool, str], ...]:
        """Whether each target is met, with a sentence. If recordings were held out, only their pressures count."""
        found = []
        for record in self.records:
            if self.badges.get(record.name) == MADE and HELD_OUT in [self.badges[r.name] for r in self.records]:
                continue
            badge = f" ({self.badges[record.name]})" if self.badges.get(record.name) else ""
            for side, share in zip("ab", record.rms, strict=True):
                words = f"{record.name}{badge}, chamber {side}: rms {100 * share:.2f} % of the range (target 1 %)"
                found.append((share <= PRESSURE, words))
        for closure in self.closures:
            words = f"{closure.name}, force: closes within {100 * closure.share:.2f} % of the range (target 1 %)"
            found.append((closure.share <= CLOSURE, words))
        return tuple(found)

    def view(self) -> View:
        """Return verdicts, start and delay of each recording, force balances, and measured and simulated pressures."""
        return upper("motion_view")(self)

    def write(self, folder: str | Path) -> list[Path]:
        """Write validation.toml into an existing folder."""
        tables: Plain = {
            "kind": "motion-validation",
            "verdicts": [{"met": met, "text": text} for met, text in self.verdicts],
            "doubts": list(self.doubts),
            "open": list(self.open),
            "recordings": [vars(r) | {"badge": self.badges.get(r.name, "")} for r in self.records],
            "closures": [
                {"name": c.name, "rms_n": c.rms_n, "share": c.share, "offset_n": c.offset_n, "text": str(c),
                 "gains": {name: [g.value, g.low, g.high] for name, g in c.gains.items()}}
                for c in self.closures
            ],
        }  # fmt: skip
        return [write_whole(Path(folder) / "validation.toml", toml.write(tables))]


def validate_motion(
    circuit: motions.FollowFit | Circuit | str | Path,
    recordings: MotionRecordings,
    *,
    layout: AnyLayout = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> MotionValidation:
    """Compare a circuit with recordings of its driven piston, and check the balance of the measured forces.

    Start pressures, start temperatures and the delay of the pressures are fitted for each recording. All other numbers
    are fixed. Recordings with open chambers test only the force balance.

    Parameters
    ----------
    circuit : FollowFit, Circuit or path
    recordings : path or Recording, or several
    layout : Layout or path, optional
    progress, cancel
        See `pneudrive.progress.Watch`.

    Returns
    -------
    MotionValidation

    Raises
    ------
    RecordingError, LayoutError, DescriptionError, FitError
        Input is not valid.
    """
    watch = Watch(progress, cancel)
    described, fit = motions.described_circuit(circuit)
    fitted = {} if fit is None else fit.hashes
    records, driven = driven_recordings(recordings, layout), DrivenCircuit(described)
    if not records:
        raise CommandError("no recording is given")
    idle, doubts = motions.check_readings(driven, records)
    used = [record for record in records if record not in idle]
    solution, found = None, ()
    if used:
        solution = solve_follow(FollowProblem(driven, used, [], watch=watch))
        found = tuple(motions.follow_record(solution, at) for at in range(len(used)))
        doubts += motions.misfit_notes(solution)
        for record in found:  # a data logger whose clock differs from that of the position
            delay = PressureDelay(*record.delay_s)
            if delay.is_clear and max(record.rms) < motions.POOR:
                doubts.append(f"{record.name}: {delay}: the clocks of the loggers differ")
    forces = [record.recording for record in records if np.ptp(record.recording.force_n) > 0.0]
    closures = tuple(close_balance(force) for force in forces)
    badges = {r.name: badge_of(r.name, r.recording.sha256 or "", fitted) for r in records}
    notes = tuple(held_out_notes(badges[record.name] for record in found))
    return MotionValidation(
        described, found, closures, tuple(r.name for r in idle), (*notes, *doubts), solution, badges
    )


# --- Validation of the fit of a pressure regulator against further runs.


@dataclass(frozen=True, eq=False, repr=False)
class RegulatorValidation(Reported):
    """Comparison of a fitted regulator with runs. Each simulation starts at the first measured pressure of the run.

    Attributes
    ----------
    fit : RegulatorFit
    runs : tuple of dict
        ``name``, ``rms_pa`` of measured minus simulated pressure, ``percent`` of the range, ``badge``.
    fitted : dict
        Name of a run -> measured and simulated pressure.
    """

    fit: RegulatorFit
    runs: tuple[Plain, ...]
    fitted: dict[str, FittedData]

    @property
    def notes(self) -> list[str]:
        """Sentences about the held-out runs, and about the residual of the fit itself."""
        made = all(run["badge"] == MADE for run in self.runs)
        size = self.fit.statistics["rms"]
        return [*(NONE_HELD_OUT,) * made, f"the fit itself has an rms of {100 * size:.2f} % of the range"]

    def view(self) -> View:
        """Return a view: the residual of each run, and measured and simulated pressures."""
        rows = []
        for run in self.runs:
            own = run["name"]
            cells = {"rms": (run["rms_pa"], "Pa"), "rms, % of the range": (run["percent"], "")}
            cells |= {"recording": (run["badge"], "")} if run["badge"] else {}
            rows += [ShownValue(f"{own}.{name}", own, name, *cell) for name, cell in cells.items()]
        worst = max(self.runs, key=lambda run: run["percent"])
        largest = ShownValue("worst", worst["name"], f"largest rms, {worst['name']}", worst["rms_pa"], "Pa")
        caption = "Measured and simulated pressures, and their difference."
        figure = ShownFigure("runs", caption, comparison_figure(self.fitted))
        title = f"{self.fit.name} against {len(self.runs)} runs"
        return View(title, tuple(rows), notes=tuple(self.notes), leading=(largest,), figures=(figure,))

    def write(self, folder: str | Path) -> list[Path]:
        """Write validation.toml into an existing folder."""
        tables = {"kind": "regulator-validation", "notes": self.notes, "runs": list(self.runs)}
        return [write_whole(Path(folder) / "validation.toml", toml.write(tables))]


def validate_regulator(
    fit: RegulatorFit, recordings: str | Path | Sequence[str | Path], *, layout: AnyLayout = None
) -> RegulatorValidation:
    """Compare the fit of a regulator with runs of its command and pressure.

    Parameters
    ----------
    fit : RegulatorFit
    recordings : path or sequence of path
    layout : Layout or path, optional
        Layout of the kind ``fixed-volume``.

    Raises
    ------
    RecordingError, LayoutError
        A recording cannot be read.
    """
    runs, fitted, made = [], {}, dict.fromkeys(fit.recordings, "") | fit.hashes
    for record in read_volume_recordings(recordings, layout):
        model = fit.simulate(record)
        size_pa = rms(record.pressure_pa - model)
        span = float(np.ptp(record.pressure_pa)) or 1.0
        badge = badge_of(record.name, record.sha256, made)
        runs.append({"name": record.name, "rms_pa": size_pa, "percent": 100.0 * (size_pa / span), "badge": badge})
        fitted[record.name] = FittedData("time_s", "pressure_pa", record.time_s, record.pressure_pa, model)
    return RegulatorValidation(fit, tuple(runs), fitted)
