"""Cycles of a campaign folder, or speed levels of recordings, as one table.

The columns are the plan, means and position bins of both directions, uncertainties, and values at rest. Position bins
have equal weight, so unevenly spaced samples, such as bursts around a reversal, do not distort the means. The strokes
and their means, scatter and breakaway come from ``strokes.py``.

Each cycle file is read as a recording whose plan states one speed and the set pressures. Damaged samples are left out
and counted. Unreadable cycles are left out and listed. Several processes read the cycles.

Cycles at rest give the gain of the force sensor (known weights) and the zeros of the pressures (zero runs). In an open
zero run, both chambers should show ambient pressure.

Recordings are treated as a campaign without a plan: each speed level of each recording is a cycle. Measured speeds and
pressures replace the set values. Pressures that differ by less than 0.1 bar form one condition. The labels of a
recording state seal, mounting and drive, and each value of the label ``run`` is a block. The order of the recordings in
time is unknown.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeVar

import numpy as np

from pneudrive.arrays import Array, Bools, Row, attributes_of, by_name, evenly
from pneudrive.batching import many_objects, share_out
from pneudrive.campaign.storage.folder import Campaign, CycleFile, Head, read_samples, recording_of, steps_of
from pneudrive.errors import CampaignError, PneudriveError, RecordingError
from pneudrive.estimate.autocorrelation import levels, means, stderr_of_mean
from pneudrive.estimate.estimates import rms
from pneudrive.friction.bins import Grid, bin_means, grid_of, known_mean, mean_profile
from pneudrive.friction.friction_map import CYCLE_COLUMNS, LEVELS, SAME_PA, TABLES, Condition, Skipped
from pneudrive.friction.level import stated_shares, usual_range
from pneudrive.friction.stick_slip import swing_of
from pneudrive.friction.strokes import RecordedMotion, SampleChoice, Strokes, stroke_rows
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import SHARED, Hold, Identity, Move, Samples
from pneudrive.signals.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.characterisation import Characterisation

    Read = tuple[float, Row | Skipped | None]
    """Path length of a cycle's moves; row of the cycle, or the reason why the cycle has no row."""

T = TypeVar("T")
SAME_SPEED = 0.1  # largest difference of the speeds of strokes in one cycle
WAYS = np.array([1, -1])  # directions, in the order of the columns of both
#: Columns of both directions, shape (n, 2): first the columns of `Strokes.sides`, then those of `cycle_row`.
OF_SIDES: list[str] = TABLES["lists"]["sides"]
#: Columns over position bins, shape (n, 2, bins): force balance (see `Recording.balance_n`), and the part from the
#: chamber pressures, p_a A_a - p_b A_b - p_ambient (A_a - A_b). NaN without settled samples.
OF_BINS = ("balance_n", "air_n")


@dataclass(frozen=True, eq=False)
class CycleTable:
    """Cycles as a table with the columns `CYCLE_COLUMNS`, `OF_SIDES`, `OF_BINS`, and objects (condition, flags)."""

    columns: dict[str, NDArray]

    @classmethod
    def of(cls, rows: Sequence[Row], bins: int) -> CycleTable:
        """Make the table from rows, with `bins` position bins."""
        columns: dict[str, NDArray] = {}
        for name, default in {**CYCLE_COLUMNS, "condition": None, "flags": None}.items():
            kind = type(default) if isinstance(default, int | float) else object
            columns[name] = np.array([row.get(name, default) for row in rows], dtype=kind)
        unknown = dict.fromkeys(OF_SIDES, np.array(np.nan)) | dict.fromkeys(OF_BINS, np.full(bins, np.nan))
        for name, default in unknown.items():
            values = [[row["sides"].get(way, {}).get(name, default) for way in WAYS] for row in rows]
            columns[name] = np.array(values, dtype=float).reshape(len(rows), 2, *default.shape)
        return cls(columns)

    def __getitem__(self, name: str) -> NDArray:
        """Return a column."""
        return self.columns[name]

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.columns["index"].size

    def at(self, rows: NDArray) -> Self:
        """Return the rows that a mask or indices select."""
        return self.having(**{name: values[rows] for name, values in self.columns.items()})

    def having(self, **columns: NDArray) -> Self:
        """Return the table with some columns replaced."""
        return replace(self, columns=self.columns | columns)

    @property
    def moves(self) -> Bools:
        """Mask of the directions in which each cycle moves (shape (n, 2))."""
        return np.isfinite(self["velocity_m_s"])

    def over_sides(self, name: str) -> Array:
        """Return the mean magnitude of a column over the directions; NaN without motion (shape (n,))."""
        return known_mean(np.abs(self[name]), axis=1)


def reduce_cycle(motion: RecordedMotion, edges_m: Array) -> Row:
    """Reduce the strokes of one speed to position bins.

    Parameters
    ----------
    motion : RecordedMotion
    edges_m : ndarray, shape (bins + 1,)
        Edges of the position bins common to all cycles.

    Raises
    ------
    RecordingError
        If the strokes have different speeds, or if every stroke has settled samples in less than a
        quarter of its middle part.
    """
    name, speeds = motion.recording.name, np.abs([stroke.speed_m_s for stroke in motion.strokes])
    if speeds.max() - speeds.min() > SAME_SPEED * speeds.max():
        raise RecordingError.of("friction.speeds", where=name, slowest=1e3 * speeds.min(), fastest=1e3 * speeds.max())
    grid = grid_of(edges_m)
    table = Strokes.of(motion, motion.strokes, (edges_m[0], edges_m[-1]), grid)
    sides, _ = table.sides(uses_window=motion.choice.uses_window)
    if not sides:
        raise RecordingError.of("friction.settled", where=name, strokes=len(motion.strokes))
    return cycle_row(motion, grid, sides, {way: table.balance_n[rows] for way, rows in table.directions.items()})


def cycle_row(
    motion: RecordedMotion,
    grid: Grid,
    sides: Mapping[int, Row],
    rows: Mapping[int, Array],
) -> Row:
    """Return the row of a cycle, or of a speed level, from its reduced strokes.

    Parameters
    ----------
    motion : RecordedMotion
    grid : Grid
        Position bins common to all cycles.
    sides : mapping
        Direction -> its strokes.
    rows : mapping
        Direction -> force balance of its strokes, in N (shape (strokes, bins)).
    """
    recording, only = motion.recording, next(iter(sides.values()))
    ambient = recording.ambient_pressure_pa
    air_n = (recording.pressure_a_pa - ambient) * recording.area_a_m2
    air_n -= (recording.pressure_b_pa - ambient) * recording.area_b_m2
    sampled = (motion.balance_n, motion.balance_n**2, air_n)
    of_sides = {}
    for way, side in sides.items():
        bins = grid.edges_m, [stroke.samples for stroke in side["used"]], motion.settled
        balance, squares, air = (bin_means(motion.position_m, values, *bins) for values in sampled)
        profile = mean_profile(rows[way])
        covered = np.isfinite(profile)
        variances = (squares - balance**2)[covered]
        known = vars(side["spread"]) | side
        of_sides[way] = {
            **{name: known[name] for name in OF_SIDES if name in known},
            "balance_n": profile,
            "air_n": np.where(covered, air, np.nan),
            "scatter_n": np.sqrt(max(variances.mean(), 0.0)),
            "swing_n": swing_of(motion.position_m, motion.balance_n, side["used"]),
        }
    return {
        "sides": of_sides,
        "duration_s": recording.time_s[-1] - recording.time_s[0],
        **stated_shares(recording, *(sides.get(way, only) for way in WAYS), late_s=motion.late_s),
    }


# --- Sensors, from cycles at rest.

SURPRISE = 3.0  # standard uncertainties between stated accuracy and known weights
GROWING = ("force: gain", "force: creep")  # sources proportional to the force
PLAUSIBLE = 0.1  # a larger gain error is not the sensor's: the weight was wrong or supported
REACH = 5.0  # stated accuracies: a larger deviation from ambient is not the zero of a sound transducer (assumed)


@dataclass(frozen=True)
class Gain:
    """Relative error of the force sensor's gain.

    Attributes
    ----------
    error : float
        Relative gain error that is corrected: the measured error or, with a stated accuracy, its weighted mean with 0.
    stderr : float
        Standard uncertainty after correction; NaN without a weight.
    measured, measured_stderr : float
        Gain error from the weights only, and its standard error. NaN without weights.
    cycles : int
    sentence : str
        Key of the statement on the error. An implausibly large error is reported, but not corrected. If the error
        exceeds stated accuracy and scatter, the stated accuracy is ignored.
    """

    error: float = 0.0
    stderr: float = np.nan
    measured: float = np.nan
    measured_stderr: float = np.nan
    cycles: int = 0
    sentence: str = "curve.gain"


def sensor_gain(identity: Identity, weights: CycleTable, tares: CycleTable) -> Gain:
    """Compare the readings of the sensor under known weights with its readings in zero runs.

    If a weight pulls the piston in +x, the rig holds the piston, and the reading is lower by the weight.
    """
    weights = weights.at(weights["weight_n"] != 0.0)
    count = len(weights)
    if not count or not len(tares):
        return Gain()
    near = tares.at(np.abs(tares["index"] - weights["index"][:, None]).argmin(axis=1))
    values = (near["standing_n"] - weights["standing_n"]) / weights["weight_n"] - 1.0
    variances = (weights["standing_stderr_n"] ** 2 + near["standing_stderr_n"] ** 2) / weights["weight_n"] ** 2
    measured = float(np.mean(values))
    scatter = np.var(values, ddof=1) / count if count > 1 else 0.0
    stderr = float(np.sqrt(max(np.mean(variances) / count, scatter)))
    if abs(measured) > PLAUSIBLE:
        return Gain(0.0, np.nan, measured, stderr, count, "curve.gain_wrong")
    prior = stated_gain(identity)
    if prior is None:
        return Gain(measured, stderr, measured, stderr, count)
    total = float(np.hypot(prior, stderr))
    if abs(measured) > SURPRISE * total:
        return Gain(measured, stderr, measured, stderr, count, "curve.gain_surprising")
    share = prior**2 / total**2 if total > 0 else 0.0
    return Gain(share * measured, float(np.sqrt(share)) * stderr, measured, stderr, count)


def stated_gain(identity: Identity) -> float | None:
    """Return the relative gain error allowed by calibration or stated accuracy; None if neither is stated."""
    if identity.force_calibration is not None:
        return identity.force_calibration.u_gain
    if "force_n" not in identity.accuracy or "force_n" not in identity.limits:
        return None
    return identity.accuracy["force_n"] / max(abs(v) for v in identity.limits["force_n"])


def corrected(cycles: CycleTable, gain: Gain) -> CycleTable:
    """Correct the forces of cycles for the gain error, and replace the stated uncertainty by that of the correction."""
    if not np.isfinite(gain.stderr):
        return cycles
    force, factor, air = cycles["force_n"], 1.0 + gain.error, cycles["air_n"]
    single = np.abs(np.nan_to_num(force)).sum(axis=1)
    difference = np.abs(force[:, 0] - force[:, 1])
    half_difference = np.where(cycles.moves.all(axis=1), difference / 2.0, single)
    left = gain.stderr * half_difference
    growing = (left, np.nan_to_num(cycles["force: creep"]), cycles["u_air_n"])
    return cycles.having(
        balance_n=air + (cycles["balance_n"] - air) / factor,
        force_n=force / factor,
        standing_n=cycles["standing_n"] / factor,
        u_gain_n=np.sqrt(sum(u**2 for u in growing)),
        assumed=np.zeros(len(cycles), dtype=bool),
        **{"force: gain": np.where(np.isfinite(cycles["force: gain"]), left, np.nan)},
    )


def pressure_zeros(identity: Identity, tares: CycleTable) -> dict[str, Row]:
    """Return chamber ("a", "b") -> zero of its transducer, for transducers with a stated accuracy.

    ``tares`` is the number of usable zero runs. ``unusable`` maps the key of a statement to its zero runs: key of the
    run -> deviation from ambient, or change, in Pa. The other three entries exist only with usable zero runs.
    ``blocks`` has the zero of each block, in Pa, which is subtracted from the cycles of the block. ``mean_pa`` is the
    mean over all runs. ``stderr_pa`` is the standard uncertainty of this mean from noise and scatter of the runs.
    """
    found = {}
    for side in "ab":
        accuracy = identity.accuracy.get(f"pressure_{side}_pa", 0.0)
        seen = tares.at(np.isfinite(tares[f"open_{side}_pa"]))
        if not (accuracy > 0.0 and len(seen)):
            continue
        off, change = seen[f"open_{side}_pa"] - identity.ambient_pressure_pa, seen[f"open_{side}_change_pa"]
        unsteady = np.abs(change) > accuracy
        far = ~unsteady & (np.abs(off) > REACH * accuracy)
        faults = {"zero.pressure_far": (far, off), "zero.pressure_unsteady": (unsteady, change)}
        unusable = {name: by_name(seen["key"][some].tolist(), values[some]) for name, (some, values) in faults.items()}
        seen, off = seen.at(~(far | unsteady)), off[~(far | unsteady)]
        found[side] = {"tares": off.size, "unusable": unusable}
        if off.size:
            noise, scatter = rms(seen[f"open_{side}_stderr_pa"]), np.std(off, ddof=1) if off.size > 1 else 0.0
            found[side] |= {
                "blocks": {block: float(off[seen["block"] == block].mean()) for block in set(seen["block"].tolist())},
                "mean_pa": float(off.mean()),
                "stderr_pa": float(np.hypot(noise, scatter) / np.sqrt(off.size)),
            }
    return found


def without_zeros(cycles: CycleTable, zeros: dict[str, Row], identity: Identity) -> CycleTable:
    """Subtract the pressure zeros of the block, or otherwise their mean, from cycles and zero runs.

    After this correction, a zero run shows only the zero of the force sensor.

    The accuracy of a transducer then only contains its gain error, which grows with the reading. If the range is not
    stated, it is assumed to be the smallest usual range that contains the highest pressure of the campaign.
    """
    known = {side: zero for side, zero in zeros.items() if zero["tares"]}
    if not known or not len(cycles):
        return cycles
    area, ambient = {"a": identity.area_a_m2, "b": -identity.area_b_m2}, identity.ambient_pressure_pa
    blocks, variance = cycles["block"].tolist(), cycles["u_offset_n"] ** 2
    off = {}
    for side, zero in known.items():
        off[side] = np.array([zero["blocks"].get(block, zero["mean_pa"]) for block in blocks])
    force = sum((area[side] * value for side, value in off.items()), np.zeros(len(cycles)))
    vented = np.isfinite(cycles["open_a_pa"]) | np.isfinite(cycles["open_b_pa"])
    shown = {f"pressure_{side}_pa": cycles[f"pressure_{side}_pa"] - value[:, None] for side, value in off.items()}
    for side in known:
        channel = f"pressure_{side}_pa"
        if channel in identity.limits or not cycles.moves.any():
            continue  # already counted by its reading
        span = usual_range(float(np.nanmax(np.abs(cycles[channel] - ambient))))
        share = np.minimum(np.abs(known_mean(shown[channel], axis=1) - ambient) / span, 1.0)
        left = identity.accuracy[channel] * abs(area[side]) * share
        variance = variance + (left**2 - cycles[f"u_pressure_{side}_n"] ** 2)
    u_offset = np.sqrt(np.maximum(variance, 0.0))
    return cycles.having(
        **shown,
        balance_n=cycles["balance_n"] - force[:, None, None],
        air_n=cycles["air_n"] - force[:, None, None],
        standing_n=np.where(vented, cycles["standing_n"] - force, cycles["standing_n"]),
        u_offset_n=np.where(cycles.moves.any(axis=1), u_offset, cycles["u_offset_n"]),
    )


# --- Cycles of a campaign folder.

PRESSURE_STEP_PA = 100.0  # difference at which a pressure is a separate level: 1 mbar
MINIMUM_SAMPLES = 20
TARE_SETTLING = 0.5  # initial share of a tare that is left out: seals relax after the release


def condition_of(head: Head) -> Condition:
    """Return the condition of a cycle: planned pressures, rounded to 1 mbar, and the levels of its block."""
    cycle = head.cycle
    a, b = (PRESSURE_STEP_PA * round(p / PRESSURE_STEP_PA) for p in (cycle.pressure_a_pa, cycle.pressure_b_pa))
    return Condition(a, b, **{name: str(cycle.levels.get(name, "")) for name in LEVELS})


def read_or_skip(
    read: Callable[..., T], file: CycleFile, samples: Samples | CampaignError, *rest: object
) -> T | Skipped:
    """Read a cycle by ``read(file, samples, *rest)``, or return the reason why it cannot be read.

    Parameters
    ----------
    read : callable
        Function that makes a result from file and samples.
    file : CycleFile
    samples : Samples or CampaignError
        Raw samples of the cycle, or the error of reading them.
    *rest
        Further arguments.
    """
    try:
        if isinstance(samples, CampaignError):
            raise samples
        return read(file, samples, *rest)
    except PneudriveError as error:
        reason = f"{error.what} ({error.value})" if error.value is not None else error.what
    except (ValueError, IndexError, ArithmeticError, np.linalg.LinAlgError) as error:
        # Unexpected samples spoil only their cycle, not the campaign.
        reason = f"{type(error).__name__}: {error}"
    return Skipped(file.head.cycle.key, file.path.name, reason)


def read_each(files: Sequence[CycleFile], read: Callable[..., T], *rest: object) -> list[T | Skipped]:
    """Read cycles one after the other by `read_or_skip`."""
    both = zip(files, read_samples(files), strict=True)
    return [read_or_skip(read, file, samples, *rest) for file, samples in both]


def standing_row(file: CycleFile, recording: Recording, samples: Samples, ambient_pa: float) -> Row:
    """Return mean force and uncertainty of a cycle at rest: a zero run, or a run with a known weight.

    For open chambers with a transducer, the row has the mean reading, its standard error, and the change between the
    halves of the run.

    Raises
    ------
    RecordingError
        If the cycle has too few samples.
    """
    cycle, steps = file.head.cycle, steps_of(recording, samples)
    holds = [(i, step) for i, step in enumerate(cycle.steps) if isinstance(step, Hold)]
    meant = [i for i, step in holds if step.released or step.weight_n]
    standing = np.isin(steps, meant) if meant else np.ones(len(recording), dtype=bool)
    begin, end = np.quantile(recording.time_s[standing], [0.0, 1.0])
    standing &= recording.time_s >= begin + TARE_SETTLING * (end - begin)
    if standing.sum() < MINIMUM_SAMPLES:
        raise RecordingError("too few samples at rest", where=recording.name, value=int(standing.sum()))
    vented = max(abs(p - ambient_pa) for p in (cycle.pressure_a_pa, cycle.pressure_b_pa)) < PRESSURE_STEP_PA
    force = (recording.balance_n() + recording.weight_n if vented else recording.force_n)[standing]
    row: Row = {"sides": {}, "duration_s": recording.time_s[-1] - recording.time_s[0]}
    for side in "ab":
        values = getattr(recording, f"pressure_{side}_pa")[standing]
        if vented and np.ptp(values) > 0:
            first, second = np.array_split(values, 2)
            row[f"open_{side}_pa"], row[f"open_{side}_stderr_pa"] = values.mean(), stderr_of_mean(values)
            row[f"open_{side}_change_pa"] = second.mean() - first.mean()
    at_rest = {"standing_n": force.mean(), "standing_stderr_n": stderr_of_mean(force), "standing_sd_n": force.std()}
    return row | at_rest


BINS = 60  # bins over the way of a campaign
SLIDING = ("sweep", "sentinel")  # kinds of cycles that are points of a characteristic over speed
STANDING = ("tare", "weight")
WORTH_WORKERS = 100  # cycles below which starting processes costs more than it saves
LOOKED_AT = 8  # cycles that determine the way of the campaign
SAMPLES_OF_WAY = 2000  # samples of a cycle that determine its way if it has no steps
ENDS = (0.001, 0.999)  # quantiles of position, without single damaged samples


@dataclass(frozen=True, eq=False)
class CampaignData:
    """The reduced cycles of a campaign or of recordings.

    Attributes
    ----------
    name : str
    source : Path
        Folder of the campaign, or of the recordings.
    identity : Identity
    about : dict
        ``campaign.json``; empty for recordings.
    files : tuple of CycleFile
        All usable files in running order; empty for recordings.
    sliding, tares : CycleTable
        Cycles after correction of the force sensor's gain (known weights) and the pressure zeros (zero runs).
    gain : Gain
    pressure_zeros : dict
        Chamber -> zero of its transducer, if known from zero runs.
    skipped : tuple of Skipped
    notes : tuple of str
    edges_m : ndarray, shape (bins + 1,)
        Edges of the position bins.
    """

    name: str
    source: Path
    identity: Identity
    sliding: CycleTable
    tares: CycleTable
    skipped: tuple[Skipped, ...]
    edges_m: Array
    about: Row = field(default_factory=dict)
    files: tuple[CycleFile, ...] = ()
    gain: Gain = field(default_factory=Gain)
    pressure_zeros: dict[str, Row] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def _date(started: str) -> str:
    """Return the date of a time in ISO 8601; empty for another text."""
    with suppress(ValueError):
        return datetime.fromisoformat(started).date().isoformat()
    return ""


@many_objects()
def read_campaign(campaign: Campaign, choice: SampleChoice, processes: int | None) -> CampaignData:
    """Read and reduce all cycles of a campaign.

    Parameters
    ----------
    campaign : Campaign
    choice : SampleChoice
        Selection of samples.
    processes : int, optional
        None: one for each processor if there are 100 cycles or more.

    Raises
    ------
    CampaignError
        If no cycle can be used.
    """
    found, problems = campaign.scan()
    skipped = [Skipped("", p.where, p.what) for p in problems if p.lost]
    notes = [str(p) for p in problems if not p.lost]
    if not found:
        lost = "; ".join(f"{s.file}: {s.reason}" for s in skipped[:3]) or "no file in cycles/"
        raise CampaignError.of("friction.no_cycle", where=str(campaign.path), value=lost)
    # The snapshot of the rig is not needed, and would be sent to every process.
    files = tuple(CycleFile(f.path, replace(f.head, memory={})) for f in found)
    wanted = [f for f in files if f.cycle.kind in (*SLIDING, *STANDING) or not f.cycle.steps]
    moving = [f for f in wanted if f.cycle.kind in SLIDING]
    looked_at = [moving[i] for i in evenly(len(moving), LOOKED_AT)] if moving else []
    read_first = (samples for samples in read_samples(looked_at, ()) if isinstance(samples, Samples))
    edges = common_edges([samples.position_m for samples in read_first])
    read = share_out(read_part, wanted, campaign.identity, choice, edges, least=WORTH_WORKERS, processes=processes)
    rows = {f.cycle.key: one for f, one in zip(wanted, read, strict=True)}
    plans = _plans(files, rows)
    table = CycleTable.of([plans[key] | row for key, (_, row) in rows.items() if isinstance(row, dict)], BINS)
    skipped += [row for _, row in rows.values() if isinstance(row, Skipped)]
    kinds = table["kind"]
    tares = table.at(kinds == "tare")
    gain = sensor_gain(campaign.identity, table.at(kinds == "weight"), tares)
    zeros = pressure_zeros(campaign.identity, tares)
    table = without_zeros(corrected(table, gain), zeros, campaign.identity)
    return CampaignData(
        name=str(campaign.about.get("name", campaign.path.name)),
        source=campaign.path,
        identity=campaign.identity,
        about=campaign.about,
        files=files,
        sliding=table.at(np.isin(kinds.tolist(), SLIDING)),
        tares=table.at(kinds == "tare"),
        gain=gain,
        pressure_zeros=zeros,
        skipped=tuple(sorted(skipped, key=lambda s: s.file)),
        notes=tuple(notes),
        edges_m=edges,
    )


def _plans(files: Sequence[CycleFile], rows: dict[str, Read]) -> dict[str, Row]:
    """Return key of a cycle -> columns that follow from the header of the cycle and from the previous cycles.

    The rest before a cycle is the time since the end of the previous cycle. If the previous cycle was a stop, the rest
    is the duration of the stop. The travel is the total travel up to the middle of the cycle, from the plan if known,
    otherwise from the samples.
    """
    heads = [file.head for file in files]
    first, last, began = heads[0].index, heads[-1].index, min(head.began_s for head in heads)
    known = sorted({_date(head.started) for head in heads} - {""})
    plans, previous, duration, total, at = {}, None, np.nan, 0.0, None
    for head in heads:
        cycle, date = head.cycle, _date(head.started)
        way, row = rows.get(cycle.key, (0.0, None))
        rest = head.began_s - previous.began_s - duration if previous is not None else np.nan
        if previous is not None and previous.cycle.kind == "stop":
            rest = previous.cycle.stop_s or 0.0
        for step in cycle.steps:
            if isinstance(step, Move):
                way += abs(step.to_m - at) if at is not None else 0.0
                at = step.to_m
        plans[cycle.key] = {
            **attributes_of(cycle, "key", "kind", "block", "repeat"),
            "index": head.index,
            "day": known.index(date) + 1 if date else 1,
            "condition": condition_of(head),
            "set_speed_m_s": np.nan if cycle.speed_m_s is None else cycle.speed_m_s,
            "set_a_pa": cycle.pressure_a_pa,
            "set_b_pa": cycle.pressure_b_pa,
            "began_s": head.began_s,
            "elapsed_s": head.began_s - began,
            "order": (head.index - first) / max(last - first, 1),
            "weight_n": next((s.weight_n for s in cycle.steps if isinstance(s, Hold) and s.weight_n), 0.0),
            "travel_m": total + way / 2.0,
            "rest_s": rest,
        }
        total, previous = total + way, head
        duration = row["duration_s"] if isinstance(row, dict) and cycle.kind != "weight" else np.nan
    return plans


@many_objects()
def read_part(
    files: Sequence[CycleFile],
    identity: Identity,
    choice: SampleChoice,
    edges_m: Array,
) -> list[Read]:
    """Read cycles one after the other. For an unusable cycle, return the reason."""
    both = zip(files, read_samples(files, STANDING), strict=True)
    return [(_way(f, samples), read_or_skip(_row, f, samples, identity, choice, edges_m)) for f, samples in both]


def _way(file: CycleFile, samples: Samples | CampaignError) -> float:
    """Return the path length from the samples; zero if the header lists steps, or if the samples cannot be read."""
    if file.cycle.steps or isinstance(samples, CampaignError):
        return 0.0
    # The samples are widely spaced, so that noise does not add to the length.
    position = samples.position_m[np.isfinite(samples.position_m)]
    return float(np.abs(np.diff(position[:: max(position.size // SAMPLES_OF_WAY, 1)])).sum())


def _row(file: CycleFile, samples: Samples, identity: Identity, choice: SampleChoice, edges_m: Array) -> Row | None:
    """Return the columns of a cycle that follow from its samples; None for a cycle that only prepares the rig."""
    if file.cycle.kind not in (*SLIDING, *STANDING):
        return None
    recording, flags = recording_of(file, identity, samples)
    if file.cycle.kind in STANDING:
        row = standing_row(file, recording, samples, identity.ambient_pressure_pa)
    else:
        # Inertia is subtracted only in the source paper's protocol, where the settled part includes the ramp at the
        # end of the stroke. Otherwise the mean acceleration is zero, and its estimate would only add noise.
        row = reduce_cycle(RecordedMotion.of(recording, choice, inertia=not choice.uses_window), edges_m)
    known = samples.temperature_k[np.isfinite(samples.temperature_k)]
    return row | {"flags": flags, "temperature_k": known.mean() if known.size else np.nan}


# --- Friction around a reversal.

SHOWN_SAMPLES = 400
BEFORE, AFTER = 0.05, 0.1  # of the stroke, shown before and after the reversal


@dataclass(frozen=True, eq=False, repr=False)
class Loop(Shown):
    """Friction around one reversal, from thinned raw samples.

    Attributes
    ----------
    key : str
        Key of the cycle.
    condition : Condition
    speed_m_s : float
    position_m, friction_n : ndarray, shape (m,)
        `friction_n` is positive if it opposes motion in +x, and does not contain the offset.
    """

    key: str
    condition: Condition
    speed_m_s: float
    position_m: Array
    friction_n: Array


def reversal_loop(file: CycleFile, samples: Samples, identity: Identity, choice: SampleChoice) -> Loop | None:
    """Return the force balance around the first reversal of a cycle; None if it has no reversal.

    `Loop.friction_n` still contains the offset (half the sum of both directions).
    """
    recording, _ = recording_of(file, identity, samples)
    strokes = RecordedMotion.of(recording, choice, inertia=not choice.uses_window).strokes
    turns = [(a, b) for a, b in pairwise(strokes) if a.direction != b.direction]
    if not turns:
        return None
    before, after = turns[0]
    friction, index = recording.balance_n(None), np.arange(before.start, after.stop)
    reach = np.where(index < after.start, BEFORE, AFTER) * abs(after.to_m - after.from_m)
    index = index[np.abs(recording.position_m[index] - after.from_m) <= reach]
    if index.size < 10:
        return None
    shown = index[evenly(index.size, SHOWN_SAMPLES)]
    speed = abs(after.speed_m_s)
    return Loop(file.cycle.key, condition_of(file.head), speed, recording.position_m[shown], friction[shown])


def common_edges(positions: Sequence[Array]) -> Array:
    """Return the edges of bins over the travel of several motions, in m (shape (bins + 1,)).

    A motion far from the others (for example in wrong units) does not affect the bins.
    """
    finite = [position[np.isfinite(position)] for position in positions]
    ends = [np.quantile(position, ENDS) for position in finite if position.size]
    low, high = 0.0, 1.0  # nothing moves: the cycles report this
    if ends:
        known = np.array(ends)
        usual = np.median(known, axis=0)
        known = known[np.all(np.abs(known - usual) <= usual[1] - usual[0], axis=1)]
        if known.size and known[:, 1].max() > known[:, 0].min():
            low, high = known[:, 0].min(), known[:, 1].max()
    return np.linspace(low, high, BINS + 1)


STEP_PA = 1e3  # to which the pressure of a condition is rounded


def reading_of(found: Characterisation) -> CampaignData:
    """Return the speed levels of recordings as cycles of a campaign.

    Parameters
    ----------
    found : Characterisation
        Recordings whose samples are kept.
    """
    edges = common_edges([r.recording.position_m for r in found.results])
    members = [(result, level) for result in found.results for level in result.levels]
    pressures = {}  # of each level: the rounded mean of all pressures within `SAME_PA`
    for side in "ab":
        gauge_pa = np.array([level.gauge_pa[side] for _, level in members])
        near = levels(gauge_pa, SAME_PA)
        pressures[side] = STEP_PA * np.round(means(near, gauge_pa)[0] / STEP_PA)[near]
    runs = list(dict.fromkeys(level.run for _, level in members))
    grid = grid_of(edges)
    rows = []
    for i, (result, level) in enumerate(members):
        recording, kept = result.recording, {id(row.stroke) for row in level.kept}
        used = {way: tuple(s for s in side["used"] if id(s) in kept) for way, side in level.sides.items()}
        balance = {way: stroke_rows(result, strokes, grid) for way, strokes in used.items() if strokes}
        ways = [way for way, values in balance.items() if np.isfinite(values).any()]
        if not ways:
            continue
        sides = {way: level.sides[way] | {"used": used[way]} for way in ways}
        a, b = (recording.ambient_pressure_pa + float(pressures[side][i]) for side in "ab")
        plan = {
            "key": recording.name if len(result.levels) == 1 else f"{recording.name}#{level.index + 1}",
            "index": i + 1,
            "block": runs.index(level.run) + 1,
            "condition": Condition(a, b, **{name: recording.labels.get(name, "") for name in LEVELS}),
            "flags": dict(recording.flags),
        }
        rows.append(plan | cycle_row(result, grid, sides, balance))
    return CampaignData(
        name="recordings",
        source=next((r.source.parent for r in found.recordings if r.source is not None), Path()),
        identity=Identity(name="recordings", **attributes_of(found.recordings[0], *SHARED)),
        sliding=CycleTable.of(rows, BINS),
        tares=CycleTable.of([], BINS),
        skipped=tuple(Skipped(key, "", why) for key, why in found.skipped),
        edges_m=edges,
    )
