"""Output of commands: the terminal, files, folders, and progress."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from tempfile import TemporaryFile
from textwrap import fill
from typing import TYPE_CHECKING

import typer

from pneudrive.errors import CommandError
from pneudrive.lazy_names import used_later
from pneudrive.progress import Watch
from pneudrive.repr_tables import aligned
from pneudrive.views import ShownTable, View

with used_later(__name__):
    from pneudrive.report import render
    from pneudrive.simulation import trajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from pneudrive.identify.base import Fit

#: Width of a table that is written to a file, characters.
WIDTH = 160
MOST_ROWS = 60  # rows of a table on the terminal; files have all of them
FIRST_S = 1.0  # s; shorter work shows no progress
LINE_EVERY_S = 10.0  # s; between lines of progress if stderr is a file
ERASED = "\r\x1b[K"  # start of an empty line in a terminal
#: Environment variable for progress. With "json", each report is a line {"done": ..., "total": ..., "task": ...}.
FORM, JSON = "PNEUDRIVE_PROGRESS", "json"


def writable_folder(out: Path) -> Path:
    """Make an output folder, before any work is done.

    Raises
    ------
    CommandError
        The folder cannot be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=out).close()
    except OSError as error:
        raise CommandError(f"--out {out}: the folder cannot be written to", value=error.strerror) from None
    return out


def _width() -> int:
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else WIDTH


def show_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table. `rich` is imported only to fold cells in a narrow terminal, because its import takes long.

    Parameters
    ----------
    heads : sequence of str
        The first column and those whose head begins with "<" are left-aligned.
    rows : iterable of sequences of str
    """
    rows, names = list(rows), [head.removeprefix("<") for head in heads]
    to_left = [index for index, head in enumerate(heads) if not index or head.startswith("<")]
    lines = aligned([names, *rows], 0, "", to_left).splitlines()
    if max(map(len, lines)) <= _width():
        typer.echo("\n".join([typer.style(lines[0], bold=True), *lines[1:]]))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(names):
        table.add_column(name, justify="left" if index in to_left else "right", no_wrap=index == 0)
    for row in rows:
        table.add_row(*row)
    # Without markup: names of recordings and seals may contain brackets.
    Console(width=_width(), highlight=False, markup=False).print(table)


def show_lines(*lines: object) -> None:
    """Print lines, wrapped at the width of the terminal."""
    for line in "\n".join(map(str, lines)).splitlines():
        typer.echo(fill(line, _width(), break_long_words=False, break_on_hyphens=False))


def show_view(view: View) -> None:
    """Print a result: headline, leading values, findings, values, curves, tables, and notes. "!" marks bad values."""
    typer.echo(typer.style(view.title, bold=True))
    leading = (("!" if value.state == "bad" else "-", value.sentence) for value in view.leading)
    findings = (("!" if f.state == "bad" else "-", f"{f.text} {f.remedy}".rstrip()) for f in view.findings)
    show_lines(*(f"{mark} {text}" for mark, text in (*leading, *findings)))
    values = view.value_tables(without=view.leading)
    for table in (*(ShownTable("", *each) for each in (*values, view.curve_table())), *view.tables):
        if table.rows:
            show_lines(*([table.caption] if table.caption else ()))
            heads = zip(table.head, table.are_numbers, strict=True)
            show_table([name if is_number else f"<{name}" for name, is_number in heads], table.rows[:MOST_ROWS])
        if len(table.rows) > MOST_ROWS:
            show_lines(f"{len(table.rows) - MOST_ROWS} further rows are in the files.")
    show_lines(*(note if note[:1] in "-!" else f"- {note}" for note in view.notes))


def check_outputs(out: Path | None, suffixes: Sequence[str] = (), plot: Path | None = None) -> None:
    """Reject output files that cannot be written, before any work is done.

    Parameters
    ----------
    out, plot : Path or None
        Result and picture.
    suffixes : sequence of str
        Suffixes of the result; default: those of a trajectory.

    Raises
    ------
    CommandError
        Unknown suffix, or a folder that does not exist or is not writable.
    """
    if out is not None:
        trajectory.check_target(out, tuple(suffixes) or trajectory.SUFFIXES)
    if plot is not None:
        trajectory.check_target(plot, render.PICTURES)


def write_outputs(*targets: tuple[Path | None, Callable[[Path], object]]) -> None:
    """Write each file whose path is not None, then print the paths."""
    for path, write in targets:
        if path is not None:
            write(path)
    show_paths(*(path for path, _ in targets))


def show_paths(*paths: Path | None) -> None:
    """Print the paths of results, one on each line; files that were not written are left out."""
    for path in paths:
        if path is not None:
            typer.echo(str(path))


def show_fit(fit: Fit, out: Path | None, report: Path | None) -> None:
    """Print a fit, and write its file and its report."""
    show_view(fit.view())
    write_outputs((out, fit.to_toml))
    show_paths(report and fit.report(report))


def write_text(text: str, out: Path | None) -> None:
    """Write a text to a file, completely or not at all, and print its path.

    Without a file, write to standard output.
    """
    if out is None:
        typer.echo(text, nl=False)
        return
    trajectory.write_whole(out, text)
    show_paths(out)


class _Line:
    """Progress line on stderr, overwritten in place. If stderr is a file, write a line every ten seconds."""

    def __init__(self) -> None:
        self.began = self.written = time.monotonic()

    def __call__(self, done: float, total: float, task: str) -> None:
        """Write the progress."""
        now = time.monotonic()
        if now - self.began < FIRST_S:
            return
        text = f"{task}: {done:g} of {total:g}" if total else f"{task}: {done:g}"
        if sys.stderr.isatty():
            sys.stderr.write(ERASED if done >= total > 0 else ERASED + text)
        elif now - self.written >= LINE_EVERY_S:
            self.written = now
            sys.stderr.write(text + "\n")
        sys.stderr.flush()


def _as_json(done: float, total: float, task: str) -> None:
    sys.stderr.write(json.dumps({"done": done, "total": total, "task": task}) + "\n")
    sys.stderr.flush()


def watch() -> Watch:
    """Return the progress callback of a command. After the first second it shows progress on stderr."""
    return Watch(_as_json if os.environ.get(FORM) == JSON else _Line())
