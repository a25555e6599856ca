"""Figures 1 to 3 of the source paper: a drive that sticks and slips at a mean speed of 9.34 mm/s."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import pneudrive as pn
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import mean_estimate
from pneudrive.friction.stick_slip import STUCK_SHARE, StickSlip, measure_stick_slip, slip_onsets
from pneudrive.rig import AnalogSensor, Encoder, Envelope, Identity
from pneudrive.rig.interface import envelope_of
from pneudrive.signals.motion import local_slope
from pneudrive.simulation.trajectory import columns
from pneudrive.studies.bracha.figure import PaperFigure, judge

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.arrays import Array, Columns, Interval, Row
    from pneudrive.campaign.storage.folder import Campaign


SLOW_DRIVE = Path(__file__).with_name("slow_drive.toml")
#: Mean speed of the paper's figure 1, m/s, and tolerance of our mean speed.
MEAN_SPEED_M_S = 9.34e-3
SPEED_TOLERANCE_M_S = 0.5e-3
#: Criteria of stick-slip: number of periods, ratio of peak to mean speed, fraction of time below 20 % of the mean
#: speed.
LEAST_PERIODS = 5
LEAST_PEAK_RATIO = 3.0
LEAST_STUCK_SHARE = 0.3
#: Valve openings at which the drive of `slow_drive.toml` reaches that mean speed, found by bisection.
OPENING = {"lugre": 0.0016, "stribeck": 0.0016}
#: Multiple of that opening at which the speed is no longer low.
FASTER = 10
FASTER_S = 6.0
MIDDLE_M = (0.15, 0.45)  # of the stroke of 0.5 m, so that neither start nor stop counts
#: Length of steps from which positioning is difficult, m (our interpretation).
COARSE_M = 1e-3
START = "position = 0.05 m, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
SKIPPED_S = 4.0
SHOWN_S = 16.0
SAMPLE_RATE = "1 kHz"
#: Sensors of the drive in figure 1 (assumed): position in steps of 5 um, pressures to 10 bar with 16 bits.
ENCODER = Encoder(5e-6)
PRESSURE_SENSOR = AnalogSensor(0.0, 1.1e6, 16, noise=200.0)
#: Half width, in samples, of the window for the speed as slope of the counted position (25 ms).
SLOPE_HALF_WIDTH = 12


def slow_drive(law: str = "lugre") -> pn.Drive:
    """Return the drive of the stick-slip figures, with the LuGre law or with combined Coulomb and Stribeck friction."""
    drive = pn.Drive.load(SLOW_DRIVE)
    if law == drive.friction.law:
        return drive
    kept = ("coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous")
    table = {key: value for key, value in drive.friction.to_dict().items() if key in kept}
    return drive.replace({"friction": {"law": law, **table}})


def creep(law: str) -> xr.Dataset:
    """Simulate the slow drive at the paper's mean speed, over the section of the stroke that the figures show.

    Parameters
    ----------
    law : str
        ``lugre`` or ``stribeck``.

    Returns
    -------
    xarray.Dataset
        Trajectory after the starting transient; its time begins at zero.
    """
    run = pn.simulate(
        slow_drive(law), [(0.0, OPENING[law])], SKIPPED_S + SHOWN_S, initial=START, sample_rate=SAMPLE_RATE
    )
    shown = run.isel(time=slice(int(np.searchsorted(run.time.values, SKIPPED_S)), None))
    return shown.assign_coords(time=("time", shown.time.values - shown.time.values[0], shown.time.attrs))


def figure_1(seed: int = 0) -> PaperFigure:
    """Return stick-slip in sensor readings of the slow drive: quantised position, its slope, noisy pressures."""
    run = creep("lugre")
    rng = np.random.default_rng(seed)
    time = run.time.to_numpy()
    position = ENCODER.read(run.position.to_numpy())
    read = {
        "time_s": time,
        "position_m": position,
        "velocity_m_s": local_slope(time, position, SLOPE_HALF_WIDTH),
        "pressure_a_pa": PRESSURE_SENSOR.read(run.pressure_a.to_numpy(), rng),
        "pressure_b_pa": PRESSURE_SENSOR.read(run.pressure_b.to_numpy(), rng),
    }
    found, faster = whole_periods(read), measure_faster()
    verdicts = {
        "steps": judge(sticks(found) and not sticks(faster), part=sticks(found)),
        "speed": judge(abs(found.mean_speed_m_s - MEAN_SPEED_M_S) <= SPEED_TOLERANCE_M_S, part=False),
    }
    return PaperFigure.make(
        1,
        verdicts,
        _quantities(found),
        read,
        opened=FASTER,
        faster_speed_m_s=faster.mean_speed_m_s,
        faster_stuck_share=faster.stuck_share,
    )


def measure_faster() -> StickSlip:
    """Measure the motion of the slow drive through the middle of its stroke, with the valve further open."""
    run = pn.simulate(
        slow_drive(), [(0.0, FASTER * OPENING["lugre"])], FASTER_S, initial=START, sample_rate=SAMPLE_RATE
    )
    motion = columns(run)
    inside = (motion["position_m"] > MIDDLE_M[0]) & (motion["position_m"] < MIDDLE_M[1])
    return whole_periods({name: values[inside] for name, values in motion.items()})


def figure_2() -> PaperFigure:
    """Return stick-slip of the slow drive, simulated with the LuGre law."""
    motion = columns(creep("lugre"))
    found = whole_periods(motion)
    verdicts = {
        "simulates": judge(sticks(found), part=False),
        "coarse": judge(sticks(found) and found.step_m > COARSE_M, part=sticks(found)),
    }
    return PaperFigure.make(2, verdicts, _quantities(found), motion)


def figure_3() -> PaperFigure:
    """Return stick-slip of the slow drive with combined Coulomb and Stribeck friction, exactly at rest when stuck."""
    motion = columns(creep("stribeck"))
    found = whole_periods(motion)
    still = np.mean(motion["velocity_m_s"] == 0.0)
    verdicts = {"simulates": judge(sticks(found) and still > 0.0, part=sticks(found))}
    return PaperFigure.make(3, verdicts, _quantities(found) | {"rest_share": still}, motion)


def whole_periods(motion: Columns) -> StickSlip:
    """Measure stick-slip between the first and the last onset of a slip, so that the mean covers whole periods."""
    time, position, velocity = motion["time_s"], motion["position_m"], motion["velocity_m_s"]
    mean = (position[-1] - position[0]) / (time[-1] - time[0])
    onsets = slip_onsets(velocity < STUCK_SHARE * mean, velocity > mean)
    part = slice(onsets[0], onsets[-1] + 1) if len(onsets) >= 2 else slice(None)
    return measure_stick_slip(time[part], position[part], velocity[part])


def sticks(found: StickSlip) -> bool:
    """Return whether a motion shows stick-slip."""
    ratio = found.peak_speed_m_s / found.mean_speed_m_s
    return found.periods >= LEAST_PERIODS and ratio >= LEAST_PEAK_RATIO and found.stuck_share >= LEAST_STUCK_SHARE


def _quantities(found: StickSlip) -> Row:
    names = ("periods", "period_s", "step_m", "mean_speed_m_s", "peak_speed_m_s", "stuck_share")
    ratio = found.peak_speed_m_s / found.mean_speed_m_s
    return {name: getattr(found, name) for name in names} | {"peak_ratio": ratio}


# --- Figure 9 of the source paper: effect of a stop of 15 s in the middle of a stroke on friction.

#: Peak, as a fraction of running friction, that counts as a change of the characteristics, and as a high dependence.
CHANGE, HIGH = 0.05, 0.2
#: Travel after which a change counts as lasting, m (our interpretation: a tenth of a stroke of 200 mm).
LASTING_M = 20e-3


def figure_9(run: Campaign) -> PaperFigure:
    """Return friction around stops of 15 s and in strokes without a stop.

    Parameters
    ----------
    run : Campaign
        Campaign with stops of 15 s, and with strokes without a stop, whose friction is that of uninterrupted sliding.

    Returns
    -------
    PaperFigure
        Columns over the speeds of the restart (m,): mean increment of the peak over uninterrupted sliding, with the
        half-width of its 95 % interval. Further columns: friction over time during one stop.

    Raises
    ------
    CampaignError
        If a stop cannot be read.
    """
    found = pn.campaign_friction(run)
    if found.skipped:
        raise CampaignError("a stop could not be evaluated", where=str(run.path), value=str(found.skipped[0]))
    stops = found.stops
    speeds = np.array(sorted(set(stops["speed_m_s"])))
    rested = [stops.filter(speed_m_s=v) for v in speeds]
    # no peak: zero increment
    means = [mean_estimate(np.nan_to_num(group["increment_n"].to_numpy(), posinf=0.0, neginf=0.0)) for group in rested]
    increment = np.array([mean.value for mean in means])
    width = np.array([mean.high for mean in means]) - increment
    running = np.array([np.mean(group["running_n"].to_numpy()) for group in rested])
    relaxed = stops["relaxation_n"].drop_nans().to_numpy()
    back = np.median(stops["recovery_m"].drop_nans())
    shown = rested[len(speeds) // 2].row(0, named=True)
    trace = {name: np.array(shown[f"trace_{name}"]) for name in ("time_s", "position_m", "friction_n")}
    changed = bool(np.all(increment - width > CHANGE * running))
    return PaperFigure.make(
        9,
        {
            "changed": judge(changed and back > LASTING_M, part=changed),
            "relaxed": judge(relaxed.size > 0 and np.median(relaxed) > 0.0, part=False),
            "ages": judge(False, part=np.all(increment - width > HIGH * running)),
        },
        {
            "least_increment_n": increment.min(),
            "largest_increment_n": increment.max(),
            "largest_share": (increment / running).max(),
            "relaxed_n": np.median(relaxed),
            "recovery_m": back,
        },
        {
            "speed_m_s": speeds,
            "increment_n": increment,
            "increment_width_n": width,
            **trace,
            "running_n": np.full(trace["time_s"].shape, shown["running_n"]),
        },
        least_share=(increment / running).min(),
    )


# --- Figures 4 and 7 of the source paper: its two rigs, and a check that ours ran the campaigns in the same way.

#: "About 5 000 measurements of force" in a cycle, and tolerance. Bursts around the turns are additional.
SAMPLES, SAMPLES_TOLERANCE = 5000, 0.05
SPEEDS_M_S = (1e-3, 0.45)
SPEEDS_UNDER_PRESSURE_M_S = (1e-3, 0.5)
GAUGES_PA = (0.1e5, 1.5e5)
#: Relative tolerance, and tolerance of a pressure sensor's zero as a fraction of its highest value.
REACHED = 0.01


def figure_4(run: Campaign) -> PaperFigure:
    """Return the rig of the first campaign: a servo drags the drive through a force sensor from 1 to 450 mm/s."""
    speeds, _, samples = _ran(run)
    near = np.all(np.abs(samples / SAMPLES - 1.0) <= SAMPLES_TOLERANCE)
    rising = _spans(speeds, SPEEDS_M_S) and np.all(np.diff(speeds) > 0.0)
    return PaperFigure.make(
        4,
        {"speeds": judge(rising, part=False), "samples": judge(near, part=False)},
        {"slowest_m_s": speeds.min(), "fastest_m_s": speeds.max(), "samples": samples.min()},
        {"speed_m_s": speeds, "samples": samples},
        _rig_of(run),
        cycles=speeds.size,
        first_m_s=speeds[0],
        last_m_s=speeds[-1],
        most_samples=samples.max(),
    )


def figure_7(run: Campaign) -> PaperFigure:
    """Return the rig of the second campaign: the same rig under 0.1 to 1.5 bar in both chambers, 1 to 500 mm/s."""
    speeds, gauges, samples = _ran(run)
    spans = _spans(speeds, SPEEDS_UNDER_PRESSURE_M_S) and _spans(gauges, GAUGES_PA, REACHED * GAUGES_PA[1])
    return PaperFigure.make(
        7,
        {"ranges": judge(spans, part=False)},
        {"lowest_gauge_pa": gauges.min(), "highest_gauge_pa": gauges.max()},
        {"speed_m_s": speeds, "gauge_pa": gauges, "samples": samples},
        _rig_of(run),
        cycles=speeds.size,
        slowest_m_s=speeds.min(),
        fastest_m_s=speeds.max(),
    )


def _rig_of(run: Campaign) -> tuple[Identity, Envelope]:
    """Return the rig of a campaign."""
    return run.identity, envelope_of(run.about["envelope"], str(run.path))


def _ran(run: Campaign) -> tuple[Array, Array, Array]:
    """Return the measured speed, the pressure, and the number of evenly spaced samples of each cycle."""
    rows = []
    ambient = run.identity.ambient_pressure_pa
    for file in run.cycles():
        samples = file.samples()
        inner = slice(len(samples) // 5, 2 * len(samples) // 5)  # within the outward stroke, between its ramps
        speed = abs(np.polyfit(samples.time_s[inner], samples.position_m[inner], 1)[0])
        gauge = 0.5 * np.mean(samples.pressure_a_pa + samples.pressure_b_pa) - ambient
        even = np.median(np.diff(samples.time_s))  # most samples lie outside the bursts
        rows.append((speed, gauge, np.rint((samples.time_s[-1] - samples.time_s[0]) / even)))
    speeds, gauges, sizes = np.array(rows, dtype=float).T
    return speeds, gauges, sizes


def _spans(values: Array, ends: Interval, zero_error: float = 0.0) -> bool:
    """Return whether the values reach both ends of a range, within the error of the sensors."""
    low, high = values.min(), values.max()
    return low <= ends[0] * (1.0 + REACHED) + zero_error and high >= ends[1] * (1.0 - REACHED) - zero_error
