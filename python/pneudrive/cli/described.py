"""Reading of drives and circuits, distinguished by the content of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


def load(source: str) -> Drive | Circuit:
    """Read a drive file, a circuit file or ``catalogue:NAME``; a file with components or connections is a circuit.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    from pneudrive.describe import toml
    from pneudrive.describe.drive import Drive

    if toml.has(source, "components") or toml.has(source, "connections"):
        from pneudrive.describe.circuit import Circuit

        return Circuit.load(source)
    return Drive.load(source)


def circuit_of(described: Drive | Circuit) -> Circuit:
    """Return the circuit of a drive; a circuit unchanged."""
    from pneudrive.start import is_circuit

    return described if is_circuit(described) else described.circuit
