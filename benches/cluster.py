"""Overhead of a chunk of a study: in this process, with a folder, and on a Dask cluster.

    .venv-extras/bin/python -m benches.cluster        (make test-extras sets that environment up)

A line for each size of chunk: seconds for each chunk of members that hardly run (1 ms of motion), one thread. The first
column subtracts the time of the members.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import pneudrive as pn

SIZES = {1: 300, 100: 200, 10_000: 10, 50_000: 3}  # members of a chunk -> chunks
VARY = {"cylinder.bore": "uniform(20 mm, 30 mm)", "load.mass": "uniform(0 kg, 5 kg)"}


def seconds(size: int, chunks: int, kept: bool = False, **options: object) -> float:
    """Time for each chunk, least of three studies."""
    drive, least = pn.Drive.load("catalogue:reference"), float("inf")
    for _ in range(3):
        with tempfile.TemporaryDirectory() as folder:
            out = {"out": Path(folder) / "study"} if kept else {}
            begun = time.perf_counter()
            pn.simulate_many(
                drive, 1.0, "1 ms", vary=VARY, n=size * chunks, chunk=size, rtol=1e-3, threads=1, **out, **options
            )
            least = min(least, time.perf_counter() - begun)
    return least / chunks


def main() -> None:
    """Print the table."""
    from distributed import Client, LocalCluster

    print(f"{'members':>8} {'in process':>12} {'with folder':>12} {'on Dask':>12}   s a chunk")
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        for size, chunks in SIZES.items():
            here = seconds(size, chunks)
            folder = seconds(size, chunks, kept=True)
            there = seconds(size, chunks, executor=pn.ensemble.DaskExecutor(client))
            print(f"{size:>8} {here:>12.5f} {folder:>12.5f} {there:>12.5f}")


if __name__ == "__main__":
    sys.exit(main())
