"""Fits of groups of a friction map: all recordings together, each seal separately, each set of a campaign."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.friction.conditions import ALL_RECORDINGS, group_of
from pneudrive.friction.pressure import MINIMUM_RANGE_PA
from pneudrive.identify.static.fit import LAWS, fit_friction

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.static.result import FrictionFit


def fit_characterisation(
    characterisation: Characterisation, laws: Sequence[str] = LAWS
) -> tuple[dict[str, dict[str, FrictionFit]], list[str]]:
    """Fit laws to the friction map of a characterisation.

    Parameters
    ----------
    characterisation : Characterisation
        As returned by ``characterise_recordings``.
    laws : sequence of str
        Laws to fit.

    Returns
    -------
    dict of dict of FrictionFit, list of str
        Group -> law -> fit, and notes on failed fits. Each assembly (mounting, seal, drive) is a separate group, or
        ``all recordings`` if there is only one. Friction may depend on pressure if the recordings have several
        pressures.
    """
    curves = characterisation.friction_map
    of_row = np.array(row_seals_and_runs(characterisation)[0])
    groups = {ALL_RECORDINGS: curves}
    if len(set(of_row)) > 1:
        groups = {seal: curves.isel(row=np.flatnonzero(of_row == seal)) for seal in dict.fromkeys(of_row.tolist())}
    return fit_groups(groups, laws)


def fit_file(group: str) -> str:
    """Return the name of the file of a group's fit.

    Examples
    --------
    >>> fit_file("all recordings"), fit_file("NBR, mounting 2")
    ('fit.toml', 'fit-NBR-mounting-2.toml')
    """
    return "fit.toml" if group == ALL_RECORDINGS else f"fit-{re.sub(r'[^A-Za-z0-9._-]+', '-', group)}.toml"


def fit_groups(
    groups: Mapping[str, xr.Dataset], laws: Sequence[str], exclude_flags: Sequence[str] = ()
) -> tuple[dict[str, dict[str, FrictionFit]], list[str]]:
    """Fit laws to each of several friction maps: group -> law -> fit, and notes on failed fits."""
    fits: dict[str, dict[str, FrictionFit]] = {}
    problems: list[str] = []
    for group, part in groups.items():
        for law in laws:
            label = f"{group}, {law}"
            try:
                found = fit_map(part, law, exclude_flags)
            except FitError as error:
                problems.append(f"{label}: {error.what}")
            else:
                fits.setdefault(group, {})[law] = found
    return fits, problems


def fit_map(table: xr.Dataset, law: str, exclude_flags: Sequence[str] = ()) -> FrictionFit:
    """Fit a law to a friction map. Friction may depend on pressure if the map has several pressures."""
    spread = max(float(np.ptp(table[f"pressure_{side}_pa"].to_numpy())) for side in ("a", "b"))
    return fit_friction(table, law, pressure_dependence=spread > MINIMUM_RANGE_PA, exclude_flags=exclude_flags)


def row_seals_and_runs(characterisation: Characterisation) -> tuple[list[str], list[str]]:
    """Return seal and run of each row of the friction map of a characterisation, for :func:`survey`."""
    labels = {r.name: (group_of(r.labels), "1") for r in characterisation.recordings}
    labels |= {point.recording: (point.seal, point.run) for point in characterisation.points}
    rows = [labels[name] for name in characterisation.friction_map["recording"].to_numpy()]
    return [seal for seal, _ in rows], [run for _, run in rows]
