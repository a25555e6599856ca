"""Cycles of a campaign folder, or speed levels of recordings, reduced to one form.

Each cycle file is read as a recording with a plan. Damaged samples are left out and counted. Unreadable cycles are left
out and listed. Several processes read the cycles.

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
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pneudrive.arrays import Array, Row, evenly
from pneudrive.batching import many_objects, share_out
from pneudrive.campaign.storage.folder import Campaign, CycleFile, Head, read_samples, recording_of, steps_of
from pneudrive.errors import CampaignError, PneudriveError, RecordingError
from pneudrive.estimate.autocorrelation import levels, means, stderr_of_mean
from pneudrive.friction.bins import grid_of
from pneudrive.friction.campaign import cycles
from pneudrive.friction.friction_map import LEVELS, SAME_PA, Condition, Skipped
from pneudrive.friction.strokes import RecordedMotion, SampleChoice, stroke_rows
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import SHARED, Hold, Identity, Move, Samples
from pneudrive.signals.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.friction.characterisation import Characterisation

    Read = tuple[float, Row | Skipped | None]
    """Path length of a cycle's moves, and its row or the reason why it has none."""

T = TypeVar("T")
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
    """Return the mean force at rest, and its uncertainty, of a zero run or a run with a known weight.

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
        Bins of position.
    several : bool
        Whether the campaign has several blocks or days.
    """

    name: str
    source: Path
    identity: Identity
    sliding: cycles.CycleTable
    tares: cycles.CycleTable
    skipped: tuple[Skipped, ...]
    edges_m: Array
    several: bool
    about: Row = field(default_factory=dict)
    files: tuple[CycleFile, ...] = ()
    gain: cycles.Gain = field(default_factory=cycles.Gain)
    pressure_zeros: dict[str, cycles.PressureZero] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def _date(started: str) -> str:
    try:
        return datetime.fromisoformat(started).date().isoformat()
    except ValueError:
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
    positions: list[Array] = []
    for i in evenly(len(moving), LOOKED_AT) if moving else ():
        with suppress(PneudriveError):
            positions.append(moving[i].samples().position_m)
    edges = common_edges(positions)
    read = share_out(read_part, wanted, campaign.identity, choice, edges, least=WORTH_WORKERS, processes=processes)
    rows = {file.head.cycle.key: one for file, one in zip(wanted, read, strict=True)}
    plans = _plans(files, rows)
    whole = [plans[key] | row for key, (_, row) in rows.items() if isinstance(row, dict)]
    table = cycles.CycleTable.of(whole, BINS)
    skipped += [data for _, data in rows.values() if isinstance(data, Skipped)]
    kinds = table["kind"]
    tares = table.at(kinds == "tare")
    gain = cycles.sensor_gain(campaign.identity, table.at(kinds == "weight"), tares)
    zeros = cycles.pressure_zeros(campaign.identity, tares)
    table = cycles.without_zeros(cycles.corrected(table, gain), zeros, campaign.identity)
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
        several=any(len({plan[name] for plan in plans.values()}) > 1 for name in ("day", "block")),
    )


def _plans(files: Sequence[CycleFile], found: dict[str, Read]) -> dict[str, Row]:
    """Return for the key of each cycle the columns that follow from its header and from the cycles before it.

    The rest before a cycle is the time since the end of the previous cycle or, if that cycle was a stop, the duration
    of the stop. The travel is the total travel up to the middle of the cycle, from the plan if known, otherwise from
    the samples.
    """
    heads = [file.head for file in files]
    first, last, began = heads[0].index, heads[-1].index, min(head.began_s for head in heads)
    known = sorted({_date(head.started) for head in heads} - {""})
    plans, previous, duration, total, at = {}, None, np.nan, 0.0, None
    for head in heads:
        cycle, date = head.cycle, _date(head.started)
        way, row = found.get(cycle.key, (0.0, None))
        rest = head.began_s - previous.began_s - duration if previous is not None else np.nan
        if previous is not None and previous.cycle.kind == "stop":
            rest = previous.cycle.stop_s or 0.0
        for step in cycle.steps:
            if isinstance(step, Move):
                way += abs(step.to_m - at) if at is not None else 0.0
                at = step.to_m
        plans[cycle.key] = {
            **{name: getattr(cycle, name) for name in ("key", "kind", "block", "repeat")},
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
    """Read cycles one after the other. For an unusable cycle, return the reason.

    The path length from the samples is zero if the header lists steps, or if the samples cannot be read. Cycles that
    only prepare the rig have no row.
    """

    def read(file: CycleFile, samples: Samples) -> Row:
        recording, flags = recording_of(file, identity, samples)
        if file.head.cycle.kind in STANDING:
            row = standing_row(file, recording, samples, identity.ambient_pressure_pa)
        else:
            # Inertia is subtracted only in the source paper's protocol, where the settled part includes the ramp at the
            # end of the stroke. Otherwise the mean acceleration is zero, and its estimate would only add noise.
            motion = RecordedMotion.of(recording, choice, inertia=not choice.uses_window)
            row = cycles.reduce_cycle(motion, edges_m)
        known = samples.temperature_k[np.isfinite(samples.temperature_k)]
        return row | {"flags": flags, "temperature_k": known.mean() if known.size else np.nan}

    found: list[Read] = []
    for file, samples in zip(files, read_samples(files, STANDING), strict=True):
        cycle, way = file.cycle, 0.0
        if not (cycle.steps or isinstance(samples, CampaignError)):
            # The samples are widely spaced, so that noise does not add to the length.
            position = samples.position_m[np.isfinite(samples.position_m)]
            way = float(np.abs(np.diff(position[:: max(position.size // SAMPLES_OF_WAY, 1)])).sum())
        found.append((way, read_or_skip(read, file, samples) if cycle.kind in (*SLIDING, *STANDING) else None))
    return found


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
        used = {way: tuple(s for s in side.used if id(s) in kept) for way, side in level.sides.items()}
        balance = {way: stroke_rows(result, strokes, grid) for way, strokes in used.items() if strokes}
        ways = [way for way, values in balance.items() if np.isfinite(values).any()]
        if not ways:
            continue
        sides = {way: replace(level.sides[way], used=used[way]) for way in ways}
        a, b = (recording.ambient_pressure_pa + float(pressures[side][i]) for side in "ab")
        plan = {
            "key": recording.name if len(result.levels) == 1 else f"{recording.name}#{level.index + 1}",
            "index": i + 1,
            "block": runs.index(level.run) + 1,
            "condition": Condition(a, b, **{name: recording.labels.get(name, "") for name in LEVELS}),
            "flags": dict(recording.flags),
        }
        rows.append(plan | cycles.cycle_row(result, grid, sides, balance))
    return CampaignData(
        name="recordings",
        source=next((r.source.parent for r in found.recordings if r.source is not None), Path()),
        identity=Identity(name="recordings", **{field: getattr(found.recordings[0], field) for field in SHARED}),
        sliding=cycles.CycleTable.of(rows, BINS),
        tares=cycles.CycleTable.of([], BINS),
        skipped=tuple(Skipped(key, "", why) for key, why in found.skipped),
        edges_m=edges,
        several=len(runs) > 1,
    )
