"""Write the golden trajectories: ``python tests/oracle/generate.py [NAME ...] [--check]``.

Each `tests/golden/NAME.json` is a case, written by hand but for its provenance. It is integrated with Radau at 1e-11.
``--check`` integrates it again with DOP853 at 1e-12 and stores the greatest differences in the case's provenance.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import scipy

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from oracle.cases import CASES, GOLDEN  # noqa: E402
from oracle.integrate import COLUMNS, run  # noqa: E402

# Bits of the mantissa that are kept: 2^-37 = 7e-12 relative, below the integrations' own error
# against each other, and the file compresses to two thirds.
KEPT_BITS = 36
# DOP853 checks Radau; for exact sticking it is the other way round: DOP853's interpolant, on which the switches
# are located, is of order 7, Radau's of order 3.
SMOOTH, SWITCHED = (("Radau", 1e-11), ("DOP853", 1e-12)), (("DOP853", 1e-12), ("Radau", 1e-11))
METHODS = {"lugre": SMOOTH, "elasto-plastic": SMOOTH, "stribeck": SWITCHED}


def trimmed(values: np.ndarray) -> np.ndarray:
    """Round float64 to `KEPT_BITS` bits of mantissa, so that the file compresses."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.round(mantissa * 2.0**KEPT_BITS) / 2.0**KEPT_BITS, exponent)


def generate(name: str, check: bool) -> str:
    """Write one case; return a line about it."""
    case = CASES[name]
    (method, tol), (other_method, other_tol) = METHODS[case["drive"]["friction"]["law"]]
    started = time.perf_counter()
    times, states, statistics = run(case, method, tol)
    case["provenance"] = {
        "made_by": "tests/oracle/generate.py",
        "method": f"SciPy {scipy.__version__} {method}, rtol {tol:g}",
        **statistics,
    }
    line = f"{name}: {len(times)} samples, {statistics}, {time.perf_counter() - started:.0f} s"
    if check:
        _, others, _ = run(case, other_method, other_tol)
        position_um = 1e6 * np.abs(others[:, 0] - states[:, 0]).max()
        pressure = np.abs(others[:, [2, 4]] / states[:, [2, 4]] - 1.0).max()
        case["provenance"]["cross_check"] = {
            "method": f"{other_method}, rtol {other_tol:g}",
            "greatest_position_difference_um": float(f"{position_um:.2g}"),
            "greatest_relative_pressure_difference": float(f"{pressure:.2g}"),
        }
        line += f"; {other_method} differs by {position_um:.2g} um, {pressure:.2g}"
    np.savez_compressed(GOLDEN / f"{name}.npz", **{c: trimmed(states[:, i]) for i, c in enumerate(COLUMNS)})
    (GOLDEN / f"{name}.json").write_text(json.dumps(case, indent=1) + "\n")
    return line


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"cases, all by default: {', '.join(CASES)}")
    parser.add_argument("--check", action="store_true", help="integrate again with an unrelated method")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(CASES))
    if unknown:
        parser.error(f"unknown case {unknown[0]!r}; choose from {', '.join(CASES)}")
    for name in arguments.names or CASES:
        sys.stdout.write(generate(name, arguments.check) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
