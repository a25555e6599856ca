"""The source paper's experiments on simulated rigs, figures of their data, and verdicts on the paper's sentences."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import pneudrive as pn
from pneudrive.arrays import Array, Columns, Interval, Keyed, Plain, rows_of
from pneudrive.campaign.storage.control import write_whole
from pneudrive.campaign.storage.folder import Campaign, recording_of
from pneudrive.characterise import SourcePaper, characterise_recordings
from pneudrive.characteristics import CampaignCharacteristics, campaign_friction
from pneudrive.errors import CampaignError, package_table
from pneudrive.estimate.estimates import mean_estimate
from pneudrive.files.content import read_json
from pneudrive.friction.campaign.result import AirShare
from pneudrive.friction.friction_map import BOTH
from pneudrive.friction.stick_slip import STUCK_SHARE, StickSlip, measure_stick_slip, slip_onsets
from pneudrive.friction.strokes import moving_average
from pneudrive.rig import AnalogSensor, Encoder, Envelope, Identity
from pneudrive.rig.interface import Move, Step, envelope_of
from pneudrive.rig.machine import Machine, Past
from pneudrive.rig.motion import Motion
from pneudrive.signals.motion import local_slope
from pneudrive.simulation import trajectory

#: Experiment -> (ready protocol, argument of `load_rig`). The paper does not describe its rigs: the first is assumed to
#: be without pressure, the second with equal pressure in both chambers.
EXPERIMENTS = {
    "cycle": ("paper-cycle", "open-chambers"),
    "speed": ("paper-speed", "open-chambers"),
    "pressure": ("paper-pressure", "common-manifold"),
    "stops": ("paper-stops", "open-chambers"),
}
#: File in the folder of a campaign: key of a cycle -> speed and true friction of its strokes.
TRUE_STROKES = "true-strokes.json"
#: Seed of the simulated sensors.
SEED = 0
#: Relative deviation up to which the commanded speed counts as reached.
AT_SPEED = 1e-3


def true_strokes(run: Campaign) -> list[list[tuple[float, float | None]]]:
    """Return speed and true friction of the strokes of each cycle, in the order of the run, see `run_experiment`."""
    return list(read_json(run.path / TRUE_STROKES, CampaignError).values())


def run_experiment(protocol: str, rig: str, into: str, seed: int) -> Campaign:
    """Run one campaign. Store the speed of every stroke, and its mean true friction at constant speed (N)."""
    from pneudrive.campaign.run import Options, run_campaign
    from pneudrive.rig import load_rig

    bench, path = load_rig(rig, seed=seed), Path(into) / TRUE_STROKES
    strokes: dict[str, list] = read_json(path, CampaignError) if path.exists() else {}

    def observe(machine: Machine, before: Past, step: Step, motion: Motion, true: Columns) -> None:
        if isinstance(step, Move):
            stroke = (step.speed_m_s, _friction_n(step, motion, true))
            strokes.setdefault(before.key, []).append(stroke)

    def store(document: str, content: Plain) -> None:
        if document == "event":  # a cycle is finished
            write_whole(path, json.dumps(strokes).encode(), flush=False)

    bench.observe = observe  # type: ignore[attr-defined] - of a simulated rig
    return run_campaign(protocol, bench, into, options=Options(yes=True), subscribers=(store,)).campaign


def _friction_n(step: Move, motion: Motion, true: Columns) -> float | None:
    """Return the mean true friction of a stroke while its commanded speed is constant; None for a short stroke."""
    direction = 1.0 if step.to_m > motion.start_m else -1.0
    commanded = motion.at(true["time_s"])[1] * direction
    steady = np.abs(commanded - step.speed_m_s) < AT_SPEED * step.speed_m_s
    if np.count_nonzero(steady) < 2:
        return None
    time, friction = true["time_s"][steady], true["friction_force_n"][steady]
    return direction * float(np.trapezoid(friction, time) / (time[-1] - time[0]))


#: The paper's sentences and our results, with placeholders for numbers.
TEXTS = Path(__file__).with_name("figures.toml")
#: Suffix of a quantity's name in SI -> suffix of its name in texts with the usual unit, and number of usual units per
#: SI unit. The first match applies.
READABLE = {
    "_n_pa": ("_n_bar", 1e5),
    "_m_s": ("_mm_s", 1e3),
    "_pa": ("_bar", 1e-5),
    "_m": ("_mm", 1e3),
    "_share": ("_percent", 100.0),
}


@dataclass(frozen=True)
class Claim:
    """A sentence of the source paper that is checked by simulated data.

    Attributes
    ----------
    place : str
        Location of the sentence in the paper [bracha], such as ``figure 8``, ``conclusions`` or ``equations 2 and 3``.
    said : str
        Words of the paper or of a caption. ``...`` marks omissions.
    verdict : {"holds", "holds in part", "does not hold"}
        Verdict from the simulated data. For "holds in part", `found` states which statement does not hold.
    found : str
        Simulated result, with the decisive numbers.
    """

    place: str
    said: str
    verdict: str
    found: str


def judge(whole: object, *, part: object) -> str:
    """Return the verdict on a sentence of the paper: it holds (`whole`), holds in part (`part`), or does not hold."""
    return "holds" if whole else "holds in part" if part else "does not hold"


def claims_of(topic: str, verdicts: Mapping[str, str], numbers: Keyed) -> tuple[Claim, ...]:
    """Return the sentences of a topic with verdicts and numbers."""
    said, shown = package_table(__file__, TEXTS.name)[topic]["claims"], readable(numbers)
    return tuple(
        Claim(one["place"], one["said"], verdicts[name], one["found"].format(**shown)) for name, one in said.items()
    )


def readable(numbers: Keyed) -> Plain:
    """Return the quantities, each in SI and in its usual unit.

    Examples
    --------
    >>> readable({"step_m": 0.002, "stuck_share": 0.5})
    {'step_m': 0.002, 'step_mm': 2.0, 'stuck_share': 0.5, 'stuck_percent': 50.0}
    """
    out = {}
    for name, value in numbers.items():
        out[name] = value
        end = next((end for end in READABLE if name.endswith(end)), None)
        if end is not None:
            other, factor = READABLE[end]
            out[name.removesuffix(end) + other] = factor * value
    return out


@dataclass(frozen=True)
class PaperFigure:
    """Data of one figure, and verdicts on the paper's sentences about it.

    Attributes
    ----------
    number : int
        Number of the figure in the source paper [bracha].
    verdicts : mapping of str
        Name of a sentence of the paper -> verdict.
    quantities : dict
        Numbers of the result, in SI.
    columns : dict
        Name with unit -> array; the arrays of a figure have matching shapes (curves over pressure are 2-D).
    rig : (Identity, Envelope) or None
        Rig that the figure shows; None if it shows data.
    """

    number: int
    verdicts: Mapping[str, str]
    quantities: Keyed
    columns: Columns = field(repr=False)
    rig: tuple[Identity, Envelope] | None = field(default=None, repr=False)

    @property
    def texts(self) -> Plain:
        """Texts of the figure: title, and assumptions of the simulated rig beyond the paper."""
        return package_table(__file__, TEXTS.name)[str(self.number)]

    @property
    def claims(self) -> tuple[Claim, ...]:
        """All checkable sentences of the paper about this figure."""
        return claims_of(str(self.number), self.verdicts, self.quantities)

    @property
    def measured(self) -> str:
        """Result in words."""
        return self.texts["measured"].format(**readable(self.quantities))


# --- Figures 5, 6 and 8: friction over time, speed and pressure, from campaigns.

#: Travel after the turn within which the peak must lie, as a fraction of the stroke.
PEAK_WITHIN = 0.02
#: Factor by which the peak must exceed every other peak of the stroke.
CLEAR = 2.0
#: Fraction of the stroke at each end that does not belong to its steady part.
ENDS = 0.1
#: Samples of the paper's moving average.
AVERAGE = SourcePaper().average_samples
#: Limit between low and high speeds in the checks, m/s.
LOW_M_S = 2e-3
#: Verdict "holds in part": required fraction of neighbouring curves that are in the order of their pressures.
ORDERED_IN_PART = 0.8
HIGH_M_S = 20e-3


def figure_5(run: Campaign) -> PaperFigure:
    """Return friction over time through one cycle at 2 mm/s. The friction is largest right after the turn.

    Parameters
    ----------
    run : Campaign
        Campaign with one cycle, out and back.

    Returns
    -------
    PaperFigure
        Columns of the stroke after the turn: time since the turn, friction as read and with the moving average of five
        samples, and mean friction of the rest of the stroke.
    """
    file = next(run.cycles())
    recording = recording_of(file, run.identity, file.samples())[0]
    result = characterise_recordings([recording]).results[0]
    stroke = next(s for s in result.strokes if s.index > 0)
    time_s = result.recording.time_s
    turn = int(np.searchsorted(time_s, time_s[stroke.start] - stroke.dwell_s))
    part = slice(min(turn, stroke.start), stroke.stop)  # with the rest before the stroke
    time = time_s[part] - time_s[part.start]
    raw = stroke.direction * (result.balance_n[part] - result.levels[0].offset_n)
    smooth = moving_average(raw, AVERAGE)
    share = np.abs(result.recording.position_m[part] - stroke.from_m) / abs(stroke.to_m - stroke.from_m)
    rest = raw[(share > ENDS) & (share < 1.0 - ENDS)]
    top = int(np.argmax(smooth))
    excess = smooth[top] - rest.mean()
    # noise and the barrel cause peaks elsewhere, too
    elsewhere = smooth[share > PEAK_WITHIN].max() - rest.mean()
    travel = share[top] * abs(stroke.to_m - stroke.from_m)
    early = share[top] < PEAK_WITHIN
    return PaperFigure(
        5,
        {"largest": judge(excess > CLEAR * elsewhere and early, part=early)},
        {
            "peak_n": smooth[top],
            "excess_n": excess,
            "elsewhere_n": elsewhere,
            "travel_at_peak_m": travel,
            "excess_share": excess / rest.mean(),
        },
        {
            "time_s": time,
            "friction_n": raw,
            "friction_smoothed_n": smooth,
            "friction_mean_n": np.full(time.shape, rest.mean()),
        },
    )


def figure_6(run: Campaign) -> PaperFigure:
    """Return mean friction over speed by the paper's protocol. The friction is largest at the lowest speeds.

    Parameters
    ----------
    run : Campaign
        Campaign with several speeds, without pressure.

    Returns
    -------
    PaperFigure
        Columns over speed: the sensor's force by the paper's protocol, the seal's friction with its 95 % band, its true
        value in each cycle, and the force of the air.
    """
    (paper,) = _shares(campaign_friction(run, SourcePaper()))
    settled = campaign_friction(run)
    (share,) = _shares(settled)
    curve = next(c for c in settled.curves if c.direction == BOTH)
    low_n, high_n = (values[curve.measured] for values in (curve.low_n, curve.high_n))
    speed, seal, air = share["speed_m_s"], share["seal_n"], share["air_n"]
    by_paper, truth = paper["total_n"], _truths(run)
    low, high = speed <= LOW_M_S, speed >= HIGH_M_S
    lead = by_paper[low].min() - by_paper[high].max()
    biggest = speed[np.argmax(by_paper)]
    error = by_paper - (truth + air)
    worst = int(np.argmax(np.abs(error)))
    (whole,) = _shares(campaign_friction(run, SourcePaper(dropped_share=0.0)))
    undropped = np.max(np.abs(whole["total_n"] - (truth + air)))
    lowest = int(np.argmin(by_paper))
    scatter = np.max(high_n - low_n)
    fall, rise = by_paper[0] - by_paper[lowest], by_paper[-1] - by_paper[lowest]
    left = abs(error[worst])
    return PaperFigure(
        6,
        {
            "biggest": judge(biggest <= LOW_M_S and lead > scatter, part=biggest <= LOW_M_S),
            "stribeck": judge(min(fall, rise) < CLEAR * scatter, part=rise < CLEAR * scatter),
            "dropped": judge(left < 0.5 * undropped, part=left < undropped),
        },
        {
            "biggest_at_m_s": biggest,
            "biggest_n": by_paper.max(),
            "lead_n": lead,
            "air_at_top_n": air[-1],
            "protocol_error_n": error[worst],
            "protocol_error_at_m_s": speed[worst],
            "settled_error_n": np.max(np.abs(seal - truth)),
            "low_m_s": LOW_M_S,
            "high_m_s": HIGH_M_S,
            "fastest_n": by_paper[-1],
            "fastest_m_s": speed[-1],
            "fall_n": fall,
            "rise_n": rise,
            "lowest_at_m_s": speed[lowest],
            "scatter_n": scatter,
            "undropped_n": undropped,
            "dropped_n": left,
        },
        {
            "speed_m_s": speed,
            "friction_n": by_paper,
            "friction_settled_n": seal,
            "low_n": low_n,
            "high_n": high_n,
            "friction_true_n": truth,
            "air_n": air,
        },
    )


def figure_8(run: Campaign) -> PaperFigure:
    """Return unfiltered friction over speed at 0.1 to 1.5 bar gauge in both chambers.

    Parameters
    ----------
    run : Campaign
        Campaign with the same speeds at each pressure.

    Returns
    -------
    PaperFigure
        Columns: speeds (m,) and gauge pressures (k,). The sensor's force, its parts from air and seal, and the seal's
        true friction have shape (k, m).
    """
    found = campaign_friction(run, SourcePaper(average_samples=1))
    shares = _shares(found)
    gauge = np.array([share.condition.pressure_a_pa for share in _by_pressure(found)])
    gauge -= run.identity.ambient_pressure_pa
    mean_speed = shares[0]["speed_m_s"]
    speed = np.array([max(v for v, _ in strokes) for strokes in true_strokes(run)])[: mean_speed.size]
    total, air, seal = (np.array([share[name] for share in shares]) for name in ("total_n", "air_n", "seal_n"))
    truth = _truths(run).reshape(total.shape)
    rises = np.diff(total, axis=0)
    lowest = total[:, 0]
    slope = np.polyfit(gauge, lowest, 1)[0]
    dip = lowest / total.min(axis=1) - 1.0
    inner = np.argmin(total, axis=1)
    has_minimum = (inner > 0) & (inner < speed.size - 1)
    more = bool(np.all(has_minimum >= has_minimum[0]) and np.all(np.diff(dip) > 0.0))
    ordered = np.mean(rises > 0.0)
    low_rises = slope > 0.0 and np.all(rises[:, 0] > 0.0)
    return PaperFigure(
        8,
        {
            "order": judge(ordered == 1.0, part=ordered > ORDERED_IN_PART),
            "stribeck": judge(more and not has_minimum[0], part=more),
            "seal": judge(False, part=low_rises),
        },
        {
            "ordered_share": ordered,
            "low_speed_slope_n_pa": slope,
            "air_at_lowest_pressure_n": air[0, -1],
            "air_at_highest_pressure_n": air[-1, -1],
            "slowest_m_s": speed[0],
            "fastest_m_s": speed[-1],
            "fastest_mean_m_s": mean_speed[-1],
            "first_pa": gauge[0],
            "last_pa": gauge[-1],
            "first_dip_share": dip[0],
            "last_dip_share": dip[-1],
            "first_total_n": total[0, -1],
            "last_total_n": total[-1, -1],
            "first_minimum_m_s": speed[inner[0]],
        },
        {
            "speed_m_s": speed,
            "gauge_pa": gauge,
            "friction_n": total,
            "air_n": air,
            "seal_n": seal,
            "friction_true_n": truth,
        },
    )


def _by_pressure(found: CampaignCharacteristics) -> list[AirShare]:
    return sorted(found.air, key=lambda share: share.condition.pressure_a_pa)


def _shares(found: CampaignCharacteristics) -> list[Columns]:
    """Return the total force, and the forces of air and seal, at the measured speeds, sorted by pressure."""
    measured = {c.condition: c.measured for c in found.curves if c.direction == BOTH}
    names = ("speed_m_s", "total_n", "air_n", "seal_n")
    return [{name: getattr(s, name)[measured[s.condition]] for name in names} for s in _by_pressure(found)]


def _truths(run: Campaign) -> Array:
    """Return the true friction (N) of each cycle, as the mean of both directions."""
    each = [[friction for _, friction in strokes if friction is not None] for strokes in true_strokes(run)]
    return np.asarray(each, dtype=float).mean(axis=1)


# --- Figures 1 to 3: a drive that sticks and slips at a mean speed of 9.34 mm/s.

SLOW_DRIVE = Path(__file__).with_name("slow_drive.toml")
#: Mean speed of the paper's figure 1, m/s, and tolerance of our mean speed.
MEAN_SPEED_M_S = 9.34e-3
SPEED_TOLERANCE_M_S = 0.5e-3
#: Criteria of stick-slip: number of periods, ratio of peak to mean speed, fraction of time below 20 % of the mean
#: speed.
LEAST_PERIODS = 5
LEAST_PEAK_RATIO = 3.0
LEAST_STUCK_SHARE = 0.3
#: Valve opening at which the drive of `slow_drive.toml` reaches that mean speed, found by bisection.
OPENING = 0.0016
#: Multiple of that opening at which the speed is no longer low.
FASTER = 10
FASTER_S = 6.0
MIDDLE_M = (0.15, 0.45)  # of the stroke of 0.5 m, so that neither start nor stop counts
#: Smallest length of steps that make positioning difficult, m (our interpretation).
COARSE_M = 1e-3
START = "position = 0.05 m, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
SKIPPED_S = 4.0
SHOWN_S = 16.0
SAMPLE_RATE = "1 kHz"
#: Sensors of the drive in figure 1 (assumed): position in steps of 5 um, pressures to 10 bar with 16 bits.
ENCODER = Encoder(5e-6)
PRESSURE_SENSOR = AnalogSensor(0.0, 1.1e6, 16, noise=200.0)
#: Half width, in samples, of the window (25 ms) in which the slope of the encoder position gives the speed.
SLOPE_HALF_WIDTH = 12


def slow_drive(law: str = "lugre") -> pn.Drive:
    """Return the drive of the stick-slip figures, with the LuGre law or with combined Coulomb and Stribeck friction."""
    drive = pn.Drive.load(SLOW_DRIVE)
    if law == drive.friction.law:
        return drive
    kept = ("coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous")
    table = {key: value for key, value in drive.friction.to_dict().items() if key in kept}
    return drive.replace({"friction": {"law": law, **table}})


def motion_of(drive: pn.Drive, opening: float, duration_s: float) -> Columns:
    """Simulate a drive with a constant valve opening; return the columns of its trajectory."""
    return trajectory.columns(pn.simulate(drive, [(0.0, opening)], duration_s, initial=START, sample_rate=SAMPLE_RATE))


def creep(law: str) -> Columns:
    """Return the motion of the slow drive after its starting transient. The time begins at zero.

    Parameters
    ----------
    law : str
        ``lugre`` or ``stribeck``.
    """
    motion = motion_of(slow_drive(law), OPENING, SKIPPED_S + SHOWN_S)
    shown = rows_of(motion, motion["time_s"] >= SKIPPED_S)
    return shown | {"time_s": shown["time_s"] - shown["time_s"][0]}


def stick_slip_figures(seed: int = 0) -> Iterator[PaperFigure]:
    """Yield figures 1 to 3, which show stick-slip of the slow drive.

    Figure 1 has sensor readings: quantised position, its slope, noisy pressures. Figure 2 has the true motion with the
    LuGre law. Figure 3 has combined Coulomb and Stribeck friction, with which a stuck piston is exactly at rest.
    """
    lugre, rng = creep("lugre"), np.random.default_rng(seed)
    position = ENCODER.read(lugre["position_m"])
    read = {
        "time_s": lugre["time_s"],
        "position_m": position,
        "velocity_m_s": local_slope(lugre["time_s"], position, SLOPE_HALF_WIDTH),
        "pressure_a_pa": PRESSURE_SENSOR.read(lugre["pressure_a_pa"], rng),
        "pressure_b_pa": PRESSURE_SENSOR.read(lugre["pressure_b_pa"], rng),
    }
    opened = motion_of(slow_drive(), FASTER * OPENING, FASTER_S)
    middle = (opened["position_m"] > MIDDLE_M[0]) & (opened["position_m"] < MIDDLE_M[1])
    faster = whole_periods(rows_of(opened, middle))
    for number, motion in {1: read, 2: lugre, 3: creep("stribeck")}.items():
        found = whole_periods(motion)
        slips, rest = sticks(found), np.mean(motion["velocity_m_s"] == 0.0)
        verdicts = {
            "steps": judge(slips and not sticks(faster), part=slips),
            "speed": judge(abs(found.mean_speed_m_s - MEAN_SPEED_M_S) <= SPEED_TOLERANCE_M_S, part=False),
            "simulates": judge(slips and (number == 2 or rest > 0.0), part=slips),
            "coarse": judge(slips and found.step_m > COARSE_M, part=slips),
        }
        quantities = {
            **vars(found),
            "peak_ratio": found.peak_speed_m_s / found.mean_speed_m_s,
            "rest_share": rest,
            "faster_speed_m_s": faster.mean_speed_m_s,
            "faster_stuck_share": faster.stuck_share,
            "opened": FASTER,
        }
        yield PaperFigure(number, verdicts, quantities, motion)


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


# --- Figure 9: effect of a stop of 15 s in the middle of a stroke on friction.

#: Fractions of running friction. A higher peak counts as a change of the characteristics, or as a high dependence.
CHANGE, HIGH = 0.05, 0.2
#: Travel after which a change counts as lasting, m (our interpretation: a tenth of a stroke of 200 mm).
LASTING_M = 20e-3


def figure_9(run: Campaign) -> PaperFigure:
    """Return friction around stops of 15 s and in strokes without a stop.

    Parameters
    ----------
    run : Campaign
        Campaign with stops of 15 s, and with strokes without a stop, which give the friction of uninterrupted sliding.

    Returns
    -------
    PaperFigure
        Columns over the speeds of the restart (m,): mean increment of the peak over uninterrupted sliding, with the
        half-width of its 95 % interval. Further columns: friction over time during one stop.

    Raises
    ------
    CampaignError
        A stop cannot be read.
    """
    found = campaign_friction(run)
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
    return PaperFigure(
        9,
        {
            "changed": judge(changed and back > LASTING_M, part=changed),
            "relaxed": judge(relaxed.size > 0 and np.median(relaxed) > 0.0, part=False),
            "ages": judge(False, part=np.all(increment - width > HIGH * running)),
        },
        {
            "least_increment_n": increment.min(),
            "largest_increment_n": increment.max(),
            "least_share": (increment / running).min(),
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
    )


# --- Figures 4 and 7: two rigs, and a check that ours ran the campaigns in the same way.

#: "About 5 000 measurements of force" in a cycle, and tolerance. Bursts around the turns are additional.
SAMPLES, SAMPLES_TOLERANCE = 5000, 0.05
#: Number of the figure -> experiment, and its slowest and fastest speed in the paper.
RIGS = {4: ("speed", (1e-3, 0.45)), 7: ("pressure", (1e-3, 0.5))}
GAUGES_PA = (0.1e5, 1.5e5)
#: Relative tolerance, and tolerance of a pressure sensor's zero as a fraction of its highest value.
REACHED = 0.01


def rig_figures(runs: Mapping[str, Campaign]) -> Iterator[PaperFigure]:
    """Yield figures 4 and 7, which show the rigs: a servo drags the drive through a force sensor.

    In figure 4, the speed rises from 1 to 450 mm/s. In figure 7, both chambers have a pressure of 0.1 to 1.5 bar.
    """
    for number, (experiment, paper_speeds_m_s) in RIGS.items():
        run = runs[experiment]
        speeds, gauges, samples = _ran(run)
        spans = _spans(speeds, paper_speeds_m_s)
        quantities = {
            "cycles": speeds.size,
            "first_m_s": speeds[0],
            "last_m_s": speeds[-1],
            "slowest_m_s": speeds.min(),
            "fastest_m_s": speeds.max(),
            "samples": samples.min(),
            "most_samples": samples.max(),
            "lowest_gauge_pa": gauges.min(),
            "highest_gauge_pa": gauges.max(),
        }
        verdicts = {
            "speeds": judge(spans and np.all(np.diff(speeds) > 0.0), part=False),
            "samples": judge(np.all(np.abs(samples / SAMPLES - 1.0) <= SAMPLES_TOLERANCE), part=False),
            "ranges": judge(spans and _spans(gauges, GAUGES_PA, REACHED * GAUGES_PA[1]), part=False),
        }
        rig = run.identity, envelope_of(run.about["envelope"], str(run.path))
        yield PaperFigure(number, verdicts, quantities, {}, rig)


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
