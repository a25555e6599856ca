"""The campaign folder: one Parquet file per cycle, written completely or not at all.

The list of files is the catalogue. `status_of` returns the progress of a campaign.

- ``campaign.toml``: the protocol as run
- ``campaign.json``: schema, name, seed, operator, labels, created, version
- ``rig.json``: the rig's identity and calibration (`pneudrive.rig.interface.Identity`)
- ``cycles/00001-KEY.parquet``: raw samples; the header of the cycle is JSON under the key "pneudrive" of its metadata

docs/reference/campaign-folder.md describes the format key by key.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Bools, Ints, Plain, attributes_of
from pneudrive.batching import many_objects
from pneudrive.campaign.cycle import SCHEMA, Cycle, Head, check_schema, read_head
from pneudrive.campaign.planning.preflight import Plan
from pneudrive.campaign.storage.control import FOLDER, PART, Holder, clear_errors, holder, make_folder, write_whole
from pneudrive.errors import CampaignError, PneudriveError, ProtocolError, RecordingError
from pneudrive.files.content import exists, read_json, read_text
from pneudrive.files.seal import sealed_parquet
from pneudrive.files.tables import read_columns, read_texts
from pneudrive.repr_tables import Card, Shown
from pneudrive.rig.interface import CHANNELS, SHARED, Identity, Move, Samples, envelope_of, identity_of, plain
from pneudrive.signals.motion import middle, noise_level
from pneudrive.signals.recording import Recording, clean, refuse_channels

#: Fraction of the usual speed below which the piston counts as at rest.
RESTS = 0.1
#: Two rests closer than this multiple of the position noise count as one.
SAME_PLACE = 10.0
#: Shortest and longest time over which the speed is averaged, s.
SPEED_WINDOW_S = (0.005, 2.0)
LEAST_SAMPLES = 20


def speed_of(time_s: Array, position_m: Array, speed_m_s: float) -> Array:
    """Return the signed speed in m/s, averaged over a time that suppresses the noise of the position (shape (n,))."""
    width = _window_s(position_m, speed_m_s)
    low = np.maximum(time_s - width / 2, time_s[0])
    high = np.minimum(time_s + width / 2, time_s[-1])
    ends = np.interp(high, time_s, position_m) - np.interp(low, time_s, position_m)
    return ends / np.maximum(high - low, 1e-12)


def _window_s(position_m: Array, speed_m_s: float) -> float:
    return float(np.clip(20.0 * max(noise_level(position_m), 1e-12) / max(speed_m_s, 1e-9), *SPEED_WINDOW_S))


def steps_from_motion(time_s: Array, position_m: Array, speed_m_s: float | None = None) -> Ints:
    """Return the number of the move or hold at each sample of a cycle.

    Parameters
    ----------
    time_s, position_m : ndarray, shape (n,)
        As recorded. A sample that is not finite or not in order of time takes the number of the sample before it.
    speed_m_s : float, optional
        Planned speed of the cycle. None: the usual speed is found from the motion.

    Returns
    -------
    ndarray of int64, shape (n,)
        0 for the first move or hold, plus 1 at each start, stop and reversal. All 0 without motion.
    """
    starts = np.zeros(time_s.size, dtype=np.int64)  # 1 where a move or hold begins
    usable = np.isfinite(time_s) & np.isfinite(position_m)
    usable[usable] = time_s[usable] >= np.maximum.accumulate(time_s[usable])
    time, position = time_s[usable], position_m[usable]
    noise = noise_level(position)
    if time.size < LEAST_SAMPLES or not time[-1] > time[0] or np.ptp(position) <= 20 * noise:
        return starts
    if not speed_m_s:
        mean = float(np.ptp(position)) / float(np.ptp(time))
        moving = np.abs(speed_of(time, position, mean))
        speed_m_s = middle(moving[moving > 0]) if (moving > 0).any() else 0.0
    speed, window_s = speed_of(time, position, speed_m_s), _window_s(position, speed_m_s)
    resting = np.abs(speed) < RESTS * speed_m_s
    for begin, end in _runs(resting, False):  # moves that are only noise of the position
        resting[begin:end] = abs(position[end] - position[begin - 1]) < SAME_PLACE * max(noise, 1e-12)
    for begin, end in _runs(resting, True):  # rests that are only the mean speed of a reversal
        resting[begin:end] = time[end] - time[begin] > window_s
    # At low speed, a reversal takes less than one sample: the sign changes without a rest.
    sign, moves = np.sign(speed), ~resting
    turns = (sign[1:] * sign[:-1] < 0) & moves[1:] & moves[:-1]
    starts[usable] = np.r_[0, turns | np.diff(resting)]
    return np.cumsum(starts)


def _runs(mask: Bools, value: bool) -> list[tuple[int, int]]:
    """Return begin and end of the runs of samples equal to `value`, without the first and the last run."""
    edges = (np.flatnonzero(np.diff(mask)) + 1).tolist()
    return [(begin, end) for begin, end in pairwise(edges) if mask[begin] == value]


HEAD = "pneudrive"
COLUMNS = (*CHANNELS, "step")
REQUIRED_COLUMNS = ("time_s", "position_m", "force_n")
CYCLES = "cycles"
PROTOCOL, ABOUT, RIG, LOG = "campaign.toml", "campaign.json", "rig.json", "campaign.log"
#: Ending of a damaged file that was put aside; its cycle is run again.
ASIDE = ".damaged"


@dataclass(frozen=True)
class Problem:
    """A problem of a campaign folder, or a note on it.

    Attributes
    ----------
    where : str
        File, within the folder.
    what : str
        Problem in words.
    lost : bool
        Whether the cycle cannot be used; otherwise this is a note.
    """

    where: str
    what: str
    lost: bool = True

    def __str__(self) -> str:
        """Return a description in one line."""
        return f"{self.where}: {self.what}"


@dataclass(frozen=True, repr=False)
class CycleFile(Shown):
    """A finished cycle on disk. ``sealed`` means that its checksum is correct."""

    path: Path
    head: Head
    sealed: bool = False

    @property
    def name(self) -> str:
        """Name of the file without its extension: index and key."""
        return self.path.stem

    @property
    def cycle(self) -> Cycle:
        """The cycle as run."""
        return self.head.cycle

    def samples(self) -> Samples:
        """Read the raw samples.

        Returns
        -------
        Samples
            As recorded. A missing pressure is replaced by the set pressure of the cycle. A missing temperature is NaN.
            Missing steps are derived from the motion.

        Raises
        ------
        CampaignError
            If the file is damaged or lacks a column.
        """
        (samples,) = read_samples([self])
        if isinstance(samples, CampaignError):
            raise samples
        return samples


def read_samples(
    files: Sequence[CycleFile], steps_of: Collection[str] | None = None
) -> Iterator[Samples | CampaignError]:
    """Read the raw samples of many files, see `CycleFile.samples`. For an unreadable file, yield the error.

    Parameters
    ----------
    files : sequence of CycleFile
    steps_of : collection of str, optional
        Kinds of cycles whose steps are needed; None: all. For other kinds, missing steps are -1, because deriving them
        from the motion takes longer than reading.
    """
    read = read_columns([file.path for file in files], COLUMNS, CampaignError)
    for file, columns in zip(files, read, strict=True):
        try:
            if isinstance(columns, PneudriveError):
                raise columns
            yield _samples(file, columns, steps_of is None or file.cycle.kind in steps_of)
        except CampaignError as error:  # noqa: PERF203 - each file has its own error
            yield error


def _samples(file: CycleFile, columns: dict[str, NDArray[Any]], derive: bool) -> Samples:
    """Make samples from a file's columns.

    Raises
    ------
    CampaignError
        If the columns are damaged, or one is missing.
    """
    where, channels = str(file.path), {}
    for name in (name for name in COLUMNS if name in columns):
        # Whole numbers with missing values were read as floats.
        kinds, rule = ("iu", "whole numbers, none missing") if name == "step" else ("iuf", "numbers in SI units")
        if columns[name].dtype.kind not in kinds:
            raise CampaignError(f"column {name} holds {columns[name].dtype}", where=where, rule=rule)
        channels[name] = np.array(columns[name], dtype=np.int64 if name == "step" else np.float64)
    if file.head.sha256 and file.head.sha256 != digest(channels):
        raise CampaignError("the samples are damaged: their SHA-256 differs from the one in the header", where=where)
    step = channels.pop("step", None)
    missing = [name for name in REQUIRED_COLUMNS if name not in channels]
    if missing:
        raise CampaignError(
            f"the file lacks the column {missing[0]}", where=where, rule="column names contain the SI unit"
        )
    cycle, count = file.cycle, channels["time_s"].size
    usual = {"pressure_a_pa": cycle.pressure_a_pa, "pressure_b_pa": cycle.pressure_b_pa, "temperature_k": np.nan}
    channels = {name: np.full(count, value) for name, value in usual.items()} | channels
    if step is None:
        motion = (channels["time_s"], channels["position_m"], cycle.speed_m_s)
        step = steps_from_motion(*motion) if derive else np.full(count, -1)
    return Samples(**channels, step=step)


LOST_SHARE = 0.5  # of a cycle's samples: largest share of damaged ones


def recording_of(file: CycleFile, identity: Identity, samples: Samples) -> tuple[Recording, dict[str, int]]:
    """Make a cleaned recording of a cycle; damaged samples are left out and counted by kind.

    Raises
    ------
    RecordingError
        If more than half of the samples are damaged, or if values are impossible.
    """
    name = file.cycle.key
    count = len(samples)
    flags = {kind: int(number) for kind, number in file.head.flags.items() if number}
    # Samples in the order of time. Repeated samples are dropped. If the clock jumped back, only the longest stretch
    # without a jump is kept.
    samples = samples.rows(np.isfinite(samples.time_s))
    time, force = samples.time_s, samples.force_n
    good = time >= np.maximum.accumulate(time)
    if not good.all():
        twin = np.searchsorted(time[good], time[~good])
        if np.any((time[good][twin] != time[~good]) | (force[good][twin] != force[~good])):
            stretches = np.split(np.arange(time.size), np.flatnonzero(np.diff(time) < 0.0) + 1)
            good = np.isin(np.arange(time.size), max(stretches, key=len))
        flags["time_backwards"] = int(np.sum(~good))
    # A released axis creeps by single counts: this is not a stuck sensor.
    stands = bool(file.cycle.steps) and not any(isinstance(step, Move) for step in file.cycle.steps)
    channels = {channel: getattr(samples, channel)[good] for channel in CHANNELS[:-1]}
    if stands and np.isfinite(position := channels["position_m"]).any():
        channels["position_m"] = np.full(position.size, float(np.nanmedian(position)))
    shared = attributes_of(identity, *SHARED)
    if (known := identity.force_calibration) is not None:
        channels["force_n"] = known.force_n(channels["force_n"])
        if "force_n" in identity.limits:
            low, high = known.force_n(np.array(identity.limits["force_n"])).tolist()
            shared["limits"] = identity.limits | {"force_n": (low, high)}
    labels = dict(file.cycle.levels)
    recording = clean(Recording(name=name, **channels, **shared, labels=labels, source=file.path))
    if len(recording) < (1.0 - LOST_SHARE) * count:
        found = ", ".join(f"{kind} {number}" for kind, number in {**flags, **recording.flags}.items())
        raise RecordingError("more than half of the samples are damaged", where=name, value=f"{found} of {count}")
    refuse_channels(recording)
    for kind, number in recording.flags.items():
        if kind != "gap":  # bursts are denser than the rest: the length of an interval means nothing
            flags[kind] = max(flags.get(kind, 0), number)
    return recording, flags


def steps_of(recording: Recording, samples: Samples) -> Ints:
    """Return the step of the cycle to which each cleaned sample belongs."""
    order = np.argsort(samples.time_s, kind="stable")
    place = np.searchsorted(samples.time_s[order], recording.time_s)
    return samples.step[order[np.minimum(place, order.size - 1)]]


def digest(columns: dict[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of the present columns: little-endian bytes, in the order of `COLUMNS`."""
    total = hashlib.sha256()
    for name in COLUMNS:
        if name in columns:
            total.update(np.ascontiguousarray(columns[name], dtype="<i8" if name == "step" else "<f8").tobytes())
    return total.hexdigest()


def file_name(index: int, key: str) -> str:
    """Return the name of a cycle's file without its extension."""
    return f"{index:05d}-{re.sub(r'[^A-Za-z0-9.+-]+', '_', key)[:150]}"


def write_cycle(folder: Path, head: Head, samples: Samples) -> Path:
    """Write one cycle under a temporary name, flush and rename it, so that it exists completely or not at all.

    Parameters
    ----------
    folder : Path
        Folder of the campaign.
    head : Head
        Header of the cycle. This function fills in its ``sha256``.
    samples : Samples
        Empty for an operator's step.

    Raises
    ------
    CampaignError
        If the cycle exists already, or cannot be written.
    """
    import polars as pl

    target = folder / CYCLES / f"{file_name(head.index, head.cycle.key)}.parquet"
    if target.exists():
        raise CampaignError("the cycle exists already and is not written again", where=target)
    make_folder(target.parent)
    head = replace(head, sha256=digest(vars(samples)))
    write_whole(target, sealed_parquet(pl.DataFrame(vars(samples)), {HEAD: head.to_json()}))
    return target


@dataclass(frozen=True, repr=False)
class Campaign(Shown):
    """A campaign folder, opened for reading.

    Attributes
    ----------
    path : Path
    identity : Identity
        The rig.
    about : dict
        ``campaign.json``.
    notes : tuple of str
        Unknown keys of ``rig.json``, which are ignored.
    """

    path: Path
    identity: Identity
    about: Plain
    notes: tuple[str, ...] = ()

    @classmethod
    def open(cls, path: str | Path) -> Campaign:
        """Open a campaign folder.

        Raises
        ------
        CampaignError
            The folder is not a campaign.
        """
        folder = Path(path)
        missing = [name for name in (RIG, ABOUT) if not exists(folder / name)]
        if missing:
            raise CampaignError.of("campaign.no-campaign", where=folder, missing=missing[0], folder=folder)
        if exists(folder / CYCLES) and not (folder / CYCLES).is_dir():
            raise CampaignError.of("campaign.no-cycles", where=folder / CYCLES)
        rig = read_json(folder / RIG, CampaignError)
        about = read_json(folder / ABOUT, CampaignError)
        if not isinstance(about, dict):
            raise CampaignError("this is not a JSON object", where=folder / ABOUT)
        check_schema(about.get("schema"), str(folder / ABOUT))
        identity, notes = identity_of(rig, str(folder / RIG), CampaignError)
        return cls(folder, identity, about, tuple(notes))

    def _card(self) -> Card:
        """Return the notebook view: rig and progress."""
        title = f"{self.about.get('name', self.path.name)} ({'simulated' if self.synthetic else 'measured'})"
        texts = {"folder": str(self.path), "rig": self.identity.name, "cycles on disk": str(len(self.files()))}
        return Card(title, rows=list(texts.items()), notes=self.notes)

    @property
    def protocol(self) -> str:
        """Text of the protocol as run; empty if the folder has none."""
        path = self.path / PROTOCOL
        return read_text(path, CampaignError) if exists(path) else ""

    @property
    def synthetic(self) -> bool:
        """Whether the rig was simulated."""
        return bool(self.about.get("synthetic", False)) or self.identity.synthetic

    def files(self) -> list[Path]:
        """Return the files of finished cycles, including damaged ones, in the order of their names."""
        # Sorted by name as text: comparing paths takes ten times as long.
        return sorted((self.path / CYCLES).glob("*.parquet"), key=lambda path: path.name)

    def scan(self) -> tuple[list[CycleFile], list[Problem]]:
        """Read the headers of all finished cycles.

        Returns
        -------
        list of CycleFile, list of Problem
            The usable cycles in running order, and the problems of the others: a file is damaged, incomplete or
            foreign, or repeats the cycle of an earlier file.
        """
        found: list[CycleFile] = []
        problems = [Problem(RIG, note, lost=False) for note in self.notes]
        paths = self.files()
        with many_objects():
            for path, read in zip(paths, read_texts(paths, HEAD, CampaignError), strict=True):
                where = f"{CYCLES}/{path.name}"
                try:
                    if isinstance(read, PneudriveError):
                        raise read
                    text, is_sealed = read
                    if text is None:
                        raise CampaignError.of("campaign.no-header", where=path, head=HEAD)
                    number, _, key = path.stem.partition("-")
                    head, notes = read_head(text, str(path), int(number) if number.isdigit() else None, key)
                except CampaignError as error:
                    problems.append(Problem(where, _one_line(error)))
                    continue
                problems += [Problem(where, note, lost=False) for note in notes]
                found.append(CycleFile(path, head, is_sealed))
        found.sort(key=lambda file: file.head.index)  # equal indices stay in the order of their names
        unique: dict[str, CycleFile] = {}
        for file in found:
            key = file.cycle.key
            if (first := unique.setdefault(key, file)) is not file:
                problems.append(Problem(f"{CYCLES}/{file.path.name}", f"cycle {key!r} is in {first.path.name} already"))
        return list(unique.values()), problems

    def cycles(self) -> Iterator[CycleFile]:
        """Return the usable finished cycles in running order. `scan` lists the problems of the others."""
        yield from self.scan()[0]

    def checked(self) -> tuple[list[CycleFile], list[Problem]]:
        """Check every file to its last sample, by checksum or by reading.

        Returns
        -------
        list of CycleFile, list of Problem
            As from `scan`.
        """
        files, problems = self.scan()
        foreign = [file for file in files if not file.sealed]
        damaged = {
            file.path: Problem(f"{CYCLES}/{file.path.name}", _one_line(samples))
            for file, samples in zip(foreign, read_samples(foreign), strict=True)
            if isinstance(samples, CampaignError)
        }
        return [file for file in files if file.path not in damaged], [*problems, *damaged.values()]


def _one_line(error: CampaignError) -> str:
    parts = [error.what.rstrip("."), *(str(part) for part in (error.value, error.rule) if part)]
    return "; ".join(parts)


def create(folder: Path, protocol: str, identity: Identity, about: Plain) -> Campaign:
    """Create a campaign folder. ``campaign.json`` is written last, so a folder with this file is complete.

    Raises
    ------
    CampaignError
        If the folder has other content, or cannot be written.
    """
    make_folder(folder)

    # A process that was killed while it created the folder leaves some of these.
    own = {PROTOCOL, RIG, ABOUT, LOG, CYCLES, FOLDER}
    foreign = [p.name for p in folder.iterdir() if p.name.removesuffix(PART) not in own and p.suffix != ".lock"]
    if foreign or any((folder / CYCLES).glob("*")):
        raise CampaignError.of("campaign.not-empty", where=folder, value=", ".join(sorted(foreign)[:5]) or CYCLES)
    make_folder(folder / CYCLES)
    write_whole(folder / PROTOCOL, protocol.encode())
    write_whole(folder / RIG, json.dumps(identity.to_dict(), indent=2, default=plain).encode())
    write_whole(folder / ABOUT, json.dumps({"schema": SCHEMA, **about}, indent=2, default=plain).encode())
    return Campaign.open(folder)


def tidy(campaign: Campaign) -> tuple[list[CycleFile], list[str]]:
    """Prepare a folder for resuming: remove incomplete files of a killed process, and rename damaged cycles.

    Returns
    -------
    list of CycleFile, list of str
        The finished cycles, and the actions in words.

    Raises
    ------
    CampaignError
        If the folder cannot be written to.
    """
    done = []
    for folder in (campaign.path, campaign.path / CYCLES):
        for path in sorted(folder.glob(f"*{PART}")):
            with clear_errors("the campaign folder cannot be tidied", path):
                path.unlink()
            done.append(f"removed {path.name}: it was incomplete")
    files, problems = campaign.checked()
    for problem in problems:
        if problem.lost and problem.where.startswith(f"{CYCLES}/"):
            path = campaign.path / problem.where
            with clear_errors("the campaign folder cannot be tidied", path):
                names = (path.with_name(f"{path.name}{ASIDE}{n or ''}") for n in range(10_000))
                path.replace(next(name for name in names if not name.exists()))
            done.append(f"put aside {problem}")
    return files, done


def plan_of(campaign: Campaign, *, checked: bool = True) -> Plan:
    """Compute the plan of a campaign folder again from its protocol and rig.

    Parameters
    ----------
    campaign : Campaign
    checked : bool
        Whether to check the plan against the limits of the rig, which is not needed to count cycles.

    Raises
    ------
    CampaignError
        If the folder has no plan, because another program wrote it.
    ProtocolError
        If the plan exceeds the limits of the rig.
    """
    text, limits = campaign.protocol, campaign.about.get("envelope")
    if not text or not isinstance(limits, dict):
        raise CampaignError.of("campaign.no-plan", where=campaign.path)
    from pneudrive.campaign.planning.plan import draft, lay_out
    from pneudrive.campaign.planning.protocol import parse_protocol

    protocol = parse_protocol(text, str(campaign.path / PROTOCOL))
    envelope = envelope_of(limits, str(campaign.path / ABOUT), CampaignError)
    return (lay_out if checked else draft)(protocol, campaign.identity, envelope)


# --- Progress of a campaign, and preliminary friction of its finished cycles.


@dataclass(frozen=True, repr=False)
class Status(Shown):
    """Progress of a campaign.

    Attributes
    ----------
    campaign : Campaign
    files : tuple of CycleFile
        Finished cycles.
    planned : int or None
        Number of cycles in the plan; None if the folder holds no plan.
    extra : int
        Number of finished cycles that the plan does not list, from an adaptive campaign of an earlier version.
    remaining_s : float or None
        Remaining time on the rig's clock.
    flags : dict
        Flag -> number of cycles with it.
    problems : tuple of Problem
    holder : Holder or None
        Process that works on the campaign now.
    """

    campaign: Campaign
    files: tuple[CycleFile, ...]
    planned: int | None
    extra: int
    remaining_s: float | None
    flags: dict[str, int]
    problems: tuple[Problem, ...]
    holder: Holder | None

    @property
    def to_do(self) -> int | None:
        """Planned cycles that are not finished."""
        return None if self.planned is None else self.planned - (len(self.files) - self.extra)


def status_of(folder: str | Path) -> Status:
    """Return the status of a campaign folder. The campaign may be running. Every file is checked by its checksum.

    A note in `problems` counts the files from other programs, which have no checksum. `pneudrive characterise` checks
    these files.

    Raises
    ------
    CampaignError
        If the folder is not a campaign.
    """
    campaign = Campaign.open(folder)
    files, problems = campaign.scan()
    foreign = sum(not file.sealed for file in files)
    if foreign:
        note = f"{foreign} of {len(files)} files have no checksum; `pneudrive characterise` checks their samples"
        problems.append(Problem(CYCLES, note, lost=False))
    done = {file.cycle.key for file in files}
    planned, remaining, extra = None, None, 0
    with suppress(CampaignError, ProtocolError):  # written by another program: no plan is known
        plan = plan_of(campaign, checked=False)  # it was before the first cycle
        keys = {cycle.key for cycle in plan.cycles}
        planned, remaining, extra = len(keys), plan.remaining_s(done), len(done - keys)
    flags = Counter(flag for file in files for flag, count in file.head.flags.items() if count)
    return Status(
        campaign, tuple(files), planned, extra, remaining, dict(flags), tuple(problems), holder(campaign.path)
    )


def preliminary_frictions(sweeps: Sequence[CycleFile], identity: Identity) -> list[float]:
    """Return the mean friction of each sweep, in N; NaN if its samples do not suffice.

    Raises
    ------
    CampaignError
        If a file is damaged.
    """
    from pneudrive.friction.level import extract
    from pneudrive.friction.strokes import Settled

    frictions = []
    for file, samples in zip(sweeps, read_samples(sweeps), strict=True):
        if isinstance(samples, CampaignError):
            raise samples
        speed = file.cycle.speed_m_s or 0.0
        try:
            recording, _ = recording_of(file, identity, samples)
            levels = extract(recording, Settled()).levels
            frictions.append(min(levels, key=lambda level: abs(level.speed_m_s - speed)).friction_n)
        except RecordingError:
            frictions.append(np.nan)
    return frictions
