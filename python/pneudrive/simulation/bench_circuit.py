"""Circuits of test stands: steady flow through a path, and a carriage with a force sensor that drags a piston."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pneudrive import constants, units
from pneudrive.arrays import Array, Keyed, NamedNumbers, Plain
from pneudrive.describe.system import short_name
from pneudrive.describe.tables.parts import Gas

SETTLED_S = 5.0  # time after which the flow through a line is steady
VACUUM = 1e-4  # ratio of the pressure behind a valve with choked flow to the pressure before the line


def steady_flow(
    parts: Keyed, way: Sequence[tuple[str, str, str]], before_pa: float, behind_pa: float, gas: Gas
) -> float:
    """Return the steady mass flow in kg/s through components in series between two pressures.

    The components are simulated for 5 s. The pressures between them are then constant.

    Parameters
    ----------
    parts : mapping
        Components by name, or their tables.
    way : sequence of (str, str, str)
        Each component with its inlet and outlet port, in the direction of the flow.
    before_pa, behind_pa : float
        Absolute pressures in Pa before and behind the path. The gas before the path has 20 degC, the reference
        temperature of ISO 6358.
    gas : Gas
    """
    from pneudrive.describe import Circuit
    from pneudrive.describe.tables.parts import Ambient

    temperature = units.UnitFloat(constants.ANR_TEMPERATURE_K, "K", "K")
    upstream = {"kind": "reservoir", "pressure": f"{before_pa!r} Pa abs", "temperature": temperature}
    leaves = ["upstream", *(f"{name}.{last}" for name, _, last in way)]
    enters = [*(f"{name}.{first}" for name, first, _ in way), "ambient"]
    stand = Circuit(
        gas=gas,
        ambient=Ambient(pressure=units.Pressure(behind_pa, gauge=False)),
        components={"upstream": upstream, **parts},
        connections=tuple(f"{one} -> {other}" for one, other in zip(leaves, enters, strict=True)),
    )
    run = stand.simulate(None, SETTLED_S, sample_rate=1.0 / SETTLED_S)
    return abs(float(run["upstream.mass_flow"][-1]))


#: Joint of the ambient air.
AMBIENT = "ambient"
#: Commanded speed below which a motion counts as ended at rest, m/s: the remaining speed is a rounding error.
AT_REST_M_S = 1e-9
#: Column of a run that does not belong to the piston -> name in the circuit.
_OTHERS = {
    "time_s": "time_s",
    "carriage_position_m": "carriage.position_m",
    "carriage_velocity_m_s": "carriage.velocity_m_s",
    "sensor_force_n": "sensor.force_n",
}


class MotionResult(NamedTuple):
    """Result of a motion.

    Attributes
    ----------
    columns : dict
        ``time_s``, ``carriage_position_m``, ``position_m``, ``sensor_force_n``, ``friction_force_n``,
        ``pressure_a_pa``, ``supply_pressure_a_pa`` and so on, then the inner states of friction.
    statistics : dict
        Counts of the integration: steps, attempts, events.
    state : list of float
        State at the end; the next motion can begin from it.
    commanded_m : float
        Commanded position of the carriage at the end, in m.
    """

    columns: dict[str, Array]
    statistics: dict[str, int]
    state: list[float]
    commanded_m: float


class Dragged:
    """Rig in which a carriage drags a piston: its components and joints. Joints ``a`` and ``b`` are the chambers.

    Parameters
    ----------
    friction : dict
        Friction of the piston, in the core's form.
    piston, sensor, carriage : dict
        Parameters of these components, by the keys of their kinds, in SI.
    ambient_pa, temperature_k : float
        Pressure in Pa and temperature in K of the room. Air and walls start at this temperature.
    """

    def __init__(
        self,
        friction: Keyed,
        piston: NamedNumbers,
        sensor: NamedNumbers,
        carriage: NamedNumbers | None = None,
        ambient_pa: float = constants.STANDARD_ATMOSPHERE_PA,
        temperature_k: float = constants.ANR_TEMPERATURE_K,
    ) -> None:
        self.ambient = {"pressure_pa": ambient_pa, "temperature_k": temperature_k}
        self.components: list[Plain] = []
        self.joints: dict[str, list[str]] = {name: [] for name in ("a", "b", "rod")}
        self.joints[AMBIENT] = [AMBIENT]
        self.start: NamedNumbers = {}
        self.sources: dict[str, str] = {}  # chamber -> joint of its supply
        self.shutters: list[str] = []  # flow paths that close when the supply is shut off
        release = {"release_stiffness": sensor["stiffness"], **(carriage or {})}
        self.add("carriage", "carriage", release, {"1": "servo"})
        self.add("sensor", "force-sensor", sensor, {"1": "servo", "2": "rod"})
        self.add("piston", "piston", piston, {"a": "a", "b": "b", "rod": "rod"})
        self.components[-1]["friction"] = friction

    def add(self, name: str, kind: str, numbers: NamedNumbers, ports: Mapping[str, str]) -> None:
        """Add a component, with the joint at each of its ports."""
        self.components.append({"name": name, "kind": kind, "numbers": dict(numbers)})
        for port, joint in ports.items():
            self.joints.setdefault(joint, []).append(f"{name}.{port}")

    def path(self, name: str, conductance: float, ratio: float, ends: tuple[str, str]) -> None:
        """Add a flow path between two joints."""
        numbers = {"conductance": conductance, "critical_pressure_ratio": ratio}
        self.add(name, "fitting", numbers, dict(zip("12", ends, strict=True)))

    def hold(self, name: str, pressure_pa: float) -> None:
        """Fix the absolute pressure of a joint."""
        self.add(name, "reservoir", {"pressure": pressure_pa}, {"1": name})

    def volume(self, name: str, pressure_pa: float, **numbers: float) -> None:
        """Add a tank to a joint, with its volume and its absolute pressure at the start."""
        self.add(name, "tank", numbers, {"1": name})
        self.start |= {f"{name}.pressure_pa": pressure_pa, f"{name}.temperature_k": self.ambient["temperature_k"]}

    def core_json(self) -> str:
        """Return the circuit in the core's form."""
        air = {
            "heat_capacity_ratio": constants.AIR_HEAT_CAPACITY_RATIO,
            "gas_constant_j_kg_k": constants.AIR_GAS_CONSTANT_J_KG_K,
        }
        joints = list(self.joints.values())
        return json.dumps({"gas": air, "ambient": self.ambient, "components": self.components, "joints": joints})

    def run(
        self,
        durations_s: Sequence[float] | Array,
        jerks_m_s3: Sequence[float] | Array,
        times_s: Sequence[float] | Array,
        begin: float | Sequence[float] | Mapping[str, float],
        rtol: float,
        *,
        released: bool = False,
        shut: bool = False,
        look: Callable[[float], object] | None = None,
    ) -> MotionResult:
        """Run a motion of piecewise constant jerk.

        Parameters
        ----------
        durations_s, jerks_m_s3 : sequence of float
            Duration in s and jerk in m/s3 of each phase of the carriage's commanded motion.
        times_s : sequence of float
            Times of the samples in s, ascending.
        begin : float, sequence of float or mapping
            Start position in m, at rest with an unloaded sensor; or the state at the end of an earlier motion; or start
            values by name.
        rtol : float
        released : bool
            Whether the carriage first moves freely until the sensor force is zero. The position that it reaches becomes
            the commanded position.
        shut : bool
            Whether the supply is shut off.
        look : callable, optional
            Called from time to time with the simulated time. An exception ends the run.

        Raises
        ------
        ValueError, RuntimeError
            The core rejects the rig, or the integration cannot continue.
        """
        from pneudrive import _core

        core = _core.Circuit(self.core_json())
        if isinstance(begin, float | int):
            at = {"position_m": float(begin), "velocity_m_s": 0.0}
            axes = {f"{own}.{name}": value for own in ("carriage", "piston") for name, value in at.items()}
            begin = self.start | axes
        session = core.start(begin, rtol)
        for name in self.shutters if shut else ():
            session.set(f"{name}.opening", 0.0)
        session.set("carriage.giving_way", float(released))
        jerks, ends = [float(jerk) for jerk in jerks_m_s3], np.cumsum(durations_s).tolist()
        session.set("carriage.jerk_m_s3", jerks[0])
        session.schedule("carriage.jerk_m_s3", ends[:-1], jerks[1:])
        of_piston = {short_name(name, "piston"): name for name in core.columns if name.startswith("piston.")}
        sources = {side: self.sources.get(side, f"piston.{side}") for side in "ab"}
        fed = {f"supply_pressure_{side}_pa": f"{source}.pressure_pa" for side, source in sources.items()}
        names = _OTHERS | of_piston | fed
        around = f"{AMBIENT}.pressure_pa"
        result = session.record(ends[-1], times_s, [name for name in names.values() if name != around], look)
        found = result["columns"] | {around: np.full(len(times_s), self.ambient["pressure_pa"])}
        columns = {own: found[name] for own, name in names.items()}
        # The state in which the next motion begins, without rounding errors at the end of the command. For a released
        # carriage, the actual position becomes the command.
        state = dict(zip((name for name, _ in core.states), session.state, strict=True))
        position, *rates = [name for name in state if name.startswith("carriage.")][:3]
        if released:
            state[position], state["carriage.velocity_m_s"] = state["carriage.position_m"], 0.0
        if released or abs(state[rates[0]]) < AT_REST_M_S:
            state |= dict.fromkeys(rates, 0.0)
        return MotionResult(columns, result["statistics"], list(state.values()), state[position])
