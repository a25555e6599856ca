"""The five lines that matter, with U (k = 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.pressure_line import CONFOUNDED
from pneudrive.numbers import fixed, with_u
from pneudrive.report.paper import count_verdicts
from pneudrive.report.recovered import recovered
from pneudrive.report.speed import richest
from pneudrive.report.words import by_seal, gauge_bar, plural, speed_mm_s

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.closure import Estimate
    from pneudrive.identify import FrictionFit
    from pneudrive.report.write import Reproduction

    Fits = Mapping[str, Mapping[str, FrictionFit]]

LINES = 5
WIDEST_AREA = 0.3  # of the nominal area, from end to end of the interval
PARAMETERS = {
    "breakaway": "breakaway force",
    "stribeck_velocity": "Stribeck velocity",
    "stribeck_exponent": "Stribeck exponent",
    "viscous": "viscous coefficient",
    "coulomb": "Coulomb force",
}


def verdict(found: Characterisation | None, fits: Fits, made: Reproduction | None) -> list[str]:
    """Return the lines; what the recordings do not show is left out, or said in its line."""
    lines = []
    if found is not None:
        lines += [_friction(found), _pressure(found), _closure(found), _open(found, fits)]
    if made is not None:
        lines += _reproduced(made, all_of_it=found is None)
    elif found is not None:
        lines.append(_quality(found))
    return [line for line in lines if line][:LINES]


def _friction(found: Characterisation) -> str:
    levels = sorted(found.levels, key=lambda level: level.friction_n)
    recordings = {r.name: r for r in found.recordings}
    kind = "simulated recording" if found.synthetic else "recording"
    head = f"Sliding friction, {plural(len(found.results), kind)}, {plural(len(by_seal(found)), 'seal')}: "
    shown = []
    for level in levels[:1] if len(levels) == 1 else (levels[0], levels[-1]):
        bar = fixed(gauge_bar(level, recordings[level.recording]), 1)
        conditions = f"{level.recording}, {bar} bar, {speed_mm_s(level):.3g} mm/s"
        shown.append(f"{with_u(level.friction_n, level.expanded_n)} ({conditions})")
    return head + " to ".join(shown) + ", U with k = 2."


def _pressure(found: Characterisation) -> str:
    lines = found.pressure_lines
    spread = found.run_spread
    known = (
        f"runs of one seal differ by {100 * spread.relative:.0f} % (standard deviation), more than U of a single run "
        "says"
        if spread and _beyond_u(found)
        else f"runs of one seal differ by {100 * spread.relative:.0f} % (standard deviation)"
        if spread
        else "nothing was run twice, so the spread between runs is unknown"
    )
    if not lines:
        return f"Pressure: too few recordings for a line over pressure; {known}."
    slopes = sorted(1e5 * line.slope_n_pa for line in lines)
    rise = f"{slopes[0]:+.2f} N/bar" if len(slopes) == 1 else f"{slopes[0]:+.2f} to {slopes[-1]:+.2f} N/bar"
    confounded = [line for line in lines if abs(line.speed_pressure_correlation) > CONFOUNDED]
    tail = (
        f"; in {len(confounded)} of {len(lines)} speed changes with pressure and the two cannot be told apart"
        if confounded
        else ""
    )
    return f"Friction changes with pressure by {rise}; {known}{tail}."


def _beyond_u(found: Characterisation) -> bool:
    relative = [level.expanded_n / level.friction_n for level in found.levels if level.friction_n > 0]
    return bool(relative) and found.run_spread is not None and found.run_spread.relative > float(np.median(relative))


def _closure(found: Characterisation) -> str:
    if not found.closures:
        return "Force balance: effective area and force zero are not determined by these pressures."
    known = [c for c in found.closures if all(_is_determined(a, c.nominal_m2[s]) for s, a in c.areas_m2.items())]
    if not known:
        return "Force balance: these pressures do not determine the effective area (both chambers moved together)."
    areas = [100 * (a.value / c.nominal_m2[s] - 1) for c in known for s, a in c.areas_m2.items()]
    zeros = [c.force_zero_n.value for c in known]
    large = sum(abs(level.offset_n) > level.friction_n for level in found.levels)
    offset = (
        f"; in {plural(large, 'recording')} the offset exceeds the friction, and only pairing the directions "
        "survives it"
        if large
        else ""
    )
    return (
        f"Force balance: effective area {min(areas):+.1f} to {max(areas):+.1f} % of nominal, force zero "
        f"{min(zeros):+.2f} to {max(zeros):+.2f} N{offset}."
    )


def _is_determined(area: Estimate, nominal: float) -> bool:
    """Whether an area's interval is narrow enough to speak of it; without spare recordings there is no interval."""
    return not np.isfinite(area.low) or area.high - area.low < WIDEST_AREA * nominal


def _open(found: Characterisation, fits: Fits) -> str:
    speeds = [p.speed_m_s * 1e3 for p in found.points]
    low, high = f"{min(speeds):.3g}", f"{max(speeds):.3g}"
    span = f"{low} to {high} mm/s" if low != high else f"{low} mm/s alone"
    if not fits:
        return f"Not determined: any law of friction over speed ({span} only)."
    names = {item.parameter for by_law in fits.values() for item in richest(by_law).undetermined}
    lost = [words for name, words in PARAMETERS.items() if name in names]
    if not lost:
        return f"Every parameter of the fitted law is determined by speeds of {span}."
    return f"Not determined by speeds of {span}: {', '.join(lost)}; what is measured is mean sliding friction there."


def _quality(found: Characterisation) -> str:
    peaks = [p for level in found.levels for p in level.peaks]
    usable = sum(not p.flags for p in peaks)
    drifting = sum("trend" in level.flags for level in found.levels)
    text = f"Friction drifts from stroke to stroke in {drifting} of {plural(len(found.levels), 'speed level')}"
    return f"{text}; {usable} of {plural(len(peaks), 'reversal peak')} usable for breakaway." if peaks else f"{text}."


def _reproduced(made: Reproduction, *, all_of_it: bool) -> list[str]:
    pairs = recovered(made.found)
    truth = f"friction recovered within U in {pairs.inside} of {pairs.true_n.size} recordings" if pairs else ""
    first = f"Simulated rig (synthetic, parameters assumed): of the source paper, {count_verdicts(made.claims)}"
    if not all_of_it:
        return [f"{first}; {truth}."]
    slip = made.figures.get(2) or made.figures.get(1)
    lines = [f"{first}.", f"{truth[:1].upper()}{truth[1:]}, U with k = 2."]
    if slip is not None:
        q = slip.quantities
        lines.append(
            f"Stick-slip at a mean of {1e3 * q['mean_speed_m_s']:.2f} mm/s: period {q['period_s']:.2f} s, step "
            f"{1e3 * q['step_m']:.1f} mm, peak {q['peak_ratio']:.1f} times the mean, stuck "
            f"{100 * q['stuck_share']:.0f} % of the time."
        )
    c = made.chambers
    lines.append(
        "Printed chamber equations: stroke time "
        f"{100 * (c.stroke_time_s['as-printed'] / c.stroke_time_s['energy-balance'] - 1):+.1f} %, but gas "
        f"temperature off by up to {c.largest_difference('temperature_b'):.0f} K and "
        f"{c.energy_residual_j['as-printed']:.0f} J of {c.stroke_work_j:.0f} J from nowhere."
    )
    return lines
