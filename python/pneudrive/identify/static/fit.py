"""Fits of friction laws to friction maps.

`fit_friction` is for laws that are linear in their forces. It gives profile intervals, and fits only the part of the
law that the data determine. `fit_any_law` needs only the bounds of a law, and searches from several starts. The
intervals of `fit_any_law` are first order in the logarithm of positive parameters. Parameters without effect on steady
sliding keep their given values.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pneudrive import __version__
from pneudrive.arrays import Array, Interval, NamedIntervals, Plain, by_name
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.autocorrelation import distinct_levels, projection, weak_coordinates
from pneudrive.estimate.estimates import CHANCE, changed, intervals, profile_interval, student
from pneudrive.friction.characterisation import CONFOUNDED, MINIMUM_RANGE_PA
from pneudrive.friction.friction_map import ALL_RECORDINGS, assemblies_of
from pneudrive.identify.base import Undetermined
from pneudrive.identify.identified import sentence, stated
from pneudrive.identify.static import model as sliding
from pneudrive.identify.static import robust
from pneudrive.identify.static.result import LAWS, FrictionFit, LawFit
from pneudrive.numbers import plain

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    import xarray as xr

    from pneudrive.describe.tables.friction import Friction
    from pneudrive.friction.characterisation import Characterisation


#: Group -> law -> fit.
GroupFits: TypeAlias = dict[str, dict[str, FrictionFit]]


def fit_friction(
    friction_map: sliding.AnyMap,
    law: str = "stribeck",
    *,
    pressure_dependence: bool = False,
    direction: int | None = None,
    pressure: str = "linear",
    viscous: bool = True,
    exclude_flags: Collection[str] = sliding.NOT_SLIDING,
) -> FrictionFit:
    """Fit a sliding friction law to a friction map by weighted robust least squares.

    Parameters
    ----------
    friction_map : xarray.Dataset, path-like or Characterisation
        Map in the form of :func:`pneudrive.characterise` (one dimension ``row``, SI), its file, or a result with a map.
    law : str
        ``coulomb`` (with a viscous part), ``stribeck`` (Gaussian), or with a shape: ``stribeck exponential``,
        ``stribeck lorentzian`` or ``stribeck free`` (the exponent is fitted).
    pressure_dependence : bool
        Whether Coulomb and breakaway force depend on the gauge pressure of each chamber, see `pressure`.
    direction : int or None
        None: friction of paired directions. +1 or -1: only that direction, from the force balance; the Coulomb force
        then contains the zero error of the force sensor.
    pressure : str
        Form of `pressure_dependence`: ``linear`` in the gauge pressures; ``quadratic``; ``saturating``, with g/(1 +
        g/knee) instead of each gauge pressure g and the most likely of a few knees; or ``interaction``, with the
        product of both gauge pressures.
    viscous : bool
        Whether to fit a viscous part. False holds it at zero; use this for nearly equal speeds.
    exclude_flags : collection of str
        Rows with any of these flags are left out; by default rows with stick-slip.

    Returns
    -------
    FrictionFit
        Estimates, covariance, 95 % intervals, undetermined parameters.

    Raises
    ------
    FitError
        The law is unknown, a column of the map is missing, or no usable rows remain.

    Notes
    -----
    Rows are weighted by their statistical standard error. A common scale of these errors is estimated from the
    residuals, so that intervals stay valid if all stated errors are too small by one factor. Intervals use Student's t.
    The intervals of Stribeck velocity and breakaway force are far from symmetric, and therefore use the profile
    likelihood. Intervals of forces cover all Stribeck shapes that fit equally well. All rows share the systematic
    uncertainty, which is given separately for each parameter (`FrictionFit.systematic`). Methods: [huber2009],
    [bates1988], [smyth2004], [paule1982].
    """
    forms = sliding.PRESSURE_FORMS
    for given, names, what in ((law, sliding.NAMES, "sliding law"), (pressure, forms, "dependence on pressure")):
        if given not in names:
            raise FitError(f"there is no {what} {given!r}", remedy=nearest(str(given), names))
    if direction not in (None, 1, -1):
        raise FitError("direction must be None, +1 or -1", value=f"direction = {direction!r}")
    data, notes, provenance = sliding.selected(
        friction_map, direction, exclude_flags, needs_ambient=pressure_dependence
    )
    form = pressure if pressure_dependence else None
    wanted = replace(sliding.CANDIDATES[sliding.NAMES[law]], viscous=viscous)
    options = {"pressure_dependence": pressure_dependence} | provenance
    return fit_values(wanted, data, pressure=form, notes=notes, options=options)


# --- Model selection: the part of a law that a friction map supports, and statements on the unsupported parts.

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


def _span(data: sliding.Observations) -> dict[str, str]:
    """Return the slowest and the fastest speed level as text."""
    return {"slowest": _mm_s(float(data.speed_m_s.min())), "fastest": _mm_s(float(data.speed_m_s.max()))}


def _listed(levels: list[Interval]) -> str:
    """Return the first six distinct speed levels as text."""
    shown = [
        _mm_s(low) if _mm_s(low) == _mm_s(high) else f"{1e3 * low:.3g} to {_mm_s(high)}"
        for low, high in levels[:MOST_SPEEDS]
    ]
    return ", ".join(shown) + (", ..." if len(levels) > MOST_SPEEDS else "")


def choose_model(
    wanted: sliding.FrictionModel, data: sliding.Observations, *, pressure: str | None
) -> tuple[sliding.FrictionModel, list[Undetermined]]:
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


def _curve_names(model: sliding.FrictionModel) -> list[str]:
    """Return the parameters of the Stribeck part."""
    return ["breakaway", "stribeck_velocity"] + ["stribeck_exponent"] * (model.exponent is None)


def _with_pressure(
    wanted: sliding.FrictionModel, data: sliding.Observations, pressure: str
) -> tuple[sliding.FrictionModel, list[Undetermined]]:
    """Add the part of the dependence on pressure that the measured pressure levels can determine."""
    forces = sliding.FORCES[: 1 + wanted.stribeck]
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


def diagnose(found: robust.RobustEstimate, intervals: NamedIntervals) -> list[Undetermined]:
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


def without_support(
    found: robust.RobustEstimate, intervals: NamedIntervals
) -> tuple[sliding.FrictionModel, list[Undetermined]]:
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


# --- Fits of selected values.


def fit_values(
    wanted: sliding.FrictionModel,
    data: sliding.Observations,
    *,
    pressure: str | None,
    notes: Sequence[str] = (),
    options: Plain,
) -> FrictionFit:
    """Fit a law to selected values; see :func:`fit_friction`, which selects them.

    Parameters
    ----------
    wanted : FrictionModel
        Law. The fit adds the dependence on chamber pressures, and removes parts that the data do not support.
    data : Observations
    pressure : str or None
        Dependence on pressure, one of ``PRESSURE_FORMS``; None: no dependence.
    notes, options
        Notes for the result, and options for its provenance.
    """
    model, lost = choose_model(wanted, data, pressure=pressure)
    model = robust.with_knee(model, data)
    while True:  # without unsupported parts, which would only widen the intervals of the other parameters
        found = robust.estimated(model, data)
        intervals = robust.interval_over_knees(found, student(found.dof))
        smaller, unsupported = without_support(found, intervals)
        if smaller == model:
            break
        model, lost = smaller, lost + unsupported
    intervals = robust.interval_over_shapes(found, intervals)
    lost += diagnose(found, intervals)
    said, total_pa = list(notes), data.gauge_a_pa + data.gauge_b_pa
    if len(data) >= 3 and np.ptp(total_pa) >= 1e4:
        if pressure is None:
            said.append(sentence("notes", "averaged", span=1e-5 * np.ptp(total_pa)))
        if changed(data.speed_m_s):
            correlation = np.corrcoef(np.log(data.speed_m_s), total_pa)[0, 1]
            if abs(correlation) > CONFOUNDED:
                said.append(sentence("notes", "confounded", correlation=correlation))
    if found.scatter_n > 0.0:
        said.append(sentence("notes", "scatter", scatter=found.scatter_n))
    if len(data) == len(model.names):
        said.append(sentence("notes", "no_freedom"))
    if np.isfinite(found.rival):
        said.append(sentence("notes", "rival", velocity=1e3 * found.rival))
    fit = assembled(wanted.law, found, intervals, lost, said, _provenance(data) | options)
    return replace(fit, notes=(*fit.notes, *fit.correlated()))


def _provenance(data: sliding.Observations) -> Plain:
    """Return version, hash of the values, speeds, and ranges of speed and gauge pressures.

    Outside these ranges, the fit extrapolates.
    """
    columns = {"speed_m_s": data.speed_m_s, "gauge_a_pa": data.gauge_a_pa, "gauge_b_pa": data.gauge_b_pa}
    ends = {name: [float(values.min()), float(values.max())] for name, values in columns.items()}
    levels = {"speed_levels_m_s": [low for low, _ in distinct_levels(data.speed_m_s)]}
    return {"version": __version__, "map_sha256": sliding.fingerprint(data)} | ends | levels


def assembled(
    law: str,
    found: robust.RobustEstimate,
    intervals: NamedIntervals,
    lost: list[Undetermined],
    notes: list[str],
    provenance: dict,
) -> FrictionFit:
    """Return the fit of an estimate: parameters in SI with covariance, intervals and statistics.

    The fit has a value for each parameter of the requested law, NaN if the data do not determine it.
    """
    model, theta = found.model, found.natural
    curve = ("breakaway", "stribeck_velocity", "stribeck_exponent") if law == "stribeck" else ()
    names = ("coulomb", *(curve[:2] if model.lorentzian else curve), "viscous")
    parameters = {name: theta.get(name, np.nan) for name in names}
    if "stribeck_exponent" in parameters and model.stribeck and model.exponent is not None:
        parameters["stribeck_exponent"] = float(model.exponent)
    for name in sliding.UNITS:
        if name in theta:
            parameters[name] = theta[name]
        elif f"{name}b" in theta:  # coulomb_ab -> both chambers
            parameters[name] = parameters[f"{name[:-1]}b"] = theta[f"{name}b"]
    return FrictionFit(
        law=law,
        values=parameters,
        units={n: sliding.unit_of(n) for n in (*parameters, *model.names)},
        free=model.names,
        covariance=found.covariance,
        intervals=intervals,
        systematic=found.systematic,
        undetermined=tuple(lost),
        notes=tuple(notes),
        statistics=found.statistics(),
        provenance=provenance,
        model=model,
        observations=found.data,
        weights=found.weight,
        profiler=intervals.__getitem__,
    )


#: Relative sensitivity of friction below which a parameter counts as without effect.
NO_EFFECT = 1e-9
#: Logarithmic distance from the estimate beyond which a side of a profile is open, as in the search.
FARTHEST_LOG = 14.0


def fit_any_law(
    friction_map: sliding.AnyMap,
    friction: Friction,
    free: Sequence[str] | None = None,
) -> LawFit:
    """Fit any friction law to the steady sliding friction of a map.

    Parameters
    ----------
    friction_map : xarray.Dataset, path-like or Characterisation
        As for :func:`fit_friction`.
    friction : Friction
        Built-in or custom law with guesses of its parameters. Its modifiers (pressure, direction) are not fitted.
    free : sequence of str, optional
        Parameters to fit. Default: all parameters with an effect on steady sliding.

    Returns
    -------
    LawFit
    """
    data, notes, provenance = sliding.selected(friction_map)
    known = tuple(friction.parameters)
    unknown = [n for n in free or () if n not in known]
    if unknown:
        raise FitError.of("identify.no_parameter", law=friction.law, name=unknown[0], known=", ".join(known))
    whole = _with_sizes(sliding.AnyLaw(friction, known), data)
    value, jac = whole.value_and_jacobian(whole.internal(whole.given), data)
    sizes = np.abs(jac).max(axis=0)
    seen = tuple(n for n, s in zip(known, sizes, strict=True) if s > NO_EFFECT * np.abs(value).max())
    model = _with_sizes(sliding.AnyLaw(friction, tuple(free) if free else seen), data)
    if not model.names:
        raise FitError("none of the free parameters has an effect on steady sliding", value=", ".join(free or known))
    if len(data) <= len(model.names):
        counts = f"{len(data)} values, {len(model.names)} parameters"
        raise FitError("the friction map has too few values for this law", value=counts)
    found = robust.estimate(model, data)
    matrix, theta = found.covariance, model.transforms.natural(found.q)
    reach = student(found.dof) * np.sqrt(np.diag(matrix))
    low, high = intervals(theta, reach, model.transforms.lower)
    lost = weak_coordinates(found.jacobian) | found.active
    return LawFit(
        model=model,
        values=found.natural,
        units={entry["key"]: entry["unit"] for entry in model.entries()},
        free=model.names,
        covariance=matrix,
        intervals=by_name(model.names, zip(low, high, strict=True)),
        systematic=found.systematic,
        undetermined=tuple(n for n, is_lost in zip(model.names, lost, strict=True) if is_lost),
        unseen=tuple(n for n in known if n not in seen),
        notes=tuple(notes),
        statistics=found.statistics(),
        provenance=_provenance(data) | provenance,
        observations=data,
        profiler=partial(_profile, found),
    )


def _profile(found: robust.RobustEstimate, name: str) -> Interval:
    """Return the interval of one parameter by profile likelihood, from the pseudo-values of the estimate."""
    model, theta = found.model, found.model.transforms.natural(found.q)
    k = model.names.index(name)
    is_positive = bool(model.positive[k])
    spread = float(np.sqrt(found.covariance[k, k]))
    reach, upper = student(found.dof), float(model.uppers[k])

    def natural(coordinate: float) -> float:
        return min(float(np.exp(coordinate)) if is_positive else coordinate, upper)

    def held(coordinate: float, start: Array) -> tuple[float, Array]:
        tried = model.without(name, natural(coordinate), start)
        q, data = tried.internal(tried.given), found.data
        if tried.names:
            q = found.pseudo_fit(tried, [q]).q
        cost = float(np.sum(((found.pseudo - tried.value(q, data)) / data.stderr_n) ** 2))
        return cost, np.insert(tried.transforms.natural(q), k, natural(coordinate))

    at, step = (np.log(theta[k]), spread / theta[k]) if is_positive else (float(theta[k]), spread)
    farthest = FARTHEST_LOG if is_positive else np.inf
    low, high = profile_interval(held, theta, at, reach * step, found.pseudo_cost, found.variance * reach**2, farthest)
    return natural(low), natural(high)


def _with_sizes(model: sliding.AnyLaw, data: sliding.Observations) -> sliding.AnyLaw:
    """Replace guesses of zero, which have no logarithm, by values that change friction by about 10 %."""
    start = model.given
    zero = model.positive & (start == 0.0)
    if not zero.any():
        return model
    q = model.internal(start)
    value, jac = model.value_and_jacobian(q, data)
    slope = np.abs(jac).max(axis=0) / np.diag(model.transforms.jacobian(q))
    sizes = 0.1 * np.median(np.abs(value)) / np.where(slope > 0.0, slope, np.inf)
    return replace(model, start=tuple(np.where(zero, np.minimum(sizes, 0.5 * model.uppers), start).tolist()))


def fit_characterisation(characterisation: Characterisation) -> tuple[GroupFits, list[str]]:
    """Fit laws to the friction map of a characterisation.

    Parameters
    ----------
    characterisation : Characterisation
        As returned by ``characterise_recordings``.

    Returns
    -------
    dict of dict of FrictionFit, list of str
        Group -> law -> fit, and notes on failed fits. Each assembly (mounting, seal, drive) is a separate group, or
        ``all recordings`` if there is only one. Friction may depend on pressure if the recordings have several
        pressures.
    """
    names = assemblies_of(characterisation.friction_map)
    names = names if len(set(names)) > 1 else [ALL_RECORDINGS] * len(names)
    return fit_groups(characterisation.friction_map, names)


def fit_file(group: str) -> str:
    """Return the file name of the fit of a group.

    Examples
    --------
    >>> fit_file("all recordings"), fit_file("NBR, mounting 2")
    ('fit.toml', 'fit-NBR-mounting-2.toml')
    """
    return "fit.toml" if group == ALL_RECORDINGS else f"fit-{re.sub(r'[^A-Za-z0-9._-]+', '-', group)}.toml"


def fit_groups(
    table: xr.Dataset, names: Sequence[str], exclude_flags: Sequence[str] = sliding.NOT_SLIDING
) -> tuple[GroupFits, list[str]]:
    """Fit each law to each group of rows of a map. Return group -> law -> fit, and notes on failed fits.

    Friction may depend on pressure if the group has several pressures.
    """
    fits: GroupFits = {}
    problems: list[str] = []
    for group in dict.fromkeys(names):
        part = table.isel(row=np.flatnonzero(np.array(names) == group))
        is_varied = any(float(np.ptp(part[f"pressure_{side}_pa"].to_numpy())) > MINIMUM_RANGE_PA for side in "ab")
        for law in LAWS:
            label = f"{group}, {law}"
            try:
                found = fit_friction(part, law, pressure_dependence=is_varied, exclude_flags=exclude_flags)
            except FitError as error:
                problems.append(f"{label}: {error.what}")
            else:
                fits.setdefault(group, {})[law] = found
    return fits, problems


def row_seals_and_runs(characterisation: Characterisation) -> tuple[list[str], list[str]]:
    """Return seal and run of each row of the friction map of a characterisation, for :func:`survey`."""
    table = characterisation.friction_map
    runs = table["run"].to_numpy().tolist() if "run" in table else [""] * table.sizes["row"]
    return assemblies_of(table), [run or "1" for run in runs]
