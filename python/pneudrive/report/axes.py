"""Common parts of figures: a grid of panels, a curve with its band, points with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.report import style

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from pneudrive.report.style import Look

WIDE = 3.0  # ratio of speeds beyond which their axis is logarithmic
TINT = 0.15  # of a band in the colour of its curve


def grid(
    count: int,
    columns: int,
    height_in: float,
    rest_in: float,
    *,
    x: str = "",
    y: str = "",
    alone_in: float = style.WIDTH_IN,
    **shared: Any,  # noqa: ANN401
) -> tuple[Figure, list[Axes]]:
    """Make a figure of `count` panels.

    Parameters
    ----------
    count, columns : int
        Number of panels, and most panels side by side.
    height_in, rest_in : float
        Height of a row, and of the space around all rows.
    x, y : str
        Label of every panel, and of those on the left.
    alone_in : float
        Width of the figure with a single panel.
    **shared
        ``sharex``, ``sharey``.
    """
    columns = max(min(columns, count), 1)
    figure = style.new_figure(height_in * -(-count // columns) + rest_in, style.WIDTH_IN if count > 1 else alone_in)
    axes = style.panels(figure, count, columns, **shared)
    for axis in axes:
        axis.set_xlabel(x)
    for axis in axes[::columns]:
        axis.set_ylabel(y)
    return figure, axes


def stack(height_in: float, ratios: Sequence[float], x: str = "time / s") -> tuple[Figure, list[Axes]]:
    """Make a figure of panels below each other on one axis.

    Parameters
    ----------
    height_in : float
    ratios : sequence of float
        Heights of the panels relative to each other.
    x : str
        Label of their axis.
    """
    figure = style.new_figure(height_in)
    axes = list(figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0])
    for axis in axes:
        axis.margins(x=0)
    axes[-1].set_xlabel(x)
    return figure, axes


def legend_over(axis: Axes, columns: int, **more: Any) -> None:  # noqa: ANN401 - of matplotlib
    """Put the legend of a panel above its right end."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=columns, borderaxespad=0.0, **more)


def band(
    axis: Axes,
    x: ArrayLike,
    middle: ArrayLike,
    ends: tuple[ArrayLike, ArrayLike],
    look: Look,
    alpha: float = TINT,
    **line: Any,  # noqa: ANN401 - of matplotlib
) -> None:
    """Draw a curve with its band."""
    axis.fill_between(x, *ends, color=look.color, alpha=alpha, lw=0)  # type: ignore[arg-type]
    axis.plot(x, middle, ls=look.linestyle, color=look.color, **line)  # type: ignore[arg-type]


def tinted(axis: Axes, x: ArrayLike, ends: tuple[ArrayLike, ArrayLike], label: str = "") -> Any:  # noqa: ANN401
    """Draw the band of a prediction."""
    return axis.fill_between(x, *ends, color=style.BAND, lw=0, label=label or None)  # type: ignore[arg-type]


def marks(axis: Axes, x: ArrayLike, y: ArrayLike, look: Look, ms: float, **more: Any) -> None:  # noqa: ANN401
    """Draw points without lines between them."""
    axis.plot(x, y, look.marker, **{"ls": "none", "color": look.color, "mfc": "white", "ms": ms} | more)  # type: ignore[arg-type]


def bars(
    axis: Axes,
    x: ArrayLike,
    y: ArrayLike,
    reach: ArrayLike,
    look: Look,
    **more: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Draw points with intervals, given as one length for both sides, or as a length below and a length above."""
    given = {"fmt": look.marker, "color": look.color, "mfc": "white", "elinewidth": 0.8}
    return axis.errorbar(x, y, yerr=reach, **given | more)  # type: ignore[arg-type]


def arrays(estimates: Iterable[Any], factor: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values, lower and upper ends of estimates."""
    rows = [(e.value, e.low, e.high) for e in estimates if e is not None]
    value, low, high = factor * np.array(rows, dtype=float).reshape(-1, 3).T
    return value, low, high


def spread(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return the lengths of intervals below and above their values."""
    return [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]


def legend_of(figure: Figure, axis: Axes, most: int | None = None) -> None:
    """Put the legend of one panel above all panels, in at most the given number of columns."""
    handles = axis.get_legend_handles_labels()[0]
    if handles:
        style.legend_above(figure, handles, columns=None if most is None else min(len(handles), most))


def speed_axis(axis: Axes, speeds_mm_s: Sequence[float] | np.ndarray) -> None:
    """Label an axis of speed, logarithmic where speeds differ much."""
    speeds = np.asarray(speeds_mm_s, dtype=float)
    if speeds.size and speeds.max() > WIDE * speeds.min():
        style.logarithmic(axis)
    axis.set_xlabel("speed / (mm/s)")


def zero_line(axis: Axes, lw: float = 0.7, color: str = style.BLACK) -> None:
    """Draw a line at zero."""
    axis.axhline(0.0, color=color, lw=lw)


def duration_axis(axis: Axes, title: str) -> None:
    """Label a panel of breakaway over the duration of stops."""
    style.logarithmic(axis)
    axis.set(xlabel="stop duration / s", ylabel="breakaway increment / N", title=title)
