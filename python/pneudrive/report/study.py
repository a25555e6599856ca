"""Additions of a study to the report of recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Block, Section

    #: Group of recordings -> friction law -> its fit.
    Fits: TypeAlias = Mapping[str, Mapping[str, FrictionFit]]


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
