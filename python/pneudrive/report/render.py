"""Drawing of figures with matplotlib. Only this module and the symbols of circuits call matplotlib's axes.

The style of all figures (fonts, sizes and colours) is readable in print and in grey, on light and on dark paper.
"""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pneudrive import figures
from pneudrive.errors import package_table
from pneudrive.figures import WIDTH_IN, Axis, Band, Bars, Drawing, Line, Markers, Panel, Rule
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import ModuleType

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL import Image

    from pneudrive.arrays import Plain

DrawnFigure: TypeAlias = "Figure"  # of matplotlib
PNG_DPI = 300  # as journals require of photographs; the SVG beside it is better for lines
FILM_DPI = 150.0  # of an animation
_STYLE = package_table(__file__, "style.toml")
#: Settings of matplotlib, legends of a panel by position, and colours by name on light and on dark paper.
_SETTINGS, LEGENDS, INKS = _STYLE["settings"], _STYLE["legends"], _STYLE["inks"]
FONT, LABEL_PT, TITLE_PT = (_SETTINGS[key] for key in ("font.family", "axes.labelsize", "axes.titlesize"))
TICK_PT, LEGEND_PT = _SETTINGS["xtick.labelsize"], _SETTINGS["legend.fontsize"]
TINTS = ("band", "shade", "shade two")
#: Lightest and darkest colour of ordered curves. The order stays visible in grey.
RAMP = ((0.67, 0.79, 0.89), (0.03, 0.13, 0.30))

#: Settings of matplotlib for windows. They do not change a picture, and reading ``backend`` is slow.
_OF_WINDOWS = ("backend", "backend_fallback", "interactive", "toolbar")


def ink(color: str | float) -> Any:  # noqa: ANN401 - a colour of matplotlib
    """Return a colour by its name, or by its position on the ramp, for light or dark paper as set by `applied`."""
    is_dark = load_matplotlib().rcParams["axes.facecolor"] == INKS["paper"][True]
    if isinstance(color, str):
        return INKS[color][is_dark] if color in INKS else color
    light, deep = reversed(RAMP) if is_dark else RAMP
    more = 0.2 if is_dark else 0.0
    return tuple(a + color * (b - a) + more * (1.0 - color) for a, b in zip(light, deep, strict=True))


def load_matplotlib() -> ModuleType:
    """Return matplotlib, imported without the settings of the current folder.

    The import would read ``matplotlibrc`` of the current folder, which may be damaged or start a foreign LaTeX.
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
    """Use the style of pneudrive inside the block, independent of settings of the user or of the current folder."""
    mpl = load_matplotlib()
    usual = {key: value for key, value in mpl.rcParamsDefault.items() if key not in _OF_WINDOWS}
    changed = {key: value for key, value in usual.items() if mpl.rcParams[key] != value}
    inked = {key: INKS[name][dark] for key, name in _STYLE["inked"].items()}
    with mpl.rc_context({**changed, **_SETTINGS, **inked}):
        yield


@cache
def _figure_class() -> type[Figure]:
    """Return a class of figures that a notebook shows without pyplot."""
    load_matplotlib()
    from matplotlib.figure import Figure

    class Drawn(Figure):
        """A figure in the report's style."""

        def draw(self, renderer: Any) -> None:  # noqa: ANN401 - of matplotlib
            """Draw the figure in this style, also if a user saves it later: tick labels are made while drawing."""
            with applied():
                no_formulas(self)
                super().draw(renderer)

        def _repr_png_(self) -> bytes:
            """Draw the figure for a notebook."""
            with applied(), BytesIO() as memory:
                self.savefig(memory, format="png", dpi=PNG_DPI)
                return memory.getvalue()

    return Drawn


def no_formulas(figure: Figure) -> None:
    """Disable formulas in all texts of a figure, even if the figure was made outside this style."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_parse_math(False)  # pyright: ignore[reportAttributeAccessIssue] - found by its class


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """Return an empty figure with the width of a report, for a notebook."""
    return _figure_class()(figsize=(width_in, height_in), layout="constrained")


#: Height of the line above the panels that marks a figure as synthetic, inch, and text size, points.
STAMP_IN, STAMP_PT = 0.17, 7


def finish(figure: Figure, *, synthetic: bool) -> None:
    """Add letters to the panels, and a mark for simulated data, because pictures may be used without their page."""
    with_axes = [axis for axis in figure.axes if axis.axison]
    if len(with_axes) > 1:
        for letter, axis in zip("abcdefghijklmnopqrstuvwxyz", with_axes, strict=False):
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
        place: Plain = {"ha": "right", "va": "top", "fontsize": STAMP_PT, "color": ink("stamp")}
        figure.text(0.995, 1.0 - 0.2 * share, "synthetic: simulated data", **place)


def drawn(figure: figures.Figure, *, synthetic: bool) -> Figure:
    """Draw a figure with panel letters, the mark of simulated data and fixed panel positions. Call it in `applied`.

    With a layout engine, matplotlib would draw the figure twice for each file.
    """
    made = render(figure)
    finish(made, synthetic=synthetic)
    layout, dpi = made.get_layout_engine(), made.dpi
    if layout is not None:
        made.dpi = PNG_DPI
        no_formulas(made)
        layout.execute(made)
        made.dpi = dpi
    made.set_layout_engine(None)
    return made


def logarithmic(axis: Axes, side: str = "x") -> None:
    """Give an axis a logarithmic scale with plain numbers."""
    from matplotlib.ticker import LogFormatter

    getattr(axis, f"set_{side}scale")("log")
    own = getattr(axis, f"{side}axis")
    own.set_major_formatter(lambda value, _: f"{value:g}")
    own.set_minor_formatter(LogFormatter())  # the usual one writes formulas


# --- Figures of data, drawn.

Handle: TypeAlias = Any  # of matplotlib, for a legend; None for a mark without one
#: Suffixes of a picture's file.
PICTURES = (".png", ".svg", ".pdf")
TINT = 0.15  # opacity of a band in the colour of its curve
WIDE = 3.0  # ratio of values beyond which an axis of scale "wide" is logarithmic
RIGHT_ANGLE = 90.0  # degrees; an axis with more, as of a phase, has ticks every 45 or 90 degrees
FAR_APART = 20.0  # ratio of the largest values of two lines beyond which an axis of scale "far" is logarithmic
NAME_IN, NAME_PT = 0.09, (3.5, 2.5)  # least distance of the names of points, and their place beside the points


def draw_figure(
    figure: figures.Figure, path: str | Path | None = None, *, synthetic: bool | None = None, dark: bool = False
) -> Figure:
    """Draw a figure, and write it if a path is given.

    Parameters
    ----------
    figure : Figure
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.
    synthetic : bool, optional
        Whether the data are simulated. True adds a mark, and both True and False add letters to the panels. None adds
        neither.
    dark : bool
        Draw on dark paper.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    target = None if path is None else check_target(path, PICTURES)
    with applied(dark=dark):
        made = render(figure)
        if synthetic is not None:
            finish(made, synthetic=synthetic)
        if target is not None:
            form = target.suffix.lower()[1:]
            options: Plain = {"metadata": {"Date": None}} if form == "svg" else {}
            with whole(target) as temporary:
                made.savefig(temporary, format=form, dpi=PNG_DPI, **options)
    return made


def render(figure: figures.Figure) -> Figure:
    """Draw a figure with matplotlib, and return it. Call this in `applied`."""
    rows, columns = figure.grid
    made = new_figure(figure.row_in * rows + figure.rest_in, figure.width_in)
    first = int(figure.tall is not None and figure.tall_first)
    layout = made.add_gridspec(
        rows,
        columns + (figure.tall is not None),
        height_ratios=figure.heights or None,
        width_ratios=figure.widths or None,
    )
    axes: dict[int, Axes] = {}
    leaders: dict[tuple[str, int], Axes] = {}  # side and group of panels with one range -> its first panel
    for index, panel in enumerate(figure.panels):
        if panel is not None:
            row, column = divmod(index, columns)
            groups = {"all": 0, "row": row, "col": column}
            alone = -1 - index  # group of a panel with a range of its own
            own = {"x": groups.get(figure.share_x, alone), "y": groups.get(figure.share_y, alone)}
            shared = {f"share{side}": leaders.get((side, group)) for side, group in own.items()}
            axes[index] = made.add_subplot(layout[row, column + first], **shared)
            leaders = dict.fromkeys(own.items(), axes[index]) | leaders
    drawn_panels = [(axes[index], panel) for index, panel in enumerate(figure.panels) if panel is not None]
    if figure.tall is not None:
        drawn_panels.append((made.add_subplot(layout[:, 0 if first else -1]), figure.tall))
    if not figure.has_margins:
        made.set_layout_engine("none")
        for axis, _ in drawn_panels:
            axis.set_position((0.0, 0.0, 1.0, 1.0))
    labels = [_panel(axis, panel, figure) for axis, panel in drawn_panels]
    led = {(side, axis) for (side, _), axis in leaders.items()}
    for axis, panel in drawn_panels:
        for side, own in zip("xy", figure.axes_of(panel), strict=True):
            _limit(axis, side, own, is_first=(side, axis) in led or panel is figure.tall)
        _spread_names(axis, panel, figure.row_in)
    handles: Plain = {}
    for (axis, panel), own in zip(drawn_panels, labels, strict=True):
        handles |= _legend(axis, own, figure, figure.legend if panel.legend is None else panel.legend)
    _outer(made, figure, axes)
    if handles:
        entries = min(len(handles), figure.entries)
        made.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=entries)
    if figure.title:
        made.suptitle(figure.title, fontsize=9, x=0.01, ha="left")
    if rows > 1 and figure.share_y != "all":
        made.align_ylabels()  # slow: matplotlib measures all panels again each time that it draws
    return made


def film(pictures: Iterable[figures.Figure]) -> Iterator[Image.Image]:
    """Yield an image of each figure. All have the same size and contain one drawing. Call this in `applied`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas = None
    for picture in pictures:
        if canvas is None:
            made = render(picture)
            made.set_dpi(FILM_DPI)
            canvas = FigureCanvasAgg(made)
        else:
            (axis,), panel = canvas.figure.axes, picture.panels[0]
            assert panel is not None
            for artist in (*axis.lines, *axis.patches, *axis.texts):
                artist.remove()
            DRAWN[Drawing](panel.marks[0], axis, *picture.axes_of(panel))
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _outer(made: Figure, figure: figures.Figure, axes: dict[int, Axes]) -> None:
    """Show the tick labels and axis labels of shared axes only on the outer sides."""
    rows, columns = figure.grid
    for index, axis in axes.items():
        if figure.share_x and index + columns in axes:
            axis.tick_params(labelbottom=False, which="both")
            axis.set_xlabel("")
        if figure.share_y in ("all", "row") and index % columns:
            axis.tick_params(labelleft=False, which="both")
            axis.set_ylabel("")
    sides = (("x", figure.x, figure.share_x, columns), ("y", figure.y, figure.share_y, rows))
    for side, own, share, several in sides:
        label = figures.axis(own).label
        if share == "all" and several > 1 and label:
            getattr(made, f"sup{side}label")(label, fontsize=LABEL_PT)
            for axis in axes.values():
                if getattr(axis, f"get_{side}label")() == label:
                    getattr(axis, f"set_{side}label")("")


def _panel(axis: Axes, panel: Panel, figure: figures.Figure) -> Plain:
    """Draw one panel and return the legend handles of its labels."""
    x, y = figure.axes_of(panel)
    if panel.title:
        axis.set_title(panel.title, fontsize=TITLE_PT * figure.text_scale)
    if all(isinstance(mark, Line | Band | Rule) for mark in panel.marks):
        axis.margins(x=0)
    handles: Plain = {}
    for mark in panel.marks:
        handle = DRAWN[type(mark)](mark, axis, x, y)
        label = getattr(mark, "label", "")
        if label and handle is not None:
            handles.setdefault(label, handle)
    _scale(axis, "x", x, panel.marks)
    _scale(axis, "y", y, panel.marks)
    if figure.text_scale != 1.0:
        axis.tick_params(labelsize=TICK_PT * figure.text_scale)
        for text in (axis.xaxis.label, axis.yaxis.label):
            text.set_fontsize(LABEL_PT * figure.text_scale)
    return handles


def _legend(axis: Axes, handles: Plain, figure: figures.Figure, how: str) -> Plain:
    """Put the legend of a panel into the panel; return the handles if the legend belongs above all panels."""
    if how in LEGENDS and handles:
        if how == "inside":
            low, high = axis.get_ylim()
            axis.set_ylim(low, high + 0.16 * -(-len(handles) // 2) * (high - low))
        usual = {"fontsize": LEGEND_PT * figure.text_scale, "ncols": min(len(handles), figure.entries)}
        axis.legend(list(handles.values()), list(handles), **usual | LEGENDS[how])
    return handles if how == "above" else {}


def _spread_names(axis: Axes, panel: Panel, row_in: float) -> None:
    """Move the names of points upwards so that they do not touch each other."""
    is_named = any(isinstance(mark, Markers) and mark.names for mark in panel.marks)
    names: list[Any] = [text for text in axis.texts if is_named and text.get_text()]
    low, high = axis.get_ylim()
    lowest = -1.0
    for name in sorted(names, key=lambda name: name.xy[1]):
        height = (name.xy[1] - low) / (high - low)
        lowest = max(height, lowest + NAME_IN / row_in)
        name.set_position((NAME_PT[0], NAME_PT[1] + 72.0 * row_in * (lowest - height)))


def _scale(axis: Axes, side: str, own: Axis, marks: Sequence[Any]) -> None:
    """Set label, scale and range of an axis."""
    values = [np.abs(own.shown(getattr(mark, side))).ravel() for mark in marks if isinstance(mark, Line | Markers)]
    every = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if own.scale == "log" or (own.scale == "wide" and every.size and every.max() > WIDE * every.min()):
        logarithmic(axis, side)
    largest = [v.max() for v in values if v.size] if own.scale == "far" else []
    if largest and max(largest) > FAR_APART * min(largest) > 0.0:
        getattr(axis, f"set_{side}scale")("symlog", linthresh=10.0 ** np.floor(np.log10(min(largest))))
        getattr(axis, f"{side}axis").set_major_formatter(lambda value, _: f"{value:g}")
    if own.unit == "deg" and every.size and every.max() > RIGHT_ANGLE:
        getattr(axis, f"{side}axis").get_major_locator().set_params(steps=[1, 4.5, 9, 10])
    if own.names:
        getattr(axis, f"set_{side}ticks")(range(len(own.names)), list(own.names))
        axis.grid(visible=False, axis=side)  # type: ignore[arg-type]
    getattr(axis, f"set_{side}label")(own.label if own.is_named else "")


def _limit(axis: Axes, side: str, own: Axis, *, is_first: bool) -> None:
    """Set the range of an axis after all marks are drawn. Only the first of shared axes (`is_first`) adds a margin."""
    limit = getattr(axis, f"set_{side}lim")
    if is_first and (own.below or own.above):
        bottom, top = getattr(axis, f"get_{side}lim")()
        limit(bottom - own.below * (top - bottom), top + own.above * (top - bottom))
    low, high = (None if end is None else float(own.shown(end)) for end in (own.low, own.high))
    if low is not None or high is not None:
        limit(low, high)


def _line(mark: Line, axis: Axes, x: Axis, y: Axis) -> Handle:
    return axis.plot(
        *(x.shown(mark.x), y.shown(mark.y)),
        color=ink(mark.look.color),
        linestyle=mark.look.dash,
        linewidth=mark.width,
        drawstyle="steps-post" if mark.steps else "default",
        label=mark.label or None,
    )[0]


def _band(mark: Band, axis: Axes, x: Axis, y: Axis) -> Handle:
    tint: Plain = {"color": ink("band")}
    if mark.look is not None:
        tint = {"color": ink(mark.look.color), "alpha": TINT}
    ends = y.shown(mark.low), y.shown(mark.high)
    return axis.fill_between(x.shown(mark.x), *ends, lw=0, **tint)


def _points(mark: Markers, axis: Axes, x: Axis, y: Axis) -> Handle:
    color = ink(mark.look.color)
    shown: Plain = {"color": color, "ms": mark.size, "marker": mark.look.marker}
    shown |= {"ls": mark.look.dash if mark.joined else "none", "lw": 0.9}
    shown["mfc"] = color if mark.filled else ink("paper")
    at, values = x.shown(mark.x), y.shown(mark.y)
    for where, name in zip(zip(at, values, strict=True), mark.names, strict=False):
        axis.annotate(name, where, NAME_PT, textcoords="offset points", fontsize=5.5)
    if mark.low is None:
        return axis.plot(at, values, **shown)[0]
    sides = (values - y.shown(mark.low), y.shown(mark.high) - values)
    reach = [np.maximum(np.nan_to_num(side), 0.0) for side in sides]
    return axis.errorbar(at, values, yerr=reach, elinewidth=0.8, capsize=min(mark.size / 2.0, 2.0), **shown)


def _rule(mark: Rule, axis: Axes, x: Axis, y: Axis) -> Handle:
    handle = None
    ways = ((x, mark.x, axis.axvline, axis.axvspan), (y, mark.y, axis.axhline, axis.axhspan))
    for own, value, line, span in ways:
        if isinstance(value, tuple):
            color = ink(mark.look.color if mark.look.color in TINTS else "shade")
            handle = span(*own.shown(value), color=color, lw=0, zorder=0)
        elif value is not None:
            color = ink(mark.look.color)
            handle = line(float(own.shown(value)), color=color, ls=mark.look.dash, lw=mark.width)
    return handle


def _bars(mark: Bars, axis: Axes, x: Axis, y: Axis) -> Handle:
    face: Plain = {"color": ink(mark.look.color), "edgecolor": ink("black"), "linewidth": 0.6}
    if mark.across:
        return axis.barh(y.shown(mark.at), x.shown(mark.values), mark.thickness / y.size, **face)
    return axis.bar(x.shown(mark.at), y.shown(mark.values), mark.thickness / x.size, **face)


def _drawing(mark: Drawing, axis: Axes, x: Axis, y: Axis) -> Handle:
    """Draw arrows, texts, and lines with their filled areas."""
    axis.set_axis_off()
    axis.grid(visible=False)
    for stroke in mark.strokes:
        color, points = ink(stroke.color), np.asarray(stroke.points, dtype=float)
        if stroke.head:
            arrow = {"arrowstyle": stroke.head, "lw": stroke.width, "color": color}
            begin, end = points
            axis.annotate(stroke.text, end, begin, arrowprops=arrow, va="center")
            continue
        if stroke.text:
            across, _, up = stroke.align.partition(" ")
            place: Plain = {"ha": across, "va": up or "center", "fontweight": "bold" if stroke.bold else "normal"}
            left, base = points.reshape(-1, 2)[0]
            axis.text(left, base, stroke.text, fontsize=stroke.size, color=color, **place)
            continue
        if stroke.fill:
            face = {"facecolor": ink(stroke.fill), "alpha": stroke.tint}
            axis.fill(*points.T, edgecolor=color, lw=0.0 if stroke.tint < 1.0 else stroke.width, **face)
        # The outline of an opaque area is drawn with the area, so that later strokes hide both.
        if not stroke.fill or stroke.tint != 1.0:
            line: Any = (0.0, list(stroke.dash)) if stroke.dash else "-"
            cap: Any = stroke.cap
            axis.plot(*points.T, color=color, lw=stroke.width, ls=line, alpha=stroke.opacity, solid_capstyle=cap)
    axis.set(xlim=mark.x, ylim=mark.y)
    if mark.equal:
        axis.set_aspect("equal", anchor="N")


#: Kind of mark -> function that draws the mark and returns its legend handle.
DRAWN: dict[type, Callable[..., Any]] = {
    Line: _line,
    Band: _band,
    Markers: _points,
    Rule: _rule,
    Bars: _bars,
    Drawing: _drawing,
}
