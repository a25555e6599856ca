"""The tables of ``make bench``: for the terminal and, as Markdown, for the README."""

from __future__ import annotations

from collections.abc import Sequence

from benches.problem import DEFAULT
from benches.sweep import Entry

OURS = "pneudrive"
HEAD = ("solver", "tolerance", "ms", "times ours", f"ms at {DEFAULT:g}", f"error at {DEFAULT:g}: um", "pressure")


def rows(entries: Sequence[Entry], case: str) -> list[tuple[str, ...]]:
    """Return the rows of one case, fastest first, ours against itself."""
    chosen = [e for e in entries if e.case.name == case]
    ours = next((e for e in chosen if e.solver == OURS), None)
    base = ours.milliseconds(ours.loosest) if ours else None
    found = []
    for entry in sorted(chosen, key=lambda e: e.milliseconds(e.loosest) or float("inf")):
        took = entry.milliseconds(entry.loosest)
        position, pressure = entry.errors[DEFAULT]
        found.append(
            (
                entry.solver,
                "never meets the bounds" if entry.loosest is None else f"{entry.loosest:g}",
                _number(took),
                "-" if base is None or took is None else f"{took / base:.3g}",
                _number(entry.milliseconds(DEFAULT)),
                f"{position:.2g}",
                f"{pressure:.1g}",
            )
        )
    return found


def ratio(entries: Sequence[Entry], case: str, solver: str) -> float | None:
    """Return how many times longer than ours a solver takes, each at the tolerance it needs."""
    by_name = {e.solver: e for e in entries if e.case.name == case}
    if OURS not in by_name or solver not in by_name:
        return None
    ours = by_name[OURS].milliseconds(by_name[OURS].loosest)
    theirs = by_name[solver].milliseconds(by_name[solver].loosest)
    return None if ours is None or theirs is None else theirs / ours


def _number(milliseconds: float | None) -> str:
    return "-" if milliseconds is None else f"{milliseconds:.3g}"


def text(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return an aligned table for the terminal."""
    widths = [max(len(row[i]) for row in (head, *body)) for i in range(len(head))]
    lines = [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in (head, *body)
    ]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def markdown(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return the same as Markdown."""
    marks = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, marks, *body))
