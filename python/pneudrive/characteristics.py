"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

from pneudrive.estimate.estimates import Estimate, FTest
from pneudrive.friction.campaign.characteristics import (
    campaign_friction,
    characterise,
    fit_campaign,
    recorded_characteristics,
)
from pneudrive.friction.campaign.files import write_characteristics
from pneudrive.friction.campaign.result import CampaignCharacteristics, Curve
from pneudrive.friction.friction_map import BOTH, Condition, Skipped
from pneudrive.friction.sentences import Statement

__all__ = [
    "BOTH",
    "CampaignCharacteristics",
    "Condition",
    "Curve",
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
