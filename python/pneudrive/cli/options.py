"""Options that several commands share, and reading of texts in options.

Options
-------
drive : DRIVE|CIRCUIT
    Drive or circuit file (TOML), or catalogue:NAME.
fit : FIT.toml
    Fit: a file of `pneudrive identify --out`, `fit` or `characterise`.
catalogue : DIR
    Folder of your own parts and drives; repeatable.
layout
    Layout of foreign files; default: layout.toml in their folder.
plot
    Picture: .png, .svg or .pdf.
command : STEPS
    Valve command, -1 to 1: 0.5, "0 s: 0.6, 1 s: -0.6", or a CSV file. In a circuit: "VALVE: 0 s: 1".
set : KEY=VALUE
    Changed value, "friction.coulomb = 31 N"; repeatable.
rtol
    Relative tolerance of the solver.
out
    Folder for the results.
report : FOLDER
    Folder for a report with residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, TypeVar

import typer

import pneudrive as pn
from pneudrive.errors import CommandError, naming, nearest
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive import units
    from pneudrive.describe.files import load


Value = TypeVar("Value")
Count = Annotated[int, typer.Option(min=0)]
Port = Annotated[int, typer.Option(min=0, max=65535)]


def command_of(described: pn.Drive | pn.Circuit, commands: list[str] | None) -> str | list[str] | None:
    """Return the commands of a circuit, or the only command of a drive.

    Raises
    ------
    CommandError
        A drive has no command, or more than one.
    """
    if "" not in described.commandable:
        return commands
    if not commands:
        raise CommandError("the command of the valve is missing", remedy='Add --command "0 s: 1", for instance.')
    if len(commands) > 1:
        raise CommandError(f"a drive has one valve, but {len(commands)} commands are given", remedy="Keep one of them.")
    return commands[0]


def changed(drive: str, changes: list[str] | None) -> pn.Drive | pn.Circuit:
    """Load a drive or a circuit, with changed values from texts ``key = value``.

    Raises
    ------
    CommandError, DescriptionError
        The file, or a change, is not valid.
    """
    described = load.load_described(drive)
    texts = pairs_in("--set", changes or (), "friction.coulomb = 31 N")
    return described.replace({key: number_or_text(text) for key, text in texts.items()}) if texts else described


def number_or_text(text: str) -> float | str:
    """Convert a text without a unit to a number. Return any other text unchanged."""
    try:
        return float(text)
    except ValueError:
        return text


def one_of(option: str, word: str, known: Mapping[str, Value]) -> Value:
    """Return the value that belongs to a word of an option.

    Raises
    ------
    CommandError
        The word is unknown.
    """
    if word not in known:
        raise CommandError(f"{option} {word} is not known", remedy=nearest(word, known))
    return known[word]


def check_used(context: typer.Context, to: str, used: Mapping[str, tuple[Sequence[str], str]]) -> None:
    """Reject an option that the target of an export does not use.

    Parameters
    ----------
    context : typer.Context
    to : str
        Target of the export.
    used : mapping
        Parameter of the command -> targets that use it, and a remedy for other targets.

    Raises
    ------
    CommandError
        An option has no effect.
    """
    for name, (targets, remedy) in used.items():
        source = context.get_parameter_source(name)
        if to not in targets and source is not None and source.name == "COMMANDLINE":
            flag = f"--{name.replace('_', '-')}"
            raise CommandError.of("cli.no-effect", flag=flag, to=to, targets=", ".join(targets), remedy=remedy)


def names_in(text: str) -> list[str]:
    """Return the names of a list separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def quantity(name: str, text: str, si_unit: str) -> float:
    """Return the quantity of an option in SI.

    Raises
    ------
    CommandError
        The text is not a quantity of this kind.
    """
    with naming(name):
        return units.parse(text, si_unit)


def pairs_in(option: str, texts: Iterable[str], example: str) -> dict[str, str]:
    """Return key and value of each ``key = value``.

    Raises
    ------
    CommandError
        A text is not of this form, or a key is repeated.

    Examples
    --------
    >>> pairs_in("--set", ["friction.coulomb = 31 N"], "load.mass = 1 kg")
    {'friction.coulomb': '31 N'}
    """
    pairs: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise CommandError(f'{option} "{text}" is not key = value', remedy=f'For instance "{example}".')
        if key in pairs:
            raise CommandError(f"{option} gives {key} twice", remedy="Keep one of them.")
        pairs[key] = value
    return pairs


def sensor_options(texts: Iterable[str] | None) -> dict[str, dict[str, str]]:
    """Read texts such as ``position: noise = 2 um, offset = free``."""
    sensors = {}
    for text in texts or ():
        channel, colon, rest = text.partition(":")
        entries = pairs_in("--sensor", names_in(rest), "noise = 2 um")
        if not colon or not entries:
            raise CommandError(f'--sensor "{text}" lacks key = value', remedy='For instance "position: noise = 2 um".')
        sensors[channel.strip()] = entries
    return sensors
