"""``pneudrive layout``: propose a layout for a foreign recording."""

from __future__ import annotations

import sys
from pathlib import Path

import typer


def layout(
    file: Path,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Propose how to read a foreign recording, with a picture.

    Options
    -------
    file : FILE
        Recording in any supported format.
    out
        Layout file to write; default: standard output.
    picture
        Picture of the recording with the layout; default: next to the layout, or FILE.layout.png here.
    """
    from pneudrive.cli.progress import on_terminal
    from pneudrive.errors import RecordingError
    from pneudrive.report.layout_figure import write_layout_figure
    from pneudrive.signals.layout import stem
    from pneudrive.signals.proposal.propose import propose_layout
    from pneudrive.signals.proposal.roles import families
    from pneudrive.simulation.trajectory import whole

    proposal = propose_layout(file, on_terminal())
    if out is None:
        typer.echo(proposal.text)
    else:
        with whole(out) as temporary:
            temporary.write_text(proposal.text, encoding="utf-8")
    if picture is None:
        picture = out.with_suffix(".png") if out is not None else Path(f"{stem(file)}.layout.png")
    write_layout_figure(proposal, picture)
    if not proposal.problem:
        what = "a fixed volume" if proposal.kind == "fixed-volume" else f"a {proposal.kind}"
        strokes = f": {len(proposal.strokes)} strokes" if proposal.strokes else ""
        sys.stderr.write(f"A recording of {what}{strokes}; check the lines marked guess.\n")
    if proposal.unused:
        sys.stderr.write(f"Not used: {', '.join(families(proposal.unused))}.\n")
    for path in (out, picture):
        if path is not None:
            sys.stderr.write(f"{path}\n")
    if proposal.problem:
        raise RecordingError(
            proposal.problem
            if proposal.asks
            else f"the proposed layout does not read the file yet: {proposal.problem}",
            where=str(file),
            remedy="Correct the lines marked guess, open or not found, and check the picture.",
        )
