"""The ``pneudrive`` command line.

Each command is a function in the module of its section, and is listed in ``sections.toml``.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from pneudrive import __version__, errors
from pneudrive.cli.commands import group

#: Commands in the order of a user's work. Each is a function or a group in the module of its name, imported on use.
SECTIONS = errors.package_table(__file__, "sections.toml")
COMMANDS = {
    name: f"pneudrive.cli.{section.lower().replace(' ', '_')}" for section, names in SECTIONS.items() for name in names
}
COMMANDS["demo"] = "pneudrive.cli.hand_over"  # called by `make demo`, and not shown

EXIT_OTHER, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130
#: Largest number of printed warnings that differ only in numbers; the others are counted.
MOST_ALIKE = 3
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d.]*(?:e[-+]?\d+)?(?!\w)")


app = group(COMMANDS, sections=SECTIONS)


@app.callback(invoke_without_command=True)
def _root(version: bool = typer.Option(False, "--version", help="Show the version.")) -> None:
    """Simulate, measure, identify, size and control pneumatic piston drives."""
    if version:
        typer.echo(__version__)
        raise typer.Exit


def fail(error: errors.PneudriveError) -> int:
    """Print an error once, on stderr, and return its exit status."""
    sys.stderr.write(f"{type(error).__name__}: {error}\n")
    ran = isinstance(error, errors.SimulationError) and not isinstance(error, errors.OwnLawError)
    return EXIT_OTHER if ran else EXIT_INPUT


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Print a warning once, as one line on stderr, without its location in the package.

    Some of the warnings that differ only in numbers are left out. All severe findings are printed.
    """
    otherwise, kinds = warnings.showwarning, defaultdict[str, list[str]](list)

    def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:  # noqa: ANN401 - signature of the standard library
        if not issubclass(category, errors.PneudriveWarning):
            otherwise(message, category, *rest)
            return
        text = str(message)
        alike = kinds[text if errors.is_severe(text) else _NUMBER.sub("#", text)]
        if text not in alike:
            alike.append(text)
            if len(alike) <= MOST_ALIKE:
                sys.stderr.write(f"{'' if errors.is_severe(text) else 'Note: '}{text}\n")

    with warnings.catch_warnings():
        warnings.simplefilter("always", errors.PneudriveWarning)
        warnings.showwarning = show
        try:
            yield
        finally:
            for alike in kinds.values():
                if len(alike) > MOST_ALIKE:
                    more = len(alike) - MOST_ALIKE
                    sys.stderr.write(f"Note: {more} more with other numbers, such as: {alike[MOST_ALIKE]}\n")


def run(arguments: Sequence[str]) -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str
        Arguments after ``pneudrive``.

    Returns
    -------
    int
        Exit status: 0 success, 2 wrong input, 1 other error, 130 interrupted.
    """
    if Path("matplotlibrc").exists():  # while there is one thread: see `load_matplotlib`
        from pneudrive.report.render import load_matplotlib

        load_matplotlib()
    try:
        with _plain_warnings():
            status = app(list(arguments), prog_name="pneudrive", standalone_mode=False)
    except (KeyboardInterrupt, errors.Cancelled):
        status = EXIT_INTERRUPTED
    except errors.PneudriveError as error:
        return fail(error)
    except BrokenPipeError:  # the reader of the output has closed it (pneudrive ... | head)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if hasattr(error, "exit_code") and hasattr(error, "show"):  # typer's error: a wrong option
            error.show()  # type: ignore[attr-defined]
            return int(error.exit_code)  # type: ignore[attr-defined]
        raise
    if status == EXIT_INTERRUPTED:  # as typer returns for Ctrl-C
        sys.stderr.write("Interrupted; finished results are kept.\n")
    return status if isinstance(status, int) else 0


def main() -> None:
    """Entry point of the ``pneudrive`` script."""
    sys.exit(run(sys.argv[1:]))
