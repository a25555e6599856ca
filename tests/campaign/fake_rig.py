"""A rig in pure numpy, as small as the protocol of rigs allows: what campaigns are tested with.

Its friction is a Stribeck curve plus noise, its past a clock, a travel and a position. It writes down what is done to
it, and does what `trouble` says at a given moment.
"""

from __future__ import annotations

import hashlib
import os
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.run import Options
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.errors import RigError
from pneudrive.rig.interface import Envelope, Identity, Move, RigState, Samples, Sampling, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

#: No test waits for a person.
QUICK = Options(operator="anna", look_s=0.01, steady_s=0.02, patience_s=0.5)
AMBIENT_PA = 101325.0


def stribeck_n(speed_m_s: np.ndarray) -> np.ndarray:
    """Friction of the fake drive: Fc 30 N, Fs 40 N, vs 12 mm/s, Fv 60 N s/m."""
    v = np.abs(speed_m_s)
    return np.sign(speed_m_s) * (30.0 + 10.0 * np.exp(-((v / 0.012) ** 2)) + 60.0 * v)


@dataclass
class FakeRig:
    """See the module. ``hold_up_s`` makes each part of the samples take that long on the wall."""

    seed: int = 0
    hold_up_s: float = 0.0
    noise_n: float = 0.2
    calls: list[str] = field(default_factory=list)
    trouble: Callable[[FakeRig, str], None] | None = None
    supply_pa: float = 7e5
    fault: str | None = None
    force_n: float = 0.0
    spoil: Callable[[str, Samples], Samples] | None = None
    key: str = ""
    moving: bool = False
    past: dict = field(default_factory=lambda: {"clock_s": 0.0, "travel_m": 0.0, "at_m": 0.0, "pa": [AMBIENT_PA] * 2})

    def _note(self, word: str) -> None:
        self.calls.append(word)
        if self.trouble is not None:
            self.trouble(self, word)

    def identity(self) -> Identity:
        return Identity(
            name="fake rig",
            area_a_m2=4.9e-4,
            area_b_m2=4.9e-4,
            ambient_pressure_pa=AMBIENT_PA,
            mass_beyond_sensor_kg=0.0,
            accuracy={"force_n": 0.1, "position_m": 1e-6},
            limits={"force_n": (-200.0, 200.0)},
            synthetic=True,
        )

    def limits(self) -> Envelope:
        return Envelope(
            position_m=(0.0, 0.1),
            speed_m_s=0.5,
            acceleration_m_s2=5.0,
            jerk_m_s3=500.0,
            force_n=200.0,
            pressure_pa=(AMBIENT_PA, 6e5),
            separate_pressures=True,
            temperature_k=(288.0, 303.0),
            supply_pressure_pa=5e5,
        )

    def state(self) -> RigState:
        self._note("state")
        a, b = self.past["pa"]
        return RigState(
            self.past["at_m"], self.force_n, a, b, self.supply_pa, 295.0, self.past["clock_s"], self.moving, self.fault
        )

    def home(self) -> None:
        self._note("home")
        self.past["at_m"] = 0.0

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        self._note("set_pressure")
        self.past["pa"] = [a_pa, b_pa]

    def move(self, to_m: float, speed_m_s: float) -> None:
        self._note("move")
        self.past["travel_m"] += abs(to_m - self.past["at_m"])
        self.past["at_m"] = to_m

    def hold(self, duration_s: float, released: bool = False) -> None:
        self._note("hold")
        self.past["clock_s"] += duration_s

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        digest = hashlib.sha256(f"{self.seed}/{self.key}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest[:8], "little"))
        self._note("acquire")
        self.moving = True
        try:
            begin = 0.0
            for number, step in enumerate(steps):
                part, begin = self._step(step, number, begin, sampling, rng)
                self._note("part")
                time.sleep(self.hold_up_s)
                yield self.spoil(self.key, part) if self.spoil is not None else part
            self.past["clock_s"] += begin
        finally:
            self.moving = False
            self.calls.append("closed")

    def _step(
        self, step: Step, number: int, begin: float, sampling: Sampling, rng: np.random.Generator
    ) -> tuple[Samples, float]:
        at = self.past["at_m"]
        if isinstance(step, Move):
            length, n = abs(step.to_m - at) / step.speed_m_s, sampling.samples_per_stroke
            position = np.linspace(at, step.to_m, n)
            force = stribeck_n(np.full(n, np.sign(step.to_m - at) * step.speed_m_s))
            self.past["travel_m"] += abs(step.to_m - at)
            self.past["at_m"] = step.to_m
        else:
            length, n = step.duration_s, max(int(step.duration_s * sampling.hold_rate_hz), 2)
            position, force = np.full(n, at), np.zeros(n)
        force = force * (1.0 + 0.01 * np.exp(-self.past["travel_m"])) + self.noise_n * rng.standard_normal(n)
        a, b = self.past["pa"]
        samples = Samples(
            time_s=begin + np.linspace(0.0, length, n, endpoint=False),
            position_m=position + 1e-6 * rng.standard_normal(n),
            force_n=force,
            pressure_a_pa=np.full(n, a),
            pressure_b_pa=np.full(n, b),
            temperature_k=np.full(n, 295.0),
            step=np.full(n, number, dtype=np.int64),
        )
        return samples, begin + length

    def stop(self) -> None:
        self._note("stop")
        self.past["pa"] = [AMBIENT_PA] * 2

    def begin_cycle(self, key: str) -> None:
        self.key = key

    def memory(self) -> dict:
        return {name: list(value) if isinstance(value, list) else value for name, value in self.past.items()}

    def restore(self, memory: dict) -> None:
        if set(memory) != set(self.past):
            raise RigError("this is not my memory")
        self.past = dict(memory)


def at_rest(rig):
    """Tell whether the rig was stopped last, but for looks at its state, and no cycle was left open."""
    done = [call for call in rig.calls if call != "state"]
    stopped = len(done) - 1 - done[::-1].index("stop")
    return not set(done[stopped:]) - {"stop", "closed"} and not rig.moving and rig.past["pa"] == [AMBIENT_PA] * 2


def on_part(number, act):
    """Give the trouble that strikes with the n-th part of samples."""

    def trouble(rig, word):
        if word == "part" and rig.calls.count("part") == number:
            act(rig)

    return trouble


def press(rig):
    """Press Ctrl-C, and give the campaign the time to notice."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.6)


PROTOCOL = (Path(__file__).parents[1] / "data/fake_rig_protocol.toml").read_text("utf-8")


def protocol(more: str = "", repeats: int = 1):
    """Read a small protocol: 8 sweeps at two pressures after a warm-up and a tare."""
    from pneudrive.campaign.planning.protocol import parse_protocol

    return parse_protocol(PROTOCOL.format(more=more, repeats=repeats))


def contents(folder: Path) -> dict[str, tuple]:
    """Read all that two runs of one campaign must have in common, bit for bit: key -> head and samples."""
    found = {}
    for file in Campaign.open(folder).cycles():
        head, samples = file.head, file.samples()
        columns = {name: values.tobytes() for name, values in vars(samples).items()}
        found[head.cycle.key] = (head.index, head.cycle, head.began_s, head.flags, head.memory, columns)
    return found
