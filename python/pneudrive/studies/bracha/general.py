"""Sentences of the source paper on the drive as a whole: its chamber equations, and its conclusions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pneudrive as pn
from pneudrive.studies.bracha.chamber_laws import AS_PRINTED, ENERGY_BALANCE, FULL_STROKE, stroke_out
from pneudrive.studies.bracha.figure import Claim, claims_of, judge
from pneudrive.studies.bracha.stick_slip import slow_drive

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.studies.bracha.chamber_laws import ChamberComparison
    from pneudrive.studies.bracha.figure import PaperFigure

#: Energy error that counts as conserved, share of the stroke's energy.
CLOSED = 1e-3
#: Changes that test the influences named in the conclusions: supply and surroundings by 40 K, argon for air.
WARMER = {"ambient.temperature": "313.15 K"}
COLDER = {"ambient.temperature": "273.15 K"}
ARGON = {"gas.heat_capacity_ratio": 1.667, "gas.gas_constant": "208.13 J/(kg K)"}
#: Factor of the valve's conductance that stands for a small connector.
NARROW = 0.5
#: Tubes on both sides that stand for long lines.
LONG = {"tubing": {side: {"length": "5 m", "diameter": "4 mm"} for side in "ab"}}
#: Share by which a reduction of the speed counts as significant.
SIGNIFICANT = 0.2
#: Share of the error of a usual law below which a law is better beyond doubt.
BETTER = 0.5


def general_claims(chambers: ChamberComparison, figures: Mapping[int, PaperFigure]) -> tuple[Claim, ...]:
    """Check the sentences that do not belong to one figure.

    Parameters
    ----------
    chambers : ChamberComparison
        Printed equations against the energy balance.
    figures : mapping of PaperFigure
        Figures by number. 6 and 9 give the effects of speed and of a stop on friction.

    Returns
    -------
    tuple of Claim
    """
    drive = pn.Drive.load(FULL_STROKE)
    work, lost = chambers.stroke_work_j, chambers.energy_residual_j
    usual, warm, cold, argon = (stroke_out(drive.replace(change)) for change in ({}, WARMER, COLDER, ARGON))
    heat, gas = abs(warm - cold) / usual, abs(argon - usual) / usual
    curve = figures[6].columns["friction_settled_n"]
    speed, stop = curve.max() / curve.min() - 1, figures[9].quantities["largest_share"]
    half = f"{NARROW * drive.valve.conductance_m3_s_pa} m^3/(s Pa)"
    slower, longer = (1.0 - usual / stroke_out(drive.replace(one)) for one in ({"valve.conductance": half}, LONG))
    least, most = min(speed, stop), max(heat, gas)
    usual_law, predictive = (followed(law) for law in ("pid", "nmpc"))
    verdicts = {
        "balance": judge(lost[AS_PRINTED] < CLOSED * work, part=lost[ENERGY_BALANCE] < CLOSED * work),
        "influences": judge(min(heat, gas) > 0.01 and least > most, part=least > 0.01),
        "connectors": judge(min(slower, longer) > SIGNIFICANT, part=max(slower, longer) > SIGNIFICANT),
        "predictive": judge(predictive < BETTER * usual_law, part=predictive < usual_law),
    }
    numbers = {
        "work_j": work,
        "balanced_j": lost[ENERGY_BALANCE],
        "printed_j": lost[AS_PRINTED],
        "heat_share": heat,
        "gas_share": gas,
        "speed_share": speed,
        "stop_share": stop,
        "slower_share": slower,
        "longer_share": longer,
        "predictive_m": predictive,
        "usual_m": usual_law,
    }
    return claims_of("general", verdicts, numbers)


def followed(law: str) -> float:
    """Return the largest error, m, of the drive of figure 2 along the sine R2 under a controller."""
    run = pn.control.run(slow_drive(), law=law, reference="R2")
    return float(run.score["max_error_m"])
