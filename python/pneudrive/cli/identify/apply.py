"""``pneudrive apply``: write the determined values of a fit into the file of a drive or tank."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import CatalogueFolders, FitFile
from pneudrive.cli.output import check_outputs, write_text


def apply(
    fit: FitFile,
    drive: Annotated[str | None, typer.Argument()] = None,
    out: Path | None = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Put the determined values of a fit into a drive or a tank.

    Each value keeps its interval and its recordings.

    Options
    -------
    drive : [DRIVE]
        Drive file, catalogue:NAME, or tank file; default: the one with which `pneudrive identify` started.
    out
        Drive file to write; default: standard output.
    """
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tank import Tank
    from pneudrive.errors import CommandError
    from pneudrive.identify.dynamic.result import DriveFit
    from pneudrive.identify.files import read_fit
    from pneudrive.identify.volume import VolumeFit

    check_outputs(out, (".toml",))
    found = read_fit(fit)
    if isinstance(found, VolumeFit):
        after = found.apply(None if drive is None else Tank.load(drive))
    elif isinstance(found, DriveFit):
        after = found.apply(None if drive is None else Drive.load(drive))
    elif drive is not None:
        after = found.apply(Drive.load(drive))
    else:
        raise CommandError(
            "this fit of friction names no drive",
            remedy="Add the drive file to the command: pneudrive apply FIT DRIVE.",
        )
    write_text(after.to_toml(), out)
