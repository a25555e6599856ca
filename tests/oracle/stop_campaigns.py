"""Campaigns of stops with a known truth, written from the documented format alone, with NumPy and polars.

Nothing here knows the product's physics or statistics. Force over time around each stop is a formula: uninterrupted
friction over position, relaxation while held, a spring that loads the contact until it breaks away, and an excess that
dies away with travel. Breakaway over duration follows a law that the test chooses.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl

AMBIENT_PA = 101325.0
BAR = 1e5

#: Increment over stop duration in s, N; five kinds and none.
LAWS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "log": lambda t: 1.2 * np.log1p(t / 0.2),
    "late log": lambda t: 1.2 * np.log1p(t / 2.0),
    "stretched": lambda t: 45.0 * -np.expm1(-((t / 5.4e4) ** 0.4)),
    "saturating": lambda t: 6.0 * -np.expm1(-((t / 30.0) ** 0.6)),
    "hyperbolic": lambda t: 6.0 * t / (t + 12.0),
    "exponential": lambda t: 5.0 * -np.expm1(-t / 20.0),
    "power": lambda t: 0.9 * t**0.25,
    "none": lambda t: 0.0 * t,
}


@dataclass(frozen=True)
class StopWorld:
    """A rig, a contact and a plan of stops; everything that could spoil the result has a number here."""

    law: str = "log"
    durations_s: tuple[float, ...] = (0.3, 1.0, 3.0, 10.0, 15.0, 30.0, 100.0, 300.0)
    gauges_pa: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    repeats: int = 4
    blocks: int = 1
    order: str = "randomised"  # or "ascending"
    directions: tuple[int, ...] = (1,)
    released: bool = False
    speed_m_s: float = 1e-3
    references: int = 1  # uninterrupted strokes before each stop
    bring_steps: bool = True
    # friction
    running_n: float = 30.0
    standing_n: float = 0.8  # breakaway above running friction without any stop
    per_bar: float = 0.25  # share of the increment's law for each bar, mean of both chambers
    length_m: float = 4e-4  # over which the excess dies away
    corner_n: float = 0.15  # roundness of the peak
    ripple: tuple[float, float] = (0.01, 3e-3)  # share of friction, wavelength
    relaxation: tuple[float, float] = (0.9, 0.5)  # N per decade, time from which on
    # rig
    stiffness_n_m: float = 2e5
    acceleration_m_s2: float = 2.0
    burst_hz: float = 5000.0
    hold_hz: float = 20.0
    samples: int = 1500
    # chance
    noise_n: float = 0.12
    correlated_n: float = 0.0
    quantum_n: float = 0.0
    scatter_n: float = 0.15  # of the increment, from stop to stop
    scatter_share: float = 0.04
    heavy_tails: bool = False
    block_n: float = 0.0
    block_share: float = 0.0
    level_share: float = 0.01  # of running friction, from cycle to cycle
    drift_share: float = 0.0  # of running friction and increments, over the campaign
    zero_n: float = 1.5
    position_noise_m: float = 3e-7
    pressure_noise_pa: float = 50.0

    def increment(self, duration_s: np.ndarray | float, gauge: tuple[float, float]) -> np.ndarray:
        """Peak above running friction by the formulas, without chance."""
        t = np.asarray(duration_s, dtype=float)
        aged = self.standing_n + self.aged(t, gauge)
        return aged + np.array([self._corner(float(a)) for a in np.atleast_1d(aged)]).reshape(t.shape)

    def aged(self, duration_s: np.ndarray | float, gauge: tuple[float, float]) -> np.ndarray:
        """Part of the increment that the law gives."""
        bar = 0.5 * (gauge[0] + gauge[1]) / BAR
        return LAWS[self.law](np.asarray(duration_s, dtype=float)) * (1.0 + self.per_bar * bar)

    def slope(self, duration_s: float, gauge: tuple[float, float]) -> float:
        """Increase of the increment per decade of duration, at this one."""
        high, low = (self.increment(duration_s * 10.0**e, gauge) for e in (0.01, -0.01))
        return float(high - low) / 0.02

    def mean_slope(self, gauge: tuple[float, float]) -> float:
        """Mean increase per decade from the shortest to the longest duration."""
        low, high = min(self.durations_s), max(self.durations_s)
        return float(self.increment(high, gauge) - self.increment(low, gauge)) / float(np.log10(high / low))

    def _corner(self, excess_n: float) -> float:
        """How much lower the rounded peak is than the sharp one."""
        way = np.linspace(-1e-4, 1e-3, 20001)
        limit = excess_n * np.exp(-np.maximum(way, 0.0) / self.length_m)
        spring = excess_n + self.stiffness_n_m * way
        return float(_softer(spring, limit, self.corner_n).max()) - excess_n


def _softer(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """Take the smaller of both, rounded where they meet."""
    return -width * np.logaddexp(-a / width, -b / width)


@dataclass
class _State:
    rng: np.random.Generator
    clock_s: float = 0.0
    done: float = 0.0
    block_n: float = 0.0
    block_share: float = 0.0
    truth: list[dict] = field(default_factory=list)


def write_stops(folder: str | Path, world: StopWorld, seed: int) -> Path:
    """Write the folder of a world; equal seeds give equal folders."""
    folder = Path(folder)
    (folder / "cycles").mkdir(parents=True)
    state = _State(np.random.default_rng([seed, 5]))
    plan = _plan(world, state.rng)
    (folder / "rig.json").write_text(json.dumps(_identity(world)))
    (folder / "campaign.json").write_text(json.dumps({"schema": 1, "name": "stops by hand", "seed": seed}))
    (folder / "campaign.toml").write_text('schema = 1\nname = "stops by hand"\n')
    block = 0
    for index, cell in enumerate(plan, start=1):
        if cell["block"] != block:
            block = cell["block"]
            state.block_n = world.block_n * state.rng.standard_normal()
            state.block_share = world.block_share * state.rng.standard_normal()
        state.done = (index - 1) / max(len(plan) - 1, 1)
        _write(folder, index, cell, world, state)
    return folder


def _plan(world: StopWorld, rng: np.random.Generator) -> list[dict]:
    out = []
    for block in range(1, world.blocks + 1):
        cells = [
            {"block": block, "repeat": r + 1, "gauge": g, "direction": d, "stop": t}
            for r in range(world.repeats)
            for g in world.gauges_pa
            for d in world.directions
            for t in world.durations_s
        ]
        if world.order == "ascending":
            cells.sort(key=lambda c: c["stop"])
        else:
            cells = [cells[i] for i in rng.permutation(len(cells))]
        out += cells
    return out


def _identity(world: StopWorld) -> dict:
    return {
        "name": "a rig of numbers",
        "area_a_m2": 4.909e-4,
        "area_b_m2": 4.909e-4,
        "ambient_pressure_pa": AMBIENT_PA,
        "mass_beyond_sensor_kg": 0.5,
        "stiffness_n_m": world.stiffness_n_m,
        "limits": {"force_n": [-200.0, 200.0]},
        "accuracy": {"force_n": 0.1, "position_m": 1e-6, "pressure_a_pa": 100.0, "pressure_b_pa": 100.0},
        "chambers": "held",
        "synthetic": True,
    }


def _write(folder: Path, index: int, cell: dict, world: StopWorld, state: _State) -> None:
    columns, steps, start = _cycle(cell, world, state)
    way = "+x" if cell["direction"] > 0 else "-x"
    a, b = (gauge / BAR for gauge in cell["gauge"])
    key = f"b{cell['block']}/stop/t{cell['stop']:g}/a{a:g}/b{b:g}/{way}/r{cell['repeat']}"
    head = {
        "schema": 1,
        "index": index,
        "began_s": state.clock_s,
        "started": "2026-03-01T08:00:00+00:00",
        "cycle": {
            "key": key,
            "kind": "stop",
            "steps": steps,
            "sampling": {"samples_per_stroke": world.samples, "burst_rate_hz": world.burst_hz},
            "pressure_a_pa": AMBIENT_PA + cell["gauge"][0],
            "pressure_b_pa": AMBIENT_PA + cell["gauge"][1],
            "block": cell["block"],
            "repeat": cell["repeat"],
            "speed_m_s": world.speed_m_s,
            "stop_s": cell["stop"],
            "released": world.released,
            "start_m": start,
            "levels": {},
        },
    }
    if not world.bring_steps:
        del columns["step"]
    name = f"{index:05d}-{key.replace('/', '_')}.parquet"
    pl.DataFrame(columns).write_parquet(folder / "cycles" / name, metadata={"pneudrive": json.dumps(head)})
    state.clock_s += float(columns["time_s"][-1]) + 30.0


def _cycle(cell: dict, world: StopWorld, state: _State) -> tuple[dict, list[dict], float]:
    """Give references, approach, stop, restart: columns and steps."""
    rng, sign = state.rng, cell["direction"]
    middle, before, after = 0.05, 2.5e-3, 6e-3
    begin, end = middle - sign * before, middle + sign * after
    fast = 0.1
    parts: list[dict] = []
    steps: list[dict] = []
    wander = 1.0 + world.drift_share * (state.done - 0.5)
    running = world.running_n * wander * (1.0 + world.level_share * rng.standard_normal())
    moves = [(begin, end, world.speed_m_s, "slide"), (end, begin, fast, "slide")] * world.references
    moves += [
        (begin, middle, world.speed_m_s, "slide"),
        (middle, middle, 0.0, "stop"),
        (middle, end, world.speed_m_s, "restart"),
    ]
    time, aged = 0.0, 0.0
    for a, b, speed, kind in moves:
        if kind == "stop":
            part = _hold(cell["stop"], a, running, sign, world)
            aged = float(world.aged(cell["stop"], cell["gauge"])) * wander * (1.0 + state.block_share)
            aged += world.standing_n + state.block_n + _scatter(aged, world, rng)
            steps.append({"duration_s": cell["stop"], "released": world.released})
        else:
            part = _move(a, b, speed, running, world, aged if kind == "restart" else None, parts[-1] if parts else None)
            steps.append({"to_m": b, "speed_m_s": speed})
        part["time"] = time + part["time"]
        time = float(part["end"]) + time
        parts.append(part)
    columns = {name: np.concatenate([p[name] for p in parts]) for name in ("time", "position", "friction")}
    step = np.repeat(np.arange(len(parts)), [p["time"].size for p in parts])
    n = columns["time"].size
    held = -cell["gauge"][0] * 4.909e-4 + cell["gauge"][1] * 4.909e-4
    force = columns["friction"] + held + world.zero_n + _noise(columns["time"], world, rng)
    if world.quantum_n:
        force = world.quantum_n * np.round(force / world.quantum_n)
    out = {
        "time_s": columns["time"],
        "position_m": columns["position"] + world.position_noise_m * rng.standard_normal(n),
        "force_n": force,
        "pressure_a_pa": AMBIENT_PA + cell["gauge"][0] + world.pressure_noise_pa * rng.standard_normal(n),
        "pressure_b_pa": AMBIENT_PA + cell["gauge"][1] + world.pressure_noise_pa * rng.standard_normal(n),
        "temperature_k": np.full(n, 293.15),
        "step": step.astype(np.int64),
    }
    return out, steps, begin


def _scatter(aged: float, world: StopWorld, rng: np.random.Generator) -> float:
    chance = rng.standard_t(4) / np.sqrt(2.0) if world.heavy_tails else rng.standard_normal()
    return float(chance) * float(np.hypot(world.scatter_n, world.scatter_share * aged))


def _uninterrupted(position: np.ndarray, running: float, world: StopWorld) -> np.ndarray:
    share, wavelength = world.ripple
    return running * (1.0 + share * np.sin(2.0 * np.pi * position / wavelength))


def _hold(stop_s: float, at: float, running: float, sign: int, world: StopWorld) -> dict:
    time = np.unique(np.r_[np.arange(0.0, stop_s, 1.0 / world.hold_hz), min(0.01, stop_s / 2)])
    rate, since = world.relaxation
    start = float(_uninterrupted(np.array([at]), running, world)[0])
    held = start - rate * np.log10(1.0 + time / since)
    if world.released:
        held = start * np.exp(-time / 0.02)
    return {"time": time, "position": np.full(time.size, at), "friction": sign * held, "end": stop_s}


def _move(
    a: float, b: float, speed: float, running: float, world: StopWorld, aged: float | None, before: dict | None
) -> dict:
    """Move with constant ramps; after a stop the contact breaks away, otherwise it reverses or goes on sliding."""
    length, ramp = abs(b - a), speed / world.acceleration_m_s2
    duration = length / speed + ramp
    even = np.linspace(0.0, duration, world.samples, endpoint=False)
    bursts = [np.arange(0.0, min(0.25, duration), 1.0 / world.burst_hz)] if world.burst_hz else []
    time = np.unique(np.round(np.concatenate([even, *bursts]), 9))
    left = duration - time
    way = np.where(
        time < ramp,
        world.acceleration_m_s2 * time**2 / 2,
        world.acceleration_m_s2 * ramp**2 / 2 + speed * (time - ramp),
    )
    way = np.where(left < ramp, length - world.acceleration_m_s2 * left**2 / 2, way)
    sign = 1.0 if b > a else -1.0
    position = a + sign * way
    sliding = _uninterrupted(position, running, world)
    start = sign * float(before["friction"][-1]) if before is not None else -running
    excess = 0.0 if aged is None else aged
    spring = start + world.stiffness_n_m * way
    slack = max((float(sliding[0]) + excess - start) / world.stiffness_n_m, 0.0)
    limit = sliding + excess * np.exp(-np.maximum(way - slack, 0.0) / world.length_m)
    friction = _softer(spring, limit, world.corner_n)
    return {"time": time, "position": position, "friction": sign * friction, "end": duration}


def _noise(time: np.ndarray, world: StopWorld, rng: np.random.Generator) -> np.ndarray:
    white = world.noise_n * rng.standard_normal(time.size)
    if not world.correlated_n:
        return white
    kept = np.exp(-np.diff(time, prepend=time[0]) / 1e-3)
    fresh = world.correlated_n * np.sqrt(1.0 - kept**2) * rng.standard_normal(time.size)
    slow, value = np.empty(time.size), 0.0
    for i in range(time.size):
        value = kept[i] * value + fresh[i]
        slow[i] = value
    return white + slow


def random_stop_world(seed: int) -> StopWorld:
    """Draw a campaign of stops that somebody could have run."""
    draw = np.random.default_rng([seed, 99])
    law = str(draw.choice(list(LAWS)))
    gauges = (((0.0, 0.0),), ((0.0, 0.0), (1.0 * BAR, 1.0 * BAR)), ((0.0, 0.0), (2e5, 0.0), (0.0, 2e5)))
    durations = (
        (0.3, 1.0, 3.0, 10.0, 15.0, 30.0, 100.0, 300.0),
        (1.0, 3.0, 10.0, 30.0, 100.0),
        (0.1, 1.0, 10.0, 100.0, 1000.0),
        (0.5, 2.0, 8.0, 15.0, 60.0, 250.0),
    )
    world = StopWorld(
        law=law,
        durations_s=durations[int(draw.integers(len(durations)))],
        gauges_pa=gauges[int(draw.integers(3))],
        repeats=int(draw.integers(3, 7)),
        directions=((1,), (1, -1), (-1,))[int(draw.integers(3))],
        released=bool(draw.random() < 0.3),
        speed_m_s=float(draw.choice([5e-4, 1e-3, 2e-3, 5e-3])),
        references=int(draw.integers(0, 2)),
        bring_steps=bool(draw.random() < 0.8),
        running_n=float(draw.uniform(12.0, 60.0)),
        standing_n=float(draw.uniform(0.0, 2.0)),
        per_bar=float(draw.uniform(-0.1, 0.4)),
        length_m=float(np.exp(draw.uniform(np.log(5e-5), np.log(1e-3)))),
        corner_n=float(draw.uniform(0.05, 0.3)),
        ripple=(float(draw.uniform(0.0, 0.015)), float(draw.uniform(1e-3, 2e-2))),
        stiffness_n_m=float(np.exp(draw.uniform(np.log(5e4), np.log(1e6)))),
        burst_hz=float(draw.choice([5000.0, 10000.0])),
        noise_n=float(np.exp(draw.uniform(np.log(0.02), np.log(0.3)))),
        correlated_n=float(draw.choice([0.0, 0.0, 0.1])),
        quantum_n=float(draw.choice([0.0, 0.01, 0.05])),
        scatter_n=float(np.exp(draw.uniform(np.log(0.05), np.log(0.4)))),
        scatter_share=float(draw.choice([0.0, 0.05, 0.1])),
        heavy_tails=bool(draw.random() < 0.25),
        zero_n=float(draw.normal(0.0, 2.0)),
    )
    if draw.random() < 0.3:
        world = replace(world, blocks=3, repeats=2, block_n=0.2, block_share=0.05)
    if draw.random() < 0.25:
        world = replace(world, order="ascending", drift_share=float(draw.choice([0.0, 0.03, -0.05])))
    elif draw.random() < 0.5:
        world = replace(world, drift_share=float(draw.normal(0.0, 0.05)))
    return world
