"""``pneudrive measure``: measure between two times of a recording, also in comparison with another recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def measure(
    recording: Path,
    at: Annotated[str, typer.Option()],
    to: Annotated[str, typer.Option()],
    beside: Annotated[Path | None, typer.Option("--compare-with")] = None,
    strokes: str = "1,1",
) -> None:
    """Measure between two times of a recording.

    The table has value, difference and slope of each channel. Faulty samples are counted.

    Options
    -------
    recording : RECORDING
        Recording in any supported format.
    at
        First time, "1.2 s"; the nearest sample counts.
    to
        Second time, "1.5 s".
    beside : RECORDING
        Another recording, measured at the same times.
    strokes : N,N
        Strokes of the two recordings that are aligned at their beginning.
    """
    from pneudrive.errors import CommandError
    from pneudrive.signals.measuring import measure as measured

    try:
        own, other = (int(one) for one in strokes.split(","))
    except ValueError:
        raise CommandError(f"--strokes {strokes} is not a pair of strokes", rule="two numbers, such as 3,2") from None
    typer.echo(str(measured(recording, at, to, beside=beside, strokes=(own, other))))
