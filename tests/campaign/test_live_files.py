"""A campaign tells what it does now in files that anybody may read; no extreme of the force is lost, none stays."""

from __future__ import annotations

import time

import numpy as np
import pytest

from campaign.fake_rig import QUICK, FakeRig, protocol
from pneudrive.campaign.run import DONE, run_campaign
from pneudrive.campaign.running.live import COLUMNS, read_live, thinned
from pneudrive.campaign.storage.control import holder


def test_another_process_sees_the_cycle_as_it_runs_and_requests_stay_requests(tmp_path):
    folder, seen = tmp_path / "c", []

    def look(rig, word):
        since = rig.calls[len(rig.calls) - 1 - rig.calls[::-1].index("acquire") :] if "acquire" in rig.calls else []
        if word != "part" or seen or rig.calls.count("acquire") < 4 or since.count("part") != 2:
            return
        for _ in range(100):
            found = read_live(folder)
            if found is not None and found[0]["samples"] and found[0]["cycle"] == holder(folder).cycle:
                seen.append((found, list(parts)))
                return
            time.sleep(0.02)

    parts = []

    class Watched(FakeRig):
        def acquire(self, steps, sampling):
            parts.clear()
            for part in super().acquire(steps, sampling):
                parts.append(part)
                yield part

    assert run_campaign(protocol(), Watched(trouble=look), folder, options=QUICK).ended == DONE
    (((about, points), (first,)),) = seen
    assert about["samples"] == len(first) <= 4000
    for name, values in points.items():
        assert np.array_equal(values, getattr(first, name).astype(np.float32))
    assert sorted(path.name for path in (folder / "control").iterdir()) == []
    assert read_live(folder) is None


@pytest.mark.parametrize("count", [3999, 4001, 123_457])
def test_a_spike_of_one_sample_is_kept_however_often_points_are_thinned(count):
    rows = np.zeros((count, len(COLUMNS)), dtype=np.float32)
    rows[:, 0] = np.arange(count)
    rows[count // 3, 2], rows[count // 2, 2], rows[7, 2] = 90.0, -80.0, np.nan
    found = thinned(thinned(rows, 8000), 4000)
    assert len(found) <= 4000
    assert np.nanmax(found[:, 2]) == 90.0
    assert np.nanmin(found[:, 2]) == -80.0
    assert (np.diff(found[:, 0]) > 0).all()
    assert (found[0, 0], found[-1, 0] > 0.99 * count) == (0, True)
