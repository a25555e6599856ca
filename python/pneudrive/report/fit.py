"""Page of a fit of any kind: values with intervals, undetermined values, residuals, data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias

from pneudrive.report.page import view_report
from pneudrive.report.tables import Topic

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.base import Fit
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Block, Section

    Fits: TypeAlias = Mapping[str, Mapping[str, FrictionFit]]


def write_fit_report(fit: Fit, folder: str | Path, more: Iterable[Section] = ()) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    fit : Fit
        Fit of any kind. A fit from a file has no residuals.
    folder : path-like
        Made if it does not exist.
    more : iterable of Section
        Further sections, before the data.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    data, view = Topic("fit", "data"), fit.view()
    # Recordings and nested tables of the provenance are shown elsewhere.
    plain = {k: str(v) for k, v in fit.provenance.items() if not isinstance(v, list | tuple | dict)}
    facts = [*fit.statistics.items(), *plain.items()]
    rows = [(k, v if isinstance(v, str) else f"{v:.6g}") for k, v in facts]
    words = [data.text("intervals"), *([] if view.figures else [data.text("none")])]
    recordings = data.listed(fit.recordings, "recordings")
    about = data.section(*words, data.table(rows), *recordings, synthetic=False)
    return view_report(view, *more, about, synthetic=fit.synthetic).write(folder)


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
