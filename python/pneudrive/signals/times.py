"""Times of samples: dates and times of day, rates, clocks of channels, wrapping counters, slow channels."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Ints
from pneudrive.errors import RecordingError

DATE_TIME = "date-time"  # the unit of such a column in a layout
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
    """Return whether a format has minutes, but neither hours nor a date. Such a time restarts after an hour."""
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


def seconds(values: NDArray | Sequence[str], form: str, path: Path) -> Array:
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
        Seconds; NaN where the column has no date.

    Raises
    ------
    RecordingError
        No text is a date of that format.
    """
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        count = values.astype("datetime64[ns]").astype(np.int64)
    else:
        count = _nanoseconds(["" if text is None else str(text) for text in values], form)
    there = count != NOT_A_TIME
    if count.size and not there.any():
        shown = form or "2026-11-03T10:15:00.123 (ISO 8601)"
        raise RecordingError.of("signals.no-dates", where=str(path), value=str(values[0])[:60], form=shown)
    first = count[there][0] if there.any() else 0
    return np.where(there, (count - first) / 1e9, np.nan)


def _nanoseconds(texts: Sequence[str], form: str) -> Ints:
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


COUNTERS = (2.0**16, 2.0**32)  # moduli of counters
CLOCKS_S = (43200.0, 86400.0)  # moduli of times of day
HOUR_S = 3600.0  # the same without hours
SAME_STEP = 0.25  # largest share of a modulus by which a jump may miss it
EQUAL_SHARE = 0.4  # least share of stamps equal to the one before for stamps that many samples share
SLOW = 2  # least usual distance of the values of a slow channel, in rows


def unwrapped(values: Array, moduli: Iterable[float], *, forward: bool = False) -> tuple[Array, int]:
    """Return a counter without its wraps, and the number of wraps. A column that is not a counter is unchanged.

    An n-bit counter has whole numbers within a range of less than 2^n, and jumps by nearly this range.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN without a value.
    moduli : iterable of float
        Possible heights of a jump.
    forward : bool
        Whether the counter only increases, like a time: every backward jump is then a wrap.
    """
    there = np.flatnonzero(np.isfinite(values))
    some = values[there]
    if some.size < 3:
        return values, 0
    steps = np.diff(some)
    for modulus in moduli:
        wraps = np.where(steps < 0, modulus, -modulus) * (np.abs(steps) > (1.0 - SAME_STEP) * modulus)
        if forward:
            wraps = np.maximum(wraps, 0.0)
        if not wraps.any() or np.ptp(some) >= modulus:
            continue
        if modulus in COUNTERS and not (some == np.floor(some)).all():
            continue
        out = values.copy()
        out[there[1:]] += np.cumsum(wraps)
        return out, int(np.count_nonzero(wraps))
    return values, 0


def clocks_of(form: str | None, factor: float = 1.0) -> list[float]:
    """Return the times after which a clock may restart, in a unit of `factor` s; `form` is the format of its texts."""
    moduli = (HOUR_S,) if form is not None and is_of_minutes(form) else CLOCKS_S
    return [modulus / factor for modulus in moduli]


def filled(time: Array, values: Array, *, held: bool = False) -> Array:
    """Return the values of a slow channel at all times, if at most every second row has a value.

    The values are interpolated linearly or held; NaN before the first and after the last value. A channel without
    isolated values is unchanged.
    """
    there = np.isfinite(values) & np.isfinite(time)
    at = np.flatnonzero(there)
    if at.size < 3 or at.size == values.size or np.median(np.diff(at)) < SLOW:
        return values
    if (np.diff(time[at]) <= 0).any():
        return values
    if held:
        before = np.maximum(np.searchsorted(at, np.arange(values.size), side="right") - 1, 0)
        out = values[at[before]]
    else:
        out = np.interp(time, time[at], values[at])
    out[: at[0]] = np.nan
    out[at[-1] + 1 :] = np.nan
    return out


def samples_of_a_stamp(time: Array) -> float:
    """Return the number of samples that share one time stamp; 1 if most stamps are different.

    Examples
    --------
    >>> samples_of_a_stamp(np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0]))
    2.0
    """
    some = time[np.isfinite(time)]
    if some.size < 3 or (np.diff(some) == 0).mean() < EQUAL_SHARE:
        return 1.0
    fresh = np.flatnonzero(np.diff(some) != 0)
    return float(np.median(np.diff(fresh))) if fresh.size > 1 else 1.0  # a column that is constant is not a time


def on_clock(time: Array, own: Array, values: Array) -> Array:
    """Interpolate a channel, whose values have their `own` times, at the times `time`.

    The result is NaN before the first and after the last value of the channel.
    """
    there = np.isfinite(own) & np.isfinite(values)
    if there.sum() < 2 or (np.diff(own[there]) < 0).any():
        return np.full(time.size, np.nan)
    return np.interp(time, own[there], values[there], left=np.nan, right=np.nan)


def overlap(columns: Iterable[Array], size: int) -> slice:
    """Return the range of rows from the first to the last row in which all columns have values."""
    first, last = 0, size
    for column in columns:
        there = np.flatnonzero(np.isfinite(column))
        if there.size:
            first, last = max(first, int(there[0])), min(last, int(there[-1]) + 1)
    return slice(first, max(last, first))
