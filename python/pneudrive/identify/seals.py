"""Fits of one characterisation: all recordings together, and each seal separately."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.friction.recording.closure import MINIMUM_RANGE_PA
from pneudrive.friction.recording.pressure_line import ALL_RECORDINGS
from pneudrive.identify.fit import LAWS, fit_friction

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.friction.recording.characterisation import Characterisation
    from pneudrive.identify.result import FrictionFit


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
        Group -> law -> fit, and notes on failed fits. Groups are ``all recordings`` and, if there are several, each
        seal. Friction may depend on pressure if the recordings have several pressures.
    """
    curves = characterisation.friction_map
    of_row = np.array(row_seals_and_runs(characterisation)[0])
    groups = {ALL_RECORDINGS: np.ones(of_row.size, dtype=bool)}
    if len(set(of_row)) > 1:
        groups |= {seal: of_row == seal for seal in dict.fromkeys(of_row)}
    fits: dict[str, dict[str, FrictionFit]] = {}
    problems: list[str] = []
    for group, rows in groups.items():
        part = curves.isel(row=np.flatnonzero(rows))
        spread = max(float(np.ptp(part[f"pressure_{side}_pa"].to_numpy())) for side in ("a", "b"))
        for law in laws:
            found = _fit(part, law, pressure_dependence=spread > MINIMUM_RANGE_PA)
            if isinstance(found, str):
                problems.append(f"{group}, {law}: {found}")
            else:
                fits.setdefault(group, {})[law] = found
    return fits, problems


def row_seals_and_runs(characterisation: Characterisation) -> tuple[list[str], list[str]]:
    """Return seal and run of each row of the friction map of a characterisation, for :func:`survey`."""
    labels = {r.name: (r.labels.get("seal", ALL_RECORDINGS), "1") for r in characterisation.recordings}
    labels |= {point.recording: (point.seal, point.run) for point in characterisation.points}
    rows = [labels[name] for name in characterisation.friction_map["recording"].to_numpy()]
    return [seal for seal, _ in rows], [run for _, run in rows]


def _fit(part: xr.Dataset, law: str, *, pressure_dependence: bool) -> FrictionFit | str:
    """Fit a law, or return why that is not possible."""
    try:
        return fit_friction(part, law, pressure_dependence=pressure_dependence)
    except FitError as error:
        return error.what
