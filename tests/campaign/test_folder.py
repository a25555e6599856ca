"""A campaign folder loses nothing: each file is whole, or a named problem of its own while all others stay valid."""

from __future__ import annotations

import json
import math
import random
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from campaign.fake_rig import FakeRig, contents, protocol
from oracle.campaigns import rewrite
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.storage.folder import (
    Campaign,
    CycleFile,
    Head,
    create,
    read_samples,
    status_of,
    steps_from_motion,
    tidy,
    write_cycle,
)
from pneudrive.errors import CampaignError
from pneudrive.files import seal
from pneudrive.rig.interface import Move, Samples, Sampling

CYCLE = Cycle("b1/sweep/v50/r1", "sweep", (Move(0.1, 0.05), Move(0.0, 0.05)), Sampling(), 2e5, 1.5e5, speed_m_s=0.05)


def read_head(path) -> Head:
    files, problems = Campaign.open(path.parents[1]).scan()
    for problem in problems:
        if problem.lost and problem.where.endswith(path.name):
            raise CampaignError(problem.what)
    return next(file.head for file in files if file.path == path)


def some_samples(n: int = 300) -> Samples:
    rng = np.random.default_rng(1)
    channels = {name: rng.normal(size=n) for name in ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")}
    return Samples(time_s=np.arange(n) * 1e-3, temperature_k=np.full(n, 295.0), step=np.arange(n) // 150, **channels)


@pytest.fixture
def folder(tmp_path):
    """Write a campaign of three cycles."""
    campaign = create(tmp_path / "c", protocol().text, FakeRig().identity(), {"name": "three"})
    for index in (1, 2, 3):
        cycle = replace(CYCLE, key=f"b1/sweep/v{index}/r1")
        write_cycle(campaign.path, Head(index, cycle, memory={"clock_s": 0.1 + index}), some_samples())
    return campaign.path


def test_what_was_written_is_read_to_the_last_bit(folder):
    campaign = Campaign.open(folder)
    first = next(campaign.cycles())
    assert campaign.identity == FakeRig().identity()
    assert first.head.cycle.steps == CYCLE.steps
    assert first.head.memory == {"clock_s": 1.1}
    for name, values in vars(some_samples()).items():
        assert np.array_equal(getattr(first.samples(), name), values), name
    assert campaign.checked()[1] == []


def test_no_cycle_is_written_twice(folder):
    with pytest.raises(CampaignError, match="not written again"):
        write_cycle(folder, next(Campaign.open(folder).cycles()).head, some_samples())


def test_every_damage_is_found_and_others_stay_valid(folder):
    campaign = Campaign.open(folder)
    path = campaign.files()[1]
    whole, rng = path.read_bytes(), random.Random(7)
    head, samples = read_head(path), CycleFile(path, read_head(path)).samples()
    harmless = 0
    for attempt in range(150):
        damaged = bytearray(whole)
        if attempt % 2:
            damaged[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        else:
            del damaged[rng.randrange(len(whole)) :]
        path.write_bytes(damaged)
        try:
            found = CycleFile(path, read_head(path)).samples()
        except CampaignError:
            continue
        harmless += 1  # a letter in the name of the seal, which is then that of a foreign file
        assert read_head(path) == head
        assert all(np.array_equal(getattr(found, name), getattr(samples, name)) for name in vars(samples))
    assert harmless <= 4
    path.write_bytes(whole[: len(whole) // 2])
    assert [problem.where for problem in campaign.checked()[1]] == [f"cycles/{path.name}"]
    assert [file.head.index for file in campaign.cycles()] == [1, 3]


@pytest.mark.parametrize(
    ("content", "what"),
    [(b"", "empty"), (b"time;force\n1;2\n" * 10, "not a Parquet file"), (None, "has no head")],
)
def test_a_foreign_file_is_a_problem_of_its_own(folder, content, what):
    path = folder / "cycles" / "00009-foreign.parquet"
    if content is None:
        pl.DataFrame({"a": [1.0]}).write_parquet(path)
    else:
        path.write_bytes(content)
    campaign = Campaign.open(folder)
    assert what in str(campaign.checked()[1][0])
    assert len(list(campaign.cycles())) == 3


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"kind": "swep"}, "Did you mean 'sweep'|not known"),
        ({"speed_m_s": None}, "cycle.speed_m_s is missing"),
        ({"pressure_a_pa": None}, "cycle.pressure_a_pa is missing"),
        ({"pressure_b_pa": -1.0}, "positive"),
        ({"speed_m_s": "50 mm/s"}, "the value is a number"),
        ({"steps": [{"to": 1.0}]}, "a step needs either to_m and speed_m_s, or duration_s"),
        ({"steps": [{"to_m": "far", "speed_m_s": 0.1}]}, "cycle.steps.0.to_m = 'far'"),
    ],
)
def test_a_wrong_head_says_what_is_wrong(folder, change, what):
    path = Campaign.open(folder).files()[0]
    rewrite(path, **change)
    with pytest.raises(CampaignError, match=what):
        read_head(path)


def test_samples_that_do_not_fit_their_digest_are_refused(folder):
    path = Campaign.open(folder).files()[0]
    rewrite(path, lambda table: table.with_columns(pl.col("force_n") + 1e-12))
    with pytest.raises(CampaignError, match="SHA-256"):
        CycleFile(path, read_head(path)).samples()


def test_a_rig_may_be_rigid_and_its_sensors_without_limits(tmp_path):
    identity = replace(FakeRig().identity(), stiffness_n_m=math.inf, limits={"force_n": (-math.inf, math.inf)})
    assert create(tmp_path / "c", "", identity, {}).identity == identity


def test_one_cycle_in_two_files_counts_once(folder):
    first = Campaign.open(folder).files()[0]
    first.with_name("00004-copy.parquet").write_bytes(first.read_bytes())
    campaign = Campaign.open(folder)
    assert len(list(campaign.cycles())) == 3
    assert "in 00001-b1_sweep_v1_r1.parquet already" in str(campaign.checked()[1][0])


def test_tidying_removes_leftovers_and_keeps_damaged_files_aside(folder):
    campaign = Campaign.open(folder)
    (folder / "cycles" / "00004-x.parquet.part").write_bytes(b"half")
    campaign.files()[1].write_bytes(b"PAR1")
    files, done = tidy(campaign)
    assert [file.head.index for file in files] == [1, 3]
    assert len(done) == 2
    assert sorted(p.name for p in (folder / "cycles").iterdir() if p.suffix != ".parquet") == [
        "00002-b1_sweep_v2_r1.parquet.damaged"
    ]
    assert contents(folder).keys() == {"b1/sweep/v1/r1", "b1/sweep/v3/r1"}


def test_a_folder_with_something_else_is_not_touched(tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(CampaignError, match="not empty"):
        create(tmp_path, "", FakeRig().identity(), {})
    with pytest.raises(CampaignError, match="not a campaign folder"):
        Campaign.open(tmp_path)


@pytest.mark.parametrize(("speed_m_s", "stop_s"), [(1e-3, 0.1), (0.45, 15.0)])
def test_steps_are_told_from_the_motion(speed_m_s, stop_s):
    """Out, a stop in the middle of the way, on, and back: 0 1 2 3, whatever the rate of the samples."""
    rng = np.random.default_rng(0)
    legs = [(0.0, 0.05, 0.05 / speed_m_s), (0.05, 0.05, stop_s), (0.05, 0.1, 0.05 / speed_m_s), (0.1, 0.0, 1.0)]
    time, position, truth, begin = [], [], [], 0.0
    for number, (start, end, length) in enumerate(legs):
        n = 2000 if number != 1 else max(int(20 * length), 30)
        time.append(begin + np.arange(n) / n * length)
        position.append(np.linspace(start, end, n, endpoint=False))
        truth.append(np.full(n, number))
        begin += length
    position = np.concatenate(position)
    found = steps_from_motion(np.concatenate(time), position + 1e-6 * rng.standard_normal(position.size))
    wrong = found != np.concatenate(truth)
    assert found.max() == 3
    assert wrong.mean() < 0.02


def test_pressures_that_are_not_measured_are_those_of_the_cycle(folder):
    path = Campaign.open(folder).files()[0]
    head = pl.read_parquet_metadata(path)["pneudrive"].replace('"sha256"', '"digest"')
    pl.read_parquet(path).drop("pressure_b_pa", "temperature_k").write_parquet(path, metadata={"pneudrive": head})
    samples = CycleFile(path, read_head(path)).samples()
    assert set(samples.pressure_b_pa) == {1.5e5}
    assert np.isnan(samples.temperature_k).all()
    assert "digest is ignored" in str(Campaign.open(folder).checked()[1][0])


def test_status_says_whose_samples_no_checksum_proves(folder):
    rewrite(Campaign.open(folder).files()[1])
    assert "1 of 3 files have no checksum" in str(status_of(folder).problems[0])


def test_files_without_a_seal_give_the_same_samples(folder):
    campaign = Campaign.open(folder)
    before = contents(folder)
    for path in campaign.files():
        rewrite(path)
    files, _ = campaign.scan()
    samples = list(read_samples(files))
    assert contents(folder) == before
    assert all(np.array_equal(s.force_n, f.samples().force_n) for s, f in zip(samples, files, strict=True))


def test_a_head_that_its_bytes_do_not_show_is_read_by_the_library(folder):
    campaign = Campaign.open(folder)
    path = campaign.files()[1]
    head = pl.read_parquet_metadata(path)["pneudrive"]
    pl.read_parquet(path).write_parquet(path, metadata={"x": "\x18\x09pneudrive\x18", "pneudrive": head})
    files, problems = campaign.scan()
    assert [file.sealed for file in files] == [True, False, True]
    assert files[1].head.cycle.key == json.loads(head)["cycle"]["key"]
    assert not problems


@pytest.mark.parametrize("damage", ["footer", "column"])
def test_a_damaged_file_costs_no_other(folder, monkeypatch, damage):
    campaign = Campaign.open(folder)
    for path in campaign.files()[:2]:
        rewrite(path)
    if damage == "footer":
        path.write_bytes(path.read_bytes()[:-100] + b"\xff" * 80 + path.read_bytes()[-20:])
    else:  # polars panics
        read = pl.read_parquet_metadata

        def opened(other):
            if other.name == path.name:
                raise pl.exceptions.PanicException("index out of bounds")
            return read(other)

        monkeypatch.setattr(pl, "read_parquet_metadata", opened)
    files, problems = campaign.checked()
    assert [file.head.index for file in files] == [1, 3]
    assert [problem.where for problem in problems] == ["cycles/00002-b1_sweep_v2_r1.parquet"]
    assert "Parquet" in str(problems[0])


def test_a_file_that_is_taken_away_meanwhile_costs_no_other(folder, monkeypatch):
    files, _ = Campaign.open(folder).scan()
    look = seal.look

    def looked(path, size):
        found = look(path, size)
        if path.name.startswith("00002"):
            path.unlink()
        return found

    monkeypatch.setattr(seal, "look", looked)
    first, second, third = read_samples(files)
    assert isinstance(second, CampaignError)
    assert "no such file" in second.what
    assert len(first) == len(third) == 300
