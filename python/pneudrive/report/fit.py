"""Page of a fit of any kind: values with intervals, undetermined values, residuals, data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.report import axes, style
from pneudrive.report.page import Report
from pneudrive.report.tables import quantity
from pneudrive.report.topics import Topic
from pneudrive.report.words import sentence, spread_evenly

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from pneudrive.identify.base import Fit, FittedData
    from pneudrive.report.page import Section

MOST_PANELS = 12
#: Number of points from which residuals are a line.
MANY = 200


@style.applied()
def write_fit_report(fit: Fit, folder: str | Path) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    fit : Fit
        Fit of any kind. A fit from a file has no residuals.
    folder : path-like
        Made if it does not exist.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    values, lost, data = (Topic("fit", key) for key in ("values", "undetermined", "data"))
    rows = [(k, v if isinstance(v, str) else f"{v:.6g}") for k, v in _facts(fit)]
    parts = [
        values.section(values.text(), values.table(fit.rows())),
        lost.section(*lost.listed(map(sentence, fit.statements()))) if fit.statements() else None,
        _residuals(fit),
        data.section(data.table(rows), *data.listed(fit.recordings, "recordings"), synthetic=False),
    ]
    lines = [sentence(line) for line in (*fit.summary(), *fit.notes)]
    return Report(values.say("page", kind=fit.TITLE), lines, parts, fit.synthetic).write(folder)


def _facts(fit: Fit) -> list[tuple[str, str | float]]:
    """Return statistics and provenance as rows of a table; recordings and nested tables are shown elsewhere."""
    plain = {k: str(v) for k, v in fit.provenance.items() if not isinstance(v, list | tuple | dict)}
    return [*fit.statistics.items(), *plain.items()]


def _residuals(fit: Fit) -> Section:
    topic, every = Topic("fit", "residuals"), fit.compared()
    if not every:
        return topic.section(topic.text("none"))
    shown = spread_evenly(list(every), MOST_PANELS)
    said = topic.text("text", shown=len(shown), all=len(every))
    return topic.section(said, topic.picture("residuals", _figure({name: every[name] for name in shown})))


def _figure(every: dict[str, FittedData]) -> Figure:
    """Draw measured values minus those of the model, with a panel for each channel of each recording."""
    figure, panels = axes.grid(len(every), 2, 1.7, 0.3)
    for axis, (name, one) in zip(panels, every.items(), strict=True):
        (across, x_unit), (up, y_unit) = quantity(one.x), quantity(one.y)
        x, rest = one.at / across, (one.measured - one.model) / up
        keep = style.thin(x)
        if x.size > MANY:
            axis.plot(x[keep], rest[keep], color=style.BLUE, lw=0.6)
        else:
            axes.marks(axis, x, rest, style.look(0), 3.0)
        axes.zero_line(axis)
        if one.x == "speed_m_s":
            axes.speed_axis(axis, x)
        else:
            axis.set_xlabel(f"time / {x_unit}" if x_unit else one.x)
        axis.set(ylabel=f"residual / {y_unit}" if y_unit else "residual", title=name)
    return figure
