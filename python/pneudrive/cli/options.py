"""Options shared by several commands, and reading of quantities in options."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from pneudrive.errors import CommandError, DescriptionError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

Value = TypeVar("Value")


def _open_catalogue(context: typer.Context, paths: list[Path] | None) -> list[Path] | None:
    """Add the folders to the catalogue while the command runs."""
    if paths:
        from pneudrive.describe.files.catalogue import catalogue_folders

        context.with_resource(catalogue_folders(*paths))
    return paths


#: Folders of the user's parts and drives; a command that reads descriptions needs only this option.
CatalogueFolders = Annotated[
    list[Path] | None,
    typer.Option(
        "--catalogue",
        help="Folder of your own parts and drives; repeatable.",
        metavar="DIR",
        callback=_open_catalogue,
    ),
]


#: Argument of commands for drives and circuits.
Described = Annotated[
    str, typer.Argument(help="Drive or circuit file (TOML), or catalogue:NAME.", metavar="DRIVE|CIRCUIT")
]
Protocol = Annotated[str, typer.Argument(help="Protocol file (TOML), or a ready one by name.", metavar="PROTOCOL")]
BenchRig = Annotated[str, typer.Option("--rig", help="Rig file, ready rig, or address.", metavar="RIG")]
Layout = Annotated[
    Path | None, typer.Option("--layout", help="Layout of foreign files; default: layout.toml in their folder.")
]
Plot = Annotated[Path | None, typer.Option("--plot", help="Picture: .png, .svg or .pdf.")]
FitFile = Annotated[
    Path,
    typer.Argument(help="Fit: a file of `pneudrive identify --out`, `fit` or `characterise`.", metavar="FIT.toml"),
]
Steps = Annotated[
    list[str] | None,
    typer.Option(
        "--command",
        help='Valve command, -1 to 1: 0.5, "0 s: 0.6, 1 s: -0.6", or a CSV file. In a circuit: "VALVE: 0 s: 1".',
        metavar="STEPS",
    ),
]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help='Value, "friction.coulomb = 31 N"; repeatable.', metavar="KEY=VALUE"),
]
Rtol = Annotated[float, typer.Option("--rtol", help="Relative tolerance of the solver.")]
Results = Annotated[Path, typer.Option("--out", help="Folder for the results.")]
Profile = Annotated[bool, typer.Option(help="Also compute intervals by profile likelihood.")]
Page = Annotated[Path | None, typer.Option("--report", help="Folder for a report with residuals.", metavar="FOLDER")]
Samples = Annotated[
    str,
    typer.Option("--protocol", help="Selection of samples: settled, or source-paper (first 5 % dropped)."),
]


def one_of(option: str, word: str, known: Mapping[str, Value]) -> Value:
    """Return the meaning of a word in an option.

    Raises
    ------
    CommandError
        The word is unknown.
    """
    if word not in known:
        raise CommandError(f"{option} {word} is not known", remedy=nearest(word, known))
    return known[word]


def check_used(context: typer.Context, to: str, used: Mapping[str, tuple[Sequence[str], str]]) -> None:
    """Refuse an option that the target of an export does not use.

    Parameters
    ----------
    context : typer.Context
    to : str
        Target of the export.
    used : mapping
        Parameter of the command -> targets that use it, and what to do for another one.

    Raises
    ------
    CommandError
        An option has no effect.
    """
    for name, (targets, remedy) in used.items():
        source = context.get_parameter_source(name)
        if to not in targets and source is not None and source.name == "COMMANDLINE":
            flag = f"--{name.replace('_', '-')}"
            rule = f"{flag} is for --to {', '.join(targets)}"
            raise CommandError(f"{flag} has no effect with --to {to}", rule=rule, remedy=remedy)


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
    from pneudrive.units import parse

    with option(name):
        return parse(text, si_unit)


@contextmanager
def option(name: str) -> Iterator[None]:
    """Add the name of an option to errors in the text of the option.

    Raises
    ------
    CommandError
        Replaces the DescriptionError of the text.
    """
    try:
        yield
    except DescriptionError as error:
        raise CommandError(f"{name}: {error.what}", rule=error.rule, remedy=error.remedy) from None


def pair_in(option: str, text: str, example: str) -> tuple[str, str]:
    """Return key and value of ``key = value``.

    Raises
    ------
    CommandError
        The text is not of this form.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise CommandError(f'{option} "{text}" is not key = value', remedy=f'For instance "{example}".')
    return key, value


def sensor_option(text: str) -> tuple[str, dict[str, str]]:
    """Read ``position: noise = 2 um, offset = free``."""
    channel, colon, rest = text.partition(":")
    entries = dict(pair_in("--sensor", entry, "noise = 2 um") for entry in names_in(rest))
    if not colon or not entries:
        raise CommandError(f'--sensor "{text}" has no key = value', remedy='For instance "position: noise = 2 um".')
    return channel.strip(), entries
