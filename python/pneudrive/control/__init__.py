"""Control of a drive along a reference: tune a law from the description, run it on the drive, score it, compare laws.

A law is a word of the core (`pneudrive.control.laws`); its gains follow from the drive that it believes it commands::

    drive = pn.Circuit.load("axis.toml")
    run = pn.control.run(drive, law="nmpc", reference="sine 60 mm 0.5 Hz around 250 mm", setup="real", seed=1)
    run.attrs["score"]["max_error_m"]

All of it is simulation: the laws have seen no machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.lazy import lazy

if TYPE_CHECKING:
    from pneudrive.control.comparison import ControlComparison, compare, standard
    from pneudrive.control.controller import Controller
    from pneudrive.control.loop import run
    from pneudrive.control.measures import Score, score
    from pneudrive.control.own_law import c_header, signals
    from pneudrive.control.references import Reference, reference
    from pneudrive.control.setup import Setup, read_setup
    from pneudrive.control.source_code import export
    from pneudrive.control.tuning import LawModel, Plant, TunedGain, Tuning, laws, tune

__all__ = [
    "ControlComparison",
    "Controller",
    "LawModel",
    "Plant",
    "Reference",
    "Score",
    "Setup",
    "TunedGain",
    "Tuning",
    "c_header",
    "compare",
    "export",
    "laws",
    "read_setup",
    "reference",
    "run",
    "score",
    "signals",
    "standard",
    "tune",
]

__getattr__ = lazy(
    __name__,
    {
        "comparison": ["ControlComparison", "compare", "standard"],
        "controller": ["Controller"],
        "source_code": ["export"],
        "loop": ["run"],
        "measures": ["Score", "score"],
        "own_law": ["c_header", "signals"],
        "references": ["Reference", "reference"],
        "setup": ["Setup", "read_setup"],
        "tuning": ["LawModel", "Plant", "TunedGain", "Tuning", "laws", "tune"],
    },
)
