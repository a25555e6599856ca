"""Small plots of points as text, with up to eight points in a character."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

#: Bits of a Braille character by row and column of its 4 x 2 dots, and the character without dots (Unicode).
BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
BLANK = 0x2800
LABEL = 9  # characters left of the frame


def text_plot(
    series: Sequence[tuple[ArrayLike, ArrayLike]],
    width: int,
    height: int,
    *,
    x_label: str = "",
    y_label: str = "",
    log_x: bool = False,
    joined: bool = False,
    x_range: tuple[float, float] | None = None,
) -> list[str]:
    """Draw points.

    Parameters
    ----------
    series : sequence of (x, y)
        Points that are not finite are left out.
    width, height : int
        Size in characters, labels included.
    x_label, y_label : str
        With units.
    log_x : bool
        Logarithmic x axis; x <= 0 is left out.
    joined : bool
        Draw straight lines between the points of a series, which are sorted by x.
    x_range : (float, float), optional
        Range of the axis; default: that of the points.

    Returns
    -------
    list of str
        `height` lines of at most `width` characters.
    """
    columns, rows = max(width - LABEL - 1, 4), max(height - 2, 1)
    x, y = _points(series, log_x, 8 * columns if joined else 0)
    if not x.size:
        return [f"{'':>{LABEL}} {y_label} over {x_label}", f"{'':>{LABEL}} no points yet", *([""] * rows)]
    low, high = (np.log10(x_range) if log_x else x_range) if x_range is not None else (x.min(), x.max())
    bottom, top = float(y.min()), float(y.max())
    dots = np.zeros((4 * rows, 2 * columns), dtype=bool)
    across = _place(x, float(low), float(high), 2 * columns)
    up = _place(y, bottom, top, 4 * rows)
    inside = (across >= 0) & (across < 2 * columns)
    dots[4 * rows - 1 - up[inside], across[inside]] = True
    cells = (dots.reshape(rows, 4, columns, 2) * BITS[None, :, None, :]).sum(axis=(1, 3)) + BLANK
    lines = ["".join(map(chr, row)) for row in cells]
    names = [""] * rows
    names[0], names[-1] = _short(top), _short(bottom)
    ends = [_short(10.0**v if log_x else v) for v in (float(low), float(high))]
    axis = ends[0] + ends[1].rjust(max(columns - len(ends[0]), len(ends[1]) + 1))
    body = [f"{name:>{LABEL}} {line}" for name, line in zip(names, lines, strict=True)]
    return [f"{'':>{LABEL}} {y_label} over {x_label}", *body, f"{'':>{LABEL}} {axis}"]


def _points(series: Sequence[tuple[ArrayLike, ArrayLike]], log_x: bool, between: int) -> tuple[NDArray, NDArray]:
    """Return the finite points of all series, with interpolated points between them on request."""
    xs, ys = [np.zeros(0)], [np.zeros(0)]
    for one in series:
        x, y = (np.asarray(values, dtype=np.float64).ravel() for values in one)
        good = np.isfinite(x) & np.isfinite(y) & ((x > 0.0) if log_x else True)
        x, y = (np.log10(x[good]) if log_x else x[good]), y[good]
        if between and x.size > 1:
            order = np.argsort(x, kind="stable")
            x, y = x[order], y[order]
            line = np.linspace(x[0], x[-1], between)
            x, y = np.append(x, line), np.append(y, np.interp(line, x, y))
        xs.append(x)
        ys.append(y)
    return np.concatenate(xs), np.concatenate(ys)


def _place(values: NDArray, low: float, high: float, cells: int) -> NDArray[np.int64]:
    """Return the cell of each value; the middle cell if the range is empty."""
    if not high > low:
        return np.full(values.size, cells // 2)
    return np.rint((values - low) / (high - low) * (cells - 1)).astype(np.int64)


def _short(value: float) -> str:
    return f"{value:.3g}"
