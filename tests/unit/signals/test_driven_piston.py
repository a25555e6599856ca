"""A test machine drags a gas spring: a ram in parallel, set speeds one way, and units that contradict the header."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneudrive.characterise import Layout, load_recordings
from pneudrive.errors import PneudriveWarning
from pneudrive.friction.characterisation import characterise_recordings
from pneudrive.signals.motion import Stroke, speed_levels
from pneudrive.signals.proposal import propose_layout

HEAD = "#t(s),Pos(in),LowerHyd(psig),UpperHyd(psig),LowerPressure(psia),UpperPressure(psia),Force(lbs)"
LAYOUT = (Path(__file__).parents[2] / "data" / "driven_piston_layout.toml").read_text("utf-8")
PSI, INCH, LBF, AREA_M2 = 6894.757293168361, 0.0254, 4.4482216152605, 9e-4


@pytest.fixture
def spring(tmp_path):
    """Write closed chambers at constant temperature, 300 N of friction, and a ram that carries part of the force."""
    t = np.arange(0.0, 120.0, 0.05)
    x = 0.3 + 1.2 * np.abs((t / 15.0) % 2.0 - 1.0)
    way = np.sign(np.gradient(x))
    pressure_a, pressure_b = (2.0e5 / (0.03 + 0.0127 * x), 9.0e3 / (0.04 + 0.0115 * (2.0 - x)))
    p1, p2 = (2e6 + 1e6 * way) / PSI, 1e6 * (1 + 0.1 * np.sin(t)) / PSI
    gas = 0.0115 * (pressure_b - 101325.0) - 0.0127 * (pressure_a - 101325.0)
    force = gas + 300.0 * way + AREA_M2 * (p1 - p2) * PSI
    rows = np.column_stack([t, x / INCH, p1, p2, pressure_b / PSI, pressure_a / PSI, force / LBF])
    path = tmp_path / "spring.exp"
    path.write_text("\n".join([HEAD, *(" ".join(f"{v:.8f}" for v in row) for row in rows)]) + "\n", encoding="utf-8")
    return path, way


def test_the_balance_contains_the_ram(spring):
    path, way = spring
    recording = load_recordings([path], Layout.loads(LAYOUT))[0]
    assert recording.balance_n() == pytest.approx(300.0 * way, abs=0.1)
    (ram,) = recording.parallel
    assert (ram.name, ram.area_m2, ram.uncertainty) == ("ram", pytest.approx(AREA_M2), 0.04)
    half = recording.at(np.arange(len(recording)) % 2 == 0)
    assert half.balance_n() == pytest.approx(recording.balance_n()[::2])


def test_a_layout_is_proposed_with_both_chambers(spring):
    path, _ = spring
    proposal = propose_layout(path)
    assert proposal.problem == ""
    for line in (
        'position = { column = "Pos(in)", unit = "in" }',
        'pressure_a = { column = "UpperPressure(psia)", unit = "psi abs" }',
        'pressure_b = { column = "LowerPressure(psia)", unit = "psi abs" }',
        'unit = "lbf", positive = "+x" }',
        "# not used: LowerHyd(psig), UpperHyd(psig)",
    ):
        assert line in proposal.text


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ('(psia)", unit = "psi abs"', '(psia)", unit = "psi gauge"', "psi abs in the file, but in psi gauge"),
        ('(in)", unit = "in"', '(in)", unit = "mm"', "in in the file, but in mm"),
        ('(lbs)", unit = "lbf"', '(lbs)", unit = "N"', "lbf in the file, but in N"),
        ('position = { column = "Pos(in)"', 'position = { column = "LowerHyd(psig)"', "psi in the file"),
    ],
)
def test_a_unit_that_contradicts_the_header_is_flagged(spring, right, wrong, words):
    with pytest.warns(PneudriveWarning, match="in the file") as found:
        load_recordings([spring[0]], Layout.loads(LAYOUT.replace(right, wrong)))
    assert any(words in str(one.message) for one in found)


def test_speeds_that_are_set_one_way_only_are_levels_of_that_way():
    out, back = np.linspace(0.05, 0.6, 12), -0.16 + 0.11 * np.exp(-np.arange(12.0))
    speeds = np.column_stack([out, back]).ravel()
    strokes = [Stroke(i, 1 if v > 0 else -1, 0, 9, 0.0, 2.0, v, 0.0) for i, v in enumerate(speeds)]
    levels = speed_levels(strokes)
    assert [[s.index for s in level] for level in levels[:12]] == [[2 * i] for i in range(12)]
    assert all(s.direction == -1 for level in levels[12:] for s in level)
    # The same speeds in random order are scatter, not steps.
    order = np.random.default_rng(3).permutation(12)
    speeds = np.column_stack([out[order] / out[order].mean(), back[order]]).ravel() * 0.1
    shuffled = [Stroke(i, 1 if v > 0 else -1, 0, 9, 0.0, 2.0, v, 0.0) for i, v in enumerate(speeds)]
    assert len(speed_levels(shuffled)) == 1


def test_returns_of_the_set_speed_share_its_class_and_slower_ones_do_not():
    """Set speeds in steps after a first stroke at another one; the fast returns lag (a public case)."""
    out = [0.1, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.349, 0.39, 0.441, 0.484, 0.517, 0.545]
    back = [0.1, 0.05, 0.1, 0.15, 0.2, 0.25, 0.297, 0.341, 0.38, 0.417, 0.429, 0.435, 0.429]
    speeds = np.column_stack([out, -np.array(back)]).ravel()
    strokes = [Stroke(i, 1 if v > 0 else -1, 0, 9, 0.0, 2.0, v, 0.0) for i, v in enumerate(speeds)]
    levels = [[s.index for s in level] for level in speed_levels(strokes)]
    assert levels[:8] == [[2, 3], [0, 1, 4, 5], *([2 * i, 2 * i + 1] for i in range(3, 9))]
    assert levels[8:] == [[18], [20], [22], [24], [19, 21, 23, 25]]


def test_a_delay_that_closed_chambers_show_is_removed():
    """Pressures of a real gas spring that come 0.3 s later raised its friction by 13 to 67 %, without a word."""
    folder = Path(__file__).resolve().parents[3] / "data" / "measurements" / "mbari-2022-gas-spring"
    (charged,) = load_recordings([folder / "charged.exp.xz"], folder / "layout.toml")
    time = charged.time_s
    late = {name: np.interp(time - 0.3, time, getattr(charged, name)) for name in ("pressure_a_pa", "pressure_b_pa")}
    before, after = (characterise_recordings(one) for one in (charged, replace(charged, **late)))
    moved = after.results[0].delay.value_s - before.results[0].delay.value_s
    assert moved == pytest.approx(0.3, abs=0.01)
    assert f"{after.results[0].delay}. The closed chambers show this delay. It is removed" in " ".join(after.notes)
    assert not any("delay" in note for note in before.notes)
    for first, second in zip(before.levels, after.levels, strict=True):
        assert second.friction_n == pytest.approx(first.friction_n, rel=0.05)
        (clock,) = (entry for entry in second.budget if entry.source == "clocks of several loggers")
        assert clock.standard_uncertainty == pytest.approx(0.015)


def test_the_budget_contains_an_error_of_the_ram_and_of_the_clock(spring):
    recording = load_recordings([spring[0]], Layout.loads(LAYOUT))[0]
    ram = recording.parallel[0]
    wider = replace(recording, parallel=(ram._replace(force_n=1.04 * ram.force_n),))
    late = {
        f"pressure_{side}_pa": np.interp(recording.time_s - 0.03, recording.time_s, values)
        for side, values in (("a", recording.pressure_a_pa), ("b", recording.pressure_b_pa))
    }
    (level,) = characterise_recordings([recording]).levels
    assert {"areas of parallel forces", "clocks of several loggers"} <= {entry.source for entry in level.budget}
    for changed in (wider, replace(recording, **late)):
        (other,) = characterise_recordings([changed]).levels
        assert abs(other.friction_n - level.friction_n) < level.expanded_n
