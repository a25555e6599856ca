"""A campaign folder that somebody else wrote, as docs/reference/campaign-folder.md tells, is read and characterised."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pneudrive.campaign.cycle import KINDS, Cycle, Head
from pneudrive.campaign.running.attempt import FLAGS
from pneudrive.campaign.storage.folder import COLUMNS, Campaign, preliminary_frictions, status_of
from pneudrive.friction.campaign.reading import read_part
from pneudrive.friction.strokes import Settled
from pneudrive.rig.interface import Identity

PAGE = (Path(__file__).parents[2] / "docs/reference/campaign-folder.md").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Run the page's example."""
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(code.splitlines()) <= 32
    exec(compile(code, "campaign-folder.md", "exec"), {})
    return tmp_path / "my-campaign"


def test_the_example_of_the_page_is_a_campaign(folder):
    campaign = Campaign.open(folder)
    assert campaign.checked()[1] == []
    assert campaign.identity.labels == {"seal": "B"}
    for file, speed in zip(campaign.cycles(), [0.005, 0.02, 0.1], strict=True):
        assert file.head.cycle.key == f"sweep-{1e3 * speed:g}"
        assert (file.head.cycle.speed_m_s, file.head.cycle.pressure_a_pa) == (speed, 150900.0)
        samples = file.samples()
        assert np.isnan(samples.temperature_k).all()
        assert set(samples.pressure_b_pa) == {150900.0}
        assert np.mean(samples.step == np.repeat([0, 1], 2000)) > 0.99
        (friction,) = preliminary_frictions([file], campaign.identity)
        assert friction == pytest.approx(18.0 + 40.0 * speed, abs=0.05)
    assert status_of(folder).planned is None


def test_the_page_names_every_key_kind_flag_and_column():
    names = {
        *COLUMNS,
        *KINDS,
        *FLAGS,
        *Identity.__dataclass_fields__,
        *Head.__dataclass_fields__,
        *Cycle.__dataclass_fields__,
    }
    assert [name for name in sorted(names) if f"`{name}`" not in PAGE] == []
    for kind in KINDS:
        assert f"| `{kind}` |" in PAGE
    for flag, what in FLAGS.items():
        assert f"| `{flag}` | {what} |" in PAGE


def test_steps_are_derived_only_where_a_result_needs_them(folder, monkeypatch):
    """Deriving them from the motion takes as long as all else that is done with a sweep."""
    from pneudrive.campaign.storage import folder as module

    derived = []
    derive = module.steps_from_motion
    monkeypatch.setattr(module, "steps_from_motion", lambda *given: derived.append(1) or derive(*given))
    files, _ = Campaign.open(folder).scan()
    with_steps, without = list(module.read_samples(files)), list(module.read_samples(files, ("tare",)))
    assert len(derived) == len(files) == 3
    for one, other in zip(with_steps, without, strict=True):
        assert set(one.step) == {0, 1}
        assert set(other.step) == {-1}
        assert np.array_equal(one.force_n, other.force_n)
    edges = np.linspace(0.0, 0.2, 61)
    derived.clear()
    read_part(files, Campaign.open(folder).identity, Settled(), edges)
    assert derived == []
