"""Start of a simulation: sessions of drives and circuits, and their start states."""

from __future__ import annotations

from typing import TypeAlias

from pneudrive.describe import Circuit, Drive
from pneudrive.describe.tables.starts import StartState as StartState
from pneudrive.errors import CommandError
from pneudrive.simulation.session import Session

#: Object that a simulation accepts.
DriveOrCircuit: TypeAlias = "Drive | Circuit"
RTOL_BOUNDS = (1e-13, 1e-1)


def start(described: DriveOrCircuit, initial: StartState = None, rtol: float = 1e-6) -> Session:
    """Start a session of a drive or a circuit; see `Drive.start` and `Circuit.start`."""
    check_tolerance(rtol)
    return Session(described.system.compiled().start(described.core_initial(initial), rtol))


def check_tolerance(rtol: float) -> None:
    """Reject a relative tolerance that no simulation can achieve."""
    low, high = RTOL_BOUNDS
    if isinstance(rtol, (bool, str)) or not low <= rtol <= high:
        raise CommandError(f"rtol = {rtol} is out of bounds", rule=f"{low:g} <= rtol <= {high:g}")
