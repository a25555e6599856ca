"""Right-hand side of the reference drive in plain scalars, for Python and for Numba.

Written for speed, as a user of a general solver would: no objects, parameters in one flat tuple.
"""

from __future__ import annotations

import math

import numpy as np

from benches.problem import A

REFERENCE_DENSITY, REFERENCE_TEMPERATURE = 1.185, 293.15  # ISO 6358 reference state, kg/m3 and K


def _parameters() -> tuple[float, ...]:
    drive = A.data["drive"]
    gas, cylinder, valve = drive["gas"], drive["cylinder"], drive["valve"]
    friction, stop = drive["friction"]["parameters"], cylinder["end_stop"]
    b, linear = valve["critical_pressure_ratio"], valve["linear_above"]
    at_limit = math.sqrt(1.0 - ((linear - b) / (1.0 - b)) ** 2)
    return (
        gas["heat_capacity_ratio"], gas["gas_constant_j_kg_k"],
        drive["supply"]["pressure_pa"], drive["supply"]["temperature_k"],
        drive["ambient"]["pressure_pa"], drive["ambient"]["temperature_k"],
        cylinder["bore_m"], cylinder["stroke_m"], cylinder["dead_volume_a_m3"], cylinder["moving_mass_kg"],
        cylinder["heat_transfer_w_m2_k"], cylinder["wall_temperature_k"],
        valve["conductance_m3_s_pa"] * REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE), b, linear, at_limit,
        stop["stiffness_n_m"], stop["damping_n_s_m"], stop["damping_depth_m"],
        friction["coulomb"], friction["breakaway"], friction["stribeck_velocity"], friction["viscous"],
        friction["bristle_stiffness"], friction["bristle_damping"],
    )  # fmt: skip


PARAMETERS = _parameters()


def mass_flow(p_port, t_port, p, t, opening, q):
    """Mass flow from the port into the chamber, kg/s."""
    rho_c, b, linear, at_limit = q[12], q[13], q[14], q[15]
    if p_port >= p:
        flow, r = opening * rho_c * p_port / math.sqrt(t_port), p / p_port
    else:
        flow, r = -opening * rho_c * p / math.sqrt(t), p_port / p
    if r <= b:
        return flow
    if r < linear:
        s = (r - b) / (1.0 - b)
        return flow * math.sqrt(1.0 - s * s)
    return flow * at_limit * (1.0 - r) / (1.0 - linear)


def chamber(p, t, volume, volume_rate, surface, p_port, t_port, opening, q):
    """(dp/dt, dT/dt) of one chamber."""
    k, r_gas = q[0], q[1]
    flow = mass_flow(p_port, t_port, p, t, opening, q)
    donor_t = t_port if flow > 0.0 else t
    heat = q[10] * surface * (q[11] - t)
    p_rate = (k * r_gas * donor_t * flow - k * p * volume_rate + (k - 1.0) * heat) / volume
    return p_rate, t * (p_rate / p + volume_rate / volume - r_gas * t * flow / (p * volume))


def stop_force(x, v, q):
    """Force of the end stops against +x, N."""
    stroke, stiffness, damping, depth = q[7], q[16], q[17], q[18]
    if x < 0.0:
        return -max(0.0, -stiffness * x - damping * min(-x / depth, 1.0) * v)
    if x > stroke:
        d = x - stroke
        return max(0.0, stiffness * d + damping * min(d / depth, 1.0) * v)
    return 0.0


def derivative(y, dy, u, q):
    """Write the state derivative into `dy`; both have shape (7,)."""
    x, v, p_a, t_a, p_b, t_b, z = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    supply_p, supply_t, exhaust_p, exhaust_t = q[2], q[3], q[4], q[5]
    bore, stroke, dead, mass = q[6], q[7], q[8], q[9]
    if u < 0.0:
        opening = -u
        port_a_p, port_a_t, port_b_p, port_b_t = exhaust_p, exhaust_t, supply_p, supply_t
    else:
        opening = u
        port_a_p, port_a_t, port_b_p, port_b_t = supply_p, supply_t, exhaust_p, exhaust_t
    area, barrel = 0.25 * math.pi * bore * bore, math.pi * bore
    dead_a, rest = dead + area * x, stroke - x
    pa_rate, ta_rate = chamber(p_a, t_a, dead_a, area * v, barrel * x + 2.0 * area, port_a_p, port_a_t, opening, q)
    dead_b = dead + area * rest
    pb_rate, tb_rate = chamber(p_b, t_b, dead_b, -area * v, barrel * rest + 2.0 * area, port_b_p, port_b_t, opening, q)
    coulomb, breakaway, stribeck, viscous, stiffness, damping = q[19], q[20], q[21], q[22], q[23], q[24]
    s = v / stribeck
    z_rate = v - stiffness * abs(v) / (coulomb + (breakaway - coulomb) * math.exp(-s * s)) * z
    friction = stiffness * z + damping * z_rate + viscous * v
    dy[0] = v
    dy[1] = (area * (p_a - p_b) - friction - stop_force(x, v, q)) / mass
    dy[2] = pa_rate
    dy[3] = ta_rate
    dy[4] = pb_rate
    dy[5] = tb_rate
    dy[6] = z_rate


def python_derivative(t, y, dy, u):
    """Plain Python: on a list, as element access of an array is slow."""
    out = [0.0] * 7
    derivative(y.tolist(), out, u, PARAMETERS)
    dy[:] = out


def jitted():
    """Compile the same formulas with Numba: `derivative(y, dy, u, q)` for any parameters `q`."""
    import numba

    scope = {"math": math}
    jit = numba.njit(error_model="numpy")
    for function in (mass_flow, chamber, stop_force, derivative):
        scope[function.__name__] = jit(_with_globals(function, scope))
    return scope["derivative"]


def numba_derivative():
    """Compile the formulas for the reference drive: `f(t, y, dy, u)`."""
    import numba

    inner, q = jitted(), PARAMETERS

    @numba.njit(error_model="numpy")
    def compiled(t, y, dy, u):
        inner(y, dy, u, q)

    compiled(0.0, np.array([0.1, 0.0, 3e5, 293.0, 3e5, 293.0, 0.0]), np.empty(7), 0.5)
    return compiled


def _with_globals(function, scope):
    import types

    return types.FunctionType(function.__code__, scope, function.__name__)
