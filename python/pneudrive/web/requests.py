"""Requests of the page as models, whose fields are checked once, and the lines that repeat them elsewhere."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, FiniteFloat, StrictInt, StrictStr, ValidationError

from pneudrive.errors import CommandError
from pneudrive.web.workspace import safe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from typing_extensions import Self

MOST_PIXELS, LEAST_PIXELS = 4000, 10
#: Width of a drawing; one that is out of bounds is cut to them.
Pixels = Annotated[StrictInt, AfterValidator(lambda width: max(LEAST_PIXELS, min(width, MOST_PIXELS)))]
#: Text or number of a value that a field of the page changes; a truth is a number.
Value = StrictStr | StrictInt | FiniteFloat


class PageRequest(BaseModel):
    """A request of the page. Additional fields are ignored, because one message may contain several requests."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Read a request.

        Raises
        ------
        CommandError
            A part is missing or of another type.
        """
        try:
            return cls.model_validate(given)
        except ValidationError:
            raise wrong_request() from None


def wrong_request() -> CommandError:
    """Return the error for a request that the page does not send."""
    return CommandError("this page does not send such a request", remedy="Reload the page.")


def words(command: str, /, *names: str, **options: Any) -> list[str]:  # noqa: ANN401 - texts, numbers, lists of them
    """Return the words of a command: its arguments, then its options without the empty ones.

    Examples
    --------
    >>> words("fit", "-map.csv", laws="stribeck", ambient=None, profile=True, set=["a = 1", "b = 2"])
    ['fit', './-map.csv', '--laws', 'stribeck', '--profile', '--set', 'a = 1', '--set', 'b = 2']
    """
    out = [*command.split(), *map(safe, names)]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            out.append(flag)
        elif not _is_empty(value):
            out += [word for text in (value if isinstance(value, list) else [value]) for word in (flag, str(text))]
    return out


def shell(command: str, /, *names: str, **options: Any) -> str:  # noqa: ANN401 - as for `words`
    """Return a line of a shell. See `words`."""
    return shlex.join(["pneudrive", *words(command, *names, **options)])


def call(function: str, /, *positional: str, **options: Any) -> str:  # noqa: ANN401 - any value
    """Return a call in Python: arguments as they are, then the options without the empty ones.

    Examples
    --------
    >>> call("pn.simulate", "drive", "'0.5 s'", initial="", rtol=1e-4)
    "pn.simulate(drive, '0.5 s', rtol=0.0001)"
    """
    named = [f"{name}={value!r}" for name, value in options.items() if not _is_empty(value)]
    return f"{function}({', '.join([*positional, *named])})"


def _is_empty(value: object) -> bool:
    return value is None or value is False or value in ("", {}, [])
