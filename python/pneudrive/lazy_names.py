"""Import of names of a package at their first use, so that a command loads only the modules that it needs."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from threading import RLock
from types import ModuleType, SimpleNamespace
from typing import Any

_LOCK = RLock()


def upper(name: str) -> Any:  # noqa: ANN401 - any function
    """Import a function of an upper layer for a method of a lower layer. ``upper.toml`` lists these functions."""
    from pneudrive.errors import package_table

    homes = {own: module for module, names in package_table(__file__, "upper.toml").items() for own in names}
    return getattr(import_module(homes[name]), name)


@contextmanager
def lazily(package: str) -> Iterator[dict[str, str]]:
    """Make the imports of a block lazy: names are imported at their first use. Type checkers see usual imports.

    Parameters
    ----------
    package : str
        ``__name__`` of the package. Its modules are also imported at their first use.

    Yields
    ------
    dict
        Module of each name. The dictionary is complete after the block.
    """
    homes: dict[str, str] = {}
    bound: list[str] = []  # also modules of the package itself

    def recorded(module: str, names: Sequence[str]) -> SimpleNamespace:
        bound.extend(names)
        homes.update(dict.fromkeys(names if module != package else (), module))
        return SimpleNamespace(**dict.fromkeys(names))

    with _imports(package, recorded):
        yield homes
    own = sys.modules[package]
    for name in bound:
        delattr(own, name)

    def get(name: str) -> object:
        if name in homes:
            value = getattr(import_module(homes[name]), name)
            setattr(own, name, value)
            return value
        if not name.startswith("_") and find_spec(f"{package}.{name}") is not None:
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module '{package}' has no attribute '{name}'")

    own.__getattr__ = get  # type: ignore[method-assign]


class _LaterModule(ModuleType):
    """A module that is imported when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any name of the module
        return getattr(import_module(self.__name__), name)


@contextmanager
def used_later(importer: str) -> Iterator[None]:
    """Make the module imports of a block lazy, like ``lazy import`` of Python 3.15.

    The block may contain only ``from package import module``. Type checkers and linters see usual imports.

    Parameters
    ----------
    importer : str
        ``__name__`` of the module with the block. Imports of other modules and threads are not affected.
    """
    with _imports(
        importer, lambda module, names: SimpleNamespace(**{leaf: _LaterModule(f"{module}.{leaf}") for leaf in names})
    ):
        yield


@contextmanager
def _imports(importer: str, answer: Callable[[str, Sequence[str]], SimpleNamespace]) -> Iterator[None]:
    """Replace each ``from module import names`` in the block of module `importer` by the result of `answer`."""
    with _LOCK:
        usual = builtins.__import__

        def later(name: str, *context: Any, **named: Any) -> Any:  # noqa: ANN401 - arguments of the standard library
            if len(context) > 2 and context[0] and context[0].get("__name__") == importer and context[2]:
                return answer(name, context[2])
            return usual(name, *context, **named)

        builtins.__import__ = later
        try:
            yield
        finally:
            builtins.__import__ = usual
