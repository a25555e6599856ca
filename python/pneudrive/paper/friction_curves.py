"""Figures 5, 6 and 8 of the source paper: friction over time, speed and pressure, from campaigns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise import SourcePaper, characterise_recordings
from pneudrive.characterise.settling import moving_average
from pneudrive.characteristics import BOTH, characteristics
from pneudrive.characteristics.raw import recording_of
from pneudrive.paper.figure import Claim, PaperFigure, judge

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording
    from pneudrive.characteristics import CampaignCharacteristics
    from pneudrive.characteristics.effects import AirShare
    from pneudrive.paper.experiments import Experiment

    Array = NDArray[np.float64]

#: Travel after the turn in which the peak has to lie, as a share of the stroke.
PEAK_WITHIN = 0.02
#: How much larger than any other peak of the stroke it has to be.
CLEAR = 2.0
#: Share of the stroke at either end that is not its steady part.
ENDS = 0.1
#: Samples of the paper's moving average.
AVERAGE = SourcePaper().average_samples
#: What counts as low speed, and as its opposite, in the checks.
LOW_M_S = 2e-3
#: Share of neighbouring lines in the order of pressure from which the sentence holds in part.
ORDERED_IN_PART = 0.8
HIGH_M_S = 20e-3


def figure_5(run: Experiment) -> PaperFigure:
    """Friction over time through one cycle at 2 mm/s: largest right after the turn.

    Parameters
    ----------
    run : Experiment
        One cycle, out and back.

    Returns
    -------
    PaperFigure
        Columns of the stroke after the turn: time since the turn, position, friction as read and with the moving
        average of five samples, mean friction of the rest of the stroke.
    """
    file = next(run.campaign.cycles())
    recording = recording_of(file, run.campaign.identity, file.samples())[0]
    result = characterise_recordings([recording]).results[0]
    stroke = next(s for s in result.strokes if s.index > 0)
    part = _after_turn(result.recording, stroke)
    time = result.recording.time_s[part] - result.recording.time_s[part.start]
    raw = stroke.direction * (result.balance_n[part] - result.levels[0].offset_n)
    smooth = moving_average(raw, AVERAGE)
    share = np.abs(result.recording.position_m[part] - stroke.from_m) / abs(stroke.to_m - stroke.from_m)
    rest = raw[(share > ENDS) & (share < 1.0 - ENDS)]
    top = int(np.argmax(smooth))
    excess = float(smooth[top] - rest.mean())
    # elsewhere noise and unevenness along the barrel make peaks too
    elsewhere = float(smooth[share > PEAK_WITHIN].max() - rest.mean())
    travel = float(share[top]) * abs(stroke.to_m - stroke.from_m)
    return PaperFigure(
        number=5,
        title="Friction through a cycle at 2 mm/s",
        claims=(
            Claim(
                "figure 5",
                "the friction value is the largest right after the change of movement direction of the piston",
                judge(excess > CLEAR * elsewhere and share[top] < PEAK_WITHIN, part=share[top] < PEAK_WITHIN),
                f"the largest value lies {1e3 * travel:.2g} mm after the turn, {excess:.2f} N above the mean of the "
                f"stroke; further on no peak is higher than {elsewhere:.2f} N above it",
            ),
        ),
        measured=f"the peak is {smooth[top]:.2f} N, {excess:.2f} N ({100.0 * excess / rest.mean():.0f} %) above the "
        f"mean of the rest of the stroke, {1e3 * travel:.2g} mm after the turn; further on noise and position "
        f"make peaks of {elsewhere:.2f} N at most",
        quantities={
            "peak_n": float(smooth[top]),
            "mean_n": float(rest.mean()),
            "excess_n": excess,
            "elsewhere_n": elsewhere,
            "travel_at_peak_m": travel,
        },
        columns={
            "time_s": time,
            "position_m": result.recording.position_m[part],
            "friction_n": raw,
            "friction_smoothed_n": smooth,
            "friction_mean_n": np.full(time.shape, rest.mean()),
        },
        assumed="law, values and how the contact ages; 5 kHz around the turn, where the paper has some 17 samples a "
        "second: with those alone the peak would lie between two of them",
    )


def figure_6(run: Experiment) -> PaperFigure:
    """Mean friction over speed by the paper's protocol: biggest at the lowest speeds.

    Parameters
    ----------
    run : Experiment
        Speeds without pressure.

    Returns
    -------
    PaperFigure
        Columns over speed: the sensor's force by the paper's protocol, the seal's friction with its 95 % band from
        samples chosen by settling, the truth of each cycle, the force of the air.
    """
    (paper,) = _shares(characteristics(run.campaign, SourcePaper()))
    settled = characteristics(run.campaign)
    (share,) = _shares(settled)
    curve = next(c for c in settled.curves if c.direction == BOTH)
    low_n, high_n = (values[curve.measured] for values in (curve.low_n, curve.high_n))
    speed, seal, air = share["speed_m_s"], share["seal_n"], share["air_n"]
    by_paper, truth = paper["total_n"], _truths(run)
    low, high = speed <= LOW_M_S, speed >= HIGH_M_S
    lead = float(by_paper[low].min() - by_paper[high].max())
    biggest = float(speed[int(np.argmax(by_paper))])
    error = by_paper - (truth + air)
    worst = int(np.argmax(np.abs(error)))
    (whole,) = _shares(characteristics(run.campaign, SourcePaper(dropped_share=0.0)))
    undropped = float(np.max(np.abs(whole["total_n"] - (truth + air))))
    lowest = int(np.argmin(by_paper))
    scatter = float(np.max(high_n - low_n))
    fall, rise = float(by_paper[0] - by_paper[lowest]), float(by_paper[-1] - by_paper[lowest])
    return PaperFigure(
        number=6,
        title="Mean friction over speed, the paper's protocol",
        claims=(
            Claim(
                "figure 6",
                "for small values of speed the resistance of the drive is the biggest",
                judge(biggest <= LOW_M_S and lead > scatter, part=biggest <= LOW_M_S),
                f"biggest at {1e3 * biggest:.2g} mm/s; up to {1e3 * LOW_M_S:g} mm/s it lies at least {lead:.2f} N "
                f"above every value from {1e3 * HIGH_M_S:g} mm/s on",
            ),
            Claim(
                "figure 6",
                "it is difficult to see on the figure a point of Stribeck speed directly",
                judge(min(fall, rise) < CLEAR * scatter, part=rise < CLEAR * scatter),
                f"on ours it is plain: friction falls by {fall:.2f} N to its least value at "
                f"{1e3 * speed[lowest]:.0f} mm/s and rises by {rise:.2f} N from there, where the widest 95 % band is "
                f"{scatter:.2f} N",
            ),
            Claim(
                "section 2.1 (measurements)",
                "In order to reduce the impact of movement changes on the measurements, 5% of the initial values are "
                "ignored",
                judge(abs(error[worst]) < 0.5 * undropped, part=abs(error[worst]) < undropped),
                f"the largest error of a mean falls from {undropped:.2f} to {abs(error[worst]):.2f} N",
            ),
        ),
        measured=f"biggest at {1e3 * biggest:.2g} mm/s: {by_paper.max():.2f} N; up to {1e3 * LOW_M_S:g} mm/s it is at "
        f"least {lead:.2f} N above every value from {1e3 * HIGH_M_S:g} mm/s on; of {by_paper[-1]:.1f} N at "
        f"{1e3 * speed[-1]:.0f} mm/s {air[-1]:.2f} N are air pushed through the ports; dropping 5 % of each "
        f"stroke leaves an error of up to {error[worst]:+.2f} N (at {1e3 * speed[worst]:.0f} mm/s)",
        quantities={
            "biggest_at_m_s": biggest,
            "biggest_n": float(by_paper.max()),
            "lead_n": lead,
            "air_at_top_n": float(air[-1]),
            "protocol_error_n": float(error[worst]),
            "protocol_error_at_m_s": float(speed[worst]),
            "settled_error_n": float(np.max(np.abs(seal - truth))),
        },
        columns={
            "speed_m_s": speed,
            "friction_n": by_paper,
            "friction_settled_n": seal,
            "low_n": low_n,
            "high_n": high_n,
            "friction_true_n": truth,
            "air_n": air,
        },
        assumed="spacing of the speeds (logarithmic); wide ports, so that little of the force at high speed is air",
    )


def figure_8(run: Experiment) -> PaperFigure:
    """Unfiltered friction over speed at 0.1 to 1.5 bar gauge in both chambers: ordered, more like Stribeck's curve.

    Parameters
    ----------
    run : Experiment
        The same speeds at each pressure.

    Returns
    -------
    PaperFigure
        Columns: speeds (m,), gauge pressures (k,); the sensor's force, of it air and seal, the seal's truth (k, m);
        depth of the dip of the sensor's force (k,).
    """
    found = characteristics(run.campaign, SourcePaper(average_samples=1))
    shares = _shares(found)
    gauge = np.array([share.condition.pressure_a_pa for share in _by_pressure(found)])
    gauge -= run.campaign.identity.ambient_pressure_pa
    speed, mean_speed = _driven(run)[: shares[0]["speed_m_s"].size], shares[0]["speed_m_s"]
    total, air, seal = (np.array([share[name] for share in shares]) for name in ("total_n", "air_n", "seal_n"))
    truth = _truths(run).reshape(total.shape)
    rises = np.diff(total, axis=0)
    lowest = total[:, 0]
    slope = float(np.polyfit(gauge, lowest, 1)[0])
    dip = lowest / total.min(axis=1) - 1.0
    inner = np.argmin(total, axis=1)
    has_minimum = (inner > 0) & (inner < speed.size - 1)
    more = bool(np.all(has_minimum >= has_minimum[0]) and np.all(np.diff(dip) > 0.0))
    ordered = float(np.mean(rises > 0.0))
    return PaperFigure(
        number=8,
        title="Friction over speed at 0.1 to 1.5 bar gauge in both chambers, unfiltered",
        claims=(
            Claim(
                "figure 8, caption",
                "Lower line is lower pressure",
                judge(ordered == 1.0, part=ordered > ORDERED_IN_PART),
                f"{100.0 * ordered:.0f} % of neighbouring lines are in the order of pressure",
            ),
            Claim(
                "figure 8",
                "as the pressure increases the characteristics of the friction force are more like Stribeck curve",
                judge(more and not has_minimum[0], part=more),
                f"from the lowest speed to the least value friction falls by {100.0 * dip[0]:.0f} % at "
                f"{1e-5 * gauge[0]:.1f} bar and by {100.0 * dip[-1]:.0f} % at {1e-5 * gauge[-1]:.1f} bar"
                + ("; but ours is a full Stribeck curve at the lowest pressure already" if has_minimum[0] else ""),
            ),
            Claim(
                "figure 8",
                "As a result of drive seal deformation, for low velocities, the friction value increases with "
                "increasing pressure",
                judge(False, part=slope > 0.0 and np.all(rises[:, 0] > 0.0)),
                f"at {1e3 * speed[0]:g} mm/s friction rises by {1e5 * slope:.2f} N/bar; that the seal's deformation is "
                "the cause cannot be told, since the simulated law takes the rise as given",
            ),
        ),
        measured=f"{100.0 * ordered:.0f} % of neighbouring lines are in the order of pressure; at "
        f"{1e3 * speed[0]:g} mm/s friction rises by {1e5 * slope:.2f} N/bar; from the lowest speed to the minimum it "
        f"falls by {100.0 * dip[0]:.0f} % at {1e-5 * gauge[0]:.1f} bar and by {100.0 * dip[-1]:.0f} % at "
        f"{1e-5 * gauge[-1]:.1f} bar; at {1e3 * speed[-1]:.0f} mm/s {air[0, -1]:.1f} of {total[0, -1]:.1f} N and "
        f"{air[-1, -1]:.1f} of {total[-1, -1]:.1f} N are air pushed through hoses and regulator, not friction. "
        "Speeds are those that the axis was told; the mean over the samples of the paper's protocol, ramps included, "
        f"is {1e3 * mean_speed[-1]:.0f} mm/s at the fastest",
        quantities={
            "ordered_share": ordered,
            "smallest_rise_n": float(rises.min()),
            "low_speed_slope_n_pa": slope,
            "dip_at_lowest_pressure": float(dip[0]),
            "dip_at_highest_pressure": float(dip[-1]),
            "air_at_lowest_pressure_n": float(air[0, -1]),
            "air_at_highest_pressure_n": float(air[-1, -1]),
            "seal_error_n": float(np.max(np.abs(seal - truth))),
        },
        columns={
            "speed_m_s": speed,
            "mean_speed_m_s": mean_speed,
            "gauge_pa": gauge,
            "friction_n": total,
            "air_n": air,
            "seal_n": seal,
            "friction_true_n": truth,
            "dip": dip,
        },
        assumed="one regulator for both chambers through a manifold and 4 mm hoses; eight pressures",
    )


def _after_turn(recording: Recording, stroke: Stroke) -> slice:
    """Take the samples from the moment at which the carriage turns: the rest before the stroke belongs to it."""
    begin = int(np.searchsorted(recording.time_s, recording.time_s[stroke.start] - stroke.dwell_s))
    return slice(min(begin, stroke.start), stroke.stop)


def _by_pressure(found: CampaignCharacteristics) -> list[AirShare]:
    return sorted(found.air, key=lambda share: share.condition.pressure_a_pa)


def _shares(found: CampaignCharacteristics) -> list[dict[str, Array]]:
    """Force of sensor, air and seal at the speeds that were measured, by rising pressure."""
    measured = {c.condition: c.measured for c in found.curves if c.direction == BOTH}
    names = ("speed_m_s", "total_n", "air_n", "seal_n")
    return [{name: getattr(s, name)[measured[s.condition]] for name in names} for s in _by_pressure(found)]


def _driven(run: Experiment) -> Array:
    """Give the speed that the axis was told in each cycle, m/s."""
    return np.array([max(step["speed_m_s"] for step in truth["steps"] if "speed_m_s" in step) for truth in run.truth()])


def _truths(run: Experiment) -> Array:
    """Mean over both directions of the friction that there truly was, of each cycle."""
    name = "friction_mean_n"
    each = [[step[name] for step in truth["steps"] if name in step] for truth in run.truth()]
    return np.asarray(each, dtype=np.float64).mean(axis=1)
