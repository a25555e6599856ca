"""Friction maps and other curves from recordings, with uncertainty.

``characterise`` is ``pn.characterise``: the friction map of recordings or of a campaign, as a Dataset.
``characterise_recordings`` also returns the intermediate results for recordings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.lazy_names import lazy

if TYPE_CHECKING:
    from pneudrive.friction.campaign.characteristics import characterise
    from pneudrive.friction.characterisation import Characterisation, characterise_recordings
    from pneudrive.friction.friction_map import read_map, write_map
    from pneudrive.friction.motion import Settled, SourcePaper
    from pneudrive.friction.stick_slip import StickSlip, find_stick_slip
    from pneudrive.signals.layout import Layout
    from pneudrive.signals.load import from_run, load_recordings
    from pneudrive.signals.recording import Recording

__all__ = [
    "Characterisation",
    "Layout",
    "Recording",
    "Settled",
    "SourcePaper",
    "StickSlip",
    "characterise",
    "characterise_recordings",
    "find_stick_slip",
    "from_run",
    "load_recordings",
    "read_map",
    "write_map",
]

__path__: list[str] = []  # nothing lies below this door
__getattr__ = lazy(
    __name__,
    {
        "pneudrive.friction.campaign.characteristics": ["characterise"],
        "pneudrive.friction.friction_map": ["read_map", "write_map"],
        "pneudrive.friction.characterisation": ["Characterisation", "characterise_recordings"],
        "pneudrive.friction.motion": ["Settled", "SourcePaper"],
        "pneudrive.friction.stick_slip": ["StickSlip", "find_stick_slip"],
        "pneudrive.signals.layout": ["Layout"],
        "pneudrive.signals.load": ["from_run", "load_recordings"],
        "pneudrive.signals.recording": ["Recording"],
    },
)
