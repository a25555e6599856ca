"""From a datasheet to a controlled drive: measure its friction, identify its valve, tune, run; all of it simulated.

The steps are those of `pneudrive.studies.identified_axis`. Run as ``python examples/identified_to_controlled.py
docs/figures/identified-to-controlled.png`` it renews the guide's figure.
"""

import sys
from pathlib import Path

import pneudrive as pn
from pneudrive.report.render import draw_figure
from pneudrive.studies.identified_axis import identify_axis

found = identify_axis(pn.Circuit.load(Path(__file__).parent / "controlled_axis.toml"))
for head, rows in ((found.NUMBERS, found.numbers), (found.SCORES, found.scores)):
    for row in (head, ["---", *["---:"] * (len(head) - 1)], *rows):
        print(f"| {' | '.join(row)} |")
    print()
if len(sys.argv) > 1:
    draw_figure(found.figure(), sys.argv[1])
