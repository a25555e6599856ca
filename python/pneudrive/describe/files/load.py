"""Reading of drives and circuits, distinguished by the content of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.describe.files import toml

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

#: Tables that make a file a circuit.
OF_A_CIRCUIT = ("components", "connections")


def load_described(source: str) -> Drive | Circuit:
    """Read a drive file, a circuit file or ``catalogue:NAME``; a file with components or connections is a circuit.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    if any(toml.has(source, key) for key in OF_A_CIRCUIT):
        from pneudrive.describe.circuit import Circuit

        return Circuit.load(source)
    from pneudrive.describe.drive import Drive

    return Drive.load(source)


def described_in(text: str, path: Path, allow: Callable[[dict[str, Any]], object] = lambda _: None) -> Drive | Circuit:
    """Read the text of a drive file or a circuit file that need not be saved.

    Parameters
    ----------
    text : str
    path : Path
        Name of the file in messages. Custom friction laws are relative to its folder.
    allow : callable
        Gets the tables before anything that they name is read, and may refuse them.

    Raises
    ------
    DescriptionError
        The description is not valid.
    """
    tables = toml.parse(text, str(path))
    allow(tables)
    if any(key in tables for key in OF_A_CIRCUIT):
        from pneudrive.describe.circuit import Circuit

        return Circuit.from_tables(tables, text, path)
    from pneudrive.describe.drive import Drive

    return Drive.from_tables(tables, text, path)
