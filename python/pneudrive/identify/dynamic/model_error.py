"""Lower limit of the model error of identified values: effect of errors in held numbers.

An interval covers only the noise of the sensors and becomes smaller with every sample, while the model is never exact.
Here each held
number of the description (bore, supply pressure, conductance, ...) has an error of `MODEL_SHARE`, the fraction of the
balances' terms that the diagnosis ignores. The free values respond by least squares on the balances along the
recordings (force in sliding, both pressure rates):

    d theta_h = - (Phi^T W Phi)^-1 Phi^T W d e_h,    floor = sqrt(sum over h of d theta_h^2)

Phi are the derivatives of the balances' residuals by the free values, and d e_h their change with the held number h. W
weights each balance by one over the mean square of its terms. The formula uses the motion of the recordings, but not
their noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import _core
from pneudrive.errors import PneudriveError
from pneudrive.free.parameters import DriveFamily, family_of, numbers_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.free.parameters import Parameter
    from pneudrive.identify.dynamic.uncertainty import Solved

    Array = NDArray[np.float64]

#: Relative error of each term of a model of a drive (assumed).
MODEL_SHARE = 0.01
#: Share of the greatest speed below which friction is not that of sliding.
SLIDES = 0.01
#: Share of the largest scaled derivative below which a direction is not determined.
SINGULAR_SHARE = 1e-3
_STATES = ("position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa")


def model_errors(drive: Drive, parameters: list[Parameter], solved: Solved) -> dict[str, float]:
    """Return the lower limit of the model error of each free value with an effect on sliding, SI."""
    if not drive.is_plain:  # the balances of the chambers differ
        return {}
    found = solved.problem.values(solved.point.eta)[: len(parameters)]
    free = [replace(p, value=float(value)) for p, value in zip(parameters, found, strict=True)]
    held = _held(drive, free, solved)
    family = family_of(drive, [*free, *held])
    values = np.array([p.value for p in (*free, *held)])
    steps = np.array([MODEL_SHARE * max(abs(p.value), p.size if np.isinf(p.lower) else 0.0) for p in (*free, *held)])
    try:
        motions = [_motion(solved, index) for index in range(len(solved.problem.experiments))]
        at = [_balances(family, values, motion) for motion in motions]
        scale = np.sqrt([sum(np.sum(one[1][b] ** 2) for one in at) for b in range(3)])
        here = [balances for balances, _ in at]
        columns = np.column_stack(
            [_change(family, values, k, steps[k], zip(motions, here, strict=True), scale) for k in range(values.size)]
        )
    except (PneudriveError, ValueError):
        return {}
    if not np.isfinite(columns).all():
        return {}
    own, off = columns[:, : len(free)], columns[:, len(free) :]
    size = np.linalg.norm(own, axis=0)
    shown = size > 0.0
    inverse = np.linalg.pinv(own[:, shown] / size[shown], rcond=SINGULAR_SHARE) / size[shown][:, None]
    floor = np.linalg.norm(inverse @ off, axis=1) * steps[: len(free)][shown]
    names = [p.name for p, one in zip(free, shown, strict=True) if one]
    return dict(zip(names, floor.tolist(), strict=True))


def _held(drive: Drive, free: list[Parameter], solved: Solved) -> list[Parameter]:
    """Return the held numbers of the drive that are not derived from free ones, with their values."""
    family = solved.problem.experiments[0].shooter.family
    known = {*family.paths, *(one.path for one in family.settled), *(p.core for p in free)}
    every = [replace(p, value=family.get(p.core)) for p in numbers_of(drive).values() if p.core not in known]
    return [p for p in every if p.value != 0.0 and not p.name.startswith(("gas.", "valve.linear_above"))]


def _motion(solved: Solved, index: int) -> dict[str, Array]:
    """Return the states of the fitted model along a recording, without noise."""
    experiment = solved.problem.experiments[index]
    shooter = experiment.shooter.with_outputs(_STATES)
    values = solved.problem.values(solved.point.eta)[: solved.problem.drive_size]
    states = shooter.run(values, solved.point.states[index], derivatives=False).outputs
    motion = {name: np.ascontiguousarray(states[:, k]) for k, name in enumerate(_STATES)}
    recording = shooter.recording
    start = solved.point.states[index][0]
    return motion | {"time_s": recording.time_s, "command": recording["command"], "temperatures": start[[3, 5]]}


def _balances(family: DriveFamily, values: Array, motion: dict[str, Array]) -> tuple[list[Array], list[Array]]:
    """Return the balances along a motion, and their terms: force in sliding, N, and pressure rates, Pa/s."""
    out = family.core(values).along(
        motion["time_s"],
        motion["position_m"],
        motion["velocity_m_s"],
        motion["pressure_a_pa"],
        motion["pressure_b_pa"],
        _core.valve_openings(motion["command"]),
        [float(t) for t in motion["temperatures"]],
    )
    if "slides" not in motion:  # at the solution; changes of numbers are evaluated along the same motion
        speed = np.abs(motion["velocity_m_s"])
        motion["slides"] = (speed > SLIDES * speed.max()) & (out["end_stop_force_n"] == 0.0)
    slides = motion["slides"]
    pushed, friction = out["force_n"] * slides, out["friction_n"] * slides
    mass = family.get("cylinder.moving_mass") + family.get("load.mass")
    if "inertia_n_kg" not in motion:
        motion["inertia_n_kg"] = (pushed - friction) / mass
    residual = mass * motion["inertia_n_kg"] - pushed + friction
    rates = [out["pressure_rate_a_pa_s"], out["pressure_rate_b_pa_s"]]
    return [residual, *rates], [np.hypot(pushed, friction), *rates]


def _change(
    family: DriveFamily,
    values: Array,
    k: int,
    step: float,
    motions: Iterable[tuple[dict[str, Array], list[Array]]],
    scale: Array,
) -> Array:
    """Return the change of all balances, relative to their terms, for a step of one number of the drive.

    `motions` are given with their balances at `values`.
    """
    parts = []
    for motion, here in motions:
        for sign in (1.0, -1.0):  # a number at a bound is changed in the other direction
            beside = values.copy()
            beside[k] += sign * step
            try:
                there = _balances(family, beside, motion)[0]
            except PneudriveError:
                if sign < 0.0:
                    raise
                continue
            parts += [sign * (b - a) / s for a, b, s in zip(here, there, scale, strict=True)]
            break
    return np.concatenate(parts)
