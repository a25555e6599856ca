"""``pneudrive datasheet``: characteristics of a drive as a data sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.options import CatalogueFolders, Layout
from pneudrive.cli.output import check_outputs, show_lines, tell


def datasheet(
    drive: str,
    recordings: Annotated[list[Path] | None, typer.Argument()] = None,
    layout: Layout = None,
    out: Path = Path("datasheet.html"),
    intervals: bool = True,
    catalogue: CatalogueFolders = None,
) -> None:
    """Write a data sheet of a drive, with standards and sources.

    Options
    -------
    drive : DRIVE|CIRCUIT
        Drive or circuit file (TOML), or catalogue:NAME.
    recordings : [RECORDING|MAP|CAMPAIGN]...
        Recordings of the drive, or of its piston alone, or one friction map or campaign.
    out
        Page: .html or .pdf.
    intervals
        Compute intervals from those of identified values.
    """
    from pneudrive.cli.progress import on_terminal
    from pneudrive.datasheet.sheet import build
    from pneudrive.describe.files.load import load_described
    from pneudrive.report.datasheet.page import SUFFIXES, write_datasheet

    out.parent.mkdir(parents=True, exist_ok=True)
    check_outputs(out, SUFFIXES)
    found = build(load_described(drive), recordings or [], layout, on_terminal(), intervals=intervals)
    show_lines(found.headlines)
    tell([write_datasheet(found, out)])
