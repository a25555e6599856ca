"""How often the band of a campaign's curve holds the truth, over many worlds drawn at random.

``python tests/oracle/campaign_coverage.py [--count 200] [--first 0]`` prints a table: share of the measured points, of
those between them, of curves of one direction, of the rows of the map; and the error as a share of what the band says.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from oracle.campaigns import AMBIENT_PA, World, gauges, random_world, write_campaign
from pneudrive.characteristics import campaign_friction

NORMAL_95 = 1.96
SAMPLES = {800: 400, 2000: 1200}  # of a stroke: enough, and twice as fast
BURST_HZ = 1000.0


@dataclass
class Tally:
    """Hits and scores of one world or several."""

    measured: list[bool] = field(default_factory=list)
    between: list[bool] = field(default_factory=list)
    direction: list[bool] = field(default_factory=list)
    rows: list[bool] = field(default_factory=list)
    ends: list[bool] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Put another tally to this one."""
        for name, values in vars(other).items():
            getattr(self, name).extend(values)

    def line(self, title: str, each: list[Tally]) -> str:
        """Write one row of the table; with the standard error over the campaigns of the share of measured points."""
        own = [float(np.mean(one.measured)) for one in each]
        stderr = 100.0 * np.std(own, ddof=1) / np.sqrt(len(own)) if len(own) > 1 else float("nan")
        shares = (self.measured, self.between, self.direction, self.rows)
        first, *others = (f"{100 * np.mean(part):.1f}" for part in shares)
        text = " | ".join([f"{first} ± {stderr:.1f} %", *(f"{other} %" for other in others)])
        size = np.sqrt(np.mean(np.square(self.scores)))
        return f"| {title} | {len(each)} | {text} | {size:.2f} | {100 * np.mean(self.widths):.1f} % |"


def tally(world: World, seed: int) -> Tally:
    """Write one world's campaign, characterise it, and count."""
    out = Tally()
    with tempfile.TemporaryDirectory() as folder:
        found = campaign_friction(write_campaign(Path(folder) / "campaign", world, seed), processes=1)
    for curve in found.curves:
        true = world.truth(curve.speed_m_s, gauges(curve.condition), curve.direction)
        hit = (curve.low_n <= true) & (true <= curve.high_n)
        if curve.direction != 0:
            out.direction += hit[curve.measured].tolist()
            continue
        out.measured += hit[curve.measured].tolist()
        out.between += hit[~curve.measured].tolist()
        first = true * (1.0 - world.drift_share / 2.0)
        out.ends += ((curve.low_n <= first) & (first <= curve.high_n))[curve.measured].tolist()
        half = (curve.high_n - curve.low_n) / 2.0
        out.scores += ((curve.friction_n - true) / half * NORMAL_95)[curve.measured].tolist()
        out.widths += (half / true)[curve.measured].tolist()
    table = found.friction_map
    known = {gauges(c.condition) for c in found.curves}
    names = ("velocity_m_s", "pressure_a_pa", "pressure_b_pa", "friction_low_n", "friction_high_n")
    for v, a, b, low, high in zip(*(table[name].to_numpy() for name in names), strict=True):
        near = min(known, key=lambda g: abs(g[0] + AMBIENT_PA - a) + abs(g[1] + AMBIENT_PA - b))
        out.rows.append(bool(low <= world.truth(abs(v), near) <= high))
    return out


GROUPS: dict[str, Callable[[World], bool]] = {
    "all": lambda w: True,
    "nothing repeated, no sentinels": lambda w: w.repeats == 1 and not w.sentinel_every,
    "sentinels only": lambda w: w.repeats == 1 and w.sentinel_every > 0,
    "repeats": lambda w: w.repeats > 1,
    "rising order": lambda w: w.order == "ascending",
    "random order": lambda w: w.order == "randomised",
    "several pressures": lambda w: len(w.gauges_pa) > 1,
    "Gaussian": lambda w: w.friction.law == "gauss",
    "exponential": lambda w: w.friction.law == "exponential",
    "Lorentzian": lambda w: w.friction.law == "lorentz",
    "Coulomb and viscous": lambda w: w.friction.law == "viscous",
    "no drift": lambda w: w.drift_share == 0.0,
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    worlds, tallies = [], []
    for seed in range(options.first, options.first + options.count):
        drawn = random_world(seed)
        world = replace(drawn, samples=SAMPLES[drawn.samples], burst_hz=BURST_HZ * (drawn.burst_hz > 0.0))
        worlds.append(world)
        tallies.append(tally(world, seed))
    sys.stdout.write(
        "| plan | campaigns | measured | between | one direction | rows of the map | error | half width |" + "\n"
    )
    sys.stdout.write("|---|---|---|---|---|---|---|---|" + "\n")
    for title, belongs in GROUPS.items():
        part = Tally()
        chosen = [t for w, t in zip(worlds, tallies, strict=True) if belongs(w)]
        for one in chosen:
            part.add(one)
        if chosen:
            sys.stdout.write(part.line(title, chosen) + "\n")
    worst = (min(100 * np.mean(getattr(t, name)) for t in tallies) for name in ("measured", "rows"))
    sys.stdout.write("worst campaign: {:.1f} % of the measured points, {:.1f} % of the rows\n".format(*worst))
    ends = np.concatenate([t.ends for t in tallies])
    sys.stdout.write(f"truth taken at the beginning of the campaign: {100 * np.mean(ends):.1f} %" + "\n")


if __name__ == "__main__":
    main()
