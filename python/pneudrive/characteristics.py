"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

from pneudrive.estimate.estimates import Estimate, FTest
from pneudrive.friction.campaign.characteristics import campaign_friction, characterise, recorded_characteristics
from pneudrive.friction.campaign.files import write_characteristics
from pneudrive.friction.campaign.fits import fit_campaign
from pneudrive.friction.campaign.result import CampaignCharacteristics, Curve, CycleResult
from pneudrive.friction.reduction.condition import BOTH, Condition, Skipped
from pneudrive.friction.sentences import Statement
from pneudrive.lazy_names import renamed

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
    "campaign_friction",
    "characterise",
    "fit_campaign",
    "recorded_characteristics",
    "write_characteristics",
]


def __getattr__(name: str) -> object:
    """Return `campaign_friction` by its old name, or raise an error; for a removed function, with its replacement."""
    if name == "characteristics":
        return globals()[renamed(__name__, name, "campaign_friction")]
    if name in ("without_swings", "Contact"):
        raise ImportError(
            f"pneudrive.characteristics.{name} is removed: points with self-excited motion have the flag force_swing "
            "and are not fitted. Measure them with a stiffer sensor."
        )
    raise AttributeError(f"module 'pneudrive.characteristics' has no attribute '{name}'")
