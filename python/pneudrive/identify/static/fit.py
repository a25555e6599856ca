"""Fit a sliding friction law to a friction map."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.estimates import changed
from pneudrive.estimate.losses import LOSSES
from pneudrive.friction.pressure import CONFOUNDED
from pneudrive.identify.determined import SIMULATED
from pneudrive.identify.diagnose import choose_model, diagnose
from pneudrive.identify.static.assemble import assembled
from pneudrive.identify.static.model import PRESSURE_FORMS, STRIBECK_SHAPES, FrictionModel, Observations
from pneudrive.identify.static.model_selection import Support, interval_over_shapes, shrunk_to_the_data, with_knee
from pneudrive.identify.static.observations import observations

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    import xarray as xr

    from pneudrive.identify.static.result import FrictionFit

LAWS = ("coulomb", "stribeck")


def fit_friction(
    friction_map: xr.Dataset,
    law: str = "stribeck",
    *,
    pressure_dependence: bool = False,
    direction: int | None = None,
    stribeck_exponent: float | None = 2.0,
    stribeck_shape: str | None = None,
    any_shape: bool | None = None,
    pressure: str = "linear",
    viscous: bool = True,
    robust: bool = True,
    loss: str = "huber",
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
) -> FrictionFit:
    """Fit a sliding friction law to a friction map by weighted robust least squares.

    Parameters
    ----------
    friction_map : xarray.Dataset
        As returned by :func:`pneudrive.characterise`: one dimension ``row``, SI units.
    law : str
        ``coulomb`` (with a viscous part) or ``stribeck``.
    pressure_dependence : bool
        Whether Coulomb and breakaway force depend on the gauge pressure of each chamber, see `pressure`.
    direction : int or None
        None: friction of paired directions. +1 or -1: only that direction, from the force balance; the zero of the
        force is then part of the Coulomb force.
    stribeck_exponent : float or None
        Fixed exponent (2 is Gauss, 1 is Tustin's exponential), or None to fit it.
    stribeck_shape : str or None
        ``gaussian``, ``exponential``, ``lorentzian`` or ``free`` (exponent is fitted); None: by
        `stribeck_exponent`.
    any_shape : bool or None
        Whether the intervals of the forces cover all Stribeck shapes that fit as well. None: if `stribeck_shape` is not
        given.
    pressure : str
        With `pressure_dependence`: ``linear`` in the gauge pressures. ``quadratic``. ``saturating``, with g/(1 +
        g/knee) in place of each gauge pressure g and the most likely of a few knees. ``interaction``, with the product
        of both.
    viscous : bool
        False holds the viscous part at zero, for speeds that hardly differ.
    robust : bool
        True: a loss by which single outliers do not move the fit; False: plain least squares.
    loss : str
        With `robust`: ``huber``, ``soft-l1`` or ``tukey`` (gives far outliers no weight at all).
    ambient_pressure_pa : float or None
        Reference of gauge pressures; None takes ``friction_map.attrs["ambient_pressure_pa"]``. Needed only with
        `pressure_dependence`.
    exclude_flags : collection of str
        Rows with any of these flags are left out.

    Returns
    -------
    FrictionFit
        Estimates, covariance, 95 % intervals, undetermined parameters.

    Raises
    ------
    FitError
        The law is unknown, the map lacks columns, or no usable rows remain.

    Notes
    -----
    Rows are weighted by their statistical standard error. Its common scale is estimated from the residuals, so that
    intervals are also valid if the stated errors are too small by a factor. Intervals use Student's t. For the Stribeck
    velocity and the breakaway force, they use the profile likelihood, because these are far from symmetric. Systematic
    uncertainty, shared by all rows, is given separately for each parameter (`FrictionFit.systematic`). Methods:
    [huber2009], [bates1988], [smyth2004], [paule1982].
    """
    known = ((law, LAWS, "sliding law"), (pressure, PRESSURE_FORMS, "dependence on pressure"), (loss, LOSSES, "loss"))
    for given, names, what in (*known, (stribeck_shape or "free", STRIBECK_SHAPES, "Stribeck shape")):
        if given not in names:
            raise FitError(f"there is no {what} {given!r}", remedy=nearest(str(given), names))
    if stribeck_exponent is not None and not 0.0 < stribeck_exponent < np.inf:
        raise FitError("the Stribeck exponent must be positive", value=f"stribeck_exponent = {stribeck_exponent}")
    if direction not in (None, 1, -1):
        raise FitError("direction must be None, +1 or -1", value=f"direction = {direction!r}")
    if law == "coulomb" and stribeck_shape is not None:
        raise FitError(
            "law 'coulomb' has no Stribeck curve", value=f"stribeck_shape = {stribeck_shape!r}", remedy="law='stribeck'"
        )
    fixed = {None: stribeck_exponent, "gaussian": 2.0, "exponential": 1.0, "free": None, "lorentzian": 2.0}
    ambient = ambient_of(friction_map, ambient_pressure_pa, pressure_dependence)
    data, notes = observations(
        friction_map, direction=direction, ambient_pressure_pa=ambient, exclude_flags=exclude_flags
    )
    notes = [*notes, *simulated(friction_map)]
    form = pressure if pressure_dependence else None
    lorentzian = stribeck_shape == "lorentzian"
    is_open = stribeck_shape is None if any_shape is None else any_shape
    wanted = FrictionModel(law, fixed[stribeck_shape], viscous=viscous, lorentzian=lorentzian)
    options = {
        "direction": "both" if direction is None else f"{direction:+d}",
        "robust": robust,
        "pressure_dependence": pressure_dependence,
        "ambient_pressure_pa": ambient,
        "exclude_flags": sorted(exclude_flags),
        "recordings": recordings_of(friction_map),
    }
    used = loss if robust else "linear"
    return fit_values(wanted, data, pressure=form, loss=used, any_shape=is_open, notes=notes, options=options)


def fit_values(
    wanted: FrictionModel,
    data: Observations,
    *,
    pressure: str | None = None,
    loss: str = "huber",
    any_shape: bool = False,
    notes: Sequence[str] = (),
    options: Mapping[str, object] | None = None,
) -> FrictionFit:
    """Fit a law to selected values; see :func:`fit_friction`, which selects them.

    Parameters
    ----------
    wanted : FrictionModel
        Law; this function adds chambers and removes parts with too few values.
    data : Observations
    pressure : str or None
        Dependence on pressure, one of ``PRESSURE_FORMS``; None for none.
    loss : str
        ``linear`` or a name in ``robust.LOSSES``.
    any_shape : bool
        Intervals of the forces cover all Stribeck shapes that fit as well.
    notes, options
        Added to the result and to its provenance.
    """
    said = [*notes, *_confounding(data, pressure is not None)]
    model, lost = choose_model(wanted, data, pressure=pressure)
    support = shrunk_to_the_data(with_knee(model, data, loss), data, loss)
    lost += support.lost + diagnose(support.model, support.data, support.found, support.intervals)
    said += _remarks(support)
    support = replace(support, intervals=interval_over_shapes(support)) if any_shape else support
    provenance = {"version": __version__, "map_sha256": fingerprint(data), "loss": loss, **_ranges(data)}
    provenance |= options or {}
    fit = assembled(wanted.law, support, lost, said, provenance)
    return replace(fit, notes=(*fit.notes, *fit.correlated()))


#: Largest number of listed recordings; more are given by their number, the first and the last one.
MOST_RECORDINGS = 50


def recordings_of(friction_map: xr.Dataset) -> list[str]:
    """Return the names of the recordings of a map."""
    if "recording" not in friction_map:
        return []
    names = list(dict.fromkeys(str(name) for name in friction_map["recording"].to_numpy()))
    return names if len(names) <= MOST_RECORDINGS else [f"{len(names)} recordings from {names[0]} to {names[-1]}"]


def simulated(friction_map: xr.Dataset) -> list[str]:
    """Return a note if the map is known to be of simulated recordings."""
    return [SIMULATED] if friction_map.attrs.get("synthetic", False) else []


def _ranges(data: Observations) -> dict[str, object]:
    """Return the lowest and highest speed and gauge pressures, outside which the fit is an extrapolation."""
    columns = {"speed_m_s": data.speed_m_s, "gauge_a_pa": data.gauge_a_pa, "gauge_b_pa": data.gauge_b_pa}
    return {name: [float(values.min()), float(values.max())] for name, values in columns.items() if values.size}


def _remarks(support: Support) -> list[str]:
    said = []
    if support.scatter_n > 0.0:
        said.append(
            f"the levels scatter by {support.scatter_n:.2g} N more than their standard errors (runs differ, or the "
            "law does not hold); weights and intervals include this scatter"
        )
    if len(support.data) == len(support.model.names):
        said.append(
            "as many values as parameters: the intervals depend only on the stated standard errors, and a further run "
            "may lie far outside them"
        )
    if np.isfinite(support.found.rival):
        said.append(
            f"another estimate, with a Stribeck velocity of {1e3 * support.found.rival:.3g} mm/s, fits almost as well: "
            "the intervals cover both"
        )
    return said


def fit_directions(friction_map: xr.Dataset, law: str = "stribeck", **options: object) -> dict[int, FrictionFit]:
    """Fit each direction separately: {+1: fit, -1: fit}; options as for :func:`fit_friction`.

    Friction of lip seals differs by 10 to 40 % between directions. An error of the force's zero or of the area has the
    same effect: it increases one Coulomb force and decreases the other. Only a fit of pairs of both directions avoids
    this error.
    """
    return {d: fit_friction(friction_map, law, direction=d, **options) for d in (1, -1)}  # type: ignore[arg-type]


def fingerprint(data: Observations) -> str:
    """Return the SHA-256 of the values of the fit."""
    import hashlib

    columns = (data.speed_m_s, data.friction_n, data.stderr_n, data.gauge_a_pa, data.gauge_b_pa)
    return hashlib.sha256(np.ascontiguousarray(np.stack(columns), dtype="<f8").tobytes()).hexdigest()


def ambient_of(friction_map: xr.Dataset, given: float | None, needed: bool) -> float:
    """Return the ambient pressure as reference of gauge pressures, Pa; 0 if it is unknown and not needed."""
    value = given if given is not None else friction_map.attrs.get("ambient_pressure_pa")
    if value is None:
        if needed:
            raise FitError(
                "the friction map has no ambient pressure",
                rule="pressure_dependence needs gauge pressures",
                remedy="Pass ambient_pressure_pa, for example 101300.0.",
            )
        return 0.0
    if not np.isfinite(value) or value <= 0.0:
        raise FitError("the ambient pressure must be positive", value=f"ambient_pressure_pa = {value}")
    return float(value)


def _confounding(data: Observations, pressure_dependence: bool) -> list[str]:
    notes = []
    pressure = data.gauge_a_pa + data.gauge_b_pa
    if len(data) < 3 or np.ptp(pressure) < 1e4:
        return notes
    if not pressure_dependence:
        span = 1e-5 * np.ptp(pressure)
        notes.append(
            f"the chamber pressures of the rows differ by {span:.2g} bar in sum, and the fit averages over them; "
            "fit with pressure_dependence or select rows of one pressure"
        )
    if changed(data.speed_m_s):
        correlation = float(np.corrcoef(np.log(data.speed_m_s), pressure)[0, 1])
        if abs(correlation) > CONFOUNDED:
            notes.append(
                f"speed and pressure change together over the rows (correlation {correlation:+.2f}): "
                "the fit may attribute an effect of pressure to speed, and the other way round"
            )
    return notes
