"""The source paper's experiments on simulated rigs, figures of their data, and verdicts on the paper's sentences."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.storage.control import write_whole
from pneudrive.campaign.storage.folder import Campaign, recording_of
from pneudrive.characterise import SourcePaper, characterise_recordings
from pneudrive.characteristics import CampaignCharacteristics, campaign_friction
from pneudrive.errors import CampaignError, package_table
from pneudrive.files.content import read_json
from pneudrive.friction.friction_map import BOTH
from pneudrive.friction.strokes import moving_average
from pneudrive.rig.interface import Move, Step

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.arrays import Array, Columns, Keyed, NamedNumbers, Plain
    from pneudrive.friction.campaign.result import AirShare
    from pneudrive.rig import Envelope, Identity
    from pneudrive.rig.machine import Machine, Past
    from pneudrive.rig.motion import Motion


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
    title : str
    claims : tuple of Claim
        All checkable sentences of the paper about this figure.
    measured : str
        The result in words.
    quantities : dict
        Numbers of the result, in SI.
    columns : dict
        Name with unit -> array; the arrays of a figure have matching shapes (curves over pressure are 2-D).
    assumed : str
        Assumptions of the simulated rig beyond the paper.
    rig : (Identity, Envelope) or None
        Rig that the figure shows; None if it shows data.
    """

    number: int
    title: str
    claims: tuple[Claim, ...]
    measured: str
    quantities: NamedNumbers
    columns: dict[str, Array] = field(repr=False)
    assumed: str = ""
    rig: tuple[Identity, Envelope] | None = field(default=None, repr=False)

    @classmethod
    def make(
        cls,
        number: int,
        verdicts: Mapping[str, str],
        quantities: Keyed,
        columns: Columns,
        rig: tuple[Identity, Envelope] | None = None,
        **more: object,
    ) -> PaperFigure:
        """Return a figure from these numbers. The numbers in `more` are used only in its texts."""
        found = {name: float(value) for name, value in quantities.items()}
        texts, numbers = package_table(__file__, TEXTS.name)[str(number)], {**found, **more}
        claims = claims_of(str(number), verdicts, numbers)
        measured = texts["measured"].format(**readable(numbers))
        return cls(number, texts["title"], claims, measured, found, columns, texts.get("assumed", ""), rig)


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
#: Fraction of neighbouring curves in the order of pressure that is required for "holds in part".
ORDERED_IN_PART = 0.8
HIGH_M_S = 20e-3


def figure_5(run: Campaign) -> PaperFigure:
    """Return friction over time through one cycle at 2 mm/s. It is largest right after the turn.

    Parameters
    ----------
    run : Campaign
        Campaign with one cycle, out and back.

    Returns
    -------
    PaperFigure
        Columns of the stroke after the turn: time since the turn, position, friction as read and with the moving
        average of five samples, and mean friction of the rest.
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
    return PaperFigure.make(
        5,
        {"largest": judge(excess > CLEAR * elsewhere and early, part=early)},
        {
            "peak_n": smooth[top],
            "excess_n": excess,
            "elsewhere_n": elsewhere,
            "travel_at_peak_m": travel,
        },
        {
            "time_s": time,
            "position_m": result.recording.position_m[part],
            "friction_n": raw,
            "friction_smoothed_n": smooth,
            "friction_mean_n": np.full(time.shape, rest.mean()),
        },
        excess_share=excess / rest.mean(),
    )


def figure_6(run: Campaign) -> PaperFigure:
    """Return mean friction over speed by the paper's protocol. It is largest at the lowest speeds.

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
    return PaperFigure.make(
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
        low_m_s=LOW_M_S,
        high_m_s=HIGH_M_S,
        fastest_n=by_paper[-1],
        fastest_m_s=speed[-1],
        fall_n=fall,
        rise_n=rise,
        lowest_at_m_s=speed[lowest],
        scatter_n=scatter,
        undropped_n=undropped,
        dropped_n=left,
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
        truth have shape (k, m).
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
    return PaperFigure.make(
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
        },
        {
            "speed_m_s": speed,
            "mean_speed_m_s": mean_speed,
            "gauge_pa": gauge,
            "friction_n": total,
            "air_n": air,
            "seal_n": seal,
            "friction_true_n": truth,
        },
        slowest_m_s=speed[0],
        fastest_m_s=speed[-1],
        fastest_mean_m_s=mean_speed[-1],
        first_pa=gauge[0],
        last_pa=gauge[-1],
        first_dip_share=dip[0],
        last_dip_share=dip[-1],
        first_total_n=total[0, -1],
        last_total_n=total[-1, -1],
        already="; but our curve is a full Stribeck curve even at the lowest pressure" if has_minimum[0] else "",
    )


def _by_pressure(found: CampaignCharacteristics) -> list[AirShare]:
    return sorted(found.air, key=lambda share: share.condition.pressure_a_pa)


def _shares(found: CampaignCharacteristics) -> list[Columns]:
    """Return the force of the sensor and its parts from air and seal at the measured speeds, sorted by pressure."""
    measured = {c.condition: c.measured for c in found.curves if c.direction == BOTH}
    names = ("speed_m_s", "total_n", "air_n", "seal_n")
    return [{name: getattr(s, name)[measured[s.condition]] for name in names} for s in _by_pressure(found)]


def _truths(run: Campaign) -> Array:
    """Return the true friction (N) of each cycle, as the mean of both directions."""
    each = [[friction for _, friction in strokes if friction is not None] for strokes in true_strokes(run)]
    return np.asarray(each, dtype=float).mean(axis=1)
