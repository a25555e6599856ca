"""Plan of a campaign folder, computed again from its protocol and rig."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.campaign.storage.folder import ABOUT, PROTOCOL
from pneudrive.errors import CampaignError
from pneudrive.rig.plain_data import envelope_of

if TYPE_CHECKING:
    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.campaign.storage.folder import Campaign


def plan_of(campaign: Campaign, *, checked: bool = True) -> Plan:
    """Compute the plan of a campaign folder again from its protocol and rig.

    Parameters
    ----------
    campaign : Campaign
    checked : bool
        Check the plan against the limits of the rig; not needed to count cycles.

    Raises
    ------
    CampaignError
        If the folder holds no plan: another program wrote it.
    ProtocolError
        If the plan exceeds the limits of the rig.
    """
    text, limits = campaign.protocol, campaign.about.get("envelope")
    if not text or not isinstance(limits, dict):
        raise CampaignError(
            "the folder holds no plan",
            where=str(campaign.path),
            rule="campaign.toml and campaign.json: envelope",
        )
    from pneudrive.campaign.planning.plan import draft, lay_out
    from pneudrive.campaign.planning.protocol import parse_protocol

    protocol = parse_protocol(text, str(campaign.path / PROTOCOL))
    envelope = envelope_of(limits, str(campaign.path / ABOUT), CampaignError)
    return (lay_out if checked else draft)(protocol, campaign.identity, envelope)
