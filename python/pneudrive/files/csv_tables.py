"""CSV files written by pneudrive: names in the first line, commas, decimal points. Foreign CSV needs a layout."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from pneudrive.files.content import check_file, unreadable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import polars as pl

    from pneudrive.errors import ErrorKind


LONGEST_HEADER = 1_000_000  # bytes of the first line: 50,000 names


def spreadsheet_text(text: str) -> str:
    """Return a text for a cell of a CSV file. A leading ' prevents spreadsheets from running texts like "=A1".

    Examples
    --------
    >>> spreadsheet_text("=HYPERLINK(1)"), spreadsheet_text("-1.5"), spreadsheet_text("-1+A1")
    ("'=HYPERLINK(1)", '-1.5', "'-1+A1")
    """
    if not text.startswith(("=", "+", "-", "@", "\t", "\r")):
        return text
    with suppress(ValueError):
        float(text)
        return text
    return f"'{text}"


def csv_names(path: Path, kind: ErrorKind) -> list[str]:
    """Return the fields of a file's first line, which are arbitrary for a binary file.

    Raises
    ------
    PneudriveError
        The file does not exist or is too large.
    """
    check_file(path, kind)
    try:
        with path.open("rb") as file:
            line = file.readline(LONGEST_HEADER)
    except OSError as error:
        raise unreadable(path, error, kind) from None
    return [name.strip().strip('"') for name in line.decode("utf-8-sig", errors="replace").split(",")]


def read_csv(
    path: Path, types: Mapping[str, type[pl.DataType]], kind: ErrorKind, wanted: Sequence[str] | None = None
) -> pl.DataFrame:
    """Read columns of a CSV file.

    Parameters
    ----------
    path : Path
    types : mapping
        Types of columns; others are guessed.
    kind : type of PneudriveError
    wanted : sequence of str, optional
        None: all columns.

    Raises
    ------
    PneudriveError
        The file or a column does not exist, or fields are not of the column's type.
    """
    import polars as pl

    check_file(path, kind)
    columns = None if wanted is None else list(wanted)
    try:
        return pl.read_csv(path, columns=columns, schema_overrides=dict(types))
    except (OSError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise kind("the file cannot be read as CSV", where=str(path), value=reason) from None
