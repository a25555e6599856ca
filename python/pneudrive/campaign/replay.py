"""Rig that replays a campaign folder. For each cycle it plays the matching recording.

This module is in a layer above `pneudrive.rig`, because it reads campaign folders. The registry
`pneudrive.rig.rig_file.LOADERS` refers to it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Annotated, Any

import numpy as np

from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.storage.folder import ABOUT, Campaign, CycleFile
from pneudrive.describe.marks import NOT_NEGATIVE, Accuracy, Quantity
from pneudrive.errors import RigError
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, RigState, Samples, Sampling, Step, envelope_of
from pneudrive.rig.motion import in_parts, keep_pace
from pneudrive.rig.rig_file import RigFile

SHOWN = 6
SAME_POSITION_M = 1e-3
# Default tolerances between a request and its recording: relative for speeds and stops, Pa for pressures.
SPEED_TOLERANCE, PRESSURE_TOLERANCE_PA = 0.05, 2000.0


def matches(steps: Sequence[Step], cycle: Cycle, tolerance: float) -> bool:
    """Return whether steps match recorded ones: speeds and durations differ at most by the fraction `tolerance`.

    If the recorded cycle lists no steps, compare the longest stop and the speed after it.
    """

    def near(asked: float, recorded: float) -> bool:
        return abs(asked - recorded) <= tolerance * asked

    def alike(asked: Step, recorded: Step) -> bool:
        if isinstance(asked, Move) and isinstance(recorded, Move):
            return abs(asked.to_m - recorded.to_m) <= SAME_POSITION_M and near(asked.speed_m_s, recorded.speed_m_s)
        if isinstance(asked, Hold) and isinstance(recorded, Hold):
            same_axis = (asked.released, asked.shut) == (recorded.released, recorded.shut)
            return same_axis and near(asked.duration_s, recorded.duration_s)
        return False

    if cycle.steps:
        return len(steps) == len(cycle.steps) and all(map(alike, steps, cycle.steps))
    holds = ((step.duration_s, at) for at, step in enumerate(steps) if isinstance(step, Hold))
    stop_s, at = max(holds, default=(0.0, 0))
    moves = moves_of(steps[at:])
    same_stop = near(stop_s, cycle.stop_s or 0.0)
    return same_stop and bool(moves) and near(moves[0].speed_m_s, cycle.speed_m_s or np.inf)


def moves_of(steps: Sequence[Step]) -> list[Move]:
    """Return the moves among the steps of a cycle."""
    return [step for step in steps if isinstance(step, Move)]


def speeds_of(cycle: Cycle) -> list[float]:
    """Return the speeds of the moves of a cycle in m/s. If the header lists no moves, return the speed of the cycle."""
    return [move.speed_m_s for move in moves_of(cycle.steps)] or ([cycle.speed_m_s] if cycle.speed_m_s else [])


class ReplayRig:
    """A rig that plays recordings. It implements `Rig`, `Reproducible` and `Changeable`.

    Parameters
    ----------
    files : sequence of CycleFile
        Recorded cycles of a campaign.
    identity : Identity
    limits : Envelope
    pace : float, optional
        Seconds of the recording per second of wall-clock time; None: as fast as possible.
    file : ReplayFile
        Rig file with the tolerances between a cycle and its recording.

    Notes
    -----
    `acquire` plays the recording at the selected levels whose steps and pressures match the request within the
    tolerances. If several recordings match, it takes the one whose key `begin_cycle` announced, otherwise the one
    played least often.
    """

    def __init__(
        self,
        files: Sequence[CycleFile],
        identity: Identity,
        limits: Envelope,
        pace: float | None,
        file: ReplayFile,
    ) -> None:
        self.files, self.pace, self.file = tuple(files), pace, file
        self._identity, self._limits = identity, limits
        self._played = dict.fromkeys((file.name for file in files), 0)
        self._key = ""
        self._levels: dict[str, str] = {}
        self._halted = threading.Event()
        ambient = identity.ambient_pressure_pa
        supply = max(limits.supply_pressure_pa, ambient)
        self._state = RigState(limits.home_m, 0.0, ambient, ambient, supply, sum(limits.temperature_k) / 2.0, 0.0)

    def identity(self) -> Identity:
        """Return the identity of the recorded rig."""
        return self._identity

    def limits(self) -> Envelope:
        """Return the limits in the rig file; without them, return the limits of the recorded rig."""
        return self._limits

    def state(self) -> RigState:
        """Return the state at the end of the last playback."""
        return self._state

    def home(self) -> None:
        """Home the axis without playing a recording."""
        self._state = replace(self._state, position_m=self._limits.home_m)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Select recordings at these absolute pressures, in Pa."""
        self._state = replace(self._state, pressure_a_pa=a_pa, pressure_b_pa=b_pa)

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move the axis without playing a recording."""
        self.hold(abs(to_m - self._state.position_m) / speed_m_s)
        self._state = replace(self._state, position_m=to_m)

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Wait at rest without playing a recording."""
        self._halted.clear()
        keep_pace(self.pace, monotonic(), duration_s, self._halted)

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Play the recording that matches these steps, with its recorded sample times."""
        file = self._find(steps)
        self._played[file.name] += 1
        self._halted.clear()
        return self._play(file, file.samples())

    def stop(self) -> None:
        """Stop the playback, and vent both chambers."""
        self._halted.set()
        ambient = self._identity.ambient_pressure_pa
        self._state = replace(self._state, pressure_a_pa=ambient, pressure_b_pa=ambient, moving=False)

    def begin_cycle(self, key: str) -> None:
        """Prefer the recording with this key over other recordings that match."""
        self._key = key
        for file in self.files:
            if file.cycle.key == key:
                self._state = replace(self._state, time_s=file.head.began_s)

    def memory(self) -> dict[str, Any]:
        """Return how often each recording was played."""
        return {"played": dict(self._played)}

    def restore(self, memory: dict[str, Any]) -> None:
        """Restore how often each recording was played."""
        self._played.update(memory.get("played", {}))

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the levels of each factor, such as the mounting, in the recordings."""
        levels = [file.cycle.levels for file in self.files]
        factors = dict.fromkeys(factor for mounted in levels for factor in mounted)
        return {f: tuple(dict.fromkeys(mounted[f] for mounted in levels if f in mounted)) for f in factors}

    def change(self, levels: dict[str, str]) -> None:
        """Select recordings at these levels."""
        self._levels.update(levels)

    def _apart_pa(self, cycle: Cycle) -> float:
        """Return the larger difference between a pressure of a recorded cycle and the requested one, in Pa."""
        requested = self._state.pressure_a_pa, self._state.pressure_b_pa
        return float(np.max(np.abs(np.subtract(cycle.pressures_pa, requested))))

    def _find(self, steps: Sequence[Step]) -> CycleFile:
        """Return the recording to play. Without a suitable recording, the error lists the nearest ones."""

        def fits(cycle: Cycle) -> bool:
            is_mounted = all(cycle.levels.get(factor, level) == level for factor, level in self._levels.items())
            is_near = is_mounted and self._apart_pa(cycle) <= self.file.pressure_tolerance_pa
            return is_near and matches(steps, cycle, self.file.speed_tolerance)

        matching = [file for file in self.files if fits(file.cycle)]
        if matching:
            return min(matching, key=lambda file: (file.cycle.key != self._key, self._played[file.name]))
        moves = moves_of(steps)
        stop = max((step.duration_s for step in steps if isinstance(step, Hold)), default=0.0)
        wanted = moves[-1].speed_m_s if moves else 0.0

        def distance(file: CycleFile) -> tuple[float, float]:
            speeds = speeds_of(file.cycle)
            return self._apart_pa(file.cycle), min((abs(speed - wanted) for speed in speeds), default=np.inf)

        nearest = "; ".join(map(_described, sorted(self.files, key=distance)[:SHOWN]))
        asked = {"moves": len(moves), "speed": 1e3 * wanted, "stop": stop, "pressures": _bar(self._state)}
        asked |= {"percent": 100 * self.file.speed_tolerance, "mbar": self.file.pressure_tolerance_pa / 100}
        raise RigError.of("campaign.no-recording", where=self._key or None, nearest=nearest, **asked)

    def _play(self, file: CycleFile, samples: Samples) -> Iterator[Samples]:
        if not len(samples):
            return
        began = monotonic()
        start = samples.time_s[0]
        began_s = file.head.began_s
        duration = float(np.nanmax(samples.time_s) - start)
        self._state = replace(self._state, moving=True, time_s=began_s)
        try:
            for rows in in_parts(len(samples), duration, self.pace):
                part = samples.rows(rows)
                keep_pace(self.pace, began, float(part.time_s[-1] - start), self._halted)
                if self._halted.is_set():
                    raise RigError("the playback was stopped", where=file.name)
                shown = {name: float(getattr(part, name)[-1]) for name in ("position_m", "force_n", "temperature_k")}
                if not np.isfinite(shown["temperature_k"]):
                    shown["temperature_k"] = self._state.temperature_k
                self._state = replace(self._state, **shown, time_s=began_s + float(part.time_s[-1]))
                yield part
        finally:
            self._state = replace(self._state, moving=False)


def _bar(pressures: Cycle | RigState) -> str:
    return f"{pressures.pressure_a_pa / 1e5:.4g} and {pressures.pressure_b_pa / 1e5:.4g} bar abs"


def _described(file: CycleFile) -> str:
    """Describe a recorded cycle in words."""
    speeds = speeds_of(file.cycle)
    speed = f"{1e3 * np.median(speeds):.4g} mm/s" if speeds else "no move"
    return f"{file.name} ({speed}, {_bar(file.cycle)})"


class ReplayFile(RigFile):
    """Rig file of a replay: a campaign folder, and the tolerance between a cycle and its recording."""

    folder: str
    speed_tolerance: Accuracy = SPEED_TOLERANCE
    pressure_tolerance_pa: Annotated[float, Quantity("Pa", bounds=NOT_NEGATIVE)] = PRESSURE_TOLERANCE_PA


def load_replay(source: str | Path, seed: int, pace: float | None) -> ReplayRig:
    """Make a rig from a campaign folder, or from a rig file that names one.

    The limits come from the rig file. If it states no limits, they come from the recorded rig.

    Raises
    ------
    RigError, CampaignError
        If the folder or file is invalid, or neither states the limits. The message gives file, value, rule and remedy.
    """
    is_folder = Path(source).is_dir()
    file = ReplayFile(folder=str(source)) if is_folder else ReplayFile.load(source)
    folder = Path(source) if is_folder else file.beside(file.folder)
    identity, limits = file.described()
    if not (folder / ABOUT).is_file():
        raise RigError.of("campaign.not-replayed", folder=folder)
    campaign = Campaign.open(folder)
    files = [file for file in campaign.cycles() if file.cycle.kind != "operator"]
    if not files:
        raise RigError("the campaign has no finished cycle to play", where=folder)
    if limits is None:
        if not (envelope := campaign.about.get("envelope")):
            raise RigError.of("campaign.no-limits", where=folder / ABOUT)
        limits = envelope_of(envelope, str(folder / ABOUT))
    return ReplayRig(files, identity or campaign.identity, limits, pace, file)
