"""Recordings into friction maps and other curves, with uncertainty.

``characterise`` gives the friction map as a Dataset; ``characterise_recordings`` everything behind it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.lazy import lazy

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr

    from pneudrive.friction.friction_map import read_map, write_map
    from pneudrive.friction.recording.characterisation import Characterisation, characterise_recordings
    from pneudrive.friction.reduction.settling import SampleChoice, Settled, SourcePaper
    from pneudrive.friction.reduction.stick_slip import StickSlip, find_stick_slip
    from pneudrive.signals.layout import Layout
    from pneudrive.signals.load import load_recordings
    from pneudrive.signals.recording import Recording
    from pneudrive.signals.trajectories import from_run

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
        "pneudrive.friction.friction_map": ["read_map", "write_map"],
        "pneudrive.friction.recording.characterisation": ["Characterisation", "characterise_recordings"],
        "pneudrive.friction.reduction.settling": ["Settled", "SourcePaper"],
        "pneudrive.friction.reduction.stick_slip": ["StickSlip", "find_stick_slip"],
        "pneudrive.signals.layout": ["Layout"],
        "pneudrive.signals.load": ["load_recordings"],
        "pneudrive.signals.recording": ["Recording"],
        "pneudrive.signals.trajectories": ["from_run"],
    },
)


def characterise(
    recordings: Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset,
    layout: Layout | str | Path | None = None,
    protocol: SampleChoice | None = None,
) -> xr.Dataset:
    """Give the friction map of recordings.

    Parameters
    ----------
    recordings
        Recordings, files or trajectories (what ``pn.simulate`` returns), or one of them.
    layout
        How files are read: a layout, its file, or None for ``layout.toml`` beside each recording.
    protocol
        Which samples count: ``Settled()`` (default) or ``SourcePaper()``.

    Returns
    -------
    xarray.Dataset
        One dimension ``row`` (recording, speed level, direction); every variable carries its unit.

    Raises
    ------
    RecordingError, LayoutError
        A file or recording that cannot be used; what, where, value, rule and remedy.
    """
    from pneudrive.friction.recording.characterisation import characterise_recordings

    return characterise_recordings(recordings, layout, protocol).friction_map
