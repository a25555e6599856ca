"""Sentences on campaigns as statements: what their data determine, what not, and what would."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.friction.campaign.basics import Statement
from pneudrive.friction.sentences import sentence

if TYPE_CHECKING:
    from collections.abc import Iterable

NAMED = 3  # most cycles that a sentence names


def say(name: str, /, **values: Any) -> Statement:  # noqa: ANN401 - whatever the sentence names
    """Return a statement from the table; one with a remedy is on what the data do not determine.

    Parameters
    ----------
    name : str
        Topic and name, ``"curve.none"``.
    **values
        Values for the braces of the sentence.
    """
    remedy = sentence(name, "remedy", **values)
    return Statement(name.partition(".")[0], sentence(name, **values), carried=not remedy, remedy=remedy)


def named(names: Iterable[str], separator: str = ", ") -> str:
    """Return the names of the first of several."""
    return separator.join(list(names)[:NAMED])


def capitalised(text: str) -> str:
    """Return a text with a capital letter."""
    return text[:1].upper() + text[1:]
