"""``pneudrive campaign``: plan, run, watch and resume friction campaigns.

Options
-------
protocol : PROTOCOL
    Protocol file (TOML), or a ready one by name.
rig : RIG
    Rig file, ready rig, or address.
folder : DIR
    Campaign folder.
operator
    Name of the operator; stored with the campaign and with each step of the operator.
yes
    Treat every step of the operator as done, without asking.
speed
    Speed of a simulated rig; 1: real time. Default: as fast as possible.
timeout
    Longest wait for normal conditions (supply pressure, temperature, force, no fault).
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import typer

from pneudrive.cli.options import pairs_in, quantity
from pneudrive.errors import CampaignError, CommandError, PneudriveError
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive.campaign import run as campaigns
    from pneudrive.campaign.planning import plan as plans
    from pneudrive.campaign.planning import preflight
    from pneudrive.campaign.planning import protocol as protocols
    from pneudrive.campaign.running import live
    from pneudrive.campaign.storage import control
    from pneudrive.campaign.storage import folder as folders
    from pneudrive.rig import interface, rig_file


EXIT_OTHER, EXIT_INTERRUPTED = 1, 130


def plan(protocol: str, *, rig: str = "default") -> None:
    """Show the plan of a protocol on a rig (cycles, time, data), and check it against the limits of the rig.

    Examples
    --------
    pneudrive campaign plan quick-look --rig default
    """
    typer.echo(plans.show(plan_of(protocol, rig)))


def plan_of(protocol: str | Path, rig: str) -> plans.Plan:
    """Return the plan of a protocol on a rig.

    Raises
    ------
    ProtocolError, RigError
        The protocol or the rig cannot be read, or a cycle of the plan breaks a limit of the rig.
    """
    content = protocols.read_protocol(protocol)
    with interface.closed_after(rig_file.load_rig(rig, content.seed)) as bench:
        preflight.check_levels(content, bench)
        return plans.lay_out(content, bench.identity(), bench.limits())


def run(
    protocol: str,
    *,
    out: Path,
    rig: str = "default",
    operator: str = "",
    label: list[str] | None = None,
    yes: bool = False,
    speed: float | None = None,
    timeout: str = "10 min",
) -> None:
    """Run a campaign on a rig into a folder.

    Ctrl-C pauses after the cycle. A second Ctrl-C stops the axis now.

    Options
    -------
    out : DIR
        Campaign folder.
    label : KEY=VALUE
        Free text stored with the campaign; repeatable.

    Examples
    --------
    pneudrive campaign run quick-look --rig default --out first-look
    """
    labels = pairs_in("--label", label or (), "seal = NAPN")
    begin = partial(campaigns.run_campaign, protocol, rig, out, labels=labels)
    _run(begin, _again(out, rig), options=_options(operator, yes, timeout), pace=speed)


def resume(
    folder: Path,
    *,
    rig: str = "",
    allow_code: str = "",
    operator: str = "",
    yes: bool = False,
    speed: float | None = None,
    timeout: str = "10 min",
) -> None:
    """Resume a campaign that another process has paused, or whose process has ended.

    Options
    -------
    rig : RIG
        Rig. For a simulated rig or a replay, the folder names the rig.
    allow_code : SHA256
        Allow the code that the folder names, if its file has this SHA-256.

    Examples
    --------
    pneudrive campaign resume first-look
    """
    running = control.holder(folder)
    if running is not None and running.state in ("paused", "operator"):
        control.ask(folder, control.RESUME, operator or control.user())
        after = control.wait_for(folder, ("running", "waiting", "pausing", "stopping"), 10.0)
        typer.echo("The campaign continues." if after else "The campaign has ended.")
        return
    begin = partial(campaigns.resume_campaign, folder, rig or None, allow_code=allow_code or None)
    _run(begin, _again(folder, rig, allow_code), options=_options(operator, yes, timeout), pace=speed)


def status(folder: Path) -> None:
    """Show progress, flagged or damaged cycles, and the running process of a campaign.

    Examples
    --------
    pneudrive campaign status first-look
    """
    state = folders.status_of(folder)
    about = state.campaign.about
    synthetic = " (synthetic)" if state.campaign.synthetic else ""
    typer.echo(f"{about.get('name') or folder}{synthetic}, rig {state.campaign.identity.name}")
    if state.planned is None:
        typer.echo(f"{len(state.files)} cycles; the folder has no plan")
    else:
        extra = f", {state.extra} beyond the plan" if state.extra else ""
        left = f"; {live.duration(state.remaining_s or 0.0)} left on the rig" if state.to_do else "; done"
        typer.echo(f"{len(state.files) - state.extra} of {state.planned} planned cycles{extra}{left}")
    for flag, count in state.flags.items():
        typer.echo(f"flag {flag}: {count} {'cycle' if count == 1 else 'cycles'}")
    for problem in state.problems:
        typer.echo(f"{'problem' if problem.lost else 'note'}: {problem}")
    typer.echo(f"run by {state.holder}" if state.holder else "no process runs this campaign")


def pause(folder: Path, *, now: bool = False) -> None:
    """Pause a campaign in another process, after the running cycle or now.

    Options
    -------
    now
        Stop the axis now; the running cycle is repeated later.

    Examples
    --------
    pneudrive campaign pause first-look --now
    """
    before = control.ask(folder, control.STOP if now else control.PAUSE, control.user())
    after = control.wait_for(folder, ("pausing", "paused", "operator"), 10.0)
    typer.echo(str(after) if after else f"The campaign has ended ({before}).")


def abort(folder: Path) -> None:
    """End a campaign in another process. The axis comes to rest, and finished cycles are kept.

    Examples
    --------
    pneudrive campaign abort first-look
    """
    control.ask(folder, control.ABORT, control.user())
    after = control.wait_for(folder, (), 90.0)
    if after is not None:
        raise CampaignError.of("campaign.not-ended", where=folder, value=str(after), pid=after.pid)
    typer.echo("The campaign has ended. Finished cycles are kept.")


def _options(operator: str, yes: bool, timeout: str) -> campaigns.Options:
    seconds = quantity("--timeout", timeout, "s")
    if seconds < 0.0:
        raise CommandError(f"--timeout {timeout} is out of bounds", rule="zero or more")
    return campaigns.Options(operator, yes, seconds, display=live.TerminalDisplay())


def _again(folder: Path, rig: str, allow_code: str = "") -> str:
    """Return the command that resumes a campaign; it names the rig if the folder is not sufficient."""
    named = f" --rig {rig}" if rig_file.must_be_named(rig) else ""
    return f"pneudrive campaign resume {folder}{named}{f' --allow-code {allow_code}' if allow_code else ''}"


def _run(begin: Callable[..., campaigns.Result], again: str, **options: Any) -> None:  # noqa: ANN401
    """Run a campaign and print its end. Exit with status 1 after an error, and with 130 if a user ended the campaign.

    SIGTERM acts like Ctrl-C. During a campaign, the campaign itself handles Ctrl-C and SIGTERM.
    """
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        result = begin(**options)
    except PneudriveError as error:
        if not campaigns.can_be_resumed(error):
            raise
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.stderr.write(f"Finished cycles are kept. Resume: {again}\n")
        raise typer.Exit(EXIT_OTHER) from error
    finally:
        signal.signal(signal.SIGTERM, before)
    if result.ended == campaigns.DONE:
        typer.echo(f"{result.finished} cycles in {result.campaign.path}")
        return
    typer.echo(f"Ended after {result.finished} of {result.planned} cycles. Resume: {again}")
    raise typer.Exit(EXIT_INTERRUPTED)
