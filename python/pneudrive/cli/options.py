"""Options that are read as quantities."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError, DescriptionError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def option(name: str) -> Iterator[None]:
    """Name the option whose text cannot be read.

    Raises
    ------
    CommandError
        Instead of the DescriptionError of the text.
    """
    try:
        yield
    except DescriptionError as error:
        raise CommandError(f"{name}: {error.what}", rule=error.rule, remedy=error.remedy) from None
