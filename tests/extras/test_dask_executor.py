"""Chunks on a Dask cluster of this machine whose workers are killed while it runs. `make test-extras` runs it."""

from __future__ import annotations

import os
import signal
import time

import pytest

distributed = pytest.importorskip("distributed")

from pneudrive.ensemble.executors import DaskExecutor  # noqa: E402
from pneudrive.errors import CommandError, SimulationError  # noqa: E402


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_items_of_killed_workers_run_again_and_none_comes_twice(client, tmp_path):
    def work(k):
        (tmp_path / f"{k}-{os.getpid()}-{time.monotonic_ns()}").touch()
        time.sleep(0.05)
        return k, os.getpid()

    came = []
    for k, pid in DaskExecutor(client).map(work, iter(range(40))):
        came.append(k)
        if len(came) in (5, 15):
            os.kill(pid, signal.SIGKILL)
    assert sorted(came) == list(range(40))
    assert len(list(tmp_path.iterdir())) > 40  # some had begun on a worker that was killed


def test_an_item_that_kills_its_workers_ends_the_study(client):
    def work(k):
        if k == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with pytest.raises(SimulationError, match="lost its worker again and again"):
        list(DaskExecutor(client).map(work, range(6)))


def test_what_is_wrong_with_an_item_is_told_as_it_is(client):
    def work(k):
        raise CommandError(f"item {k} is wrong", remedy="Mend it.")

    with pytest.raises(CommandError, match="item 0 is wrong") as told:
        list(DaskExecutor(client).map(work, [0]))
    assert told.value.remedy == "Mend it."
