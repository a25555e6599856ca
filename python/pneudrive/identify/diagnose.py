"""What a friction map can and cannot determine, in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import changed
from pneudrive.errors import FitError
from pneudrive.estimate.information import weak_coordinates
from pneudrive.identify.base import Undetermined
from pneudrive.identify.levels import distinct_levels
from pneudrive.numbers import plain

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.model import FrictionModel, Observations
    from pneudrive.identify.robust import RobustEstimate

    Array = NDArray[np.float64]

#: Gauge pressures that differ by less are one level: about 0.5 % of a 10 bar transducer.
SAME_PRESSURE_PA = 5e3
#: Without a level below this multiple of vs the data see only the tail of the Stribeck curve, in which a larger
#: Fs and a smaller vs look alike (at 2 vs the tail is exp(-4) = 2 % of the excess).
TAIL = 2.0
#: Without a level above this multiple of vs the plateau Fc + Fv v is never reached; 2.8 vs is the support point of
#: the optimal design of four speeds.
PLATEAU = 2.8
#: A falling part that chance makes this often is not there.
CHANCE = 0.05
#: A viscous part whose interval spans more than this share of all friction is not told from the Coulomb force.
VISCOUS_REACH = 0.5
#: Speeds that a sentence lists before it stops.
MOST_SPEEDS = 6


def _mm_s(speed: float) -> str:
    return f"{1e3 * speed:.3g} mm/s"


def _listed(levels: list[tuple[float, float]]) -> str:
    """Speed levels in words, each once, the first six of them."""
    shown = [
        _mm_s(low) if _mm_s(low) == _mm_s(high) else f"{1e3 * low:.3g} to {_mm_s(high)}"
        for low, high in levels[:MOST_SPEEDS]
    ]
    return ", ".join(shown) + (", ..." if len(levels) > MOST_SPEEDS else "")


def choose_model(
    wanted: FrictionModel, data: Observations, *, pressure: str | None
) -> tuple[FrictionModel, list[Undetermined]]:
    """Choose the largest part of the law whose parameters these rows can determine in number; say what is left out.

    Parameters
    ----------
    wanted : FrictionModel
        The law, without chambers.
    data : Observations
    pressure : str or None
        Wanted dependence on pressure, one of ``PRESSURE_FORMS``.
    """
    model, lost = (wanted, []) if pressure is None else _with_pressure(wanted, data, pressure)
    model, statements = _with_enough_speeds(model, data, len(model.terms))
    if statements:
        lost = [s for s in lost if not s.parameter.startswith("breakaway_")] + statements
        if pressure is not None:
            first = statements[0]
            lost += [Undetermined(f"breakaway_{c}", first.reason, first.remedy) for c in "ab"]
    levels = distinct_levels(data.speed_m_s)
    if not wanted.viscous:
        reason = "it was held at zero; what is called coulomb here is all the friction at the speeds of the map"
        lost.append(Undetermined("viscous", reason, "measure at speeds that differ by a factor of three or more"))
    elif len(levels) < 2 or len(data) < len(model.names):
        reason = f"all rows lie at one speed ({_listed(levels)})"
        if len(levels) >= 2:
            reason = f"the map has {len(data)} independent values, fewer than the law has parameters"
        reason += "; what is called coulomb here is all the friction at " + (
            "that speed" if len(levels) < 2 else "its speeds"
        )
        lost.append(Undetermined("viscous", reason, "measure at a second speed, at least three times higher"))
        model = replace(model, viscous=False)
    if len(data) < len(model.names):
        raise FitError(
            "the friction map has fewer values than the law has parameters",
            value=f"{len(data)} values, {len(model.names)} parameters ({', '.join(model.names)})",
            remedy="measure more speeds and pressures, or fit law='coulomb' without pressure dependence",
        )
    return model, lost


def _with_enough_speeds(
    model: FrictionModel, data: Observations, terms: int
) -> tuple[FrictionModel, list[Undetermined]]:
    """Leave the Stribeck part out where there are fewer speeds or values than it has parameters."""
    grouped = distinct_levels(data.speed_m_s)
    levels, free = len(grouped), model.exponent is None
    needed = 5 if free else 4
    if not model.stribeck or (levels >= needed and len(data) >= needed + 2 * terms):
        return model, []
    count = f"{levels} distinct speed{'s' * (levels != 1)} ({_listed(grouped)})"
    reason = f"the map has {count} and a Stribeck curve needs at least {needed}"
    if levels >= needed:
        reason = f"the map has {len(data)} independent values, fewer than the law has parameters"
    remedy = "measure at least 8 speeds, spaced logarithmically from 1 mm/s to the largest"
    names = ["breakaway", "stribeck_velocity"] + ["stribeck_exponent"] * free
    return model.without_stribeck(), [Undetermined(name, reason, remedy) for name in names]


def _with_pressure(
    wanted: FrictionModel, data: Observations, pressure: str
) -> tuple[FrictionModel, list[Undetermined]]:
    """Add what of the dependence on pressure the levels can carry."""
    chambers, lost = _chambers(data, wanted.law)
    forces = ("coulomb", "breakaway") if wanted.stribeck else ("coulomb",)
    gauges = {"a": data.gauge_a_pa, "b": data.gauge_b_pa}
    if pressure in ("quadratic", "saturating"):
        few = [c for c in "ab" if any(c in chamber for chamber in chambers) and _levels(gauges[c]) < 3]
        if few:
            reason = f"chamber {few[0]} was measured at fewer than three pressures, which carry no more than a line"
            remedy = "measure at three or more pressures, spread over the range"
            lost += [Undetermined(f"{f}_curve_{c}", reason, remedy) for f in forces for c in few]
            pressure = "linear"
    if pressure == "interaction" and (chambers != ("a", "b") or not _crossed(data)):
        reason = "the two chambers' pressures were not varied independently of each other"
        remedy = "measure a grid: both chambers at 0, 2, 4 and 6 bar gauge in all combinations"
        lost += [Undetermined(f"{f}_product", reason, remedy) for f in forces]
        pressure = "linear"
    return replace(wanted, chambers=chambers, pressure=pressure), lost


def _levels(gauge: Array) -> int:
    return int(np.sum(np.diff(np.sort(gauge)) > SAME_PRESSURE_PA)) + 1


def _crossed(data: Observations) -> bool:
    """Whether the product of both pressures is no combination of the pressures themselves."""
    a, b = data.gauge_a_pa / 1e5, data.gauge_b_pa / 1e5
    base = np.column_stack([np.ones_like(a), a, b])
    rest = a * b - base @ np.linalg.lstsq(base, a * b, rcond=None)[0]
    return bool(np.std(rest) > 1e-3 * np.std(a * b))


def _chambers(data: Observations, law: str) -> tuple[tuple[str, ...], list[Undetermined]]:
    """Chambers whose slopes can be found, and statements on those that cannot."""
    gauges = {"a": data.gauge_a_pa, "b": data.gauge_b_pa}
    varying = tuple(c for c, g in gauges.items() if np.ptp(g) > SAME_PRESSURE_PA)
    forces = ("coulomb", "breakaway") if law == "stribeck" else ("coulomb",)
    lost = []
    for c in gauges:
        if c not in varying:
            reason = f"the pressure in chamber {c} is the same in all rows ({1e-5 * gauges[c].mean():.3g} bar gauge)"
            remedy = f"measure with chamber {c} at two or more pressures at least 1 bar apart"
            lost += [Undetermined(f"{f}_{c}", reason, remedy) for f in forces]
    if len(varying) == 2 and _collinear(data.gauge_a_pa, data.gauge_b_pa):
        reason = (
            "both chambers always had the same pressure: only the sum of both slopes is known, "
            "half of it is given to each"
        )
        remedy = "measure with different pressures in the chambers, such as a grid of 0, 2, 4 and 6 bar gauge"
        lost += [Undetermined(f"{f}_{c}", reason, remedy) for f in forces for c in "ab"]
        return ("ab",), lost
    return varying, lost


def _collinear(a: Array, b: Array) -> bool:
    slope, intercept = np.polyfit(a, b, 1)
    return bool(np.std(b - slope * a - intercept) < 0.5 * SAME_PRESSURE_PA)


def diagnose(
    model: FrictionModel,
    data: Observations,
    found: RobustEstimate,
    intervals: dict[str, tuple[float, float]],
) -> list[Undetermined]:
    """Statements on parameters that were free but that the data do not bound.

    Parameters
    ----------
    model, data, found, intervals
        As of the fit.
    """
    statements: dict[str, Undetermined] = {}
    theta = dict(zip(model.names, model.natural(found.q), strict=True))
    if model.stribeck:
        for statement in _stribeck(theta, data, intervals):
            statements.setdefault(statement.parameter, statement)
    for name in np.array(model.names)[weak_coordinates(found.jacobian)].tolist():
        statements.setdefault(
            name,
            Undetermined(
                name,
                "the rows do not tell it from the other parameters (a direction of the scaled Jacobian vanishes)",
                "measure at more speeds and pressures, not all varied together",
            ),
        )
    for name, (lower, upper) in intervals.items():
        open_below = name in {"stribeck_velocity", "stribeck_exponent"} and lower <= 0.0
        if open_below or not np.isfinite([lower, upper]).all():
            statements.setdefault(
                name,
                Undetermined(
                    name, "its 95 % interval is open", "measure where the law depends on it, with smaller noise"
                ),
            )
    return [statements[n] for n in model.names if n in statements]


def without_support(
    model: FrictionModel,
    data: Observations,
    found: RobustEstimate,
    intervals: dict[str, tuple[float, float]],
    excess_p_value: float | None,
) -> tuple[FrictionModel, list[Undetermined]]:
    """Take a part out of the law that the values do not support; returns `model` itself where they support all of it.

    Parameters
    ----------
    model, data, found, intervals
        As of the fit.
    excess_p_value : float or None
        Probability of a Stribeck part as large as the one found where there is none.
    """
    slowest, fastest = float(data.speed_m_s.min()), float(data.speed_m_s.max())
    if model.stribeck and excess_p_value is not None and excess_p_value > CHANCE:
        reason = (
            f"friction does not fall with speed by more than chance between {_mm_s(slowest)} and {_mm_s(fastest)} "
            f"(a falling part improves the fit with p = {excess_p_value:.2g})"
        )
        remedy = (
            f"add levels well below {_mm_s(slowest)} and well above {_mm_s(fastest)}, "
            "and repeat strokes to lower the noise"
        )
        names = ["breakaway", "stribeck_velocity"] + ["stribeck_exponent"] * (model.exponent is None)
        names += [f"breakaway_{c}" for c in ("a", "b") if any(c in chamber for chamber in model.chambers)]
        smaller = model.without_stribeck()
        return smaller, [Undetermined(n, reason, remedy) for n in names]
    if model.viscous and not model.stribeck and not changed(data.speed_m_s):
        reason = (
            f"all speeds are about {_mm_s(float(data.speed_m_s.mean()))}, and one speed tells nothing of how friction "
            "depends on it; what is called coulomb here is all the friction at this speed"
        )
        return replace(model, viscous=False), [Undetermined("viscous", reason, "add levels at other speeds")]
    if model.viscous and not model.stribeck:
        typical = float(np.median(np.abs(data.friction_n)))
        reach = fastest * (intervals["viscous"][1] - max(intervals["viscous"][0], 0.0))
        smaller = replace(model, viscous=False)
        if found.active[model.names.index("viscous")] and reach < 1e-3 * typical:
            reason = (
                f"friction falls with speed between {_mm_s(slowest)} and {_mm_s(fastest)}, which no viscous part does; "
                "what is called coulomb here is the mean friction at these speeds"
            )
            remedy = (
                f"add levels below {_mm_s(slowest)} and above {_mm_s(3.0 * fastest)}, for a law with a Stribeck part"
            )
            return smaller, [Undetermined("viscous", reason, remedy)]
        if reach > VISCOUS_REACH * typical:
            reason = (
                f"between {_mm_s(slowest)} and {_mm_s(fastest)} it could be anything up to {plain(reach, 2)} N, where "
                f"{plain(typical, 2)} N were measured; what is called coulomb here is all the friction at these speeds"
            )
            return smaller, [Undetermined("viscous", reason, f"add levels above {_mm_s(3.0 * fastest)}")]
    return model, []


def _stribeck(
    theta: dict[str, float], data: Observations, intervals: dict[str, tuple[float, float]]
) -> list[Undetermined]:
    slowest, fastest = float(data.speed_m_s.min()), float(data.speed_m_s.max())
    vs = theta["stribeck_velocity"]
    out = []
    if slowest > TAIL * vs:
        reason = (
            f"the slowest level, {_mm_s(slowest)}, lies above {TAIL:g} vs (vs is near {_mm_s(vs)}): "
            "a larger Fs with a smaller vs fits as well"
        )
        out += [
            Undetermined(n, reason, f"add levels at and below {_mm_s(vs)}") for n in ("breakaway", "stribeck_velocity")
        ]
    if fastest < PLATEAU * vs:
        reason = (
            f"the fastest level, {_mm_s(fastest)}, lies below {PLATEAU:g} vs (vs is near {_mm_s(vs)}): "
            "the plateau above the Stribeck part is not reached"
        )
        remedy = f"add levels above {_mm_s(PLATEAU * vs)}"
        out += [Undetermined(n, reason, remedy) for n in ("coulomb", "viscous") if n in theta]
    lower, upper = intervals["stribeck_velocity"]
    if lower <= 0.0:
        reason = f"a Stribeck velocity far below the slowest level, {_mm_s(slowest)}, fits as well"
        remedy = f"add levels below {_mm_s(slowest)}"
        out += [Undetermined(n, reason, remedy) for n in ("breakaway", "stribeck_velocity")]
    if not np.isfinite(upper):
        reason = f"a Stribeck velocity far above the fastest level, {_mm_s(fastest)}, fits as well"
        out.append(Undetermined("stribeck_velocity", reason, f"add levels above {_mm_s(fastest)}"))
    if not np.isfinite(intervals["breakaway"][1]):
        reason = f"the slowest level, {_mm_s(slowest)}, is too fast to see the limit of friction at zero speed"
        out.append(Undetermined("breakaway", reason, f"add levels below {_mm_s(0.5 * vs)}"))
    return out
