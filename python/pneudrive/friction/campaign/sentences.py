"""Sentences for people: topic, text and remedy stand in sentences.toml; code says when, and with which values."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.describe.toml import read
from pneudrive.friction.campaign.basics import Statement

if TYPE_CHECKING:
    from collections.abc import Iterable

TABLE = Path(__file__).with_name("sentences.toml")
NAMED = 3  # cycles that are named where several share a fate


@lru_cache(maxsize=1)
def table() -> dict[str, dict[str, dict[str, str]]]:
    """Give topic -> name -> text and remedy."""
    return read(TABLE)[0]


def say(name: str, /, **values: Any) -> Statement:  # noqa: ANN401 - whatever the sentence names
    """Make a statement of a sentence of the table; one with a remedy is on what the data do not carry.

    Parameters
    ----------
    name : str
        Topic and name, ``"curve.none"``.
    **values
        What the braces of the sentence name.
    """
    topic, _, key = name.partition(".")
    sentence = table()[topic][key]
    remedy = sentence.get("remedy", "").format(**values)
    return Statement(topic, sentence["text"].format(**values), carried=not remedy, remedy=remedy)


def named(names: Iterable[str], separator: str = ", ") -> str:
    """Name the first of several."""
    return separator.join(list(names)[:NAMED])


def capitalised(text: str) -> str:
    """Begin with a capital letter."""
    return text[:1].upper() + text[1:]
