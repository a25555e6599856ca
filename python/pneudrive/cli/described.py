"""Reading of drives and circuits, distinguished by the content of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.errors import CommandError

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


def command_of(described: Drive | Circuit, given: list[str] | None) -> str | list[str] | None:
    """Return the commands of a circuit, or the only one of a drive.

    Raises
    ------
    CommandError
        A drive has none, or more than one.
    """
    from pneudrive.start import is_circuit

    if is_circuit(described):
        return given
    if not given:
        raise CommandError("the command of the valve is missing", remedy='Add --command "0 s: 1", for instance.')
    if len(given) > 1:
        raise CommandError(f"a drive has one valve, but {len(given)} commands are given", remedy="Keep one of them.")
    return given[0]
