"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""

from __future__ import annotations

from pneudrive.estimate.estimates import Estimate as Estimate
from pneudrive.friction.campaign.characteristics import campaign_friction as campaign_friction
from pneudrive.friction.campaign.characteristics import characterise as characterise
from pneudrive.friction.campaign.characteristics import fit_campaign as fit_campaign
from pneudrive.friction.campaign.characteristics import recorded_characteristics as recorded_characteristics
from pneudrive.friction.campaign.result import CampaignCharacteristics as CampaignCharacteristics
from pneudrive.friction.campaign.result import write_characteristics as write_characteristics
