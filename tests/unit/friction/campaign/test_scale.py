"""A campaign of 20,000 cycles: work is counted, so that nothing is done once a cycle that can be done once for many."""

from __future__ import annotations

from threading import Lock

import numpy as np

from oracle.campaigns import write_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.files import seal, tables
from pneudrive.friction.campaign import reading, trends
from pneudrive.friction.campaign.points import points_of
from pneudrive.friction.motion import Settled

FILES = 5  # of a message
SPEEDS = (0.005, 0.01, 0.02, 0.05)


def test_work_grows_by_two_looks_a_cycle(quick, tmp_path, monkeypatch):
    """Each file is looked at for its head and for its samples.

    Patterns over position are one least squares problem for all cycles that cover the same bins.
    """
    calls: dict[str, int] = {}
    lock = Lock()

    def count(module: object, name: str) -> None:
        function = getattr(module, name)

        def counted(*arguments, **options):
            with lock:  # files are looked at by several threads
                calls[name] = calls.get(name, 0) + 1
            return function(*arguments, **options)

        monkeypatch.setattr(module, name, counted)

    monkeypatch.setattr(tables, "MOST_FILES", FILES)
    for module, name in ((seal, "look"), (np.linalg, "lstsq")):
        count(module, name)
    told = []
    for repeats in (2, 4):
        folder = write_campaign(tmp_path / f"r{repeats}", quick(repeats=repeats, samples=80, speeds_m_s=SPEEDS), 1)
        calls.clear()
        found = reading.read_campaign(Campaign.open(folder), Settled(), 1)
        points = points_of(found)
        assert points is not None
        rows = points["relative_n"][:, points.pattern.common]
        solved = calls.get("lstsq", 0)
        assert len(trends._each(np.ones((rows.shape[1], 1)), rows)) == len(points)
        masks = len(np.unique(np.isfinite(rows), axis=0))
        assert calls["lstsq"] - solved == masks < len(points)
        told.append((len(found.files), calls["look"]))
    (few, looks), (many, more_looks) = told
    assert many > 1.5 * few
    assert more_looks - looks == 2 * (many - few)
