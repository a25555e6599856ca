"""``pneudrive measure``: measure between two times of a recording, also in comparison with another recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def measure(
    recording: Annotated[Path, typer.Argument(help="Recording in any supported format.", metavar="RECORDING")],
    at: Annotated[str, typer.Option(help='First time, "1.2 s"; the nearest sample counts.')],
    to: Annotated[str, typer.Option(help='Second time, "1.5 s".')],
    beside: Annotated[
        Path | None,
        typer.Option("--compare-with", help="Another recording, measured at the same times.", metavar="RECORDING"),
    ] = None,
    strokes: Annotated[
        str, typer.Option(help="Strokes of the two recordings that are aligned at their beginning.", metavar="N,N")
    ] = "1,1",
) -> None:
    """Measure between two times of a recording.

    The table has value, difference and slope of each channel. Faulty samples are counted.
    """
    from pneudrive.errors import CommandError
    from pneudrive.signals.measuring import measure as measured

    try:
        own, other = (int(one) for one in strokes.split(","))
    except ValueError:
        raise CommandError(f"--strokes {strokes} is not a pair of strokes", rule="two numbers, such as 3,2") from None
    typer.echo(str(measured(recording, at, to, beside=beside, strokes=(own, other))))
