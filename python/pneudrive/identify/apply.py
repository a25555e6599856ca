"""Put a fit into a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.errors import FitError
from pneudrive.identify.model import PRESSURE_NAMES, UNITS
from pneudrive.units import write

if TYPE_CHECKING:
    from pneudrive.describe import Drive
    from pneudrive.identify.result import FrictionFit


def apply_to_drive(fit: FrictionFit, drive: Drive) -> Drive:
    """Return `drive` with the determined parameters of `fit`; see `FrictionFit.apply`."""
    from pneudrive.describe.friction import friction_laws

    known = {p["key"] for p in friction_laws()[drive.friction.law]["parameters"]}
    forces = {n: fit.parameters[n] for n in fit.determined if n not in PRESSURE_NAMES}
    changes: dict[str, object] = {}
    if not set(forces) <= known:
        changes |= _other_law(fit, drive, forces)
    elif fit.model.stribeck and "stribeck_exponent" in known:
        changes |= _curve(fit, forces)
    _check_pressure(fit, drive)
    _check_order(fit, drive, forces)
    for name, value in forces.items():
        changes[f"friction.{name}"] = _quantity(name, value)
    changes |= _pressure(fit, drive)
    return drive.replace(changes)


def _quantity(name: str, value: float) -> str | float:
    return value if UNITS[name] == "1" else write(value, UNITS[name])


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
    slopes = (seals.coulomb.a, seals.coulomb.b, seals.breakaway.a, seals.breakaway.b)
    if any(slopes):
        raise FitError(
            "the drive adds friction with pressure, and the fit holds at the pressures of its recordings only",
            rule="the same friction would count twice",
            remedy="fit with pressure_dependence=True, or take [friction.pressure] out of the drive first",
        )


def _check_order(fit: FrictionFit, drive: Drive, forces: dict[str, float]) -> None:
    kept = dict(drive.friction.parameters)
    after = {**kept, **forces}
    if "breakaway" in after and after["breakaway"] < after["coulomb"]:
        kept_names = sorted({"coulomb", "breakaway"} - set(forces))
        raise FitError(
            f"the drive would break away at {after['breakaway']:.4g} N, "
            f"below its Coulomb force of {after['coulomb']:.4g} N",
            value=f"kept from the drive, as the data do not determine it: {', '.join(kept_names)}",
            rule="breakaway >= coulomb",
            remedy="; ".join(str(s.remedy) for s in fit.undetermined if s.parameter in kept_names)
            or "fit law='stribeck' or change the drive's breakaway first",
        )


def _pressure(fit: FrictionFit, drive: Drive) -> dict[str, object]:
    slopes = {n: fit.parameters[n] for n in PRESSURE_NAMES if n in fit.determined or _shared(fit, n)}
    if not slopes:
        return {}
    seals = drive.friction.pressure
    out: dict[str, object] = {}
    for force in ("coulomb", "breakaway"):
        old = getattr(seals, force) if seals is not None else None
        both = {c: slopes.get(f"{force}_{c}", getattr(old, c) if old is not None else 0.0) for c in "ab"}
        out[f"friction.pressure.{force}"] = {c: write(v, "N/Pa") for c, v in both.items()}
    return out


def _shared(fit: FrictionFit, name: str) -> bool:
    """Whether half of the determined sum of both slopes stands for this one."""
    return f"{name[:-1]}ab" in fit.free and name in fit.parameters
