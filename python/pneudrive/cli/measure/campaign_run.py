"""``pneudrive campaign run``, ``resume``, ``status``, ``pause`` and ``abort``."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.options import BenchRig, Protocol, pair_in, quantity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.campaign.run import Options, Result
    from pneudrive.campaign.running.live import Display

EXIT_OTHER, EXIT_INTERRUPTED = 1, 130

Folder = Annotated[Path, typer.Argument(help="Campaign folder.", metavar="DIR")]
Operator = Annotated[
    str, typer.Option(help="Name of the operator; kept with the campaign and with each operator's step.")
]
Yes = Annotated[bool, typer.Option("--yes", help="Treat every step of the operator as done, without asking.")]
Pace = Annotated[
    float | None,
    typer.Option("--speed", help="Speed of a simulated rig; 1: real time. Default: as fast as possible."),
]
Patience = Annotated[
    str,
    typer.Option(
        "--timeout", help="Longest wait for normal conditions (supply pressure, temperature, force, no fault)."
    ),
]


def run(
    protocol: Protocol,
    into: Annotated[Path, typer.Option("--out")],
    rig: BenchRig = "default",
    operator: Operator = "",
    label: list[str] | None = None,
    yes: Yes = False,
    pace: Pace = None,
    patience: Patience = "10 min",
) -> None:
    """Run a campaign on a rig into a folder.

    Ctrl-C pauses after the cycle. A second Ctrl-C stops the axis now.

    Options
    -------
    into : DIR
        Campaign folder.
    label : KEY=VALUE
        Free text kept with the campaign; repeatable.
    """
    from pneudrive.campaign.run import run_campaign

    labels = dict(pair_in("--label", text, "seal = NAPN") for text in label or ())
    options = _options(operator, yes, patience)
    again = _again(into, rig)
    with _running(again):
        result = run_campaign(protocol, rig, into, options=options, labels=labels, pace=pace, display=_display())
    _end(result, again)


def resume(
    folder: Folder,
    rig: str = "",
    allow_code: str = "",
    operator: Operator = "",
    yes: Yes = False,
    pace: Pace = None,
    patience: Patience = "10 min",
) -> None:
    """Resume a campaign that another process has paused, or whose process has ended.

    Options
    -------
    rig : RIG
        Rig; may be left out for a simulated rig or a replay, which the folder names.
    allow_code : SHA256
        Allow the code that the folder names, if its file has this SHA-256.
    """
    from pneudrive.campaign.run import resume_campaign
    from pneudrive.campaign.storage.control import RESUME, ask, wait_for
    from pneudrive.campaign.storage.files import holder

    running = holder(folder)
    if running is not None and running.state in ("paused", "operator"):
        ask(folder, RESUME, _me(operator))
        after = wait_for(folder, ("running", "waiting", "pausing", "stopping"), 10.0)
        typer.echo("The campaign continues." if after else "The campaign has ended.")
        return
    options = _options(operator, yes, patience)
    again = _again(folder, rig, allow_code)
    with _running(again):
        result = resume_campaign(
            folder, rig or None, options=options, pace=pace, allow_code=allow_code or None, display=_display()
        )
    _end(result, again)


def status(folder: Folder) -> None:
    """Show progress, flagged or damaged cycles, and the running process of a campaign."""
    from pneudrive.campaign.running.live import duration
    from pneudrive.campaign.status import status_of

    found = status_of(folder)
    about = found.campaign.about
    synthetic = " (synthetic)" if found.campaign.synthetic else ""
    typer.echo(f"{about.get('name') or folder}{synthetic}, rig {found.campaign.identity.name}")
    if found.planned is None:
        typer.echo(f"{len(found.files)} cycles; the folder has no plan")
    else:
        extra = f", {found.extra} beyond the plan" if found.extra else ""
        left = f"; {duration(found.remaining_s or 0.0)} left on the rig" if found.to_do else "; done"
        typer.echo(f"{len(found.files) - found.extra} of {found.planned} planned cycles{extra}{left}")
    for flag, count in found.flags.items():
        typer.echo(f"flag {flag}: {count} {'cycle' if count == 1 else 'cycles'}")
    for problem in found.problems:
        typer.echo(f"{'problem' if problem.lost else 'note'}: {problem}")
    typer.echo(f"in work by {found.holder}" if found.holder else "no process runs this campaign")


def pause(
    folder: Folder,
    now: Annotated[bool, typer.Option("--now")] = False,
) -> None:
    """Pause a campaign in another process, after its cycle or now.

    Options
    -------
    now
        Stop the axis now; the running cycle is repeated later.
    """
    from pneudrive.campaign.storage.control import PAUSE, STOP, ask, wait_for

    before = ask(folder, STOP if now else PAUSE, _me(""))
    after = wait_for(folder, ("pausing", "paused", "operator"), 10.0)
    typer.echo(str(after) if after else f"The campaign has ended ({before}).")


def abort(folder: Folder) -> None:
    """End a campaign in another process. The axis comes to rest, and finished cycles are kept."""
    from pneudrive.campaign.storage.control import ABORT, ask, wait_for
    from pneudrive.errors import CampaignError

    ask(folder, ABORT, _me(""))
    after = wait_for(folder, (), 90.0)
    if after is not None:
        raise CampaignError(
            "the campaign has not ended yet",
            value=str(after),
            where=str(folder),
            remedy=f"Check the rig, then end process {after.pid} by hand: finished cycles are kept.",
        )
    typer.echo("The campaign has ended. Finished cycles are kept.")


def _options(operator: str, yes: bool, patience: str) -> Options:
    from pneudrive.campaign.run import Options
    from pneudrive.errors import CommandError

    seconds = quantity("--timeout", patience, "s")
    if seconds < 0.0:
        raise CommandError(f"--timeout {patience} is out of bounds", rule="zero or more")
    return Options(operator=operator, yes=yes, patience_s=seconds)


def _display() -> Display:
    from pneudrive.campaign.running.live import LineDisplay, ScreenDisplay

    return ScreenDisplay() if sys.stdout.isatty() else LineDisplay()


def _again(folder: Path, rig: str, allow_code: str = "") -> str:
    """Return the command to resume; it names the rig if the folder alone is not sufficient."""
    from pneudrive.rig.loading import must_be_named

    named = f" --rig {rig}" if must_be_named(rig) else ""
    return f"pneudrive campaign resume {folder}{named}{f' --allow-code {allow_code}' if allow_code else ''}"


@contextmanager
def _running(again: str) -> Iterator[None]:
    """Exit with status 1 if an error ends a running campaign, and print how to resume.

    SIGTERM acts like Ctrl-C. During a campaign, the campaign itself handles Ctrl-C and SIGTERM.
    """
    from pneudrive.campaign.run import can_be_resumed
    from pneudrive.errors import PneudriveError

    in_main = threading.current_thread() is threading.main_thread()  # others must not
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if in_main else None
    try:
        yield
    except PneudriveError as error:
        if not can_be_resumed(error):
            raise
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.stderr.write(f"Finished cycles are kept. Resume: {again}\n")
        raise typer.Exit(EXIT_OTHER) from error
    finally:
        if in_main:
            signal.signal(signal.SIGTERM, before)


def _end(result: Result, again: str) -> None:
    """Print the end of a campaign; exit with status 130 if a user ended it."""
    from pneudrive.campaign.run import DONE

    if result.ended == DONE:
        typer.echo(f"{result.finished} cycles in {result.campaign.path}")
        return
    typer.echo(f"Ended after {result.finished} of {result.planned} cycles. Resume: {again}")
    raise typer.Exit(EXIT_INTERRUPTED)


def _me(operator: str) -> str:
    from pneudrive.campaign.storage.files import user

    return operator or user()
