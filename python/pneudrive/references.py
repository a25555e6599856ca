"""Sources of equations and values: entries of references.bib by key."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pneudrive.errors import PneudriveError

FILE = Path(__file__).resolve().parent / "data" / "references.bib"


@cache
def entries() -> dict[str, str]:
    """Return all BibTeX entries by key."""
    found = {}
    for block in ("\n" + FILE.read_text(encoding="utf-8")).split("\n@")[1:]:
        key = block[block.index("{") + 1 : block.index(",")].strip()
        found[key] = f"@{block[: block.rindex('}') + 1]}"
    return found


def bibtex(key: str) -> str:
    """Return the BibTeX entry with this key.

    Raises
    ------
    PneudriveError
        The key has no entry.
    """
    if key not in entries():
        raise PneudriveError(f"references.bib has no entry '{key}'")
    return entries()[key]
