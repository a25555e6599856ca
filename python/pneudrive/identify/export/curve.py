"""The sliding friction that is exported: our curve over the measured speeds, and what it depends on beside speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.provenance import values
from pneudrive.errors import FitError
from pneudrive.identify.apply import identified
from pneudrive.identify.model import unit_of
from pneudrive.show import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.identify.result import FrictionFit

    Array = NDArray[np.float64]

#: Speeds at which a curve is taken, evenly in the logarithm.
POINTS = 400


@dataclass(frozen=True)
class Entry:
    """One value of ours, as the table has it; SI, NaN where there is no bound."""

    name: str
    value: float
    unit: str
    low: float
    high: float
    source: str
    note: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Curve(Shown):
    """Steady friction over speed at given pressures.

    Attributes
    ----------
    title : str
    law, shape : str
        Ours.
    speed_m_s, friction_n : ndarray, shape (n,)
        Ascending speeds, evenly in the logarithm.
    gauge_a_pa, gauge_b_pa : float
        Gauge pressures of the chambers that it holds at.
    entries : tuple of Entry
        Our parameters.
    lost : tuple of str
        What it depends on beside speed, which no other tool's law of friction over speed says.
    exponential : bool
        Whether our Stribeck curve is exp(-v/vs), or none.
    """

    title: str
    law: str
    shape: str
    speed_m_s: Array
    friction_n: Array
    gauge_a_pa: float
    gauge_b_pa: float
    entries: tuple[Entry, ...]
    lost: tuple[str, ...]
    exponential: bool


def _speeds(low: float, high: float) -> Array:
    if not 0.0 < low < high:
        raise FitError(
            f"no curve over speeds from {low:g} to {high:g} m/s",
            rule="0 < lowest < highest speed",
            remedy='say over which speeds it shall hold: --speeds "1 mm/s .. 500 mm/s"',
        )
    return np.geomspace(low, high, POINTS)


def _gauge(given: float | None, measured: object) -> float:
    """Return the pressure that is asked for, else the middle of the measured ones."""
    if given is None and isinstance(measured, list | tuple):
        return 0.5 * (float(measured[0]) + float(measured[1]))
    return given or 0.0


def curve_of_fit(
    fit: FrictionFit,
    gauge_a_pa: float | None = None,
    gauge_b_pa: float | None = None,
    speeds_m_s: tuple[float, float] | None = None,
) -> Curve:
    """Take the curve of a fit, at the middle of the measured pressures and over the measured speeds if nothing is said.

    Raises
    ------
    FitError
        The fit does not say over which speeds it holds.
    """
    ranges = [speeds_m_s or fit.provenance.get("speed_m_s")]
    ranges += [fit.provenance.get(f"gauge_{c}_pa") for c in "ab"]
    if ranges[0] is None:
        raise FitError(
            "the fit does not say which speeds were measured",
            remedy='fit again, or say over which speeds it shall hold: --speeds "1 mm/s .. 500 mm/s"',
        )
    low, high = ranges[0]  # type: ignore[misc]
    gauges = (_gauge(gauge_a_pa, ranges[1]), _gauge(gauge_b_pa, ranges[2]))
    speed = _speeds(float(low), float(high))
    found = identified(fit)
    entries = []
    for name, value in fit.parameters.items():
        key = next((k for k in found.intervals if k.split(".", 1)[1].replace("pressure.", "") == _dotted(name)), "")
        ends = found.intervals.get(key, (np.nan, np.nan))
        note = "" if name in fit.determined else ("fixed" if name not in fit.free else "not determined by the data")
        source = ", ".join(found.sources.get(key, ()))
        entries.append(Entry(name, value, unit_of(name), *ends, source, note))
    model = fit.model
    shape = "lorentzian" if model.lorentzian else f"exp(-(v/vs)^{fit.parameters.get('stribeck_exponent', 2.0):g})"
    lost = []
    if model.chambers:
        lost.append(
            f"dependence on the chamber pressures: the curve holds at {gauges[0] / 1e5:.3g} bar gauge in a and "
            f"{gauges[1] / 1e5:.3g} bar gauge in b; export again for others"
        )
    exponential = not model.stribeck or (not model.lorentzian and fit.parameters.get("stribeck_exponent") == 1.0)
    return Curve(
        f"friction fit, law {fit.law}",
        fit.model.law,
        shape if model.stribeck else "none",
        speed,
        fit.predict(speed, *gauges).friction_n,
        *gauges,
        tuple(entries),
        tuple(lost),
        exponential,
    )


def _dotted(name: str) -> str:
    return ".".join(name.rsplit("_", 1)) if name.endswith(("_a", "_b")) else name


#: Tables of a drive's friction -> what is lost with them.
_TABLES = {
    "pressure": "dependence on the chamber pressures",
    "dwell": "growth of the breakaway force in stops (dwell)",
    "relaxation": "relaxation of held bristles",
    "position": "variation along the stroke",
    "direction": "difference between the directions: the curve is the mean of both",
    "side_load": "side load as a quantity of its own: it is part of the curve",
}


def curve_of_drive(
    drive: Drive,
    speeds_m_s: tuple[float, float] | None,
    gauge_a_pa: float | None = None,
    gauge_b_pa: float | None = None,
) -> Curve:
    """Take the steady curve of a drive's friction law; its speeds have to be said.

    Raises
    ------
    FitError
        No speeds are said.
    """
    from pneudrive import _core

    if speeds_m_s is None:
        raise FitError(
            "a drive does not say which speeds were measured",
            remedy='say over which speeds the curve shall hold: --speeds "1 mm/s .. 500 mm/s"',
        )
    speed = _speeds(*speeds_m_s)
    core = drive.friction.core()
    law, parameters, pressure = core.pop("law"), core.pop("parameters"), core.pop("pressure", None)
    gauges = (gauge_a_pa or 0.0, gauge_b_pa or 0.0)
    sides = [
        np.asarray(_core.steady_friction(law, parameters, sign * speed, *gauges, pressure, core or None)) * sign
        for sign in (1.0, -1.0)
    ]
    entries = []
    for key, value in values(drive).items():
        if not key.startswith("friction."):
            continue
        origin = drive.provenance.get(key)
        ends = origin.bounds_si(value.mark) if origin is not None else (np.nan, np.nan)
        unit = getattr(value.mark, "si_unit", "") or "1"
        entries.append(Entry(key.removeprefix("friction."), value.si, unit, *ends, origin.source if origin else ""))
    lost = [text for key, text in _TABLES.items() if getattr(drive.friction, key) is not None]
    if drive.friction.law not in ("coulomb", "stribeck"):
        lost.append(f"presliding and friction that lags behind speed (law {drive.friction.law}): only its steady curve")
    shape = drive.friction.stribeck_shape or f"exp(-(v/vs)^{drive.friction.parameters.get('stribeck_exponent', 2.0):g})"
    exponent = 1.0 if shape == "exponential" else drive.friction.parameters.get("stribeck_exponent", 2.0)
    plain = drive.friction.law == "coulomb" or (exponent == 1.0 and shape not in ("gaussian", "lorentzian"))
    return Curve(
        drive.name, law, shape, speed, 0.5 * (sides[0] + sides[1]), *gauges, tuple(entries), tuple(lost), plain
    )
