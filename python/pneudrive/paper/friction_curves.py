"""Figures 5, 6 and 8 of the source paper: friction on the simulated rig over time, speed and pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise import SourcePaper, characterise, characterise_recordings
from pneudrive.characterise.budget import COVERAGE_FACTOR
from pneudrive.characterise.settling import moving_average
from pneudrive.paper.figure import PaperFigure
from pneudrive.rig.motion import Limits
from pneudrive.rig.simulated import SimulatedRig, sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording

    Array = NDArray[np.float64]

#: Speeds of the paper's campaigns; how they were spaced it does not say (assumed: logarithmic).
SPEEDS_M_S = np.geomspace(1e-3, 0.45, 60)
SPEEDS_UNDER_PRESSURE_M_S = np.geomspace(1e-3, 0.5, 40)
GAUGES_PA = 1e5 * np.linspace(0.1, 1.5, 15)
#: Figure 5: speed of the cycle, and servo ramps that take 0.5 mm (assumed), so that the peak after the turn lasts
#: for some samples; the limits of fast motion would pass the slow part of the curve between two samples.
CYCLE_SPEED_M_S = 2e-3
RAMP_M = 0.5e-3
RAMP_JERK_M_S3 = 0.05
#: Travel after the turn in which the peak has to lie, as a share of the stroke.
PEAK_WITHIN = 0.02
#: Samples of the paper's moving average.
AVERAGE = SourcePaper().average_samples
#: What counts as low speed, and as its opposite, in the checks.
LOW_M_S = 2e-3
HIGH_M_S = 20e-3


def figure_5(rig: SimulatedRig | None = None, seed: int = 0) -> PaperFigure:
    """Friction over time through one cycle at 2 mm/s: largest right after the turn.

    Parameters
    ----------
    rig : SimulatedRig, optional
        The default rig where nothing is said.
    seed : int
        Of the noise.

    Returns
    -------
    PaperFigure
        Columns of the stroke after the turn: time since the turn, position, friction as read and with the moving
        average of five samples, mean friction of the rest of the stroke.
    """
    rig = rig or SimulatedRig.default()
    limits = Limits(0.5 * CYCLE_SPEED_M_S**2 / RAMP_M, RAMP_JERK_M_S3)
    recording = rig.record(rig.drag(CYCLE_SPEED_M_S, limits=limits), (seed, 5), name="2 mm/s cycle")
    result = characterise_recordings([recording]).results[0]
    level = result.levels[0]
    stroke = next(s for s in result.strokes if s.index > 0)
    part = _after_turn(result.recording, stroke)
    time = result.recording.time_s[part] - result.recording.time_s[part.start]
    raw = stroke.direction * (result.balance_n[part] - level.offset_n)
    smooth = moving_average(raw, AVERAGE)
    travelled = np.abs(result.recording.position_m[part] - stroke.from_m)
    top = int(np.argmax(smooth))
    rest = raw[travelled > 0.1 * abs(stroke.to_m - stroke.from_m)]
    noise = float(np.std(rest) / np.sqrt(AVERAGE))
    excess = float(smooth[top] - rest.mean())
    share = float(travelled[top] / abs(stroke.to_m - stroke.from_m))
    # the largest of n smoothed samples lies sqrt(2 ln n) deviations high by chance
    chance = noise * float(np.sqrt(2.0 * np.log(raw.size)))
    return PaperFigure(
        number=5,
        title="Friction through a cycle at 2 mm/s",
        sentence="Friction is largest right after the direction of motion changes.",
        holds=excess > chance and share < PEAK_WITHIN,
        measured=f"the peak is {smooth[top]:.2f} N, {excess:.2f} N ({100.0 * excess / rest.mean():.0f} %) above the "
        f"mean of the rest of the stroke, {1e3 * travelled[top]:.1f} mm after the turn "
        f"(noise alone would give {chance:.2f} N)",
        quantities={
            "peak_n": float(smooth[top]),
            "mean_n": float(rest.mean()),
            "excess_n": excess,
            "chance_n": chance,
            "travel_at_peak_m": float(travelled[top]),
            "true_breakaway_n": rig.description.parameters["breakaway"],
        },
        columns={
            "time_s": time,
            "position_m": result.recording.position_m[part],
            "friction_n": raw,
            "friction_smoothed_n": smooth,
            "friction_mean_n": np.full(time.shape, rest.mean()),
        },
    )


def figure_6(rig: SimulatedRig | None = None, seed: int = 0) -> PaperFigure:
    """Mean friction over speed by the paper's protocol: biggest at the lowest speeds.

    Parameters
    ----------
    rig : SimulatedRig, optional
    seed : int

    Returns
    -------
    PaperFigure
        Columns over speed: the paper's protocol, samples chosen by settling, expanded uncertainty, truth.
    """
    rig = rig or SimulatedRig.default()
    recordings = sweep(rig, SPEEDS_M_S, seed=seed)
    paper, _ = _means(recordings, SourcePaper())
    settled, expanded = _means(recordings, None)
    truth = np.array([r.truth["friction_n"] for r in recordings if r.truth])
    low, high = SPEEDS_M_S <= LOW_M_S, SPEEDS_M_S >= HIGH_M_S
    lead = float(paper[low].min() - paper[high].max())
    biggest = float(SPEEDS_M_S[int(np.argmax(paper))])
    bias = paper - truth
    worst = int(np.argmax(np.abs(bias)))
    return PaperFigure(
        number=6,
        title="Mean friction over speed, the paper's protocol",
        sentence="At small speeds the resistance of the drive is biggest.",
        holds=biggest <= LOW_M_S and lead > 2.0 * float(np.max(expanded)),
        measured=f"biggest at {1e3 * biggest:.2g} mm/s: {paper.max():.2f} N; up to {1e3 * LOW_M_S:g} mm/s it is at "
        f"least {lead:.2f} N above every value from {1e3 * HIGH_M_S:g} mm/s on; dropping 5 % of each stroke leaves an "
        f"error of up to {bias[worst]:+.2f} N (at {1e3 * SPEEDS_M_S[worst]:.0f} mm/s)",
        quantities={
            "biggest_at_m_s": biggest,
            "biggest_n": float(paper.max()),
            "lead_n": lead,
            "protocol_error_n": float(bias[worst]),
            "protocol_error_at_m_s": float(SPEEDS_M_S[worst]),
            "settled_error_n": float(np.max(np.abs(settled - truth))),
        },
        columns={
            "speed_m_s": SPEEDS_M_S,
            "friction_n": paper,
            "friction_settled_n": settled,
            "expanded_uncertainty_n": expanded,
            "friction_true_n": truth,
        },
    )


def figure_8(rig: SimulatedRig | None = None, seed: int = 0) -> PaperFigure:
    """Unfiltered friction over speed at 0.1 to 1.5 bar gauge in both chambers: ordered, more like Stribeck's curve.

    Parameters
    ----------
    rig : SimulatedRig, optional
    seed : int

    Returns
    -------
    PaperFigure
        Columns: speeds (40,), gauge pressures (15,), friction and truth (15, 40), depth of the dip (15,).
    """
    rig = rig or SimulatedRig.default()
    recordings = sweep(rig, SPEEDS_UNDER_PRESSURE_M_S, GAUGES_PA, seed=seed)
    shape = (GAUGES_PA.size, SPEEDS_UNDER_PRESSURE_M_S.size)
    friction = _means(recordings, SourcePaper(average_samples=1))[0].reshape(shape)
    truth = np.array([r.truth["friction_n"] for r in recordings if r.truth]).reshape(shape)
    rises = np.diff(friction, axis=0)
    ordered = float(np.mean(rises > 0.0))
    lowest = friction[:, 0]
    slope = float(np.polyfit(GAUGES_PA, lowest, 1)[0])
    dip = lowest / friction.min(axis=1) - 1.0
    inner = np.argmin(friction, axis=1)
    has_minimum = bool(np.all((inner > 0) & (inner < shape[1] - 1)))
    return PaperFigure(
        number=8,
        title="Friction over speed at 0.1 to 1.5 bar gauge in both chambers, unfiltered",
        sentence="A lower line is a lower pressure; at low speed friction rises with pressure, and the curves look "
        "more like a Stribeck curve as it rises.",
        holds=ordered == 1.0 and slope > 0.0 and has_minimum and bool(np.all(np.diff(dip) > 0.0)),
        measured=f"{100.0 * ordered:.0f} % of neighbouring lines are in the order of pressure; at "
        f"{1e3 * SPEEDS_UNDER_PRESSURE_M_S[0]:g} mm/s friction rises by {1e5 * slope:.2f} N/bar; from the lowest speed "
        f"to the minimum it falls by {100.0 * dip[0]:.0f} % at 0.1 bar and by {100.0 * dip[-1]:.0f} % at 1.5 bar",
        quantities={
            "ordered_share": ordered,
            "smallest_rise_n": float(rises.min()),
            "low_speed_slope_n_pa": slope,
            "dip_at_lowest_pressure": float(dip[0]),
            "dip_at_highest_pressure": float(dip[-1]),
        },
        columns={
            "speed_m_s": SPEEDS_UNDER_PRESSURE_M_S,
            "gauge_pa": GAUGES_PA,
            "friction_n": friction,
            "friction_true_n": truth,
            "dip": dip,
        },
    )


def _after_turn(recording: Recording, stroke: Stroke) -> slice:
    """Take the samples from the moment at which the carriage turns: the rest before the stroke belongs to it."""
    begin = int(np.searchsorted(recording.time_s, recording.time_s[stroke.start] - stroke.dwell_s))
    return slice(min(begin, stroke.start), stroke.stop)


def _means(recordings: list[Recording], protocol: SourcePaper | None) -> tuple[Array, Array]:
    """Friction and expanded uncertainty of each recording, in their order."""
    curves = characterise(recordings, protocol=protocol)
    up = curves.isel(row=np.flatnonzero(curves["direction"].to_numpy() > 0))
    of = {str(name): i for i, name in enumerate(up["recording"].to_numpy())}
    order = [of[recording.name] for recording in recordings]
    expanded = COVERAGE_FACTOR * np.hypot(up["stderr_n"].to_numpy(), up["u_systematic_n"].to_numpy())
    return up["friction_n"].to_numpy()[order], expanded[order]
