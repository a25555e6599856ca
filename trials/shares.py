"""Fractions of random trials that must be within bounds, with an allowance for chance."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

#: Standard errors over independent trials by which a share may miss its bounds by chance.
BY_CHANCE = 3.0


def is_within(title: str, shares: Sequence[float] | Sequence[bool], low: float, high: float = 1.0) -> bool:
    """Print the mean fraction of independent trials. Return whether it is from `low` to `high`, except for chance."""
    values = np.asarray(shares, dtype=float)
    mean, is_count = float(values.mean()), bool(np.isin(values, (0.0, 1.0)).all())

    def chance(bound: float) -> float:
        spread = np.sqrt(bound * (1.0 - bound)) if is_count else values.std(ddof=1)
        return BY_CHANCE * float(spread) / np.sqrt(values.size)

    held = low - chance(low) <= mean <= high + chance(high)
    sys.stdout.write(
        f"{title}: {100 * mean:.1f} % of {values.size} trials, wanted {100 * low:.0f} to {100 * high:.0f} %"
        f"{'' if held else '   <-- outside'}\n"
    )
    sys.stdout.flush()
    return held


@dataclass
class Hits:
    """Lists of counts of one trial or several."""

    def __add__(self, other: Hits) -> Hits:
        return type(self)(**{name: own + getattr(other, name) for name, own in vars(self).items()})


def by_group(groups: dict[str, Callable[[Any], bool]], worlds: list, hits: list) -> Iterator[tuple[str, Any, list]]:
    """Give title, sum and each of the hits of the worlds of every group that has any."""
    for title, belongs in groups.items():
        if chosen := [own for world, own in zip(worlds, hits, strict=True) if belongs(world)]:
            yield title, sum(chosen[1:], chosen[0]), chosen


def options(description: str | None, count: int) -> argparse.Namespace:
    """Return the number of trials and the first seed of a command line."""
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1, help="seed of the first trial; the others follow")
    return parser.parse_args()
