"""Reading of files of fits of every kind, and of sources of an export."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.describe.files.load import OF_A_CIRCUIT
from pneudrive.errors import DescriptionError, FitError, nearest
from pneudrive.identify.dynamic.presliding import Presliding
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.static.law_fit import LawFit
from pneudrive.identify.static.result import FrictionFit
from pneudrive.identify.volume_result import VolumeFit

if TYPE_CHECKING:
    from pathlib import Path

AnyFit = FrictionFit | LawFit | DriveFit | VolumeFit | Presliding
KINDS: dict[str, type[AnyFit]] = {kind.KIND: kind for kind in (FrictionFit, LawFit, DriveFit, VolumeFit, Presliding)}


def read_fit(path: str | Path) -> AnyFit:
    """Read a fit of any kind.

    Raises
    ------
    FitError
        The file does not exist, is not TOML, or is not a complete fit.
    """
    content, _ = toml.read(path, FitError, "pneudrive fit and pneudrive identify write a fit.toml.")
    kind = str(content.get("kind", FrictionFit.KIND))
    if kind not in KINDS:
        raise FitError("the file is not a fit", where=str(path), value=f'kind = "{kind}"', remedy=nearest(kind, KINDS))
    return KINDS[kind].from_toml(path)


def read_source(path: str | Path) -> AnyFit | Drive:
    """Read the source of an export: a fit.toml, or a drive file.

    Raises
    ------
    FitError, DescriptionError
        The file is neither of them, or not valid.
    """
    if str(path).startswith("catalogue:"):
        return Drive.load(path)
    tables, _ = toml.read(path, FitError, "pneudrive fit writes a fit.toml.")
    if any(key in tables for key in OF_A_CIRCUIT):
        raise DescriptionError(
            "the file describes a circuit, but friction is exported from a fit or a drive",
            where=str(path),
            remedy="Export the whole circuit with --to fmu or --to c, or give the fit or the drive file.",
        )
    is_drive = "kind" not in tables and ("friction" in tables or "drive" in tables)
    return Drive.load(path) if is_drive else read_fit(path)
