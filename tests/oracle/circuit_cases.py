"""The circuits of the golden runs: each as a file that the product reads (`circuits`), here as numbers of the model.

Both are written by hand, so that a unit, a sign or a default that the product takes for another shows. All values are
chosen for the tests ("assumed"): they are typical of their size, and of no product.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from oracle.network import (
    AMBIENT,
    At,
    Column,
    Cushion,
    Face,
    Friction,
    Gas,
    Mass,
    Network,
    Path,
    Volume,
    check_valve,
    clip,
    path,
    position,
    travels,
)

ROOM = AMBIENT[1]
SUPPLY = (7e5, ROOM)
SEALS = Friction(20.0, 28.0, 0.02, 50.0, 5e4, 150.0)


@dataclass(frozen=True)
class Case:
    """A circuit, its start and commands, and what is compared: columns of the product and what they are here."""

    file: str
    commands: dict[str, str]
    duration: float
    model: Network
    gas: Sequence[Gas]
    positions: Sequence[float]
    steps: Sequence[tuple[float, dict[str, float]]]
    columns: dict[str, Callable[[At], float]] = field(default_factory=dict)
    rate: float = 200.0
    initial: dict[str, str] = field(default_factory=dict)

    @property
    def times(self) -> np.ndarray:
        """Times of the samples, s."""
        return np.arange(round(self.duration * self.rate) + 1) / self.rate


CASES: dict[str, Callable[[], Case]] = {}


def case(build: Callable[[], Case]) -> Callable[[], Case]:
    """Register a case under its function's name."""
    CASES[build.__name__] = build
    return build


def pressure(i: int) -> Callable[[At], float]:
    return lambda at: at.gas[i][0]


def temperature(i: int) -> Callable[[At], float]:
    return lambda at: at.gas[i][1]


def both(name: str, i: int) -> dict[str, Callable[[At], float]]:
    """Return pressure and temperature of a volume."""
    return {f"{name}.pressure": pressure(i), f"{name}.temperature": temperature(i)}


def motion(name: str, axis: int) -> dict[str, Callable[[At], float]]:
    """Return position and velocity of a mass."""
    return {f"{name}.position": lambda at: at.x[axis], f"{name}.velocity": lambda at: at.v[axis]}


def proportional(command: str, conductance: float, b: float, supply: int | Gas, a: int, at_b: int) -> list[Path]:
    """Return the four edges of a 5/3 valve whose spool follows its command at once."""

    def edge(sign: float, one: int | Gas, two: int | Gas) -> Path:
        def flow(at: At) -> float:
            ends = [at.gas[end] if isinstance(end, int) else end for end in (one, two)]
            return path(conductance * clip(sign * at.commands[command]), b, ends[0], ends[1])

        return flow, one, two

    return [edge(1.0, supply, a), edge(-1.0, a, AMBIENT), edge(-1.0, supply, at_b), edge(1.0, at_b, AMBIENT)]


def through(conductance: float, b: float, one: int | Gas, two: int | Gas) -> Path:
    """Return a restriction that is always open."""

    def flow(at: At) -> float:
        return path(conductance, b, *(at.gas[end] if isinstance(end, int) else end for end in (one, two)))

    return flow, one, two


@case
def tanks() -> Case:
    """Fill and vent three tanks: regulator that relieves, flow control, check valve, quick exhaust valve."""
    mains, set_pressure = (12e5, ROOM), 5e5

    def seat(p: float) -> float:
        return clip((set_pressure - p) / 6e4)

    def relief(at: At) -> float:
        return path(1e-9 * clip((at.gas[0][0] - set_pressure - 2e4) / 2e4), 0.3, at.gas[0], AMBIENT)

    def exhaust(at: At) -> float:
        u = clip((at.gas[2][0] - at.gas[0][0]) / 1e4)
        return path(3e-8 * u * u * (3.0 - 2.0 * u), 0.3, at.gas[2], AMBIENT)

    return Case(
        file="tests/oracle/circuits/tanks.toml",
        commands={},
        duration=0.6,
        model=Network(
            volumes=[Volume(1e-3), Volume(3e-4), Volume(2e-4)],
            paths=[
                (lambda at: path(2e-8 * at.others[0], 0.3, mains, at.gas[0]), mains, 0),
                (relief, 0, AMBIENT),
                through(2e-9, 0.3, 0, 1),
                (lambda at: check_valve(1e-8, 0.3, 1e4, at.gas[0], at.gas[1]), 0, 1),
                (lambda at: check_valve(1e-8, 0.3, 1e4, at.gas[0], at.gas[2]), 0, 2),
                (exhaust, 2, AMBIENT),
            ],
            others=[seat(2e5)],
            rates=lambda at: [(seat(at.gas[0][0]) - at.others[0]) / 0.03],
        ),
        gas=[(2e5, ROOM), (6e5, ROOM), (6.5e5, ROOM)],
        positions=[],
        steps=[(0.0, {})],
        columns={**both("one", 0), **both("two", 1), **both("three", 2), "reg.relief_flow": relief},
    )


@case
def single_acting() -> Case:
    """Drive a cylinder with a spring and a breather on a 3/2 switching valve that is off twice for a while."""
    # On at 0, off at 0.25 s, on at 0.33 s: dead time and travel by a share of 0.2 of 9 ms and 12 ms.
    moves = travels([(0.0081, 0.0099), (0.25 + 0.0108, 0.25 + 0.0132), (0.33 + 0.0081, 0.33 + 0.0099)])

    def fill(at: At) -> float:
        return path(0.86e-8 * clip(2.0 * position(moves, at.t) - 1.0), 0.31, SUPPLY, at.gas[0])

    def vent(at: At) -> float:
        return path(0.2e-8 * clip(1.0 - 2.0 * position(moves, at.t)), 0.25, at.gas[0], AMBIENT)

    middles = [0.5 * (one + two) for (one, _), (two, _) in zip(moves[::2], moves[1::2], strict=True)]
    return Case(
        file="tests/oracle/circuits/single_acting.toml",
        commands={"valve": "0 s: 1, 0.25 s: 0, 0.33 s: 1"},
        duration=0.6,
        model=Network(
            volumes=[Volume(5e-6, heat_transfer=30.0), Volume(4e-6, heat_transfer=30.0)],
            paths=[(fill, SUPPLY, 0), (vent, 0, AMBIENT), through(0.3e-8, 0.35, 1, AMBIENT)],
            masses=[Mass(0.8, SEALS)],
            faces=[Face(0, 0, 0.025), Face(1, 0, 0.025, 0.01, 0.1)],
            forces=[(0, lambda at: -15.0 - 5e3 * at.x[0])],
        ),
        gas=[(4.3e5, ROOM), AMBIENT],
        positions=[0.03],
        steps=[(t, {}) for t in sorted([0.0, *(t for t, _ in moves), *middles])],
        columns={**motion("clamp", 0), **both("clamp.a", 0), **both("clamp.b", 1)},
    )


@case
def two_cylinders() -> Case:
    """Drive two cylinders on a tank behind a regulator that relieves, one of them upright."""
    left, right = Friction(30.0, 40.0, 0.02, 60.0, 5e4, 150.0), SEALS
    mains, warm = (9e5, ROOM), 30.0
    set_pressure, drop, lag = 6e5 + AMBIENT[0], 6e4, 0.03

    def seat(at: At) -> float:
        return path(3e-8 * at.others[0], 0.3, mains, at.gas[0])

    def relief(at: At) -> float:
        return path(1e-9 * clip((at.gas[0][0] - set_pressure - 2e4) / 2e4), 0.3, at.gas[0], AMBIENT)

    return Case(
        file="tests/oracle/circuits/two_cylinders.toml",
        commands={
            "valve_l": "0 s: 0, 0.05 s: 0.6, 0.13 s: -0.4, 0.3 s: 0.1",
            "valve_r": "0 s: 0, 0.1 s: -0.8, 0.18 s: 0.6, 0.3 s: 0",
        },
        duration=0.5,
        model=Network(
            volumes=[Volume(5e-4, 0.04, 10.0), *(Volume(v, 0.0, warm) for v in (8e-6, 9e-6, 1e-5, 1e-5))],
            paths=[
                (seat, mains, 0),
                (relief, 0, AMBIENT),
                *proportional("l", 2e-8, 0.3, 0, 1, 2),
                *proportional("r", 1.2e-8, 0.25, 0, 3, 4),
            ],
            masses=[Mass(3.0, left), Mass(2.0, right)],
            faces=[
                Face(1, 0, 0.032),
                Face(2, 0, 0.032, 0.012, 0.2),
                Face(3, 1, 0.025),
                Face(4, 1, 0.025, 0.0, 0.3),
            ],
            forces=[(0, lambda _: -3.0 * 9.80665)],
            others=[0.0],
            rates=lambda at: [(clip((set_pressure - at.gas[0][0]) / drop) - at.others[0]) / lag],
        ),
        gas=[(7.3e5, ROOM), (3.2e5, ROOM), (3e5, ROOM), (3e5, ROOM), (3e5, ROOM)],
        positions=[0.04, 0.25],
        steps=[
            (0.0, {"l": 0.0, "r": 0.0}),
            (0.05, {"l": 0.6}),
            (0.1, {"r": -0.8}),
            (0.13, {"l": -0.4}),
            (0.18, {"r": 0.6}),
            (0.3, {"l": 0.1, "r": 0.0}),
        ],
        columns={
            **motion("left", 0),
            **motion("right", 1),
            **both("tank", 0),
            **both("left.a", 1),
            **both("left.b", 2),
            **both("right.a", 3),
            **both("right.b", 4),
            "reg.mass_flow": seat,
            "reg.relief_flow": relief,
        },
    )


@case
def cushion() -> Case:
    """Drive a piston that runs into its cushion, is thrown back, and is drawn out of it through the check valve."""
    plunger = 0.014
    bore = 2e-3 * 0.25 * math.pi * plunger**2
    cushioned = Cushion(1, 2, 0, plunger, 0.018, 2e-4, 0.2)

    def free_bore(at: At) -> float:
        _, out, _ = cushioned.out(at.x[0])
        return path(bore * out / (out + 2e-4), 0.3, at.gas[1], at.gas[2])

    return Case(
        file="tests/oracle/circuits/cushion.toml",
        commands={"valve": "0 s: 0.5, 0.3 s: -0.4"},
        duration=0.5,
        model=Network(
            volumes=[Volume(1e-5, 0.0, 40.0), Volume(2e-6, 0.0, 40.0), Volume(5e-6, 0.0, 40.0)],
            paths=[
                *proportional("valve", 1e-8, 0.3, SUPPLY, 0, 2),
                (free_bore, 1, 2),
                through(0.02e-8, 0.3, 1, 2),
                (lambda at: check_valve(0.8e-8, 0.3, 1e4, at.gas[2], at.gas[1]), 2, 1),
            ],
            masses=[Mass(4.0, SEALS)],
            faces=[Face(0, 0, 0.032), Face(1, 0, 0.032, 0.012, 0.2)],
            cushions=[cushioned],
        ),
        gas=[(2e5, ROOM), (3e5, ROOM), (3e5, ROOM)],
        positions=[0.06],
        steps=[(0.0, {"valve": 0.5}), (0.3, {"valve": -0.4})],
        columns={
            **motion("cylinder", 0),
            **both("cylinder.a", 0),
            **both("cylinder.b", 1),
            "cylinder.b.port_pressure": pressure(2),
        },
    )


@case
def line() -> Case:
    """Drive a cylinder behind two tubes of four lengths each, with waves."""
    length, diameter, cells = 1.5, 0.006, 4
    area = 0.25 * math.pi * diameter**2
    mouth, laminar = 2e-3 * area, 3.66 * 0.026 / diameter
    joint = Volume(2e-7)
    chamber = Volume(1e-5, 0.0, 30.0)

    def tube() -> list[Volume]:
        parts = [length / cells * share for share in (0.5, 1.0, 1.0, 1.0, 0.5)]
        return [Volume(area * part, math.pi * diameter * part, laminar) for part in parts]

    # Volumes: joint, tube, chamber of a side from 0 on, of the other from 7 on.
    columns, paths = [], proportional("valve", 1.5e-8, 0.3, SUPPLY, 0, 7)
    for first in (0, 7):
        columns += [Column(first + 1 + i, first + 2 + i, length / cells, diameter) for i in range(cells)]
        paths += [through(mouth, 0.528, first, first + 1), through(mouth, 0.528, first + 5, first + 6)]
    inlet, outlet = paths[4][0], paths[5][0]
    return Case(
        file="tests/oracle/circuits/line.toml",
        commands={"valve": "0 s: 0, 0.02 s: 0.7, 0.13 s: -0.6, 0.26 s: 0"},
        duration=0.5,
        model=Network(
            volumes=[joint, *tube(), chamber, joint, *tube(), chamber],
            paths=paths,
            masses=[Mass(2.0, SEALS)],
            faces=[Face(6, 0, 0.025), Face(13, 0, 0.025, 0.0, 0.4)],
            columns=columns,
        ),
        gas=[(3e5, ROOM)] * 14,
        positions=[0.1],
        steps=[(0.0, {"valve": 0.0}), (0.02, {"valve": 0.7}), (0.13, {"valve": -0.6}), (0.26, {"valve": 0.0})],
        columns={
            **motion("cylinder", 0),
            **both("cylinder.a", 6),
            **both("cylinder.b", 13),
            "tube_a.mass_flow": inlet,
            "tube_a.outlet_flow": outlet,
        },
    )


@case
def two_spools() -> Case:
    """Drive a cylinder on two 3/2 proportional valves: spools of second order, top speed, dead time, play, leaks."""
    w, zeta, top, delay, overlap = 2.0 * math.pi * 90.0, 0.6, 1.0 / 0.004, 0.0015, 0.04
    leak, leak_width = 0.01, 0.05

    def share(x: float) -> float:
        return clip((x - overlap) / (1.0 - overlap))

    def edges(chamber: int, spool: int) -> list[Path]:
        def to(at: At) -> float:
            x = at.others[spool]
            return path(1e-8 * (share(x) + leak * math.exp(-abs(x) / leak_width)), 0.3, SUPPLY, at.gas[chamber])

        def out(at: At) -> float:
            x = at.others[spool]
            return path(1.3e-8 * (share(-x) + leak * math.exp(-abs(x) / leak_width)), 0.35, at.gas[chamber], AMBIENT)

        return [(to, SUPPLY, chamber), (out, chamber, AMBIENT)]

    def rates(at: At) -> list[float]:
        out = []
        for i, name in ((0, "a"), (2, "b")):
            x, v = at.others[i : i + 2]
            wanted = min(max(w / (2.0 * zeta) * (at.commands[name] - x), -top), top)
            out += [v, 2.0 * zeta * w * (wanted - v)]
        return out

    # Behind a play of 0.02 a command that rises acts less by 0.01, one that falls more.
    a = [(0.0, 0.0), (0.02, 0.7), (0.15, -0.5), (0.3, 0.1)]
    b = [(0.0, 0.0), (0.03, -0.6), (0.17, 0.45), (0.32, 0.05)]

    def behind(entries: list[tuple[float, float]], name: str) -> list[tuple[float, dict[str, float]]]:
        held, out = 0.0, []
        for t, command in entries:
            held = min(max(held, command - 0.01), command + 0.01)
            out.append((t if t == 0.0 else t + delay, {name: held}))
        return out

    said = [", ".join(f"{t:g} s: {command:g}" for t, command in entries) for entries in (a, b)]
    return Case(
        file="tests/oracle/circuits/two_spools.toml",
        commands={"v_a": said[0], "v_b": said[1]},
        duration=0.45,
        model=Network(
            volumes=[Volume(9e-6, 0.0, 30.0), Volume(1.1e-5, 0.0, 30.0)],
            paths=[*edges(0, 0), *edges(1, 2)],
            masses=[Mass(2.5, SEALS)],
            faces=[Face(0, 0, 0.032, 0.012), Face(1, 0, 0.032, 0.012, 0.25)],
            others=[0.0] * 4,
            rates=rates,
        ),
        gas=[(4e5, ROOM), (4e5, ROOM)],
        positions=[0.1],
        steps=sorted([*behind(a, "a"), *behind(b, "b")], key=lambda step: step[0]),
        columns={
            **motion("cylinder", 0),
            **both("cylinder.a", 0),
            **both("cylinder.b", 1),
            "v_a.position": lambda at: at.others[0],
            "v_b.position": lambda at: at.others[2],
        },
        rate=400.0,
    )


@case
def pulses() -> Case:
    """Run the example pwm_axis.toml: four 2/2 switching valves under pulses, each of them as it is."""
    supply, period, duration = (6e5 + AMBIENT[0], ROOM), 0.01, 0.25
    dead, travel = 0.002 * 0.9, 0.002 * 0.2
    widths = {
        "in_a": [(0.0, 0.6), (0.12, 0.0)],
        "out_b": [(0.0, 0.5), (0.12, 0.3)],
        "out_a": [(0.0, 0.0), (0.12, 0.45)],
    }

    def armature(entries: list[tuple[float, float]]) -> list[tuple[float, float]]:
        moves = []
        for i in range(round(duration / period)):
            width = [share for t, share in entries if t <= i * period + 1e-9][-1:] or [0.0]
            if width[0] > 0.0:
                starts = (i * period + dead, (i + width[0]) * period + dead)
                moves += [(start, start + travel) for start in starts]
        return travels(moves)

    moves = {name: armature(entries) for name, entries in widths.items()}

    def valve(name: str, one: int | Gas, two: int | Gas) -> Path:
        def flow(at: At) -> float:
            ends = [at.gas[end] if isinstance(end, int) else end for end in (one, two)]
            return path(0.3e-8 * position(moves[name], at.t), 0.3, ends[0], ends[1])

        return flow, one, two

    seals = Friction(25.0, 35.0, 0.01, 60.0, 1e5, 300.0)
    breaks = sorted({0.0} | {t for each in moves.values() for t, _ in each if t < duration})
    return Case(
        file="examples/pwm_axis.toml",
        commands={name: ", ".join(f"{t:g} s: {width:g}" for t, width in entries) for name, entries in widths.items()},
        duration=duration,
        model=Network(
            volumes=[Volume(8e-6, 0.0, 30.0), Volume(8e-6, 0.0, 30.0)],
            paths=[valve("in_a", supply, 0), valve("out_a", 0, AMBIENT), valve("out_b", 1, AMBIENT)],
            masses=[Mass(1.5, seals)],
            faces=[Face(0, 0, 0.032, 0.012), Face(1, 0, 0.032, 0.012, 0.1)],
        ),
        gas=[(3e5, ROOM), (3e5, ROOM)],
        positions=[0.03],
        steps=[(t, {}) for t in breaks],
        columns={
            **motion("cylinder", 0),
            **both("cylinder.a", 0),
            **both("cylinder.b", 1),
            "in_a.position": lambda at: position(moves["in_a"], at.t),
        },
        rate=400.0,
        initial={"cylinder.position": "30 mm", "cylinder.a": "3 bar abs", "cylinder.b": "3 bar abs"},
    )


@case
def play() -> Case:
    """Drive a cylinder that moves a second mass over a coupling with play, to and fro."""
    stiffness, damping, gap, depth = 4e4, 60.0, 0.002, 1e-4

    def force(at: At) -> float:
        """Return the force in +x on the second mass."""
        z, rate = at.x[0] - at.x[1], at.v[0] - at.v[1]
        for sign in (1.0, -1.0):
            d = sign * z - 0.5 * gap
            if d > 0.0:
                return sign * max(0.0, stiffness * d + damping * sign * rate * min(d / depth, 1.0))
        return 0.0

    guide = Friction(8.0, 10.0, 0.02, 15.0, 2e4, 60.0)
    return Case(
        file="tests/oracle/circuits/play.toml",
        commands={"valve": "0 s: 0, 0.01 s: 0.4, 0.13 s: -0.3, 0.3 s: 0.2"},
        duration=0.5,
        model=Network(
            volumes=[Volume(1e-5, 0.0, 30.0), Volume(1e-5, 0.0, 30.0)],
            paths=proportional("valve", 1.5e-8, 0.3, SUPPLY, 0, 1),
            masses=[Mass(1.2, SEALS), Mass(3.0, guide)],
            faces=[Face(0, 0, 0.032), Face(1, 0, 0.032, 0.012, 0.3)],
            forces=[(0, lambda at: -force(at)), (1, force)],
        ),
        gas=[(3e5, ROOM), (3.4e5, ROOM)],
        positions=[0.1, 0.1002],
        steps=[(0.0, {"valve": 0.0}), (0.01, {"valve": 0.4}), (0.13, {"valve": -0.3}), (0.3, {"valve": 0.2})],
        columns={
            **motion("cylinder", 0),
            **motion("slide", 1),
            **both("cylinder.a", 0),
            **both("cylinder.b", 1),
            "coupling.force": force,
        },
    )
