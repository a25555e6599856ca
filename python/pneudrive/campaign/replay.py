"""A rig that has been recorded: it plays the recording that is like what a cycle asks for."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RigError
from pneudrive.files.content import read_json
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, RigState, Samples, Sampling, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

PART_S = 0.1  # samples come in parts of this duration, on the clock on the wall
SAME_POSITION_M = 1e-3
SHOWN = 6


@dataclass(frozen=True)
class Tolerance:
    """How much a recording may differ from what is asked: relative for speeds and stops, Pa for pressures."""

    speed: float = 0.05
    pressure_pa: float = 2000.0


@dataclass(frozen=True)
class Take:
    """One recording that can be played.

    Attributes
    ----------
    name, key : str
        File; the campaign's key of it, "" where it is foreign.
    steps : tuple of Move and Hold
        What the axis did. Of a foreign recording: its strokes, played from the one whose direction is asked. Empty
        where a campaign's writer did not say them.
    pressure_a_pa, pressure_b_pa : float
    read : callable
        ``read(first, steps)`` gives the samples of these steps, from step ``first`` of the recording on.
    began_s : float
        The rig's clock at its beginning.
    levels : dict
        What was mounted.
    foreign : bool
    slack_m : float
        How far a foreign stroke may end from where a move is asked to end.
    speed_m_s, stop_s : float or None
        What a cycle without steps was for.
    truth : Path or None
        File that says what was true.
    """

    name: str
    key: str
    steps: tuple[Step, ...]
    pressure_a_pa: float
    pressure_b_pa: float
    read: Callable[[int, Sequence[Step]], Samples]
    began_s: float = 0.0
    levels: dict[str, str] = field(default_factory=dict)
    foreign: bool = False
    slack_m: float = SAME_POSITION_M
    speed_m_s: float | None = None
    stop_s: float | None = None
    truth: Path | None = None

    def first_step(self, steps: Sequence[Step], tolerance: Tolerance) -> int | None:
        """Give the step of this recording at which the asked ones begin; None where they are not in it."""
        if not self.foreign and not self.steps:
            return 0 if self._was_for(steps, tolerance) else None
        if not self.foreign:
            same = len(steps) == len(self.steps)
            return 0 if same and all(map(_like, steps, self.steps, [tolerance] * len(steps))) else None
        moves = [step for step in steps if isinstance(step, Move)]
        if not moves or _stops_on_the_way(steps):
            return None
        strokes = [step for step in self.steps if isinstance(step, Move)]
        for first in range(min(2, len(strokes) - len(moves) + 1)):  # strokes alternate: the first or the second fits
            part = strokes[first : first + len(moves)]
            if all(
                abs(asked.to_m - stroke.to_m) <= self.slack_m and _as_fast(asked.speed_m_s, stroke.speed_m_s, tolerance)
                for asked, stroke in zip(moves, part, strict=True)
            ):
                return first
        return None

    def _was_for(self, steps: Sequence[Step], tolerance: Tolerance) -> bool:
        """Whether a cycle of which only the purpose is known is the asked one: longest stop, speed of what follows."""
        holds = [(step.duration_s, at) for at, step in enumerate(steps) if isinstance(step, Hold)]
        stop, at = max(holds, default=(0.0, 0)) if self.stop_s else (0.0, 0)
        moves = [step.speed_m_s for step in steps[at:] if isinstance(step, Move)]
        if not moves or self.speed_m_s is None or not _as_fast(moves[0], self.speed_m_s, tolerance):
            return False
        return bool(self.stop_s) == bool(holds) and abs(stop - (self.stop_s or 0.0)) <= tolerance.speed * stop


class ReplayRig:
    """A rig that has been recorded: `Rig`, `Reproducible` and `Changeable`.

    Parameters
    ----------
    takes : sequence of Take
    identity : Identity
    limits : Envelope
    pace : float, optional
        Seconds of the recording per second on the wall; None: as fast as it goes.
    tolerance : Tolerance, optional

    Notes
    -----
    `acquire` plays the recording that is like what is asked: its steps, pressures and mounting within the tolerance. Of
    several that are, the one whose key was announced by `begin_cycle`, else the one that was played least often.
    """

    def __init__(
        self,
        takes: Sequence[Take],
        identity: Identity,
        limits: Envelope,
        pace: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> None:
        if not takes:
            raise RigError("there is no recording to play")
        self.takes, self.pace, self.tolerance = tuple(takes), pace, tolerance or Tolerance()
        self._identity, self._limits = identity, limits
        self._played = dict.fromkeys((take.name for take in takes), 0)
        self._key = ""
        self._levels: dict[str, str] = {}
        self._last: Take | None = None
        self._halted = threading.Event()
        ambient = identity.ambient_pressure_pa
        supply = max(limits.supply_pressure_pa, ambient)
        self._state = RigState(limits.home_m, 0.0, ambient, ambient, supply, sum(limits.temperature_k) / 2.0, 0.0)

    def identity(self) -> Identity:
        """Tell which rig was recorded."""
        return self._identity

    def limits(self) -> Envelope:
        """Tell what was recorded: the rig's own limits where they are known."""
        return self._limits

    def state(self) -> RigState:
        """Tell what was played last."""
        return self._state

    def home(self) -> None:
        """Go home; nothing is played."""
        self._state = replace(self._state, position_m=self._limits.home_m)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Ask for recordings at these absolute pressures, Pa."""
        self._state = replace(self._state, pressure_a_pa=a_pa, pressure_b_pa=b_pa)

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move without recording; nothing is played."""
        self._halted.clear()
        self._rest(abs(to_m - self._state.position_m) / speed_m_s)
        self._state = replace(self._state, position_m=to_m)

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Stand still without recording."""
        self._halted.clear()
        self._rest(duration_s)

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Play the recording that is like these steps, at the times at which it was sampled."""
        take, first = self._find(steps)
        self._played[take.name] += 1
        self._last = take
        self._halted.clear()
        return self._play(take, take.read(first, steps))

    def stop(self) -> None:
        """End what plays; ambient pressure is asked for next."""
        self._halted.set()
        ambient = self._identity.ambient_pressure_pa
        self._state = replace(self._state, pressure_a_pa=ambient, pressure_b_pa=ambient, moving=False)

    def begin_cycle(self, key: str) -> None:
        """Prefer the recording of this key, and take over its time."""
        self._key = key
        for take in self.takes:
            if take.key == key:
                self._state = replace(self._state, time_s=take.began_s)

    def memory(self) -> dict[str, Any]:
        """Give what was played how often."""
        return {"played": dict(self._played)}

    def restore(self, memory: dict[str, Any]) -> None:
        """Take back what was played how often."""
        self._played.update(memory.get("played", {}))

    def truth(self) -> dict[str, Any]:
        """Give what was true of the recording that was played last, where that is kept."""
        if self._last is None or self._last.truth is None or not self._last.truth.is_file():
            return {}
        return read_json(self._last.truth, RigError)

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Give what was mounted in the recordings."""
        factors = dict.fromkeys(factor for take in self.takes for factor in take.levels)
        return {f: tuple(dict.fromkeys(t.levels[f] for t in self.takes if f in t.levels)) for f in factors}

    def change(self, levels: dict[str, str]) -> None:
        """Ask for recordings with this mounted."""
        self._levels.update(levels)

    def _find(self, steps: Sequence[Step]) -> tuple[Take, int]:
        state, found = self._state, []
        for take in self.takes:
            asked = ((state.pressure_a_pa, take.pressure_a_pa), (state.pressure_b_pa, take.pressure_b_pa))
            if any(abs(want - have) > self.tolerance.pressure_pa for want, have in asked):
                continue
            if any(take.levels.get(factor, level) != level for factor, level in self._levels.items()):
                continue
            first = take.first_step(steps, self.tolerance)
            if first is not None:
                found.append((take, first))
        if not found:
            raise self._none_like(steps)
        return min(found, key=lambda pair: (pair[0].key != self._key, self._played[pair[0].name]))

    def _none_like(self, steps: Sequence[Step]) -> RigError:
        pressures = f"{self._state.pressure_a_pa / 1e5:.4g} and {self._state.pressure_b_pa / 1e5:.4g} bar abs"
        moves = [step for step in steps if isinstance(step, Move)]
        stop = max((step.duration_s for step in steps if isinstance(step, Hold)), default=0.0)
        wanted = moves[-1].speed_m_s if moves else 0.0

        def distance(take: Take) -> float:
            speeds = [step.speed_m_s for step in take.steps if isinstance(step, Move)]
            air = abs(take.pressure_a_pa - self._state.pressure_a_pa) + abs(
                take.pressure_b_pa - self._state.pressure_b_pa
            )
            return air / self.tolerance.pressure_pa + min(
                (abs(np.log(s / wanted)) for s in speeds if wanted), default=9
            )

        near = sorted(self.takes, key=distance)[:SHOWN]
        return RigError(
            f"no recording is like the cycle: {len(moves)} moves at {1e3 * wanted:.4g} mm/s, "
            f"longest stop {stop:.4g} s, chambers at {pressures}",
            where=self._key or None,
            value="nearest: " + "; ".join(_shown(take) for take in near),
            rule=f"the same steps, speeds within {100 * self.tolerance.speed:g} %, "
            f"pressures within {self.tolerance.pressure_pa / 100:g} mbar",
            remedy="ask for what was recorded, or allow more in the rig file (speed_tolerance, pressure_tolerance)",
        )

    def _play(self, take: Take, samples: Samples) -> Iterator[Samples]:
        if not len(samples):
            return
        began, start = time.monotonic(), samples.time_s[0]
        duration = float(np.nanmax(samples.time_s) - start)
        count = max(1, round(duration / PART_S / self.pace)) if self.pace else max(1, len(samples) // 1000)
        self._state = replace(self._state, moving=True, time_s=take.began_s)
        try:
            for rows in np.array_split(np.arange(len(samples)), count):
                if not rows.size:
                    continue
                part = samples.rows(rows)
                self._wait(began, float(part.time_s[-1] - start))
                if self._halted.is_set():
                    raise RigError("the playback was stopped", where=take.name)
                self._show(take, part)
                yield part
        finally:
            self._state = replace(self._state, moving=False)

    def _show(self, take: Take, part: Samples) -> None:
        temperature = float(part.temperature_k[-1])
        self._state = replace(
            self._state,
            position_m=float(part.position_m[-1]),
            force_n=float(part.force_n[-1]),
            temperature_k=temperature if np.isfinite(temperature) else self._state.temperature_k,
            time_s=take.began_s + float(part.time_s[-1]),
        )

    def _wait(self, began: float, until_s: float) -> None:
        if self.pace is not None:
            self._halted.wait(max(0.0, began + until_s / self.pace - time.monotonic()))

    def _rest(self, duration_s: float) -> None:
        self._wait(time.monotonic(), duration_s)


def _like(asked: Step, recorded: Step, tolerance: Tolerance) -> bool:
    """Whether a recorded step of a campaign is the asked one."""
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
    """Whether a hold lies between moves of one direction, or begins or ends the cycle."""
    for index, step in enumerate(steps):
        if not isinstance(step, Hold):
            continue
        before = [s for s in steps[:index] if isinstance(s, Move)]
        after = [s for s in steps[index:] if isinstance(s, Move)]
        if len(before) < 2 or not after:
            return len(before) != 1 or not after  # one move before it: its direction is not known, but it is a turn
        if (before[-1].to_m > before[-2].to_m) == (after[0].to_m > before[-1].to_m):
            return True
    return False


def _shown(take: Take) -> str:
    speeds = [1e3 * step.speed_m_s for step in take.steps if isinstance(step, Move)]
    speed = f"{np.median(speeds):.4g} mm/s" if speeds else "no move"
    return f"{take.name} ({speed}, {take.pressure_a_pa / 1e5:.4g} and {take.pressure_b_pa / 1e5:.4g} bar abs)"
