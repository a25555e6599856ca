"""``pneudrive report``: the page of a fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import FitFile, Results
from pneudrive.cli.output import tell


def report(
    fit: FitFile,
    friction_map: Annotated[Path | None, typer.Option("--map")] = None,
    out: Results = Path("report"),
) -> None:
    """Write a report of a fit, with intervals and undetermined values.

    Residuals need the data: use --map for the fit of a friction map, and `pneudrive identify --report` for the fit of a
    drive.

    Options
    -------
    friction_map : MAP
        The fitted friction map, for the residuals.
    """
    from pneudrive.errors import CommandError
    from pneudrive.friction.friction_map import read_map
    from pneudrive.identify.files import read_fit
    from pneudrive.identify.static.result import SlidingFit, with_map

    found = read_fit(fit)
    if friction_map is not None:
        if not isinstance(found, SlidingFit):
            raise CommandError(f"--map: the {found.TITLE} was not fitted to a friction map")
        found = with_map(found, read_map(friction_map))
    tell([found.report(out)])
