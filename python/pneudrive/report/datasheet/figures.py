"""Figures of characteristics: one panel for each, its curves with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.sheet import in_words, shown_unit
from pneudrive.errors import CommandError
from pneudrive.report import style
from pneudrive.report.axes import TINT
from pneudrive.report.written import drawn

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT_IN, WIDTH_IN = 2.6, 4.6
MOST_CURVES, MOST_BARS = 5, 12
ROW = 0.16  # height of a row of the legend, of that of the curves
LOGARITHMIC = 30.0  # ratio of frequencies from which on their axis is logarithmic


def plot_characteristic(found: xr.Dataset, path: str | Path | None = None) -> Figure:
    """Draw a characteristic.

    Parameters
    ----------
    found : xarray.Dataset
        From `pneudrive.characteristic`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        It is a number without a curve, the suffix is unknown, or the file cannot be written.
    """
    one = characteristics()[found.attrs["characteristic"]]
    if not one.x:
        raise CommandError(
            f"{one.name} has no curve", remedy="This result is not drawn; its numbers are in the data set."
        )

    def figure() -> Figure:
        names = one.y.split()
        made = style.new_figure(HEIGHT_IN * len(names), WIDTH_IN)
        for axis, name in zip(made.subplots(len(names), 1, squeeze=False)[:, 0], names, strict=True):
            panel(axis, found, name)
        style.finish(made, synthetic=True)
        return made

    return drawn(figure, path)


def panel(axis: Axes, found: xr.Dataset, name: str = "", title: str = "") -> None:
    """Draw one result of a characteristic into a panel."""
    one = characteristics()[found.attrs["characteristic"]]
    name, *others = [name] if name else one.y.split()
    axis.set_title(title or one.title, loc="left")
    if found[one.x].dtype.kind in "US":
        return _bars(axis, found, one.x, name)
    for other in others:  # its own axis on the right, dashed
        right, look = axis.twinx(), style.look(1)
        for _, x, y, *_ in _curves(found, one.x, other):
            right.plot(x, y, ls="--", color=look.color)
        right.set_ylabel(_label(found, other), color=look.color)
    for index, (label, x, y, low, high) in enumerate(_curves(found, one.x, name)):
        look = style.look(index)
        axis.plot(x, y, ls=look.linestyle, color=look.color, label=label or None)
        if low is not None and high is not None:
            axis.fill_between(x, low, high, color=look.color, alpha=TINT, lw=0)
    axis.set_xlabel(_label(found, one.x))
    axis.set_ylabel(_label(found, name))
    xs = np.abs(np.asarray(found[one.x], dtype=float))
    if found[one.x].attrs["units"] == "Hz" and xs.max() > LOGARITHMIC * xs.min() > 0.0:
        style.logarithmic(axis)
    _legend(axis)
    return None


def _legend(axis: Axes) -> None:
    """Add a legend in two columns, with room for it above the curves."""
    handles = axis.get_legend_handles_labels()[0]
    if handles:
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + ROW * -(-len(handles) // 2) * (high - low))
        axis.legend(loc="upper left", borderaxespad=0.1, ncols=2, fontsize=6.5, handlelength=2.0, labelspacing=0.3)


def _label(found: xr.Dataset, name: str) -> str:
    unit = shown_unit(found[name].attrs["units"])[1]
    words = in_words(name)
    return words if unit in ("1", "") else f"{words} / {unit if unit.count('/') == 0 else f'({unit})'}"


def _curves(
    found: xr.Dataset, x: str, name: str
) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]]:
    """Yield label, abscissa, ordinate and both ends of its interval of each curve, in shown units."""
    along = found[x].dims[-1]
    others = [str(dim) for dim in found[name].dims if dim != along]
    factor, by = shown_unit(found[name].attrs["units"])[0], shown_unit(found[x].attrs["units"])[0]
    points = [{}] if not others else [{others[0]: k} for k in range(found.sizes[others[0]])]
    if len(points) > MOST_CURVES:
        points = [points[k] for k in np.linspace(0, len(points) - 1, MOST_CURVES).astype(int)]
    for at in points:
        abscissa = found[x].isel({dim: k for dim, k in at.items() if dim in found[x].dims})
        low, high = (
            factor * np.asarray(found[f"{name}_{end}"].isel(at)) if f"{name}_{end}" in found else None
            for end in ("low", "high")
        )
        yield (
            _of(found, at, at is points[0]),
            by * np.asarray(abscissa, dtype=float),
            factor * np.asarray(found[name].isel(at)),
            low,
            high,
        )


def _of(found: xr.Dataset, at: dict[str, int], is_first: bool) -> str:
    """Return the label of a curve; only the first one names the quantity."""
    words = ", ".join(value_in_words(found, dim, k) for dim, k in at.items())
    names = [in_words(dim) for dim in at if found[dim].dtype.kind not in "US"]
    return words if is_first else words.removeprefix("".join(names)).strip()


def value_in_words(found: xr.Dataset, dim: str, index: int) -> str:
    """Return a position on an axis as text."""
    value = found[dim].to_numpy()[index]
    if isinstance(value, str):
        return value
    factor, unit = shown_unit(found[dim].attrs["units"])
    return f"{in_words(dim)} {factor * float(value):.3g}{'' if unit == '1' else f' {unit}'}"


def _bars(axis: Axes, found: xr.Dataset, x: str, name: str) -> None:
    """Draw one bar for each entry, the largest on top."""
    factor, _ = shown_unit(found[name].attrs["units"])
    labels, values = [str(one) for one in found[x].to_numpy()], factor * np.asarray(found[name])
    order = np.argsort(values)
    if len(order) > MOST_BARS:
        order = [k for k in order if k in np.argsort(-np.abs(values))[:MOST_BARS]]
    axis.barh([labels[k] for k in order], values[order], color=style.BLUE, height=0.6)
    axis.set_xlabel(_label(found, name))
