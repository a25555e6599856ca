"""Friction laws fitted to the map of a campaign: one fit for each set of mounting, seal and drive."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.threads import one_thread
from pneudrive.friction.campaign.dependences import dependences_of
from pneudrive.identify.dependences import Dependences
from pneudrive.identify.static.fit import LAWS
from pneudrive.identify.static.seals import fit_groups

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.identify.static.result import FrictionFit

ALL = "all cycles"  # the group of a campaign without levels
#: Note of a fit of rows that have no friction modifiers in common.
AVERAGED = (
    "direction, position, stops and temperature: the fit averages over several mountings, seals or drives; not applied"
)
NO_POINTS = ("stick_slip", "speed_ripple", "force_swing", "saturated", "unpaired", "outlier", "negative_friction")


def fit_campaign(
    found: CampaignCharacteristics, laws: Sequence[str] = LAWS
) -> tuple[dict[str, dict[str, FrictionFit]], list[str]]:
    """Fit laws to the map of a campaign.

    Parameters
    ----------
    found : CampaignCharacteristics
    laws : sequence of str

    Returns
    -------
    dict of dict of FrictionFit, list of str
        Group -> law -> fit, and the failures. A group is a set of mounting, seal and drive, or
        ``all cycles`` in a campaign without levels. Friction may depend on pressure if there were several.
    """
    with one_thread():
        table = found.friction_map
        names = np.array([", ".join(level for level in row if level) or ALL for row in _levels(table)])
        groups = {name: table.isel(row=np.flatnonzero(names == name)) for name in dict.fromkeys(names.tolist())}
        fits, problems = fit_groups(groups, laws, NO_POINTS)
        for group, by_law in fits.items():
            own = _levels(groups[group])[0]
            fits[group] = {law: _with_dependences(fit, found, own) for law, fit in by_law.items()}
        return fits, problems


def with_dependences(fit: FrictionFit, found: CampaignCharacteristics, part: xr.Dataset) -> FrictionFit:
    """Return a fit of rows of a campaign's map with the friction modifiers that the campaign measured.

    Rows of several sets of mounting, seal and drive do not have a common set. A note then reports this.
    """
    sets = set(_levels(part))
    if len(sets) > 1:
        return replace(fit, dependences=Dependences(notes=(AVERAGED,), source=f"campaign {found.name}"))
    with one_thread():
        return _with_dependences(fit, found, sets.pop())


def _with_dependences(fit: FrictionFit, found: CampaignCharacteristics, levels: tuple[str, str, str]) -> FrictionFit:
    viscous = fit.values["viscous"] if "viscous" in fit.determined else 0.0
    measured = dependences_of(found, viscous, levels)
    is_of_both = fit.provenance["direction"] == "both"
    return replace(fit, dependences=measured if is_of_both else measured.without("direction"))


def _levels(table: xr.Dataset) -> list[tuple[str, str, str]]:
    columns = [table[name].to_numpy().tolist() for name in ("mounting", "seal", "drive")]
    return list(zip(*columns, strict=True))
