"""Present action of a running campaign, as two files in ``control/``. Any process may read them, also over the network.

``live.json`` has the cycle, counts and the remaining time. ``live.f4`` has the points of the cycle so far as 32-bit
floats, one row of `COLUMNS` each. If there are new data, both are replaced by renaming, five times a second. A separate
thread writes them, so a slow disk does not delay the campaign. They are removed when the campaign ends. Long recordings
are reduced to the samples
with the lowest and the highest force of each interval.
"""

from __future__ import annotations

import contextlib
import json
import threading
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import crc32

import numpy as np

from pneudrive.campaign.running.live import CampaignProgress, Display
from pneudrive.campaign.storage.control import FOLDER, LIVE, LIVE_POINTS
from pneudrive.campaign.storage.files import write_whole
from pneudrive.errors import CampaignError
from pneudrive.files.content import read_bytes, read_json

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.rig.interface import Samples

    Points = NDArray[np.float32]

COLUMNS = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
_FORCE = COLUMNS.index("force_n")
EVERY_S = 0.2
#: Points of the current cycle that are kept for its curve.
SHOWN = 4000


class LiveFiles(Display):
    """A display that writes files.

    Parameters
    ----------
    folder : Path
        Folder of the campaign, which contains the folder ``control``.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._lock, self._end = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._write_on, daemon=True)
        self._about: dict[str, Any] = {}
        self._points = np.zeros((0, len(COLUMNS)), dtype=np.float32)
        self._samples, self._is_new = 0, False

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Begin to write."""
        self._progress = CampaignProgress(plan, done)
        self._thread.start()

    def cycle(self, cycle: Cycle) -> None:
        """Write that a cycle begins."""
        with self._lock:
            self._about = {"cycle": cycle.key, "planned": self._progress.total}
            self._restart()

    def _restart(self) -> None:
        self._points, self._samples, self._is_new = self._points[:0], 0, True

    def part(self, samples: Samples) -> None:
        """Add samples that arrived. Samples of another attempt at the cycle replace the earlier ones."""
        rows = np.column_stack([getattr(samples, name) for name in COLUMNS]).astype(np.float32)
        with self._lock:
            if len(self._points) and len(rows) and rows[0, 0] < self._points[-1, 0]:
                self._restart()
            self._points = np.concatenate([self._points, rows])
            self._samples += len(rows)
            if len(self._points) > 2 * SHOWN:
                self._points = thinned(self._points, SHOWN)
            self._is_new = True

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Count a cycle as done."""
        with self._lock:
            self._progress.finished(cycle.key)
            self._is_new = True

    def ended(self) -> None:
        """End, and remove the files."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()
        for name in (LIVE, LIVE_POINTS):
            with contextlib.suppress(OSError):
                (self._folder / name).unlink()

    def _write_on(self) -> None:
        while not self._end.wait(EVERY_S):
            with contextlib.suppress(CampaignError):  # a disk that is full tells the campaign itself
                self._write()

    def _write(self) -> None:
        with self._lock:
            if not (self._is_new and self._about):
                return
            self._is_new = False
            data = thinned(self._points, SHOWN).astype("<f4").tobytes()
            about = {**self._about, "done": self._progress.count, "left": self._progress.left}
            about |= {"samples": self._samples, "columns": COLUMNS, "crc32": crc32(data)}
        write_whole(self._folder / LIVE_POINTS, data, flush=False)
        write_whole(self._folder / LIVE, json.dumps(about).encode(), flush=False)


def thinned(points: Points, most: int) -> Points:
    """Return at most `most` rows, in order: lowest and highest force of each interval of equal length.

    Parameters
    ----------
    points : ndarray, shape (n, len(COLUMNS))
    most : int
        Even.
    """
    count = len(points)
    if count <= most:
        return points
    stretch = -(-count // (most // 2))
    force = points[:, _FORCE]
    fill = -count % stretch
    rows = np.arange(0, count, stretch)
    kept = []
    for padding, place in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        numbers = np.where(np.isnan(force), padding, force)
        padded = np.concatenate([numbers, np.full(fill, padding)]).reshape(-1, stretch)
        kept.append(rows + place(padded, axis=1))
    return points[np.unique(np.concatenate(kept))]


class LiveCycle(NamedTuple):
    """The cycle that a campaign runs now.

    Attributes
    ----------
    cycle, left : str
        Key of the cycle; time left by the computer's clock, in words.
    done, planned, samples : int
        Finished and planned cycles; samples of this cycle so far.
    points : dict of ndarray, shape (n,)
        Values by `COLUMNS`.
    """

    cycle: str
    left: str
    done: int
    planned: int
    samples: int
    points: dict[str, Points]


def read_live(folder: Path) -> LiveCycle | None:
    """Return the files of the present cycle of a campaign, or None if they are missing or just being replaced."""
    try:
        about = read_json(folder / FOLDER / LIVE, CampaignError)
        data = read_bytes(folder / FOLDER / LIVE_POINTS, CampaignError)
        if about["crc32"] != crc32(data) or tuple(about["columns"]) != COLUMNS:
            return None
        rows = np.frombuffer(data, dtype="<f4").reshape(-1, len(COLUMNS))
        done, planned, samples = (int(about[key]) for key in ("done", "planned", "samples"))
        points: dict[str, Points] = {name: rows[:, place] for place, name in enumerate(COLUMNS)}
        return LiveCycle(str(about["cycle"]), str(about["left"]), done, planned, samples, points)
    except (CampaignError, KeyError, TypeError, ValueError):
        return None
