"""Lazy names of a package: each is imported at its first use, so that a command loads only the modules it needs."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

#: Name -> module of an upper layer. The package root fills it, because the layers below do not know that module.
UPPER: dict[str, str] = {}


def upper(name: str) -> Any:  # noqa: ANN401 - any function
    """Return a function of an upper layer, for a method that only calls this function."""
    return getattr(import_module(UPPER[name]), name)


def lazy(package: str, homes: Mapping[str, Sequence[str]]) -> Callable[[str], object]:
    """Return the ``__getattr__`` of a package.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    homes : mapping
        Module within the package, or its full name -> public names that it holds. Other modules of the package keep
        their own names.
    """
    home = {name: module for module, names in homes.items() for name in names}

    def get(name: str) -> object:
        if name in home:
            module = home[name] if home[name].startswith("pneudrive.") else f"{package}.{home[name]}"
            value = getattr(import_module(module), name)
            setattr(sys.modules[package], name, value)
            return value
        if not name.startswith("_") and find_spec(f"{package}.{name}") is not None:
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module '{package}' has no attribute '{name}'")

    return get
