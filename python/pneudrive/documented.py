"""Parts of a docstring that a program shows to its user."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from types import ModuleType
from typing import Any


def parts_of(function: Callable[..., Any] | ModuleType, heading: str) -> tuple[str, dict[str, tuple[str, str]]]:
    """Return the text of a docstring, and the type and meaning of each entry below a heading.

    Parameters
    ----------
    function : callable or module
    heading : str
        Heading of the section, such as ``Options``.

    Examples
    --------
    >>> parts_of(parts_of, "Parameters")[1]["heading"]
    ('str', 'Heading of the section, such as ``Options``.')
    """
    text, _, described = inspect.cleandoc(function.__doc__ or "").partition(f"\n\n{heading}\n{'-' * len(heading)}\n")
    described = described.partition("\n\n")[0]
    parameters = {}
    for block in re.split(r"\n(?=\S)", described) if described else ():
        head, *lines = block.splitlines()
        name, _, form = head.partition(" : ")
        parameters[name] = (form, " ".join(line.strip() for line in lines))
    return text, parameters
