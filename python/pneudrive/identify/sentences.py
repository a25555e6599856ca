"""Sentences of fits, from sentences.toml."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Any

from pneudrive.describe.files import toml


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    return toml.read(Path(__file__).with_name("sentences.toml"))[0]


def sentences(topic: str) -> dict[str, Any]:
    """Return the sentences of a topic, by name; a sentence on an undetermined value has reason and remedy."""
    return _table()[topic]


_ANY = "record motion that depends on it, or fix it"


def remedy_for(name: str) -> str:
    """Return the recording that would determine a value, in words."""
    plain = name.partition(" [")[0]
    return next((text for pattern, text in sentences("remedies").items() if fnmatchcase(plain, pattern)), _ANY)
