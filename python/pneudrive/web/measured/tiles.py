"""Lowest and highest value of every pixel column, so that no peak of a recording is lost on the screen.

One pass over a recording builds blocks of 256 samples. A block has the lowest and the highest value of each channel,
the times of its first and last sample, and the number of missing values. A view with at least one block for each pixel
needs only the blocks. A closer view reads the samples.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneudrive.arrays import Array, Columns, Interval, Ints, Plain, attributes_of, by_name
from pneudrive.progress import Watch
from pneudrive.signals.channels import first_fall

#: Times of samples between two rows, s, and values of columns, by name.
Reader = Callable[[Sequence[str], tuple[int, int]], tuple[Array, Columns]]

BLOCK = 256  # samples
READ = BLOCK << 11  # samples read at once: half a million, 4 MB a channel
#: Time without a sample that is drawn as a gap, in multiples of a pixel's width.
PAUSE = 2.0
_FILES = ("time", "low", "high", "missing")


@dataclass(frozen=True)
class Pyramid:
    """Blocks of a recording.

    Attributes
    ----------
    names : tuple of str
        Channels.
    count : int
        Samples.
    time : ndarray, shape (blocks, 2)
        First and last time of each block, in s.
    low, high : ndarray, shape (channels, blocks)
        32-bit, rounded outward. NaN for a block without numbers.
    missing : ndarray, shape (channels, blocks)
        Number of missing values.
    fall : int or None
        First sample whose time is missing or less than the previous one, for instance because the clock was set back.
    """

    names: tuple[str, ...]
    count: int
    time: Array
    low: Array
    high: Array
    missing: Array
    fall: int | None = None

    @classmethod
    def build(cls, names: Sequence[str], count: int, read: Reader, watch: Watch) -> Pyramid:
        """Make the blocks in one pass over the samples.

        Parameters
        ----------
        names : sequence of str
            Channels.
        count : int
            Samples.
        read : callable
            Times and values of channels between two rows.
        watch : Watch
            Progress, in samples.
        """
        blocks = -(-count // BLOCK)
        time = np.empty((blocks, 2))
        low, high = (np.empty((len(names), blocks), "f4") for _ in range(2))
        missing = np.zeros((len(names), blocks), "u2")
        fall: int | None = None
        for begin in range(0, count, READ):
            watch.tell(begin, count, "samples")
            rows = (begin, min(begin + READ, count))
            starts = np.arange(0, rows[1] - begin, BLOCK)
            at = slice(begin // BLOCK, begin // BLOCK + len(starts))
            seconds, values = read(names, rows)
            if fall is None:
                found = first_fall(seconds, time[at.start - 1, 1] if begin else seconds[0])
                fall = None if found is None else begin + found
            time[at, 0] = seconds[starts]
            time[at, 1] = seconds[np.minimum(starts + BLOCK, len(seconds)) - 1]
            for channel, name in enumerate(names):
                own = np.asarray(values[name], np.float64)
                is_none = ~np.isfinite(own)
                if is_none.any():
                    missing[channel, at] = np.add.reduceat(is_none, starts)
                    own = np.where(is_none, np.nan, own)
                low[channel, at] = _outward(np.fmin.reduceat(own, starts), -np.inf)
                high[channel, at] = _outward(np.fmax.reduceat(own, starts), np.inf)
        watch.tell(count, count, "samples")
        return cls(tuple(names), count, time, low, high, missing, fall)

    def save(self, folder: Path) -> None:
        """Write the blocks into a folder. The folder becomes valid when the last file is written."""
        folder.mkdir(parents=True, exist_ok=True)
        for name in _FILES:
            np.save(folder / f"{name}.npy", getattr(self, name))
        about = folder / "pyramid.json.part"
        about.write_text(json.dumps(attributes_of(self, "names", "count", "fall")), encoding="utf-8")
        about.replace(folder / "pyramid.json")

    @classmethod
    def open(cls, folder: Path) -> Pyramid | None:
        """Open the files of `save` without reading them. Return None if files are missing or incomplete."""
        try:
            about = json.loads((folder / "pyramid.json").read_text(encoding="utf-8"))
            arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in _FILES}
            return cls(tuple(about["names"]), int(about["count"]), **arrays, fall=about["fall"])
        except (OSError, EOFError, ValueError, KeyError):
            return None

    def window(
        self,
        span: Interval,
        pixels: int,
        channels: Sequence[str],
        samples: Reader,
    ) -> tuple[Array, Columns, Plain]:
        """Return a view of at most two values for each pixel and channel, or the samples if they are fewer.

        The view has times, values by channel, and a table. ``samples`` and ``missing`` in the table are the numbers of
        samples and of missing values. ``raw`` is true if the values are the samples themselves. NaN marks a gap.

        Parameters
        ----------
        span : (float, float)
            First and last time, in s.
        pixels : int
        channels : sequence of str
            Some of `names`.
        samples : callable
            Samples of the recording between two rows.
        """
        starts = self.time[:, 0]
        first = max(int(np.searchsorted(starts, span[0], "right")) - 1, 0)
        last = max(int(np.searchsorted(starts, span[1], "right")), first + 1)
        rows = (first * BLOCK, min(last * BLOCK, self.count))
        if last - first >= pixels:
            begins, ends = self.time[first:last].T
            places = [self.names.index(name) for name in channels]
            low, high = (by_name(channels, list(own[places, first:last])) for own in (self.low, self.high))
            missing = self.missing[places, first:last].sum(dtype=np.int64)
            about: Plain = {"missing": missing, "samples": rows[1] - rows[0], "raw": False}
        else:
            # One more sample continues the line to the edge of a view that ends between two blocks.
            seconds, values = samples(channels, (rows[0], min(rows[1] + 1, self.count)))
            begin, end = np.searchsorted(seconds, span[0]), np.searchsorted(seconds, span[1], "right")
            missing = sum(np.isnan(own[begin:end]).sum() for own in values.values())
            around = slice(max(begin - 1, 0), end + 1)
            begins = ends = seconds[around]
            low = high = {name: own[around] for name, own in values.items()}
            about = {"missing": missing, "samples": end - begin, "raw": len(begins) <= 2 * pixels}
            if about["raw"]:
                return begins, low, about
        edges = _edges(begins, span, pixels)
        starts = edges[:-1]
        found = {}
        for name in channels:
            found[name] = np.fmin.reduceat(low[name], starts), np.fmax.reduceat(high[name], starts)
        last, width = edges[1:] - 1, (span[1] - span[0]) / pixels
        return *_with_gaps(begins[starts], ends[last], width, found), about


def _with_gaps(
    begins: Array, ends: Array, width: float, found: dict[str, tuple[Array, Array]]
) -> tuple[Array, Columns]:
    """Return times and channels of pixel columns, each with its lowest and its highest value side by side.

    Pauses of the clock are marked by NaN. A pixel column with samples before and after a pause is drawn on both sides.

    Parameters
    ----------
    begins, ends : ndarray
        First and last time of each column, in s.
    width : float
        Width of a pixel, in s.
    found : dict
        Lowest and highest values of each channel.
    """
    nothing = np.float32(np.nan)
    across = np.flatnonzero(ends - begins > PAUSE * width)
    before = np.flatnonzero(begins[1:] - ends[:-1] > PAUSE * width) + 1
    # Indices at which values are inserted: a gap; for a pause inside a column, a gap and the column again.
    at = np.concatenate([2 * before, np.repeat(2 * across + 2, 3)])
    middles = begins + 0.5 * np.minimum(ends - begins, width)
    again = np.column_stack([middles[across], ends[across], ends[across]]).ravel()
    times = np.column_stack([begins, middles]).ravel()
    time = np.insert(times, at, np.concatenate([ends[before - 1], again]))
    channels = {}
    for name, pair in found.items():
        line, own = np.column_stack(pair).ravel(), [one[across] for one in pair]
        gaps = np.full(len(across), nothing)
        put = np.concatenate([np.full(len(before), nothing), np.column_stack([gaps, *own]).ravel()])
        channels[name] = np.insert(line, at, put)
    return time, channels


def drawn_columns(columns: Columns, pixels: int) -> Columns:
    """Return columns over ``time_s``. Long columns are reduced to the lowest and highest value of each pixel.

    Reduced columns also have ``NAME/at``: the values at the sent times. The page can therefore show the value of the
    run at the cursor, not an extreme value of a pixel.
    """
    time = columns["time_s"]
    if len(time) <= 2 * pixels + 1:
        return columns
    edges = np.linspace(0, len(time), pixels + 1).astype(int)
    starts = edges[:-1]
    sent = np.column_stack([time[starts], time[(starts + edges[1:]) // 2]]).ravel()
    values = {name: column for name, column in columns.items() if name != "time_s"}
    rows = np.searchsorted(time, sent)
    drawn = {}
    for name, own in values.items():
        ends = np.fmin.reduceat(own, starts), np.fmax.reduceat(own, starts)
        drawn[name] = np.stack(ends, 1).ravel()
    return {"time_s": sent, **drawn, **{f"{name}/at": own[rows] for name, own in values.items()}}


def _edges(seconds: Array, span: Interval, pixels: int) -> Ints:
    """Return the first sample of each pixel column, in order of time. Columns without a sample are left out."""
    wanted = np.searchsorted(seconds, np.linspace(*span, pixels + 1)[1:-1])
    edges = np.concatenate([[0], wanted, [len(seconds)]])
    return edges[np.diff(edges, prepend=-1) > 0]


def _outward(values: Array, towards: float) -> Array:
    """Round lowest values down and highest values up to 32 bits."""
    with np.errstate(over="ignore"):
        short = values.astype("f4")
    inward = short > values if towards < 0 else short < values
    return np.where(inward, np.nextafter(short, np.float32(towards)), short)
