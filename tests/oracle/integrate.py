"""Integration of the oracle: SciPy's Radau and DOP853 at tolerances far below the tests'.

The command is piecewise constant, so every step of it starts a new integration.  `stribeck` and
`coulomb` are integrated as three smooth systems (sliding forwards, sliding backwards, sticking)
with the switches located as events.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from oracle.model import Drive, Json

COLUMNS = ("position_m", "velocity_m_s", "pressure_a_pa", "temperature_a_k", "pressure_b_pa", "temperature_b_k")
# absolute tolerance = tol times this: x, v, p, T, p, T; inner states have their own
TOLERANCE_SCALE = [0.1, 0.1, 1e5, 300.0, 1e5, 300.0]
# After a switch to sliding v is 0 (or its rounding error): the event "v = 0" is not looked for
# until the piston has had this time to move.
BLIND_TIME = 1e-9
MAX_SWITCHES = 2000


def sample_times(duration: float, rate: float) -> np.ndarray:
    """k/rate for k = 0 .. round(duration rate), the last one at the duration."""
    times = np.arange(round(duration * rate) + 1) / rate
    times[-1] = duration
    return times


def run(case: Json, method: str = "Radau", tol: float = 1e-11) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
    """Integrate a case.

    Parameters
    ----------
    case
        ``drive`` (description in SI units), ``commands`` [[time_s, command], ...], ``duration_s``,
        ``sample_rate_hz`` and ``initial``.
    method
        Integrator of :func:`scipy.integrate.solve_ivp`.
    tol
        Relative tolerance; absolute ones are `tol` times `TOLERANCE_SCALE`.

    Returns
    -------
    times : ndarray, shape (n,)
    states : ndarray, shape (n, 6) or more
        x, v, p_a, T_a, p_b, T_b and, for laws of bristles, their inner states.
    statistics : dict
        Right-hand sides and switches.
    """
    drive = Drive(case["drive"])
    own = _Integration(drive, method, tol)
    if "servo" in case:
        return _run_servo(own, case)
    times = sample_times(case["duration_s"], case["sample_rate_hz"])
    y = _initial(drive, case)
    states = np.empty((len(times), len(y)))
    states[0] = y
    starts = [*case["commands"], [case["duration_s"], 0.0]]
    mode: int | None = None
    for (t0, u), (t1, _) in itertools.pairwise(starts):
        if drive.bristles:
            inside = (times > t0) & (times <= t1)
            solution = own.solve(drive.rhs_bristles, t0, t1, y, t_eval=np.union1d(times[inside], [t1]), args=(u,))
            states[inside], y = solution.y.T[: inside.sum()], solution.y[:, -1]
        else:
            y, mode = _switched(own, y, u, (t0, t1), times, states, mode)
    return times, states, own.statistics


@dataclass
class _Integration:
    """A drive with method and tolerance of its integration, and the work so far."""

    drive: Drive
    method: str
    tol: float
    statistics: dict[str, int] = field(default_factory=lambda: {"rhs": 0, "switches": 0})

    def solve(self, fun: Any, t0: float, t1: float, y: np.ndarray, **more: Any) -> Any:
        bristles = self.drive.bristles
        atol = self.tol * np.array(TOLERANCE_SCALE + (bristles.scales() if bristles else []))
        solution = solve_ivp(fun, (t0, t1), y, method=self.method, rtol=self.tol, atol=atol, **more)
        if not solution.success:
            raise RuntimeError(solution.message)
        self.statistics["rhs"] += solution.nfev
        return solution


def _initial(drive: Drive, case: Json) -> np.ndarray:
    y = np.array([case["initial"][name] for name in COLUMNS])
    return np.append(y, drive.bristles.initial(case["initial"])) if drive.bristles else y


def servo_command(servo: Json, stroke: float, t: float, x: float, v: float) -> float:
    """Position control: proportional and derivative action on a sine about mid stroke, clipped to [-1, 1]."""
    w, amplitude = 2.0 * math.pi * servo["frequency_hz"], servo["amplitude_m"]
    target, target_speed = 0.5 * stroke + amplitude * math.sin(w * t), amplitude * w * math.cos(w * t)
    u = servo["kp"] * (target - x) + servo["kd"] * (target_speed - v)
    return min(1.0, max(-1.0, u))


def _run_servo(own: _Integration, case: Json) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
    """Integrate from sample to sample of the controller; keep every n-th state."""
    servo, y = case["servo"], _initial(own.drive, case)
    keep = round(servo["sample_rate_hz"] / case["sample_rate_hz"])
    grid = sample_times(case["duration_s"], servo["sample_rate_hz"])
    kept = [y]
    for i, (t0, t1) in enumerate(itertools.pairwise(grid)):
        u = servo_command(servo, own.drive.stroke, t0, y[0], y[1])
        y = own.solve(own.drive.rhs_bristles, t0, t1, y, args=(u,)).y[:, -1]
        if (i + 1) % keep == 0:
            kept.append(y)
    return grid[::keep], np.array(kept), own.statistics


def _mode_at_rest(drive: Drive, y: np.ndarray) -> int:
    """Which mode follows v = 0: the piston sticks unless the applied force exceeds breakaway."""
    force = drive.applied_force(y[0], 0.0, y[2], y[4])
    breakaway = drive.coulomb_and_breakaway(y[2], y[4])[1]
    return 0 if abs(force) <= breakaway else int(math.copysign(1, force))


def _events(drive: Drive, mode: int, entered: float) -> list[Any]:
    """Events that end a mode."""

    def stops(t: float, y: np.ndarray, *_: Any) -> float:
        return mode * y[1] if t > entered + BLIND_TIME else 1.0

    def breaks_away(direction: int) -> Any:
        def excess(_t: float, y: np.ndarray, *_: Any) -> float:
            force = drive.applied_force(y[0], 0.0, y[2], y[4])
            return direction * force - drive.coulomb_and_breakaway(y[2], y[4])[1]

        excess.direction, excess.terminal = 1.0, True  # type: ignore[attr-defined]
        return excess

    stops.direction, stops.terminal = -1.0, True  # type: ignore[attr-defined]
    return [breaks_away(1), breaks_away(-1)] if mode == 0 else [stops]


def _switched(
    own: _Integration,
    y: np.ndarray,
    u: float,
    span: tuple[float, float],
    times: np.ndarray,
    states: np.ndarray,
    mode: int | None,
) -> tuple[np.ndarray, int]:
    """Integrate from switch to switch; fill the states of the times inside."""
    drive, (t, t1) = own.drive, span
    if mode is None:
        mode = _mode_at_rest(drive, y) if y[1] == 0.0 else int(np.sign(y[1]))
    for _ in range(MAX_SWITCHES):
        sliding = {"args": (u, mode), "events": _events(drive, mode, t), "dense_output": True}
        solution = own.solve(drive.rhs_sliding, t, t1, y, **sliding)
        end, y = solution.t[-1], solution.y[:, -1].copy()
        inside = (times > t) & (times <= end)
        if inside.any():
            states[inside] = solution.sol(times[inside]).T
        t = end
        if solution.status == 0:
            return y, mode
        own.statistics["switches"] += 1
        which = next(i for i, found in enumerate(solution.t_events) if len(found))
        y[1] = 0.0
        mode = (1, -1)[which] if mode == 0 else _mode_at_rest(drive, y)
    raise RuntimeError(f"more than {MAX_SWITCHES} switches between {span[0]} s and {t1} s")
