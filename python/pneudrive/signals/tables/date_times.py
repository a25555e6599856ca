"""Columns that hold dates and times instead of seconds: read to the nanosecond, from the first one on."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

UNIT = "date-time"  # what a layout gives as the unit of such a column
ISO = ""  # form of dates that are written as ISO 8601 says; the time of day may stand alone
_DATE = r"\d{4}-\d\d?-\d\d?|\d\d?\.\d\d?\.\d{4}|\d\d?/\d\d?/\d{4}|\d{4}/\d\d?/\d\d?"
_CLOCK = r"\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?(?:\s?[AaPp][Mm])?(?:\s?Z|\s?[+-]\d\d:?\d\d)?"
_LOOKS = re.compile(rf"\s*(?:(?:{_DATE})(?:[T\s]\s*(?:{_CLOCK}))?|{_CLOCK})\s*")
# date, hour and minute, second, zone; each may be left out, and what is left counts from midnight UTC
_ISO_PARTS = r"^(?:(\d{4}-\d\d?-\d\d?)(?:[T\s]\s*|$))?(?:(\d\d?:\d\d)(?::(\d\d(?:\.\d+)?))?\s*(Z|[+-]\d\d:?\d\d)?)?$"
GUESSES = ("%d.%m.%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f",
           "%m/%d/%Y %I:%M:%S.%f %p", "%d.%m.%Y %H:%M")  # fmt: skip
NOT_A_TIME = np.iinfo(np.int64).min


def looks_like_date_time(text: str) -> bool:
    """Whether a field is a date, a time of day, or both.

    Examples
    --------
    >>> looks_like_date_time("03.11.2026 10:15:00,25"), looks_like_date_time("10.15")
    (True, False)
    """
    return _LOOKS.fullmatch(text) is not None


def guess_form(texts: Sequence[str]) -> str | None:
    """Find the form in which dates are written; None where none of the usual ones fits all of them.

    Examples
    --------
    >>> guess_form(["31/12/2026 23:59:59"])
    '%d/%m/%Y %H:%M:%S.%f'
    """
    for form in (ISO, *GUESSES):
        if (_nanoseconds(texts, form) != NOT_A_TIME).all():
            return form
    return None


def seconds(values: NDArray | Sequence[str], form: str, path: Path) -> NDArray[np.float64]:
    """Give the seconds since the first date and time of a column.

    Parameters
    ----------
    values
        Texts, or NumPy's ``datetime64``.
    form
        As `datetime.strptime` takes it (``%d.%m.%Y %H:%M:%S.%f``; the fraction may be left out, a comma in it is a
        point); ``ISO`` for ISO 8601.
    path
        File, for the message.

    Returns
    -------
    ndarray
        NaN where there is no date.

    Raises
    ------
    RecordingError
        No text is a date of that form.
    """
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        count = values.astype("datetime64[ns]").astype(np.int64)
    else:
        count = _nanoseconds(["" if text is None else str(text) for text in values], form)
    there = count != NOT_A_TIME
    if count.size and not there.any():
        shown = form or "2026-11-03T10:15:00.123 (ISO 8601)"
        remedy = 'say how they are written: format = "%d.%m.%Y %H:%M:%S.%f"'
        what = f"no value of the time column is a date of the form {shown}"
        raise RecordingError(what, where=str(path), value=str(values[0])[:60], remedy=remedy)
    out = np.full(count.size, np.nan)
    if there.any():
        out[there] = (count[there] - count[there][0]) / 1e9
    return out


def _nanoseconds(texts: Sequence[str], form: str) -> NDArray[np.int64]:
    """Count nanoseconds from some day on; `NOT_A_TIME` where a text has not that form."""
    import polars as pl

    column = pl.Series("texts", [text.strip().replace(",", ".") for text in texts], dtype=pl.String)
    if form == ISO:
        date, clock, second, zone = (column.str.extract(_ISO_PARTS, group) for group in (1, 2, 3, 4))
        whole = date.fill_null("1970-01-01") + "T" + clock.fill_null("00:00") + ":" + second.fill_null("00")
        column = (whole + zone.fill_null("Z")).set(date.is_null() & clock.is_null(), None)
        parts = "%Y-%m-%dT%H:%M:%S%.f%#z"
    else:
        parts = form.replace(",", ".").replace(".%f", "%.f")
        if not re.search(r"%[djyYFxcs]", parts):
            column, parts = "1970-01-01 " + column, f"%Y-%m-%d {parts}"
    try:
        found = column.str.to_datetime(parts, strict=False, time_unit="ns")
    except pl.exceptions.PolarsError:  # a form that has no meaning
        return np.full(len(texts), NOT_A_TIME)
    return found.dt.epoch("ns").fill_null(NOT_A_TIME).to_numpy()
