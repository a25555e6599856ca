"""Reading of fits and of sources for an export; range of conditions that two fits have in common."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from pneudrive.arrays import Interval
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.describe.files.load import OF_A_CIRCUIT
from pneudrive.errors import DescriptionError, FitError, nearest
from pneudrive.identify.dynamic.fit import Presliding
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.follow.fit import FollowFit
from pneudrive.identify.identified import stated
from pneudrive.identify.static.result import FrictionFit, LawFit
from pneudrive.identify.volume import RegulatorFit, VolumeFit
from pneudrive.simulation.trajectory import SUFFIXES

AnyFit = FrictionFit | LawFit | DriveFit | VolumeFit | Presliding | FollowFit | RegulatorFit
KINDS: dict[str, type[AnyFit]] = {kind.KIND: kind for kind in get_args(AnyFit)}


def read_fit(path: str | Path) -> AnyFit:
    """Read a fit of any kind.

    Raises
    ------
    FitError
        The file does not exist, is not TOML, or is not a complete fit.
    """
    if Path(path).suffix in SUFFIXES:
        raise FitError.of("identify.table", where=str(path))
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
        The file is neither a fit nor a drive file, or it is not valid.
    """
    if str(path).startswith("catalogue:"):
        return Drive.load(path)
    tables, _ = toml.read(path, FitError, "pneudrive fit writes a fit.toml.")
    if any(key in tables for key in OF_A_CIRCUIT):
        raise DescriptionError(where=str(path), **stated("application", "circuit"))
    is_drive = "kind" not in tables and ("friction" in tables or "drive" in tables)
    return Drive.load(path) if is_drive else read_fit(path)


def common(before: FrictionFit, after: FrictionFit, name: str) -> Interval:
    """Return the range of a condition that both fits have measured.

    Without a common range, the lower end is above the upper end.

    Parameters
    ----------
    before, after : FrictionFit
    name : str
        ``"speed_m_s"``, ``"gauge_a_pa"`` or ``"gauge_b_pa"``.
    """
    lows, highs = zip(*(fit.provenance[name] for fit in (before, after)), strict=True)
    return max(lows), min(highs)
