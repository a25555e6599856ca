"""Output of ``pneudrive campaign plan --fraction``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.campaign.running.live import duration
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.campaign.planning.fraction import CellProposal
    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.campaign.planning.protocol import Protocol


def check_target(path: Path, protocol: Protocol) -> None:
    """Check that the fraction can be written, before any work is done.

    Raises
    ------
    CommandError
        The file exists, its folder does not exist, or the protocol is already a fraction.
    """
    if protocol.fraction is not None:
        raise CommandError("--fraction: the protocol is already a fraction", remedy="Name the whole protocol.")
    if path.exists():
        raise CommandError(f"--fraction {path}: the file exists", remedy="Name another one.")
    if path.suffix != ".toml" or not path.parent.is_dir():
        raise CommandError(
            f"--fraction {path}: a protocol cannot be written there", rule="FILE.toml in a folder that exists"
        )


def proposal_lines(proposal: CellProposal, whole: Plan, part: Plan, file: Path | None) -> list[str]:
    """Return lines on the kept and the lost effects of a proposed fraction."""
    limit_s = whole.protocol.limits.time_s
    out = ["", f"This fraction takes {duration(part.time_s)} instead of {duration(whole.time_s)}:"]
    if part.time_s > limit_s:
        out.append(f"  more than {duration(limit_s)}: a smaller fraction cannot distinguish all levels and effects")
    for family in proposal.families:
        levels = ", ".join(f"{name} {least}" for name, least in family.levels.items())
        first, second = family.interaction or ("", "")
        slopes = f", and the slope over {first} at each {second}" if family.interaction else ""
        lost = [f"{name} ({kept} of {total} degrees of freedom left)" for name, (kept, total) in family.lost.items()]
        out += [
            f"  {family.kind}: {family.cells} of {family.of} cells, each with all its repeats",
            f"    kept: every level of every factor (at least {levels or 'one factor only'} cells at each)",
            f"    kept: every main effect{slopes}",
            f"    standard errors: {family.error_ratio:.2g} times those of the full factorial (geometric mean)",
            f"    lost: {'; '.join([*lost, 'interactions of three and more factors'])}",
        ]
    if file is None:
        out.append("  --fraction FILE writes the protocol that runs it.")
    return out
