"""Friction maps and other curves from recordings, with uncertainty.

``characterise`` is ``pn.characterise``: the friction map of recordings or of a campaign, as a Dataset.
``characterise_recordings`` also returns the intermediate results for recordings.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.friction.campaign.characteristics import characterise
    from pneudrive.friction.characterisation import Characterisation, characterise_recordings
    from pneudrive.friction.friction_map import read_map, write_map
    from pneudrive.friction.stick_slip import StickSlip, find_stick_slip
    from pneudrive.friction.strokes import Settled, SourcePaper
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
