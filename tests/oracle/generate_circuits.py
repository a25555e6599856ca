"""Write the golden runs of circuits: ``python tests/oracle/generate_circuits.py [NAME ...]``.

Every case is integrated with Radau at 1e-10, and again with DOP853 at 1e-11; their greatest differences are stored.
Two minutes for all of them. `tests/unit/test_circuit_oracle.py` says when the files are older than the model.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import scipy

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from oracle.circuit_cases import CASES, Case  # noqa: E402

GOLDEN = HERE.parent / "golden" / "circuits"
MODEL = ("network.py", "circuit_cases.py")
METHODS = (("Radau", 1e-10), ("DOP853", 1e-11))


def model_hash() -> str:
    """Return the SHA-256 of the model and its cases."""
    return hashlib.sha256(b"".join((HERE / name).read_bytes() for name in MODEL)).hexdigest()


def columns(case: Case, method: str, rtol: float) -> dict[str, np.ndarray]:
    """Return a case's columns by name."""
    with np.errstate(all="ignore"):  # an explicit method tries steps far outside the physics
        run = case.model.run(case.gas, case.positions, case.steps, case.times, method, rtol)
    return {name: np.array([of(at) for at in run]) for name, of in case.columns.items()}


def generate(name: str) -> str:
    """Write one case; return a line about it."""
    case = CASES[name]()
    own, other = (columns(case, *method) for method in METHODS)
    apart = {key: float(np.abs(other[key] - one).max() / np.ptp(one)) for key, one in own.items()}
    made = {
        "made_by": "tests/oracle/generate_circuits.py",
        "model_sha256": model_hash(),
        "method": "SciPy {}, {} at rtol {:g}".format(scipy.__version__, *METHODS[0]),
        "greatest_difference_of_range": {"method": "{} at rtol {:g}".format(*METHODS[1]), **apart},
    }
    GOLDEN.mkdir(exist_ok=True)
    np.savez_compressed(GOLDEN / f"{name}.npz", made=np.array(json.dumps(made)), **own)
    worst = max(apart, key=apart.__getitem__)
    return f"{name}: {METHODS[1][0]} differs most in {worst}, by {apart[worst]:.1g} of its range"


def main() -> None:
    """Command line."""
    unknown = sorted(set(sys.argv[1:]) - set(CASES))
    if unknown:
        raise SystemExit(f"unknown case {unknown[0]!r}; choose from {', '.join(CASES)}")
    for name in sys.argv[1:] or CASES:
        sys.stdout.write(generate(name) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
