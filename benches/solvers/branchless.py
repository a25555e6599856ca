"""Right-hand side of the reference drive without branches, for tools that trace: CasADi and JAX."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any


def derivative(m: Any, y: Sequence[Any], u: float, q: Sequence[Any]) -> list[Any]:
    """Return the state derivative. `m` has sqrt, exp, where, minimum, maximum. `q` is laid out as `rhs.PARAMETERS`."""
    (k, gas, p_supply, t_supply, p_exhaust, t_exhaust, bore, stroke, dead, mass, alpha, t_wall, rho_c, b, linear, edge,
     k_stop, d_stop, depth, coulomb, breakaway, stribeck, viscous, stiffness, damping) = q  # fmt: skip
    x, v, p_a, t_a, p_b, t_b, z = y
    supply, exhaust = (p_supply, t_supply), (p_exhaust, t_exhaust)
    port_a, port_b = (supply, exhaust) if u >= 0.0 else (exhaust, supply)
    area, barrel = 0.25 * math.pi * bore * bore, math.pi * bore

    def chamber(p: Any, t: Any, volume: Any, rate: Any, surface: Any, port: tuple[Any, Any]) -> tuple[Any, Any]:
        inward = port[0] >= p
        upstream, t_up = m.maximum(port[0], p), m.where(inward, port[1], t)
        r = m.minimum(port[0], p) / upstream
        s = (m.minimum(m.maximum(r, b), linear) - b) / (1.0 - b)
        psi = m.where(r < linear, m.sqrt(1.0 - s * s), edge * (1.0 - r) / (1.0 - linear))
        flow = m.where(inward, 1.0, -1.0) * abs(u) * rho_c * upstream / m.sqrt(t_up) * psi
        heat = alpha * surface * (t_wall - t)
        p_rate = (k * gas * t_up * flow - k * p * rate + (k - 1.0) * heat) / volume
        return p_rate, t * (p_rate / p + rate / volume - gas * t * flow / (p * volume))

    rest = stroke - x
    a = chamber(p_a, t_a, dead + area * x, area * v, barrel * x + 2.0 * area, port_a)
    b_ = chamber(p_b, t_b, dead + area * rest, -area * v, barrel * rest + 2.0 * area, port_b)
    left, right = m.maximum(0.0, -x), m.maximum(0.0, x - stroke)
    stop = m.maximum(0.0, k_stop * right + d_stop * m.minimum(right / depth, 1.0) * v)
    stop = stop - m.maximum(0.0, k_stop * left - d_stop * m.minimum(left / depth, 1.0) * v)
    slip = v / stribeck
    level = coulomb + (breakaway - coulomb) * m.exp(-slip * slip)
    z_rate = v - stiffness * m.where(v >= 0.0, v, -v) / level * z
    friction = stiffness * z + damping * z_rate + viscous * v
    return [v, (area * (p_a - p_b) - friction - stop) / mass, *a, *b_, z_rate]
