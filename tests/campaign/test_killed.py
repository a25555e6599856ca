"""Killed at any moment, a campaign keeps every finished cycle, has none twice, and ends as if nothing had been.

By SIGKILL and SIGTERM, while its folder is made too. 6 times here; with ``PNEUDRIVE_KILLS=200`` in the environment
that often.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import signal
import time
from collections import Counter

import numpy as np
import pytest

from campaign import killed_child
from campaign.fake_rig import QUICK, FakeRig, contents, protocol
from pneudrive.campaign.run import DONE, resume_campaign, run_campaign
from pneudrive.campaign.storage.control import holder
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characterise import Recording, characterise
from pneudrive.errors import CampaignError

KILLS = int(os.environ.get("PNEUDRIVE_KILLS", "6"))


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


def halves_of(folder):
    """Give what is there half-written, each with its time."""
    halves = [*folder.glob("*.part"), *folder.glob("*/*.part")]
    return {(path, path.stat().st_mtime_ns) for path in halves}


def wait(process, folder, seconds, moment, old):
    """Wait so long; then until the process makes the folder, or writes a cycle, where that is to be disturbed."""
    process.join(0.0 if moment == "making" else seconds)
    while moment != "any" and process.exitcode is None:
        time.sleep(0.0005)  # who asks all the time takes the processor from the one that is to be killed
        with contextlib.suppress(OSError):
            if halves_of(folder) - old or (moment == "making" and (folder / "campaign.json").exists()):
                return


def kill(process, number):
    """Kill it, or ask it to end, and hold it to what it says then."""
    if number == signal.SIGKILL:
        process.kill()
    else:
        process.terminate()
    process.join()
    # asked to end, it ends as by Ctrl-C, unless it had not begun, or was done just then
    assert process.exitcode in ((-signal.SIGKILL, 0) if number == signal.SIGKILL else (130, -signal.SIGTERM, 0))
    return process.exitcode


def test_killed_at_random_moments(tmp_path, processes):
    text = tmp_path / "killed.toml"
    text.write_text(killed_child.PROTOCOL)

    def start(folder):
        process = processes.Process(target=killed_child.run, args=(str(folder), str(text)))
        process.start()
        return process

    for name in ("imports", "undisturbed"):
        begin = time.monotonic()
        process = start(tmp_path / name)
        process.join()
        assert process.exitcode == 0
    usual_s = time.monotonic() - begin
    undisturbed, known = contents(tmp_path / "undisturbed"), friction_map(tmp_path / "undisturbed")
    assert len(undisturbed) > 30

    moments, kills, campaigns, before, halves, statuses = random.Random(5), 0, 0, 0, set(), Counter()
    while kills < KILLS:
        campaigns += 1
        folder = tmp_path / f"killed-{campaigns}"
        kept: dict[str, tuple] = {}
        while True:
            begun, old = (folder / "campaign.json").exists(), halves_of(folder)
            process = start(folder)
            if kills >= KILLS:
                process.join()
            moment = "making" if not begun and kills % 3 else ("any", "writing")[kills % 2]
            wait(process, folder, moments.uniform(0.0, 0.7 * usual_s), moment, old)
            if process.exitcode is not None:
                assert process.exitcode == 0
                break
            status = kill(process, (signal.SIGKILL, signal.SIGTERM)[kills // 2 % 2])
            kills += 1
            statuses[status] += 1
            halves |= halves_of(folder)
            if not (folder / "campaign.json").exists():
                before += 1  # before there was a campaign: it begins next time
                continue
            assert holder(folder) is None
            assert Campaign.open(folder).checked()[1] == []
            found = contents(folder)
            assert kept.items() <= found.items()
            assert found.items() <= undisturbed.items()
            kept = found
        assert contents(folder) == undisturbed
        assert not list(folder.rglob("*.part"))
        other = friction_map(folder)
        for name in known.variables:
            left, right = known[name].to_numpy(), other[name].to_numpy()
            assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f"), name
    print(  # noqa: T201
        f"{kills} kills ({dict(statuses)}) in {campaigns} campaigns of {len(undisturbed)} cycles, {before} before "
        f"there was one, {len(halves)} half-written files"
    )


@pytest.mark.parametrize("name", ["campaign.toml", "campaign.toml.part", "rig.json.part", "campaign.json.part"])
def test_a_folder_that_was_half_made_begins(tmp_path, name):
    (tmp_path / "c" / "cycles").mkdir(parents=True)
    (tmp_path / "c" / "control").mkdir()
    (tmp_path / "c" / name).write_text("{")
    assert run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK).ended == DONE
    assert not list((tmp_path / "c").glob("*.part"))


def test_a_folder_never_decides_what_is_written_elsewhere(tmp_path):
    """A link in the place of any file or folder of a campaign is refused, before anything is touched."""
    run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK)
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim" / "precious").write_text("kept")
    for name in ("campaign.lock", "campaign.log", "campaign.json.part", "cycles/00001-x.parquet.part", "control"):
        path = tmp_path / "c" / name
        content = path.read_bytes() if path.is_file() else None
        if path.is_dir():
            path.rmdir()
        path.unlink(missing_ok=True)
        path.symlink_to(tmp_path / "victim" / ("" if name == "control" else "precious"))
        for work in (
            lambda: resume_campaign(tmp_path / "c", FakeRig(), options=QUICK),
            lambda: run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK),
        ):
            with pytest.raises(CampaignError, match="a link to"):
                work()
        assert (tmp_path / "victim" / "precious").read_text() == "kept"
        path.unlink()
        if content is not None:
            path.write_bytes(content)
    assert resume_campaign(tmp_path / "c", FakeRig(), options=QUICK).ended == DONE
