"""Figures 4 and 7 of the source paper: its two rigs, and a check that ours ran the campaigns in the same way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.studies.bracha.figure import PaperFigure, judge

if TYPE_CHECKING:
    from pneudrive.studies.bracha.experiments import Experiment

#: "About 5 000 measurements of force" in a cycle; bursts around the turns come on top of them.
SAMPLES, SAMPLES_TOLERANCE = 5000, 0.05
SPEEDS_M_S = (1e-3, 0.45)
SPEEDS_UNDER_PRESSURE_M_S = (1e-3, 0.5)
GAUGES_PA = (0.1e5, 1.5e5)
#: Relative tolerance; also of a pressure sensor's zero, share of its highest value.
REACHED = 0.01


def figure_4(run: Experiment) -> PaperFigure:
    """Return the rig of the first campaign: a servo drags the drive through a force sensor from 1 to 450 mm/s."""
    speeds, _, samples = _ran(run)
    near = np.all(np.abs(samples / SAMPLES - 1.0) <= SAMPLES_TOLERANCE)
    rising = _spans(speeds, SPEEDS_M_S) and np.all(np.diff(speeds) > 0.0)
    return PaperFigure.make(
        4,
        {"speeds": judge(rising, part=False), "samples": judge(near, part=False)},
        {"slowest_m_s": float(speeds.min()), "fastest_m_s": float(speeds.max()), "samples": float(samples.min())},
        {"speed_m_s": speeds, "samples": samples},
        (run.campaign.identity, run.envelope),
        cycles=speeds.size,
        first_m_s=speeds[0],
        last_m_s=speeds[-1],
        most_samples=samples.max(),
    )


def figure_7(run: Experiment) -> PaperFigure:
    """Return the rig of the second campaign: the same under 0.1 to 1.5 bar in both chambers, 1 to 500 mm/s."""
    speeds, gauges, samples = _ran(run)
    spans = _spans(speeds, SPEEDS_UNDER_PRESSURE_M_S) and _spans(gauges, GAUGES_PA, REACHED * GAUGES_PA[1])
    return PaperFigure.make(
        7,
        {"ranges": judge(spans, part=False)},
        {"lowest_gauge_pa": float(gauges.min()), "highest_gauge_pa": float(gauges.max())},
        {"speed_m_s": speeds, "gauge_pa": gauges, "samples": samples},
        (run.campaign.identity, run.envelope),
        cycles=speeds.size,
        slowest_m_s=speeds.min(),
        fastest_m_s=speeds.max(),
    )


def _ran(run: Experiment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return measured speed and pressure, and number of evenly spaced samples, of each cycle."""
    rows = []
    ambient = run.campaign.identity.ambient_pressure_pa
    for file in run.campaign.cycles():
        samples = file.samples()
        inner = slice(len(samples) // 5, 2 * len(samples) // 5)  # within the outward stroke, between its ramps
        speed = abs(float(np.polyfit(samples.time_s[inner], samples.position_m[inner], 1)[0]))
        gauge = 0.5 * float(np.mean(samples.pressure_a_pa + samples.pressure_b_pa)) - ambient
        even = float(np.median(np.diff(samples.time_s)))  # most samples lie outside the bursts
        rows.append((speed, gauge, np.rint((samples.time_s[-1] - samples.time_s[0]) / even)))
    speeds, gauges, sizes = np.array(rows, dtype=float).T
    return speeds, gauges, sizes


def _spans(values: np.ndarray, ends: tuple[float, float], zero_error: float = 0.0) -> bool:
    """Return whether the values reach both ends, within the error of the sensors."""
    low, high = float(values.min()), float(values.max())
    return low <= ends[0] * (1.0 + REACHED) + zero_error and high >= ends[1] * (1.0 - REACHED) - zero_error
