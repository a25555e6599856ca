"""A run requested by the page: its drive with changed values, its result, and its command and Python lines."""

from __future__ import annotations

import math
import re
import time
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, Field, StrictStr, field_validator

from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files.load import described_in
from pneudrive.describe.formulas.written import FILE_PREFIX
from pneudrive.errors import CommandError
from pneudrive.progress import Flag, Watch
from pneudrive.simulation.simulate import Run, positive, run
from pneudrive.web.messages import PageRequest, Pixels, Value, call, shell
from pneudrive.web.workspace import COMMANDS, Workspace, is_in_catalogue

if TYPE_CHECKING:
    from pneudrive.arrays import Keyed, Plain


Described = Drive | Circuit

MOST_SAMPLES = 1_000_000
MOST_SECONDS = 2.0  # longest computing time of a run: the page waits for it
_KEPT = 500  # number of kept descriptions
#: Pattern of a command that is not a file: a number, or times with values, optionally after the name of a component.
_COMMAND = re.compile(r"\s*+(?:[A-Za-z_][\w-]*+(?:\.command)?\s*+:)?\s*+[-+.\d][^/\\]*+", re.DOTALL)
#: Pattern of a command that is a file of the workspace, optionally after the name of a component.
_FILE = re.compile(r"(\s*+(?:[A-Za-z_][\w-]*+(?:\.command)?\s*+:)?\s*+)(\S.*\.csv)\s*+", re.IGNORECASE)


def check_changes(changes: Plain) -> Plain:
    """Reject changed values that name a file.

    Raises
    ------
    CommandError
        A value names a file.
    """
    for key, value in changes.items():
        if isinstance(value, str) and FILE_PREFIX in value:
            raise CommandError(f"{key} = {value[:80]!r} names a file", remedy="Change it in the text of the file.")
    return changes


#: Changed values that a page sends: dotted keys, with numbers and texts.
Changes = Annotated[dict[str, Value], AfterValidator(check_changes)]


class RunLimit:
    """Cancel flag of a run. It is set by the reader of the result, or after the time limit."""

    def __init__(self, seconds: float = MOST_SECONDS) -> None:
        self.cancelled = False
        self.allow(seconds)

    def allow(self, seconds: float) -> None:
        """Set the flag after this many seconds."""
        self.seconds, self.end = seconds, time.monotonic() + seconds

    def is_set(self) -> bool:
        """Return whether the run should end."""
        return self.cancelled or time.monotonic() > self.end


class RunRequest(PageRequest):
    """Request for a run, checked as far as possible before its drive is read.

    Attributes
    ----------
    path : str
        Name in the workspace, or ``catalogue:NAME``.
    text : str or None
        Text of the file, if the page has unsaved changes of it.
    changes : dict
        Dotted keys and values, in the form of `replace`.
    command : str or list of str
        As for `pneudrive.simulate`, with a file by its name in the workspace. A list has a text for each valve of a
        circuit.
    duration, rate, initial : str
        As for `pneudrive.simulate`. An empty `initial` is the default start.
    pixels : int
        Width of the drawing. At most two samples for each pixel are sent.
    """

    path: StrictStr = ""
    text: StrictStr | None = None
    changes: Changes = Field(default_factory=dict)
    command: StrictStr | list[StrictStr] = ""
    duration: StrictStr = ""
    rate: StrictStr = "1 kHz"
    initial: StrictStr = ""
    pixels: Pixels = 1000

    @field_validator("command")
    @classmethod
    def _check_command(cls, command: str | list[str]) -> str | list[str]:
        """Check that each line is a command or the name of a file; remove empty lines of a list."""
        lines = command if isinstance(command, list) else [command]
        for line in lines:
            if line.strip() and not (_FILE if line.lower().rstrip().endswith(".csv") else _COMMAND).fullmatch(line):
                raise CommandError.of("web.command", line=line)
        return [line for line in lines if line.strip()] if isinstance(command, list) else command

    def with_path(self, path: str) -> RunRequest:
        """Return the same request for another drive or circuit, without changes."""
        return self.model_copy(update={"path": path, "text": None, "changes": {}})

    def run(self, workspace: Workspace, described: Described, cancel: Flag) -> Run:
        """Simulate the drive or circuit `described`, and return its run.

        Raises
        ------
        PneudriveError
            As for `pneudrive.simulate`, or the run is too long for a page.
        Cancelled
            The flag was set, or the time limit is reached.
        """
        check_samples(positive(self.duration, "s", "duration") * positive(self.rate, "1/s", "sample_rate"))
        options: Plain = {"initial": self.initial or None, "sample_rate": self.rate, "watch": Watch(cancel=cancel)}
        return run(described, self.command_of(described, workspace), self.duration, **options)

    def command_of(self, described: Described, workspace: Workspace) -> Any:  # noqa: ANN401 - any form of a command
        """Return the command in the form of a description; files are given by their path.

        Raises
        ------
        CommandError
            The name refers to a file outside the workspace.
        """
        if "" not in described.commandable:
            return [_placed(line, workspace) for line in self.lines] or None
        return _placed(self.command if isinstance(self.command, str) else ", ".join(self.command), workspace)

    def as_command(self, out: str) -> str:
        """Return the shell line that makes the same run in the folder of the workspace, into a file `out`."""
        changes = [f"{key} = {value}" for key, value in self.changes.items()]
        times = {"duration": self.duration, "sample_rate": self.rate}
        return shell("simulate", self.path, command=self.lines, **times, initial=self.initial, set=changes, out=out)

    @property
    def lines(self) -> list[str]:
        """Commands that are not empty."""
        each = self.command if isinstance(self.command, list) else [self.command]
        return [line for line in each if line.strip()]

    def as_python(self, described: Described, number: str = "") -> str:
        """Return the Python lines that make the same run. The variables of drive and run end with the given number."""
        lines = [f"drive{number} = pn.{type(described).__name__}.load({self.path!r})"]
        if self.changes:
            lines.append(f"drive{number} = drive{number}.replace({dict(self.changes)!r})")
        return "\n".join([*lines, f"run{number} = {self.call('pn.simulate', number, sample_rate=self.rate)}"])

    def call(self, function: str, number: str = "", **options: Any) -> str:  # noqa: ANN401 - any value
        """Return a call in Python with the drive, its command, its duration and its start state."""
        values = (f"drive{number}", repr(self.command or None), repr(self.duration))
        return call(function, *values, initial=self.initial, **options)

    def stem(self) -> str:
        """Return the first part of the names of files made from the description."""
        return re.sub(r"[^\w.-]+", "-", Path(self.path.rpartition(":")[2]).stem).lstrip("-") or "run"


def check_samples(samples: float) -> None:
    """Reject a run that is too long for the page."""
    if not math.isfinite(samples) or samples > MOST_SAMPLES:
        raise CommandError.of("web.samples", samples=samples, most=MOST_SAMPLES)


def _placed(command: str, workspace: Workspace) -> str:
    """Return a command. If it is a file, return its path."""
    found = _FILE.fullmatch(command)
    return f"{found[1]}{workspace.path(found[2], COMMANDS)}" if found else command


def described_at(workspace: Workspace, path: str, text: str | None = None) -> Described:
    """Read a drive or a circuit from the workspace, from the catalogue, or from a given text.

    Results are cached, except for descriptions that refer to files.

    Raises
    ------
    CommandError, DescriptionError
        The name refers to a file outside the workspace, or the description is not valid.
    """
    if text is None and not is_in_catalogue(path):
        text = workspace.read(path)[0]
    read = _described.__wrapped__ if text is not None and FILE_PREFIX in text else _described
    return read(workspace, path, text)


@lru_cache(_KEPT)
def _described(workspace: Workspace, path: str, text: str | None) -> Described:
    if text is None:
        return Drive.load(path)
    place = workspace.root / "unnamed.toml" if is_in_catalogue(path) else workspace.path(path)
    name = place.relative_to(workspace.root).as_posix()
    return described_in(text, place, lambda tables: workspace.check_named(name, tables))


def with_changes(described: Described, changes: Keyed) -> Described:
    """Return a drive or a circuit with values that have passed `check_changes`.

    Raises
    ------
    CommandError, DescriptionError
        A value is not valid.
    """
    try:
        return described.replace(dict(changes)) if changes else described
    except TypeError:  # a key below a value; fields of the page have no such keys
        raise CommandError(f"{', '.join(changes)[:200]} cannot be changed here", remedy="Reload the page.") from None
