"""Columns of numbers of a foreign file, before any layout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.tables.formats import read_all
from pneudrive.signals.tables.sniff import FileForm, sniff_format, sniff_text
from pneudrive.signals.tables.text_table import TextForm, read_bytes, read_text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def read_raw_table(path: Path) -> tuple[FileForm, list[NDArray[np.float64]]]:
    """Return the form of a file and its columns of numbers; columns of texts are empty.

    Raises
    ------
    RecordingError
        The file does not exist, is empty or of an unknown format, or has no table of numbers.
    """
    form = sniff_format(path)
    if form == "csv":
        reading = sniff_text(path)
        wanted: list[int | str] = [at for at in range(reading.columns) if at not in reading.words]
        found = iter(read_text(path, read_bytes(path), reading.form, wanted, {**reading.dates}).columns)
        columns = {at: next(found) for at in wanted}
        none = np.full_like(columns[wanted[0]], np.nan)
        return reading, [columns.get(at, none) for at in range(reading.columns)]
    names, columns, dates, units, others = read_all(form, path)
    return FileForm(form, TextForm(), names, units, len(names), dates, other_lengths=others), columns
