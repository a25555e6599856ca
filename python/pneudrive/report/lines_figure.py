"""Speed and stroke time of a drive against the length and the bore of its tubes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.report import style
from pneudrive.report.written import PICTURES, write_picture
from pneudrive.trajectory import check_target

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

#: Panel: its label, factor from SI, and the variable in it.
_PANELS = (
    ("mean speed of the stroke / (m/s)", 1.0, "mean_speed"),
    ("stroke time / s", 1.0, "stroke_time_out"),
)


def plot_lines(study: xr.Dataset, path: str | Path | None = None) -> Figure:
    """Draw mean speed and stroke time over the length of the tubes, a curve for each bore.

    Parameters
    ----------
    study : xarray.Dataset
        From `pneudrive.lines`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    target = None if path is None else check_target(path, PICTURES)
    with style.applied():
        figure = style.new_figure(2.9)
        axes = figure.subplots(1, len(_PANELS))
        for axis, (label, factor, name) in zip(axes, _PANELS, strict=True):
            for number, diameter in enumerate(study.diameter.to_numpy()):
                look = style.ramp(number, study.sizes["diameter"])
                words = f"{1e3 * diameter:g} mm bore"
                axis.plot(study.length, factor * study[name][number], **look._asdict(), label=words)
            without = factor * study.attrs["without_tubes"][name]
            axis.axhline(without, color=style.GREY, linestyle="--", label="without tubes")
            axis.set_xlabel("length of each tube / m")
            axis.set_ylabel(label)
            axis.set_xlim(left=0.0)
            axis.set_ylim(bottom=0.0)
        style.legend_above(figure, axes[0].get_legend_handles_labels()[0])
        style.finish(figure, synthetic=True)
        if target is not None:
            write_picture(figure, target)
    return figure
