"""Linear algebra on one thread.

The matrices of a campaign are small. Threads that wait for each other on a busy machine cost more than they save. On
two busy processors, a computation took 47 s instead of 3 s.
"""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

#: Names of OpenBLAS in NumPy and SciPy, and by itself.
FORMS = ("scipy_openblas_{}_num_threads64_", "scipy_openblas_{}_num_threads", "openblas_{}_num_threads")


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenBLAS use one thread inside the block; other libraries of linear algebra are unchanged."""
    libraries = _libraries()
    before = [(put, int(get())) for put, get in libraries]
    try:
        for put, _ in libraries:
            put(1)
        yield
    finally:
        for put, count in before:
            put(count)


def _libraries() -> list[tuple[Callable[..., int], Callable[..., int]]]:
    """Find how to set and get the number of threads of each OpenBLAS that NumPy and SciPy have loaded."""
    import numpy as np
    import scipy

    found = []
    for package in (np, scipy):
        home = Path(str(package.__file__)).parent
        for folder in (home.parent / f"{home.name}.libs", home / ".dylibs"):
            for path in sorted(folder.glob("*openblas*")) if folder.is_dir() else ():
                with contextlib.suppress(OSError):
                    library = ctypes.CDLL(str(path))  # already loaded: this is the same library
                    found += _functions(library)
    return found


def _functions(library: ctypes.CDLL) -> list[tuple[Callable[..., int], Callable[..., int]]]:
    for form in FORMS:
        with contextlib.suppress(AttributeError):
            return [(getattr(library, form.format("set")), getattr(library, form.format("get")))]
    return []
