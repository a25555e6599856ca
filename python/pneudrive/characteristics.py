"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

import sys
from importlib import import_module

from pneudrive.estimate.estimates import Estimate, FTest
from pneudrive.friction.campaign.characteristics import characterise, characteristics
from pneudrive.friction.campaign.files import write_characteristics
from pneudrive.friction.campaign.fits import fit_campaign
from pneudrive.friction.campaign.result import CampaignCharacteristics, Curve, CycleResult
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
    "write_characteristics",
]

# Modules that earlier versions listed below this name, and where they lie in `pneudrive.friction`.
_LISTED = {
    **{name: name for name in ("files", "result")},
    **{name: name for name in ("compare", "compare.comparison", "compare.curves", "stops", "stops.stop")},
    **{
        f"stops.{name}": f"stops.{name}"
        for name in ("dwell_design", "dwell_forms", "dwell_law", "recovery", "relaxation")
    },
    "campaign": "characteristics",
    "effects": "effects.effect",
}
__path__: list[str] = []  # there are no others
for _name, _home in _LISTED.items():
    sys.modules[f"{__name__}.{_name}"] = import_module(f"pneudrive.friction.campaign.{_home}")
sys.modules[f"{__name__}.basics"] = sys.modules[__name__]  # its names are here
