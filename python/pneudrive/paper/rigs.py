"""Figures 4 and 7 of the source paper: its two rigs, and whether ours ran the campaigns as the paper says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.paper.figure import Claim, PaperFigure, judge

if TYPE_CHECKING:
    from pneudrive.paper.experiments import Experiment

#: "About 5 000 measurements of force" in a cycle; bursts around the turns come on top of them.
SAMPLES, SAMPLES_TOLERANCE = 5000, 0.05
SPEEDS_M_S = (1e-3, 0.45)
SPEEDS_UNDER_PRESSURE_M_S = (1e-3, 0.5)
GAUGES_PA = (0.1e5, 1.5e5)
#: Relative; the zero of a pressure sensor may be off by as much of its highest value.
REACHED = 0.01


def figure_4(run: Experiment) -> PaperFigure:
    """Rig of the first campaign: a servo drags the drive through a force sensor, by itself, from 1 to 450 mm/s."""
    speeds, _, samples = _ran(run)
    few, many = int(samples.min()), int(samples.max())
    near = SAMPLES * (1.0 - SAMPLES_TOLERANCE) <= few <= many <= SAMPLES * (1.0 + SAMPLES_TOLERANCE)
    return PaperFigure(
        number=4,
        title="Rig of the first campaign",
        claims=(
            Claim(
                "figure 4",
                "The measurement process takes place automatically by increasing the speed from 1 to 450 mm / s",
                judge(_spans(speeds, SPEEDS_M_S) and np.all(np.diff(speeds) > 0.0), part=False),
                f"{speeds.size} cycles ran by themselves, from {1e3 * speeds[0]:.3g} to {1e3 * speeds[-1]:.4g} mm/s",
            ),
            Claim(
                "figure 4",
                "Every single cycle generates about 5 000 measurements of friction force",
                judge(near, part=False),
                f"{few} to {many} evenly spaced samples in each, and bursts around the turns",
            ),
        ),
        measured=f"{speeds.size} cycles from {1e3 * speeds.min():.3g} to {1e3 * speeds.max():.4g} mm/s ran by "
        f"themselves; {few} to {many} evenly spaced samples in each, and bursts around the turns",
        quantities={"slowest_m_s": float(speeds.min()), "fastest_m_s": float(speeds.max()), "samples": float(few)},
        columns={"speed_m_s": speeds, "samples": samples},
        rig=(run.campaign.identity, run.envelope),
    )


def figure_7(run: Experiment) -> PaperFigure:
    """Rig of the second campaign: the same under 0.1 to 1.5 bar in both chambers, 1 to 500 mm/s."""
    speeds, gauges, samples = _ran(run)
    return PaperFigure(
        number=7,
        title="Rig of the campaign under pressure",
        claims=(
            Claim(
                "figure 7",
                "The piston velocity was changed in the range of 1 - 500 mm / sec, and the pressure from 0.1 to 1.5 "
                "Bar which was fed to both chambers",
                judge(
                    _spans(speeds, SPEEDS_UNDER_PRESSURE_M_S) and _spans(gauges, GAUGES_PA, REACHED * GAUGES_PA[1]),
                    part=False,
                ),
                f"{speeds.size} cycles from {1e3 * speeds.min():.3g} to {1e3 * speeds.max():.4g} mm/s at "
                f"{1e-5 * gauges.min():.2g} to {1e-5 * gauges.max():.2g} bar gauge",
            ),
        ),
        measured=f"{speeds.size} cycles from {1e3 * speeds.min():.3g} to {1e3 * speeds.max():.4g} mm/s at "
        f"{1e-5 * gauges.min():.2g} to {1e-5 * gauges.max():.2g} bar gauge in both chambers ran by themselves; "
        "that one regulator fed both through a manifold is our reading of the paper's picture",
        quantities={"lowest_gauge_pa": float(gauges.min()), "highest_gauge_pa": float(gauges.max())},
        columns={"speed_m_s": speeds, "gauge_pa": gauges, "samples": samples},
        rig=(run.campaign.identity, run.envelope),
    )


def _ran(run: Experiment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed and pressure as measured, and number of evenly spaced samples, of each cycle."""
    speeds, gauges, sizes = [], [], []
    ambient = run.campaign.identity.ambient_pressure_pa
    for file in run.campaign.cycles():
        samples = file.samples()
        inner = slice(len(samples) // 5, 2 * len(samples) // 5)  # within the way out, between its ramps
        speeds.append(abs(float(np.polyfit(samples.time_s[inner], samples.position_m[inner], 1)[0])))
        gauges.append(0.5 * float(np.mean(samples.pressure_a_pa + samples.pressure_b_pa)) - ambient)
        even = float(np.median(np.diff(samples.time_s)))  # most samples lie outside the bursts
        sizes.append(np.rint((samples.time_s[-1] - samples.time_s[0]) / even))
    return np.array(speeds), np.array(gauges), np.array(sizes, dtype=float)


def _spans(values: np.ndarray, ends: tuple[float, float], zero_error: float = 0.0) -> bool:
    """Whether the values reach both ends, within what the sensors may be off by."""
    low, high = float(values.min()), float(values.max())
    return low <= ends[0] * (1.0 + REACHED) + zero_error and high >= ends[1] * (1.0 - REACHED) - zero_error
