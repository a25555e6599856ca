"""Sources of a replay: a campaign folder, foreign files with a layout, or a rig file that names them.

This module is in a layer above `pneudrive.rig` because it reads campaign folders. The registry of rigs has its name.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from pneudrive.campaign.replay import ReplayRig, ReplaySource, Tolerance
from pneudrive.campaign.storage.folder import ABOUT, CYCLES, TRUTH, Campaign
from pneudrive.constants import ANR_TEMPERATURE_K
from pneudrive.describe.marks import Percent
from pneudrive.describe.quantities import Bounds, Quantity
from pneudrive.errors import RecordingError, RigError
from pneudrive.files.content import read_json
from pneudrive.rig.interface import SHARED, Envelope, Hold, Identity, Move, Samples
from pneudrive.rig.plain_data import envelope_of
from pneudrive.rig.rig_file import RigFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.campaign.storage.folder import CycleFile
    from pneudrive.rig.interface import Step
    from pneudrive.signals.load import RecordingFile
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

# Axis limits of a rig known only from recordings (assumed). A plan computes the ends of its ramps from them.
ASSUMED_ACCELERATION_M_S2, ASSUMED_JERK_M_S3 = 5.0, 200.0
ANY_TEMPERATURE_K = (0.0, 1000.0)
NO_LIMIT_N = 1e9
SAME_POSITION_M = 1e-3
STROKE_SLACK = 0.05  # allowed error of a stroke's end, share of the travel


class ReplayFile(RigFile):
    """The rig file of a replay: a folder of a campaign, or of recordings with a layout."""

    folder: str
    layout: str | None = None
    pattern: str = "*"
    speed_tolerance: Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=100.0))] = Tolerance.speed
    pressure_tolerance_pa: Annotated[float, Quantity("Pa", bounds=Bounds(at_least=0.0))] = Tolerance.pressure_pa


@dataclass(frozen=True)
class RecordedCycle(ReplaySource):
    """A cycle of a campaign folder; ``true`` is the file of its ground truth."""

    file: CycleFile
    true: Path

    @classmethod
    def of(cls, file: CycleFile, campaign: Campaign) -> RecordedCycle:
        """Make a recorded cycle from its header."""
        cycle, true = file.head.cycle, campaign.path / TRUTH / f"{file.name}.json"
        pressures = (cycle.pressure_a_pa, cycle.pressure_b_pa)
        return cls(file.name, cycle.key, cycle.steps, *pressures, file.head.began_s, dict(cycle.levels), file, true)

    def first_step(self, steps: Sequence[Step], tolerance: Tolerance) -> int | None:
        """Return 0 if the whole cycle matches, else None."""
        if not self.steps:
            return 0 if self._was_for(steps, tolerance) else None
        same = len(steps) == len(self.steps) and all(map(_like, steps, self.steps, [tolerance] * len(steps)))
        return 0 if same else None

    def _was_for(self, steps: Sequence[Step], tolerance: Tolerance) -> bool:
        """Return whether a cycle without steps matches by its purpose: longest stop, and speed after it."""
        cycle = self.file.head.cycle
        holds = [(step.duration_s, at) for at, step in enumerate(steps) if isinstance(step, Hold)]
        stop, at = max(holds, default=(0.0, 0)) if cycle.stop_s else (0.0, 0)
        moves = [step.speed_m_s for step in steps[at:] if isinstance(step, Move)]
        if not moves or cycle.speed_m_s is None or not _as_fast(moves[0], cycle.speed_m_s, tolerance):
            return False
        return bool(cycle.stop_s) == bool(holds) and abs(stop - (cycle.stop_s or 0.0)) <= tolerance.speed * stop

    def samples(self, first: int, steps: Sequence[Step]) -> Samples:
        """Read all samples of the cycle."""
        return self.file.samples()

    def range_m(self) -> tuple[float, float] | None:
        """Return the range of the moves, m; without moves in the header, the range of the samples."""
        if self.steps:
            return _range(self.steps)
        position = self.file.samples().position_m
        return float(np.nanmin(position)), float(np.nanmax(position))

    @property
    def speeds_m_s(self) -> list[float]:
        """Speeds of the moves; without moves in the header, the speed of the cycle."""
        speed = self.file.head.cycle.speed_m_s
        return super().speeds_m_s or ([speed] if speed else [])

    def truth(self) -> dict[str, Any]:
        """Read the ground truth of the cycle."""
        return read_json(self.true, RigError) if self.true.is_file() else {}


@dataclass(frozen=True)
class ForeignRecording(ReplaySource):
    """Strokes of a foreign file.

    Strokes are played from the first one in the requested direction. Their ends may differ by ``slack_m``.
    """

    file: RecordingFile
    slack_m: float

    @classmethod
    def of(cls, file: RecordingFile, recording: Recording, strokes: list[Stroke]) -> ForeignRecording:
        """Make recorded strokes from the samples of a recording."""
        steps = tuple(Move(stroke.to_m, abs(stroke.speed_m_s)) for stroke in strokes)
        pressures = (float(np.median(recording.pressure_a_pa)), float(np.median(recording.pressure_b_pa)))
        slack = max(STROKE_SLACK * float(np.ptp(recording.position_m)), SAME_POSITION_M)
        return cls(recording.name, "", steps, *pressures, 0.0, {}, file, slack)

    def first_step(self, steps: Sequence[Step], tolerance: Tolerance) -> int | None:
        """Return the first stroke with the ends and the speed of the moves."""
        moves = [step for step in steps if isinstance(step, Move)]
        if not moves or _stops_on_the_way(steps):
            return None
        strokes = [step for step in self.steps if isinstance(step, Move)]
        for first in range(min(2, len(strokes) - len(moves) + 1)):  # strokes alternate: the first or the second fits
            if all(
                abs(asked.to_m - stroke.to_m) <= self.slack_m and _as_fast(asked.speed_m_s, stroke.speed_m_s, tolerance)
                for asked, stroke in zip(moves, strokes[first:], strict=False)
            ):
                return first
        return None

    def samples(self, first: int, steps: Sequence[Step]) -> Samples:
        """Read one stroke for each move."""
        return _strokes_as(steps, first, *_strokes_of(self.file))

    def range_m(self) -> tuple[float, float] | None:
        """Return the range of the strokes, m."""
        return _range(self.steps)


def _strokes_of(file: RecordingFile) -> tuple[Recording, list[Stroke]]:
    from pneudrive.signals.motion import find_strokes
    from pneudrive.signals.samples import clean

    recording = clean(file.read())
    return recording, find_strokes(recording.name, recording.time_s, recording.position_m)


def _range(steps: Sequence[Step]) -> tuple[float, float] | None:
    ends = [step.to_m for step in steps if isinstance(step, Move)]
    return (min(ends), max(ends)) if len(ends) > 1 else None


def _strokes_as(steps: Sequence[Step], first: int, recording: Recording, strokes: list[Stroke]) -> Samples:
    """Return the samples of one stroke for each move, with the numbers of the requested steps."""
    moves = [index for index, step in enumerate(steps) if isinstance(step, Move)]
    played = strokes[first : first + len(moves)]
    rows = slice(played[0].start, played[-1].stop)
    step = np.full(rows.stop - rows.start, moves[0], dtype=np.int64)
    for index, stroke, before in zip(moves[1:], played[1:], played[:-1], strict=True):
        if isinstance(steps[index - 1], Hold):
            step[before.stop - rows.start :] = index - 1
        step[stroke.start - rows.start :] = index
    time = recording.time_s[rows]
    return Samples(
        time_s=time - time[0],
        position_m=recording.position_m[rows],
        force_n=recording.force_n[rows],
        pressure_a_pa=recording.pressure_a_pa[rows],
        pressure_b_pa=recording.pressure_b_pa[rows],
        temperature_k=np.full(time.size, ANR_TEMPERATURE_K),  # not measured
        step=step,
    )


def _like(asked: Step, recorded: Step, tolerance: Tolerance) -> bool:
    """Return whether a recorded step matches the requested step."""
    if isinstance(asked, Move) and isinstance(recorded, Move):
        near = abs(asked.to_m - recorded.to_m) <= SAME_POSITION_M
        return near and _as_fast(asked.speed_m_s, recorded.speed_m_s, tolerance)
    if isinstance(asked, Hold) and isinstance(recorded, Hold):
        same = (asked.released, asked.shut) == (recorded.released, recorded.shut)
        return same and abs(asked.duration_s - recorded.duration_s) <= tolerance.speed * asked.duration_s
    return False


def _as_fast(asked_m_s: float, recorded_m_s: float, tolerance: Tolerance) -> bool:
    return abs(asked_m_s - recorded_m_s) <= tolerance.speed * asked_m_s


def _stops_on_the_way(steps: Sequence[Step]) -> bool:
    """Return whether a hold is between moves of one direction, or at the start or end of the cycle."""
    for index, step in enumerate(steps):
        if not isinstance(step, Hold):
            continue
        before = [s for s in steps[:index] if isinstance(s, Move)]
        after = [s for s in steps[index:] if isinstance(s, Move)]
        if len(before) < 2 or not after:
            return len(before) != 1 or not after  # one move before: direction unknown, the axis turns
        if (before[-1].to_m > before[-2].to_m) == (after[0].to_m > before[-1].to_m):
            return True
    return False


def load_replay(source: str | Path, seed: int = 0, pace: float | None = None) -> ReplayRig:
    """Make a rig from a folder (campaign, or recordings with ``layout.toml``) or from a rig file that names one.

    Raises
    ------
    RigError, CampaignError, RecordingError, LayoutError
        With file, value, rule and remedy.
    """
    path = Path(source)
    if path.is_dir():
        return _folder_rig(path, pace, Tolerance())
    file = ReplayFile.load(path)
    folder = file.beside(file.folder) or Path()
    layout = file.beside(file.layout)
    tolerance = Tolerance(speed=file.speed_tolerance, pressure_pa=file.pressure_tolerance_pa)
    if layout is None and (folder / ABOUT).is_file():
        return campaign_rig(folder, pace, tolerance, *file.described())
    return recordings_rig(folder, layout, file.pattern, pace, tolerance, *file.described())


def _folder_rig(folder: Path, pace: float | None, tolerance: Tolerance) -> ReplayRig:
    if (folder / ABOUT).is_file():
        return campaign_rig(folder, pace, tolerance)
    if (folder / "layout.toml").is_file():
        return recordings_rig(folder, None, "*", pace, tolerance)
    raise RigError(
        f"{folder} holds neither a campaign nor recordings with a layout",
        rule=f"a campaign folder has {ABOUT} and {CYCLES}/, a folder of recordings has layout.toml",
        remedy='Or name folder, layout and pattern in a rig file with kind = "replay"',
    )


def campaign_rig(
    folder: Path,
    pace: float | None = None,
    tolerance: Tolerance | None = None,
    identity: Identity | None = None,
    limits: Envelope | None = None,
) -> ReplayRig:
    """Make a rig from a campaign folder, with the limits of the original rig if the folder states them.

    Raises
    ------
    RigError, CampaignError
        If it is not a campaign, or has no finished cycle.
    """
    campaign = Campaign.open(folder)
    sources = [RecordedCycle.of(file, campaign) for file in campaign.cycles() if file.head.cycle.kind != "operator"]
    if not sources:
        raise RigError("the campaign has no finished cycle to play", where=str(folder))
    identity = identity or campaign.identity
    envelope = campaign.about.get("envelope")
    limits = limits or (envelope_of(envelope, str(folder / ABOUT)) if envelope else _envelope(sources, identity))
    return ReplayRig(sources, identity, limits, pace, tolerance)


def recordings_rig(
    folder: Path,
    layout: Path | None = None,
    pattern: str = "*",
    pace: float | None = None,
    tolerance: Tolerance | None = None,
    identity: Identity | None = None,
    limits: Envelope | None = None,
) -> ReplayRig:
    """Make a rig from foreign recordings: each has one speed and pressure, and its strokes are played.

    Parameters
    ----------
    folder : Path
    layout : Path, optional
        How they are read. Default: ``layout.toml`` in the folder.
    pattern : str
        Pattern of the file names.
    pace, tolerance
        As for `ReplayRig`.
    identity, limits : Identity, Envelope, optional
        Replace those from layout and recordings.

    Raises
    ------
    RigError, RecordingError, LayoutError
        The file does not exist or cannot be read, or the drives differ.
    """
    from pneudrive.signals.load import recording_files

    paths = sorted(p for p in folder.glob(pattern) if p.is_file() and p.suffix != ".toml")
    if not paths:
        raise RigError(f"there is no recording {pattern} in {folder}")
    sources, first = [], None
    for file in recording_files(paths, layout):
        recording, strokes = _strokes_of(file)
        first = first or recording
        if (recording.area_a_m2, recording.area_b_m2) != (first.area_a_m2, first.area_b_m2):
            what = f"{recording.name} and {first.name} are from drives of different size"
            raise RigError(what, where=str(folder), remedy="Choose recordings of one drive by `pattern` in a rig file")
        sources.append(ForeignRecording.of(file, recording, strokes))
    assert first is not None, "there is a file"
    identity = identity or _identity(folder, first)
    return ReplayRig(sources, identity, limits or _envelope(sources, identity), pace, tolerance)


def _identity(folder: Path, recording: Recording) -> Identity:
    return Identity(
        name=f"Recordings {folder.resolve().name}",
        **{name: getattr(recording, name) for name in SHARED},
        stiffness_n_m=recording.stiffness_n_m,
        accuracy=dict(recording.accuracy),
        limits=dict(recording.limits),
        calibration={**recording.calibration, "temperature_k": "assumed, because this was not measured"},
        labels={key: text for key, text in recording.labels.items() if key not in ("run", "pressure")},
        synthetic=recording.synthetic,
        force_calibration=recording.force_calibration,
    )


def _envelope(sources: Sequence[ReplaySource], identity: Identity) -> Envelope:
    """Return the limits of a rig that is known only from recordings: the range that all recordings cover."""
    spans = [span for source in sources if (span := source.range_m()) is not None]
    speeds = [speed for source in sources for speed in source.speeds_m_s]
    if not spans:
        raise RigError("no recording moves in both directions", rule="the range of the axis is unknown then")
    # Files of a campaign share the axis. Foreign files differ in their strokes, and a plan must fit into all.
    foreign = isinstance(sources[0], ForeignRecording)
    low = (max if foreign else min)(span[0] for span in spans)
    high = (min if foreign else max)(span[1] for span in spans)
    if not low < high:
        raise RecordingError("the recordings do not share a range of positions", rule="the strokes overlap")
    pressures = [pressure for one in sources for pressure in (one.pressure_a_pa, one.pressure_b_pa)]
    force = identity.limits.get("force_n", (-NO_LIMIT_N, NO_LIMIT_N))
    return Envelope(
        position_m=(low, high),
        speed_m_s=max(speeds, default=0.0) * (1.0 + Tolerance.speed),
        acceleration_m_s2=ASSUMED_ACCELERATION_M_S2,
        jerk_m_s3=ASSUMED_JERK_M_S3,
        force_n=min(map(abs, force)),
        pressure_pa=(min(*pressures, identity.ambient_pressure_pa), max(pressures) + Tolerance.pressure_pa),
        separate_pressures=True,
        temperature_k=ANY_TEMPERATURE_K,
        home_m=low,
    )
