"""Model selection: the part of a law that a friction map supports, and statements on the unsupported parts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.autocorrelation import distinct_levels, projection, weak_coordinates
from pneudrive.estimate.estimates import CHANCE, changed, student
from pneudrive.identify.base import Undetermined
from pneudrive.identify.identified import stated
from pneudrive.identify.static.robust import RobustEstimate, estimate, profile_intervals
from pneudrive.numbers import plain

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.arrays import Interval, NamedIntervals
    from pneudrive.identify.static.model import FrictionModel, Observations

#: Difference below which gauge pressures count as one level, Pa: about 0.5 % of a 10 bar transducer.
SAME_PRESSURE_PA = 5e3
#: Multiple of vs below which a speed level is needed. The tail of the Stribeck curve alone (at 2 vs, exp(-4) = 2 % of
#: the excess) does not separate Fs and vs.
TAIL = 2.0
#: Multiple of vs above which a speed level is needed, to reach the plateau Fc + Fv v. 2.8 vs is the support point of
#: the optimal design with four speeds.
PLATEAU = 2.8
#: Half width of the viscous part's interval, as a fraction of friction, above which this part cannot be distinguished
#: from the Coulomb force.
VISCOUS_REACH = 0.5
#: Largest number of speeds in a sentence.
MOST_SPEEDS = 6


def _lost(names: Iterable[str], what: str, **values: object) -> list[Undetermined]:
    """Return the reason and remedy of each undetermined parameter."""
    return [Undetermined(name, **stated("friction_map", what, **values)) for name in names]


def _mm_s(speed: float) -> str:
    return f"{1e3 * speed:.3g} mm/s"


def _span(data: Observations) -> dict[str, str]:
    """Return the slowest and the fastest level as text."""
    return {"slowest": _mm_s(float(data.speed_m_s.min())), "fastest": _mm_s(float(data.speed_m_s.max()))}


def _listed(levels: list[Interval]) -> str:
    """Return the first six distinct speed levels as text."""
    shown = [
        _mm_s(low) if _mm_s(low) == _mm_s(high) else f"{1e3 * low:.3g} to {_mm_s(high)}"
        for low, high in levels[:MOST_SPEEDS]
    ]
    return ", ".join(shown) + (", ..." if len(levels) > MOST_SPEEDS else "")


def choose_model(
    wanted: FrictionModel, data: Observations, *, pressure: str | None
) -> tuple[FrictionModel, list[Undetermined]]:
    """Return the largest part of the law with enough rows for its parameters, and statements on the omitted parts.

    Parameters
    ----------
    wanted : FrictionModel
        Law without chambers.
    data : Observations
    pressure : str or None
        Requested dependence on pressure, one of ``PRESSURE_FORMS``.
    """
    model, lost = (wanted, []) if pressure is None else _with_pressure(wanted, data, pressure)
    levels = distinct_levels(data.speed_m_s)
    needed = 5 if model.exponent is None else 4
    if model.stribeck and (len(levels) < needed or len(data) < needed + 2 * len(model.terms)):
        names = [*_curve_names(model), *(f"breakaway_{c}" for c in "ab" if pressure is not None)]
        lost = [s for s in lost if not s.parameter.startswith("breakaway_")]
        counts = {"count": len(levels), "s": "s" * (len(levels) != 1), "needed": needed, "values": len(data)}
        lost += _lost(names, "few_speeds" if len(levels) < needed else "few_values", levels=_listed(levels), **counts)
        model = model.without_stribeck()
    if not wanted.viscous:
        lost += _lost(["viscous"], "held_at_zero")
    elif len(levels) < 2 or len(data) < len(model.names):
        what = "one_speed" if len(levels) < 2 else "few_values_viscous"
        lost += _lost(["viscous"], what, levels=_listed(levels), values=len(data))
        model = replace(model, viscous=False)
    if len(data) < len(model.names):
        raise FitError.of("identify.few_values", values=len(data), count=len(model.names), names=", ".join(model.names))
    return model, lost


def _curve_names(model: FrictionModel) -> list[str]:
    """Return the parameters of the Stribeck part."""
    return ["breakaway", "stribeck_velocity"] + ["stribeck_exponent"] * (model.exponent is None)


def _with_pressure(
    wanted: FrictionModel, data: Observations, pressure: str
) -> tuple[FrictionModel, list[Undetermined]]:
    """Add the part of the dependence on pressure that the levels can determine."""
    forces = ("coulomb", "breakaway") if wanted.stribeck else ("coulomb",)
    gauges = {"a": data.gauge_a_pa, "b": data.gauge_b_pa}
    chambers = tuple(c for c, g in gauges.items() if np.ptp(g) > SAME_PRESSURE_PA)
    lost: list[Undetermined] = []
    for c in gauges:
        if c not in chambers:
            lost += _lost((f"{f}_{c}" for f in forces), "one_pressure", chamber=c, bar=1e-5 * gauges[c].mean())
    if len(chambers) == 2:  # if b is a linear function of a, only the sum of both slopes is free
        slope, intercept = np.polyfit(data.gauge_a_pa, data.gauge_b_pa, 1)
        if np.std(data.gauge_b_pa - slope * data.gauge_a_pa - intercept) < 0.5 * SAME_PRESSURE_PA:
            lost += _lost((f"{f}_{c}" for f in forces for c in "ab"), "same_pressure")
            chambers = ("ab",)
    if pressure in ("quadratic", "saturating"):  # a curve needs three levels
        few = [c for c in "".join(chambers) if np.sum(np.diff(np.sort(gauges[c])) > SAME_PRESSURE_PA) < 2]
        if few:
            lost += _lost((f"{f}_curve_{c}" for f in forces for c in few), "few_pressures", chamber=few[0])
            pressure = "linear"
    if pressure == "interaction":  # the product must be linearly independent of the pressures
        a, b = (gauge / 1e5 for gauge in data.gauges_pa)
        rest = a * b - projection(a * b, np.column_stack([np.ones_like(a), a, b]))
        if chambers != ("a", "b") or not np.std(rest) > 1e-3 * np.std(a * b):
            lost += _lost((f"{f}_product" for f in forces), "not_crossed")
            pressure = "linear"
    return replace(wanted, chambers=chambers, pressure=pressure), lost


def diagnose(found: RobustEstimate, intervals: NamedIntervals) -> list[Undetermined]:
    """Return statements on free parameters that the data do not determine."""
    data, theta, names = found.data, found.natural, found.model.names
    said: list[Undetermined] = []
    if found.model.stribeck:  # parts of the Stribeck curve outside the measured levels
        vs, span = theta["stribeck_velocity"], _span(data)
        curve, (low, high) = ("breakaway", "stribeck_velocity"), intervals["stribeck_velocity"]
        if data.speed_m_s.min() > TAIL * vs:
            said += _lost(curve, "tail", tail=TAIL, vs=_mm_s(vs), **span)
        if data.speed_m_s.max() < PLATEAU * vs:
            at = {"plateau": PLATEAU, "vs": _mm_s(vs), "level": _mm_s(PLATEAU * vs)}
            said += _lost([n for n in ("coulomb", "viscous") if n in theta], "no_plateau", **at, **span)
        if low <= 0.0:
            said += _lost(curve, "far_below", **span)
        if not np.isfinite(high):
            said += _lost(["stribeck_velocity"], "far_above", **span)
        if not np.isfinite(intervals["breakaway"][1]):
            said += _lost(["breakaway"], "too_fast", level=_mm_s(0.5 * vs), **span)
    said += _lost(np.array(names)[weak_coordinates(found.jacobian)].tolist(), "weak")
    for name, (lower, upper) in intervals.items():
        open_below = name in {"stribeck_velocity", "stribeck_exponent"} and lower <= 0.0
        if open_below or not np.isfinite([lower, upper]).all():
            said += _lost([name], "open")
    first = {one.parameter: one for one in reversed(said)}
    return [first[n] for n in names if n in first]


def without_support(found: RobustEstimate, intervals: NamedIntervals) -> tuple[FrictionModel, list[Undetermined]]:
    """Return the law without a part that the data do not support, or the law itself if all parts are supported."""
    from scipy.special import fdtrc

    model, data = found.model, found.data
    span, fastest = _span(data), float(data.speed_m_s.max())
    if model.stribeck and found.dof > 0:  # F-test against the law without Stribeck part, on the same pseudo-values
        without = found.pseudo_fit(model.without_stribeck())
        extra = len(model.names) - len(without.model.names)
        gain = np.sum(without.residual**2) - found.pseudo_cost
        p = float(fdtrc(extra, found.dof, max(gain, 0.0) / extra / found.variance))
        if p > CHANCE:
            names = _curve_names(model) + [f"breakaway_{c}" for c in "ab" if c in "".join(model.chambers)]
            return without.model, _lost(names, "no_fall", p=p, **span)
    if model.stribeck or not model.viscous:
        return model, []
    smaller = replace(model, viscous=False)
    if not changed(data.speed_m_s):
        return smaller, _lost(["viscous"], "same_speeds", mean=_mm_s(float(data.speed_m_s.mean())))
    typical = np.median(np.abs(data.friction_n))
    reach = fastest * (intervals["viscous"][1] - max(intervals["viscous"][0], 0.0))
    beyond = _mm_s(3.0 * fastest)
    if found.active[model.names.index("viscous")] and reach < 1e-3 * typical:
        return smaller, _lost(["viscous"], "falls", beyond=beyond, **span)
    if reach > VISCOUS_REACH * typical:
        sizes = {"reach": plain(reach, 2), "typical": plain(typical, 2)}
        return smaller, _lost(["viscous"], "anything", beyond=beyond, **sizes, **span)
    return model, []


#: Candidate knees, as multiples of the largest gauge pressure. Above 4, the curve is nearly a straight line (within 20
#: % of its final value); below 0.1, it is nearly a step.
KNEES = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0)

#: Factors of further knees between the best knee and its neighbours.
FINER = np.geomspace(0.6, 1.0 / 0.6, 9)
#: Candidate shapes: exponent of the Stribeck curve (0.5 to 2 in the literature [armstrong1994]), and whether
#: Lorentzian.
SHAPES = ((0.5, False), (1.0, False), (2.0, False), (2.0, True))
#: Factors of knees about the best one. Intervals are joined over the knees that the data allow.
NEIGHBOURS = np.geomspace(1.0, 40.0, 61)[1:]


def _largest_gauge(data: Observations) -> float:
    return float(np.abs(data.gauges_pa).max())


def with_knee(model: FrictionModel, data: Observations) -> FrictionModel:
    """Choose the most likely of a few knees of a saturating dependence on pressure."""
    if model.pressure != "saturating" or not model.chambers:
        return model
    top, starts, sizes = _largest_gauge(data), [], {}
    for share in KNEES[::-1]:  # beginning nearest to a straight line, each starts from the estimate before
        found = estimate(replace(model, knee_pa=share * top), data, starts=starts)
        starts, sizes[share] = [found.q], found.deviance
    for share in min(sizes, key=lambda one: sizes[one]) * FINER:
        if KNEES[0] <= share <= KNEES[-1]:
            found = estimate(replace(model, knee_pa=share * top), data, starts=starts)
            sizes.setdefault(share, found.deviance)
    return replace(model, knee_pa=min(sizes, key=lambda one: sizes[one]) * top)


def _joined(first: Interval, second: Interval) -> Interval:
    """Return the interval that contains two intervals."""
    return min(first[0], second[0]), max(first[1], second[1])


def interval_over_knees(found: RobustEstimate, quantile: float) -> NamedIntervals:
    """Return profile intervals over all knees that the data allow. Those at a single knee would be far too narrow."""
    out, model = profile_intervals(found, quantile), found.model
    if model.knee_pa is None:
        return out
    top, least = _largest_gauge(found.data), found.pseudo_cost
    for side in (NEIGHBOURS, 1.0 / NEIGHBOURS):
        for knee in model.knee_pa * side:
            if not KNEES[0] * top <= knee <= KNEES[-1] * top:
                break
            near = found.pseudo_fit(replace(model, knee_pa=float(knee)), [found.q])
            more = profile_intervals(near, quantile, least)
            if not more:
                break
            out = {name: _joined(ends, more[name]) for name, ends in out.items()}
    return out


def interval_over_shapes(found: RobustEstimate, intervals: NamedIntervals) -> NamedIntervals:
    """Return the intervals of the forces over all Stribeck shapes that fit as well as the chosen shape.

    The breakaway force depends on the unknown shape at low speed. At a single exponent, the intervals of the forces
    would be too narrow. Parameters of the shape keep their own intervals.
    """
    model, out = found.model, dict(intervals)
    if not model.stribeck or model.exponent is None:
        return out
    for exponent, lorentzian in SHAPES:
        if (exponent, lorentzian) != (model.exponent, model.lorentzian):
            near = found.pseudo_fit(replace(model, exponent=exponent, lorentzian=lorentzian))
            more = profile_intervals(near, student(found.dof), found.pseudo_cost)
            for name in (n for n in more if not n.startswith("stribeck_")):
                out[name] = _joined(out[name], more[name])
    return out
