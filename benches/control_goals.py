"""Goals of control: largest errors, rest errors and spreads of each axis, measured.

    python -m benches.control_goals --out FOLDER [--members 200] [--seeds 5] [--axes P1,P2,P3,P3h,P4,P5] [--setup real]
    python -m benches.control_goals --out FOLDER --axes "" --laws        each law beside what a first study reached

Runs are kept in FOLDER, so that an interrupted call continues. All results are simulated.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import pneudrive as pn
from pneudrive.control.loop import prepare, run_prepared

AXES = {
    "P1": "controlled_axis",
    "P2": "axes/bench",
    "P3": "axes/starter",
    "P3h": "axes/starter_heavy",
    "P4": "axes/upright",
    "P5": "axes/tubes",
}
EXAMPLES = Path(__file__).parents[1] / "examples"
#: 60 mm and 60 s of rest.
REST = "{0:g} mm; 1 s: {1:g} mm in 0.3 s; 61.3 s: {1:g} mm in 0.1 s"
STEPS = 1_000_000


Found = pn.control.ControlComparison
#: `nmpc` that learns nothing.
DESCRIBED = "nmpc-as-described"
#: Axis, study and reference of a cell of `ROWS`; with "rest" the error at rest, um, else the largest error, mm.
CELLS = (
    *(("P1", "known", along) for along in ("R1", "R2", "R3", "R3 rest")),
    *(("P1", "all", along) for along in ("R1", "R2")),
    *(("P1", "spread", along) for along in ("R1", "R2", "R3 rest")),
    *(("P2", "spread", along) for along in ("R1", "R2")),
)
#: What a first study of these laws reached, simulated, with a few seeds and 22 members of the spread.
ROWS = {
    "pid": (11.7, 13.8, 24, 8300),
    "sliding-mode": (0.15, 0.23, 0.48, 140, 3.0, 3.5, 2.3, 2.4, 590, 1.2, 2.1),
    "super-twisting": (0.14, 0.15, 0.63, 21, 1.3, 2.0, 1.2, 1.2, 350, 0.58, 0.72),
    "inversion": (0.25, 0.32, 0.76, 69, 0.21, 0.26, 0.94, 0.42, 850, 0.30, 0.32),
    DESCRIBED: (0.07, 0.11, 0.51, 18, 0.56, 0.79, 0.62, 0.74, 50, 0.42, 0.57),
    "nmpc": (0.10, 0.13, 0.65, 17, 0.08, 0.18, 0.49, 0.35, 29, 0.27, 0.26),
}


class Studies:
    """Comparisons of laws on the axes, kept in a folder: `known`, mismatch `all`, and `spread`."""

    def __init__(self, asked: argparse.Namespace) -> None:
        self.out, self.setup = asked.out, asked.setup
        self.of = {
            "known": {"seeds": asked.seeds},
            "all": {"seeds": asked.seeds, "mismatch": "all"},
            "spread": {"spread": "standard", "members": asked.members},
        }
        self.threads = asked.threads

    def run(self, name: str, study: str, laws: list[str | Path], along: list[str | pn.control.Reference]) -> Found:
        """Return a comparison on an axis."""
        out = self.out / (name if self.setup == "real" else f"{name}-{self.setup}") / study
        drive = pn.Circuit.load(EXAMPLES / f"{AXES[name]}.toml")
        of = {"out": out, "setup": self.setup, "threads": self.threads, "keep_runs": False} | self.of[study]
        return pn.control.benchmark(drive, laws, along, **of)


def beside_rows(studies: Studies) -> Iterator[tuple[str, ...]]:
    """Yield controller, cell, measure, result of the first study, and their ratio."""
    described = studies.out / f"{DESCRIBED}.toml"
    studies.out.mkdir(parents=True, exist_ok=True)
    described.write_text('schema = 1\nlaw = "nmpc"\nadaptation = false\n', encoding="utf-8")
    laws = [*pn.control.laws(), described]
    along: dict[tuple[str, str], list[str]] = {}
    for name, study, cell in CELLS:
        along.setdefault((name, study), []).append(cell.removesuffix(" rest"))
    found = {key: studies.run(*key, laws, list(dict.fromkeys(each))) for key, each in along.items()}

    def value(law: str, name: str, study: str, along: str) -> float:
        measure, factor = ("rest_error_m", 1e6) if along.endswith("rest") else ("max_error_m", 1e3)
        share = 0.95 if study == "spread" else 0.5
        own = found[name, study].within(law, along.removesuffix(" rest"), measure, share)
        return float("nan") if own is None else factor * own

    for law in [*pn.control.laws(), DESCRIBED]:
        for i, cell in enumerate(CELLS):
            ours = value(law, *cell)
            row = value("pid", *cell) if law == "fuzzy" else (*ROWS[law], *[None] * len(CELLS))[i]
            yield (
                law,
                " ".join(cell),
                f"{ours:.3g}",
                *(("-", "-") if row is None else (f"{row:.3g}", f"{ours / row:.2f}")),
            )


def measure(name: str, law: str, studies: Studies) -> list[tuple[str, str]]:
    """Return title and value of each cell of a drive."""
    drive = pn.Circuit.load(EXAMPLES / f"{AXES[name]}.toml")
    low = 460.0 * pn.control.tune(drive).plant.stroke_m
    told = pn.control.reference(REST.format(low, low + 60.0))
    known = studies.run(name, "known", [law], ["R1", "R2", "R3", "R7", "R8", told])
    differs = studies.run(name, "all", [law], ["R1", "R2"])
    spread = studies.run(name, "spread", [law], ["R1", "R2", "R3"])

    def median(found: Found, along: str, measure: str, factor: float = 1e3) -> str:
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
        ("R8 max, RMSE mm", f"{median(known, 'R8', 'max_error_m')}, {median(known, 'R8', 'rmse_m')}"),
    ]


def worst_step(law: str, steps: int) -> None:
    """Print the time of a controller's steps.

    Each is the least of three equal runs, because disturbances come in bursts.

    The first run, whose code has to be fetched, is listed separately.
    """
    drive = pn.Circuit.load(EXAMPLES / "controlled_axis.toml")
    prepared = prepare(drive, law, "sine 60 mm 1 Hz around 250 mm", duration=1e-3 * steps, mismatch="all")
    took = np.minimum.reduce([run_prepared(prepared, 1).columns["step_time_s"] for _ in range(3)])
    print(f"first step: {1e6 * took[0]:.4g} us")
    for name, share in {"median": 0.5, "99.9 %": 0.999, "worst": 1.0}.items():
        print(f"{name} of the {steps - 1} behind it: {1e6 * np.quantile(took[1:], share):.4g} us")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--law", default="nmpc")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--members", type=int, default=200)
    parser.add_argument("--axes", default=",".join(AXES))
    parser.add_argument("--setup", default="real")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--laws", action="store_true", help="each law beside its row")
    parser.add_argument("--steps", type=int, default=0, help="of the law's worst step; 0: not measured")
    asked = parser.parse_args()
    studies = Studies(asked)
    for name in filter(None, asked.axes.split(",")):
        for title, value in measure(name, asked.law, studies):
            print(f"{name} | {title} | {value}", flush=True)
    if asked.laws:
        for cells in beside_rows(studies):
            print(" | ".join(cells), flush=True)
    if asked.steps:
        worst_step(asked.law, asked.steps)


if __name__ == "__main__":
    main()
