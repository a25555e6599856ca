"""Correction of points in the self-excited range to points of F(v), by simulation of their rig.

The mean force over a swing is not the friction of steady sliding. With a law, the rig's stiffness, mass and damping,
and the contact's stiffness and damping, the difference can be simulated and subtracted: the law is fitted, the
difference computed and subtracted from these points, and the law fitted again, until nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import FitError
from pneudrive.friction.campaign.cycles.self_excited import NAMES
from pneudrive.friction.campaign.fits import NO_POINTS
from pneudrive.identify.seals import fit_map

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.identify.result import FrictionFit

    Array = NDArray[np.float64]

MOST_ROUNDS = 12
SETTLED_N = 1e-3  # change of every difference, relative to friction, at convergence
TRUSTED = 0.5  # standard uncertainty of a difference, as its share (assumed)
FLAGS = tuple(name.replace("-", "_").replace(" ", "_") for name in NAMES)
LOST = tuple(flag for flag in NO_POINTS if flag not in FLAGS)
SAME_SPEED = 0.02  # speeds that are simulated as one


@dataclass(frozen=True)
class Contact:
    """Values that a sliding measurement does not give, but that the swing of a rig depends on.

    Attributes
    ----------
    rig_damping_n_s_m : float
        Between axis and piston, beside the rig's stiffness.
    bristle_stiffness_n_m, bristle_damping_n_s_m : float
        Of the contact, as in a drive file with the law ``lugre``.
    damping_fade_m_s : float or None
        Speed at which the contact's damping has faded.
    """

    rig_damping_n_s_m: float
    bristle_stiffness_n_m: float
    bristle_damping_n_s_m: float
    damping_fade_m_s: float | None = None


@dataclass(frozen=True, eq=False)
class Corrected:
    """A map with swinging points corrected to steady ones.

    Attributes
    ----------
    friction_map : xarray.Dataset
        Map of the campaign; these rows have the corrected friction, an uncertainty of half of the
        difference (assumed) in addition to their own, and the flag ``simulated`` after their other flags.
    fit : FrictionFit
        The law at convergence.
    difference_n : ndarray, shape (row,)
        The subtracted difference; 0 in the other rows.
    rounds : int
    """

    friction_map: xr.Dataset
    fit: FrictionFit
    difference_n: Array
    rounds: int


def without_swings(found: CampaignCharacteristics, contact: Contact) -> Corrected:
    """Correct the points of a campaign that were measured while rig and seal swung.

    Parameters
    ----------
    found : CampaignCharacteristics
        From a rig whose identity states stiffness and mass.
    contact : Contact

    Returns
    -------
    Corrected

    Raises
    ------
    FitError
        If there is no such point, the rig's stiffness or mass is not known, or no law can be fitted or converges.
    SimulationError
        If the rig cannot be simulated.
    """
    identity, table = found.identity, found.friction_map
    swinging = np.array([any(f in FLAGS for f in str(flags).split(",")) for flags in table["flags"].to_numpy()])
    if not swinging.any():
        raise FitError("no point was measured in a self-excited range", remedy="nothing needs a correction")
    if not (identity.stiffness_n_m and identity.mass_beyond_sensor_kg):
        raise FitError(
            "the swing of this rig cannot be simulated",
            rule="the rig's stiffness_n_m and mass_beyond_sensor_kg must be known",
            remedy="state both in rig.json",
        )
    difference, change = np.zeros(table.sizes["row"]), np.inf
    for number in range(1, MOST_ROUNDS + 1):
        corrected = _taken_off(table, difference, swinging)
        fit = fit_map(corrected, "stribeck", LOST)
        again = _differences(corrected, swinging, fit, found, contact)
        change = float(np.max(np.abs(again - difference)[swinging]))
        difference = again
        if change < SETTLED_N * float(np.abs(table["friction_n"].to_numpy()).max()):
            return Corrected(_taken_off(table, difference, swinging), fit, difference, number)
    raise FitError(
        "the simulated swing does not settle",
        value=f"differences still change by {change:.2g} N after {MOST_ROUNDS} rounds",
        remedy="measure steady points on both sides of the range, or check the contact's values",
    )


def _taken_off(table: xr.Dataset, difference: Array, swinging: NDArray[np.bool_]) -> xr.Dataset:
    out = table.copy(deep=True)
    out["friction_n"].values -= difference
    u = np.hypot(out["u_systematic_n"].to_numpy(), TRUSTED * np.abs(difference))
    out["u_systematic_n"].values[:] = u
    out["stderr_n"].values[swinging] = np.hypot(out["stderr_n"].to_numpy(), TRUSTED * np.abs(difference))[swinging]
    flags = [f"{text},simulated" if s else text for text, s in zip(out["flags"].to_numpy(), swinging, strict=True)]
    out["flags"].values[:] = np.array(flags, dtype=object)
    return out


def _differences(
    table: xr.Dataset,
    swinging: NDArray[np.bool_],
    fit: FrictionFit,
    found: CampaignCharacteristics,
    contact: Contact,
) -> Array:
    """Simulate each swinging speed and pressure pair once."""
    from pneudrive.rig.swing import drag_swinging

    identity = found.identity
    law = _law(fit, contact)
    speed = np.abs(table["velocity_m_s"].to_numpy())
    gauges = [table[f"pressure_{c}_pa"].to_numpy() - identity.ambient_pressure_pa for c in ("a", "b")]
    known: dict[tuple[int, int, int], float] = {}
    out = np.zeros(speed.size)
    for i in np.flatnonzero(swinging).tolist():
        place = (round(np.log(speed[i]) / SAME_SPEED), round(gauges[0][i] / 1e3), round(gauges[1][i] / 1e3))
        if place not in known:
            pair = (float(gauges[0][i]), float(gauges[1][i]))
            swing = drag_swinging(
                law,
                float(speed[i]),
                identity.stiffness_n_m or 0.0,
                contact.rig_damping_n_s_m,
                identity.mass_beyond_sensor_kg,
                pair,
            )
            known[place] = swing.bias_n
        out[i] = known[place]
    return out


def _law(fit: FrictionFit, contact: Contact) -> dict[str, Any]:
    """Return the fitted law with the contact's values, in the form of the core."""
    values = fit.parameters
    parameters = {
        "coulomb": values["coulomb"],
        "breakaway": max(values["breakaway"], values["coulomb"]),
        "stribeck_velocity": values["stribeck_velocity"],
        "stribeck_exponent": values.get("stribeck_exponent", 2.0),
        "viscous": values["viscous"],
        "bristle_stiffness": contact.bristle_stiffness_n_m,
        "bristle_damping": contact.bristle_damping_n_s_m,
    }
    if contact.damping_fade_m_s is not None:
        parameters["damping_fade_velocity"] = contact.damping_fade_m_s
    slopes = {name: values.get(name, 0.0) for name in ("coulomb_a", "coulomb_b", "breakaway_a", "breakaway_b")}
    return {"law": "lugre", "parameters": parameters, "pressure": slopes if any(slopes.values()) else None}
