"""Put a fit into a drive, each value with its interval and its recordings."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import NORMAL_95
from pneudrive.errors import FitError
from pneudrive.identify.files import fit_toml
from pneudrive.identify.identified import Identified, apply_identified
from pneudrive.identify.model import PRESSURE_NAMES

if TYPE_CHECKING:
    from pneudrive.describe import Drive
    from pneudrive.identify.result import FrictionFit


def apply_to_drive(fit: FrictionFit, drive: Drive) -> Drive:
    """Return `drive` with the determined parameters of `fit`; see `FrictionFit.apply`."""
    known = {p["key"] for p in drive.friction.entry["parameters"]}
    forces = {n: fit.parameters[n] for n in fit.determined if n not in PRESSURE_NAMES}
    changes: dict[str, object] = {}
    if not set(forces) <= known:
        changes |= _other_law(fit, drive, forces)
    elif fit.model.stribeck and "stribeck_exponent" in known:
        changes |= _curve(fit, forces)
    _check_pressure(fit, drive)
    return apply_identified(identified(fit, forces), drive, changes)


def identified(fit: FrictionFit, forces: dict[str, float] | None = None) -> Identified:
    """Return the determined parameters of a fit under their names in the drive file.

    The intervals hold what chance leaves (profile likelihood) and, in quadrature, what all rows share. Half the sum of
    two slopes stands for each where the data determine the sum alone: without an interval.
    """
    own = {n: fit.parameters[n] for n in fit.determined if n not in PRESSURE_NAMES} if forces is None else forces
    values = {f"friction.{name}": value for name, value in own.items()}
    values |= {_slope_key(n): fit.parameters[n] for n in PRESSURE_NAMES if n in fit.determined or _shared(fit, n)}
    intervals = {}
    for name in (*own, *PRESSURE_NAMES):
        key = _slope_key(name) if name in PRESSURE_NAMES else f"friction.{name}"
        if key in values and name in fit.intervals:
            intervals[key] = whole_interval(values[key], fit.intervals[name], fit.systematic.get(name, 0.0))
    said = fit.provenance.get("recordings", ())
    recordings = tuple(str(name) for name in said) if isinstance(said, list | tuple) else ()
    digest = hashlib.sha256(fit_toml(fit).encode()).hexdigest()[:HASH_DIGITS]
    return Identified(values, intervals, dict.fromkeys(values, recordings), digest)


#: Digits of the hash of a fit: those with which `sha256sum fit.toml` begins.
HASH_DIGITS = 16


def whole_interval(value: float, interval: tuple[float, float], systematic: float) -> tuple[float, float]:
    """Statistical interval, widened by a standard uncertainty that is independent of it."""
    reach = NORMAL_95 * systematic
    low, high = interval
    return value - float(np.hypot(value - low, reach)), value + float(np.hypot(high - value, reach))


def _slope_key(name: str) -> str:
    force, _, chamber = name.rpartition("_")
    return f"friction.pressure.{force}.{chamber}"


def _other_law(fit: FrictionFit, drive: Drive, forces: dict[str, float]) -> dict[str, object]:
    """Take the fitted law, as the drive's own has no Stribeck part; it must be determined as a whole."""
    wanted = {"coulomb", "breakaway", "stribeck_velocity", "viscous"}
    missing = sorted(wanted - set(forces))
    if missing:
        raise FitError(
            f"the drive's friction law {drive.friction.law!r} has no Stribeck part, and the fit does not determine "
            + ", ".join(missing),
            rule="a drive takes another law only as a whole",
            remedy="give the drive the law stribeck or lugre first, or fit law='coulomb'",
        )
    return {"friction.law": fit.law} | _curve(fit, forces)


def _curve(fit: FrictionFit, forces: dict[str, float]) -> dict[str, object]:
    """Shape of the Stribeck curve: an exponent among the forces, or the Lorentzian by its name."""
    if fit.model.lorentzian:
        return {"friction.stribeck_shape": "lorentzian"}
    forces["stribeck_exponent"] = fit.parameters["stribeck_exponent"]
    return {}


def _check_pressure(fit: FrictionFit, drive: Drive) -> None:
    if fit.model.chambers and fit.model.pressure != "linear":
        raise FitError(
            f"a drive's friction is linear in the chamber pressures, and this fit is {fit.model.pressure} in them",
            rule="no straight line is put in a curve's place without being asked for",
            remedy="fit with pressure='linear' over the pressures at which the drive works",
        )
    seals = drive.friction.pressure
    if seals is None or fit.model.chambers:
        return
    slopes = (*seals.coulomb_n_pa, *seals.breakaway_n_pa)
    if any(slopes):
        raise FitError(
            "the drive adds friction with pressure, and the fit holds at the pressures of its recordings only",
            rule="the same friction would count twice",
            remedy="fit with pressure_dependence=True, or take [friction.pressure] out of the drive first",
        )


def _shared(fit: FrictionFit, name: str) -> bool:
    """Whether half of the determined sum of both slopes stands for this one."""
    return f"{name[:-1]}ab" in fit.free and name in fit.parameters
