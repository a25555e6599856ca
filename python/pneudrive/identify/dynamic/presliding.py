"""Bristle stiffness and damping from presliding: force over displacement right after slow reversals.

After a reversal the contact is elastic before it slips: friction grows from -F to +F over a few bristle deflections.
The slope there is the bristle stiffness times a factor of the law. The factor is 2 for LuGre, whose bristles have
slipped before, and 1 for bristles that are elastic below breakaway. The factor is computed from a simulated loop with
known stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pneudrive import __version__
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.identify.base import SIMULATED, Fit, FittedData, Undetermined
from pneudrive.identify.dynamic.assemble import LARGEST_REACH, unresolved_damping
from pneudrive.identify.dynamic.problem import white_noise
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
        ``reversals`` is their number. ``breakaway_n`` is the breakaway force. ``slope_factor`` is the slope relative to
        the stiffness of the law.
    each : dict
        Name -> value of each reversal, shape (n,); empty if read from a file.
    """

    KIND: ClassVar[str] = "presliding"
    TITLE: ClassVar[str] = "fit of presliding"
    HEAD: ClassVar[str] = (
        "# Bristles from slow reversals. SI units; intervals are 95 %, from the scatter between reversals."
    )

    each: dict[str, Array] = field(default_factory=dict, repr=False)

    @property
    def stiffness_n_m(self) -> float:
        """Stiffness sigma0, even if the data do not determine it."""
        return self.values[STIFFNESS]

    @property
    def stiffness_interval(self) -> tuple[float, float]:
        """95 % interval of the stiffness; infinite for a single reversal."""
        return self._ends(STIFFNESS)

    @property
    def damping_n_s_m(self) -> float | None:
        """Damping sigma1; None if not determined."""
        return self.values[DAMPING] if DAMPING in self.determined else None

    @property
    def damping_interval(self) -> tuple[float, float]:
        """95 % interval of the damping; infinite for a single reversal."""
        return self._ends(DAMPING)

    @property
    def breakaway_n(self) -> float:
        """Half the change of friction between both directions, which is the load of the bristles."""
        return self.statistics["breakaway_n"]

    @property
    def reversals(self) -> int:
        """Number of evaluated reversals."""
        return int(self.statistics["reversals"])

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with the determined values, each with its interval and its recordings.

        Raises
        ------
        FitError
            The drive's law has no bristles.
        """
        return apply_identified(self.identified_as({name: name for name in self.determined}), drive)

    def compared(self) -> dict[str, FittedData]:
        """Return the values of the reversals and their means. Empty if read from a file."""
        columns = {STIFFNESS: "stiffness_n_m", DAMPING: "damping_n_s_m"}
        return {
            name: FittedData("reversal", columns[name], np.arange(1.0, own.size + 1.0), own, 0.0 * own + own.mean())
            for name, own in self.each.items()
        }

    def _ends(self, name: str) -> tuple[float, float]:
        return self.intervals[name] if self.profiler is None else self.profiler(name)

    def _title(self) -> str:
        return f"bristles from {self.reversals} reversal(s), friction of {self.breakaway_n:.4g} N in each direction"


@dataclass(frozen=True)
class _Loop:
    """Displacement, increase of friction and speed after a reversal, in the new direction; `swing` of friction."""

    displacement: Array
    gain: Array
    speed: Array
    swing: float


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
    law = drive.friction.law
    if "bristle_stiffness" not in drive.friction.parameters:
        raise FitError(f"law {law} has no bristle stiffness", remedy="Choose lugre or elasto-plastic.")
    every = loops if isinstance(loops, (list, tuple)) else [loops]
    given = [_columns(g) for g in every]
    step = max([resolution_m, *(white_noise(position) for _, position, _ in given)])
    found = [loop for columns in given for loop in _reversals(*columns, step)]
    most = max((loop.swing for loop in found), default=0.0)
    found = [loop for loop in found if loop.swing >= WHOLE_SWING * most]
    fits = [fit for loop in found if (fit := _slope(loop, step)) is not None]
    if not fits:
        raise FitError(
            "no reversal shows the bristles",
            value=f"{len(found)} reversals, position known to {1e6 * step:.3g} um",
            rule=f"{LEAST_SAMPLES} samples within {100 * SWING_SHARE:.0f} % of the swing of friction",
            remedy="Reverse more slowly, or sample faster.",
        )
    slopes, dampings = np.array(fits).T
    level = 0.5 * float(np.median([loop.swing for loop in found]))
    top = float(np.median([loop.speed.max() for loop in found]))
    factor = _factor(drive, float(slopes.mean()), level, top)
    each = {STIFFNESS: slopes / factor, DAMPING: dampings / factor}
    pooled = {name: _pooled(values) for name, values in each.items()}
    count = len(fits)
    return Presliding(
        values={name: value for name, (value, _) in pooled.items()},
        units={STIFFNESS: "N/m", DAMPING: "N s/m"},
        free=tuple(each),
        covariance=np.cov(np.array(list(each.values()))) / count if count > 1 else np.zeros((2, 2)),
        intervals={name: ends for name, (_, ends) in pooled.items()},
        undetermined=_lost(step, level, pooled[STIFFNESS], pooled[DAMPING]),
        notes=(SIMULATED,) if any(getattr(g, "synthetic", False) for g in every) else (),
        statistics={"reversals": float(count), "breakaway_n": level, "slope_factor": factor},
        provenance={
            "version": __version__,
            "drive": drive.name,
            "description_hash": drive.description_hash,
            "recordings": [str(getattr(g, "name", f"loop {i}")) for i, g in enumerate(every, 1)],
        },
        profiler={name: ends for name, (_, ends) in pooled.items()}.__getitem__,
        each=each,
    )


def _lost(
    step: float,
    level: float,
    stiffness: tuple[float, tuple[float, float]],
    damping: tuple[float, tuple[float, float]],
) -> tuple[Undetermined, ...]:
    out = []
    for name, (value, (low, high)), remedy in (
        (STIFFNESS, stiffness, "reverse more slowly and more often, with a finer encoder"),
        (DAMPING, damping, "reverse at several speeds, some of them ten times faster"),
    ):
        if not (value > 0.0 and 0.5 * (high - low) <= LARGEST_REACH * value):
            reason = f"its 95 % interval over the reversals reaches from {low:.3g} to {high:.3g}"
            out.append(Undetermined(name, reason, remedy))
    unresolved = unresolved_damping(step, level, stiffness[0])
    if unresolved is not None:
        out = [u for u in out if u.parameter != unresolved.parameter] + [unresolved]
    return tuple(out)


def _columns(given: Any) -> tuple[Array, Array, Array]:  # noqa: ANN401 - a recording or a mapping, distinguished here
    """Return time, position and friction."""
    if hasattr(given, "balance_n"):
        return given.time_s, given.position_m, given.balance_n()
    names = ("time_s", "position_m", "friction_n")
    missing = [c for c in names if c not in given]
    if missing:
        raise FitError(f"a loop lacks {', '.join(missing)}", rule="time_s, position_m and friction_n of one length")
    time, position, friction = (np.asarray(given[c], dtype=np.float64) for c in names)
    return time, position, friction


def _reversals(time: Array, position: Array, friction: Array, step: float) -> list[_Loop]:
    """Return the loops from each turning point of the position."""
    threshold = max(5.0 * step, 1e-9)
    turns = _turning_points(position, threshold)
    out = []
    for begin, end in pairwise(turns):
        if end - begin < LEAST_SAMPLES:
            continue
        part = slice(begin, end + 1)
        sign = np.sign(position[end] - position[begin])
        x = sign * (position[part] - position[begin])
        f = sign * (friction[part] - friction[begin])
        speed = sign * np.gradient(position[part], time[part])
        swing = float(np.median(f[len(f) * 3 // 4 :]))
        if swing > 0.0:
            out.append(_Loop(x, f, speed, swing))
    return out


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


def _slope(loop: _Loop, step: float) -> tuple[float, float] | None:
    """Return the slopes of friction over displacement at the reversal and over speed, by least squares.

    x = b (F - s v) + c F^2, as friction is more accurate than a displacement of a few encoder steps.
    """
    begin = loop.gain <= SWING_SHARE * loop.swing
    stop = int(np.argmin(begin)) if not begin.all() else begin.size
    if stop < LEAST_SAMPLES or loop.displacement[stop - 1] < 2.0 * step:
        return None
    f, v, x = loop.gain[:stop], loop.speed[:stop], loop.displacement[:stop]
    sizes = np.array([f.max(), f.max() ** 2, max(np.abs(v).max(), 1e-12), 1.0])
    design = np.stack([f, f**2, v, np.ones_like(f)], axis=1) / sizes
    b, _, d, _ = np.linalg.lstsq(design, x, rcond=1e-8)[0] / sizes
    return (1.0 / b, -d / b) if b > 0.0 else None


def _pooled(values: Array) -> tuple[float, tuple[float, float]]:
    """Return the mean and the 95 % interval over reversals."""
    mean, n = float(values.mean()), values.size
    if n == 1:
        return mean, (-np.inf, np.inf)
    reach = float(student(n - 1) * values.std(ddof=1) / np.sqrt(n))
    return mean, (mean - reach, mean + reach)


def _factor(drive: Drive, slope: float, level: float, speed: float) -> float:
    """Return the ratio of slope to stiffness for the drive's law.

    A simulated loop of this force is evaluated like a measured one.
    """
    stiffness = slope
    factor = 1.0
    for _ in range(ROUNDS):
        loops = _reversals(*_simulated_loop(drive, stiffness, level, speed), 0.0)
        fits = [fit[0] for loop in loops[1:] if (fit := _slope(loop, 0.0)) is not None]
        if not fits:
            break
        factor = float(np.mean(fits)) / stiffness
        stiffness = slope / factor
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
