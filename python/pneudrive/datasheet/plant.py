"""Plant model for characteristics: one piston with its valves, evaluated by the core at any state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq

from pneudrive.arrays import Array, Keyed, NamedNumbers, Pair, Plain
from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.describe.circuit import Circuit
from pneudrive.describe.drive import Drive
from pneudrive.describe.tables.valve_flow import EXHAUST, FLOW_KEYS, path_of
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.identify.export import steady_friction
from pneudrive.simulation.session import Linear, Session

# --- The valves of a drive as one signal u: 1 and -1 move the piston out and back, 0 shuts the valves.
#
# A switching valve has only the commands of its positions. To hold a state, a proportional valve with the same paths
# replaces the switching valve. It is fully open to one side or the other.

#: Keys that only a switching valve has.
_TIMES = ("time_on", "time_off", "travel_share", "pwm_frequency", "pwm_model", "normally", "centre")
LOCK = "rod-lock"


@dataclass(frozen=True)
class Actuation:
    """Commands of all valves for the two directions of the piston.

    Attributes
    ----------
    out, back : dict
        Valve -> its command for motion towards the end of chamber b (out) or of chamber a (back).
    has_shares : bool
        Whether the drive itself accepts commands between 0 and full opening.
    held : dict
        Switching valve -> its command -> command of the proportional valve that replaces it. With a switching valve,
        the signal u is 1 or -1.
    """

    out: NamedNumbers
    back: NamedNumbers
    has_shares: bool = True
    held: Mapping[str, Mapping[float, float]] = field(default_factory=dict)

    def commands(self, u: float) -> NamedNumbers:
        """Return the command of each valve; an empty dict leaves switching valves at rest.

        Raises
        ------
        CommandError
            A switching valve has no such command.
        """
        if self.held and u == 0.0:
            return {}
        if self.held and abs(u) != 1.0:
            raise CommandError.of("datasheet.command", u=u, valves=" and ".join(self.held))
        full = self.out if u >= 0.0 else self.back
        return {name: abs(u) * value for name, value in full.items()}


def held_tables(circuit: Circuit) -> Plain:
    """Return the tables of a circuit after replacing its switching valves with proportional valves."""
    tables = circuit.to_dict()
    parts = {name: circuit.components[name] for name in circuit.commandable}
    held = {name: _proportional(part.kind, part.plain()) for name, part in parts.items() if part.kind in HELD}
    tables["components"] |= held
    if "initial" in tables:  # a proportional valve has no last position to start from
        tables["initial"] = {name: table for name, table in tables["initial"].items() if name not in held}
    return tables


#: Kind of a switching valve -> kind of the proportional valve with the same paths.
HELD = {
    "valve/switching-2/2": "valve/proportional-3/2",
    "valve/switching-3/2": "valve/proportional-3/2",
    "valve/switching-5/2": "valve/proportional-5/3",
    "valve/switching-5/3": "valve/proportional-5/3",
    "valve/impulse-5/2": "valve/proportional-5/3",
}


def _proportional(kind: str, table: Plain) -> Plain:
    """Return the table of the proportional valve with the paths of a switching valve."""
    out = {key: value for key, value in table.items() if key not in _TIMES} | {"kind": HELD[kind]}
    if HELD[kind] != "valve/proportional-5/3":
        return out
    supply, exhaust = path_of(table, exhaust=False), path_of(table, exhaust=True)
    out = {key: value for key, value in out.items() if not key.startswith(EXHAUST) and key not in FLOW_KEYS}
    if supply == exhaust:
        return out | supply
    from pneudrive.describe.components import component

    c, c_exhaust = (component({"kind": "fitting"} | path).numbers(1e5) for path in (supply, exhaust))
    points = []
    for opening in (-1.0, 0.0, 1.0):
        point: Plain = {"opening": opening}
        for port, sign in (("4", 1.0), ("2", -1.0)):
            for way, path, towards in (("supply", c, sign), ("exhaust", c_exhaust, -sign)):
                size = path["conductance"] if opening == towards else 0.0
                point[f"{way}_{port}"] = f"{size!r} m3/(s Pa)"
                point[f"{way}_{port}_critical_pressure_ratio"] = path["critical_pressure_ratio"]
        points.append(point)
    return out | {"flow_table": points, "flow_shape": "straight"}


def positions_of(kind: str, table: Keyed) -> dict[float, float]:
    """Return the commands to try for a valve, each with the command of the proportional valve that replaces it."""
    if kind == LOCK:
        return {0.0: 0.0}  # open
    both = {1.0: 1.0, -1.0: -1.0}
    if kind.startswith(("valve/proportional", "valve/impulse")):
        return both
    if kind == "valve/switching-5/3":
        return both | ({0.0: 0.0} if table.get("centre", "closed") == "closed" else {})
    on, off = (1.0, 0.0) if kind == "valve/switching-2/2" else (1.0, -1.0)
    return {0.0: on, 1.0: off} if table.get("normally") == "open" else {0.0: off, 1.0: on}


RTOL = 1e-6  # of sessions that are not advanced
PINNED_N, LASTING_S = 1e9, 600.0  # friction that holds any piston, and a time in which chambers fill and empty
MOST_VALVES, CLOSE = 4, 1e-6  # whose positions are tried; forces whose difference is below this part are equal
NO_FRICTION_N = 1e-9  # a law of friction has a level above 0
CONTACT_N, LEAST_LAG_M, MOST_LAG = 1e-3, 1e-7, 0.1  # force on a coupling; its lags: least, most over the stroke
LEAST_VELOCITY = 1e-5  # m/s: the contact just slides; its steady friction is the breakaway force
#: Kinds of components at which a line to a chamber ends.
_ENDS = ("tank", "reservoir")
#: Parameters of valve and piston (names or their first parts) that add states, but have no effect on a steady state
#: away from the ends.
_LAGS = ("frequency", "damping_ratio", "stroke_time", "delay", "hysteresis", "cushion_")


class HeldDrive:
    """One piston with valves that follow a common signal; see `Actuation`.

    Parameters
    ----------
    described : Drive or Circuit
    actuation : Actuation, optional
        Commands of the valves for the two directions; default: from `actuation_of`.

    Raises
    ------
    CommandError
        The drive does not have exactly one piston that its valves move in both directions, or a tube cannot be held.
    DescriptionError
        `described` is neither a drive nor a circuit.
    """

    def __init__(self, described: Drive | Circuit, *, actuation: Actuation | None = None) -> None:
        if not hasattr(described, "core_json"):
            raise DescriptionError(f"a {type(described).__name__} is not a drive", remedy='pn.Drive.load("drive.toml")')
        self.described = described
        self.circuit = described.circuit
        self.parts = self.circuit.components
        pistons = [name for name, one in self.parts.items() if one.entry["kind"].startswith("cylinder/")]
        self.valves = list(self.circuit.commandable)
        if len(pistons) != 1 or not self.valves:
            raise CommandError.of(
                "datasheet.pistons", name=self.circuit.name, pistons=len(pistons), valves=len(self.valves)
            )
        self.piston, self.valve = pistons[0], self.valves[0]
        self.cylinder: Any = self.parts[self.piston]
        if actuation is None and isinstance(described, Drive) and not described.valve.is_switching:
            actuation = Actuation({self.valve: 1.0}, {self.valve: -1.0})
        self.actuation = actuation_of(self.circuit) if actuation is None else actuation
        self.load = f"{self.piston}.load_force_n"
        self.core = self.circuit.system.compiled()
        self.start_values = self.circuit.core_initial(None)
        ends = ".pressure_pa"
        self.nodes = tuple(name.removesuffix(ends) for name in self.core.start_names if name.endswith(ends))

    @cached_property
    def static(self) -> HeldDrive:
        """The drive without valve lags and cushions, for steady states and linear models.

        Raises
        ------
        CommandError
            A component has states that cannot be held, such as the flow of a distributed tube.
        """
        plant = self.with_held_valves
        tables = {name: plant.table(name) for name in (*plant.valves, self.piston)}
        lost = {name: dict.fromkeys(k for k in table if k.startswith(_LAGS)) for name, table in tables.items()}
        if any(lost.values()):
            plant = plant.varied(lost)
        held = {f"{node}.mass_kg" for node in plant.nodes}
        loose = [name for name, _ in plant.core.states if name.endswith(("kg", "kg_s")) and name not in held]
        if loose:
            raise CommandError.of("datasheet.loose", name=self.name, state=loose[0])
        return plant

    @cached_property
    def with_held_valves(self) -> HeldDrive:
        """The drive with proportional valves that hold the positions of its switching valves."""
        held = self.actuation.held
        if not held:
            return self
        out = {name: held.get(name, {}).get(value, value) for name, value in self.actuation.out.items()}
        back = {name: held.get(name, {}).get(value, value) for name, value in self.actuation.back.items()}
        actuation = Actuation(out, back, has_shares=False)
        return HeldDrive(type(self.circuit).model_validate(held_tables(self.circuit)), actuation=actuation)

    def before(self, u: float) -> Pair:
        """Return the pressures (Pa) of chambers a and b before a stroke. They are steady under the opposite command."""
        ambient, supply = self.ambient[0], self.supply_pa
        usual = (ambient, supply) if u > 0.0 else (supply, ambient)
        if self.described.system.names:
            return usual
        session = self.settled(math.copysign(1.0, -u), 0.0 if u > 0.0 else self.stroke_m)
        return self.pressures(np.array([(session.read(f"{node}.pressure_pa"), 0.0) for node in self.nodes]))

    def settled(self, u: float, position: float) -> Session:
        """Return a session in which the valves were held for a long time, with the piston pinned by friction."""
        plant, pinned = self.with_held_valves, {"friction": {"law": "coulomb", "coulomb": f"{PINNED_N!r} N"}}
        gas = np.tile([0.5 * (self.supply_pa + self.ambient[0]), self.ambient[1]], (len(plant.nodes), 1))
        session = plant.varied({self.piston: pinned}).session(u, position, 0.0, gas)
        session.advance(LASTING_S)
        return session

    def table(self, name: str) -> Plain:
        """Return the table of a component as described."""
        return self.parts[name].plain()

    def varied(self, changes: Mapping[str, Keyed]) -> HeldDrive:
        """Return the drive with changed values of some components. None removes a value; the commands do not change."""
        tables = self.circuit.to_dict()
        for name, change in changes.items():
            table = {**self.table(name), **change}
            tables["components"][name] = {key: value for key, value in table.items() if value is not None}
        return HeldDrive(type(self.circuit).model_validate(tables), actuation=self.actuation)

    def sizes(self, commands: Sequence[float]) -> tuple[float, ...]:
        """Return the given magnitudes of a command, or only 1 if a valve has no partial openings."""
        return tuple(commands) if self.actuation.has_shares else (1.0,)

    def plans(self, steps: Sequence[Pair]) -> dict[str, str]:
        """Return the command of each valve over time, from pairs of time (s) and signal."""
        rows = [(t, self.actuation.commands(u)) for t, u in steps]
        return {name: ", ".join(f"{float(t)!r} s: {float(row[name])!r}" for t, row in rows) for name in self.valves}

    def line(self, side: str) -> tuple[str, list[tuple[str, str, str]]] | None:
        """Return the port of the valve that feeds chamber a or b, and the components in between.

        Components are ordered from the valve to the chamber, each with its port towards the valve and its port towards
        the chamber. Return None if no single path of components with two ports leads to the chamber.
        """
        wiring, passed = self.circuit.wiring, list[tuple[str, str, str]]()
        ends = [port for port in wiring.at if port.id == f"{self.piston}.{side}"]
        while len(ends) == 1:
            done = (self.piston, *(name for name, *_ in passed))
            near = (port for port in wiring.at[ends[0]].ports if port.kind == "gas" and not port.is_pilot)
            others = [port for port in near if port.component not in done]
            if len(others) != 1 or self.parts[others[0].component].entry["kind"] in _ENDS:
                return None
            (port,) = others
            if port.component in self.valves:
                return port.id, passed[::-1]
            ends = [other for other in wiring.ports(port.component) if other != port and other in wiring.at]
            passed += [(port.component, end.name, port.name) for end in ends]
        return None

    @property
    def sides(self) -> tuple[str, ...]:
        """Chambers with a gas node: a and b, or only a if b is open to the ambient."""
        return tuple(side for side in "ab" if f"{self.piston}.{side}" in self.nodes)

    def edge(self, direction: float) -> tuple[float, bool]:
        """Return the signal up to which a valve is shut in a direction, and whether its flow begins with zero slope.

        The flow of a smooth table begins with zero slope.
        """
        edges = [(0.0, False)]
        for name, side in self.actuation.commands(math.copysign(1.0, direction)).items():
            if side:
                core = self.parts[name].core(0.0)
                points = core.get("points", ())
                shut = (side * point[0] for point in points if not any(point[1::2]))
                is_smooth = bool(len(points)) and core["choices"].get("flow_shape") == "smooth"
                edges.append((max(core["numbers"].get("overlap", 0.0), 0.0, *shut), is_smooth))
        return max(edges)

    def is_at_b(self, node: str) -> bool:
        """Return whether the gas of a node belongs to the line of chamber b."""
        if self.described.system.names:
            return node.endswith((".2", "_b")) or "_b." in node
        line = self.line("b")
        return line is not None and node.partition(".")[0] in {name for name, *_ in line[1]}

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.circuit.name

    @property
    def stroke_m(self) -> float:
        """Stroke in m."""
        return float(self.cylinder.stroke)

    @property
    def middle_m(self) -> float:
        """Position at mid stroke, in m."""
        return 0.5 * self.stroke_m

    def check_position(self, position: float) -> None:
        """Reject a position outside the stroke, m."""
        if not 0.0 <= position <= self.stroke_m:
            rule, remedy = f"0 to the stroke, {self.stroke_m:g} m", 'Write the unit: position = "150 mm".'
            raise CommandError(f"position = {position:g} m is out of bounds", rule=rule, remedy=remedy)

    @property
    def hanging_n(self) -> float:
        """Force (N) on piston and moved bodies without pressure: the larger of weight alone and weight with loads."""
        inclines = {name: getattr(self.parts[name], "incline", 0.0) for name in self.moved}
        weight = sum(self.masses[name] * STANDARD_GRAVITY_M_S2 * math.sin(at) for name, at in inclines.items())
        return max(abs(weight), abs(weight - self.sum_of("load", "force")))

    def sum_of(self, kind: str, key: str) -> float:
        """Return the sum of one number over all components of a kind."""
        return sum(getattr(part, key) for part in self.parts.values() if part.kind == kind)

    @cached_property
    def supply(self) -> str:
        """Name of the input that is the pressure of the supply."""
        inputs = [name for name, *_ in self.core.inputs if name.endswith(".pressure_pa")]
        if len(inputs) != 1:
            raise CommandError(f"{self.name} has {len(inputs)} supplies", rule="one reservoir must feed the valve")
        return inputs[0]

    @cached_property
    def supply_pa(self) -> float:
        """Absolute pressure of the supply, in Pa."""
        return Session(self.core.start(self.start_values, RTOL)).read(self.supply)

    @property
    def ambient(self) -> Pair:
        """Ambient pressure (Pa) and temperature (K)."""
        return float(self.circuit.ambient.pressure_pa), float(self.circuit.ambient.temperature_k)

    @cached_property
    def frictionless(self) -> HeldDrive:
        """The same drive with negligible friction."""
        law = {"friction": {"law": "coulomb", "coulomb": f"{NO_FRICTION_N!r} N"}}
        return self.varied(dict.fromkeys(self.frictions, law))

    @cached_property
    def frictions(self) -> dict[str, Plain]:
        """Component -> friction in the core's form, for the piston and each slide that has friction."""
        laws = {name: getattr(self.parts[name], "friction", None) for name in self.slides}
        return {name: law.core() for name, law in laws.items() if law is not None}

    @cached_property
    def slides(self) -> tuple[str, ...]:
        """Names of the piston, then of the other components with a position, a velocity and a load."""
        loads = [name.removesuffix(".load_force_n") for name, *_ in self.core.inputs if name.endswith(".load_force_n")]
        moved = (name for name in loads if name != self.piston and f"{name}.velocity_m_s" in self.core.start_names)
        return (self.piston, *moved)

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of the piston and of the components that couplings move with it."""
        return tuple(self.lags) if len(self.slides) > 1 else self.slides

    @cached_property
    def lags(self) -> NamedNumbers:
        """Coupled component -> its distance (m) behind the piston in slow motion in +x.

        A coupling transmits weight and friction of its slide only at the end of its play.
        """
        plant, lags = self.frictionless, {self.piston: 0.0}  # the same masses and couplings
        middle, least = self.middle_m, LEAST_LAG_M
        for name in self.slides[1:]:
            carried = self.sliding_of(name, LEAST_VELOCITY, (self.ambient[0], self.ambient[0]), middle) + CONTACT_N

            def missing(lag: float, name: str = name, carried: float = carried) -> float:
                session = plant.session(1.0, middle, lags={**lags, name: lag})
                return carried - self.masses[name] * session.read(f"{name}.acceleration_m_s2")

            at, sign = 0.0, math.copysign(1.0, missing(0.0))
            while sign * missing(at) > 0.0 and abs(at) < MOST_LAG * self.stroke_m:
                at = sign * max(2.0 * abs(at), least)
            if sign * missing(at) <= 0.0:
                lags[name] = float(np.asarray(brentq(missing, 0.5 * at, at, xtol=1e-3 * least)))
        return lags

    def session(
        self,
        command: float,
        position: float,
        velocity: float = 0.0,
        gas: Array | None = None,
        lags: Mapping[str, float] | None = None,
    ) -> Session:
        """Return a session at a state; other components move at the velocity of the piston.

        Parameters
        ----------
        command, position, velocity : float
            SI.
        gas : ndarray, optional
            Absolute pressure (Pa) and temperature (K) at `nodes`, with the shape (nodes, 2).
        lags : mapping, optional
            Component -> distance behind the piston, in m; by default the distance in the start state.
        """
        self.check_position(position)
        start, moved = dict(self.start_values), position - self.start_values[f"{self.piston}.position_m"]
        for name in self.slides[1:]:
            start |= {f"{name}.position_m": start[f"{name}.position_m"] + moved, f"{name}.velocity_m_s": velocity}
        start |= {f"{name}.position_m": position - lag for name, lag in (lags or {}).items()}
        start |= {f"{self.piston}.position_m": position, f"{self.piston}.velocity_m_s": velocity}
        if gas is not None:
            for node, (pressure, temperature) in zip(self.nodes, gas, strict=True):
                start |= {f"{node}.pressure_pa": pressure, f"{node}.temperature_k": temperature}
        try:
            session = Session(self.core.start(start, RTOL))
        except (ValueError, RuntimeError) as error:
            raise CommandError(str(error)) from None
        for name, value in self.actuation.commands(command).items():
            session.set(f"{name}.command", value)
        return session

    def force(self, linear: Linear) -> float:
        """Return the force (N) in +x on the piston and the slides that it moves, without friction."""
        found, force = dict(zip(linear.outputs, linear.output.tolist(), strict=True)), 0.0
        for name in self.moved:
            friction, stop = (found.get(f"{name}.{kind}_force_n", 0.0) for kind in ("friction", "end_stop"))
            force += found[f"{name}.acceleration_m_s2"] * self.masses[name] + friction + stop
        return force

    @property
    def mass(self) -> float:
        """Mass of the piston and of the bodies that it moves, in kg."""
        return sum(self.masses[name] for name in self.moved)

    @cached_property
    def masses(self) -> NamedNumbers:
        """Mass (kg) that moves with each of `slides`, from the core's acceleration per unit of load."""
        gas = np.tile(self.ambient, (len(self.nodes), 1))
        half = 1.0 if self.actuation.held else 0.5
        loads = [f"{name}.load_force_n" for name in self.slides]
        found = {}
        for velocity in (0.0, 1.0):  # sticking: the contact takes the load
            linear = self.session(half, self.middle_m, velocity, gas).linearise(loads)
            for k, name in enumerate(self.slides):
                rate = linear.B[linear.states.index(f"{name}.velocity_m_s"), k]
                if rate != 0.0:
                    found.setdefault(name, float(1.0 / rate))
        return found

    def sliding(self, velocity: float, pressures: Pair, position: float) -> float:
        """Return the steady friction (N) of the piston and its slides at absolute pressures of chambers a and b."""
        return sum(self.sliding_of(name, velocity, pressures, position) for name in self.moved)

    def sliding_of(self, name: str, velocity: float, pressures: Pair, position: float) -> float:
        """Return the steady friction (N) of a component at a velocity, with the sign of the velocity."""
        if name not in self.frictions:
            return 0.0
        gauge_a, gauge_b = (pressure - self.ambient[0] for pressure in pressures)
        size = steady_friction(self.frictions[name], np.array([velocity]), gauge_a, gauge_b, position)[0]
        return float(np.copysign(size, velocity))

    def pressures(self, gas: Array) -> Pair:
        """Return the absolute pressures of chambers a and b."""
        return self.chamber(gas, "a")[0], self.chamber(gas, "b")[0]

    def chamber(self, gas: Array, which: str) -> Pair:
        """Return pressure and temperature of chamber a or b, or of the ambient if the chamber is open."""
        node = f"{self.piston}.{which}"
        if node not in self.nodes:
            return self.ambient
        pressure, temperature = gas[self.nodes.index(node)]
        return float(pressure), float(temperature)


_known: dict[str, Actuation] = {}  # by the hash of a circuit's description


def actuation_of(circuit: Circuit) -> Actuation:
    """Return the commands of the valves that cause the largest force on the fixed piston in each direction.

    If several choices cause nearly the same force, the one with the fewest commands is returned.

    Raises
    ------
    CommandError
        The circuit has another component with a command, too many valves, or valves that do not move the piston.
    """
    if circuit.description_hash in _known:
        return _known[circuit.description_hash]
    kinds = {name: circuit.components[name].kind for name in circuit.commandable}
    others = [name for name, kind in kinds.items() if not kind.startswith("valve/") and kind != LOCK]
    if others or len(kinds) > MOST_VALVES:
        what = f"{others[0]} takes a command, but is not a valve" if others else f"there are {len(kinds)} valves"
        rule = f"a characteristic needs one piston and 1 to {MOST_VALVES} valves"
        raise CommandError(f"{circuit.name}: {what}", rule=rule)
    positions = {name: positions_of(kind, circuit.components[name].plain()) for name, kind in kinds.items()}
    held = {name: positions[name] for name, kind in kinds.items() if kind in HELD}
    copy = type(circuit).model_validate(held_tables(circuit)) if held else circuit
    forces: list[tuple[float, NamedNumbers]] = []
    for choice in product(*positions.values()):
        commands = dict(zip(kinds, choice, strict=True))
        seen = {name: positions[name][command] for name, command in commands.items()}
        plant = HeldDrive(copy, actuation=Actuation(seen, seen))
        session = plant.settled(1.0, plant.middle_m)
        forces.append((session.read(f"{plant.piston}.friction_force_n"), commands))
    ends = []
    for sign in (-1.0, 1.0):
        largest = max(sign * force for force, _ in forces)
        close = [one for one in forces if sign * one[0] >= largest - CLOSE * abs(largest)]
        ends.append(min(close, key=lambda one: sum(value != 0.0 for value in one[1].values())))
    least, most = ends
    if not most[0] - least[0] > CLOSE * max(abs(most[0]), abs(least[0])):
        raise CommandError.of("datasheet.still", name=circuit.name, valves=", ".join(kinds))
    found = _known[circuit.description_hash] = Actuation(most[1], least[1], not held, held)
    return found
