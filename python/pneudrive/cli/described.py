"""Commands of drives and circuits in options."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


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
