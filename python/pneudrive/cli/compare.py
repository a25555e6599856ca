"""``pneudrive compare``: two campaigns against each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.output import console, writable_folder
from pneudrive.cli.progress import on_terminal

if TYPE_CHECKING:
    from pneudrive.characteristics.compare.comparison import Comparison


def compare(
    first: Annotated[Path, typer.Argument(help="Folder of a campaign.", metavar="A")],
    second: Annotated[Path, typer.Argument(help="Folder of another one; differences are B less A.", metavar="B")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("comparison"),
    protocol: Annotated[
        str, typer.Option(help="Which samples count: settled, or source-paper (first 5 % dropped).")
    ] = "settled",
) -> None:
    """Test two campaigns against each other (new and worn, one seal and another): report.html, comparison.toml."""
    from pneudrive.characterise.settling import SAMPLE_CHOICES
    from pneudrive.characteristics import characteristics
    from pneudrive.characteristics.compare.comparison import compare as compared
    from pneudrive.characteristics.files import write_comparison
    from pneudrive.errors import CommandError, nearest
    from pneudrive.report.campaign_compare import write_comparison_report

    if protocol not in SAMPLE_CHOICES:
        raise CommandError(f"--protocol {protocol} is not known", remedy=nearest(protocol, SAMPLE_CHOICES))
    if first.resolve() == second.resolve():
        raise CommandError("a campaign cannot be compared with itself", value=str(first), remedy="Give two folders.")
    tell = on_terminal().tell
    found = [characteristics(folder, SAMPLE_CHOICES[protocol](), progress=tell) for folder in (first, second)]
    comparison = compared(found[0], found[1])
    folder = writable_folder(out)
    written = [write_comparison(comparison, folder / "comparison.toml"), write_comparison_report(comparison, folder)]
    _say(comparison)
    for path in written:
        typer.echo(str(path))


def _say(comparison: Comparison) -> None:
    """Print one line per question, and what should be kept in mind."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("question", "B less A (95 %)", "p", "p corrected", "different"):
        table.add_column(heading)
    for test in comparison.tests:
        e = test.difference
        size = f"{e.value:+.3g} ({e.low:+.3g} .. {e.high:+.3g}) {e.unit}" if e is not None else "-"
        words = (test.what, size, f"{test.p:.2g}", f"{test.adjusted_p:.2g}", "yes" if test.different else "not shown")
        table.add_row(*words)
    shown = console()
    for letter, one in zip("AB", (comparison.first, comparison.second), strict=True):
        shown.print(f"{letter}: {one.folder} ({one.name}, {len(one.cycles)} cycles)")
    shown.print(table)
    for statement in comparison.statements:
        shown.print(f"{'-' if statement.carried else '!'} {statement}")
    shown.print(str(comparison))
