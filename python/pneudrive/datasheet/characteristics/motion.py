"""Runs of a drive for its characteristics: one stroke, and a periodic cycle out and back."""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.datasheet.equilibrium import under_load
from pneudrive.datasheet.strokes import StrokeNumbers, stroke_numbers
from pneudrive.describe.system import short_name
from pneudrive.errors import CommandError, PneudriveWarning, SimulationError
from pneudrive.simulation.simulate import simulate
from pneudrive.simulation.trajectory import columns as columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.datasheet.plant import HeldDrive
    from pneudrive.simulation.command import Commands

    Array = NDArray[np.float64]

SLOWER, LONGEST = 4.0, 256.0  # a piston that has not arrived is given this much more time, up to this multiple
EXPECTED = 4.0  # times the stroke over its steady speed
USUAL_SPEED = 0.5  # m/s, where no steady one is found
LEAST_S = 0.2  # of a half cycle
SAMPLES = 2000  # of a stroke
REPEATS = 3  # cycles after which a fast cycle repeats itself


class StrokeRun(NamedTuple):
    """A run and its strokes: columns by a drive's names, one stroke for each command."""

    columns: dict[str, Array]
    strokes: tuple[StrokeNumbers, ...]
    half_s: float
    attrs: dict[str, Any]

    def arrived(self) -> bool:
        """Return whether all strokes reached their end."""
        return all(stroke.stroke_time == stroke.stroke_time for stroke in self.strokes)


def simulate_plant(plant: HeldDrive, plans: Commands, duration: float, rate: float, **more: Any) -> xr.Dataset:  # noqa: ANN401
    """Simulate the circuit of a drive without its warnings, which belong to the user's own runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        return simulate(plant.circuit, plans, duration, sample_rate=rate, **more)


def short_columns(plant: HeldDrive, run: xr.Dataset) -> dict[str, Array]:
    """Return the columns of a circuit's run by a drive's names."""
    return {short_name(name, plant.piston): values for name, values in columns_of(run).items()}


def expected_time(plant: HeldDrive, command: float) -> float:
    """Return a time in which a stroke should end, s."""
    try:
        speed = min(
            abs(under_load(plant.static, side * command, 0.5 * plant.stroke_m, 0.0).velocity_m_s) for side in (1, -1)
        )
    except (CommandError, SimulationError):
        speed = USUAL_SPEED
    return max(EXPECTED * plant.stroke_m / speed, LEAST_S) if speed > 0.0 else LONGEST * LEAST_S


def one_stroke(
    plant: HeldDrive, command: float, position: float, pressures: tuple[float, float], *, ledger: bool = False
) -> StrokeRun:
    """Run one stroke from rest until the piston arrives, or rests elsewhere."""
    expected = expected_time(plant, abs(command))
    start = start_of(plant, position, pressures)
    times = 1.0
    while True:
        half = times * expected
        run = simulate_plant(
            plant, plant.plans([(0.0, command)]), half, SAMPLES / expected, initial=start, ledger=ledger
        )
        found = _motion(plant, run, half, (0.0, half), command)
        if found.arrived() or times >= LONGEST or times * expected > LONGEST:
            return found
        times *= SLOWER


def start_of(plant: HeldDrive, position: float, pressures: tuple[float, float]) -> dict[str, str]:
    """Return a start at ambient temperature; lines have the pressure of their chamber."""
    own = plant.piston
    start = {f"{own}.position": f"{position!r} m"}
    sides = [(side, p) for side, p in zip("ab", pressures, strict=True) if f"{own}.{side}" in plant.nodes]
    return start | {f"{own}.{side}": f"{p!r} Pa abs" for side, p in sides}


def cycle(
    plant: HeldDrive,
    command: float = 1.0,
    half_s: float | None = None,
    repeats: int = REPEATS,
    **more: Any,  # noqa: ANN401
) -> StrokeRun:
    """Run out and back until the cycle is periodic; columns and strokes are those of the last cycle."""
    expected = expected_time(plant, command)
    times, half = 1.0, half_s or expected
    start = start_of(plant, 0.0, plant.before(1.0))
    while True:
        plans = plant.plans([(k * half, command if k % 2 == 0 else -command) for k in range(2 * repeats)])
        run = simulate_plant(plant, plans, 2 * repeats * half, SAMPLES / min(expected, half), initial=start, **more)
        begin = 2 * (repeats - 1) * half
        found = _motion(plant, run, half, (begin, begin + half, begin + 2 * half), command)
        if found.arrived() or half_s is not None or times >= LONGEST or half * SLOWER > LONGEST:
            return found
        times, half = times * SLOWER, half * SLOWER


def _motion(plant: HeldDrive, run: xr.Dataset, half: float, edges: tuple[float, ...], command: float) -> StrokeRun:
    """Return the strokes between the edges.

    The first stroke has the direction of the command, and the next stroke is back.
    """
    columns = short_columns(plant, run)
    impacts = run.attrs["impacts"]
    strokes = []
    for k, (begin, end) in enumerate(pairwise(edges)):
        own = [impact for impact in impacts if begin <= impact["time_s"] < end]
        towards = 1 if (command > 0.0) == (k % 2 == 0) else -1
        strokes.append(stroke_numbers(columns, plant.stroke_m, plant.mass, begin, end, own, towards))
    keep = columns["time_s"] >= edges[0]
    last = {name: values[keep] for name, values in columns.items()}
    last["time_s"] = last["time_s"] - edges[0]
    return StrokeRun(last, tuple(strokes), half, run.attrs)
