"""No sample of a recording is lost on the screen, at any width, with gaps, pauses and clocks that are set back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pneudrive.progress import UNWATCHED
from pneudrive.simulation.trajectory import save_columns
from pneudrive.web.measured.recordings import OpenRecording, Recordings, column_part
from pneudrive.web.measured.tiles import BLOCK, Pyramid
from pneudrive.web.workspace import Workspace
from waiting import until

RATE = 1000.0
COUNT = 1_000_003
PIXELS = 700
SPIKES = 1000


def columns(seed: int = 4) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return a recording of noise, and the rows of its spikes, each of one sample and another height."""
    chance = np.random.default_rng(seed)
    force = chance.normal(size=COUNT)
    spikes = np.sort(chance.choice(COUNT, SPIKES, replace=False))
    force[spikes] = np.where(np.arange(SPIKES) % 2, 1.0, -1.0) * (100.0 + np.arange(SPIKES))
    return {"time_s": np.arange(COUNT) / RATE, "force_n": force, "position_m": np.sin(np.arange(COUNT) / 5e4)}, spikes


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[OpenRecording, dict[str, np.ndarray], np.ndarray]:
    folder = tmp_path_factory.mktemp("long")
    table, spikes = columns()
    save_columns(table, {}, folder / "long.parquet")
    return opened(folder, "long.parquet"), table, spikes


def opened(folder: Path, name: str) -> OpenRecording:
    recordings = Recordings(Workspace.at(folder))
    until(lambda: recordings.opened(name).done())
    return recordings.need(name)


def test_no_spike_is_lost_in_150_windows(recorded: tuple) -> None:
    recording, table, spikes = recorded
    chance = np.random.default_rng(15)
    seen = kinds = 0
    for width in 10.0 ** chance.uniform(-1.0, 3.0, 150):
        begin = chance.uniform(0.0, COUNT / RATE - width)
        span = (begin, begin + width)
        time_s, channels, about = recording.window(span, PIXELS, ["force_n", "position_m"])
        assert len(time_s) <= 4 * PIXELS
        assert np.all(np.diff(time_s) >= 0.0)
        kinds |= 1 << about["raw"]
        heights = channels["force_n"]
        inside = spikes[(table["time_s"][spikes] >= span[0]) & (table["time_s"][spikes] <= span[1])]
        shown = set(np.float32(heights).tolist())
        for row in inside:
            height = np.float32(table["force_n"][row])
            rounded = {float(height), *(float(np.nextafter(height, np.float32(end))) for end in (-np.inf, np.inf))}
            assert shown & rounded or _hidden(row, table["force_n"], span)
            seen += 1
        if len(inside):
            rows = slice(np.searchsorted(table["time_s"], span[0]), np.searchsorted(table["time_s"], span[1], "right"))
            assert np.nanmax(heights) >= table["force_n"][rows].max()
            assert np.nanmin(heights) <= table["force_n"][rows].min()
    assert seen > 1000
    assert kinds == 3  # windows of samples, and windows of lowest and highest values


def _hidden(row: int, force: np.ndarray, span: tuple[float, float]) -> bool:
    """Whether a higher spike of the same sign lies in the same column of pixels."""
    reach = int(2 * (span[1] - span[0]) / PIXELS * RATE) + 2 * BLOCK
    near = force[max(row - reach, 0) : row + reach] * np.sign(force[row])
    return bool(near.max() > abs(force[row]))


def test_a_close_view_is_the_samples(recorded: tuple) -> None:
    recording, table, _ = recorded
    for end in (500_201, 2000 * BLOCK):  # the second view ends between two blocks
        span = (end - 201) / RATE, (end - 0.5) / RATE
        time_s, channels, about = recording.window(span, PIXELS, ["force_n"])
        rows = slice(end - 202, end + 1)  # one sample beyond each end
        assert about == {"missing": 0, "samples": 201, "raw": True}
        assert np.array_equal(time_s, table["time_s"][rows])
        assert np.array_equal(channels["force_n"], table["force_n"][rows])


def test_blocks_are_made_once_and_are_small(recorded: tuple, tmp_path: Path) -> None:
    recording, _, _ = recorded
    recording.pyramid.save(tmp_path / "kept")
    kept = Pyramid.open(tmp_path / "kept")
    assert kept is not None
    assert np.array_equal(kept.low, recording.pyramid.low)
    assert sum(path.stat().st_size for path in (tmp_path / "kept").iterdir()) < COUNT / BLOCK * 40
    (tmp_path / "kept" / "high.npy").write_bytes(b"")
    assert Pyramid.open(tmp_path / "kept") is None


def test_values_that_are_no_number_are_gaps_and_pauses_stay_visible(tmp_path: Path) -> None:
    table, _ = columns()
    table["time_s"] = np.where(np.arange(COUNT) < 500_000, table["time_s"], table["time_s"] + 300.0)
    table["force_n"][200_000:260_000] = np.nan
    table["force_n"][700_000] = np.inf
    save_columns(table, {}, tmp_path / "gaps.parquet")
    seconds, channels, about = opened(tmp_path, "gaps.parquet").window((0.0, 1300.0), PIXELS, ["force_n"])
    assert about["missing"] == 60_001
    values = channels["force_n"]
    assert np.isnan(values[(seconds > 202.0) & (seconds < 258.0)]).all()
    pause = (seconds > 503.0) & (seconds < 797.0)
    assert not pause.any()  # nothing is drawn there
    before = np.flatnonzero(seconds <= 503.0)[-1]
    assert np.isnan(values[before])  # and no line leads over it
    assert {*np.round(seconds[before + 1 : before + 3])} == {800.0}
    assert not np.isnan(values[(seconds > 300.0) & (seconds < 499.0)]).any()


def test_a_clock_that_was_set_back_is_said_and_samples_are_counted(tmp_path: Path) -> None:
    table, spikes = columns()
    table["time_s"][300_010:] -= 250.0
    save_columns(table, {}, tmp_path / "back.parquet")
    recording = opened(tmp_path, "back.parquet")
    assert recording.file.time is None
    assert "sample numbers replace it" in recording.file.notes[0]
    _, channels, _ = recording.window((0.0, float(COUNT)), PIXELS, ["force_n"])
    assert np.nanmax(channels["force_n"]) >= table["force_n"][spikes].max()


def test_rounding_is_outward() -> None:
    values = np.random.default_rng(1).normal(size=BLOCK * 50) * 10.0 ** np.repeat(np.arange(-25, 25), BLOCK)
    made = Pyramid.build(
        ["x"],
        len(values),
        lambda _, rows: (np.arange(*rows, dtype=float), {"x": values[slice(*rows)]}),
        UNWATCHED,
    )
    blocks = values.reshape(-1, BLOCK)
    assert np.all(made.low[0].astype(float) <= blocks.min(axis=1))
    assert np.all(made.high[0].astype(float) >= blocks.max(axis=1))
    assert np.allclose(made.high[0], blocks.max(axis=1), rtol=1e-6)


def test_a_view_beside_or_within_the_last_one_reads_nothing(recorded: tuple) -> None:
    recording, table, _ = recorded
    column_part.cache_clear()
    recording.window((500.0, 501.0), PIXELS, ["force_n"])
    begun = column_part.cache_info().misses
    for span in ((500.5, 501.5), (500.2, 500.4), (499.5, 500.5), (500.0, 500.01)):
        _, channels, _ = recording.window(span, PIXELS, ["force_n"])
        inside = (table["time_s"] >= span[0]) & (table["time_s"] <= span[1])
        assert np.nanmax(channels["force_n"]) >= table["force_n"][inside].max()
    assert column_part.cache_info().misses == begun
    recording.window((800.0, 801.0), PIXELS, ["position_m"])
    assert column_part.cache_info().misses > begun
