"""Style of all figures: fonts, sizes and colours, readable in print and in grey, on light and on dark paper."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.errors import package_table
from pneudrive.figures import WIDTH_IN

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PNG_DPI = 300  # as journals require of photographs; the SVG beside it is better for lines
_STYLE = package_table(__file__, "style.toml")
#: Settings of matplotlib, and colours by name on light and on dark paper.
_SETTINGS, INKS = _STYLE["settings"], _STYLE["inks"]
FONT, LABEL_PT, TITLE_PT = (_SETTINGS[key] for key in ("font.family", "axes.labelsize", "axes.titlesize"))
TICK_PT, LEGEND_PT = _SETTINGS["xtick.labelsize"], _SETTINGS["legend.fontsize"]
TINTS = ("band", "shade", "shade two")
#: Lightest and darkest of an ordered row of curves: their order is visible in grey, too.
RAMP = ((0.67, 0.79, 0.89), (0.03, 0.13, 0.30))

_INKED = {
    "black": ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"),
    "paper": ("figure.facecolor", "axes.facecolor"),
    "grid": ("grid.color",),
}
#: Settings of matplotlib that concern windows: they do not change a picture, and to look at the first one is slow.
_OF_WINDOWS = ("backend", "backend_fallback", "interactive", "toolbar")


def ink(color: str | float, *, dark: bool = False) -> Any:  # noqa: ANN401 - a colour of matplotlib
    """Return a colour by its name, or by its position on the ramp."""
    if isinstance(color, str):
        return INKS[color][dark] if color in INKS else color
    light, deep = reversed(RAMP) if dark else RAMP
    return tuple(a + color * (b - a) + (0.2 if dark else 0.0) * (1.0 - color) for a, b in zip(light, deep, strict=True))


def load_matplotlib() -> ModuleType:
    """Return matplotlib, imported without the settings of the current folder.

    Its import reads ``matplotlibrc`` of the current folder, which may start a foreign LaTeX or be damaged.
    """
    if "matplotlib" not in sys.modules and Path("matplotlibrc").exists():
        here = Path.cwd()
        os.chdir(Path(__file__).parents[1] / "data")  # no module lies there
        try:
            return import_module("matplotlib")
        finally:
            os.chdir(here)
    return import_module("matplotlib")


@contextmanager
def applied(*, dark: bool = False) -> Iterator[None]:
    """Draw in this style inside the block, independent of the settings of the user or of the current folder."""
    mpl = load_matplotlib()
    usual = {key: value for key, value in mpl.rcParamsDefault.items() if key not in _OF_WINDOWS}
    changed = {key: value for key, value in usual.items() if mpl.rcParams[key] != value}
    inked = {key: ink(name, dark=dark) for name, keys in _INKED.items() for key in keys}
    with mpl.rc_context({**changed, **_SETTINGS, **inked}):
        yield


@lru_cache(maxsize=1)
def _figure_class() -> type[Figure]:
    """Return a class of figures that a notebook shows without pyplot."""
    load_matplotlib()
    from matplotlib.figure import Figure

    class Drawn(Figure):
        """A figure in the report's style."""

        def draw(self, renderer: Any) -> None:  # noqa: ANN401 - of matplotlib
            """Draw it. Labels of ticks are made here, also for a user who saves the figure later."""
            with applied():
                no_formulas(self)
                super().draw(renderer)

        def _repr_png_(self) -> bytes:
            """Draw it for a notebook."""
            with applied(), BytesIO() as memory:
                self.savefig(memory, format="png", dpi=PNG_DPI)
                return memory.getvalue()

    return Drawn


def no_formulas(figure: Figure) -> None:
    """Read no text of a figure as a formula, also where it was made outside this style."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_parse_math(False)  # pyright: ignore[reportAttributeAccessIssue] - found by its class


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """Return an empty figure with the width of a report, for a notebook."""
    return _figure_class()(figsize=(width_in, height_in), layout="constrained")


#: Height of the line above the panels that marks a figure as synthetic, inch, and size of its letters.
STAMP_IN, STAMP_PT = 0.17, 7


def finish(figure: Figure, *, synthetic: bool) -> None:
    """Add letters to the panels, and mark simulated data inside the picture, because pictures are used separately."""
    panels_shown = [
        axis for axis in figure.axes if axis.get_visible() and axis.axison and axis.get_label() != "<colorbar>"
    ]
    if len(panels_shown) > 1:
        for letter, axis in zip("abcdefghijklmnopqrstuvwxyz", panels_shown, strict=False):
            axis.set_title(f"{letter}   {axis.get_title('left')}".rstrip(), loc="left")
    if synthetic:
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + STAMP_IN)
        share = STAMP_IN / (height + STAMP_IN)
        layout = figure.get_layout_engine()
        for legend in figure.legends:  # it begins at the top of the picture: an empty line leaves room for the mark
            legend.set_title(" ")
            legend.get_title().set_fontsize(STAMP_PT)
        if layout is not None and not figure.legends:
            layout.set(rect=(0.0, 0.0, 1.0, 1.0 - share))  # pyright: ignore[reportCallIssue] - constrained layout
        place: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": STAMP_PT, "color": ink("stamp")}
        figure.text(0.995, 1.0 - 0.2 * share, "synthetic: simulated data", **place)


def lay_out(figure: Figure) -> None:
    """Fix the places of the panels.

    While a figure has a layout engine, matplotlib draws it twice for each file.
    """
    layout, dpi = figure.get_layout_engine(), figure.dpi
    if layout is not None:
        figure.dpi = PNG_DPI
        no_formulas(figure)
        layout.execute(figure)
        figure.dpi = dpi
    figure.set_layout_engine(None)


def logarithmic(axis: Axes, side: str = "x") -> None:
    """Give an axis a logarithmic scale with plain numbers."""
    from matplotlib.ticker import LogFormatter

    getattr(axis, f"set_{side}scale")("log")
    own = getattr(axis, f"{side}axis")
    own.set_major_formatter(lambda value, _: f"{value:g}")
    own.set_minor_formatter(LogFormatter())  # the usual one writes formulas
