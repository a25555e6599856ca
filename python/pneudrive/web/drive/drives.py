"""The drive of a file or of a fit in the workspace, and the hash that values of the fit carry."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.errors import PneudriveError
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.files import read_fit
from pneudrive.web.drive.run_request import described_at, kept

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.web.workspace import Workspace

MOST_DRIVES = 500  # files that are searched for the requested one


def is_fit(path: Path) -> bool:
    """Return whether a file is the fit of a drive."""
    tables, _ = toml.read(path)
    return tables.get("kind") == DriveFit.KIND and "values" in tables


@kept(MOST_DRIVES)
def drive_at(workspace: Workspace, name: str, _changed: float) -> Drive | None:
    """Return the drive of a file, or of a fit. None for another file, or one that is not valid."""
    try:
        path = workspace.path(name)
        if is_fit(path):
            fit = read_fit(path)
            return fit.apply() if isinstance(fit, DriveFit) and fit.converged else None
        found = described_at(workspace, name)
    except PneudriveError:
        return None
    return found if isinstance(found, Drive) else None


@lru_cache(maxsize=MOST_DRIVES)
def hash_at(path: Path, _changed: float) -> str:
    """Return the hash of a fit in the form that identified values carry. Empty for another file."""
    try:
        return read_fit(path).identified_as({}).fit
    except PneudriveError:
        return ""
