"""Small friction maps with a known law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from pneudrive.friction.friction_map import AMBIENT, columns_to_dataset

AIR_PA = 1.01325e5
SPEEDS = (0.01, 0.03, 0.1)
WIDE = (0.002, 0.004, 0.008, 0.016, 0.03, 0.06, 0.12, 0.25)


def friction_map(
    friction: Callable[[np.ndarray, np.ndarray], np.ndarray],
    speeds: tuple[float, ...] = SPEEDS,
    gauges_b_pa: tuple[float, ...] = (0.0,),
    noise_n: float = 0.02,
) -> xr.Dataset:
    """Return a map of two recordings for each pressure; friction, N, over speed, m/s, and gauge pressure in b, Pa."""
    names = [
        (f"{day}-{gauge / 1e5:g}" if gauge else day, gauge) for gauge in gauges_b_pa for day in ("monday", "tuesday")
    ]
    rows = [(name, gauge, direction, speed) for name, gauge in names for direction in (1, -1) for speed in speeds]
    recording, gauge, direction, speed = (np.array(column) for column in zip(*rows, strict=True))
    one_way = np.random.default_rng(7).standard_normal((len(names), 1, len(speeds)))  # both directions are one value
    value = friction(speed, gauge) + noise_n * np.broadcast_to(one_way, (len(names), 2, len(speeds))).ravel()
    zeros = np.zeros(len(rows))
    found = columns_to_dataset(
        {
            "recording": recording,
            "direction": direction,
            "velocity_m_s": direction * speed,
            "pressure_a_pa": zeros + AIR_PA,
            "pressure_b_pa": gauge + AIR_PA,
            "balance_n": direction * value,
            "friction_n": value,
            "offset_n": zeros,
            "stderr_n": zeros + noise_n,
            "u_systematic_n": zeros,
            "samples": np.ones(len(rows), int),
            "strokes": np.ones(len(rows), int),
            "position_from_m": zeros,
            "position_to_m": zeros,
            "breakaway_n": zeros,
            "dwell_s": zeros,
            "loading_rate_n_s": zeros,
            "flags": np.full(len(rows), ""),
            AMBIENT: zeros + AIR_PA,
        }
    )
    return found.assign_attrs({AMBIENT: AIR_PA})


def coulomb(force_n: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return Coulomb and viscous friction."""
    return lambda speed, _: force_n + 40.0 * speed


def stribeck(speed: np.ndarray, gauge_b_pa: np.ndarray) -> np.ndarray:
    """Return Stribeck friction that grows with the pressure in b."""
    return 20.0 + 15.0 * np.exp(-((speed / 0.02) ** 2)) + 60.0 * speed + 3e-5 * gauge_b_pa
