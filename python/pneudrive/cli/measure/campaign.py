"""``pneudrive campaign``: plan, run and watch friction campaigns."""

from __future__ import annotations

import typer

from pneudrive.cli.groups import group
from pneudrive.cli.options import BenchRig, Protocol

campaign = group(
    {
        "plan": "pneudrive.cli.measure.campaign",
        "run": "pneudrive.cli.measure.campaign_run",
        "resume": "pneudrive.cli.measure.campaign_run",
        "status": "pneudrive.cli.measure.campaign_run",
        "pause": "pneudrive.cli.measure.campaign_run",
        "abort": "pneudrive.cli.measure.campaign_run",
    }
)


@campaign.callback()
def _campaign() -> None:
    """Plan, run, watch and resume friction campaigns."""


def plan(protocol: Protocol, rig: BenchRig = "default") -> None:
    """Show the plan of a protocol on a rig (cycles, time, data), and check it against the limits of the rig."""
    from pneudrive.campaign.planning.plan import lay_out, show
    from pneudrive.campaign.planning.preflight import check_levels
    from pneudrive.campaign.planning.protocol import read_protocol
    from pneudrive.rig.loading import load_rig, opened

    asked = read_protocol(protocol)
    with opened(load_rig(rig, asked.seed)) as bench:
        check_levels(asked, bench)
        typer.echo(show(lay_out(asked, bench.identity(), bench.limits())))
