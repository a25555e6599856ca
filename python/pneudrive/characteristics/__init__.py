"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

from pneudrive.characteristics.basics import BOTH, Condition, Skipped, Statement
from pneudrive.characteristics.campaign import characterise, characteristics
from pneudrive.characteristics.files import write_characteristics
from pneudrive.characteristics.fits import fit_campaign
from pneudrive.characteristics.result import CampaignCharacteristics, Curve, CycleResult
from pneudrive.characteristics.swinging import Contact, without_swings
from pneudrive.estimate.estimates import Estimate, FTest

__all__ = [
    "BOTH",
    "CampaignCharacteristics",
    "Condition",
    "Contact",
    "Curve",
    "CycleResult",
    "Estimate",
    "FTest",
    "Skipped",
    "Statement",
    "characterise",
    "characteristics",
    "fit_campaign",
    "without_swings",
    "write_characteristics",
]
