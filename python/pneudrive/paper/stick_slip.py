"""Figures 1 to 3 of the source paper: a drive that sticks and slips at a mean speed of 9.34 mm/s."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import local_slope
from pneudrive.characterise.stick_slip import STUCK_SHARE, StickSlip, measure_stick_slip
from pneudrive.describe import Drive
from pneudrive.paper.figure import PaperFigure
from pneudrive.rig.sensors import AnalogSensor, Encoder
from pneudrive.simulate import simulate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SLOW_DRIVE = Path(__file__).with_name("slow_drive.toml")
#: Mean speed of the paper's figure 1, and how near ours has to come.
MEAN_SPEED_M_S = 9.34e-3
SPEED_TOLERANCE_M_S = 0.5e-3
#: What makes a motion stick-slip: number of periods, peak over mean speed, share of time below 20 % of the mean.
LEAST_PERIODS = 5
LEAST_PEAK_RATIO = 3.0
LEAST_STUCK_SHARE = 0.3
#: Valve openings at which the drive of `slow_drive.toml` reaches that mean speed, found by bisection.
OPENING = {"lugre": 0.0016, "stribeck": 0.0016}
START_M = 0.05
SKIPPED_S = 4.0
SHOWN_S = 16.0
SAMPLE_RATE = "1 kHz"
#: Sensors of the drive in figure 1 (assumed): position in steps of 5 um, pressures to 10 bar with 16 bits.
ENCODER = Encoder(5e-6)
PRESSURE_SENSOR = AnalogSensor(0.0, 1.1e6, 16, noise=200.0)
#: Half width in samples of the slope that gives a speed from the counted position: 25 ms.
SLOPE_HALF_WIDTH = 12


def slow_drive(law: str = "lugre") -> Drive:
    """Return the drive of the stick-slip figures, with the LuGre law or with Coulomb and Stribeck combined."""
    drive = Drive.load(SLOW_DRIVE)
    if law == drive.friction.law:
        return drive
    kept = ("coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous")
    table = {key: value for key, value in drive.friction.to_dict().items() if key in kept}
    return drive.replace({"friction": {"law": law, **table}})


def creep(law: str, opening: float | None = None) -> xr.Dataset:
    """Simulate the slow drive through the section that the figures show.

    Parameters
    ----------
    law : str
        ``lugre`` or ``stribeck``.
    opening : float, optional
        Valve command; None takes the one that gives the paper's mean speed.

    Returns
    -------
    xarray.Dataset
        Trajectory from the moment at which the start has died away, its time from zero.
    """
    u = OPENING[law] if opening is None else opening
    start = f"position = {START_M} m, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
    run = simulate(slow_drive(law), [(0.0, u)], SKIPPED_S + SHOWN_S, initial=start, sample_rate=SAMPLE_RATE)
    shown = run.isel(time=slice(int(np.searchsorted(run.time.values, SKIPPED_S)), None))
    return shown.assign_coords(time=("time", shown.time.values - shown.time.values[0], shown.time.attrs))


def figure_1(seed: int = 0) -> PaperFigure:
    """Stick-slip as sensors on a drive would show it: counted position, speed from its slope, noisy pressures."""
    run = creep("lugre")
    rng = np.random.default_rng(seed)
    time = run.time.to_numpy()
    position = ENCODER.read(run.position.to_numpy())
    columns = {
        "time_s": time,
        "position_m": position,
        "velocity_m_s": local_slope(time, position, SLOPE_HALF_WIDTH),
        "pressure_a_pa": PRESSURE_SENSOR.read(run.pressure_a.to_numpy(), rng),
        "pressure_b_pa": PRESSURE_SENSOR.read(run.pressure_b.to_numpy(), rng),
    }
    return _figure(1, "Stick-slip of a drive, read by sensors", columns)


def figure_2() -> PaperFigure:
    """Stick-slip of the same drive simulated with the LuGre law."""
    return _figure(2, "Simulated with the LuGre law", _columns(creep("lugre")))


def figure_3() -> PaperFigure:
    """Stick-slip of the same drive simulated with Coulomb and Stribeck friction combined, sticking exactly."""
    columns = _columns(creep("stribeck"))
    figure = _figure(3, "Simulated with Coulomb and Stribeck friction", columns)
    still = float(np.mean(columns["velocity_m_s"] == 0.0))
    return replace(
        figure,
        holds=figure.holds and still > 0.0,
        measured=f"{figure.measured}; exactly at rest for {100.0 * still:.0f} % of the time",
        quantities=figure.quantities | {"rest_share": still},
    )


def _columns(run: xr.Dataset) -> dict[str, Array]:
    return {
        "time_s": run.time.to_numpy(),
        "position_m": run.position.to_numpy(),
        "velocity_m_s": run.velocity.to_numpy(),
        "pressure_a_pa": run.pressure_a.to_numpy(),
        "pressure_b_pa": run.pressure_b.to_numpy(),
        "friction_n": run.friction_force.to_numpy(),
    }


def whole_periods(columns: dict[str, Array]) -> StickSlip:
    """Measure stick-slip between the first and the last onset of a slip, so that the mean covers whole periods."""
    time, position, velocity = columns["time_s"], columns["position_m"], columns["velocity_m_s"]
    onsets = _onsets(velocity, float((position[-1] - position[0]) / (time[-1] - time[0])))
    part = slice(onsets[0], onsets[-1] + 1) if len(onsets) >= 2 else slice(None)
    return measure_stick_slip(time[part], position[part], velocity[part])


def _onsets(velocity: Array, mean: float) -> list[int]:
    """First sample of each slip: above the mean after a rest below a fifth of it."""
    onsets, rested = [], False
    for i in np.flatnonzero((velocity > mean) | (velocity < STUCK_SHARE * mean)):
        if velocity[i] < STUCK_SHARE * mean:
            rested = True
        elif rested:
            onsets.append(int(i))
            rested = False
    return onsets


def _figure(number: int, title: str, columns: dict[str, Array]) -> PaperFigure:
    found = whole_periods(columns)
    ratio = found.peak_speed_m_s / found.mean_speed_m_s
    near = abs(found.mean_speed_m_s - MEAN_SPEED_M_S) <= SPEED_TOLERANCE_M_S
    holds = (
        near and found.periods >= LEAST_PERIODS and ratio >= LEAST_PEAK_RATIO and found.stuck_share >= LEAST_STUCK_SHARE
    )
    return PaperFigure(
        number=number,
        title=title,
        sentence="At low speed the compressible air makes the piston move in steps: it sticks and slips "
        "(mean speed about 9.34 mm/s).",
        holds=holds,
        measured=f"{found.periods} periods of {found.period_s:.2f} s and {1e3 * found.step_m:.1f} mm at a mean of "
        f"{1e3 * found.mean_speed_m_s:.2f} mm/s; slips peak at {ratio:.1f} times the mean; below a fifth of it for "
        f"{100.0 * found.stuck_share:.0f} % of the time",
        quantities={
            "periods": float(found.periods),
            "period_s": found.period_s,
            "step_m": found.step_m,
            "mean_speed_m_s": found.mean_speed_m_s,
            "peak_speed_m_s": found.peak_speed_m_s,
            "peak_ratio": ratio,
            "stuck_share": found.stuck_share,
        },
        columns=columns,
    )
