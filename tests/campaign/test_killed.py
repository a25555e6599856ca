"""Killed at any moment, a campaign keeps every finished cycle, has none twice, and ends as if nothing had been.

20 times here; with ``PNEUDRIVE_KILLS=200`` in the environment that often.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import time

import numpy as np
import pytest

from campaign import killed_child
from campaign.fake_rig import contents
from pneudrive.campaign.folder import Campaign
from pneudrive.campaign.lock import holder
from pneudrive.characterise import Recording, characterise

KILLS = int(os.environ.get("PNEUDRIVE_KILLS", "20"))


@pytest.fixture(scope="module")
def processes():
    """Give what starts a process fast: a server that has imported everything forks it."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["campaign.killed_child"])
    return context


def friction_map(folder):
    """Characterise the sweeps."""
    campaign = Campaign.open(folder)
    recordings = []
    for file in campaign.cycles():
        if file.head.cycle.kind != "sweep":
            continue
        samples = file.samples()
        channels = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
        recordings.append(
            Recording(
                name=file.head.cycle.key,
                **{name: getattr(samples, name) for name in channels},
                area_a_m2=campaign.identity.area_a_m2,
                area_b_m2=campaign.identity.area_b_m2,
                ambient_pressure_pa=campaign.identity.ambient_pressure_pa,
            )
        )
    return characterise(recordings)


def wait(process, folder, seconds, *, writing):
    """Wait so long, or until the process writes a cycle for the first time after that."""
    process.join(seconds)
    while writing and process.exitcode is None:
        with contextlib.suppress(OSError):
            if any(name.endswith(".part") for name in os.listdir(folder / "cycles")):  # noqa: PTH208 - fast
                return


def test_killed_at_random_moments(tmp_path, processes):
    for name in ("imports", "undisturbed"):
        begin = time.monotonic()
        process = processes.Process(target=killed_child.run, args=(str(tmp_path / name),))
        process.start()
        process.join()
        assert process.exitcode == 0
    usual_s = time.monotonic() - begin
    undisturbed = contents(tmp_path / "undisturbed")
    assert len(undisturbed) > 40

    moments, kills, campaigns, halves = random.Random(5), 0, 0, set()
    while kills < KILLS:
        campaigns += 1
        folder = tmp_path / f"killed-{campaigns}"
        kept: dict[str, tuple] = {}
        while True:
            process = processes.Process(target=killed_child.run, args=(str(folder),))
            process.start()
            if kills < KILLS:
                wait(process, folder, moments.uniform(0.0, 0.7 * usual_s), writing=kills % 2 == 1)
            else:
                process.join()
            ended_by_itself = process.exitcode is not None
            if ended_by_itself:
                assert process.exitcode == 0
                break
            process.kill()
            process.join()
            kills += 1
            if not (folder / "campaign.json").exists():
                continue  # before there was a campaign
            assert holder(folder) is None
            assert Campaign.open(folder).problems() == []
            found = contents(folder)
            assert kept.items() <= found.items()
            assert found.items() <= undisturbed.items()
            halves |= {(path, path.stat().st_mtime_ns) for path in folder.rglob("*.part")}
            kept = found
        assert contents(folder) == undisturbed
        assert not list(folder.rglob("*.part"))
        before, after = friction_map(tmp_path / "undisturbed"), friction_map(folder)
        for name in before.variables:
            left, right = before[name].to_numpy(), after[name].to_numpy()
            assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f"), name
    print(f"{kills} kills in {campaigns} campaigns of {len(undisturbed)} cycles, {len(halves)} half-written files")  # noqa: T201
