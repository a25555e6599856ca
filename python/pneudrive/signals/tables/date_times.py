"""Columns of dates and times instead of seconds: read to the nanosecond, and counted from the first value."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

UNIT = "date-time"  # the unit of such a column in a layout
ISO = ""  # format of ISO 8601; the time of day may stand alone
_DATE = r"\d{4}-\d\d?-\d\d?|\d\d?\.\d\d?\.\d{4}|\d\d?/\d\d?/\d{4}|\d{4}/\d\d?/\d\d?"
_CLOCK = r"\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?(?:\s?[AaPp][Mm])?(?:\s?Z|\s?[+-]\d\d:?\d\d)?"
_MINUTES = r"[0-5]?\d:[0-5]\d[.,]\d+"  # as spreadsheets save a time of day
_LOOKS = re.compile(rf"\s*(?:(?:{_DATE})(?:[T\s]\s*(?:{_CLOCK}))?|{_CLOCK}|{_MINUTES})\s*")
# date, hour and minute, second, zone. Each is optional, and the rest counts from midnight UTC
_ISO_PARTS = r"^(?:(\d{4}-\d\d?-\d\d?)(?:[T\s]\s*|$))?(?:(\d\d?:\d\d)(?::(\d\d(?:\.\d+)?))?\s*(Z|[+-]\d\d:?\d\d)?)?$"
GUESSES = ("%d.%m.%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f",
           "%m/%d/%Y %I:%M:%S.%f %p", "%d/%m/%Y %I:%M:%S.%f %p", "%d.%m.%Y %H:%M", "%I:%M:%S.%f %p",
           "%M:%S.%f", "%d.%m.%Y", "%Y/%m/%d", "%m/%d/%Y", "%d/%m/%Y")  # fmt: skip
NOT_A_TIME = np.iinfo(np.int64).min


def looks_like_date_time(text: str) -> bool:
    """Return whether a field is a date, a time of day, or both.

    Examples
    --------
    >>> looks_like_date_time("03.11.2026 10:15:00,25"), looks_like_date_time("10.15")
    (True, False)
    """
    return _LOOKS.fullmatch(text) is not None


def is_of_minutes(form: str) -> bool:
    """Return whether a format has minutes, but neither hours nor a date: it begins again after an hour."""
    return "%M" in form and not re.search(r"%[HIsTRcdjyYFx]", form)


def guess_form(texts: Sequence[str]) -> str | None:
    """Return the format of dates; None if no usual format fits all of them.

    Examples
    --------
    >>> guess_form(["31/12/2026 23:59:59"])
    '%d/%m/%Y %H:%M:%S.%f'
    """
    found = {form: _nanoseconds(texts, form) for form in (ISO, *GUESSES)}
    fits = [form for form, count in found.items() if count.size and (count != NOT_A_TIME).all()]
    # 03/02 and 04/02 are two days in a row, not two months: the shortest span, then the first format.
    return min(fits, key=lambda form: int(np.ptp(found[form])), default=None)


def seconds(values: NDArray | Sequence[str], form: str, path: Path) -> NDArray[np.float64]:
    """Return the seconds since the first date and time of a column.

    Parameters
    ----------
    values
        Texts, or NumPy's ``datetime64``.
    form
        Format of `datetime.strptime` (``%d.%m.%Y %H:%M:%S.%f``). The fraction is optional, and a comma in it is read as
        a point. ``ISO`` for ISO 8601.
    path
        File, for the message.

    Returns
    -------
    ndarray
        NaN without a date.

    Raises
    ------
    RecordingError
        If no text is a date of that format.
    """
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        count = values.astype("datetime64[ns]").astype(np.int64)
    else:
        count = _nanoseconds(["" if text is None else str(text) for text in values], form)
    there = count != NOT_A_TIME
    if count.size and not there.any():
        shown = form or "2026-11-03T10:15:00.123 (ISO 8601)"
        remedy = 'state their format: format = "%d.%m.%Y %H:%M:%S.%f"'
        what = f"no value of the time column is a date of the format {shown}"
        raise RecordingError(what, where=str(path), value=str(values[0])[:60], remedy=remedy)
    out = np.full(count.size, np.nan)
    if there.any():
        out[there] = (count[there] - count[there][0]) / 1e9
    return out


def _nanoseconds(texts: Sequence[str], form: str) -> NDArray[np.int64]:
    """Return nanoseconds since a fixed day; `NOT_A_TIME` for texts of another format."""
    import polars as pl

    column = pl.Series("texts", [text.strip().replace(",", ".") for text in texts], dtype=pl.String)
    if form == ISO:
        date, clock, second, zone = (column.str.extract(_ISO_PARTS, group) for group in (1, 2, 3, 4))
        whole = date.fill_null("1970-01-01") + "T" + clock.fill_null("00:00") + ":" + second.fill_null("00")
        column = (whole + zone.fill_null("Z")).set(date.is_null() & clock.is_null(), None)
        parts = "%Y-%m-%dT%H:%M:%S%.f%#z"
    else:
        parts = form.replace(",", ".").replace(".%f", "%.f")
        if is_of_minutes(form):
            column, parts = "00:" + column, f"%H:{parts}"
        if not re.search(r"%[djyYFxcs]", parts):
            column, parts = "1970-01-01 " + column, f"%Y-%m-%d {parts}"
        elif not re.search(r"%[HIsTRc]", parts):
            column, parts = column + " 00:00", f"{parts} %H:%M"
    try:
        found = column.str.to_datetime(parts, strict=False, time_unit="ns")
    except pl.exceptions.PolarsError:  # an invalid format
        return np.full(len(texts), NOT_A_TIME)
    return found.dt.epoch("ns").fill_null(NOT_A_TIME).to_numpy()
