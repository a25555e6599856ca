"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

from pneudrive.characteristics.basics import BOTH, Condition, Estimate, FTest
from pneudrive.characteristics.campaign import characteristics
from pneudrive.characteristics.result import CampaignCharacteristics, Curve, CycleResult, Skipped, Statement

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
    "characteristics",
]
