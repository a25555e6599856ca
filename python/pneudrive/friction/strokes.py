"""Table of strokes: a row for each stroke of a speed class or cycle, with means over its settled samples.

`Strokes` holds the rows and the balance of each stroke in position bins. `Strokes.sides` combines the strokes of one
direction in one row.

`RecordedMotion` is the motion of a recording: strokes, force balance, and the selected samples. Samples are selected
after settling of the stroke (`Settled`), or by the source paper's protocol (`SourcePaper`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneudrive.arrays import Array, Bools, Interval, Row
from pneudrive.friction import stick_slip
from pneudrive.friction.bins import Grid, Profile, bin_means, known_mean, mean_profile, spread_of
from pneudrive.friction.sentences import sentence
from pneudrive.friction.stick_slip import ReversalPeak, StickSlip, median
from pneudrive.signals.motion import Stroke, find_strokes, local_slope, speed_levels, straight_line, thinned
from pneudrive.signals.recording import PressureDelay, Recording, refuse_channels

# Least share of the window's bins with settled samples for a stroke to count. Missing bins are filled from the profile.
COVERED_SHARE = 0.25
MINIMUM_BINS, MAXIMUM_BINS, SAMPLES_PER_BIN = 5, 100, 4
CUT_SHARE = 0.1  # of a bin: largest part of it that may lie outside the settled part
MOST_NAMED = 12  # recordings with a sentence of their own on unused strokes
MEANS = ("force_n", "pressure_a_pa", "pressure_b_pa", "velocity_m_s", "parallel_n", "late_n")


@dataclass(frozen=True)
class MeasuredStroke:
    """A stroke with its means over the settled samples.

    Attributes
    ----------
    stroke : Stroke
        The stroke. Its indices count from the first of the samples that were read together.
    means : dict
        `MEANS`, ``mean_n`` (balance of all chosen samples), ``samples`` and ``pressure_moves_n`` (usual range of the
        pressure force). Empty for an unused stroke: its settled samples cover less than a quarter of
        the window.
    slip : (StickSlip, StickSlip or None) or None
        Stick-slip of axis and piston; None for unused or short strokes.
    peak : ReversalPeak or None
        Peak of friction after the preceding reversal.
    """

    stroke: Stroke
    means: dict[str, float] = field(default_factory=dict)
    slip: tuple[StickSlip, StickSlip | None] | None = None
    peak: ReversalPeak | None = None

    @classmethod
    def of(cls, motion: RecordedMotion, stroke: Stroke, window: Interval) -> MeasuredStroke:
        """Average the settled samples of a stroke between two positions in m, and measure its stick-slip.

        Stick-slip is measured in the middle 80 % of the stroke. The axis may move steadily while the piston behind a
        soft force sensor does not. If the stiffness of the rig is known, the piston's position is the axis position
        minus the deflection. Otherwise, there is only a result for the axis.
        """
        recording, part = motion.recording, stroke.samples
        settled, position = motion.settled[part], motion.position_m[part]
        index = np.flatnonzero((position >= window[0]) & (position <= window[1]) & settled) + stroke.start
        if not index.size:
            return cls(stroke)
        pressure_a, pressure_b = recording.pressure_a_pa[index], recording.pressure_b_pa[index]
        first, last = map(int, index[[0, -1]])
        seconds, way = (values[last] - values[first] for values in (motion.time_s, motion.position_m))
        gas_n = recording.area_a_m2 * pressure_a - recording.area_b_m2 * pressure_b
        moves = 0.0  # range of the pressure force, without the lowest and highest 5 % of each pressure
        for pressure, area in ((pressure_a, recording.area_a_m2), (pressure_b, recording.area_b_m2)):
            values = np.sort(thinned(pressure))
            margin = int(0.05 * values.size)
            moves += float(values[values.size - 1 - margin] - values[margin]) * area
        means = {
            "mean_n": motion.balance_n[part][settled].mean(),
            "samples": index.size,
            "force_n": recording.force_n[index].mean(),
            "pressure_a_pa": pressure_a.mean(),
            "pressure_b_pa": pressure_b.mean(),
            "velocity_m_s": way / seconds if seconds > 0 else stroke.speed_m_s,
            "parallel_n": sum(f.uncertainty * f.force_n[index].mean() for f in recording.parallel),
            "late_n": motion.late_s * ((gas_n[-1] - gas_n[0]) / seconds) if seconds > 0 else 0.0,
            "pressure_moves_n": moves,
        }
        middle = stick_slip.middle_of(stroke, motion.position_m)
        if middle is None:
            return cls(stroke, means)
        samples = (motion.time_s[middle], motion.position_m[middle], recording.force_n[middle])
        time_s, axis_m, force_n = stick_slip.evenly_spaced(*samples)
        stiffness = recording.stiffness_n_m
        piston = stick_slip.measure_stick_slip(time_s, axis_m - force_n / stiffness) if stiffness else None
        return cls(stroke, means, (stick_slip.measure_stick_slip(time_s, axis_m), piston))


@dataclass(frozen=True, eq=False)
class Strokes:
    """The strokes of a speed class or of a cycle. The size in memory depends on the number of bins, not of samples.

    Attributes
    ----------
    grid : Grid
    rows : tuple of MeasuredStroke
    balance_n : ndarray, shape (strokes, bins)
        Mean balance of the settled samples in each bin; NaN without settled samples.
    """

    grid: Grid
    rows: tuple[MeasuredStroke, ...]
    balance_n: Array

    @classmethod
    def of(cls, motion: RecordedMotion, strokes: Sequence[Stroke], window: Interval, grid: Grid) -> Strokes:
        """Measure the strokes of one speed class or cycle between the two positions of the window, in m."""
        balance = stroke_rows(motion, strokes, grid)
        covered = np.isfinite(balance[:, grid.is_in_window]).mean(axis=1) >= COVERED_SHARE
        rows = [
            MeasuredStroke.of(motion, stroke, window) if covers else MeasuredStroke(stroke)
            for stroke, covers in zip(strokes, covered.tolist(), strict=True)
        ]
        table = cls(grid, tuple(rows), balance)
        if len(table.directions) < 2:
            return table
        peaks = stick_slip.find_reversal_peaks(motion.recording, strokes, motion.raw_balance_n, table.profile)
        return replace(table, rows=tuple(replace(row, peak=peaks.get(row.stroke.index)) for row in rows))

    @classmethod
    def joined(cls, tables: Sequence[Strokes]) -> Strokes:
        """Join the strokes of several parts of a recording. The grids of the parts must have equal windows."""
        first, stop = min(t.grid.first for t in tables), max(t.grid.stop for t in tables)
        padded = [((0, 0), (t.grid.first - first, stop - t.grid.stop)) for t in tables]
        balance = [np.pad(t.balance_n, pad, constant_values=np.nan) for t, pad in zip(tables, padded, strict=True)]
        grid = replace(tables[0].grid, first=first, stop=stop)
        rows = tuple(row for t in tables for row in t.rows)
        return cls(grid, rows, np.concatenate(balance))

    def at(self, rows: Sequence[int]) -> Strokes:
        """Return the strokes with these row numbers."""
        return Strokes(self.grid, tuple(self.rows[i] for i in rows), self.balance_n[list(rows)])

    @property
    def profile(self) -> Profile:
        """Both directions of all strokes, paired at equal position."""
        way, edges = np.array([row.stroke.direction for row in self.rows]), self.grid.edges_m
        up_n, down_n = (self.balance_n[way == direction] for direction in (1, -1))
        up, down = mean_profile(up_n), mean_profile(down_n)
        centres, in_window = (edges[:-1] + edges[1:]) / 2, self.grid.is_in_window
        return Profile(centres, up, down, (up - down) / 2, (up + down) / 2, up_n, down_n, in_window)

    @property
    def directions(self) -> dict[int, list[int]]:
        """Indices of the evaluated strokes by direction. A direction without evaluated strokes is left out."""
        counting = [row.stroke.direction if row.means else 0 for row in self.rows]
        return {way: [i for i, it in enumerate(counting) if it == way] for way in (1, -1) if way in counting}

    def sides(self, *, uses_window: bool) -> tuple[dict[int, Row], Bools]:
        """Combine the strokes of each direction. The result is empty without usable strokes or common bins.

        Parameters
        ----------
        uses_window : bool
            Whether to average over the bins of the window, rather than over all chosen samples.

        Returns
        -------
        dict
            Direction -> its row. The columns are

            - `MEANS`: means over the settled samples.
            - ``parallel_n``, one of the means: standard uncertainty of the parallel forces, due to their areas.
            - ``late_n``, one of the means: standard uncertainty of the pressure force, due to the times of pressures.
            - ``samples``, ``strokes``, ``strokes_recorded``: used samples, used strokes, and all strokes.
            - ``used``: the used strokes. ``spread``: the `Spread` of their means at equal positions.
            - ``pressure_moves_n``: usual range of the pressure force within a stroke.
            - ``breakaway_n``, ``dwell_s``, ``loading_rate_n_s``: medians of the preceding reversals. They are NaN
              without a usable peak.
            - ``ripple``: standard deviation of speed divided by the mean speed.
            - ``period_s``, ``step_m``: period and travel of one stick-slip. They are NaN without stick-slip.
            - ``piston_ripple``: ripple of the piston behind the rig's spring. It is NaN with an unknown stiffness.
            - ``stick_slip``: whether more than half of the strokes have stick-slip.
        ndarray of bool, shape (bins,)
            Bins of the window covered by all present directions, so that means are over equal positions.
        """
        ways, bins = self.directions, self.grid.is_in_window
        for rows in ways.values():
            bins &= np.isfinite(self.balance_n[rows]).any(axis=0)
        if not ways or not bins.any():
            return {}, bins
        sides = {}
        for way, rows in ways.items():  # strokes have equal weight
            some, balance = [self.rows[i] for i in rows], self.balance_n[rows]
            columns = {name: np.array([row.means[name] for row in some]) for name in some[0].means}
            means_n, peaks = columns["mean_n"], [row.peak for row in some if row.peak]
            if uses_window:  # missing bins are filled from the profile
                rows_n = balance[:, bins]
                profile_n = mean_profile(rows_n)
                means_n = known_mean(rows_n - profile_n, axis=1) + np.nanmean(profile_n)
            # Stick-slip of axis or piston, whichever sticks in more strokes.
            axis = [row.slip[0] for row in some if row.slip]
            piston = [row.slip[1] for row in some if row.slip and row.slip[1] is not None]
            sliding = max((axis, piston), key=lambda slips: sum(slip.found for slip in slips))
            is_slipping = bool(sliding) and sum(slip.found for slip in sliding) > 0.5 * len(sliding)
            sides[way] = {name: float(columns[name].mean()) for name in MEANS} | {
                "samples": int(columns["samples"].sum()),
                "strokes": len(rows),
                "strokes_recorded": sum(row.stroke.direction == way for row in self.rows),
                "used": tuple(row.stroke for row in some),
                "spread": spread_of(means_n),
                "pressure_moves_n": float(np.median(columns["pressure_moves_n"])),
                "breakaway_n": median([peak.friction_n for peak in peaks if not peak.flags]),
                "dwell_s": median([row.stroke.dwell_s for row in some if row.stroke.index > 0]),
                "loading_rate_n_s": median([p.loading_rate_n_s for p in peaks if np.isfinite(p.loading_rate_n_s)]),
                "ripple": median([slip.ripple for slip in axis]),
                "period_s": median([slip.period_s for slip in sliding if is_slipping]),
                "step_m": median([slip.step_m for slip in sliding if is_slipping]),
                "piston_ripple": median([slip.ripple for slip in piston]),
                "stick_slip": is_slipping,
            }
        return sides, bins


def stroke_grid(
    position_m: Array,
    strokes: Sequence[Stroke],
    window: Interval,
    bins: int | None = None,
) -> Grid:
    """Divide the travel of strokes into bins. The window has `bins` bins or, if None, bins of about four samples."""
    low, high = window
    inside = [int(((x >= low) & (x <= high)).sum()) for x in (position_m[s.samples] for s in strokes)]
    ends = [value for s in strokes for value in (s.from_m, s.to_m)]
    filled = int(np.clip(int(np.median(inside)) // SAMPLES_PER_BIN, MINIMUM_BINS, MAXIMUM_BINS))
    core = np.linspace(low, high, (bins or filled) + 1)
    width = core[1] - core[0]
    below = max(int(np.ceil((low - min(ends)) / width)), 0)
    above = max(int(np.ceil((max(ends) - high) / width)), 0)
    return Grid(low, float(width), core.size - 1, -below, core.size - 1 + above)


def stroke_rows(motion: RecordedMotion, strokes: Sequence[Stroke], grid: Grid) -> Array:
    """Average the balance of the settled samples of each stroke in each bin; NaN in unused bins."""
    edges, slack = grid.edges_m, CUT_SHARE * grid.width_m
    rows = np.empty((len(strokes), edges.size - 1))
    for row, stroke in zip(rows, strokes, strict=True):
        row[:] = bin_means(motion.position_m, motion.balance_n, edges, [stroke.samples], motion.settled)
        reached = motion.position_m[stroke.samples][motion.settled[stroke.samples]]
        if grid.whole and reached.size:
            row[(edges[:-1] < reached.min() - slack) | (edges[1:] > reached.max() + slack)] = np.nan
    return rows


@dataclass(frozen=True)
class StrokeUse:
    """Number of strokes of one recording, and number of unused strokes by reason.

    Attributes
    ----------
    recorded : int
    left_out : dict
        Reason -> number of strokes: ``window`` (less than a quarter of the window is crossed), ``unsettled`` (too few
        settled samples in the window), ``apart`` (the speed class has no position common to both directions).
    """

    recorded: int
    left_out: dict[str, int]

    @property
    def used(self) -> int:
        """Number of used strokes."""
        return self.recorded - sum(self.left_out.values())

    @property
    def why(self) -> str:
        """Reasons in words; "" if all strokes are used."""
        return ", ".join(sentence(f"strokes.{name}", count=count) for name, count in self.left_out.items())


def stroke_notes(uses: Mapping[str, StrokeUse]) -> Iterator[str]:
    """Yield a sentence for each of up to `MOST_NAMED` recordings with unused strokes, and one for all others.

    Parameters
    ----------
    uses : mapping
        Name of each recording -> its strokes.
    """
    partial = {name: use for name, use in uses.items() if use.why}
    worst = sorted(partial, key=lambda name: partial[name].used / max(partial[name].recorded, 1))[:MOST_NAMED]
    for name in (name for name in partial if name in worst):
        use = partial[name]
        yield sentence("strokes.partial", name=name, used=use.used, recorded=use.recorded, why=use.why)
    rest = [use for name, use in partial.items() if name not in worst]
    if rest:
        used, recorded = sum(use.used for use in rest), sum(use.recorded for use in rest)
        yield sentence("strokes.rest", count=len(rest), used=used, recorded=recorded)


# --- Motion of a recording.

CLOCK_S = 0.015  # standard uncertainty of a delay between loggers, with parallel forces (assumed)
SWING_BINS = 40  # bins over the travel for the balance of one direction
END_TRAVELS = 2.0  # of the way from the stroke's end at which its speed falls below the share: excluded
LEAST_SWING = 0.5  # of its median: limit of the variation of friction over position


@dataclass(frozen=True, eq=False, repr=False)
class RecordedMotion:
    """A cleaned recording with its strokes, its force balance and its settled samples.

    Attributes
    ----------
    recording : Recording
        Cleaned recording, with counts of its flags.
    choice : SampleChoice
        Selection of samples.
    strokes : tuple of Stroke
    raw_balance_n : ndarray, shape (n,)
        Force balance (see `Recording.balance_n`).
    balance_n : ndarray, shape (n,)
        Force balance to average; smoothed if the sample selection requires it.
    settled : ndarray of bool, shape (n,)
        Mask of the selected samples.
    delay : PressureDelay or None
        Delay of the pressures, estimated from closed chambers. A significant delay is removed from the recording.
    """

    recording: Recording
    choice: SampleChoice
    strokes: tuple[Stroke, ...]
    raw_balance_n: Array
    balance_n: Array
    settled: Bools
    delay: PressureDelay | None

    @classmethod
    def of(
        cls, recording: Recording, choice: SampleChoice, *, inertia: bool = True, delay: PressureDelay | None = None
    ) -> RecordedMotion:
        """Find strokes, balance and settled samples of a cleaned recording.

        Parameters
        ----------
        recording : Recording
        choice : SampleChoice
        inertia : bool
            Whether inertia of the mass beyond the sensor is subtracted.
        delay : PressureDelay, optional

        Raises
        ------
        RecordingError
            The recording has no motion, too few samples, or impossible values.
        """
        strokes = find_strokes(recording.name, recording.time_s, recording.position_m)
        refuse_channels(recording, strokes)
        balance = recording.balance_n(None if inertia else 0.0)
        every = np.ones(len(recording), dtype=bool)
        motion = cls(recording, choice, tuple(strokes), balance, balance, every, delay)
        settled, chosen = choice.choose(motion)
        return replace(motion, balance_n=chosen, settled=settled)

    @property
    def time_s(self) -> Array:
        """Times of the samples, in s."""
        return self.recording.time_s

    @property
    def position_m(self) -> Array:
        """Positions of the samples, in m."""
        return self.recording.position_m

    @property
    def late_s(self) -> float:
        """Standard uncertainty of the times of the pressures: from the delay, or from the error of a removed delay."""
        clock = CLOCK_S if self.recording.parallel else 0.0
        if self.delay is None:
            return clock
        left = 0.0 if self.delay.is_clear else abs(self.delay.value_s)
        return max(clock, max(left, self.delay.half_width_s) / 2.0)


@dataclass(frozen=True)
class Settled:
    """Selection of the samples after the transient of the reversal, for motions with or without a controlled speed.

    A stroke has settled when both speed and force have settled. Speed has settled after ``speed_travels`` times the
    travel at which ``speed_share`` of the speed in mid stroke is reached. Force has settled after ``force_travels``
    times the travel at which the balance has completed the fraction ``force_share`` of its change at the reversal. In
    presliding, the force approaches its final value like 1 - 2 exp(-x/l). The distance 1.6 l gives 80 % of the change;
    after three times this distance, 2 % are left. A higher ``force_share`` would be sensitive to friction that varies
    over position. At the end of a stroke, the speed falls below ``speed_share``. Twice the distance from there to the
    end is dropped. The reference change of the force is the `Swing` of the stroke's speed class, because slow strokes
    never reach the friction of fast strokes. The change is limited to the swing of all strokes, because the friction of
    fast strokes may still grow along the stroke. Neither speed nor force needs to be constant. Means are over bins of
    equal position (``uses_window``).
    """

    speed_share: float = 0.8
    force_share: float = 0.8
    speed_travels: float = 2.0
    force_travels: float = 3.0
    name: str = "settled"
    uses_window: bool = True

    def choose(self, motion: RecordedMotion) -> tuple[Bools, Array]:
        """Return the mask of settled samples and the unchanged balance."""
        position_m, balance_n, strokes = motion.position_m, motion.balance_n, motion.strokes
        velocity_m_s = local_slope(motion.time_s, position_m)
        mask = np.zeros(position_m.size, dtype=bool)
        # The swing of a stroke is that of its speed class, or of all strokes if that is smaller. For a direction
        # without strokes in the class, all strokes of this direction are used.
        whole, classes = Swing.of(motion, strokes), speed_levels(list(strokes))
        swings = {stroke.index: whole for stroke in strokes}
        whole_n = 0.0 if whole is None else abs(whole.middle_n)
        for members in classes if len(classes) > 1 else ():
            ways = {stroke.direction for stroke in members}
            swing = Swing.of(motion, [*members, *(s for s in strokes if s.direction not in ways)])
            if swing is not None and abs(swing.middle_n) < whole_n:
                swings |= {stroke.index: swing for stroke in members}
        for stroke in strokes:
            part = stroke.samples
            travelled = np.abs(position_m[part] - stroke.from_m)
            fast = np.abs(velocity_m_s[part]) >= self.speed_share * abs(stroke.speed_m_s)
            if not fast.any():
                continue
            begin = self.speed_travels * travelled[int(np.argmax(fast))]
            swing = swings[stroke.index]
            if swing is not None:
                risen = swing.share_risen(position_m[part], balance_n[part], stroke.direction) >= self.force_share
                if risen.any():
                    begin = max(begin, self.force_travels * travelled[int(np.argmax(risen))])
            ahead = np.abs(stroke.to_m - position_m[part])
            braking = END_TRAVELS * ahead[np.flatnonzero(fast)[-1]]
            mask[part] = (travelled >= begin) & (ahead > braking)
        return mask, balance_n


@dataclass(frozen=True)
class SourcePaper:
    """The source paper's protocol: drop the first 5 % of each stroke, smooth over 5 samples, and average the rest.

    The moving average hardly changes the mean. This protocol is available for comparison with published numbers.
    Dropping 5 % is not enough if the piston needs more travel to reach its speed. Means are over all chosen samples.
    """

    dropped_share: float = 0.05
    average_samples: int = 5
    name: str = "source-paper"
    uses_window: bool = False

    def choose(self, motion: RecordedMotion) -> tuple[Bools, Array]:
        """Return the mask of samples after the first 5 % of each stroke's time, and the smoothed balance."""
        mask = np.zeros(motion.time_s.size, dtype=bool)
        smooth = motion.balance_n.copy()
        for stroke in motion.strokes:
            time = motion.time_s[stroke.samples]
            # By time, so that a burst after the reversal does not count more.
            mask[stroke.samples] = time >= time[0] + self.dropped_share * (time[-1] - time[0])
            smooth[stroke.samples] = moving_average(motion.balance_n[stroke.samples], self.average_samples)
        return mask, smooth


SampleChoice = Settled | SourcePaper  # rule that selects, and may smooth, the samples of a stroke for its mean
SAMPLE_CHOICES = {"settled": Settled, "source-paper": SourcePaper}


def moving_average(values: Array, count: int) -> Array:
    """Return the centred moving average over ``count`` samples, or fewer at the ends, in the same shape."""
    kernel = np.ones(count)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")


@dataclass(frozen=True, eq=False)
class Swing:
    """Mean balance of each direction over position, and its change from -x to +x as a linear function of position."""

    position_m: Array
    balance_n: dict[int, Array]
    middle_n: float  # median in the middle 60 % of the travel
    slope_n_m: float
    intercept_n: float

    @classmethod
    def of(cls, motion: RecordedMotion, strokes: Sequence[Stroke]) -> Swing | None:
        """Return the swing of strokes over the travel of all strokes; None without both directions or a change."""
        ends = [value for stroke in motion.strokes for value in (stroke.from_m, stroke.to_m)]
        low, high = min(ends), max(ends)
        edges = np.linspace(low, high, SWING_BINS + 1)
        centres = (edges[:-1] + edges[1:]) / 2
        parts = {way: [s.samples for s in strokes if s.direction == way] for way in (1, -1)}
        if not all(parts.values()):
            return None
        means = {way: bin_means(motion.position_m, motion.balance_n, edges, some) for way, some in parts.items()}
        swings, margin = means[1] - means[-1], 0.2 * (high - low)
        inside = (centres > low + margin) & (centres < high - margin) & np.isfinite(swings)
        middle = float(np.median(swings[inside])) if inside.any() else 0.0
        return cls(centres, means, middle, *straight_line(centres[inside], swings[inside])) if middle else None

    def share_risen(self, position_m: Array, balance_n: Array, direction: int) -> Array:
        """Return the fraction of the change of the balance after a reversal that each sample has completed."""
        before = self.balance_n[-direction]
        known = np.isfinite(before)
        start = np.interp(position_m, self.position_m[known], before[known])
        line = (self.slope_n_m * position_m + self.intercept_n) / self.middle_n
        return direction * (balance_n - start) / (self.middle_n * np.clip(line, LEAST_SWING, 1 / LEAST_SWING))
