"""Error classes for all steps from the description to the result. All messages have the same form."""

from __future__ import annotations

import re
import sys
import warnings
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from typing_extensions import Self


_NOT_THE_CALLER = ("pneudrive", "pydantic")

Wrong = TypeVar("Wrong", bound="PneudriveError")
#: First words of severe findings: danger to people or the machine, or a reason not to order. Outputs never hide them.
SEVERE = HAZARD, OPEN_CHECK, NOT_READY = "Hazard: ", "Open check: ", "Not ready to order: "
MOST_SHOWN = 30  # largest number of further errors of one file in a message
LONGEST_QUOTE, LONGEST_PART = 300, 800  # characters: of the quoted value, and of any other part of a message
#: Control characters except the end of a line, and characters that reverse the direction of text.
_HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")


def shown(given: object, longest: int = LONGEST_QUOTE) -> str:
    r"""Escape the control characters in a text from a file or a user, for messages and reports.

    Long texts are cut in the middle.

    Examples
    --------
    >>> print(shown(f"seal {chr(0x202E)}5"))
    seal \u202e5
    >>> shown("x" * 1000, 20)
    'xxxxxxxxxxxxx ... xxxxx'
    """
    text = str(given)
    if len(text) > longest:
        head = longest * 2 // 3
        text = f"{text[:head]} ... {text[head - longest + 2 :]}"
    return _HIDDEN.sub(lambda sign: ascii(sign[0])[1:-1], text)


@cache
def package_table(module: str, name: str) -> dict[str, Any]:
    """Return the tables of the TOML file `name` in the folder of the file `module`.

    The file is read once, and all callers share its tables: do not change them.
    """
    return tomllib.loads((Path(module).parent / name).read_text(encoding="utf-8"))


def messages(package: str) -> dict[str, dict[str, str]]:
    """Return the messages of a package: name -> what, value, rule and remedy, with placeholders in braces."""
    return package_table(__file__, f"{package}/messages.toml")


#: Parts of an error in addition to the description of the problem.
DETAILS = ("where", "value", "rule", "remedy")


class PneudriveError(Exception):
    """Base of every error that pneudrive raises on purpose.

    Parameters
    ----------
    what : str
        Problem, with names and values.
    where : str or Path, optional
        File and line, command-line option, row or time.
    value : object, optional
        The rejected value or line, as the user wrote it.
    rule : str, optional
        The rule that the value breaks.
    remedy : str, optional
        Advice for the user.

    Examples
    --------
    >>> print(DescriptionError("cylinder.bore = 0 mm", where="drive.toml:7", rule="bore > 0", remedy="Give the bore."))
    cylinder.bore = 0 mm.   drive.toml:7
        Rule: bore > 0
        Hint: Give the bore.
    """

    key: str | None = None  # dotted name of the wrong key, with which the file reader finds the line

    def __init__(
        self,
        what: str,
        *,
        where: str | Path | None = None,
        value: object = None,
        rule: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what, self.value, self.rule, self.remedy = what, value, rule, remedy
        self.where = None if where is None else str(where)
        self.others: tuple[Any, ...] = ()  # further errors

    @classmethod
    def of(cls, message: str, **values: Any) -> Self:  # noqa: ANN401 - of any type that a text can show
        """Return the error with a message of ``messages.toml``.

        Parameters
        ----------
        message : str
            Package and name of the message: ``"signals.no-motion"``.
        **values : object
            Values of the placeholders in the message. ``where``, ``value``, ``rule`` and ``remedy`` also become parts
            of the error.
        """
        package, _, name = message.partition(".")
        parts = {part: text.format(**values) for part, text in messages(package)[name].items()}
        parts |= {part: values[part] for part in DETAILS if values.get(part) is not None}
        return cls(parts.pop("what"), **parts)

    def __str__(self) -> str:
        """Return the message: what and where in the first line, then value, rule and remedy, then further errors."""
        first = f"{shown(self.what.rstrip('.'), LONGEST_PART)}."
        lines = [f"{first}   {shown(self.where, LONGEST_PART)}" if self.where else first]
        if self.value is not None:
            lines.append(f"    {shown(self.value, LONGEST_QUOTE)}")
        if self.rule:
            lines.append(f"    Rule: {shown(self.rule, LONGEST_PART)}")
        if self.remedy:
            lines.append(f"    Hint: {shown(self.remedy, LONGEST_PART)}")
        lines += map(str, self.others[:MOST_SHOWN])
        if len(self.others) > MOST_SHOWN:
            lines.append(f"... and {len(self.others) - MOST_SHOWN} more.")
        return "\n".join(lines)

    def each(self: Wrong) -> list[Wrong]:
        """Return this error and the errors that it contains."""
        return [self, *self.others]

    def turned(self, kind: type[Wrong]) -> Wrong:
        """Return this error as an error of another class, with the same message."""
        return together([kind(e.what, **{part: getattr(e, part) for part in DETAILS}) for e in self.each()])


ErrorKind = type[PneudriveError]


def together(errors: Sequence[Wrong]) -> Wrong:
    """Combine several errors into one that shows them all, in their order."""
    first = errors[0]
    first.others = tuple(errors[1:])
    return first


class Problems:
    """Errors of a file, gathered until the whole file is checked, so that its author can correct them all at once.

    Examples
    --------
    >>> problems = Problems()
    >>> for name in ("bore", "stroke"):
    ...     with problems.caught():
    ...         raise DescriptionError(f"{name} is missing")
    >>> problems.tell()
    Traceback (most recent call last):
    pneudrive.errors.DescriptionError: bore is missing.
    stroke is missing.
    """

    def __init__(self) -> None:
        self.found: dict[tuple[str, str | None], PneudriveError] = {}

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Keep an error that is raised in the block, and continue after the block."""
        try:
            yield
        except PneudriveError as error:
            self.add(error)

    def take(self, read: Callable[..., Any], *arguments: object, otherwise: Any = None) -> Any:  # noqa: ANN401
        """Return the result of `read`. If it raises an error, keep the error and return `otherwise`."""
        with self.caught():
            return read(*arguments)
        return otherwise

    def add(self, error: PneudriveError) -> None:
        """Add an error and the errors that it contains. An error that was added before is ignored."""
        for one in error.each():
            one.others = ()
            self.found.setdefault((one.what, one.where), one)

    def tell(self) -> None:
        """Raise all errors as one, if there are any."""
        if self.found:
            raise together(list(self.found.values()))


class DescriptionError(PneudriveError, ValueError):
    """A drive description (file or Python) is not valid. The error is a `ValueError`, so that pydantic collects it."""


def wrong(key: str, what: str, *, rule: str | None = None, remedy: str | None = None) -> DescriptionError:
    """Return an error for one key, with rule and remedy. The file reader uses ``error.key`` to find the line."""
    error = DescriptionError(what, rule=rule, remedy=remedy)
    error.key = key
    return error


def invalid(key: str, message: str, /, **values: object) -> DescriptionError:
    """Return an error for one key with a message of ``messages.toml``; see `PneudriveError.of`."""
    error = DescriptionError.of(message, **values)
    error.key = key
    return error


def within(
    error: DescriptionError, name: str, above: str = "", written: Callable[[str], str] = str
) -> DescriptionError:
    """Convert errors of an inner table to errors of the outer table that contains it.

    Parameters
    ----------
    error : DescriptionError
        Error, with the errors that it contains.
    name : str
        Key of the inner table, and its name in messages.
    above : str
        Prefix of the key. Messages do not show it.
    written : callable
        Function that converts the key of an error to the key that the user wrote.
    """
    out = []
    for one in error.each():
        key = one.key or ""
        what = f"{name}.{one.what}" if key and one.what.startswith(key) else f"{name}: {one.what}"
        out.append(wrong(f"{above}{name}.{written(key)}".rstrip("."), what, rule=one.rule, remedy=one.remedy))
    return together(out)


class LayoutError(PneudriveError):
    """A layout file (description of the columns of a recording) is not valid."""


class RecordingError(PneudriveError):
    """A recording cannot be read or lacks data that are needed."""


class CommandError(PneudriveError):
    """A command, an option or an output path of a run is not valid."""


class SimulationError(PneudriveError):
    """A simulation cannot continue. The message gives the time, the state and a remedy."""


class OwnLawError(SimulationError):
    """A custom controller raised an error or returned NaN. The run ends at this time."""


class FitError(PneudriveError):
    """Parameters could not be estimated from the data."""


class ProtocolError(PneudriveError):
    """A campaign protocol is not valid, or violates a limit of the rig."""


class RigError(PneudriveError):
    """A rig cannot carry out a request because of a fault, a limit or a lost connection."""


class ConnectionLostError(RigError):
    """The connection to a rig was lost and restored. The rig is at rest without pressure; its saved state may be lost.

    The running cycle is lost. The caller restores the rig's saved state (`Reproducible.restore`) and repeats the cycle.
    """


class CampaignError(PneudriveError):
    """A campaign folder cannot be used: it is locked, read-only, full, not a campaign, or has inconsistent files."""


class Cancelled(PneudriveError):  # noqa: N818 - not an error
    """A long call ended because its cancel flag was set."""


class PneudriveWarning(UserWarning):
    """A result has a limitation that its user should know, such as a friction law that is not passive."""


def warn(message: str) -> None:
    """Issue a warning about a result, located at the calling line of the user's code."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _NOT_THE_CALLER:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, PneudriveWarning, stacklevel=level)


def is_severe(finding: str) -> bool:
    """Return whether a finding is a hazard, an open check, or a reason not to order the drive yet."""
    return finding.removeprefix("! ").startswith(SEVERE)


def nearest(name: str, choices: Iterable[str]) -> str:
    """Return a hint: the nearest known name, and all known names.

    Examples
    --------
    >>> nearest("strok", ["bore", "stroke"])
    "Did you mean 'stroke'? Known: bore, stroke."
    """
    known = sorted(choices)
    small = {choice.lower(): choice for choice in known}
    close = get_close_matches(name.lower(), small, n=1, cutoff=0.5)
    guess = f"Did you mean '{small[close[0]]}'? " if close else ""
    return f"{guess}Known: {', '.join(known) or 'none'}."


@contextmanager
def naming(name: str, caught: ErrorKind = DescriptionError, kind: ErrorKind = CommandError) -> Iterator[None]:
    """Put a name before the message of each error that the block raises.

    Raises
    ------
    PneudriveError
        An error of `kind`: the block raised an error of the class `caught`.
    """
    try:
        yield
    except caught as error:
        raise kind(f"{name}: {error.what}", where=error.where, rule=error.rule, remedy=error.remedy) from None
