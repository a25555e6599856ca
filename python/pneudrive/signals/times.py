"""Times of samples: dates and times of day, rates, clocks of channels, counters that wrap, slow channels."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.columns import FEWEST, INDEX, NAME, PHYSICS, UNIT, Candidate, words_of
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.arrays import Array
    from pneudrive.signals.columns import FileColumn
    from pneudrive.signals.text_table import FileForm

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
        raise RecordingError.of("signals.no-dates", where=str(path), value=str(values[0])[:60], form=shown)
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


COUNTERS = (2.0**16, 2.0**32)  # moduli of counters
CLOCKS_S = (43200.0, 86400.0)  # moduli of times of day
HOUR_S = 3600.0  # the same without hours
SAME_STEP = 0.25  # largest share of a modulus by which a jump may miss it
EQUAL_SHARE = 0.4  # least share of stamps equal to the one before for stamps that many samples share
EVEN_SHARE = 0.05  # largest deviation of the number of samples of one stamp, or of the steps of stamps
SLOW = 2  # least usual distance of the values of a slow channel, in rows


def unwrapped(values: Array, moduli: Iterable[float] = COUNTERS, *, forward: bool = False) -> tuple[Array, int]:
    """Return a counter without its wraps, and their number; other columns are unchanged.

    An n-bit counter has whole numbers within a range of less than 2^n, and jumps by nearly this range.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN without a value.
    moduli : iterable of float
        Possible heights of a jump.
    forward : bool
        A counter only grows, like a time. Every jump goes back.
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
        if not wraps.any() or float(np.ptp(some)) >= modulus:
            continue
        if modulus in COUNTERS and not (some == np.floor(some)).all():
            continue
        out = values.copy()
        out[there[1:]] += np.cumsum(wraps)
        return out, int(np.count_nonzero(wraps))
    return values, 0


def clocks_of(form: str | None, factor: float = 1.0) -> list[float]:
    """Return the times after which a clock begins again, in its unit; `form` is the format of a date."""
    moduli = (HOUR_S,) if form is not None and is_of_minutes(form) else CLOCKS_S
    return [modulus / factor for modulus in moduli]


def filled(time: Array, values: Array, *, held: bool = False) -> Array:
    """Return the values of a slow channel at all times, if it has a value in every second row or fewer.

    The values are interpolated linearly or held. Before the first value and after the last one there is NaN. A channel
    that has no isolated values is unchanged.
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
    inside = (np.arange(values.size) >= at[0]) & (np.arange(values.size) <= at[-1])
    return np.where(inside, out, np.nan)


def samples_of_a_stamp(time: Array) -> float:
    """Return the number of samples that share one stamp. The result is 1 if most stamps are new.

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


def rate_of_stamps(time: Array) -> float | None:
    """Return the rate of samples that share stamps, 1/s for stamps in s. None if the rate is not even."""
    some = time[np.isfinite(time)]
    fresh = np.flatnonzero(np.diff(some) != 0) + 1
    if fresh.size < 3:
        return None
    counts, steps = np.diff(fresh), np.diff(some[fresh])
    usual, step = float(np.median(counts)), float(np.median(steps))
    is_even = (np.abs(counts - usual) <= max(EVEN_SHARE * usual, 1.0)).all()
    if step <= 0 or not is_even or (np.abs(steps - step) > EVEN_SHARE * step).any():
        return None
    return float(counts.sum() / (some[fresh[-1]] - some[fresh[0]]))


def refuse_equal_stamps(time: Array, column: object, where: str) -> None:
    """Refuse stamps that many samples share.

    Raises
    ------
    RecordingError
        If 40 % of the samples or more have the stamp of the one before.
    """
    count = samples_of_a_stamp(time)
    if count > 1.0:
        raise RecordingError.of("signals.shared-stamps", where=f"{where}, column {column!r}", count=count)


def on_clock(time: Array, own: Array, values: Array) -> Array:
    """Return the values of a channel with a separate clock at other times.

    The result is NaN before its first value and after its last one.
    """
    there = np.isfinite(own) & np.isfinite(values)
    if there.sum() < 2 or (np.diff(own[there]) < 0).any():
        return np.full(time.size, np.nan)
    return np.interp(time, own[there], values[there], left=np.nan, right=np.nan)


def overlap(columns: Iterable[Array], size: int) -> slice:
    """Return the rows from the first to the last one in which all columns have values."""
    first, last = 0, size
    for column in columns:
        there = np.flatnonzero(np.isfinite(column))
        if there.size:
            first, last = max(first, int(there[0])), min(last, int(there[-1]) + 1)
    return slice(first, max(last, first))


# --- The time of a foreign table: its column, its unit, and other clocks.

#: Units that a time without one may have, in s. What fits the bounds below in one of them only is that unit.
UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "day": 86400.0}
STEPS_S = (50e-6, 0.5)  # usual steps of samples of a motion (assumed)
SLOWEST_S = 3600.0  # the same without a motion: the longest step
SPEEDS_M_S = (5e-5, 5.0)  # usual speeds of pistons (assumed)
RISING = 0.999  # least share of steps of a time that do not fall
EVEN, EVEN_STEPS = 0.2, 0.9  # largest deviation of an even step; least share of even steps
INDEX_SHARE = 0.99  # least share of steps of exactly 1 of an index


@dataclass
class Times:
    """The time of a table.

    Samples at a rate have no ``index`` of a column, but ``rate_hz``; their ``values`` are numbers of samples.
    An unstated ``unit`` is empty. A time of day may have a ``date`` column. The keys of ``clocks`` are columns with
    another time, its values are the columns of that time. ``question`` asks the user.
    """

    index: int | None
    values: Array
    unit: str = ""
    rate_hz: float | None = None
    reason: str = ""
    date: int | None = None
    clocks: dict[int, int] = field(default_factory=dict)
    question: str = ""


def find_times(form: FileForm, columns: Sequence[FileColumn], taken: set[int]) -> Times:
    """Find the time of a table, and take its columns from the others."""
    candidates, dates, numbered = _candidates(form, columns, taken)
    taken |= {one.column.index for one in candidates if one.score >= NAME}
    taken |= {one.index for one in (*dates, *numbered)}
    if not candidates:
        return _without_column(form, columns[0].values.size, numbered)
    best = candidates[0]
    times = _time(form, best.column, dates)
    if best.score > PHYSICS:
        clocks = [one.column for one in candidates if one.score >= best.score]
        times.clocks = _clocks_of(form, columns, best.column, clocks)
    rank = f"next: column {candidates[1].column.place!r}" if len(candidates) > 1 else "no other candidate"
    times.reason = "; ".join(filter(None, [", ".join(best.evidence), times.reason, rank]))
    taken.add(best.column.index)
    return times


def _candidates(
    form: FileForm, columns: Sequence[FileColumn], taken: set[int]
) -> tuple[list[Candidate], list[FileColumn], list[FileColumn]]:
    """Return the columns that may be the time, the best first. Columns of dates only and row counters are separate."""
    found: list[Candidate] = []
    dates: list[FileColumn] = []
    numbered: list[FileColumn] = []
    for column in columns:
        values, unit = column.values, column.unit
        is_other = unit is not None and unit.si != "s"
        if column.index in taken or is_other or np.isfinite(values).sum() < FEWEST:
            continue
        is_date = column.index in form.dates
        if is_date and len(form.dates) > 1 and (values[np.isfinite(values)] % 86400.0 == 0).all():
            dates.append(column)
            continue
        is_named, has_unit = column.role == "time", is_date or unit is not None
        score = NAME * is_named + UNIT * has_unit
        evidence = ("name",) * is_named + ("unit",) * has_unit
        if _rises(values, clocks_of(form.dates[column.index]) if is_date else COUNTERS):
            if score == 0 and (_counts(values) or INDEX.match(words_of(column.name))):
                numbered.append(column)
                continue
            if score == 0 and not _is_even(values):
                continue
            score, evidence = score + PHYSICS, (*evidence, "even steps")
        elif score == 0 or not is_named:
            continue
        if column.role not in (None, "time") and not has_unit:
            continue
        # Among equal candidates, the finer one is better: fewer samples share a stamp.
        found.append(Candidate(column, score - 0.5 * (samples_of_a_stamp(values) > 1.0), evidence))
    # A column that only rises is the time if nothing has its name; without names the first one.
    return sorted(found, key=lambda one: -one.score), dates, numbered


def _rises(values: Array, moduli: Iterable[float]) -> bool:
    some = values[np.isfinite(values)]
    some, _ = unwrapped(some, moduli, forward=True)
    steps = np.diff(some)
    if steps.size < 2 or not steps.any():
        return False
    is_coarse = samples_of_a_stamp(some) > 1.0
    return bool((steps >= 0).mean() > RISING and (np.median(steps) > 0 or is_coarse))


def _is_even(values: Array) -> bool:
    """Return whether most steps are equal: a signal that drifts upwards is not a time."""
    steps = np.diff(values[np.isfinite(values)])
    usual = float(np.median(steps))
    return bool((np.abs(steps - usual) <= EVEN * usual).mean() > EVEN_STEPS)


def _counts(values: Array) -> bool:
    """Return whether a column numbers the rows."""
    steps = np.diff(values[np.isfinite(values)])
    return steps.size > 1 and bool((steps == 1.0).mean() >= INDEX_SHARE)


def _is_same_clock(form: FileForm, first: FileColumn, second: FileColumn) -> bool:
    """Return whether two columns show one clock, perhaps in other units or more coarsely."""
    a, b = first.values, second.values
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < FEWEST or both.sum() < 0.9 * min(np.isfinite(a).sum(), np.isfinite(b).sum()):
        return False
    a, b = a[both], b[both]
    slope, start = np.polyfit(a - a[0], b - b[0], 1)
    quanta = [float(np.min(s[s > 0], initial=np.inf)) for s in (np.diff(v) for v in (a, b))]
    quantum = max(abs(slope) * quanta[0], quanta[1])
    rest = float(np.abs(b - b[0] - slope * (a - a[0]) - start).max())
    is_shifted = abs(slope - 1.0) < 0.01 and abs(b[0] - a[0]) > 1.01 * quantum
    is_number = not {first.index, second.index} & set(form.dates)
    return rest <= 1.01 * quantum and not (is_shifted and is_number)


def _clocks_of(
    form: FileForm, columns: Sequence[FileColumn], best: FileColumn, clocks: Sequence[FileColumn]
) -> dict[int, int]:
    """Return the clock of each column that does not use the best clock: the nearest clock to its left."""
    other = {one.index for one in clocks if one is not best and not _is_same_clock(form, best, one)}
    every = [one.index for one in clocks]
    nearest = {at: max((c for c in every if c < at), default=best.index) for at in range(len(columns))}
    return {at: clock for at, clock in nearest.items() if clock in other}


def _time(form: FileForm, column: FileColumn, dates: Sequence[FileColumn]) -> Times:
    """Return the time of a column."""
    unit, factor, moduli = "", 1.0, COUNTERS
    if column.index in form.dates:
        unit, moduli = DATE_TIME, clocks_of(form.dates[column.index])
    elif column.unit is not None:
        unit, factor = column.unit.unit, converter(column.unit.unit, "s")[0]
    times = Times(column.index, unwrapped(column.values, moduli, forward=True)[0], unit)
    if unit == DATE_TIME and dates:
        times.date = dates[0].index
        times.values = column.values + dates[0].values
    count = samples_of_a_stamp(times.values)
    if count > 1.0:  # stamps that many samples share are replaced by the rate of the samples, if it is even
        shared, rate = f"{count:g} samples share each stamp of column {column.place!r}", rate_of_stamps(times.values)
        if rate is None or not unit:
            times.question = f'{shared}: state the rate of the samples, time = {{ rate = "50 Hz" }}'
        else:
            times.rate_hz, times.reason = rate / factor, shared
        times.index = times.date = None
        times.values = np.arange(times.values.size, dtype=float)
    return times


def _without_column(form: FileForm, count: int, numbered: Sequence[FileColumn]) -> Times:
    """Return the time of a table without a column of times: from the rate in the file, otherwise a question."""
    preamble = form.preamble
    times = Times(None, np.arange(count, dtype=float))
    if len(set(preamble.steps_s)) > 1:
        shown = ", ".join(f"{step:g} s" for step in sorted(set(preamble.steps_s)))
        times.question = f"the channels have different rates ({shown}): resample them, or export one rate"
    elif preamble.step_s:
        times.rate_hz = 1.0 / preamble.step_s
        times.reason = f"the file states the rate: {' '.join(preamble.source.split())[:40]}"
    else:
        only = f", column {numbered[0].place!r} numbers the rows" if numbered else ""
        rate = 'state the rate of the samples, time = { rate = "50 Hz" }'
        times.question = f"no column increases like a time{only}: {rate}"
    return times


def unit_by_size(times: Times, position_m: Array | None) -> tuple[str, str]:
    """Return the unit of a time that states none, by the step of the samples and the speed of the piston.

    Returns
    -------
    str, str
        Unit and evidence; an empty unit, and a question.
    """
    steps = np.diff(times.values[np.isfinite(times.values)])
    step = float(np.median(steps)) if steps.size else 0.0
    speed = _usual_speed(times.values, position_m)
    fits = []
    longest = SLOWEST_S if speed is None else STEPS_S[1]
    for unit, factor in UNITS_S.items():
        is_speed = speed is None or SPEEDS_M_S[0] <= speed / factor <= SPEEDS_M_S[1]
        if STEPS_S[0] <= step * factor <= longest and is_speed:
            fits.append(unit)
    if len(fits) == 1:
        shown = "" if speed is None else f" and {speed / UNITS_S[fits[0]] * 1e3:.3g} mm/s"
        return fits[0], f"unit by the size of the steps: {step * UNITS_S[fits[0]]:.3g} s{shown}"
    which = " or ".join(fits) if fits else "none of s, ms and us fits usual steps and speeds"
    return "", f"the unit of the time is not stated ({which}): state it"


def _usual_speed(time: Array, position_m: Array | None) -> float | None:
    """Return the usual speed of the piston, m for each unit of the time."""
    if position_m is None:
        return None
    good = np.isfinite(time) & np.isfinite(position_m)
    path, span = np.abs(np.diff(position_m[good])), np.diff(time[good])
    moving = path > 0.2 * (np.quantile(path, 0.9) if path.size else 0.0)
    if not moving.any() or span[moving].sum() <= 0:
        return None
    return float(path[moving].sum() / span[moving].sum())
