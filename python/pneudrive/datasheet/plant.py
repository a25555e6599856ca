"""A drive as its characteristics see it: one piston on one commanded valve, evaluated at any state by the core."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.describe.circuit import compiled
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.identify.friction_curve import steady_friction
from pneudrive.session import Session
from pneudrive.start import circuit_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.session import Linear

    Array = NDArray[np.float64]

RTOL = 1e-6  # of sessions that are not advanced
NO_FRICTION_N = 1e-9  # a law of friction has a level above 0
#: What does not act on a steady state away from the ends, but has states of its own: of the valve, of the piston.
_LAGS, _CUSHIONS = ("frequency", "damping_ratio", "stroke_time", "delay", "hysteresis"), ("cushion_",)


class Rates(NamedTuple):
    """What the core says at one state.

    Attributes
    ----------
    pressure, temperature : ndarray
        Rates of change at the gas nodes over their values, 1/s.
    force : float
        On the piston without its friction, in +x, N.
    """

    pressure: Array
    temperature: Array
    force: float


class HeldDrive:
    """One piston on one commanded valve.

    Parameters
    ----------
    described : Drive or Circuit
    held : bool
        Whether it is looked at in states that are held.

    Raises
    ------
    CommandError
        There is not one piston and one command, or the valve or a tube has states that cannot be held.
    DescriptionError
        It is neither a drive nor a circuit.
    """

    def __init__(self, described: Drive | Circuit, *, held: bool = True) -> None:
        if not hasattr(described, "core_json"):
            raise DescriptionError(f"a {type(described).__name__} is not a drive", remedy='pn.Drive.load("drive.toml")')
        self.described = described
        self.circuit = circuit_of(described)
        pistons = [name for name, one in self.circuit.components.items() if one.entry["kind"].startswith("cylinder/")]
        valves = list(self.circuit.commandable)
        if len(pistons) != 1 or len(valves) != 1:
            raise CommandError(
                f"{self.circuit.name} has {len(pistons)} pistons and {len(valves)} commands",
                rule="characteristics are those of one piston on one commanded valve",
            )
        self.piston, self.valve = pistons[0], valves[0]
        self.command, self.load = f"{self.valve}.command", f"{self.piston}.load_force_n"
        if held and "time_on" in self.circuit.components[self.valve].plain():
            raise CommandError(
                f"{self.valve} has time_on",
                rule="a switching valve that opens later cannot be held open where the drive is looked at",
                remedy="Take its flow as a proportional valve in a copy of the file.",
            )
        self.core = compiled(self.circuit.core_json())
        self.start_values = self.circuit.core_initial(None)
        ends = ".pressure_pa"
        self.nodes = tuple(name.removesuffix(ends) for name in self.core.start_names if name.endswith(ends))

    @cached_property
    def static(self) -> HeldDrive:
        """The drive without lags of its valve and without cushions: for steady states and linear models.

        Raises
        ------
        CommandError
            A component has states that cannot be held, such as the flow of a distributed tube.
        """
        tables = self.circuit.to_dict()
        parts = tables["components"]
        known = self.circuit.components
        lags, cushions = known[self.valve].plain(), known[self.piston].plain()
        without = {
            self.valve: {key: one for key, one in lags.items() if key not in _LAGS},
            self.piston: {key: one for key, one in cushions.items() if not key.startswith(_CUSHIONS)},
        }
        same = without[self.valve].keys() == lags.keys() and without[self.piston].keys() == cushions.keys()
        plant = self if same else HeldDrive(type(self.circuit).model_validate(tables | {"components": parts | without}))
        held = {f"{node}.mass_kg" for node in plant.nodes}
        loose = [name for name, _ in plant.core.states if name.endswith(("kg", "kg_s")) and name not in held]
        if loose:
            raise CommandError(
                f"{self.name}: {loose[0]} cannot be held",
                rule="steady states need pressures and temperatures that a start takes",
                remedy='Take tubes with model = "steady".',
            )
        return plant

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.circuit.name

    @property
    def stroke_m(self) -> float:
        """Stroke, m."""
        return float(self._cylinder("stroke"))

    @cached_property
    def supply(self) -> str:
        """Name of the input that is the pressure of the supply."""
        inputs = [name for name, *_ in self.core.inputs if name.endswith(".pressure_pa")]
        if len(inputs) != 1:
            raise CommandError(f"{self.name} has {len(inputs)} supplies", rule="one reservoir feeds the valve")
        return inputs[0]

    @cached_property
    def supply_pa(self) -> float:
        """Absolute pressure of the supply, Pa."""
        return Session(self.core.start(self.start_values, RTOL)).read(self.supply)

    @property
    def ambient(self) -> tuple[float, float]:
        """Ambient pressure, Pa, and temperature, K."""
        return float(self.circuit.ambient.pressure_pa), float(self.circuit.ambient.temperature_k)

    @property
    def friction(self):  # noqa: ANN201 - of a drive or a component
        """Friction of the piston."""
        return self._cylinder("friction")

    def _cylinder(self, key: str):  # noqa: ANN202 - any field
        return getattr(self.circuit.components[self.piston], key)

    @cached_property
    def frictionless(self) -> HeldDrive:
        """The same with friction that does not act (the core's least law, at a force of no effect)."""
        tables = self.circuit.to_dict()
        tables["components"][self.piston]["friction"] = {"law": "coulomb", "coulomb": f"{NO_FRICTION_N!r} N"}
        return HeldDrive(type(self.circuit).model_validate(tables))

    @cached_property
    def heatless(self) -> HeldDrive:
        """The same with walls of the cylinder that take no heat."""
        tables = self.circuit.to_dict()
        tables["components"][self.piston]["heat_transfer"] = "0 W/(m2 K)"
        return HeldDrive(type(self.circuit).model_validate(tables))

    def session(
        self,
        command: float,
        position: float,
        velocity: float = 0.0,
        gas: Array | None = None,
        load: float = 0.0,
        rtol: float = RTOL,
    ) -> Session:
        """Return a session at a state.

        Parameters
        ----------
        command, position, velocity, load : float
            SI; the load acts in +x.
        gas : ndarray, optional
            Shape (nodes, 2): absolute pressure, Pa, and temperature, K, at `nodes`.
        rtol : float
            Of the solver.
        """
        if not 0.0 <= position <= self.stroke_m:
            rule = f"0 to the stroke, {self.stroke_m:g} m"
            raise CommandError(f"position = {position:g} m is out of bounds", rule=rule)
        start = dict(self.start_values)
        start |= {f"{self.piston}.position_m": position, f"{self.piston}.velocity_m_s": velocity}
        if gas is not None:
            for node, (pressure, temperature) in zip(self.nodes, gas, strict=True):
                start |= {f"{node}.pressure_pa": float(pressure), f"{node}.temperature_k": float(temperature)}
        try:
            session = Session(self.core.start(start, rtol))
        except (ValueError, RuntimeError) as error:
            raise CommandError(str(error)) from None
        session.set(self.command, command)
        if load:
            session.set(self.load, load)
        return session

    def rates(self, session: Session) -> Rates:
        """Return rates of all pressures and temperatures, and the force on the piston, at a session's state."""
        linear = session.linearise([])
        row = {name: k for k, name in enumerate(linear.outputs)}
        outputs = [[row[f"{node}.{q}"] for node in self.nodes] for q in ("pressure_pa", "temperature_k")]
        change = linear.C @ linear.rates
        p, t = (change[rows] / linear.output[rows] for rows in outputs)
        return Rates(p, t, self.force(linear))

    def force(self, linear: Linear) -> float:
        """Return the force of gas, weight, springs and load on the piston, in +x, N: all but its friction."""
        row = {name: k for k, name in enumerate(linear.outputs)}
        acceleration, friction, stop = (
            linear.output[row[f"{self.piston}.{what}"]]
            for what in ("acceleration_m_s2", "friction_force_n", "end_stop_force_n")
        )
        return float(acceleration * self.mass + friction + stop)

    @cached_property
    def mass(self) -> float:
        """Moving mass, kg: the inverse of the core's derivative of the acceleration by the load."""
        pressure, temperature = self.ambient
        gas = np.tile([pressure, temperature], (len(self.nodes), 1))
        linear = self.session(0.5, 0.5 * self.stroke_m, 0.0, gas).linearise([self.load])
        rate = linear.B[linear.states.index(f"{self.piston}.velocity_m_s"), 0]
        if rate == 0.0:  # sticking: the contact takes the load
            linear = self.session(0.5, 0.5 * self.stroke_m, 1.0, gas).linearise([self.load])
            rate = linear.B[linear.states.index(f"{self.piston}.velocity_m_s"), 0]
        return float(1.0 / rate)

    def sliding(self, velocity: float, pressures: tuple[float, float], position: float) -> float:
        """Return the steady friction at a velocity and absolute pressures of a and b, N, with the velocity's sign."""
        gauges = [pressure - self.ambient[0] for pressure in pressures]
        size = steady_friction(self.friction, np.array([velocity]), gauges[0], gauges[1], position)[0]
        return float(np.copysign(size, velocity))

    def pressures(self, gas: Array) -> tuple[float, float]:
        """Return the absolute pressures of chambers a and b."""
        return self.chamber(gas, "a")[0], self.chamber(gas, "b")[0]

    def chamber(self, gas: Array, which: str) -> tuple[float, float]:
        """Return pressure and temperature of chamber a or b."""
        pressure, temperature = gas[self.nodes.index(f"{self.piston}.{which}")]
        return float(pressure), float(temperature)
