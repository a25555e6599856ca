"""``pneudrive campaign``: plan, run and watch friction campaigns."""

from __future__ import annotations

from pathlib import Path

import typer

from pneudrive.cli.groups import group
from pneudrive.cli.options import BenchRig, Protocol
from pneudrive.cli.output import write_text
from pneudrive.errors import CommandError

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


def plan(
    protocol: Protocol,
    rig: BenchRig = "default",
    fraction: Path | None = None,
) -> None:
    """Show the plan of a protocol on a rig (cycles, time, data), and check it against the limits of the rig.

    Options
    -------
    fraction : FILE
        Write a protocol that runs the proposed fraction.
    """
    from pneudrive.campaign.planning.fraction import propose, write_fraction
    from pneudrive.campaign.planning.plan import lay_out
    from pneudrive.campaign.planning.plan_words import show
    from pneudrive.campaign.planning.preflight import check_levels
    from pneudrive.campaign.planning.protocol import parse_protocol, read_protocol
    from pneudrive.campaign.running.live import duration
    from pneudrive.cli.measure.campaign_plan import check_target, proposal_lines
    from pneudrive.rig.loading import load_rig, opened

    asked = read_protocol(protocol)
    if fraction is not None:
        check_target(fraction, asked)
    with opened(load_rig(rig, asked.seed)) as bench:
        check_levels(asked, bench)
        whole = lay_out(asked, bench.identity(), bench.limits())
    typer.echo(show(whole))
    limit_s = asked.limits.time_s
    if whole.time_s <= limit_s or asked.fraction is not None:
        if fraction is not None:
            raise CommandError(
                f"--fraction: the whole protocol {asked.name} fits into the time",
                rule=f"{duration(whole.time_s)} of limits.time = {duration(limit_s)}",
                remedy="If it is still too long, lower [limits] time.",
            )
        return
    proposal = propose(whole, limit_s)
    text = write_fraction(asked, proposal)
    part = lay_out(parse_protocol(text, str(fraction or asked.origin)), whole.identity, whole.envelope)
    typer.echo("\n".join(proposal_lines(proposal, whole, part, fraction)))
    if fraction is not None:
        write_text(text, fraction)
