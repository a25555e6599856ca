"""Figures as files: a picture is whole or not there, and equal data give equal bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

#: Endings of a picture's file.
PICTURES = (".png", ".svg", ".pdf")


def write_picture(figure: Figure, target: Path) -> None:
    """Write a figure; within `style.applied`, and to a file that `check_target` has accepted.

    Raises
    ------
    CommandError
        The file cannot be written.
    """
    form = target.suffix.lower()[1:]
    options: dict[str, Any] = {"metadata": {"Date": None}} if form == "svg" else {}
    with whole(target) as temporary:
        figure.savefig(temporary, format=form, dpi=style.PNG_DPI, **options)
