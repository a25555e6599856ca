"""The plan that a campaign folder speaks of, laid out anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.campaign.folder import ABOUT, PROTOCOL
from pneudrive.errors import CampaignError
from pneudrive.rig.plain_data import envelope_of

if TYPE_CHECKING:
    from pneudrive.campaign.folder import Campaign
    from pneudrive.campaign.plan import Plan


def plan_of(campaign: Campaign, *, checked: bool = True) -> Plan:
    """Lay out the plan of a campaign folder anew, from what the folder says of protocol and rig.

    Parameters
    ----------
    campaign : Campaign
    checked : bool
        Whether to hold it against what the rig may be asked to do; who only counts cycles need not.

    Raises
    ------
    CampaignError
        If the folder does not say it: somebody else has written it.
    ProtocolError
        The rig must not be asked to do that.
    """
    text, limits = campaign.protocol, campaign.about.get("envelope")
    if not text or not isinstance(limits, dict):
        raise CampaignError(
            "the folder does not say what was planned",
            where=str(campaign.path),
            rule="campaign.toml and campaign.json: envelope",
        )
    from pneudrive.campaign.plan import draft, lay_out
    from pneudrive.campaign.protocol import parse_protocol

    protocol = parse_protocol(text, str(campaign.path / PROTOCOL))
    envelope = envelope_of(limits, str(campaign.path / ABOUT), CampaignError)
    return (lay_out if checked else draft)(protocol, campaign.identity, envelope)
