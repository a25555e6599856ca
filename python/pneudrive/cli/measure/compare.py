"""``pneudrive compare``: compare two campaigns, drives or fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.cli.options import Results, Samples, one_of
from pneudrive.cli.output import show_lines, show_statements, show_table, tell, writable_folder
from pneudrive.cli.progress import on_terminal

if TYPE_CHECKING:
    from pneudrive.friction.campaign.compare import Comparison
    from pneudrive.identify.static.result import FrictionFit

SPEEDS = 5  # at which curves are compared
SAME_PA = 1.0  # rounding of a pressure


def compare(
    first: Path,
    second: Path,
    out: Results = Path("comparison"),
    protocol: Samples = "settled",
) -> None:
    """Compare two campaigns, two drives or two fits.

    For two campaigns (new and worn, two seals), it writes report.html and comparison.toml.
    Two drive files, or two fits of one kind, are compared value by value, without any file.

    Options
    -------
    first : A
        Folder of campaign A; or a drive, or a fit.
    second : B
        Folder of campaign B, drive or fit; differences are B minus A.
    """
    from pneudrive.errors import CommandError
    from pneudrive.friction.campaign.characteristics import campaign_friction
    from pneudrive.friction.campaign.compare import compare_campaigns as compared
    from pneudrive.friction.campaign.files import write_comparison
    from pneudrive.friction.motion import SAMPLE_CHOICES
    from pneudrive.report.campaign.compare import write_comparison_report

    if all(one.suffix == ".toml" or str(one).startswith("catalogue:") for one in (first, second)):
        _values(str(first), str(second))
        return
    choice = one_of("--protocol", protocol, SAMPLE_CHOICES)
    if first.resolve() == second.resolve():
        raise CommandError("a campaign cannot be compared with itself", value=str(first), remedy="Give two folders.")
    found = [campaign_friction(folder, choice(), progress=on_terminal().tell) for folder in (first, second)]
    comparison = compared(found[0], found[1])
    folder = writable_folder(out)
    written = [write_comparison(comparison, folder / "comparison.toml"), write_comparison_report(comparison, folder)]
    _say(comparison)
    tell(written)


def _values(first: str, second: str) -> None:
    """Print the values that differ between two drives or fits."""
    from pneudrive.identify.files import differences, read_source
    from pneudrive.identify.static.result import FrictionFit

    sources = read_source(first), read_source(second)
    found = differences(*sources)
    rows = []
    for one in found:
        change = "" if one.change is None else f"{100 * one.change:+.3g}"
        rows.append((one.key, one.before, one.interval_before, one.after, one.interval_after, change))
    show_table(("value", "<before", "<95 %", "<after", "<95 %", "change %"), rows)
    show_lines([] if found else ["No value differs."])
    if all(isinstance(source, FrictionFit) for source in sources):
        _curves(*sources)  # type: ignore[arg-type]


def _curves(before: FrictionFit, after: FrictionFit) -> None:
    """Print the difference between the curves of two fits, at speeds and pressures that both have measured."""
    import numpy as np

    from pneudrive.identify.files import common, curve_differences

    low, high = common(before, after, "speed_m_s")
    gauges = [common(before, after, f"gauge_{side}_pa") for side in "ab"]
    if low > high or any(one > other + SAME_PA for one, other in gauges):
        show_lines(["The fits have no speeds and pressures in common, so their curves are not compared."])
        return
    speeds = np.geomspace(low, high, SPEEDS) if low < high else np.array([low])
    rows = []
    for a, b in dict.fromkeys(zip(*gauges, strict=True)):
        for speed, one in zip(speeds, curve_differences(before, after, speeds, a, b), strict=True):
            at = (f"{1e3 * speed:.3g}", f"{a / 1e5:.3g}", f"{b / 1e5:.3g}")
            rows.append((*at, f"{one.value:+.3g}", f"{one.low:+.3g} .. {one.high:+.3g}"))
    show_table(("speed mm/s", "a bar gauge", "b bar gauge", "B minus A, N", "95 %"), rows, left=0)


def _say(comparison: Comparison) -> None:
    """Print one line for each compared property, and the notes."""
    show_lines(
        f"{letter}: {one.folder} ({one.name}, {len(one.cycles)} cycles)"
        for letter, one in zip("AB", (comparison.first, comparison.second), strict=True)
    )
    rows = []
    for test in comparison.tests:
        e = test.difference
        size = f"{e.value:+.3g} ({e.low:+.3g} .. {e.high:+.3g}) {e.unit}" if e is not None else "-"
        chances = (f"{test.p:.2g}", f"{test.adjusted_p:.2g}")
        rows.append((test.what, size, *chances, "yes" if test.different else "not shown"))
    show_table(("question", "B minus A (95 %)", "p", "p corrected", "different"), rows, left=5)
    show_statements(comparison.statements)
    show_lines([str(comparison)])
