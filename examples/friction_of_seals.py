"""Friction of seals against pressure, from the real recordings: the figure and the table on the project's first page.

Run as ``python examples/friction_of_seals.py docs/figures/friction-of-seals.png`` it renews the figure.
"""

import sys
from pathlib import Path

import numpy as np

import pneudrive as pn
from pneudrive.characterise import characterise_recordings

MEASUREMENTS = Path(__file__).resolve().parents[1] / "data" / "measurements" / "zillen-2021-pneumatic-piston"

found = characterise_recordings(
    sorted(MEASUREMENTS.glob("friction/*.csv.xz")) + sorted(MEASUREMENTS.glob("rep*/*.csv.xz"))
)
pn.report.plot_pressure(found, sys.argv[1] if len(sys.argv) > 1 else "friction-of-seals.png")

print("| seal | pressure, bar | measured, N (U, k = 2) | line over pressure, N | a further run, N (95 %) |")
print("| --- | ---: | ---: | ---: | ---: |")
for line in found.pressure_lines:
    points = sorted(line.points, key=lambda point: point.pressure_pa)
    for point in (points[0], points[-1]):
        at, grid = point.pressure_pa, line.band_pressure_pa
        fitted, low, high = (np.interp(at, grid, y) for y in (line.band_mean_n, line.band_low_n, line.band_high_n))
        measured = f"{point.friction_n:.1f} ± {point.expanded_n:.1f}"
        print(f"| {line.seal} | {at / 1e5:.1f} | {measured} | {fitted:.1f} | {max(low, 0.0):.1f} … {high:.1f} |")
