"""Page of a fit of any kind: values with intervals, undetermined values, residuals, data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias

from pneudrive.figures import RESIDUAL, SPEED, Figure, Line, Markers, Panel, Rule, thin
from pneudrive.report.page import Report
from pneudrive.report.tables import quantity, sentence, spread_evenly
from pneudrive.report.topics import Topic

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.base import Fit, FittedData
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Block, Section

    Fits: TypeAlias = Mapping[str, Mapping[str, FrictionFit]]


MOST_PANELS = 12
#: Number of points from which residuals are a line.
MANY = 200


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
    # Recordings and nested tables of the provenance are shown elsewhere.
    plain = {k: str(v) for k, v in fit.provenance.items() if not isinstance(v, list | tuple | dict)}
    facts = [*fit.statistics.items(), *plain.items()]
    rows = [(k, v if isinstance(v, str) else f"{v:.6g}") for k, v in facts]
    parts = [
        values.section(values.text(), values.table(fit.rows())),
        lost.section(*lost.listed(map(sentence, fit.statements()))) if fit.statements() else None,
        _residuals(fit),
        data.section(data.table(rows), *data.listed(fit.recordings, "recordings"), synthetic=False),
    ]
    lines = [sentence(line) for line in (*fit.summary(), *fit.notes)]
    return Report(values.say("page", kind=fit.TITLE), lines, parts, fit.synthetic).write(folder)


def _residuals(fit: Fit) -> Section:
    topic, every = Topic("fit", "residuals"), fit.compared()
    if not every:
        return topic.section(topic.text("none"))
    shown = spread_evenly(list(every), MOST_PANELS)
    text = topic.text("text", shown=len(shown), all=len(every))
    figure = Figure([_panel(name, every[name]) for name in shown], columns=2, row_in=1.7, rest_in=0.3)
    return topic.section(text, topic.picture("residuals", figure))


def _panel(name: str, data: FittedData) -> Panel:
    """Draw measured values minus those of the model of one channel of one recording."""
    rest, x_unit, y_unit = data.measured - data.model, quantity(data.x)[1], quantity(data.y)[1]
    part = thin(data.at)
    is_line = data.at.size > MANY
    mark = Line(data.at[part], rest[part], look=RESIDUAL, width=0.6) if is_line else Markers(data.at, rest, size=3.0)
    x = SPEED if data.x == "speed_m_s" else f"time / {x_unit}" if x_unit else data.x
    y_label = f"residual / {y_unit if '/' not in y_unit else f'({y_unit})'}" if y_unit else "residual"
    return Panel([mark, Rule(y=0.0)], name, x, y_label)


# --- Additions of a study to the report of recordings.


@dataclass(frozen=True)
class Addition:
    """The addition of a study to a report.

    Attributes
    ----------
    title : str
        Title of a report that contains only the study.
    verdict : tuple of str
        Lines of the verdict.
    sections : tuple of Section
        They follow those of the recordings. A section with an existing key continues that section.
    validity : str
        Text on validation with real data, and its limits.
    settings : tuple
        Rows of the table of software: name, value.
    sources : tuple
        Sources of its values.
    cited, laws : tuple of str
        Keys of references.bib, and friction laws whose sources are named.
    """

    title: str
    verdict: tuple[str, ...]
    sections: tuple[Section, ...]
    validity: str
    settings: tuple[tuple[str, str], ...] = ()
    sources: tuple[Block, ...] = ()
    cited: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()


class Study(Protocol):
    """An object that adds to the report of recordings."""

    def addition(self, found: Characterisation | None) -> Addition:
        """Return the sections that this study adds to a report, with or without recordings."""
        ...


@dataclass(frozen=True)
class WithSections:
    """A study followed by the sections of further studies."""

    study: Study
    sections: tuple[Section, ...]

    def addition(self, found: Characterisation | None) -> Addition:
        """Return the sections that this study adds to a report, with or without recordings."""
        own = self.study.addition(found)
        return replace(own, sections=(*own.sections, *self.sections))
