"""``pneudrive size``: drives of the catalogue for a task."""

from __future__ import annotations

from pathlib import Path

import typer

from pneudrive.cli.options import CatalogueFolders
from pneudrive.cli.output import show_lines, show_table, tell


def size(
    task: Path,
    out: Path | None = None,
    min_candidates: int = 10,
    max_candidates: int = 160,
    samples: int = 256,
    catalogue: CatalogueFolders = None,
) -> None:
    """Find the drives of the catalogue that do a task.

    Candidates are simulated over given spreads and ranked by air and margin.

    A provisional answer by nominal runs comes first. Ctrl-C ends the search and keeps its results; the same command
    with --out continues. If no drive does the task, the nearest feasible value of each quantity is shown.

    Options
    -------
    task : TASK
        Task file (TOML).
    out : DIR
        Folder for report, ranking and circuit files of the ten best; it is resumed.
    min_candidates : N
        Least number of simulated choices of parts.
    max_candidates : N
        Largest number of choices of parts whose needles are set.
    samples
        Samples of each choice; the ten best have four times as many.
    """
    from pneudrive.cli.main import EXIT_INTERRUPTED
    from pneudrive.cli.progress import on_terminal
    from pneudrive.sizing.result import HEAD, PARTS, REASONS, SUMMARY, TABLE, WRITTEN, row_of, sentences, set_to
    from pneudrive.sizing.search import DRAWS_BEST_OF, watched

    found = watched(
        task,
        on_terminal(),
        least=min_candidates,
        most=max_candidates,
        draws=samples,
        draws_best=DRAWS_BEST_OF * samples,
        out=out,
        provisional=lambda made: show_lines(sentences(made)[:1]),
    )
    said = sentences(found)
    first = 1 + len(found.open_checks)
    show_lines(said[:first])
    best = found.by_cylinder[:WRITTEN]
    if best:
        show_table(("", *HEAD[PARTS:]), [(str(place), *row_of(one)[PARTS:]) for place, one in enumerate(best, start=1)])
        show_lines(f"{place:2d}  {' + '.join(one.parts.values())}; {set_to(one)}" for place, one in enumerate(best, 1))
        show_lines([f"The best of each cylinder; {len(found.ranked)} choices meet the task."])
    show_lines([f"{found.task.name}: {found.state}", *said[first:]])
    if out is not None:
        from pneudrive.report.sizing.page import write_sizing_report

        page = write_sizing_report(found, out)
        tell([*sorted(out.glob("*.toml")), *(out / name for name in (TABLE, SUMMARY, REASONS)), page])
    if found.interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
