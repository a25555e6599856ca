"""Sentences on recordings and campaigns: they stand in sentences.toml; code says when, and with which values."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from pneudrive.describe.toml import read


@lru_cache(maxsize=1)
def table() -> dict[str, dict[str, str | dict[str, str]]]:
    """Return topic -> name -> sentence, or its parts: text and remedy."""
    return read(Path(__file__).with_name("sentences.toml"))[0]


def sentence(name: str, part: str = "text", /, **values: Any) -> str:  # noqa: ANN401 - whatever the sentence names
    """Fill in a sentence of the table.

    Parameters
    ----------
    name : str
        Topic and name, ``"doubt.no_friction"``.
    part : {"text", "remedy"}
        A sentence without a remedy gives "" for it.
    **values
        What the braces of the sentence name.
    """
    topic, _, key = name.partition(".")
    found = table()[topic][key]
    parts = {"text": found} if isinstance(found, str) else found
    return parts.get(part, "").format(**values)
