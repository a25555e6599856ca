"""Figure 9 of the source paper: what a stop of 15 s in the middle of a stroke does to friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.stops.stop import find_stops
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import mean_estimate
from pneudrive.paper.figure import Claim, PaperFigure, judge

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.stops.stop import Stop
    from pneudrive.paper.experiments import Experiment

    Array = NDArray[np.float64]
#: Share of running friction from which on a peak counts as a change of the characteristics, and as a high dependence.
CHANGE, HIGH = 0.05, 0.2
#: A change that is gone after this travel is not a complete one, m (our reading: a tenth of a stroke of 200 mm).
LASTING_M = 20e-3


def figure_9(run: Experiment) -> PaperFigure:
    """Friction around stops of 15 s against strokes without one: it falls while held, peaks at the restart, comes back.

    Parameters
    ----------
    run : Experiment
        Stops of 15 s, and strokes without one that say what uninterrupted sliding is.

    Returns
    -------
    PaperFigure
        Columns over the speeds of the restart (m,): mean increment of the peak over uninterrupted sliding with the
        half-width of its 95 % interval; and one stop over time.

    Raises
    ------
    CampaignError
        A stop could not be read.
    """
    stops, skipped = find_stops(run.campaign)
    if skipped:
        raise CampaignError("a stop could not be read", where=str(run.campaign.path), value=str(skipped[0]))
    speeds = np.array(sorted({stop.speed_m_s for stop in stops}))
    rested = [[s for s in stops if s.speed_m_s == v] for v in speeds]
    increment, width = (np.array(part) for part in zip(*(_mean(group) for group in rested), strict=True))
    running = np.array([np.mean([s.running_n for s in group]) for group in rested])
    relaxed = np.array([s.relaxation.amount.value for group in rested for s in group if s.relaxation])
    back = np.array([s.recovery.distance.value for group in rested for s in group if s.recovery])
    shown = rested[len(speeds) // 2][0]
    share = 100 * increment / running
    changed = bool(np.all(increment - width > CHANGE * running))
    return PaperFigure(
        number=9,
        title="Friction around stops of 15 s",
        claims=(
            Claim(
                "conclusions, figure 9",
                "Even short-term stop of the drive during the test causes a complete change of drive characteristics",
                judge(changed and np.median(back) > LASTING_M, part=changed),
                f"a stop of 15 s changes the restart: the peak is {share.min():.0f} to {share.max():.0f} % above "
                f"uninterrupted sliding. The change is not complete: after {1e3 * np.median(back):.2g} mm (median) "
                "friction is that of uninterrupted sliding again",
            ),
            Claim(
                "figure 9, caption",
                "Changes of friction forces during 15-seconds stops",
                judge(relaxed.size > 0 and np.median(relaxed) > 0.0, part=False),
                f"while the axis holds, the force falls by {np.median(relaxed):.2f} N (median)",
            ),
            Claim(
                "section 2.1",
                "static friction value - which is highly dependent on the stopping time",
                judge(False, part=np.all(increment - width > HIGH * running)),
                f"after 15 s the peak is {share.min():.0f} to {share.max():.0f} % higher than without a stop; these "
                "two times alone do not say how it grows in between (`campaign run stops-pressure` measures that)",
            ),
        ),
        measured=f"while the axis holds for 15 s the force falls by {np.median(relaxed):.2f} N (median); at the "
        f"restart it peaks {increment.min():.2f} to {increment.max():.2f} N "
        f"({100 * np.min(increment / running):.0f} to {100 * np.max(increment / running):.0f} %) above uninterrupted "
        f"sliding; after {1e3 * np.median(back):.2g} mm (median) it is back",
        quantities={
            "least_increment_n": float(increment.min()),
            "largest_increment_n": float(increment.max()),
            "largest_share": float(share.max()) / 100,
            "relaxed_n": float(np.median(relaxed)),
            "recovery_m": float(np.median(back)),
        },
        columns={
            "speed_m_s": speeds,
            "increment_n": increment,
            "increment_width_n": width,
            "time_s": shown.trace.time_s,
            "position_m": shown.trace.position_m,
            "friction_n": shown.trace.friction_n,
            "running_n": np.full(shown.trace.time_s.shape, shown.running_n),
        },
        assumed="how the contact ages and how the held seal relaxes: the paper prints one picture and no law; speeds "
        "of the restart; the axis keeps its position during the stop",
    )


def _mean(group: list[Stop]) -> tuple[float, float]:
    """Mean increment and half of its 95 % interval."""
    values = np.array([stop.increment_n for stop in group])
    values = np.where(np.isfinite(values), values, 0.0)  # no peak is an increment of nothing
    found = mean_estimate(values)
    return found.value, found.high - found.value
