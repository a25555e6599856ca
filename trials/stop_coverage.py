"""Coverage of the truth by the intervals of slopes per decade of stop duration, over many campaigns drawn at random.

``python -m trials.stop_coverage [--count 150] [--seed 1]`` prints a table. Three columns are the coverage of 95 %
intervals: of the slope at the reference duration, of the mean slope, and of slopes at single conditions. The next
column is the half width over the true slope of the log law at 15 s. The last one is the fraction in which the law that
made the data has support. The exit status is 1 if the first, second or last one is too small.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from oracle.stop_campaigns import AMBIENT_PA, LAWS, StopWorld, random_stop_world, write_stops
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.friction.campaign.stops.dwell_law import fit_dwell
from pneudrive.friction.campaign.stops.stop import find_stops
from trials.shares import Hits, by_group, is_within, options

#: The law of the product that is the one by which a world was made.
MADE_BY = {
    "log": "log",
    "late log": "log",
    "stretched": "kato",
    "saturating": "kato-free",
    "hyperbolic": "hyperbolic",
    "exponential": "exponential",
    "none": "none",
}
SUPPORTED = 10.0  # difference of AICc


@dataclass
class Tally(Hits):
    """Hits of some campaigns."""

    slope: list[bool] = field(default_factory=list)
    mean: list[bool] = field(default_factory=list)
    each: list[bool] = field(default_factory=list)
    width: list[float] = field(default_factory=list)
    bias: list[float] = field(default_factory=list)
    law: list[bool] = field(default_factory=list)

    def line(self, title: str, worlds: int) -> str:
        """Write one row of the table; with the standard error of the share whose slope is in its interval."""
        share = float(np.mean(self.slope))
        stderr = 100.0 * np.sqrt(share * (1.0 - share) / len(self.slope))
        others = " | ".join(f"{100 * np.mean(part):.0f} %" for part in (self.mean, self.each))
        law = f"{100 * np.mean(self.law):.0f} %" if self.law else "–"
        slope = f"{100 * share:.0f} ± {stderr:.0f} %"
        size = f"{np.median(self.width):.2f} N | {np.mean(self.bias):+.2f} N"
        return f"| {title} | {worlds} | {slope} | {others} | {size} | {law} |"


def tally(world: StopWorld, seed: int) -> Tally:
    """Write one world's campaign, read it, and count."""
    out = Tally()
    with tempfile.TemporaryDirectory() as folder:
        stops, _ = find_stops(Campaign.open(write_stops(Path(folder) / "c", world, seed)), 1)
    series, _ = fit_dwell(stops, AMBIENT_PA)
    if not series or series[0].slope is None or series[0].mean_slope is None:
        out.slope.append(False)
        out.mean.append(False)
        return out
    s = series[0]
    gauges = [(round(c.pressure_a_pa - AMBIENT_PA, -3), round(c.pressure_b_pa - AMBIENT_PA, -3)) for c in s.conditions]
    true = [world.slope(s.reference_s, g) for g in gauges]
    out.slope.append(s.slope.low <= float(np.mean(true)) <= s.slope.high)
    mean = float(np.mean([world.mean_slope(g) for g in gauges]))
    out.mean.append(s.mean_slope.low <= mean <= s.mean_slope.high)
    out.each += [e.low <= t <= e.high for e, t in zip(s.slopes, true, strict=True)]
    out.width.append((s.slope.high - s.slope.low) / 2.0)
    out.bias.append(s.slope.value - float(np.mean(true)))
    if world.law in MADE_BY and s.laws:
        out.law.append(any(law.name == MADE_BY[world.law] and law.delta < SUPPORTED for law in s.laws))
    return out


GROUPS: dict[str, Callable[[StopWorld], bool]] = {
    "all": lambda w: True,
    **{law: (lambda w, law=law: w.law == law) for law in LAWS},
    "released": lambda w: w.released,
    "held": lambda w: not w.released,
    "random order": lambda w: w.order == "randomised",
    "durations rising": lambda w: w.order == "ascending",
    "several pressures": lambda w: len(w.gauges_pa) > 1,
    "three blocks": lambda w: w.blocks > 1,
    "no uninterrupted strokes": lambda w: w.references == 0,
    "heavy tails": lambda w: w.heavy_tails,
}


def main() -> None:
    """Print the table."""
    given = options(__doc__, 150)
    seeds = range(given.seed, given.seed + given.count)
    worlds = [replace(random_stop_world(seed), samples=900) for seed in seeds]
    tallies = [tally(world, seed) for world, seed in zip(worlds, seeds, strict=True)]
    head = "| campaigns of | number | slope at 15 s | mean slope | single conditions | half width | mean error | law |"
    sys.stdout.write(f"{head}\n|---|---|---|---|---|---|---|---|\n")
    for title, whole, chosen in by_group(GROUPS, worlds, tallies):
        sys.stdout.write(whole.line(title, len(chosen)) + "\n")
    fine = True
    for name in ("slope", "mean", "law"):
        fine &= is_within(name, [hit for one in tallies for hit in getattr(one, name)], 0.95)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
