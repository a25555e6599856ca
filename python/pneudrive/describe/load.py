"""Reading of drives and circuits, distinguished by the content of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.describe import toml

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


def load_described(source: str) -> Drive | Circuit:
    """Read a drive file, a circuit file or ``catalogue:NAME``; a file with components or connections is a circuit.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    if toml.has(source, "components") or toml.has(source, "connections"):
        from pneudrive.describe.circuit import Circuit

        return Circuit.load(source)
    from pneudrive.describe.drive import Drive

    return Drive.load(source)
