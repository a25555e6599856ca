"""Fits of friction laws to friction maps.

`fit_friction` is for laws that are linear in their forces. It gives profile intervals, and fits only the part of the
law that the data determine. `fit_any_law` needs only the bounds of a law. It searches from several
starts. Its intervals are first order in the logarithm of positive parameters. Parameters without effect on steady
sliding keep their given values.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pneudrive import __version__
from pneudrive.arrays import Array, Interval, NamedIntervals, by_name
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.autocorrelation import distinct_levels, weak_coordinates
from pneudrive.estimate.estimates import changed, intervals, profile_interval, student
from pneudrive.friction.characterisation import CONFOUNDED, MINIMUM_RANGE_PA
from pneudrive.friction.friction_map import ALL_RECORDINGS, assemblies_of
from pneudrive.identify.identified import sentence
from pneudrive.identify.static import diagnose as selection
from pneudrive.identify.static import model as sliding
from pneudrive.identify.static.result import LAWS, FrictionFit, LawFit
from pneudrive.identify.static.robust import RobustEstimate, estimate, estimated

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    import xarray as xr

    from pneudrive.describe.tables.friction import Friction
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.base import Undetermined


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
        product of both.
    viscous : bool
        Whether to fit a viscous part. False holds it at zero; use this for nearly equal speeds.
    exclude_flags : collection of str
        Rows with any of these flags are left out; by default those of stick-slip.

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
    residuals, so that intervals stay valid if the stated errors are too small by a factor. Intervals use Student's t.
    The intervals of Stribeck velocity and breakaway force use the profile likelihood, because they are far from
    symmetric. Intervals of forces cover all Stribeck shapes that fit equally well. All rows share the systematic
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


def fit_values(
    wanted: sliding.FrictionModel,
    data: sliding.Observations,
    *,
    pressure: str | None,
    notes: Sequence[str] = (),
    options: Mapping[str, object],
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
    model, lost = selection.choose_model(wanted, data, pressure=pressure)
    model = selection.with_knee(model, data)
    while True:  # without unsupported parts, which would only widen the intervals of the other parameters
        found = estimated(model, data)
        intervals = selection.interval_over_knees(found, student(found.dof))
        smaller, unsupported = selection.without_support(found, intervals)
        if smaller == model:
            break
        model, lost = smaller, lost + unsupported
    intervals = selection.interval_over_shapes(found, intervals)
    lost += selection.diagnose(found, intervals)
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
    provenance = {"version": __version__, "map_sha256": sliding.fingerprint(data), **_ranges(data), **options}
    fit = assembled(wanted.law, found, intervals, lost, said, provenance)
    return replace(fit, notes=(*fit.notes, *fit.correlated()))


def _ranges(data: sliding.Observations) -> dict[str, list[float]]:
    """Return the speeds, and the ranges of speed and gauge pressures. Outside these ranges, the fit extrapolates."""
    columns = {"speed_m_s": data.speed_m_s, "gauge_a_pa": data.gauge_a_pa, "gauge_b_pa": data.gauge_b_pa}
    ends = {name: [float(values.min()), float(values.max())] for name, values in columns.items()}
    return ends | {"speed_levels_m_s": [low for low, _ in distinct_levels(data.speed_m_s)]}


def assembled(
    law: str,
    found: RobustEstimate,
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
    found = estimate(model, data)
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
        provenance={"version": __version__, "map_sha256": sliding.fingerprint(data), **_ranges(data)} | provenance,
        observations=data,
        profiler=partial(_profile, found),
    )


def _profile(found: RobustEstimate, name: str) -> Interval:
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
