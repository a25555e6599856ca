"""A replayed rig: it plays the recording that matches a cycle."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RigError
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, RigState, Samples, Sampling, Step

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PART_S = 0.1  # samples come in parts of this duration, wall-clock time
SHOWN = 6


@dataclass(frozen=True)
class Tolerance:
    """Allowed difference between a recording and a request: relative for speeds and stops, Pa for pressures."""

    speed: float = 0.05
    pressure_pa: float = 2000.0


@dataclass(frozen=True)
class ReplaySource(ABC):
    """A recording that can be played.

    Attributes
    ----------
    name, key : str
        File; its key in the campaign, "" for a foreign recording.
    steps : tuple of Move and Hold
        Steps of the axis. Empty if the file does not contain them.
    pressure_a_pa, pressure_b_pa : float
    began_s : float
        Time of the rig's clock at its start.
    levels : dict
        Mounted parts.
    """

    name: str
    key: str
    steps: tuple[Step, ...]
    pressure_a_pa: float
    pressure_b_pa: float
    began_s: float
    levels: dict[str, str]

    @abstractmethod
    def first_step(self, steps: Sequence[Step], tolerance: Tolerance) -> int | None:
        """Return the step of this recording at which the requested steps begin, or None."""

    @abstractmethod
    def samples(self, first: int, steps: Sequence[Step]) -> Samples:
        """Read the samples of these steps, starting with step `first` of the recording."""

    @abstractmethod
    def range_m(self) -> tuple[float, float] | None:
        """Return the range of positions, m, if the recording shows it."""

    @property
    def speeds_m_s(self) -> list[float]:
        """Speeds of the moves."""
        return [step.speed_m_s for step in self.steps if isinstance(step, Move)]

    def truth(self) -> dict[str, Any]:
        """Return the ground truth of the recording, if it was kept."""
        return {}

    def __str__(self) -> str:
        """Return a description in words."""
        speed = f"{1e3 * np.median(self.speeds_m_s):.4g} mm/s" if self.speeds_m_s else "no move"
        pressures = f"{self.pressure_a_pa / 1e5:.4g} and {self.pressure_b_pa / 1e5:.4g} bar abs"
        return f"{self.name} ({speed}, {pressures})"


class ReplayRig:
    """A rig that plays recordings: `Rig`, `Reproducible` and `Changeable`.

    Parameters
    ----------
    sources : sequence of ReplaySource
    identity : Identity
    limits : Envelope
    pace : float, optional
        Seconds of the recording per second of wall-clock time; None: as fast as possible.
    tolerance : Tolerance, optional

    Notes
    -----
    `acquire` plays the recording that matches the request: steps, pressures and mounting within the tolerance. If
    several match, it takes the one whose key `begin_cycle` announced, otherwise the one played least often.
    """

    def __init__(
        self,
        sources: Sequence[ReplaySource],
        identity: Identity,
        limits: Envelope,
        pace: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> None:
        if not sources:
            raise RigError("there is no recording to play")
        self.sources, self.pace, self.tolerance = tuple(sources), pace, tolerance or Tolerance()
        self._identity, self._limits = identity, limits
        self._played = dict.fromkeys((source.name for source in sources), 0)
        self._key = ""
        self._levels: dict[str, str] = {}
        self._last: ReplaySource | None = None
        self._halted = threading.Event()
        ambient = identity.ambient_pressure_pa
        supply = max(limits.supply_pressure_pa, ambient)
        self._state = RigState(limits.home_m, 0.0, ambient, ambient, supply, sum(limits.temperature_k) / 2.0, 0.0)

    def identity(self) -> Identity:
        """Return the identity of the recorded rig."""
        return self._identity

    def limits(self) -> Envelope:
        """Return the limits of the rig if they are known, otherwise the range of the recordings."""
        return self._limits

    def state(self) -> RigState:
        """Return the state at the end of the last playback."""
        return self._state

    def home(self) -> None:
        """Home the axis; no recording is played."""
        self._state = replace(self._state, position_m=self._limits.home_m)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Select recordings at these absolute pressures, Pa."""
        self._state = replace(self._state, pressure_a_pa=a_pa, pressure_b_pa=b_pa)

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move without recording; no recording is played."""
        self._halted.clear()
        self._wait(time.monotonic(), abs(to_m - self._state.position_m) / speed_m_s)
        self._state = replace(self._state, position_m=to_m)

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Wait at rest without recording."""
        self._halted.clear()
        self._wait(time.monotonic(), duration_s)

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Play the recording that matches these steps, with its recorded sample times."""
        source, first = self._find(steps)
        self._played[source.name] += 1
        self._last = source
        self._halted.clear()
        return self._play(source, source.samples(first, steps))

    def stop(self) -> None:
        """Stop the playback; the next request is for ambient pressure."""
        self._halted.set()
        ambient = self._identity.ambient_pressure_pa
        self._state = replace(self._state, pressure_a_pa=ambient, pressure_b_pa=ambient, moving=False)

    def begin_cycle(self, key: str) -> None:
        """Prefer the recording with this key; the key has priority over the time."""
        self._key = key
        for source in self.sources:
            if source.key == key:
                self._state = replace(self._state, time_s=source.began_s)

    def memory(self) -> dict[str, Any]:
        """Return how often each recording was played."""
        return {"played": dict(self._played)}

    def restore(self, memory: dict[str, Any]) -> None:
        """Restore how often each recording was played."""
        self._played.update(memory.get("played", {}))

    def truth(self) -> dict[str, Any]:
        """Return the ground truth of the last recording, if it was kept."""
        return {} if self._last is None else self._last.truth()

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the mountings of the recordings."""
        factors = dict.fromkeys(factor for source in self.sources for factor in source.levels)
        return {f: tuple(dict.fromkeys(t.levels[f] for t in self.sources if f in t.levels)) for f in factors}

    def change(self, levels: dict[str, str]) -> None:
        """Select recordings with this mounting."""
        self._levels.update(levels)

    def _find(self, steps: Sequence[Step]) -> tuple[ReplaySource, int]:
        state, found = self._state, []
        for source in self.sources:
            asked = ((state.pressure_a_pa, source.pressure_a_pa), (state.pressure_b_pa, source.pressure_b_pa))
            if any(abs(want - have) > self.tolerance.pressure_pa for want, have in asked):
                continue
            if any(source.levels.get(factor, level) != level for factor, level in self._levels.items()):
                continue
            first = source.first_step(steps, self.tolerance)
            if first is not None:
                found.append((source, first))
        if not found:
            raise self._none_like(steps)
        return min(found, key=lambda pair: (pair[0].key != self._key, self._played[pair[0].name]))

    def _none_like(self, steps: Sequence[Step]) -> RigError:
        pressures = f"{self._state.pressure_a_pa / 1e5:.4g} and {self._state.pressure_b_pa / 1e5:.4g} bar abs"
        moves = [step for step in steps if isinstance(step, Move)]
        stop = max((step.duration_s for step in steps if isinstance(step, Hold)), default=0.0)
        wanted = moves[-1].speed_m_s if moves else 0.0

        def distance(source: ReplaySource) -> float:
            a, b = source.pressure_a_pa - self._state.pressure_a_pa, source.pressure_b_pa - self._state.pressure_b_pa
            apart = (abs(np.log(speed / wanted)) for speed in source.speeds_m_s if wanted)
            return (abs(a) + abs(b)) / self.tolerance.pressure_pa + min(apart, default=9)

        near = sorted(self.sources, key=distance)[:SHOWN]
        return RigError(
            f"no recording matches the cycle: {len(moves)} moves at {1e3 * wanted:.4g} mm/s, "
            f"longest stop {stop:.4g} s, chambers at {pressures}",
            where=self._key or None,
            value="nearest: " + "; ".join(map(str, near)),
            rule=f"the same steps, speeds within {100 * self.tolerance.speed:g} %, "
            f"pressures within {self.tolerance.pressure_pa / 100:g} mbar",
            remedy="Ask for a recorded cycle, or allow more in the rig file (speed_tolerance, pressure_tolerance)",
        )

    def _play(self, source: ReplaySource, samples: Samples) -> Iterator[Samples]:
        if not len(samples):
            return
        began, start = time.monotonic(), samples.time_s[0]
        duration = float(np.nanmax(samples.time_s) - start)
        count = max(1, round(duration / PART_S / self.pace)) if self.pace else max(1, len(samples) // 1000)
        self._state = replace(self._state, moving=True, time_s=source.began_s)
        try:
            for rows in np.array_split(np.arange(len(samples)), count):
                if not rows.size:
                    continue
                part = samples.rows(rows)
                self._wait(began, float(part.time_s[-1] - start))
                if self._halted.is_set():
                    raise RigError("the playback was stopped", where=source.name)
                self._show(source, part)
                yield part
        finally:
            self._state = replace(self._state, moving=False)

    def _show(self, source: ReplaySource, part: Samples) -> None:
        temperature = float(part.temperature_k[-1])
        self._state = replace(
            self._state,
            position_m=float(part.position_m[-1]),
            force_n=float(part.force_n[-1]),
            temperature_k=temperature if np.isfinite(temperature) else self._state.temperature_k,
            time_s=source.began_s + float(part.time_s[-1]),
        )

    def _wait(self, began: float, until_s: float) -> None:
        if self.pace is not None:
            self._halted.wait(max(0.0, began + until_s / self.pace - time.monotonic()))
