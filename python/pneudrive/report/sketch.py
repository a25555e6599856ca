"""Sketches of rigs, from strokes in a table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.report.topics import texts_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SKETCHES = Path(__file__).with_name("sketches.toml")
FACES = {"WALL": "#cfcfcf", "PISTON": "#8f8f8f"}


def draw_sketch(name: str, there: Collection[str] = (), **values: object) -> Figure:
    """Draw a sketch.

    Parameters
    ----------
    name : str
        Name in ``sketches.toml``.
    there : collection of str
        Optional parts of the rig that are present.
    **values
        Values for the texts.

    Returns
    -------
    matplotlib.figure.Figure
    """
    said = texts_of(SKETCHES)[name]
    figure = style.new_figure(said["height_in"])
    axis = figure.subplots()
    axis.set_axis_off()
    axis.grid(visible=False)
    for stroke in said["strokes"]:
        if stroke.get("when", "") in ("", *there):
            next(draw for kind, draw in DRAWN.items() if kind in stroke)(axis, stroke, values)
    axis.set(xlim=said["x"], ylim=said["y"])
    if said.get("equal"):
        axis.set_aspect("equal")
    return figure


def _color(stroke: Mapping[str, Any]) -> str:
    name = stroke.get("color", "BLACK")
    return FACES.get(name) or getattr(style, name, name)


def _box(axis: Axes, stroke: Mapping[str, Any], _: Mapping[str, object]) -> None:
    from matplotlib.patches import FancyBboxPatch, Rectangle

    x, y, width, height = stroke["box"]
    look = {"facecolor": _color(stroke), "edgecolor": style.BLACK, "lw": stroke["lw"]}
    if "round" in stroke:
        axis.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=f"round,pad={stroke['round']}", **look))
    else:
        axis.add_patch(Rectangle((x, y), width, height, **look))


def _line(axis: Axes, stroke: Mapping[str, Any], _: Mapping[str, object]) -> None:
    xs, ys = zip(*stroke["line"], strict=True)
    axis.plot(xs, ys, color=_color(stroke), lw=stroke["lw"], solid_capstyle=stroke.get("cap", "round"))


def _arrow(axis: Axes, stroke: Mapping[str, Any], _: Mapping[str, object]) -> None:
    look = {"arrowstyle": stroke["head"], "lw": stroke["lw"], "color": _color(stroke)}
    begin, end = stroke["arrow"]
    axis.annotate(stroke.get("text", ""), end, begin, arrowprops=look, va="center")


def _text(axis: Axes, stroke: Mapping[str, Any], values: Mapping[str, object]) -> None:
    look = {"fontsize": stroke["size"], "fontweight": stroke.get("weight", "normal")}
    x, y = stroke["at"]
    axis.text(x, y, stroke["text"].format(**values), ha=stroke.get("align", "center"), va="center", **look)


DRAWN: dict[str, Callable[[Axes, Mapping[str, Any], Mapping[str, object]], None]] = {
    "box": _box,
    "line": _line,
    "arrow": _arrow,
    "text": _text,
}
