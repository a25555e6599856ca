"""Chunks on a Dask cluster of this machine whose workers are killed while it runs. `make test-extras` runs it."""

from __future__ import annotations

import os
import signal
import time
from contextlib import contextmanager

import pytest

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

import pneudrive as pn  # noqa: E402
from pneudrive import ensemble  # noqa: E402
from pneudrive.ensemble.many import DaskExecutor  # noqa: E402
from pneudrive.errors import CommandError, SimulationError  # noqa: E402


@contextmanager
def cluster_of(workers, **settings):
    """Start so many workers on this machine; a nanny starts one that is killed again, if it had quite started."""
    with (
        dask.config.set({f"distributed.scheduler.{key.replace('_', '-')}": value for key, value in settings.items()}),
        distributed.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture
def client():
    with cluster_of(3) as client:
        yield client


def test_items_of_killed_workers_run_again_and_none_comes_twice(client, tmp_path):
    def work(k):
        (tmp_path / f"{k}-{os.getpid()}-{time.monotonic_ns()}").touch()
        time.sleep(0.05)
        return k, os.getpid()

    came, victims = [], list(client.run(os.getpid).values())
    for k, _ in DaskExecutor(client).map(work, iter(range(40))):
        came.append(k)
        if len(came) in (5, 15):
            os.kill(victims.pop(), signal.SIGKILL)
    assert sorted(came) == list(range(40))
    assert len(list(tmp_path.iterdir())) > 40  # some had begun on a worker that was killed


def test_an_item_that_kills_its_worker_ends_the_study():
    def work(k):
        if k == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with (
        cluster_of(2, allowed_failures=0) as client,
        pytest.raises(SimulationError, match="stopped repeatedly"),
    ):
        list(DaskExecutor(client).map(work, range(4)))


def test_a_cluster_without_workers_ends_the_study(monkeypatch):
    monkeypatch.setattr("pneudrive.ensemble.many.LOOK_S", 0.1)
    monkeypatch.setattr("pneudrive.ensemble.many.NO_WORKER_S", 0.5)
    with cluster_of(0) as client, pytest.raises(SimulationError, match=r"no worker for 0\.5 s"):
        list(DaskExecutor(client).map(abs, [1, 2]))


def test_what_is_wrong_with_an_item_is_told_as_it_is(client):
    def work(k):
        raise CommandError(f"item {k} is wrong", remedy="Mend it.")

    with pytest.raises(CommandError, match="item 0 is wrong") as told:
        list(DaskExecutor(client).map(work, [0]))
    assert told.value.remedy == "Mend it."


DRIVE, VARY = (
    pn.Drive.load("catalogue:reference"),
    {"cylinder.bore": "uniform(20 mm, 30 mm)", "load.mass": "uniform(0 kg, 5 kg)"},
)


def study(folder, client, asked=None, after=None):
    """Run 300 members in 30 chunks; each that is run leaves a file in `asked`; workers are killed after some chunks."""
    asked.mkdir(exist_ok=True)
    died = []

    def seen(signals, times):
        time.sleep(0.03)
        (asked / f"{signals['position'][0, 0]!r}-{os.getpid()}-{time.monotonic_ns()}").touch()
        return signals["position"][:, -1]

    def progress(done, total, task):
        if after is not None and done >= after[0] and not died:
            died.append(after[1]())

    return pn.simulate_many(
        DRIVE, 1.0, "0.02 s", vary=VARY, n=300, outputs=["final(position)", ensemble.own(seen, ["position"], "seen")],
        executor=DaskExecutor(client), out=folder, chunk=10, progress=progress,
    )  # fmt: skip


def test_a_study_whose_workers_are_killed_has_the_results_of_an_undisturbed_one(client, tmp_path):
    victims = list(client.run(os.getpid).values())

    def kill_two():
        for pid in victims[:2]:
            os.kill(pid, signal.SIGKILL)

    disturbed = study(tmp_path / "study", client, tmp_path / "asked", after=(100, kill_two))
    alone = pn.simulate_many(DRIVE, 1.0, "0.02 s", vary=VARY, n=300, outputs=["final(position)"])
    assert (disturbed.final_position == alone.final_position).all()
    assert (disturbed.seen == alone.final_position).all()
    assert len(list((tmp_path / "study").glob("members-*.parquet"))) == 30
    assert len(list((tmp_path / "asked").iterdir())) >= 30


def test_an_interrupted_study_resumes_and_runs_nothing_twice(client, tmp_path):
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(tmp_path / "study", client, tmp_path / "asked", after=(120, stop))
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "study").glob("members-*.parquet")}
    assert 12 <= len(kept) < 30
    resumed = study(tmp_path / "study", client, tmp_path / "again")
    assert len(list((tmp_path / "again").iterdir())) == 30 - len(kept)
    assert all(path.stat().st_mtime_ns == then for path, then in kept.items())
    alone = pn.simulate_many(DRIVE, 1.0, "0.02 s", vary=VARY, n=300, outputs=["final(position)"])
    assert (resumed.final_position == alone.final_position).all()
