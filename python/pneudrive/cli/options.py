"""Options that several commands share, and options that are read as quantities."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from pneudrive.errors import CommandError, DescriptionError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Value = TypeVar("Value")


def _open_catalogue(context: typer.Context, paths: list[Path] | None) -> list[Path] | None:
    """Take the folders as long as the command runs."""
    if paths:
        from pneudrive.describe.catalogue import catalogue_folders

        context.with_resource(catalogue_folders(*paths))
    return paths


#: Folders of the user's own parts and drives; a command that reads descriptions has this option and needs no more.
CatalogueFolders = Annotated[
    list[Path] | None,
    typer.Option(
        "--catalogue",
        help="Folder of your own parts and drives, beside the catalogue; may be given several times.",
        metavar="DIR",
        callback=_open_catalogue,
    ),
]


#: What a command reads that takes drives and circuits alike.
Described = Annotated[
    str, typer.Argument(help="Drive or circuit file (TOML), or catalogue:NAME.", metavar="DRIVE|CIRCUIT")
]
Protocol = Annotated[str, typer.Argument(help="Protocol file (TOML), or a ready one by name.", metavar="PROTOCOL")]
BenchRig = Annotated[str, typer.Option("--rig", help="Rig file, ready rig, or address.", metavar="RIG")]
Layout = Annotated[
    Path | None, typer.Option("--layout", help="How foreign files are read; default: layout.toml beside them.")
]
Results = Annotated[Path, typer.Option("--out", help="Folder for the results.")]
Samples = Annotated[
    str,
    typer.Option("--protocol", help="Which samples count: settled, or source-paper (first 5 % dropped)."),
]


def one_of(option: str, word: str, known: Mapping[str, Value]) -> Value:
    """Return what a word of an option means.

    Raises
    ------
    CommandError
        It means nothing.
    """
    if word not in known:
        raise CommandError(f"{option} {word} is not known", remedy=nearest(word, known))
    return known[word]


def names_in(text: str) -> list[str]:
    """Return the names in a list with commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def quantity(name: str, text: str, si_unit: str) -> float:
    """Return the quantity of an option in SI.

    Raises
    ------
    CommandError
        It cannot be read.
    """
    from pneudrive.units import parse

    with option(name):
        return parse(text, si_unit)


@contextmanager
def option(name: str) -> Iterator[None]:
    """Name the option whose text cannot be read.

    Raises
    ------
    CommandError
        Instead of the DescriptionError of the text.
    """
    try:
        yield
    except DescriptionError as error:
        raise CommandError(f"{name}: {error.what}", rule=error.rule, remedy=error.remedy) from None


def sensor_option(text: str) -> tuple[str, dict[str, str]]:
    """Read ``position: noise = 2 um, offset = free``."""
    channel, colon, rest = text.partition(":")
    entries: dict[str, str] = {}
    for entry in filter(None, map(str.strip, rest.split(","))):
        key, equals, value = (part.strip() for part in entry.partition("="))
        if not equals or not value:
            raise CommandError(f'"{entry}" in --sensor is not key = value', remedy='For instance "noise = 2 um".')
        entries[key] = value
    if not colon or not entries:
        raise CommandError(f'--sensor "{text}" has no key = value', remedy='For instance "position: noise = 2 um".')
    return channel.strip(), entries
