"""Intervals by profile likelihood: one coordinate is held, all others are fitted again [bates1988]."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


Point = TypeVar("Point")

#: Largest number of steps to find an end, and relative error of the root of the cost's growth at it.
STEPS, ROOT_ERROR = 12, 0.02
#: Distance without sufficient growth of the cost beyond which a side is open.
FARTHEST = 50.0
#: Least distance of a step from both ends of the bracket, as a share of the bracket, and largest growth of a distance.
INSET, GROWTH = 0.1, 3.0


def profile_interval(
    held: Callable[[float, Point], tuple[float, Point]],
    point: Point,
    estimate: float,
    step: float,
    least: float,
    allowed: float,
    farthest: float = FARTHEST,
) -> tuple[float, float]:
    """Return the interval of one coordinate in which the cost grows by no more than `allowed`.

    For a linear model, the square root of the growth of the cost is linear, so a secant method finds each end. The
    secant stays within
    a bracket: the farthest point below the limit and the nearest one beyond it. Incompletely minimised costs scatter,
    but the bracket keeps its points. A side is open only if no point is beyond the
    limit.

    Parameters
    ----------
    held : callable
        ``held(value, start)`` holds the coordinate at a value, fits all others from a start, and returns the cost and
        the point where it ended. A step starts from the last point below the limit. The cost may be infinite.
    point : object
        Point of the estimate: start of the first step to either side.
    estimate : float
        Coordinate at the estimate.
    step : float
        First step; the half width of the first-order interval.
    least, allowed : float
        Cost at the estimate, and its growth at the ends.
    farthest : float
        Distance from the estimate beyond which a side is open.

    Returns
    -------
    float, float
        Ends; infinite if the cost never grows so far.

    Examples
    --------
    The model 3 x of the values 3, 6 and 9 at unit weights grows by (3^2 + 6^2 + 9^2) (x - 1)^2 about x = 1.

    >>> low, high = profile_interval(lambda x, _: (126.0 * (x - 1.0) ** 2, None), None, 1.0, 0.1, 0.0, 126.0)
    >>> round(low, 6), round(high, 6)
    (0.0, 2.0)
    """
    first = step if step > 0.0 else 1.0
    low, high = (_end(held, point, estimate, sign * min(first, farthest), least, allowed, farthest) for sign in (-1, 1))
    return estimate + low, estimate + high


def _end(
    held: Callable[[float, Point], tuple[float, Point]],
    point: Point,
    estimate: float,
    step: float,
    least: float,
    allowed: float,
    farthest: float,
) -> float:
    """Return the signed distance to one end. Infinite if no point is beyond the limit up to `farthest`."""
    sign, away = float(np.sign(step)), abs(step)
    below, beyond = [(0.0, 0.0)], (np.inf, np.inf)  # distances, and roots of the cost's growth
    for _ in range(STEPS):
        cost, ended = held(estimate + sign * away, point)
        root = float(np.sqrt(max(cost - least, 0.0) / allowed)) if np.isfinite(cost) else np.inf
        if abs(root - 1.0) < ROOT_ERROR:
            return sign * away
        if root < 1.0:
            below.append((away, root))
            point = ended
        else:
            beyond = (away, root)
        last, root_last = below[-1]
        if np.isfinite(beyond[0]):
            share = (1.0 - root_last) / (beyond[1] - root_last) if np.isfinite(beyond[1]) else 0.5
            away = last + (beyond[0] - last) * float(np.clip(share, INSET, 1.0 - INSET))
        elif last >= farthest:
            break
        else:
            before, root_before = below[-2]
            slope = (root_last - root_before) / (last - before)
            away = last + (1.0 - root_last) / slope if slope > 0.0 else np.inf
            away = min(max(away, (1.0 + INSET) * last), GROWTH * last, farthest)
    return sign * (away if np.isfinite(beyond[0]) else np.inf)


# --- Linear algebra on one thread.
#
# The matrices of a campaign are small. Threads that wait for each other on a busy machine cost more than they save. On
# two busy processors, a computation took 47 s instead of 3 s.

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
