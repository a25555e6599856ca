"""Bristle stiffness and damping from presliding: force over displacement right after slow reversals.

After a reversal the contact is elastic before it slips: friction grows from -F to +F over a few bristle deflections.
The slope there is the bristle stiffness times a factor of the law. The factor is 2 for LuGre, whose bristles have
slipped before, and 1 for bristles that are elastic below breakaway. The factor is computed from a simulated loop with
known stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pneudrive import __version__
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.identify.base import SIMULATED, Fit, Undetermined
from pneudrive.identify.compared import FittedData
from pneudrive.identify.dynamic.problem import white_noise
from pneudrive.identify.dynamic.result import LARGEST_REACH, unresolved_damping
from pneudrive.identify.identified import apply_identified
from pneudrive.simulation.bench_circuit import Dragged

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

STIFFNESS, DAMPING = "friction.bristle_stiffness", "friction.bristle_damping"
#: Share of the swing of friction over which the slope is evaluated.
SWING_SHARE = 0.35
#: Least number of samples of a reversal within that share.
LEAST_SAMPLES = 6
#: Least swing of friction of a reversal, as a share of the greatest swing.
WHOLE_SWING = 0.6
#: Steps of the search for the stiffness with the measured slope in the simulated loop.
ROUNDS = 3


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Presliding(Fit):
    """Bristle parameters from reversals; SI.

    Attributes
    ----------
    values, intervals : dict
        ``friction.bristle_stiffness`` (sigma0) and ``friction.bristle_damping`` (sigma1); intervals are 95 %, from the
        scatter between reversals.
    statistics : dict
        ``reversals`` is their number. ``breakaway_n`` is the breakaway force: half the change of friction between both
        directions. ``slope_factor`` is the slope relative to the stiffness of the law.
    """

    KIND: ClassVar[str] = "presliding"
    TITLE: ClassVar[str] = "fit of presliding"
    HEAD: ClassVar[str] = (
        "# Bristles from slow reversals. SI units; intervals are 95 %, from the scatter between reversals."
    )

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with the determined values, each with its interval and its recordings.

        Raises
        ------
        FitError
            The drive's law has no bristles.
        """
        return apply_identified(self.identified_as({name: name for name in self.determined}), drive)

    def _title(self) -> str:
        reversals, force = self.statistics["reversals"], self.statistics["breakaway_n"]
        return f"bristles from {reversals:.0f} reversal(s), friction of {force:.4g} N in each direction"


def identify_presliding(
    drive: Drive,
    loops: Recording | Mapping[str, Any] | Sequence[Recording | Mapping[str, Any]],
    *,
    resolution_m: float = 0.0,
) -> Presliding:
    """Identify bristle stiffness, and damping if the encoder resolves it, from force-displacement loops.

    Parameters
    ----------
    drive : Drive
        Drive with the friction law and its other parameters.
    loops
        Recordings of a rig with slow reversals, or mappings with ``time_s``, ``position_m`` and ``friction_n`` (the
        force that opposes motion in +x), shape (n,).
    resolution_m : float
        Step of the encoder.

    Returns
    -------
    Presliding

    Raises
    ------
    FitError
        The law has no bristles, or no reversal can be evaluated.
    """
    if "bristle_stiffness" not in drive.friction.parameters:
        raise FitError(f"law {drive.friction.law} has no bristle stiffness", remedy="Choose lugre or elasto-plastic.")
    every = loops if isinstance(loops, (list, tuple)) else [loops]
    columns = [_columns(loop) for loop in every]
    step = max([resolution_m, *(white_noise(position) for _, position, _ in columns)])
    found = [reversal for loop in columns for reversal in _reversals(*loop, step)]
    most = max((_swing(reversal) for reversal in found), default=0.0)
    found = [reversal for reversal in found if _swing(reversal) >= WHOLE_SWING * most]
    slopes = [slope for reversal in found if (slope := _slope(reversal, step)) is not None]
    if not slopes:
        raise FitError(
            "no reversal shows the bristles",
            value=f"{len(found)} reversals, position known to {1e6 * step:.3g} um",
            rule=f"{LEAST_SAMPLES} samples within {100 * SWING_SHARE:.0f} % of the swing of friction",
            remedy="Reverse more slowly, or sample faster.",
        )
    stiffness, damping = np.array(slopes).T
    level = 0.5 * float(np.median([_swing(reversal) for reversal in found]))
    top = float(np.median([speed.max() for _, _, speed in found]))
    factor = _factor(drive, float(stiffness.mean()), level, top)
    each, count = {STIFFNESS: stiffness / factor, DAMPING: damping / factor}, len(slopes)
    values = {name: float(own.mean()) for name, own in each.items()}
    ends = {name: _interval(own) for name, own in each.items()}
    return Presliding(
        values=values,
        units={STIFFNESS: "N/m", DAMPING: "N s/m"},
        free=tuple(each),
        covariance=np.cov(np.array(list(each.values()))) / count if count > 1 else np.zeros((2, 2)),
        intervals=ends,
        undetermined=_lost(step, level, values, ends),
        notes=(SIMULATED,) if any(getattr(loop, "synthetic", False) for loop in every) else (),
        statistics={"reversals": float(count), "breakaway_n": level, "slope_factor": factor},
        provenance={
            "version": __version__,
            "drive": drive.name,
            "description_hash": drive.description_hash,
            "recordings": [str(getattr(loop, "name", f"loop {i}")) for i, loop in enumerate(every, 1)],
            INPUTS: inputs_of(drive),
        },
        profiler=ends.__getitem__,
        fitted={
            name: FittedData("reversal", column, np.arange(1.0, count + 1.0), own, 0.0 * own + own.mean())
            for (name, own), column in zip(each.items(), ("stiffness_n_m", "damping_n_s_m"), strict=True)
        },
    )


def _lost(
    step: float, level: float, values: dict[str, float], ends: dict[str, tuple[float, float]]
) -> tuple[Undetermined, ...]:
    unresolved = unresolved_damping(step, level, values[STIFFNESS])
    remedies = {STIFFNESS: "reverse more slowly and more often, with a finer encoder"}
    remedies |= {} if unresolved else {DAMPING: "reverse at several speeds, some of them ten times faster"}
    out = []
    for name, remedy in remedies.items():
        low, high = ends[name]
        if not (values[name] > 0.0 and 0.5 * (high - low) <= LARGEST_REACH * values[name]):
            reason = f"its 95 % interval over the reversals reaches from {low:.3g} to {high:.3g}"
            out.append(Undetermined(name, reason, remedy))
    return (*out, unresolved) if unresolved else tuple(out)


def _columns(loop: Any) -> tuple[Array, Array, Array]:  # noqa: ANN401 - a recording or a mapping, distinguished here
    """Return time, position and friction."""
    if hasattr(loop, "balance_n"):
        return loop.time_s, loop.position_m, loop.balance_n()
    names = ("time_s", "position_m", "friction_n")
    missing = [c for c in names if c not in loop]
    if missing:
        raise FitError(f"a loop lacks {', '.join(missing)}", rule="time_s, position_m and friction_n of one length")
    time, position, friction = (np.asarray(loop[c], dtype=np.float64) for c in names)
    return time, position, friction


def _reversals(time: Array, position: Array, friction: Array, step: float) -> list[Array]:
    """Return displacement, increase of friction and speed after each turn, in the new direction, shape (3, n) each."""
    out = []
    for begin, end in pairwise(_turning_points(position, max(5.0 * step, 1e-9))):
        part, sign = slice(begin, end + 1), np.sign(position[end] - position[begin])
        if end - begin >= LEAST_SAMPLES:
            x, f = position[part] - position[begin], friction[part] - friction[begin]
            out.append(sign * np.stack([x, f, np.gradient(position[part], time[part])]))
    return [reversal for reversal in out if _swing(reversal) > 0.0]


def _swing(reversal: Array) -> float:
    """Return the change of friction between both directions: the median over the last quarter."""
    return float(np.median(reversal[1, reversal.shape[1] * 3 // 4 :]))


def _turning_points(position: Array, threshold: float) -> list[int]:
    """Return the samples at which the position turns back by more than a threshold."""
    turns, low, high, rising = [], 0, 0, 0
    for i, x in enumerate(position):
        if x > position[high]:
            high = i
        if x < position[low]:
            low = i
        if rising >= 0 and position[high] - x > threshold:
            turns.append(high)
            rising, low = -1, i
        elif rising <= 0 and x - position[low] > threshold:
            turns.append(low)
            rising, high = 1, i
    turns.append(high if rising > 0 else low)
    return sorted(set(turns))


def _slope(reversal: Array, step: float) -> tuple[float, float] | None:
    """Return the slopes of friction over displacement at the reversal and over speed, by least squares.

    x = b (F - s v) + c F^2, as friction is more accurate than a displacement of a few encoder steps.
    """
    begin = reversal[1] <= SWING_SHARE * _swing(reversal)
    stop = int(np.argmin(begin)) if not begin.all() else begin.size
    if stop < LEAST_SAMPLES or reversal[0, stop - 1] < 2.0 * step:
        return None
    x, f, v = reversal[:, :stop]
    sizes = np.array([f.max(), f.max() ** 2, max(np.abs(v).max(), 1e-12), 1.0])
    design = np.stack([f, f**2, v, np.ones_like(f)], axis=1) / sizes
    b, _, d, _ = np.linalg.lstsq(design, x, rcond=1e-8)[0] / sizes
    return (1.0 / b, -d / b) if b > 0.0 else None


def _interval(values: Array) -> tuple[float, float]:
    """Return the 95 % interval of the mean over reversals; infinite for a single one."""
    if values.size == 1:
        return -np.inf, np.inf
    mean, n = float(values.mean()), values.size
    reach = float(student(n - 1) * values.std(ddof=1) / np.sqrt(n))
    return mean - reach, mean + reach


def _factor(drive: Drive, slope: float, level: float, speed: float) -> float:
    """Return the ratio of slope to stiffness for the drive's law.

    A simulated loop of this force is evaluated like a measured one.
    """
    factor = 1.0
    for _ in range(ROUNDS):
        loops = _reversals(*_simulated_loop(drive, slope / factor, level, speed), 0.0)
        slopes = [found[0] for loop in loops[1:] if (found := _slope(loop, 0.0)) is not None]
        if not slopes:
            break
        factor = float(np.mean(slopes)) / (slope / factor)
    return factor


def _simulated_loop(drive: Drive, stiffness: float, level: float, speed: float) -> tuple[Array, Array, Array]:
    """Simulate the law to and fro over many bristle deflections, on a stiff rig without air."""
    law = drive.friction.core()
    parameters = dict(law["parameters"])
    ratio = level / max(parameters.get("breakaway", parameters.get("coulomb", level)), 1e-12)
    for name in ("coulomb", "breakaway"):
        if name in parameters:
            parameters[name] *= ratio
    parameters["bristle_stiffness"] = stiffness
    travel = 12.0 * level / stiffness
    piston = {"area_a": 1e-9, "area_b": 1e-9, "stroke": 10.0 * travel, "moving_mass": 1e-2}
    friction = {**law, "parameters": parameters, "pressure": None}
    rig = Dragged(friction, piston, {"stiffness": 1e3 * stiffness, "damping": 1e2})
    for side in "ab":
        rig.hold(side, STANDARD_ATMOSPHERE_PA)
    cruise, turn = travel / speed, 0.02 * travel / speed
    jerk = 4.0 * speed / turn**2
    durations, jerks = [], []
    for change in (1.0, -2.0, 2.0, -2.0):
        durations += [0.5 * turn, 0.5 * turn, cruise]
        jerks += [change * jerk, -change * jerk, 0.0]
    times = np.linspace(0.0, sum(durations), 20000, endpoint=False)
    columns = rig.run(durations, jerks, times, 5.0 * travel, 1e-8).columns
    return columns["time_s"], columns["position_m"], columns["friction_force_n"]
