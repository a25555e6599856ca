"""Figures as data: panels with curves and other marks, on axes with quantity and unit. This module does not draw.

All values are in SI. An axis divides them by the size of its unit, so that figures need no conversion factors. The
renderer for reports (`pneudrive.report.render`) and the page read the same figure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from pneudrive.units import TABLE

if TYPE_CHECKING:
    import numpy as np

WIDTH_IN = 7.1  # 180 mm: the text width of a printed page
#: Numbers of a mark, in any sequence. The data of a view have lists, with None for non-finite numbers.
if TYPE_CHECKING:
    Numbers: TypeAlias = Any
    Grid: TypeAlias = Any
else:
    Numbers = list[float | None]
    Grid = list[Numbers]
#: Additions to a unit that do not change its size.
ADDITIONS = (" abs", " gauge")


class Look(NamedTuple):
    """Appearance of a mark: colour by name or by position on the ramp from light (0) to dark (1), dash, and marker."""

    color: str | float = "black"
    dash: Any = "-"
    marker: str = "o"


#: Looks of curves in one panel. They differ in dash, marker, colour and lightness.
LOOKS = (
    Look("black", "-", "o"),
    Look("blue", "--", "s"),
    Look("orange", "-.", "^"),
    Look("green", ":", "D"),
    Look("grey", (0, (5, 1)), "v"),
    Look("black", (0, (1, 1)), "P"),
    Look("blue", (0, (3, 1, 1, 1, 1, 1)), "X"),
    Look("orange", (0, (7, 2)), "*"),
)
#: Looks with the same meaning in all figures.
MEASURED, MODEL, RESIDUAL, THIN = Look(), Look("orange", "--"), Look("blue", "-", "."), Look("grey", "-", ".")


def look(index: int) -> Look:
    """Return the look of the curve with this index. Looks repeat after eight curves."""
    return LOOKS[index % len(LOOKS)]


def ramp(index: int, count: int) -> Look:
    """Return the look of curve `index` of `count` ordered curves (pressures, durations), from light to dark."""
    return Look(index / max(count - 1, 1), "-", LOOKS[index % len(LOOKS)].marker)


@dataclass(frozen=True)
class Axis:
    """Label, unit, scale and range of an axis.

    Attributes
    ----------
    label : str
        Quantity and unit, ``"position / mm"``. A label without a unit is for a dimensionless quantity.
    scale : str
        ``"linear"``, ``"log"``, ``"wide"`` (logarithmic if the values differ by a factor above 3), or ``"far"``
        (logarithmic on both sides of zero if the largest values of the lines differ by a factor above 20).
    low, high : float or None
        Ends of the axis in SI. None: the ends of the data.
    below, above : float
        Room below and above the data, as a fraction of their range.
    names : sequence of str
        Names of the positions 0, 1, 2 ... of a bar chart.
    is_si : bool
        False for values that are already in the unit of the label.
    is_named : bool
        False if the title of the panel already shows the label.
    unit : str
        Unit of the label, without parentheses.
    size : float
        Size of the unit in SI; 1 for a unit that is not in the table of units.
    """

    label: str = ""
    scale: str = "linear"
    low: float | None = None
    high: float | None = None
    below: float = 0.0
    above: float = 0.0
    names: Sequence[str] = ()
    is_si: bool = True
    is_named: bool = True
    unit: str = field(default="", init=False)
    size: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        """Read the unit in the label."""
        shown = self.label.replace("/\n", "/ ").rpartition(" / ")[2].strip("()") if "/" in self.label else ""
        unit = shown if self.is_si else ""
        for addition in ADDITIONS:
            unit = unit.removesuffix(addition)
        size = 0.01 if unit.startswith("%") else TABLE[unit][1] if unit in TABLE else 1.0
        object.__setattr__(self, "unit", shown)
        object.__setattr__(self, "size", size)

    def shown(self, values: Any) -> np.ndarray:  # noqa: ANN401 - any array
        """Return SI values in the unit of the axis."""
        import numpy as np

        return np.asarray(values, dtype=float) / self.size


@dataclass(frozen=True)
class Line:
    """A curve. `width` is in points. With `steps`, each value holds until the next one."""

    x: Numbers
    y: Numbers
    label: str = ""
    look: Look = MEASURED
    width: float | None = None
    steps: bool = False
    kind: Literal["line"] = "line"


@dataclass(frozen=True)
class Band:
    """The area between two curves. Without a look, it has the colour of predictions."""

    x: Numbers
    low: Numbers
    high: Numbers
    label: str = ""
    look: Look | None = None
    kind: Literal["band"] = "band"


@dataclass(frozen=True)
class Markers:
    """Points with intervals from `low` to `high`. `joined` draws lines between the points, and `names` labels them."""

    x: Numbers
    y: Numbers
    label: str = ""
    look: Look = MEASURED
    low: Numbers | None = None
    high: Numbers | None = None
    size: float = 4.0
    filled: bool = False
    joined: bool = False
    names: Sequence[str] = ()
    kind: Literal["markers"] = "markers"


@dataclass(frozen=True)
class Rule:
    """A straight line at a value of x or y, or a tinted range between two values."""

    x: float | tuple[float, float] | None = None
    y: float | tuple[float, float] | None = None
    label: str = ""
    look: Look = THIN
    width: float = 0.7
    kind: Literal["rule"] = "rule"


@dataclass(frozen=True)
class Bars:
    """Bars at positions on an axis with or without names. `across` makes the bars horizontal."""

    at: Numbers
    values: Numbers
    label: str = ""
    look: Look = RESIDUAL
    thickness: float = 0.8
    across: bool = False
    kind: Literal["bars"] = "bars"


@dataclass(frozen=True)
class PenStroke:
    """A line, an area (if `fill` is set), an arrow (if `head` is set) or a text, in the coordinates of its drawing.

    Attributes
    ----------
    points : sequence, shape (k, 2)
        Corners, or the single point of a text.
    text : str
    color, fill : str
        Names of colours; "" for no area.
    width, size : float
        Width of a line and size of a text, in points.
    dash : sequence of float
        Lengths of dashes and gaps, in line widths; empty for a solid line.
    opacity, tint : float
        Opacity of the line and of the area.
    align : str
        Horizontal and vertical alignment of a text.
    head, cap : str
        Shape of the head of an arrow, and of the ends of a line.
    bold : bool
    """

    points: Grid
    text: str = ""
    color: str = "black"
    fill: str = ""
    width: float = 0.8
    size: float = 7.0
    dash: Sequence[float] = ()
    opacity: float = 1.0
    tint: float = 1.0
    align: str = "center center"
    head: str = ""
    cap: str = "round"
    bold: bool = False


@dataclass(frozen=True)
class Drawing:
    """Pen strokes in the ranges `x` and `y`, without axes. `equal` requires the same scale in both directions."""

    strokes: Sequence[PenStroke]
    x: tuple[float, float]
    y: tuple[float, float]
    equal: bool = False
    kind: Literal["drawing"] = "drawing"


Mark: TypeAlias = Line | Band | Markers | Rule | Bars | Drawing


@dataclass(frozen=True)
class Panel:
    """Marks on two axes. If an axis is empty, the axis of the figure is used."""

    marks: Sequence[Mark]
    title: str = ""
    x: Axis | str = ""
    y: Axis | str = ""
    legend: str | None = None


@dataclass(frozen=True)
class Figure:
    """Panels in a grid, row by row.

    Attributes
    ----------
    panels : sequence of Panel or None
        None leaves a cell of the grid empty.
    x, y : Axis or str
        Axes of the panels that do not define axes.
    columns : int
        Largest number of panels side by side.
    row_in, rest_in, width_in : float
        Height of each row, height added once for the margins, and width, in inches.
    share_x, share_y : str
        "all", "col" or "row" for equal ranges in all panels, a column or a row; "" for a separate range in each panel.
    heights, widths : sequence of float
        Ratios of the heights of rows and of the widths of columns. Empty: equal sizes.
    legend : str
        "above" for one legend above all panels, "panel" for one in each panel, "inside" for one in each panel above the
        data, "over" for one above each panel, "under" for one below a drawing, or "".
    entries : int
        Largest number of legend entries side by side.
    title : str
    text_scale : float
        Ratio of the size of the text to the usual size.
    has_margins : bool
        False for a drawing that fills its paper.
    tall : Panel or None
        A panel over all rows in a separate column: the first column if `tall_first`, otherwise the last.
    """

    panels: Sequence[Panel | None]
    x: Axis | str = ""
    y: Axis | str = ""
    columns: int = 1
    row_in: float = 2.0
    rest_in: float = 0.5
    width_in: float = WIDTH_IN
    share_x: str = ""
    share_y: str = ""
    heights: Sequence[float] = ()
    widths: Sequence[float] = ()
    legend: str = "above"
    entries: int = 4
    title: str = ""
    text_scale: float = 1.0
    has_margins: bool = True
    tall: Panel | None = None
    tall_first: bool = False

    @property
    def grid(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        columns = max(min(self.columns, len(self.panels)), 1)
        return max(-(-len(self.panels) // columns), 1), columns

    def axes_of(self, panel: Panel) -> tuple[Axis, Axis]:
        """Return both axes of a panel."""
        return axis(panel.x or self.x), axis(panel.y or self.y)

    def data(self) -> dict[str, Any]:
        """Return plain data for the page and for tests. Values are in SI. Each axis has a unit and the unit's size."""
        return plain_data(self)


def axis(given: Axis | str) -> Axis:
    """Return the axis, or a linear axis with the given label."""
    return Axis(given) if isinstance(given, str) else given


def label_of(quantity: str, unit: str) -> str:
    """Return the label of an axis. A unit with a slash is written in parentheses.

    Examples
    --------
    >>> label_of("speed", "mm/s"), label_of("gain", "1")
    ('speed / (mm/s)', 'gain')
    """
    return quantity if unit in ("", "1") else f"{quantity} / {f'({unit})' if '/' in unit else unit}"


#: Axis of speeds in many figures, logarithmic for a wide range.
SPEED = Axis("speed / (mm/s)", "wide")


def stack(
    panels: Sequence[Panel],
    height_in: float,
    heights: Sequence[float] = (),
    x: Axis | str = "time / s",
    **more: Any,  # noqa: ANN401 - fields of the figure
) -> Figure:
    """Return a figure with a column of panels, a common x axis and the total height `height_in`."""
    return Figure(
        panels, x, row_in=height_in / max(len(panels), 1), rest_in=0.0, share_x="all", heights=heights, **more
    )


def banded(
    x: Numbers,
    y: Numbers,
    low: Numbers,
    high: Numbers,
    label: str = "",
    look: Look = MEASURED,
    width: float | None = None,
) -> list[Band | Line]:
    """Return a curve and its band with the same look."""
    return [Band(x, low, high, look=look), Line(x, y, label, look, width)]


def thin(values: Any, most: int = 4000) -> slice:  # noqa: ANN401 - any sequence
    """Return a slice that selects evenly spaced samples of a long record, fewer than ``2 * most``."""
    return slice(None, None, max(len(values) // most, 1))


def ends(estimates: Any, factor: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # noqa: ANN401
    """Return values, lower bounds and upper bounds of estimates, multiplied by `factor`."""
    import numpy as np

    rows = [(e.value, e.low, e.high) for e in estimates if e is not None]
    value, low, high = factor * np.array(rows, dtype=float).reshape(-1, 3).T
    return value, low, high


def plain_data(value: Any) -> Any:  # noqa: ANN401 - any data
    """Convert a value to lists, mappings, numbers and texts. Non-finite numbers become None."""
    if is_dataclass(value) and not isinstance(value, type):
        items = {own.name: getattr(value, own.name) for own in fields(value)}
        items |= {key: axis(items[key]) for key in "xy" if isinstance(items.get(key), str)}
        return {key: plain_data(item) for key, item in items.items()}
    if isinstance(value, Mapping):
        return {str(key): plain_data(item) for key, item in value.items()}
    if tolist := getattr(value, "tolist", None):  # of numpy, which a command without figures does not import
        return plain_data(tolist())
    if isinstance(value, list | tuple):
        return [plain_data(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
