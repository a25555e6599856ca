"""The drive as a textbook writes it: an oracle that shares no line with the core.

The core integrates mass and internal energy of each chamber; this model integrates pressure and
temperature.  The core is Rust with automatic derivatives; this is plain Python.  An error in one
of them therefore shows as a difference.

State vector (SI, absolute pressure; t is temperature), chamber a grows with x::

    y = [x, v, p_a, t_a, p_b, t_b]  and, for laws of bristles, the inner states of `oracle.friction`

Sign conventions: x and v grow towards chamber b's end, mass flow is positive into a chamber, the
friction force is positive when it opposes v > 0, the end stop force likewise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from oracle.friction import Bristles

GRAVITY = 9.80665  # m/s2, standard acceleration of free fall
AIR_HEAT_CAPACITY_RATIO = 1.4
AIR_GAS_CONSTANT = 287.05  # J/(kg K)
REFERENCE_PRESSURE = 1.0e5  # Pa, ISO 6358 reference state
REFERENCE_TEMPERATURE = 293.15  # K
REFERENCE_AIR_DENSITY = 1.185  # kg/m3, the same state at 65 % relative humidity

Json = dict[str, Any]


@dataclass(frozen=True)
class Chamber:
    """Geometry of one chamber: `length` is the distance of the piston from its end cover."""

    area: float  # piston area that its pressure acts on, m2
    rod_diameter: float  # of the rod that runs through it, m (0 without)
    bore: float  # m
    dead_volume: float  # m3

    def volume(self, length: float) -> float:
        """Gas volume, m3."""
        return self.dead_volume + self.area * length

    def wall_area(self, length: float) -> float:
        """Surface that exchanges heat, m2: barrel, both end faces, and the rod where there is one."""
        barrel = math.pi * self.bore * length
        rod = math.pi * self.rod_diameter * length
        return barrel + rod + 2.0 * self.area


class Drive:
    """Right-hand side of one drive from its description in SI units."""

    def __init__(self, description: Json) -> None:
        self.description = description
        gas, cylinder, valve = description["gas"], description["cylinder"], description["valve"]
        self.k, self.r_gas = gas["heat_capacity_ratio"], gas["gas_constant_j_kg_k"]
        self.p_amb, self.t_amb = _node(description["ambient"])
        self.p_sup, self.t_sup = _node(description["supply"])
        self.stroke = cylinder["stroke_m"]
        self.chamber_a, self.chamber_b = _chambers(cylinder)
        self.alpha, self.t_wall = cylinder["heat_transfer_w_m2_k"], cylinder["wall_temperature_k"]
        self.stop = cylinder["end_stop"]
        self.b, self.m_index = valve["critical_pressure_ratio"], valve["subsonic_index"]
        self.r_linear = valve["linear_above"]
        # rho0 C of the gas that flows, with C measured with air
        self.rho_c = valve["conductance_m3_s_pa"] * self._density_and_conductance_factor()
        self.friction = description["friction"]
        self.law = self.friction["law"]
        self.bristles = Bristles(self.friction, self.p_amb) if self.law in {"lugre", "elasto-plastic"} else None
        load = description["load"]
        self.mass = cylinder["moving_mass_kg"] + load["mass_kg"]
        self.weight = self.mass * GRAVITY * math.sin(cylinder["incline_rad"])
        self.load_force = load["force_n"]
        self.spring = load["spring"] or {"stiffness_n_m": 0.0, "rest_position_m": 0.0}

    def _density_and_conductance_factor(self) -> float:
        """Return the reference density times C_gas/C_air, kg/m3."""
        if self.k == AIR_HEAT_CAPACITY_RATIO and self.r_gas == AIR_GAS_CONSTANT:
            return REFERENCE_AIR_DENSITY
        density = REFERENCE_PRESSURE / (self.r_gas * REFERENCE_TEMPERATURE)
        ratio = choked_flow_factor(self.k) / choked_flow_factor(AIR_HEAT_CAPACITY_RATIO)
        return density * math.sqrt(self.r_gas / AIR_GAS_CONSTANT) * ratio

    # -- valve --------------------------------------------------------------------------------
    def flow_function(self, r: float) -> float:
        """ISO 6358-1 flow against choked flow at the pressure ratio r in [0, 1]."""
        if r <= self.b:
            return 1.0
        if r < self.r_linear:
            return (1.0 - ((r - self.b) / (1.0 - self.b)) ** 2) ** self.m_index
        at_limit = (1.0 - ((self.r_linear - self.b) / (1.0 - self.b)) ** 2) ** self.m_index
        return at_limit * (1.0 - r) / (1.0 - self.r_linear)

    def mass_flow(self, p_port: float, t_port: float, p: float, t: float, opening: float) -> float:
        """Mass flow from the port into the chamber, kg/s, with the donor's temperature."""
        if p_port >= p:
            donor_p, donor_t, r, sign = p_port, t_port, p / p_port, 1.0
        else:
            donor_p, donor_t, r, sign = p, t, p_port / p, -1.0
        choked = self.rho_c * donor_p * math.sqrt(REFERENCE_TEMPERATURE / donor_t)
        return sign * opening * choked * self.flow_function(r)

    def ports(self, u: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """(pressure, temperature) that chamber a and chamber b are connected to."""
        supply, exhaust = (self.p_sup, self.t_sup), (self.p_amb, self.t_amb)
        return (supply, exhaust) if u >= 0.0 else (exhaust, supply)

    # -- chambers -----------------------------------------------------------------------------
    def chamber_rates(
        self,
        chamber: Chamber,
        length: float,
        speed: float,
        p: float,
        t: float,
        port: tuple[float, float],
        opening: float,
    ) -> tuple[float, float]:
        """(dp/dt, dT/dt) from the balances of mass and internal energy of an ideal gas."""
        volume, volume_rate = chamber.volume(length), chamber.area * speed
        c_v = self.r_gas / (self.k - 1.0)
        c_p = c_v + self.r_gas
        flow = self.mass_flow(port[0], port[1], p, t, opening)
        enthalpy = c_p * flow * (port[1] if flow > 0.0 else t)
        heat = self.alpha * chamber.wall_area(length) * (self.t_wall - t)
        energy_rate = enthalpy - p * volume_rate + heat
        mass = p * volume / (self.r_gas * t)
        p_rate = ((self.k - 1.0) * energy_rate - p * volume_rate) / volume
        return p_rate, (energy_rate / c_v - t * flow) / mass

    # -- forces -------------------------------------------------------------------------------
    def end_stop_force(self, x: float, v: float) -> float:
        """Force of the end stops against +x, N: spring and damper, never pulling."""
        if x < 0.0:
            depth, closing, sign = -x, -v, -1.0
        elif x > self.stroke:
            depth, closing, sign = x - self.stroke, v, 1.0
        else:
            return 0.0
        engaged = min(depth / self.stop["damping_depth_m"], 1.0)
        force = self.stop["stiffness_n_m"] * depth + self.stop["damping_n_s_m"] * engaged * closing
        return sign * max(0.0, force)

    def applied_force(self, x: float, v: float, p_a: float, p_b: float) -> float:
        """Sum of all forces on the piston but friction, N, in +x."""
        gas = p_a * self.chamber_a.area - p_b * self.chamber_b.area
        rod = self.p_amb * (self.chamber_a.area - self.chamber_b.area)
        spring = self.spring["stiffness_n_m"] * (x - self.spring["rest_position_m"])
        return gas - rod - self.weight + self.load_force - spring - self.end_stop_force(x, v)

    def coulomb_and_breakaway(self, p_a: float, p_b: float) -> tuple[float, float]:
        """Coulomb force Fc and breakaway force Fs at these chamber pressures, N."""
        law, seal = self.friction["parameters"], self.friction["pressure"]
        coulomb, breakaway = law["coulomb"], law.get("breakaway", law["coulomb"])
        if seal is not None:
            gauge_a, gauge_b = p_a - self.p_amb, p_b - self.p_amb
            coulomb += seal["coulomb_a"] * gauge_a + seal["coulomb_b"] * gauge_b
            breakaway += seal["breakaway_a"] * gauge_a + seal["breakaway_b"] * gauge_b
        return coulomb, breakaway

    def stribeck_level(self, v: float, p_a: float, p_b: float) -> float:
        """Level g(v) of steady sliding friction without its viscous part, N."""
        coulomb, breakaway = self.coulomb_and_breakaway(p_a, p_b)
        if self.law == "coulomb":
            return coulomb
        law = self.friction["parameters"]
        return coulomb + (breakaway - coulomb) * math.exp(
            -(abs(v / law["stribeck_velocity"]) ** law["stribeck_exponent"])
        )

    # -- the whole ----------------------------------------------------------------------------
    def gas_rates(self, y: list[float], u: float) -> tuple[float, float, float, float]:
        """(dp_a/dt, dT_a/dt, dp_b/dt, dT_b/dt); NaN makes the integrator refuse an impossible trial step."""
        x, v, p_a, t_a, p_b, t_b = y[:6]
        if min(p_a, t_a, p_b, t_b) <= 0.0:
            return (math.nan, math.nan, math.nan, math.nan)
        port_a, port_b = self.ports(u)
        rates_a = self.chamber_rates(self.chamber_a, x, v, p_a, t_a, port_a, abs(u))
        rates_b = self.chamber_rates(self.chamber_b, self.stroke - x, -v, p_b, t_b, port_b, abs(u))
        return (*rates_a, *rates_b)

    def rhs_bristles(self, _t: float, y: Any, u: float) -> list[float]:
        """State derivative of a drive with a friction law of bristles."""
        y = y.tolist()
        x, v, p_a, _, p_b, _ = y[:6]
        friction, inner_rates = self.bristles(x, v, p_a, p_b, y[6:])
        acceleration = (self.applied_force(x, v, p_a, p_b) - friction) / self.mass
        return [v, acceleration, *self.gas_rates(y, u), *inner_rates]

    def rhs_sliding(self, _t: float, y: Any, u: float, mode: int) -> list[float]:
        """State derivative of a drive with exact sticking; mode -1, 0 (sticks) or +1."""
        y = y.tolist()
        x, v, p_a, _, p_b, _ = y
        if mode == 0:
            return [0.0, 0.0, *self.gas_rates([x, 0.0, *y[2:]], u)]
        friction = mode * self.stribeck_level(v, p_a, p_b) + self.friction["parameters"]["viscous"] * v
        acceleration = (self.applied_force(x, v, p_a, p_b) - friction) / self.mass
        return [v, acceleration, *self.gas_rates(y, u)]


def choked_flow_factor(k: float) -> float:
    """Choked mass flow through an ideal nozzle times sqrt(R T)/(A p)."""
    return math.sqrt(k) * (2.0 / (k + 1.0)) ** ((k + 1.0) / (2.0 * (k - 1.0)))


def _node(table: Json) -> tuple[float, float]:
    return table["pressure_pa"], table["temperature_k"]


def _chambers(cylinder: Json) -> tuple[Chamber, Chamber]:
    bore, rod = cylinder["bore_m"], cylinder["rod_diameter_m"]
    rod_a = rod if cylinder["kind"] == "through-rod" else 0.0
    rod_b = rod if cylinder["kind"] in ("through-rod", "single-rod") else 0.0

    def chamber(rod_diameter: float, dead_volume: float) -> Chamber:
        area = 0.25 * math.pi * (bore**2 - rod_diameter**2)
        return Chamber(area, rod_diameter, bore, dead_volume)

    return chamber(rod_a, cylinder["dead_volume_a_m3"]), chamber(rod_b, cylinder["dead_volume_b_m3"])
