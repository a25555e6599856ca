"""Coverage of the truth by the band of a campaign's curve, over many worlds drawn at random.

``python -m trials.campaign_coverage [--count 200] [--seed 1]`` prints coverages: of measured points, of points between
them, of curves of one direction, of rows of the map. A further column is the ratio of the error to the error stated by
the band. A sixth as many campaigns of each rig in `RIGS` follow. The exit status is 1 if the band contains too few true
points.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from oracle.campaigns import AMBIENT_PA, BAR, LAWS, Friction, World, gauges, random_world, write_campaign
from pneudrive.characteristics import campaign_friction
from trials.shares import Hits, by_group, is_within, options

NORMAL_95 = 1.96
SAMPLES = {800: 400, 2000: 1200}  # of a stroke: enough, and twice as fast
BURST_HZ = 1000.0
RIGS = {
    "repeats and sentinels in random order, drift, zero that drifts": {"drift_share": 0.02, "zero_drift_n": 1.0},
    "one pass upwards, nothing repeated": {
        "repeats": 1,
        "order": "ascending",
        "sentinel_every": 0,
        "cycle_share": 0.005,
    },
    "three pressure pairs, scatter in newton": {
        "gauges_pa": ((0.0, 0.0), (2.0 * BAR, 0.0), (0.0, 2.0 * BAR)),
        "cycle_share": 0.0,
        "cycle_n": 0.4,
        "repeats": 1,
        "sentinel_every": 6,
    },
    "seals in two blocks each": {
        "levels": ({"seal": "A"}, {"seal": "B"}, {"seal": "A"}, {"seal": "B"}),
        "block_share": 0.01,
        "repeats": 1,
    },
    "slow noise, bursts, friction that varies over position": {
        "correlated_n": 1.0,
        "correlation_s": 0.1,
        "burst_hz": 1000.0,
        "ripple": ((0.02, 3.0, 1.0),),
        "slope_share": 0.03,
    },
    "gain error, air": {"gain_share": 0.003, "air_pa_s_m": 2e4, "cycle_share": 0.005},
}


def rig_world(kind: str, number: int) -> World:
    """Return a rig with a friction law that somebody's seal could have."""
    draw = np.random.default_rng([number, list(RIGS).index(kind)])
    coulomb = float(draw.uniform(10.0, 60.0))
    friction = Friction(
        law=LAWS[number % len(LAWS)],
        coulomb=coulomb,
        breakaway=coulomb * float(draw.uniform(1.1, 1.8)),
        stribeck_m_s=float(np.exp(draw.uniform(np.log(0.004), np.log(0.04)))),
        viscous=coulomb * float(draw.uniform(0.3, 2.5)),
        asymmetry=0.05 * float(draw.integers(2)),
        lip_a=1.5,
        lip_b=1.0,
    )
    return World(friction=friction, **({"samples": 300} | RIGS[kind]))


@dataclass
class Tally(Hits):
    """Hits and scores of one world or several."""

    measured: list[bool] = field(default_factory=list)
    between: list[bool] = field(default_factory=list)
    direction: list[bool] = field(default_factory=list)
    rows: list[bool] = field(default_factory=list)
    ends: list[bool] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

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


def random_plan(seed: int) -> World:
    """Return a random world with fewer samples."""
    drawn = random_world(seed)
    return replace(drawn, samples=SAMPLES[drawn.samples], burst_hz=BURST_HZ * (drawn.burst_hz > 0.0))


def main() -> None:
    """Print the table."""
    given = options(__doc__, 200)
    seeds = range(given.seed, given.seed + given.count)
    worlds = [random_plan(seed) for seed in seeds]
    tallies = [tally(world, seed) for world, seed in zip(worlds, seeds, strict=True)]
    sys.stdout.write(
        "| plan | campaigns | measured | between | one direction | rows of the map | error | half width |" + "\n"
    )
    sys.stdout.write("|---|---|---|---|---|---|---|---|" + "\n")
    for title, whole, chosen in by_group(GROUPS, worlds, tallies):
        sys.stdout.write(whole.line(title, chosen) + "\n")
    worst = (min(100 * np.mean(getattr(t, name)) for t in tallies) for name in ("measured", "rows"))
    sys.stdout.write("worst campaign: {:.1f} % of the measured points, {:.1f} % of the rows\n".format(*worst))
    ends = np.concatenate([t.ends for t in tallies])
    sys.stdout.write(f"truth taken at the beginning of the campaign: {100 * np.mean(ends):.1f} %" + "\n")
    fine = True
    for kind in RIGS:
        own = [tally(rig_world(kind, number), number) for number in seeds[: max(given.count // len(RIGS), 2)]]
        fine &= is_within(kind, [np.mean(t.measured + t.direction) for t in own], 0.90)
        tallies += own
    for name in ("measured", "direction", "rows"):
        fine &= is_within(name, [np.mean(getattr(t, name)) for t in tallies], 0.93, 0.995)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
