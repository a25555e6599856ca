"""Page of results of control: measure errors of `nmpc` on the axes, or write the page from stored measurements.

    python -m benches.control_results --measure [--seeds 5] [--axes P1,P2,P3,P3h]    measures and writes both files
    python -m benches.control_results                                               writes the page

`benches/control_results.json` has the measured values, `docs/guide/control-results.md` shows them. All is simulated.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

import pneudrive as pn
from benches.control_goals import AXES, EXAMPLES

VALUES = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).parents[1] / "docs/guide/control-results.md"
ALONG = ("R1", "R2", "R3")
#: Name of a study -> mismatch of the drive from its description.
STUDIES = {"as described": None, "all": "all", "mass 0.5": "mass-50", "mass 1.6": "mass+60"}
HEAD = """# Errors of the controllers

With this page you can look up how closely `nmpc` follows a reference. **All of it is simulated.**
`python -m benches.control_results` writes this page. [](control.md) explains the controllers and the references.

The table has the largest error of `nmpc` in µm with the instrumentation `real`. Along the sines R1 and R2 it is the
error in the last 4 s, along R3 the error in the whole run. The values are medians of {seeds} seeds. Peaks of fast moves
differ by 30 % between seeds. The axes are files of `examples`:

- P1 is `controlled_axis.toml`, and P2 is `axes/bench.toml`.
- P3 is `axes/starter.toml`, a light piston with a sticky seal. P3h is `axes/starter_heavy.toml` with 4 kg more.

| axis | drive | R1 | R2 | R3 |
|---|---|---|---|---|
"""


def measure(axis: str, seeds: int) -> dict[str, dict[str, float]]:
    """Return the median error, um, of each study and reference."""
    drive = pn.Circuit.load(EXAMPLES / f"{AXES[axis]}.toml")
    along = pn.control.standard(drive)

    def error_um(mismatch: str | None, reference: str, seed: int) -> float:
        run = pn.control.run(drive, "nmpc", reference=along[reference], mismatch=mismatch, seed=seed)
        return 1e6 * float(run.attrs["score"]["max_error_m"])

    return {
        name: {
            reference: round(statistics.median(error_um(mismatch, reference, 1 + i) for i in range(seeds)))
            for reference in ALONG
        }
        for name, mismatch in STUDIES.items()
    }


def page(values: dict[str, object]) -> str:
    """Return the page."""
    axes: dict[str, dict[str, dict[str, float]]] = values["axes"]  # type: ignore[assignment]
    rows = [
        f"| {axis} | {study} | " + " | ".join(f"{errors[reference]:g}" for reference in ALONG) + " |"
        for axis, studies in axes.items()
        for study, errors in studies.items()
    ]
    return HEAD.format(seeds=values["seeds"]) + "\n".join(rows) + "\n"


def main() -> None:
    """Measure if asked to, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--axes", default="P1,P2,P3,P3h")
    asked = parser.parse_args()
    if asked.measure:
        found = {"seeds": asked.seeds, "axes": {axis: measure(axis, asked.seeds) for axis in asked.axes.split(",")}}
        VALUES.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(json.loads(VALUES.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main()
