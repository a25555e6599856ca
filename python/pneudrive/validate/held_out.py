"""Recordings that made a fit, and recordings that were held out: only the latter test the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pneudrive.describe.drive import Drive

MADE, HELD_OUT = "made the fit", "held out"  # badges of a recording
NONE_HELD_OUT = "no recording was held out: all of them made the fit, so nothing tests its predictions"


def sources_of(drive: Drive) -> dict[str, str]:
    """Return the recordings of the identified values of a drive, without hashes. A drive file lists the first six."""
    texts = {origin.source for origin in drive.provenance.values()} - {"not stated"}
    return {name: "" for text in texts for name in text.partition(" and ")[0].split(", ")}


def badge_of(name: str, sha256: str, fitted: Mapping[str, str]) -> str:
    """Return the badge of a recording; empty if no recordings of a fit are known.

    Parameters
    ----------
    name, sha256 : str
        Of the recording.
    fitted : mapping
        Name of each recording of the fit -> its hash, empty if unknown. Hashes decide if there are any.
    """
    if not fitted:
        return ""
    hashes = set(fitted.values()) - {""}
    return MADE if (sha256 in hashes if hashes else name in fitted) else HELD_OUT


def held_out_notes(badges: Iterable[str]) -> list[str]:
    """Return a sentence if no recording was held out, or if the verdicts leave out recordings of the fit."""
    found = list(badges)
    if MADE not in found:
        return []
    if HELD_OUT not in found:
        return [NONE_HELD_OUT]
    return [f"recordings held out of the fit: {found.count(HELD_OUT)} of {len(found)}. Only they count in the verdicts"]
