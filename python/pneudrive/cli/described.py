"""Commands of drives and circuits in options."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.cli.options import pair_in
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


def command_of(described: Drive | Circuit, given: list[str] | None) -> str | list[str] | None:
    """Return the commands of a circuit, or the only command of a drive.

    Raises
    ------
    CommandError
        A drive has none, or more than one.
    """
    if "" not in described.commandable:
        return given
    if not given:
        raise CommandError("the command of the valve is missing", remedy='Add --command "0 s: 1", for instance.')
    if len(given) > 1:
        raise CommandError(f"a drive has one valve, but {len(given)} commands are given", remedy="Keep one of them.")
    return given[0]


def changed(drive: str, given: list[str] | None) -> Drive | Circuit:
    """Load a drive or a circuit, with changed values as `changes_of` reads them.

    Raises
    ------
    CommandError, DescriptionError
        The file, or a change, is not valid.
    """
    from pneudrive.describe.files.load import load_described

    described = load_described(drive)
    return described.replace(changes_of(given)) if given else described


def changes_of(given: list[str]) -> dict[str, str | float]:
    """Return changed values of a description from texts ``key = value``; a number without a unit is a pure number.

    Raises
    ------
    CommandError
        A text is not of this form, or a key is repeated.

    Examples
    --------
    >>> changes_of(["friction.coulomb = 31 N", "valve.critical_pressure_ratio = 0.3"])
    {'friction.coulomb': '31 N', 'valve.critical_pressure_ratio': 0.3}
    """
    out: dict[str, str | float] = {}
    for text in given:
        key, value = pair_in("--set", text, "friction.coulomb = 31 N")
        if key in out:
            raise CommandError(f"--set gives {key} twice", remedy="Keep one of them.")
        try:
            out[key] = float(value)
        except ValueError:
            out[key] = value
    return out
