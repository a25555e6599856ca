"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

import sys
from typing import NoReturn

from pneudrive.estimate.estimates import Estimate, FTest
from pneudrive.friction.campaign import characteristics as _characteristics
from pneudrive.friction.campaign import compare as _compare
from pneudrive.friction.campaign import files, result
from pneudrive.friction.campaign import stops as _stops
from pneudrive.friction.campaign.characteristics import characterise, characteristics, recorded_characteristics
from pneudrive.friction.campaign.compare import comparison, curves
from pneudrive.friction.campaign.effects import effect
from pneudrive.friction.campaign.files import write_characteristics
from pneudrive.friction.campaign.fits import fit_campaign
from pneudrive.friction.campaign.result import CampaignCharacteristics, Curve, CycleResult
from pneudrive.friction.campaign.stops import dwell_design, dwell_forms, dwell_law, recovery, relaxation, stop
from pneudrive.friction.reduction.condition import BOTH, Condition, Skipped
from pneudrive.friction.sentences import Statement

__all__ = [
    "BOTH",
    "CampaignCharacteristics",
    "Condition",
    "Curve",
    "CycleResult",
    "Estimate",
    "FTest",
    "Skipped",
    "Statement",
    "characterise",
    "characteristics",
    "fit_campaign",
    "recorded_characteristics",
    "write_characteristics",
]

# Modules that earlier versions listed below this name.
_LISTED = {
    "basics": sys.modules[__name__],
    "files": files,
    "result": result,
    "campaign": _characteristics,
    "compare": _compare,
    "compare.comparison": comparison,
    "compare.curves": curves,
    "effects": effect,
    "stops": _stops,
    "stops.stop": stop,
    "stops.dwell_design": dwell_design,
    "stops.dwell_forms": dwell_forms,
    "stops.dwell_law": dwell_law,
    "stops.recovery": recovery,
    "stops.relaxation": relaxation,
}
__path__: list[str] = []  # there are no others
for _name, _module in _LISTED.items():
    sys.modules[f"{__name__}.{_name}"] = _module


def __getattr__(name: str) -> NoReturn:
    """Raise an error; for a removed function, with its replacement."""
    if name in ("without_swings", "Contact"):
        raise ImportError(
            f"pneudrive.characteristics.{name} is removed: points with self-excited motion have the flag force_swing "
            "and are not fitted. Measure them with a stiffer sensor."
        )
    raise AttributeError(f"module 'pneudrive.characteristics' has no attribute '{name}'")
