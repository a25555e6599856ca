"""Friction maps and other curves from recordings, with uncertainty.

``characterise`` (``pn.characterise``) returns the friction map of recordings or of a campaign as a Dataset.
``characterise_recordings`` also returns the intermediate results for recordings.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.friction.campaign.characteristics import characterise as characterise
    from pneudrive.friction.characterisation import Characterisation as Characterisation
    from pneudrive.friction.characterisation import characterise_recordings as characterise_recordings
    from pneudrive.friction.friction_map import read_map as read_map
    from pneudrive.friction.friction_map import write_map as write_map
    from pneudrive.friction.stick_slip import StickSlip as StickSlip
    from pneudrive.friction.stick_slip import find_stick_slip as find_stick_slip
    from pneudrive.friction.strokes import Settled as Settled
    from pneudrive.friction.strokes import SourcePaper as SourcePaper
    from pneudrive.signals.layout import Layout as Layout
    from pneudrive.signals.load import from_run as from_run
    from pneudrive.signals.load import load_recordings as load_recordings
    from pneudrive.signals.recording import Recording as Recording


__path__: list[str] = []  # nothing lies below this door
