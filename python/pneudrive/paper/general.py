"""The source paper on the drive as a whole: its chamber equations, and its conclusions on what acts on the drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.describe import Drive
from pneudrive.paper.chamber_laws import AS_PRINTED, ENERGY_BALANCE, FULL_STROKE
from pneudrive.paper.figure import Claim, judge
from pneudrive.simulate import simulate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.paper.chamber_laws import ChamberComparison
    from pneudrive.paper.figure import PaperFigure

#: Sentences that simulated data cannot speak to, and why.
UNCHECKED = {
    "[Stick-slip] Real pneumatic piston drive (figure 1, caption); characteristics are obtained and compared with the "
    "real drive characteristics (abstract)": "the paper prints no data of its drive",
    "This model reflects the behaviour of friction in the pneumatic drives very well": "it would take measured data",
    "This may be caused by: the surface quality of the cylinder, impurities, worn seals or even corrosion": "no law "
    "here knows surfaces",
    "it is possible to use the predictive control based on complex mathematical model": "there is no controller yet",
}
#: In which every one of these strokes ends, s.
STROKE_S = 2.0
#: Share of the stroke's energy that may be missing where energy is conserved.
CLOSED = 1e-3
#: What is changed to see the influences that the conclusions name: supply and surroundings by 40 K, argon for air.
WARMER = {"ambient.temperature": "313.15 K"}
COLDER = {"ambient.temperature": "273.15 K"}
ARGON = {"gas.heat_capacity_ratio": 1.667, "gas.gas_constant": "208.13 J/(kg K)"}
#: A valve with half the conductance: the connector that is too small.
NARROW = 0.5
#: A reduction of the speed by this share is a significant one.
SIGNIFICANT = 0.2


def general_claims(chambers: ChamberComparison, figures: Mapping[int, PaperFigure]) -> tuple[Claim, ...]:
    """Check the sentences that belong to no single figure.

    Parameters
    ----------
    chambers : ChamberComparison
        Printed equations against the energy balance.
    figures : mapping of PaperFigure
        By number; 6 and 9 say what speed and a stop do to friction.

    Returns
    -------
    tuple of Claim
    """
    return (_balance(chambers), _influences(figures), _connectors())


def _balance(chambers: ChamberComparison) -> Claim:
    work, lost = chambers.stroke_work_j, chambers.energy_residual_j
    return Claim(
        "section 2, equations 1 to 3",
        "A common mathematical model of pneumatic piston drive is a model based on energy balance",
        judge(lost[AS_PRINTED] < CLOSED * work, part=lost[ENERGY_BALANCE] < CLOSED * work),
        f"the balance of equation 1 closes (within {lost[ENERGY_BALANCE]:.2g} of {work:.0f} J of stroke work); "
        f"equations 2 and 3 as printed do not follow from it: {lost[AS_PRINTED]:.1f} J come from nowhere",
    )


def _influences(figures: Mapping[int, PaperFigure]) -> Claim:
    usual = _stroke_time({})
    heat = 100 * abs(_stroke_time(WARMER) - _stroke_time(COLDER)) / usual
    gas = 100 * abs(_stroke_time(ARGON) - usual) / usual
    curve = figures[6].columns["friction_settled_n"]
    speed = 100 * (curve.max() / curve.min() - 1)
    stop = 100 * figures[9].quantities["largest_share"]
    some = min(heat, gas) > 1.0
    return Claim(
        "conclusions",
        "The performance of this drive is affected by many factors such as changes in temperature, working fluid "
        "properties, and especially the velocity of piston and how long the drive is stopped",
        judge(some and min(speed, stop) > max(heat, gas), part=min(speed, stop) > 1.0),
        f"a stroke takes {heat:.0f} % longer or shorter for 40 K, {gas:.0f} % for argon instead of air; friction "
        f"changes by {speed:.0f} % over speed and by up to {stop:.0f} % over a stop of 15 s",
    )


def _connectors() -> Claim:
    wide = _stroke_time({})
    drive = Drive.load(FULL_STROKE)
    narrow = _stroke_time({"valve.conductance": f"{NARROW * drive.valve.conductance_m3_s_pa} m^3/(s Pa)"})
    slower = 1.0 - wide / narrow
    return Claim(
        "conclusions",
        "size of connectors and length of pneumatic lines whereby improper selection significantly reduces the maximum "
        "speed or dynamics of the piston",
        judge(False, part=slower > SIGNIFICANT),
        f"with half the conductance the mean speed of a stroke falls by {100 * slower:.0f} %; the length of lines is "
        "not simulated yet",
    )


def _stroke_time(change: Mapping[str, object]) -> float:
    """Time of the stroke out at full opening, s; the drive's own where nothing is changed."""
    drive = Drive.load(FULL_STROKE).replace(dict(change))
    start = f"position = 0 mm, pressure_b = {drive.supply_pressure_pa} Pa abs"
    run = simulate(drive, [(0.0, 1.0)], STROKE_S, initial=start, sample_rate="10 kHz")
    there = run.position.to_numpy() >= drive.cylinder.stroke_m
    return float(run.time[int(there.argmax())]) if there.any() else float("nan")
