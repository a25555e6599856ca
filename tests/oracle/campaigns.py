"""Campaign folders with a known truth, written from the documented format alone, with NumPy and polars.

Nothing here knows the product's physics or statistics: the friction laws, the servo's motion, the noise and the
wanderings of the rig are formulas of this file. A test draws a `World`, writes its folder, and asks whether what the
product says of it is true.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[np.float64]

AMBIENT_PA = 101325.0
BAR = 1e5
LAWS = ("gauss", "exponential", "lorentz", "viscous")
ROOM_K = 293.15
TARE_S, PAUSE_S = 5.0, 2.0
LEAST_ACCURACY = 1e-4  # of the range, that is stated of a force sensor without a gain error


@dataclass(frozen=True)
class Friction:
    """Steady sliding friction by hand: F(v, gauge a, gauge b), N; lips in N/bar, joint in N/bar2."""

    law: str = "gauss"
    coulomb: float = 30.0
    breakaway: float = 42.0
    stribeck_m_s: float = 0.015
    viscous: float = 50.0
    asymmetry: float = 0.0  # F(+x) = F (1 + asymmetry), F(-x) = F (1 - asymmetry)
    lip_a: float = 0.0
    lip_b: float = 0.0
    lip_breakaway: float = 0.0  # further N/bar of both chambers at the lowest speeds
    joint: float = 0.0

    def at(self, speed: Array | float, gauge_a: float, gauge_b: float, direction: int = 0) -> Array:
        """Friction at these speeds (> 0) and gauge pressures in Pa; direction 0 is half the difference."""
        v = np.asarray(speed, dtype=float)
        a, b = gauge_a / BAR, gauge_b / BAR
        fall = {
            "gauss": np.exp(-((v / self.stribeck_m_s) ** 2)),
            "exponential": np.exp(-v / self.stribeck_m_s),
            "lorentz": 1.0 / (1.0 + (v / self.stribeck_m_s) ** 2),
            "viscous": np.zeros_like(v),
        }[self.law]
        lips = self.lip_a * a + self.lip_b * b + self.joint * a * b
        excess = self.breakaway - self.coulomb + self.lip_breakaway * (a + b)
        return (self.coulomb + lips + excess * fall + self.viscous * v) * (1.0 + direction * self.asymmetry)


@dataclass(frozen=True)
class World:
    """A rig, a drive and a plan; everything that a campaign's result could be spoiled by has a number here."""

    friction: Friction = field(default_factory=Friction)
    speeds_m_s: tuple[float, ...] = tuple(np.geomspace(1e-3, 0.45, 10))
    gauges_pa: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    levels: tuple[dict[str, str], ...] = ({},)  # one block each
    repeats: int = 2
    order: str = "randomised"  # or "ascending", "up and down"
    sentinel_every: int = 8  # 0: none
    sentinel_m_s: float = 0.05
    tare: bool = True
    samples: int = 1500  # a stroke
    burst_hz: float = 0.0
    stroke_m: float = 0.2
    acceleration_m_s2: float = 5.0
    mass_kg: float = 1.0
    area_a_m2: float = 4.909e-4
    area_b_m2: float = 4.909e-4
    presliding_m: float = 2e-4
    # noise of a sample: white, and correlated over a time
    white_n: float = 0.3
    correlated_n: float = 0.4
    correlation_s: float = 0.05
    position_noise_m: float = 2e-6
    pressure_noise_pa: float = 100.0
    # what changes from cycle to cycle, from block to block, with time
    cycle_share: float = 0.01  # standard deviation, of friction
    cycle_n: float = 0.0  # standard deviation, N
    block_share: float = 0.0
    drift_share: float = 0.0  # over the campaign, linear, zero in its middle
    run_in_share: float = 0.0  # at the start, dies away over run_in_m
    run_in_m: float = 2.0
    # sensor
    gain_share: float = 0.0  # standard deviation of the gain error; stated as accuracy of the range
    range_n: float = 200.0
    zero_n: float = 1.0
    zero_drift_n: float = 0.0  # over the campaign
    zero_with_clock: bool = False  # it drifts with time, in slow cycles too; else from cycle to cycle
    state_accuracy: bool = True
    # position: (share, periods over the stroke, phase)
    ripple: tuple[tuple[float, float, float], ...] = ()
    slope_share: float = 0.0  # from end to end
    # air: pressure falls and rises by this many Pa per m/s
    air_pa_s_m: float = 0.0
    measured_at: str = "chamber"
    temperature_share_k: float = 0.0  # friction per kelvin; temperature rises by 4 K over the campaign
    wild: tuple[tuple[int, float], ...] = ()  # sweeps by their number from 0, and the factor on their friction
    pressure_zeros_pa: tuple[float, float] = (0.0, 0.0)  # of the transducers, on every sample
    pressure_gains: tuple[float, float] = (0.0, 0.0)  # of them, share of the gauge pressure
    pressure_accuracy_pa: float = 100.0
    written_too_high_pa: float = 0.0  # by which the samples' pressures differ from those that the heads state

    def truth(self, speed: Array | float, gauge: tuple[float, float], direction: int = 0) -> Array:
        """Friction of the seal without anything that passes."""
        return self.friction.at(speed, *gauge, direction)

    def air_n(self, speed: Array | float) -> Array:
        """Force of the air against the motion."""
        return self.air_pa_s_m * np.asarray(speed, dtype=float) * (self.area_a_m2 + self.area_b_m2)


@dataclass
class _State:
    """What runs along while the campaign is written."""

    rng: np.random.Generator
    share_done: float = 0.0
    clock_s: float = 0.0
    travel_m: float = 0.0
    gain: float = 1.0
    block: float = 0.0
    wild: float = 1.0
    lasts_s: float = 1.0  # all cycles together


def plan(world: World, rng: np.random.Generator) -> Iterator[dict]:
    """Lay out the cycles: kind, speed, gauge pressures, block, repeat, levels."""
    number = 0
    for block, levels in enumerate(world.levels, start=1):
        common = {"block": block, "levels": levels}
        if world.tare:
            yield common | {"kind": "tare", "gauge": (0.0, 0.0)}
        points = [(v, g, r + 1) for r in range(world.repeats) for g in world.gauges_pa for v in world.speeds_m_s]
        if world.order == "randomised":
            points = [points[i] for i in rng.permutation(len(points))]
        elif world.order == "up and down":
            points = [p for r in range(world.repeats) for p in _turned(points, r + 1)]
        for speed, gauge, repeat in points:
            if world.sentinel_every and number % world.sentinel_every == 0:
                place = {"speed": world.sentinel_m_s, "gauge": world.gauges_pa[0]}
                yield common | place | {"kind": "sentinel", "repeat": number // world.sentinel_every + 1}
            number += 1
            yield common | {"kind": "sweep", "speed": speed, "gauge": gauge, "repeat": repeat}
        if world.tare:
            yield common | {"kind": "tare", "gauge": (0.0, 0.0)}


def _turned(points: list, repeat: int) -> list:
    part = [p for p in points if p[2] == repeat]
    return part if repeat % 2 else part[::-1]


def write_campaign(folder: str | Path, world: World, seed: int) -> Path:
    """Write the folder of a world; equal seeds give equal folders."""
    folder = Path(folder)
    (folder / "cycles").mkdir(parents=True)
    rng = np.random.default_rng(seed)
    cycles = list(plan(world, rng))
    state = _State(
        rng, gain=1.0 + world.gain_share * rng.standard_normal(), lasts_s=sum(_lasts(c, world) for c in cycles)
    )
    (folder / "rig.json").write_text(json.dumps(_identity(world)))
    (folder / "campaign.json").write_text(json.dumps({"schema": 1, "name": "oracle", "seed": seed}))
    (folder / "campaign.toml").write_text('schema = 1\nname = "oracle"\n')
    block, sweeps = 0, 0
    wild = dict(world.wild)
    for index, cycle in enumerate(cycles, start=1):
        state.wild = wild.get(sweeps, 1.0) if cycle["kind"] == "sweep" else 1.0
        sweeps += cycle["kind"] == "sweep"
        if cycle["block"] != block:
            block, state.block = cycle["block"], world.block_share * rng.standard_normal()
        state.share_done = (index - 1) / max(len(cycles) - 1, 1)
        _write(folder, index, cycle, world, state)
    return folder


def _lasts(cycle: dict, world: World) -> float:
    """Time of a cycle, about."""
    return PAUSE_S + (TARE_S if cycle.get("speed") is None else 2.0 * 0.96 * world.stroke_m / cycle["speed"])


def _identity(world: World) -> dict:
    identity = {
        "name": "a rig of numbers",
        "area_a_m2": world.area_a_m2,
        "area_b_m2": world.area_b_m2,
        "ambient_pressure_pa": AMBIENT_PA,
        "mass_beyond_sensor_kg": world.mass_kg,
        "limits": {"force_n": [-world.range_n, world.range_n]},
        "chambers": "common" if world.air_pa_s_m else "held",
        "pressure_measured_at": world.measured_at,
        "synthetic": True,
    }
    if world.state_accuracy:
        identity["accuracy"] = {
            "force_n": max(world.gain_share, LEAST_ACCURACY) * world.range_n,
            "position_m": 5e-6,
            "pressure_a_pa": world.pressure_accuracy_pa,
            "pressure_b_pa": world.pressure_accuracy_pa,
            "bore_m": 1e-5,
        }
    return identity


def _write(folder: Path, index: int, cycle: dict, world: World, state: _State) -> None:
    head, columns = _cycle(index, cycle, world, state)
    frame = pl.DataFrame(columns)
    name = f"{index:05d}-{head['cycle']['key']}.parquet"
    frame.write_parquet(folder / "cycles" / name, metadata={"pneudrive": json.dumps(head)})
    state.clock_s += float(columns["time_s"][-1]) + PAUSE_S
    state.travel_m += float(np.abs(np.diff(columns["position_m"])).sum())


def _cycle(index: int, cycle: dict, world: World, state: _State) -> tuple[dict, dict[str, NDArray]]:
    speed, gauge = cycle.get("speed"), cycle["gauge"]
    low, high = 0.02 * world.stroke_m, 0.98 * world.stroke_m
    if speed is None:
        steps: list[dict] = [{"duration_s": TARE_S, "released": True}]
        time = np.arange(0.0, TARE_S, 0.01)
        columns = _standing(time, world, state)
    else:
        steps = [{"to_m": high, "speed_m_s": speed}, {"to_m": low, "speed_m_s": speed}]
        columns = _sliding(speed, gauge, (low, high), world, state)
    head = {
        "schema": 1,
        "index": index,
        "began_s": state.clock_s,
        "started": f"2026-03-0{1 + cycle['block'] % 7}T08:00:00+00:00",
        "flags": {},
        "memory": {},
        "cycle": {
            "key": f"{cycle['kind']}-{index}",
            "kind": cycle["kind"],
            "steps": steps,
            "sampling": {"samples_per_stroke": world.samples, "burst_rate_hz": world.burst_hz},
            "pressure_a_pa": AMBIENT_PA + gauge[0],
            "pressure_b_pa": AMBIENT_PA + gauge[1],
            "block": cycle["block"],
            "repeat": cycle.get("repeat", 1),
            "speed_m_s": speed,
            "levels": cycle["levels"],
        },
    }
    return head, columns


def _standing(time: Array, world: World, state: _State) -> dict[str, NDArray]:
    force = _zero(time, world, state) + _noise(time, world, state)
    ambient = AMBIENT_PA + world.pressure_noise_pa * state.rng.standard_normal((2, time.size))
    return {
        "time_s": time,
        "position_m": np.full(time.size, 0.02 * world.stroke_m),
        "force_n": force,
        "pressure_a_pa": ambient[0] + world.pressure_zeros_pa[0],
        "pressure_b_pa": ambient[1] + world.pressure_zeros_pa[1],
        "temperature_k": np.full(time.size, _temperature(world, state)),
        "step": np.zeros(time.size, dtype=np.int64),
    }


def _sliding(
    speed: float, gauge: tuple[float, float], span: tuple[float, float], world: World, state: _State
) -> dict[str, NDArray]:
    """Out and back with constant acceleration in the ramps."""
    rng = state.rng
    length = span[1] - span[0]
    ramp_s, duration_s = speed / world.acceleration_m_s2, length / speed + speed / world.acceleration_m_s2
    once = _times(duration_s, world)
    way, velocity, acceleration = _ramps(once, speed, world.acceleration_m_s2, ramp_s, duration_s, length)
    time = np.concatenate([once, duration_s + once])
    direction = np.repeat([1, -1], once.size)
    true_x = np.concatenate([span[0] + way, span[1] - way])
    v, a = np.tile(velocity, 2), direction * np.tile(acceleration, 2)
    travelled = np.tile(way, 2)
    level = world.friction.at(np.maximum(v, 1e-6), *gauge, 0) * (1.0 + direction * world.friction.asymmetry)
    level = level * _wander(world, state) * _pattern(true_x, world) * state.wild
    level = level + world.cycle_n * rng.standard_normal()
    friction = direction * level * (1.0 - 2.0 * np.exp(-travelled / world.presliding_m))
    change = world.air_pa_s_m * v * direction
    air = change * (world.area_a_m2 + world.area_b_m2)
    held = -gauge[0] * world.area_a_m2 + gauge[1] * world.area_b_m2
    force = (
        state.gain * (friction + world.mass_kg * a + air + held)
        + _zero(time, world, state)
        + _noise(time, world, state)
    )
    shown = change if world.measured_at == "chamber" else 0.0 * change
    errors = np.array(world.pressure_zeros_pa) + np.array(world.pressure_gains) * np.array(gauge)
    errors = errors + world.written_too_high_pa
    pressures = world.pressure_noise_pa * rng.standard_normal((2, time.size)) + errors[:, None]
    return {
        "time_s": time,
        "position_m": true_x + world.position_noise_m * rng.standard_normal(time.size),
        "force_n": force,
        "pressure_a_pa": AMBIENT_PA + gauge[0] - shown + pressures[0],
        "pressure_b_pa": AMBIENT_PA + gauge[1] + shown + pressures[1],
        "temperature_k": np.full(time.size, _temperature(world, state)),
        "step": np.repeat(np.array([0, 1]), once.size),
    }


def _times(duration_s: float, world: World) -> Array:
    """Even over the stroke, and a burst after its beginning and before its end."""
    even = np.linspace(0.0, duration_s, world.samples, endpoint=False)
    if world.burst_hz <= world.samples / duration_s:
        return even
    after = np.arange(0.0, min(0.2, duration_s), 1.0 / world.burst_hz)
    before = duration_s - np.arange(1, int(min(0.05, duration_s) * world.burst_hz)) / world.burst_hz
    return np.unique(np.round(np.concatenate([even, after, before]), 9))


def _ramps(
    t: Array, speed: float, acceleration: float, ramp_s: float, duration_s: float, length: float
) -> tuple[Array, Array, Array]:
    left = duration_s - t
    up, down = t < ramp_s, left < ramp_s
    v = np.where(up, acceleration * t, np.where(down, acceleration * left, speed))
    way = np.where(up, acceleration * t**2 / 2, acceleration * ramp_s**2 / 2 + speed * (t - ramp_s))
    way = np.where(down, length - acceleration * left**2 / 2, way)
    return way, v, np.where(up, acceleration, np.where(down, -acceleration, 0.0))


def _wander(world: World, state: _State) -> float:
    """Factor on the friction of one cycle."""
    drift = world.drift_share * (state.share_done - 0.5)
    run_in = world.run_in_share * np.exp(-state.travel_m / world.run_in_m)
    warm = world.temperature_share_k * (_temperature(world, state) - ROOM_K)
    cycle = world.cycle_share * state.rng.standard_normal()
    return 1.0 + drift + run_in + warm + cycle + state.block


def _temperature(world: World, state: _State) -> float:
    return ROOM_K + 4.0 * (state.share_done - 0.5) * (world.temperature_share_k != 0.0)


def _pattern(x: Array, world: World) -> Array:
    away = x / world.stroke_m
    waves = sum((s * np.sin(2 * np.pi * k * away + phase) for s, k, phase in world.ripple), np.zeros_like(x))
    return 1.0 + waves + world.slope_share * (away - 0.5)


def _zero(time: Array, world: World, state: _State) -> Array:
    share = (state.clock_s + time) / state.lasts_s if world.zero_with_clock else np.full(time.size, state.share_done)
    return world.zero_n + world.zero_drift_n * share


def _noise(time: Array, world: World, state: _State) -> Array:
    """White noise, and noise that forgets itself over a time, at any spacing of the samples."""
    kept = np.exp(-np.diff(time, prepend=time[0]) / world.correlation_s)
    fresh = world.correlated_n * np.sqrt(1.0 - kept**2) * state.rng.standard_normal(time.size)
    fresh[0] = world.correlated_n * state.rng.standard_normal()
    slow, value = np.empty(time.size), 0.0
    for i, (k, f) in enumerate(zip(kept.tolist(), fresh.tolist(), strict=True)):
        value = k * value + f
        slow[i] = value
    return slow + world.white_n * state.rng.standard_normal(time.size)


def random_world(seed: int) -> World:
    """Draw a world that somebody could own."""
    draw = np.random.default_rng([seed, 77])
    coulomb = float(draw.uniform(8.0, 60.0))
    friction = Friction(
        law=str(draw.choice(LAWS)),
        coulomb=coulomb,
        breakaway=coulomb * float(draw.uniform(1.1, 2.0)),
        stribeck_m_s=float(np.exp(draw.uniform(np.log(0.003), np.log(0.05)))),
        viscous=float(draw.uniform(0.3, 3.0)) * coulomb,
        asymmetry=float(draw.choice([0.0, 0.03, 0.1])),
        lip_a=float(draw.uniform(0.0, 3.0)),
        lip_b=float(draw.uniform(0.0, 3.0)),
        lip_breakaway=float(draw.choice([0.0, 1.0])),
    )
    noise = coulomb * float(np.exp(draw.uniform(np.log(0.003), np.log(0.05))))
    gauges = (((0.0, 0.0),), ((0.5 * BAR, 0.5 * BAR), (1.5 * BAR, 1.5 * BAR)), ((0.0, 0.0), (2e5, 0.0), (0.0, 2e5)))
    world = World(
        friction=friction,
        speeds_m_s=tuple(np.geomspace(1e-3, float(draw.choice([0.2, 0.45])), int(draw.integers(6, 15)))),
        gauges_pa=gauges[int(draw.integers(3))],
        repeats=int(draw.choice([1, 1, 2, 3])),
        order=str(draw.choice(["randomised", "randomised", "up and down", "ascending"])),
        sentinel_every=int(draw.choice([0, 5, 10])),
        samples=int(draw.choice([800, 2000])),
        burst_hz=float(draw.choice([0.0, 2000.0])),
        white_n=noise,
        correlated_n=noise * float(draw.uniform(0.0, 2.0)),
        correlation_s=float(np.exp(draw.uniform(np.log(0.003), np.log(0.3)))),
        cycle_share=float(draw.choice([0.0, 0.005, 0.02])),
        cycle_n=coulomb * float(draw.choice([0.0, 0.0, 0.01])),
        gain_share=float(draw.choice([0.0, 0.002])),
        zero_n=float(draw.normal(0.0, 2.0)),
        zero_drift_n=float(draw.normal(0.0, 0.5)),
        ripple=((float(draw.uniform(0.0, 0.03)), float(draw.integers(1, 6)), float(draw.uniform(0, 6.28))),),
        slope_share=float(draw.normal(0.0, 0.02)),
    )
    if world.sentinel_every or world.order == "randomised":
        world = replace(world, drift_share=float(draw.normal(0.0, 0.02)))
    return world


def rewrite(path: Path, change: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table, **cycle: object) -> dict:
    """Write a cycle's file again without its seal, with other samples or entries of its cycle; return its head."""
    head = json.loads(pl.read_parquet_metadata(path)["pneudrive"])
    head["cycle"] |= cycle
    change(pl.read_parquet(path)).write_parquet(path, metadata={"pneudrive": json.dumps(head)})
    return head


def gauges(condition: object) -> tuple[float, float]:
    """Planned gauge pressures of a result's condition, to 0.1 bar."""
    absolute = (condition.pressure_a_pa, condition.pressure_b_pa)  # type: ignore[attr-defined]
    a, b = (BAR * round((p - AMBIENT_PA) / BAR, 1) + 0.0 for p in absolute)
    return a, b


def hits(world: World, curve: object) -> NDArray[np.bool_]:
    """Whether the truth lies in the band, at each measured speed of a result's curve."""
    true = world.truth(curve.speed_m_s, gauges(curve.condition), curve.direction)  # type: ignore[attr-defined]
    return ((curve.low_n <= true) & (true <= curve.high_n))[curve.measured]  # type: ignore[attr-defined]
