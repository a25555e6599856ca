"""Friction maps made from a known Stribeck law, as arrays."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pneudrive import _core

AMBIENT = 101300.0
TRUTH = {"coulomb": 30.0, "breakaway": 40.0, "stribeck_velocity": 0.012, "stribeck_exponent": 2.0, "viscous": 60.0}


def steady(speed, gauge_a=0.0, gauge_b=0.0, slopes=None, **changes):
    """Friction of the known law; slopes in N/Pa added to its forces before the core sees them."""
    parameters = TRUTH | changes
    speed, a, b = np.broadcast_arrays(np.asarray(speed, float), gauge_a, gauge_b)
    out = np.empty(speed.size)
    for i, (v, pa, pb) in enumerate(zip(speed.ravel(), a.ravel(), b.ravel(), strict=True)):
        here = dict(parameters)
        for force in ("coulomb", "breakaway"):
            here[force] += (slopes or {}).get(f"{force}_a", 0.0) * pa + (slopes or {}).get(f"{force}_b", 0.0) * pb
        out[i] = _core.steady_friction("stribeck", here, np.array([v]), 0.0, 0.0)[0]
    return out


def make_map(
    speed, friction, stderr=0.5, *, gauge_a=0.0, gauge_b=0.0, strokes=1000, systematic=0.0, offset=0.0, flags=""
):
    """Map with both rows of each pair; arrays of one value per pair."""
    n = np.size(speed)

    def pair(values):
        return np.repeat(np.broadcast_to(np.asarray(values, dtype=float), (n,)), 2)

    direction = np.tile([1.0, -1.0], n)
    columns = {
        "recording": np.repeat([f"recording {i}" for i in range(n)], 2).astype(object),
        "direction": direction.astype(int),
        "velocity_m_s": pair(speed) * direction,
        "pressure_a_pa": pair(gauge_a) + AMBIENT,
        "pressure_b_pa": pair(gauge_b) + AMBIENT,
        "balance_n": pair(friction) * direction + offset,
        "friction_n": pair(friction),
        "offset_n": pair(offset),
        "stderr_n": pair(stderr),
        "u_systematic_n": pair(systematic),
        "samples": np.full(2 * n, 2500),
        "strokes": np.full(2 * n, strokes),
        "flags": np.repeat(np.broadcast_to(np.asarray(flags, dtype=object), (n,)), 2),
    }
    return xr.Dataset({k: ("row", v) for k, v in columns.items()}, attrs={"ambient_pressure_pa": AMBIENT})
