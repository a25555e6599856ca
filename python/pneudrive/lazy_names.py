"""Lazy names of a package: each is imported at its first use, so that a command loads only the modules it needs."""

from __future__ import annotations

import builtins
import sys
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from threading import RLock
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

_LOCK = RLock()

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


class _LaterModule(ModuleType):
    """A module that is imported when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any name of the module
        return getattr(import_module(self.__name__), name)


@contextmanager
def used_later(importer: str) -> Iterator[None]:
    """Import the modules that a block names at their first use, as ``lazy import`` of Python 3.15 does.

    The block has lines ``from package import module`` only, so that type checkers and linters see usual imports.

    Parameters
    ----------
    importer : str
        ``__name__`` of the module with the block. Imports of other modules and threads are not affected.
    """
    with _LOCK:
        usual = builtins.__import__

        def later(name: str, *context: Any, **named: Any) -> Any:  # noqa: ANN401 - arguments of the standard library
            if len(context) > 2 and context[0] and context[0].get("__name__") == importer and context[2]:
                return SimpleNamespace(**{leaf: _LaterModule(f"{name}.{leaf}") for leaf in context[2]})
            return usual(name, *context, **named)

        builtins.__import__ = later
        try:
            yield
        finally:
            builtins.__import__ = usual
