"""Figure 9 of the source paper: effect of a stop of 15 s in the middle of a stroke on friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import pneudrive as pn
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import mean_estimate
from pneudrive.studies.bracha.figure import PaperFigure, judge

if TYPE_CHECKING:
    from pneudrive.studies.bracha.experiments import Experiment

#: Peak, share of running friction, that counts as a change of the characteristics, and as a high dependence.
CHANGE, HIGH = 0.05, 0.2
#: Travel after which a complete change persists, m (our reading: a tenth of a stroke of 200 mm).
LASTING_M = 20e-3


def figure_9(run: Experiment) -> PaperFigure:
    """Return friction around stops of 15 s and in strokes without a stop.

    Parameters
    ----------
    run : Experiment
        Stops of 15 s, and strokes without a stop for uninterrupted sliding.

    Returns
    -------
    PaperFigure
        Columns over the speeds of the restart (m,): mean increment of the peak over uninterrupted sliding, with the
        half-width of its 95 % interval. Also one stop over time.

    Raises
    ------
    CampaignError
        If a stop cannot be read.
    """
    found = pn.campaign_friction(run.campaign)
    if found.skipped:
        raise CampaignError("a stop could not be read", where=str(run.campaign.path), value=str(found.skipped[0]))
    speeds = np.array(sorted({stop.speed_m_s for stop in found.stops}))
    rested = [[s for s in found.stops if s.speed_m_s == v] for v in speeds]
    # no peak: zero increment
    means = [mean_estimate(np.nan_to_num([s.increment_n for s in group], posinf=0.0, neginf=0.0)) for group in rested]
    increment = np.array([mean.value for mean in means])
    width = np.array([mean.high for mean in means]) - increment
    running = np.array([np.mean([s.running_n for s in group]) for group in rested])
    relaxed = np.array([s.relaxation.amount.value for group in rested for s in group if s.relaxation])
    back = float(np.median([s.recovery.distance.value for group in rested for s in group if s.recovery]))
    shown = rested[len(speeds) // 2][0]
    changed = bool(np.all(increment - width > CHANGE * running))
    return PaperFigure.make(
        9,
        {
            "changed": judge(changed and back > LASTING_M, part=changed),
            "relaxed": judge(relaxed.size > 0 and np.median(relaxed) > 0.0, part=False),
            "ages": judge(False, part=np.all(increment - width > HIGH * running)),
        },
        {
            "least_increment_n": float(increment.min()),
            "largest_increment_n": float(increment.max()),
            "largest_share": float((increment / running).max()),
            "relaxed_n": float(np.median(relaxed)),
            "recovery_m": back,
        },
        {
            "speed_m_s": speeds,
            "increment_n": increment,
            "increment_width_n": width,
            "time_s": shown.trace.time_s,
            "position_m": shown.trace.position_m,
            "friction_n": shown.trace.friction_n,
            "running_n": np.full(shown.trace.time_s.shape, shown.running_n),
        },
        least_share=(increment / running).min(),
    )
