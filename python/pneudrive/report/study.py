"""What a study adds to the report of recordings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.friction.recording.characterisation import Characterisation
    from pneudrive.identify.result import FrictionFit
    from pneudrive.report.page import Block, Section

    #: Group of recordings -> friction law -> its fit.
    Fits: TypeAlias = Mapping[str, Mapping[str, FrictionFit]]


@dataclass(frozen=True)
class Addition:
    """What a study adds to a report.

    Attributes
    ----------
    title : str
        Of a report of the study alone.
    verdict : tuple of str
        Its lines.
    sections : tuple of Section
        They come behind those of the recordings; one with a key that is there already continues that section.
    validity : str
        What is validated on real data and what is not.
    settings : tuple
        Rows of the table of software: name, value.
    sources : tuple
        Where its values are from.
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
    """What has something to add to the report of recordings."""

    def addition(self, found: Characterisation | None) -> Addition:
        """Return what it adds to the report of these recordings, or to an empty one."""
        ...
