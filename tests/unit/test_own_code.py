"""Python runs because the user of this run names it: never because it lies in the folder that one stands in."""

from __future__ import annotations

from pneudrive.batching import in_processes


def test_a_worker_process_imports_nothing_from_the_folder_one_stands_in(tmp_path, monkeypatch):
    for name in ("numpy", "polars", "pickle", "json", "pneudrive"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('it ran')")
    monkeypatch.chdir(tmp_path)
    assert in_processes(sorted, [([2, 1],)]) == [[1, 2]]
