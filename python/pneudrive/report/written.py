"""Figures as files. Pictures are written completely or not at all, and equal data give equal bytes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

#: Suffixes of a picture's file.
PICTURES = (".png", ".svg", ".pdf")


def write_picture(figure: Figure, target: Path) -> None:
    """Write a figure, within `style.applied`, to a file that `check_target` accepted.

    Raises
    ------
    CommandError
        If the file cannot be written.
    """
    form = target.suffix.lower()[1:]
    options: dict[str, Any] = {"metadata": {"Date": None}} if form == "svg" else {}
    with whole(target) as temporary:
        figure.savefig(temporary, format=form, dpi=style.PNG_DPI, **options)


def drawn(
    draw: Callable[[], Figure],
    path: str | Path | None = None,
    suffixes: tuple[str, ...] = PICTURES,
    write: Callable[[Figure, Path], None] = write_picture,
) -> Figure:
    """Draw a figure, and write it if a path is given.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    target = None if path is None else check_target(path, suffixes)
    with style.applied():
        figure = draw()
        if target is not None:
            write(figure, target)
    return figure
