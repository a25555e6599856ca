"""A campaign folder plays back as a rig: the same campaign to the bit, and nothing made up."""

from __future__ import annotations

import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneudrive.campaign.run import run_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characteristics import characterise
from pneudrive.errors import RigError
from pneudrive.rig import Changeable, Hold, Move, Reproducible, Rig, Samples, Sampling, load_rig


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns") / "recorded"
    run_campaign("quick-look", "default", folder)
    return folder


def test_a_campaign_again(recorded, tmp_path):
    rig = load_rig(recorded)
    assert isinstance(rig, Rig)
    assert isinstance(rig, Reproducible)
    assert isinstance(rig, Changeable)
    again = run_campaign("quick-look", str(recorded), tmp_path / "again").campaign
    original = Campaign.open(recorded)
    assert (again.identity, again.synthetic) == (original.identity, True)
    for a, b in zip(original.cycles(), again.cycles(), strict=True):
        assert (a.name, a.head.sha256, a.head.flags) == (b.name, b.head.sha256, b.head.flags)
        assert a.head.began_s == b.head.began_s
        truths = [(folder / "truth" / f"{a.name}.json").read_text() for folder in (recorded, tmp_path / "again")]
        assert truths[0] == truths[1]
    assert characterise(tmp_path / "again").identical(characterise(recorded))


def test_real_time_and_stop(recorded):
    file = next(file for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    cycle, samples = file.head.cycle, file.samples()
    rig = load_rig(recorded, pace=20.0)
    rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
    began = time.monotonic()
    played = Samples.join(list(rig.acquire(cycle.steps, cycle.sampling)))
    assert time.monotonic() - began == pytest.approx(samples.time_s[-1] / 20.0, rel=0.2, abs=0.3)
    assert np.array_equal(played.force_n, samples.force_n)
    assert rig.state().position_m == samples.position_m[-1]
    parts = rig.acquire(cycle.steps, cycle.sampling)
    next(parts)
    rig.stop()
    with pytest.raises(RigError, match="stopped"):
        next(parts)
    assert not rig.state().moving


def test_what_was_not_recorded_is_refused(recorded):
    rig = load_rig(recorded)
    cycle = next(file.head.cycle for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    rig.begin_cycle(cycle.key)
    rig.set_pressure(3e5, 3e5)
    with pytest.raises(
        RigError, match=r"(?s)no recording matches the cycle.*3 and 3 bar abs.*nearest: .*within 20 mbar"
    ):
        rig.acquire(cycle.steps, Sampling())
    rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
    out, *rest = cycle.steps
    for steps in (
        [Move(out.to_m, 1.2 * out.speed_m_s), *rest],
        [out],
        [out, Hold(1.0), *rest],
        [Move(0.1, out.speed_m_s), *rest],
    ):
        with pytest.raises(RigError, match="no recording matches"):
            rig.acquire(steps, Sampling())
    assert len(Samples.join(list(rig.acquire(cycle.steps, Sampling())))) > 1000


def test_a_campaign_that_somebody_else_wrote(recorded, tmp_path):
    """Only what the format requires: no steps, no envelope; the cycles are found by speed, stop and pressure."""
    import json
    import shutil

    import polars as pl

    shutil.copytree(recorded, tmp_path / "plain")
    (tmp_path / "plain" / "campaign.json").write_text("{}")
    for path in (tmp_path / "plain" / "cycles").iterdir():
        cycle = json.loads(pl.read_parquet_metadata(path)["pneudrive"])["cycle"]
        needed = ("key", "kind", "pressure_a_pa", "pressure_b_pa", "speed_m_s", "stop_s")
        head = {"cycle": {name: cycle[name] for name in needed}}
        pl.read_parquet(path).write_parquet(path, metadata={"pneudrive": json.dumps(head)})
    rig = load_rig(tmp_path / "plain")
    low, high = load_rig(recorded).limits().position_m
    assert rig.limits().position_m == pytest.approx((low, high), abs=2e-3)  # less the margin
    for file in Campaign.open(recorded).cycles():
        cycle = file.head.cycle
        if cycle.kind in ("sweep", "stop"):
            rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
            played = Samples.join(list(rig.acquire(cycle.steps, cycle.sampling)))
            assert np.array_equal(played.force_n, file.samples().force_n)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('folder = "nowhere"', "nowhere is not a campaign folder"),
        ('folder = "x"\nlayout = "layout.toml"', "layout is not a known key"),
        ("", "folder is missing"),
        ('folder = "x"\nspeed_tolerance = "5"', r"speed_tolerance: '5' is not a share"),
        ('folder = "x"\ntolerance = "5 %"', "tolerance is not a known key"),
    ],
)
def test_rig_files_that_are_wrong(tmp_path, text, words):
    (tmp_path / "bench.toml").write_text(f'kind = "replay"\n{text}')
    with pytest.raises(RigError, match=words):
        load_rig(tmp_path / "bench.toml")


def test_a_folder_that_is_not_a_campaign(tmp_path):
    with pytest.raises(RigError, match=r"(?s)is not a campaign folder.*characterised without a campaign"):
        load_rig(tmp_path)


def test_a_rig_file_allows_other_speeds(recorded, tmp_path):
    cycle = next(file.head.cycle for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    steps = [replace(step, speed_m_s=1.2 * step.speed_m_s) for step in cycle.steps if isinstance(step, Move)]
    for tolerance, fits in (("5 %", False), ("40 %", True)):
        (tmp_path / "bench.toml").write_text(
            f'kind = "replay"\nfolder = "{recorded}"\nspeed_tolerance = "{tolerance}"\n'
        )
        rig = load_rig(tmp_path / "bench.toml")
        rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
        with nullcontext() if fits else pytest.raises(RigError, match="no recording matches"):
            assert list(rig.acquire(steps, Sampling()))
