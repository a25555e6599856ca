"""The core's answer to a case, and how far it is from a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oracle.integrate import COLUMNS
from oracle.model import Json

BEFORE_IMPACT_S, AFTER_IMPACT_S = 2e-3, 30e-3


@dataclass(frozen=True)
class Difference:
    """Greatest differences; pressure and temperature outside the instants of impact."""

    position_um: float
    velocity_m_s: float
    pressure: float
    temperature: float
    position_everywhere_um: float

    def meets(self, case: Json) -> bool:
        """Say whether position and pressure are within the case's bounds."""
        return self.position_um <= case["position_bound_um"] and self.pressure <= case["pressure_bound"]


def simulated(case: Json, rtol: float) -> tuple[np.ndarray, Json]:
    """Return the core's states, shape (n, 6) in the order of `COLUMNS`, and its statistics."""
    from pneudrive.describe.system import System

    drive = System.of_drive(case["drive"]).compiled()
    times, commands = (list(column) for column in zip(*case["commands"], strict=True))
    run = drive.simulate(
        [("command", times, commands)], case["duration_s"], case["sample_rate_hz"], case["initial"], rtol
    )
    return np.stack([run["columns"][c] for c in COLUMNS], axis=1), run["statistics"]


def outside_impact(times: np.ndarray, position: np.ndarray, stroke: float) -> np.ndarray:
    """Return a mask of the samples that are not around a first contact with an end stop."""
    beyond = (position < 0.0) | (position > stroke)
    keep = np.ones(len(times), bool)
    for i in np.flatnonzero(beyond[1:] & ~beyond[:-1]):
        keep &= (times < times[i] - BEFORE_IMPACT_S) | (times > times[i + 1] + AFTER_IMPACT_S)
    return keep


def difference(case: Json, got: np.ndarray, want: np.ndarray) -> Difference:
    """Compare two trajectories of a case, each of shape (n, >= 6)."""
    got, want = got[:, : len(COLUMNS)], want[:, : len(COLUMNS)]
    times = np.arange(len(want)) / case["sample_rate_hz"]
    keep = outside_impact(times, want[:, 0], case["drive"]["cylinder"]["stroke_m"])
    position = np.abs(got[:, 0] - want[:, 0]) * 1e6
    relative = np.abs(got[keep] / np.where(want[keep] == 0.0, 1.0, want[keep]) - 1.0)
    return Difference(
        position_um=float(position[keep].max()),
        velocity_m_s=float(np.abs(got[keep, 1] - want[keep, 1]).max()),
        pressure=float(relative[:, [2, 4]].max()),
        temperature=float(relative[:, [3, 5]].max()),
        position_everywhere_um=float(position.max()),
    )
