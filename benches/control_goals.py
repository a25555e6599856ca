"""Goals of control: each cell of the table in docs/guide/control.md, measured.

    python -m benches.control_goals --out FOLDER [--members 200] [--seeds 5] [--axes P1,P2,P3,P3h] [--law nmpc]

Runs are kept in FOLDER, so that a call that was interrupted goes on. All of it is simulated.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import pneudrive as pn
from pneudrive.control.loop import prepare, run_prepared

AXES = {"P1": "controlled_axis", "P2": "axes/bench", "P3": "axes/starter", "P3h": "axes/starter_heavy"}
EXAMPLES = Path(__file__).parents[1] / "examples"
#: 60 mm and 60 s of rest.
REST = "{0:g} mm; 1 s: {1:g} mm in 0.3 s; 61.3 s: {1:g} mm in 0.1 s"
STEPS = 1_000_000


def measure(name: str, law: str, out: Path, seeds: int, members: int) -> list[tuple[str, str]]:
    """Return title and value of each cell of a drive."""
    drive = pn.Circuit.load(EXAMPLES / f"{AXES[name]}.toml")
    low = 460.0 * pn.control.tune(drive).plant.stroke_m
    told = pn.control.reference(REST.format(low, low + 60.0))
    known = pn.control.compare(
        drive, [law], ["R1", "R2", "R3", "R7", told], out=out / name / "known", seeds=seeds, threads=1
    )
    differs = pn.control.compare(
        drive, [law], ["R1", "R2"], out=out / name / "all", seeds=seeds, mismatch="all", threads=1
    )
    spread = pn.control.compare(
        drive, [law], ["R1", "R2", "R3"], out=out / name / "spread", spread="standard", members=members, threads=1
    )

    def median(found: pn.control.ControlComparison, along: str, measure: str, factor: float = 1e3) -> str:
        value = found.middle(law, along, measure)
        return "-" if value is None else f"{factor * value:.3g}"

    def ends(along: str, measure: str, share: float, factor: float = 1e3) -> str:
        value = spread.within(law, along, measure, share)
        return "-" if value is None else f"{factor * value:.3g}"

    first = max(float(differs.middle(law, along, "first_max_error_m") or np.nan) for along in ("R1", "R2"))
    lost = sum(run.score is None or run.score.lost for run in spread.runs)
    rest = told.text
    hunting = [run.score.hunting_m for run in known.of(law, rest) if run.score is not None]
    slips = [run.score.slips for run in known.of(law, rest) if run.score is not None]
    return [
        ("known: R1 / R2 max mm", f"{median(known, 'R1', 'max_error_m')} / {median(known, 'R2', 'max_error_m')}"),
        (
            "`all`: R1 / R2 last 4 s; first 4 s, mm",
            f"{median(differs, 'R1', 'max_error_m')} / {median(differs, 'R2', 'max_error_m')}; {1e3 * first:.3g}",
        ),
        (
            "spread: R1 / R2 95 %; worst, mm; lost",
            f"{ends('R1', 'max_error_m', 0.95)} / {ends('R2', 'max_error_m', 0.95)}; "
            f"{max(float(ends(along, 'max_error_m', 1.0)) for along in ('R1', 'R2')):.3g}; {lost}",
        ),
        (
            "R3: known max mm; settling to 0.1 mm, spread 95 %, ms",
            f"{median(known, 'R3', 'max_error_m')}; {ends('R3', 'settling_100_um_s', 0.95)}",
        ),
        (
            "rest um: R3 known, spread 95 %; 60 s: hunting um, slips",
            f"{median(known, 'R3', 'rest_error_m', 1e6)}, {ends('R3', 'rest_error_m', 0.95, 1e6)}; "
            f"{1e6 * float(np.median(hunting)):.3g}, {int(np.median(slips))}",
        ),
        ("R7 repeatability R um", median(known, "R7", "iso_repeatability_m", 1e6)),
    ]


def worst_step(law: str, steps: int) -> None:
    """Print the worst step of a law, of the least of three repeats of each."""
    drive = pn.Circuit.load(EXAMPLES / "controlled_axis.toml")
    prepared = prepare(drive, law, "sine 60 mm 1 Hz around 250 mm", duration=1e-3 * steps, mismatch="all")
    score = run_prepared(prepared._replace(step_repeats=3), 1).provenance["score"]
    for key in ("step_median_s", "step_999_s", "step_worst_s", "step_undisturbed_s"):
        print(f"{key}: {1e6 * score[key]:.4g} us of {steps} steps")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--law", default="nmpc")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--members", type=int, default=200)
    parser.add_argument("--axes", default=",".join(AXES))
    parser.add_argument("--steps", type=int, default=0, help="of the law's worst step; 0: not measured")
    asked = parser.parse_args()
    for name in filter(None, asked.axes.split(",")):
        for title, value in measure(name, asked.law, asked.out, asked.seeds, asked.members):
            print(f"{name} | {title} | {value}", flush=True)
    if asked.steps:
        worst_step(asked.law, asked.steps)


if __name__ == "__main__":
    main()
