"""Stops in the middle of a move: relaxation while held, breakaway peak, return to uninterrupted sliding.

Every result is a difference within one move, or from an uninterrupted move of the same cycle. The zero of the sensor
and slow drift therefore cancel. Samples are raw. In this module, friction is the force balance times the direction, and
still contains the offset.

All stops of a campaign form one table, in memory and as a file.

The height of a breakaway peak must be free of bias, although samples are noisy.

The largest of many noisy samples is biased upwards, and the largest of smoothed samples is biased downwards. Therefore,
one half of the samples locates the peak, and the other half gives its height. Then the halves are exchanged. Noise
that shifts the location therefore does not raise the height. Samples are smoothed by local parabolas. Their
width is the largest at which the peak agrees, within noise, with the peaks at all smaller widths. A sharp
peak is therefore smoothed little, and a flat peak much.

A peak between a steep rise and a slow fall is modelled as a sharp or rounded corner:

  F(t) = p + r (t - c) + d S(t - c) + q S(t - c)^2,   S(u) = s ln(1 + exp(u / s))

Smoothing reduces the height of a corner; a fit does not. Peaks that are round over several samples are not treated as
corners. The parameters p, r, d, q are linear. Corner c and roundness s are evaluated on a grid. The height is the
average over the grid, weighted by the quality of each fit. Its uncertainty therefore includes that of c and s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from pneudrive.arrays import Array, ArrayPair, Bools, Pair, Row, attributes_of, evenly
from pneudrive.batching import share_out
from pneudrive.campaign.storage.folder import Campaign, CycleFile, recording_of, steps_of
from pneudrive.estimate.estimates import robust_deviation
from pneudrive.estimate.mixed import Scan
from pneudrive.friction.campaign.reading import condition_of, read_each
from pneudrive.friction.campaign.stops import course
from pneudrive.friction.friction_map import TABLES, Condition, Skipped
from pneudrive.friction.stick_slip import rise
from pneudrive.friction.strokes import moving_average
from pneudrive.rig.interface import Identity, Move, Samples
from pneudrive.signals.motion import noise_level, straight_line
from pneudrive.signals.recording import Recording

#: Largest contribution of air force or inertia to a usable peak, as a fraction of the increment; also largest loading
#: time, as a fraction of the stop duration.
SPOILS = 0.1
LEAST_RATE_HZ = 5000.0  # least rate of samples around a restart
SAME_DURATION = 0.2  # share by which a rest may differ from the planned stop without a flag
MOST_CYCLES = 24  # cycles without a stop, of one condition and speed, that are read for comparison
WORTH_WORKERS = 60  # stops below which starting processes costs more than it saves
AROUND_PEAK = 3.0  # times from restart to peak, in which missing samples count
TRACE_SAMPLES, RESTART_SAMPLES = (120, 160), 480  # of approach and rest, and of the restart, kept for figures
#: Flags that exclude a stop from the law of breakaway over duration.
SPOILING = frozenset(
    {"undersampled", "no_peak", "pressure_transient", "saturated", "stuck", "negative_friction", "no_running"}
)


#: Columns of thinned friction around a stop, over time since the start of the rest; for figures only.
TRACE = ("trace_time_s", "trace_position_m", "trace_friction_n")


def _read(
    file: CycleFile,
    samples: Samples,
    identity: Identity,
    others: Sequence[course.UninterruptedStroke],
) -> Row:
    """Return the columns of a stop.

    `others` are uninterrupted strokes of other cycles, for cycles without such strokes.
    """
    recording, _ = recording_of(file, identity, samples)
    step = steps_of(recording, samples)
    cycle, condition = file.head.cycle, condition_of(file.head)
    phases = course.find_phases(cycle, recording.time_s, recording.position_m, step)
    friction = phases.direction * recording.balance_n()
    own = course.strokes_of(file, recording, step) if phases.by_steps else []
    running = course.running_level(recording, friction, phases, own, others, condition)
    steady, velocity = course.steady_part(recording, phases.restart)
    peak, top = _peak(file, samples, identity, recording, phases, running)
    held = phases.rest
    relaxation = {} if cycle.released else course.relax(recording.time_s[held] - phases.rest_s, friction[held])
    bins = course.bin_excess(recording, friction, slice(top, steady.stop), phases.direction, running)
    return {
        **vars(condition),
        "index": file.head.index,
        **attributes_of(cycle, "key", "block", "repeat"),
        "direction": phases.direction,
        "speed_m_s": float(cycle.speed_m_s or 0.0) or abs(velocity),
        "position_m": float(recording.position_m[phases.restart.start]),
        "began_s": file.head.began_s,
        "stop_s": float(cycle.stop_s) if cycle.stop_s is not None else phases.dwell_s,
        "dwell_s": phases.dwell_s,
        "released": cycle.released,
        "running_stderr_n": running.stderr_n,
        "basis": running.basis,
        **peak,
        **TABLES["stop"],
        **relaxation,
        **({} if bins is None else course.recover(bins[0], running.stderr_n, bins[1])),
        **_trace(recording, friction, phases),
    }


def _peak(
    file: CycleFile,
    samples: Samples,
    identity: Identity,
    recording: Recording,
    phases: course.Phases,
    running: course.Running,
) -> tuple[Row, int]:
    """Return the columns of a stop that follow from its breakaway peak, with all flags; and the sample of the peak."""
    part, cycle = phases.restart, file.head.cycle
    travel = np.maximum.accumulate(phases.direction * (recording.position_m[part] - recording.position_m[part.start]))
    after = phases.direction * recording.balance_n()[part]
    level = running.level_n if np.isfinite(running.level_n) else np.median(after[after.size // 2 :])
    bandwidth = identity.bandwidth_hz.get("force_n")
    peak, top, flags = find_breakaway(recording.time_s[part], travel, after, level, identity.stiffness_n_m, bandwidth)
    at_peak = part.start + top
    shift = running.shape(recording.position_m[[at_peak]])[0]
    increment = peak["breakaway_n"] - running.level_n - shift
    stderr = float(np.hypot(peak["breakaway_stderr_n"], running.stderr_n))
    inertia = _inertia(recording, travel[top], peak, cycle.speed_m_s)
    # Samples at the sensor's limit were left out on reading: some are missing around the peak.
    begin, end = phases.restart_s, phases.restart_s + AROUND_PEAK * peak["loading_s"]
    here, kept = (((t >= begin) & (t <= end)).sum() for t in (samples.time_s, recording.time_s))
    # A force of the air measured in the chambers is corrected. It spoils a result that is not larger.
    most = 1.0 if identity.pressure_measured_at == "chamber" else SPOILS
    size = max(abs(increment), 3.0 * stderr)
    seen = {
        "no_running": running.basis == "none",
        "negative_friction": running.level_n < 0,
        "stuck": np.ptp(recording.force_n[part]) == 0,
        "saturated": recording.flags.get("saturated", 0) and here - kept > 2,
        "slow_samples": peak["sample_rate_hz"] < LEAST_RATE_HZ * 0.9,
        "duration": cycle.stop_s is not None and abs(phases.dwell_s - cycle.stop_s) > SAME_DURATION * cycle.stop_s,
        "long_loading": peak["loading_s"] > SPOILS * phases.dwell_s,
        "reversed": phases.reversed,
        "by_motion": not phases.by_steps,
        "pressure_transient": _pressure_moves_n(recording, part, at_peak) > most * size,
        "inertia": inertia > SPOILS * size,
    }
    flags += [flag for flag, is_so in seen.items() if is_so]
    usable = bool(np.isfinite(increment)) and not SPOILING.intersection(flags)
    found = {"running_n": running.level_n + shift, "increment_n": increment, "increment_stderr_n": stderr}
    return peak | found | {"inertia_n": inertia, "usable": usable, "flags": flags}, at_peak


def _pressure_moves_n(recording: Recording, restart: slice, at_peak: int) -> float:
    """Return the change in air force from before the restart to the peak, in N, beyond noise."""
    moved = 0.0
    for side in ("a", "b"):
        channel = getattr(recording, f"pressure_{side}_pa")
        places = max(restart.start - 3, 0), at_peak
        ends = [channel[max(i - 20, 0) : i + 20].mean() for i in places]
        noise = noise_level(channel, quantisation=False) / np.sqrt(20.0)
        moved += max(abs(ends[1] - ends[0]) - 3.0 * noise, 0.0) * getattr(recording, f"area_{side}_m2")
    return moved


def _inertia(recording: Recording, travel_m: float, peak: Row, speed_m_s: float | None) -> float:
    """Return the force overshoot, in N, of a mass that breaks loose on the rig's spring at the speed of the axis."""
    speed = 2.0 * travel_m / max(peak["loading_s"], 1e-12)  # at constant acceleration; less in a longer move
    speed = min(speed, speed_m_s) if speed_m_s is not None else speed
    stiffness = recording.stiffness_n_m or abs(np.nan_to_num(peak["loading_rate_n_s"])) / max(speed, 1e-12)
    return speed * np.sqrt(max(stiffness, 0.0) * recording.mass_beyond_sensor_kg)


def _trace(recording: Recording, friction: Array, phases: course.Phases) -> Row:
    chosen = []
    for part, most in zip((phases.approach, phases.rest), TRACE_SAMPLES, strict=True):
        size = part.stop - part.start
        chosen.append(part.start + evenly(size, most)[:size])
    begin, end = phases.restart.start, phases.restart.stop
    dense = np.geomspace(1, end - begin, RESTART_SAMPLES).astype(int)  # dense around the peak
    index = np.concatenate([*chosen, begin - 1 + np.unique(dense)])
    values = (recording.time_s[index] - phases.rest_s, recording.position_m[index], friction[index])
    return {name: each.tolist() for name, each in zip(TRACE, values, strict=True)}


def find_stops(
    campaign: Campaign, processes: int | None, files: Sequence[CycleFile] | None = None
) -> tuple[pl.DataFrame, tuple[Skipped, ...]]:
    """Read all stops of a campaign.

    Parameters
    ----------
    campaign : Campaign
    processes : int, optional
        None: one for each processor if there are enough stops.
    files : sequence of CycleFile, optional
        Usable files of the campaign, if known.

    Returns
    -------
    polars.DataFrame
        One row for each stop, in the order of execution. It has the columns of the `Condition` and of the header.
        Further columns, in SI: `direction` and `speed_m_s` of the restart; duration as planned (`stop_s`) and as
        measured (`dwell_s`); `running_n`, friction of uninterrupted sliding at the stop, and its `basis`;
        `breakaway_n`, the peak after the restart; `increment_n`, the peak minus running friction; `loading_rate_n_s`
        and `loading_s`, rate and time of the rise of the force; `inertia_n`, the largest contribution of the moving
        mass; relaxation of the held force; recovery: travel and time until the excess over sliding has fallen to 5 %;
        `usable`, whether the increment is used for the law of breakaway over duration; `flags`. Bounds of 95 %
        intervals have the suffixes `_low` and `_high`.
    tuple of Skipped
        Unreadable stops with reasons.
    """
    files = campaign.scan()[0] if files is None else files
    stops = [f for f in files if f.head.cycle.kind == "stop" and f.head.cycle.stop_s != 0.0]
    if not stops:
        return pl.DataFrame(), ()
    # Unreadable cycles are skipped here: the characterisation of the cycle reports them.
    uninterrupted = read_each(_comparable(files, stops), course.uninterrupted_strokes, campaign.identity)
    others = [stroke for strokes in uninterrupted if not isinstance(strokes, Skipped) for stroke in strokes]
    found = share_out(read_each, stops, _read, campaign.identity, others, least=WORTH_WORKERS, processes=processes)
    rows = [row for row in found if isinstance(row, dict)]
    skipped = sorted((s for s in found if isinstance(s, Skipped)), key=lambda s: s.file)
    texts = {"flags": pl.List(pl.String)}
    return pl.DataFrame(rows, schema_overrides=texts, infer_schema_length=None), tuple(skipped)


def _comparable(files: Sequence[CycleFile], stops: Sequence[CycleFile]) -> list[CycleFile]:
    """Return cycles without a stop, at the condition and speed class of stops that lack an uninterrupted stroke."""

    def place(file: CycleFile) -> tuple[Condition, float]:
        speed = file.cycle.speed_m_s
        return condition_of(file.head), round(np.log(speed) / course.SAME_SPEED) if speed else np.nan

    wanted = set()
    for file in stops:
        # A stroke is uninterrupted if it has the restart speed and is not next to the stop.
        hold, cycle = course.stop_step(file.cycle), file.cycle
        moves = [i for i, s in enumerate(cycle.steps) if isinstance(s, Move) and s.speed_m_s == cycle.speed_m_s]
        if hold is None or not any(abs(i - hold) > 1 for i in moves):
            wanted.add(place(file))
    found: dict[tuple, list[CycleFile]] = {}
    for file in files:
        cycle = file.cycle
        uninterrupted = cycle.kind in ("sweep", "sentinel", "blank") or (cycle.kind == "stop" and cycle.stop_s == 0.0)
        if uninterrupted and (key := place(file)) in wanted:
            found.setdefault(key, []).append(file)
    return [group[i] for group in found.values() for i in evenly(len(group), MOST_CYCLES)]


# --- Height of a breakaway peak.

#: Depths below the peak, as fractions of the excess. A corner is fitted to the samples on both sides down to a depth.
#: The largest depth at which a corner describes the samples is used.
DEPTHS = (0.6, 0.35, 0.2)
LEAST_DEPTH = 8.0  # deviations of the noise
BEHIND, BEFORE = 160, 60  # samples at most on either side
FEWEST_BEFORE, FEWEST_BEHIND = 3, 12
PLACES = 33  # of the corner
FINER = 3  # refinements of the grid, while samples resolve the corner better than its spacing
KNOWN = 1.5  # spacings: largest standard deviation of the place without refinement
ROUNDNESS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # samples
SHARP = 1.0  # samples: a rounder corner is smoothed without loss, and parabolas describe it better
FITS = 1.3  # largest ratio of squared residual to noise for a corner
FINE = 8  # points per sample for the maximum of a fitted corner
#: Times before and after a peak between which rise and fall are fitted, in multiples of the sensor's lag; least number
#: of samples on a side; and least lag, in samples, so that noise is not mistaken for a slope.
RISE_LAGS, FALL_LAGS, FEWEST_ON_A_SIDE, LEAST_LAG = (1.0, 6.0), (2.0, 7.0), 3, 3.0


def corner_height(friction_n: Array, top: int, excess_n: float, one_n: float, many_n: float) -> Pair | None:
    """Return height and standard error of the peak from the fit of a corner.

    Parameters
    ----------
    friction_n : ndarray, shape (n,)
        Evenly spaced samples.
    top : int
        Approximate index of the highest sample.
    excess_n : float
        Approximate excess of the peak over running friction.
    one_n : float
        Standard deviation of one sample.
    many_n : float
        Equivalent standard deviation of one sample in means of many samples. It exceeds `one_n` if noise is correlated.

    Returns
    -------
    (float, float) or None
        None if no corner describes the samples.
    """
    if excess_n < LEAST_DEPTH * one_n:
        return None  # hardly a peak: the start of a plateau is not a falling corner
    for depth in DEPTHS:
        first, below = max(top - BEFORE, 0), friction_n[top] - max(depth * excess_n, LEAST_DEPTH * one_n)
        run = _run(friction_n[first : top + BEHIND] >= below, top - first)
        begin, end = min(first + run.start, top - FEWEST_BEFORE), first + run.stop
        if begin < 0 or end - top < FEWEST_BEHIND:
            continue
        found = _fit(friction_n[begin:end], top - begin, one_n, many_n)
        if found is not None:
            return found
    return None


def lag_loss(time_s: Array, friction_n: Array, at_s: float, bandwidth_hz: float) -> float:
    """Return the height, in N, that a first-order sensor loses: exact for a corner, upper bound for a rounded peak.

    A corner between a rise r and a fall q appears lower by q tau ln(1 + r / q), tau = 1 / (2 pi f). This is the largest
    response of a first-order lag to two ramps.

    Parameters
    ----------
    time_s, friction_n : ndarray, shape (n,)
    at_s : float
        Time of the measured peak.
    bandwidth_hz : float
        f, the -3 dB bandwidth of the sensor.
    """
    lag = 1.0 / (2.0 * np.pi * bandwidth_hz)
    unit = max(lag, LEAST_LAG * np.median(np.diff(time_s)))

    def slope(begin: float, end: float) -> float:
        part = slice(*np.searchsorted(time_s, (at_s + begin * unit, at_s + end * unit)).tolist())
        few = time_s[part].size < FEWEST_ON_A_SIDE
        return 0.0 if few else straight_line(time_s[part], friction_n[part])[0]

    rise, fall = slope(-RISE_LAGS[1], -RISE_LAGS[0]), -slope(*FALL_LAGS)
    return float(fall * lag * np.log1p(rise / fall)) if rise > 0.0 and fall > 0.0 else 0.0


def _fit(friction: Array, top: int, one_n: float, many_n: float) -> Pair | None:
    found, weight = _places(friction, top, many_n)
    if found.cost[found.best] > FITS * (friction.size - 6.0) * one_n**2 or found.shape[found.best, 1] > SHARP:
        return None
    chosen = np.flatnonzero(weight > 1e-3)
    corner, each = found.shape[chosen, 0], np.arange(chosen.size)
    even = np.linspace(0.0, friction.size - 1.0, FINE * friction.size)
    columns = _columns(np.c_[np.broadcast_to(even, (chosen.size, even.size)), corner], found.shape[chosen])
    values = (columns @ found.coefficient[chosen, :, None])[:, :, 0]
    at = np.argmax(values, axis=1)
    heights, rows = values[each, at], columns[each, at]
    variances = np.einsum("gi,gij,gj->g", rows, found.covariance[chosen], rows) * many_n**2
    share = weight[chosen] / weight[chosen].sum()
    height = share @ heights
    return height, np.sqrt(share @ (variances + (heights - height) ** 2))


def _places(friction: Array, top: int, many_n: float) -> tuple[Scan, Array]:
    """Fit corners on a grid of positions and roundnesses, and return a weight for each.

    The grid spacing of positions is the smallest that the samples resolve.
    """
    low, high, finer = max(top - 6.0, 0.5), top + 6.0, 0
    while True:
        places = np.linspace(low, high, PLACES)
        grid = np.column_stack([np.tile(places, len(ROUNDNESS)), np.repeat(ROUNDNESS, PLACES)])
        found = Scan(grid, _columns(np.arange(friction.size, dtype=float), grid), friction)
        weight = np.exp(-0.5 * (found.cost - found.cost[found.best]) / many_n**2)
        share, step, corner = weight / weight.sum(), (high - low) / (PLACES - 1), found.shape[:, 0]
        middle = share @ corner
        if finer == FINER or share @ (corner - middle) ** 2 > (KNOWN * step) ** 2:
            return found, weight
        low, high, finer = middle - 2.0 * KNOWN * step, middle + 2.0 * KNOWN * step, finer + 1


def _columns(t: Array, grid: Array) -> Array:
    """Return the design columns at the times `t`, for each corner and roundness in `grid` (shape (g, n, 4))."""
    corner, roundness = grid[:, :1], grid[:, 1:]
    away = t - corner
    width = np.where(roundness > 0.0, roundness, 1.0)
    bend = np.where(roundness > 0.0, width * np.logaddexp(0.0, away / width), np.maximum(away, 0.0))
    return np.stack([np.ones_like(away), away, bend, bend**2], axis=2)


#: Half-widths of the parabolas, in samples of one half.
WIDTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
#: Peaks at two widths agree if they differ by less than this number of standard errors of the narrower peak.
AGREE = 2.0
#: For a peak from a single sample: neighbours on each side that it exceeds; its bias by noise (maximum of three equal
#: samples), in standard deviations; ratio of its uncertainty to the noise.
SINGLE, SINGLE_EXCESS, SINGLE_DOUBT = 3, 0.85, 1.5
#: Number of samples around a peak below which the peak counts as undersampled.
FEWEST = 12
#: Fraction of the rise above running friction by which the force must fall, beyond noise, to end a peak.
FALLEN = 0.25
FALLEN_DEVIATIONS = 9.0
#: First range of the search for a peak, in units of the travel to running friction; and largest range, as a fraction of
#: the move.
REACH, MOST_TRAVEL = 1.5, 0.25
LEAST_TRAVEL_M, LEAST_SAMPLES = 2e-4, 40
#: Fraction of the excess within which samples belong to the top of a peak, and their smallest number.
TOP, FEWEST_AT_TOP = 0.1, 5
#: Estimate of noise: largest number of samples, half width of the smoothing parabola, and threshold of a significant
#: correlation in standard errors.
NOISE_SAMPLES, NOISE_HALF_WIDTH, SIGNIFICANT = 3000, 40, 4.0
UNEVEN = 0.3  # time steps that differ by less than this share have one rate
NEAR_CHANGE = 8  # samples from a change of rate within which a peak belongs to both sides of it
SPAN_AT_CHANGE = 60  # samples of the lower rate that are then used on each side
QUICK = 5  # samples of the mean for the search of a peak's place


def find_breakaway(
    time_s: Array,
    travel_m: Array,
    friction_n: Array,
    running_n: float,
    stiffness_n_m: float | None = None,
    bandwidth_hz: float | None = None,
) -> tuple[Row, int, list[str]]:
    """Find the first peak after a restart.

    Parameters
    ----------
    time_s, travel_m, friction_n : ndarray, shape (n,)
        Raw samples from the restart on: time, travel of the axis since the restart, friction (positive against motion).
    running_n : float
        Level of uninterrupted sliding at the peak.
    stiffness_n_m : float, optional
        Stiffness of the rig, if known.
    bandwidth_hz : float, optional
        Bandwidth of the force sensor, if known. The standard error then includes the loss of height by its lag.

    Returns
    -------
    dict
        Columns of the stop: the height of the peak, its standard error, its time since the restart, the rate of the
        rise before it, and the sampling rate around it.
    int
        Nearest sample.
    list of str
        Flags: undersampled, no_peak.
    """
    noise = Noise.of(friction_n)
    end, peaked = _search_end(travel_m, friction_n, running_n, noise, stiffness_n_m)
    time, friction = _even(time_s[:end], friction_n[:end])
    value, stderr, at, width = _height(time, friction, noise)
    # A wide parabola is off the corner by its own width.
    first, last = np.searchsorted(time, (at - width, at + width)).tolist()
    inside = friction[first:last]
    nearest = int(np.argmin(np.abs(time - at)))
    top = first + int(np.argmax(_quick(inside))) if inside.size else nearest
    # Correlated noise matters more for means of many samples.
    many_n = np.sqrt(noise.white**2 + noise.slow**2 * (1.0 + 2.0 * noise.memory))
    corner = corner_height(friction, top, value - running_n, noise.total, many_n)
    if corner is not None:
        # The loss by smoothing is corrected, and is part of the uncertainty.
        value, stderr = corner[0], np.hypot(corner[1], corner[0] - value)
    if bandwidth_hz is not None:
        stderr = np.hypot(stderr, lag_loss(time_s, friction_n, time[top], bandwidth_hz))
    index = int(np.argmin(np.abs(time_s[:end] - at)))
    low, high = rise(_quick(friction_n[: index + 1]))
    span = time_s[high] - time_s[low]
    steps = np.diff(time)
    flags = []
    near = friction >= value - max(TOP * (value - running_n), 3.0 * noise.total)
    near[1:-1] |= near[:-2] & near[2:]  # single gaps do not end the top
    run = _run(near, int(np.argmin(np.abs(time - at))))
    if time.size < FEWEST or run.stop - run.start < FEWEST_AT_TOP:
        flags.append("undersampled")
    if not peaked and index >= end - 2:
        flags.append("no_peak")
    columns = {
        "breakaway_n": value,
        "breakaway_stderr_n": stderr,
        "loading_rate_n_s": (friction_n[high] - friction_n[low]) / span if span > 0 else np.nan,
        "loading_s": at - float(time_s[0]),
        "sample_rate_hz": float(1.0 / np.median(steps)) if steps.size else np.nan,
    }
    return columns, index, flags


@dataclass(frozen=True)
class Noise:
    """Noise of the samples: a white part, and a part that is correlated over some samples.

    Attributes
    ----------
    white, slow : float
        Standard deviations.
    memory : float
        Samples over which the correlation of the slow part falls to 1/e.
    """

    white: float
    slow: float
    memory: float

    @classmethod
    def of(cls, values: Array) -> Noise:
        """Estimate the white part from second differences, and the slow part from residuals of a smoothed curve.

        The residuals are those after the largest value, where the force changes slowly.
        """
        white = max(noise_level(values), 1e-12 * np.abs(values).max() + 1e-300)
        behind = values[np.argmax(_quick(values)) + NOISE_HALF_WIDTH // 2 :][:NOISE_SAMPLES]
        if behind.size < 6 * NOISE_HALF_WIDTH:
            return cls(white, 0.0, 0.0)
        kernel = _parabola(NOISE_HALF_WIDTH)
        rest = behind[NOISE_HALF_WIDTH:-NOISE_HALF_WIDTH] - np.convolve(behind, kernel, "valid")
        limit = 4.0 * robust_deviation(rest)
        rest = np.clip(rest, -limit, limit)
        first, second = (rest[k:] @ rest[:-k] / rest.size for k in (1, 2))
        power = rest @ rest / rest.size
        if first < SIGNIFICANT * power / np.sqrt(rest.size) or not 0.0 < second < first:
            return cls(white, 0.0, 0.0)
        slow2 = min(first * first / second, power)
        white = float(np.sqrt(max(power - slow2, 0.01 * power)))
        return cls(white, float(np.sqrt(slow2)), -1.0 / float(np.log(second / first)))

    @property
    def total(self) -> float:
        """Standard deviation of one sample."""
        return np.hypot(self.white, self.slow)

    def of_mean(self, weights: Array, spacing: int, share: float = 1.0) -> float:
        """Return the standard deviation of a weighted sum of every `spacing`-th sample.

        `share` is the fraction of the white variance that remains.
        """
        variance = share * self.white**2 * (weights @ weights)
        if self.slow > 0.0:
            lags = np.arange(weights.size) * spacing
            shared = np.exp(-lags / self.memory)
            both = np.correlate(weights, weights, "full")[weights.size - 1 :]
            variance += self.slow**2 * (2.0 * both @ shared - both[0])
        return float(np.sqrt(variance))


def _run(mask: Bools, at: int) -> slice:
    """Return the run of marked samples around sample `at`. It is empty if this sample is not marked."""
    before, after = np.flatnonzero(~mask[:at]), np.flatnonzero(~mask[at:])
    stop = at + int(after[0]) if after.size else mask.size
    return slice(min(int(before[-1]) + 1 if before.size else 0, stop), stop)


def _quick(values: Array) -> Array:
    """Return the centred moving average over `QUICK` samples, or fewer at the ends."""
    return moving_average(values, QUICK) if values.size >= QUICK else values


def _search_end(
    travel: Array, friction: Array, running: float, noise: Noise, stiffness: float | None
) -> tuple[int, bool]:
    """Return the sample at which the search for a peak ends, and whether the force has fallen by then."""
    smooth = _quick(friction)
    spread = noise.of_mean(np.full(QUICK, 1.0 / QUICK), 1)
    reached = np.flatnonzero(smooth >= running - 3.0 * spread)
    most = int(np.searchsorted(travel, MOST_TRAVEL * travel[-1]))
    most = min(max(most, LEAST_SAMPLES), travel.size)
    if not reached.size or reached[0] >= most:
        return most, False
    first = int(reached[0])
    rise = running - smooth[0]
    slope = rise / travel[first] if rise > 10 * spread and travel[first] > 0 else (stiffness or 1e5)
    reach = travel[first] + max(REACH * abs(running) / slope, LEAST_TRAVEL_M)
    end = int(np.clip(np.searchsorted(travel, reach), first + LEAST_SAMPLES, most))
    while True:
        part = smooth[first:end]
        top = np.maximum.accumulate(part)
        fallen = np.flatnonzero(part < top - np.maximum(FALLEN_DEVIATIONS * spread, FALLEN * (top - running)))
        if fallen.size:
            return first + int(fallen[0]) + 1, True
        if np.argmax(part) < 0.9 * part.size or end >= most:
            return end, False
        end = min(2 * end, most)  # still rising: look further


def _even(time: Array, friction: Array) -> ArrayPair:
    """Return samples of a single rate around the highest sample.

    If the sampling rate changes near this sample, omit samples where they are denser.
    """
    steps = np.diff(time)
    if steps.size < 2:
        return time, friction
    top = min(max(int(np.argmax(_quick(friction))), 1), steps.size - 1)
    usual = np.median(steps[max(top - 3, 0) : top + 3])
    run = _run(np.abs(steps - usual) <= UNEVEN * usual, top)
    part = slice(run.start, run.stop + 1)
    near = min(top - part.start, part.stop - 1 - top)
    if near >= NEAR_CHANGE or (part.stop >= time.size - 1 and part.start == 0):
        return time[part], friction[part]
    coarse = np.median(steps[max(part.start - 5, 0) : part.stop + 5][-10:])
    coarse = max(coarse, np.median(steps[part.stop : part.stop + 5]) if part.stop < steps.size else coarse)
    span = SPAN_AT_CHANGE * coarse
    wanted = np.arange(max(time[top] - span, time[0]), min(time[top] + span, time[-1]), coarse)
    chosen = np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))
    return time[chosen], friction[chosen]


def _height(time: Array, friction: Array, noise: Noise) -> tuple[float, float, float, float]:
    """Return height, standard error and time (s) of the highest point, and the width (s) of the parabola."""
    # First the largest sample minus its bias from noise; its uncertainty is from noise and the step to the next sample.
    top = np.argmax(_quick(friction))
    first = max(top - SINGLE, 0)
    near = friction[first : top + SINGLE + 1]
    lower = np.sort(near)[-2] if near.size > 1 else near[0]
    spread = SINGLE_DOUBT * np.hypot(noise.total, (near.max() - lower) / 2.0)
    chosen = [(near.max() - SINGLE_EXCESS * noise.white, spread, time[first + np.argmax(near)], 0.0)]
    halves = [slice(k, None, 2) for k in (0, 1)]
    most = min(friction[half].size for half in halves)
    step = np.median(np.diff(time)) if time.size > 1 else 0.0
    for w in (w for w in WIDTHS if 6 * w + 3 <= most):
        kernel = _parabola(w)
        smooth = [np.convolve(friction[half], kernel, "valid") for half in halves]
        place = [time[half][w : time[half].size - w] for half in halves]
        tops = [np.argmax(s) for s in smooth]
        read = [np.interp(place[a][tops[a]], place[b], smooth[b]) for a, b in ((0, 1), (1, 0))]
        value, stderr = float(np.mean(read)), noise.of_mean(kernel, 2, share=0.5)
        if any(abs(value - v) > AGREE * s for v, s, _, _ in chosen):
            break
        at = float(np.mean([place[k][tops[k]] for k in (0, 1)]))
        chosen.append((value, stderr, at, 4.0 * w * step))
    value, stderr, at, width = chosen[-1]
    others = chosen[-3:-1] if len(chosen) > 3 else ()
    bias = max((abs(value - v) for v, _, _, _ in others), default=0.0)
    return value, np.hypot(stderr, bias), at, width


def _parabola(half: int) -> Array:
    """Return the weights that give the value at the middle of a parabola fitted to 2 half + 1 evenly spaced samples."""
    j = np.arange(-half, half + 1, dtype=float)
    weights = 3.0 * (3.0 * half * half + 3.0 * half - 1.0) - 15.0 * j * j
    return weights / ((2 * half - 1) * (2 * half + 1) * (2 * half + 3))
