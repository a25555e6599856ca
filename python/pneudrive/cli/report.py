"""``pneudrive report``: the page of a fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import Results
from pneudrive.cli.output import tell


def report(
    fit: Annotated[
        Path,
        typer.Argument(help="Fit: a file of `pneudrive identify --out`, `fit` or `characterise`.", metavar="FIT.toml"),
    ],
    out: Results = Path("report"),
) -> None:
    """Write a page of a fit: values with intervals, recordings, what the data do not determine.

    Residuals need the data: `pneudrive identify` and `pneudrive fit` show them with --report.
    """
    from pneudrive.identify.files import read_fit

    tell([read_fit(fit).report(out)])
