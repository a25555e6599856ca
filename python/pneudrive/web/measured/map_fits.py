"""Fits next to a friction map: the fit of each seal, mounting and drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import PneudriveError
from pneudrive.friction.conditions import ALL_RECORDINGS, LEVELS, group_of
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import FrictionFit

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

FIT = "fit.toml"


def assemblies_of(found: xr.Dataset, rows: Any) -> Any:  # noqa: ANN401 - arrays
    """Return the name of the assembly (mounting, seal, drive) of each row."""
    columns = {name: found[name].to_numpy()[rows].astype(str).tolist() for name in LEVELS if name in found}
    labels = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    return np.array([group_of(row) for row in labels] if columns else [ALL_RECORDINGS] * len(rows))


def fits_of(path: Path, fit_name: str, names: list[str]) -> tuple[dict[str, FrictionFit], str]:
    """Return the fit of each assembly, and reasons for missing fits.

    In a map with several assemblies, the usual name refers to the fit of each. Another file belongs to one seal,
    mounting or drive.
    """
    if len(names) == 1:
        fit, why = fit_beside(path, fit_name)
        return ({} if fit is None else {names[0]: fit}), why
    wanted = {name: fit_file(name) for name in names if fit_name in (FIT, fit_file(name))}
    if not wanted:
        return {}, f"{fit_name} is a fit over several seals or mountings: its curve belongs to none of them."
    read = {name: fit_beside(path, file) for name, file in wanted.items()}
    missing = " ".join(dict.fromkeys(why for _, why in read.values() if why))
    return {name: fit for name, (fit, _) in read.items() if fit is not None}, missing


def fit_beside(path: Path, name: str) -> tuple[FrictionFit | None, str]:
    """Return the fit in the folder of a map, or the reason why it is missing."""
    place = path.parent / name
    if not place.is_file():
        return None, f"There is no {name} beside the map."
    try:
        fit = read_fit(place)
    except PneudriveError as error:
        return None, error.what
    if not isinstance(fit, FrictionFit):
        return None, f"{name} is the fit of a {fit.KIND}, which has no curve over speed."
    return fit, ""
