"""Where a replay's recordings come from: a campaign's folder, foreign files with a layout, a rig file that names them.

It stands above `pneudrive.rig`, whose registry names it, because it reads campaign folders.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from pneudrive.campaign.folder import ABOUT, CYCLES, TRUTH, Campaign
from pneudrive.campaign.replay import SAME_POSITION_M, ReplayRig, Take, Tolerance
from pneudrive.constants import ANR_TEMPERATURE_K
from pneudrive.describe.base import Bounds, Quantity
from pneudrive.describe.marks import Percent
from pneudrive.errors import RecordingError, RigError
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, Samples
from pneudrive.rig.plain_data import envelope_of
from pneudrive.rig.rig_file import RigFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.characterise.load import RecordingFile
    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording
    from pneudrive.rig.interface import Step

# Of a rig of which only recordings are known (assumed): they decide where a plan expects its ramps to end.
ASSUMED_ACCELERATION_M_S2, ASSUMED_JERK_M_S3 = 5.0, 200.0
ANY_TEMPERATURE_K = (0.0, 1000.0)
NO_LIMIT_N = 1e9
STROKE_SLACK = 0.05  # share of the travel by which a stroke may end elsewhere


class ReplayFile(RigFile):
    """The rig file of a replay: a folder of a campaign, or of recordings with a layout."""

    folder: str
    layout: str | None = None
    pattern: str = "*"
    speed_tolerance: Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=100.0))] = Tolerance.speed
    pressure_tolerance_pa: Annotated[float, Quantity("Pa", bounds=Bounds(at_least=0.0))] = Field(
        default=Tolerance.pressure_pa, alias="pressure_tolerance"
    )


def load_replay(source: str | Path, seed: int = 0, pace: float | None = None) -> ReplayRig:
    """Make a rig of a folder (a campaign's, or of recordings with ``layout.toml``) or of a rig file that names one.

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
        rule=f"a campaign's folder has {ABOUT} and {CYCLES}/, one of recordings has layout.toml",
        remedy='a rig file with kind = "replay" can name folder, layout and pattern',
    )


def campaign_rig(
    folder: Path,
    pace: float | None = None,
    tolerance: Tolerance | None = None,
    identity: Identity | None = None,
    limits: Envelope | None = None,
) -> ReplayRig:
    """Make a rig of a campaign's folder; it has the limits of the original where the folder tells them.

    Raises
    ------
    RigError, CampaignError
        It is not a campaign, or has no finished cycle.
    """
    campaign = Campaign.open(folder)
    takes = []
    for file in campaign.cycles():
        cycle = file.head.cycle
        if cycle.kind == "operator":
            continue
        takes.append(
            Take(
                name=file.name,
                key=cycle.key,
                steps=cycle.steps,
                pressure_a_pa=cycle.pressure_a_pa,
                pressure_b_pa=cycle.pressure_b_pa,
                read=lambda _first, _steps, file=file: file.samples(),
                began_s=file.head.began_s,
                levels=dict(cycle.levels),
                speed_m_s=cycle.speed_m_s,
                stop_s=cycle.stop_s,
                truth=campaign.path / TRUTH / f"{file.name}.json",
            )
        )
    if not takes:
        raise RigError("the campaign has no finished cycle to play", where=str(folder))
    identity = identity or campaign.identity
    told = campaign.about.get("envelope")
    limits = limits or (envelope_of(told, str(folder / ABOUT)) if told else _envelope(takes, identity))
    return ReplayRig(takes, identity, limits, pace, tolerance)


def recordings_rig(
    folder: Path,
    layout: Path | None = None,
    pattern: str = "*",
    pace: float | None = None,
    tolerance: Tolerance | None = None,
    identity: Identity | None = None,
    limits: Envelope | None = None,
) -> ReplayRig:
    """Make a rig of foreign recordings: each is one speed and pressure, its strokes are played.

    Parameters
    ----------
    folder : Path
    layout : Path, optional
        How they are read; ``layout.toml`` in the folder where absent.
    pattern : str
        Which files of the folder.
    pace, tolerance
        As for `ReplayRig`.
    identity, limits : Identity, Envelope, optional
        Instead of what layout and recordings tell.

    Raises
    ------
    RigError, RecordingError, LayoutError
        No file, one that cannot be read, or recordings of different drives.
    """
    from pneudrive.characterise.load import recording_files

    paths = sorted(p for p in folder.glob(pattern) if p.is_file() and p.suffix != ".toml")
    if not paths:
        raise RigError(f"there is no recording {pattern} in {folder}")
    takes, first = [], None
    for file in recording_files(paths, layout):
        recording, strokes = _recording(file)
        first = first or recording
        if (recording.area_a_m2, recording.area_b_m2) != (first.area_a_m2, first.area_b_m2):
            what = f"{recording.name} and {first.name} are of drives of different size"
            raise RigError(what, where=str(folder), remedy="choose those of one drive by `pattern` in a rig file")
        takes.append(_take(file, recording, strokes))
    assert first is not None, "there is a file"
    identity = identity or _identity(folder, first)
    return ReplayRig(takes, identity, limits or _envelope(takes, identity), pace, tolerance)


def _recording(file: RecordingFile) -> tuple[Recording, list[Stroke]]:
    from pneudrive.characterise.motion import find_strokes
    from pneudrive.characterise.samples import clean

    recording = clean(file.read())
    return recording, find_strokes(recording.name, recording.time_s, recording.position_m)


def _take(file: RecordingFile, recording: Recording, strokes: list[Stroke]) -> Take:
    def read(first: int, steps: Sequence[Step]) -> Samples:
        return _strokes_as(steps, first, *_recording(file))

    return Take(
        name=recording.name,
        key="",
        steps=tuple(Move(stroke.to_m, abs(stroke.speed_m_s)) for stroke in strokes),
        pressure_a_pa=float(np.median(recording.pressure_a_pa)),
        pressure_b_pa=float(np.median(recording.pressure_b_pa)),
        read=read,
        foreign=True,
        slack_m=max(STROKE_SLACK * float(np.ptp(recording.position_m)), SAME_POSITION_M),
    )


def _strokes_as(steps: Sequence[Step], first: int, recording: Recording, strokes: list[Stroke]) -> Samples:
    """Give the samples of as many strokes as there are moves, numbered as the steps that were asked for."""
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


def _identity(folder: Path, recording: Recording) -> Identity:
    return Identity(
        name=f"Recordings {folder.resolve().name}",
        area_a_m2=recording.area_a_m2,
        area_b_m2=recording.area_b_m2,
        ambient_pressure_pa=recording.ambient_pressure_pa,
        mass_beyond_sensor_kg=recording.mass_beyond_sensor_kg,
        incline_rad=recording.incline_rad,
        stiffness_n_m=recording.stiffness_n_m,
        accuracy=dict(recording.accuracy),
        limits=dict(recording.limits),
        calibration={**recording.calibration, "temperature_k": "assumed: it was not measured"},
        labels={key: text for key, text in recording.labels.items() if key not in ("run", "pressure")},
        synthetic=recording.synthetic,
        force_calibration=recording.force_calibration,
    )


def _envelope(takes: Sequence[Take], identity: Identity) -> Envelope:
    """Limits of a rig of which only recordings are known: what all of them cover."""
    spans, speeds = [], []
    for take in takes:
        moves = [step for step in take.steps if isinstance(step, Move)]
        speeds += [move.speed_m_s for move in moves] or [take.speed_m_s or 0.0]
        if len(moves) > 1:
            spans.append((min(move.to_m for move in moves), max(move.to_m for move in moves)))
        elif not take.steps:
            position = take.read(0, ()).position_m
            spans.append((float(np.nanmin(position)), float(np.nanmax(position))))
    if not spans:
        raise RigError("no recording goes to and fro", rule="the range of the axis is not known then")
    # Files of a campaign share the axis; foreign ones each have strokes of their own, and a plan must fit into all.
    foreign = any(take.foreign for take in takes)
    low = (max if foreign else min)(span[0] for span in spans)
    high = (min if foreign else max)(span[1] for span in spans)
    if not low < high:
        raise RecordingError("the recordings do not share a range of positions", rule="the strokes overlap")
    pressures = [pressure for take in takes for pressure in (take.pressure_a_pa, take.pressure_b_pa)]
    force = identity.limits.get("force_n", (-NO_LIMIT_N, NO_LIMIT_N))
    return Envelope(
        position_m=(low, high),
        speed_m_s=max(speeds) * (1.0 + Tolerance.speed),
        acceleration_m_s2=ASSUMED_ACCELERATION_M_S2,
        jerk_m_s3=ASSUMED_JERK_M_S3,
        force_n=min(map(abs, force)),
        pressure_pa=(min(*pressures, identity.ambient_pressure_pa), max(pressures) + Tolerance.pressure_pa),
        separate_pressures=True,
        temperature_k=ANY_TEMPERATURE_K,
        home_m=low,
    )
