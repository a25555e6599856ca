"""A force sensor's calibration as a curve: a known curve is taken out, and what it leaves open no mean takes away."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from oracle.campaigns import World, write_campaign
from pneudrive.characteristics import campaign_friction
from pneudrive.errors import CampaignError, LayoutError
from pneudrive.friction.level import systematic_budget
from pneudrive.signals.force_calibration import ForceCalibration
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import si_columns
from pneudrive.signals.recording import Recording
from unit.signals.test_bad_recordings import TEXT

REFERENCE = (-200.0, -60.0, -20.0, 0.0, 20.0, 60.0, 200.0)
SHOWN = (-204.0, -61.0, -20.5, 0.4, 21.1, 61.2, 202.0)
QUICK = {"samples": 300, "speeds_m_s": (0.001, 0.01, 0.05, 0.2), "cycle_share": 0.002, "zero_n": 0.0}


def shown_by(folder: Path, sensor, **curve) -> Path:
    """Let a sensor show the forces of a campaign, and state its calibration."""
    for file in sorted((folder / "cycles").iterdir()):
        head = pl.read_parquet_metadata(file)["pneudrive"]
        table = pl.read_parquet(file)
        force, step = table["force_n"].to_numpy(), table["step"].to_numpy()
        moves = "sweep" in head or "sentinel" in head
        direction = np.where(step == 0, 1.0, -1.0) if moves else np.zeros(force.size)
        table = table.with_columns(force_n=pl.Series(sensor(force, direction)))
        table.write_parquet(file, metadata={"pneudrive": head})
    rig = json.loads((folder / "rig.json").read_text())
    (folder / "rig.json").write_text(json.dumps(rig | ({"force_calibration": curve} if curve else {})))
    return folder


def curves(folder: Path) -> dict[int, np.ndarray]:
    found = campaign_friction(folder, processes=1)
    return {c.direction: c.friction_n[c.measured] for c in found.curves}


def test_a_known_curve_is_taken_out_of_the_force(tmp_path):
    """A bent curve with a step at zero would make friction 2 % and directions differ; nothing of it is left."""
    straight = curves(write_campaign(tmp_path / "straight", World(**QUICK), 3))
    bent = write_campaign(tmp_path / "bent", World(**QUICK), 3)
    shown_by(bent, lambda f, _: np.interp(f, REFERENCE, SHOWN), reference_n=REFERENCE, shown_n=SHOWN)
    corrected = curves(bent)
    for direction, friction in straight.items():
        assert corrected[direction] == pytest.approx(friction, rel=1e-6)
    (bent / "rig.json").write_text((tmp_path / "straight" / "rig.json").read_text())
    assert np.abs(curves(bent)[0] / straight[0] - 1.0).min() > 0.01


def test_gain_and_zero_are_a_curve_too_and_the_last_piece_goes_on():
    line = ForceCalibration(gain=1.02, zero_n=-0.3)
    points = ForceCalibration((-10.0, 10.0), (-10.5, 9.9))
    for force in (-7.0, 0.0, 9.0, 50.0):
        assert line.force_n(1.02 * force - 0.3) == pytest.approx(force)
        assert points.force_n(1.02 * force - 0.3) == pytest.approx(force)
        assert points.applied().force_n(force) == force


@pytest.mark.parametrize("repeats", [1, 4])
def test_hysteresis_is_half_the_loop_in_each_direction_however_many_cycles(tmp_path, repeats):
    """A rising force is shown too low by h/2, a falling one too high: all of it is in friction, none is averaged."""
    h, plan = 1.2, QUICK | {"repeats": repeats}
    straight = curves(write_campaign(tmp_path / "straight", World(**plan), 3))
    looped = write_campaign(tmp_path / "looped", World(**plan), 3)
    shown_by(looped, lambda f, direction: f - 0.5 * h * direction, hysteresis_n=h)
    found = campaign_friction(looped, processes=1)
    for curve in found.curves:
        m = curve.measured
        off = curve.friction_n[m] - straight[curve.direction]
        assert off == pytest.approx(-0.5 * h, rel=0.05)  # the curves are smoothed in proportion
        assert curve.u_systematic_n[m].min() >= h / 2.0 / np.sqrt(3.0)
        assert ((curve.low_n[m] <= straight[curve.direction]) & (straight[curve.direction] <= curve.high_n[m])).all()
    (source,) = [s for s in found.sources if s.name == "force sensor, hysteresis"]
    assert source.standard_uncertainty_n == pytest.approx(h / 2.0 / np.sqrt(3.0))


def test_what_the_certificate_leaves_open_is_named_in_the_budget():
    known = ForceCalibration(
        u_gain=0.002, u_zero_n=0.3, linearity_n=0.6, hysteresis_n=0.4, creep_n=0.5, range_n=100.0, certificate="K 7"
    )
    t = np.linspace(0.0, 1.0, 50)
    recording = Recording("run", t, t, 40.0 * np.sign(t - 0.5), 1e5, 1e5, 5e-4, 5e-4, force_calibration=known)
    still = {"pressure_a_pa": 1e5, "pressure_b_pa": 1e5, "parallel_n": 0.0, "late_n": 0.0}
    up, down = ({"force_n": f, "velocity_m_s": v} | still for f, v in ((45.0, 0.1), (-35.0, -0.1)))
    lines = {e.source: e for e in systematic_budget(recording, up, down) if e.source.startswith("force: ")}
    friction = {name: (e.friction_n, e.offset_n) for name, e in lines.items()}
    third = 1.0 / np.sqrt(3.0)
    assert friction["force: gain"] == pytest.approx((0.002 * 40.0, 0.002 * 5.0))
    assert friction["force: linearity"] == pytest.approx((0.6 * third, 0.6 * third))
    assert friction["force: hysteresis"] == pytest.approx((0.2 * third, 0.2 * third))
    assert friction["force: creep"] == pytest.approx((0.5 * third * 0.4, 0.5 * third * 0.05))
    assert friction["force: zero"] == (0.0, 0.3)
    assert {e.note for e in lines.values()} == {"K 7"}


LAYOUT = TEXT.replace('"N"', '"kN", positive = "-x"') + "[force_calibration]\n"


def test_a_layout_corrects_what_the_sensor_shows_before_it_turns_the_sign():
    text = LAYOUT + 'reference = ["0 N", "50 N", "100 N"]\nshown = ["1 N", "52 N", "104 N"]\ndate = 2026-03-01\n'
    said = Layout.loads(text).for_file(Path("run.csv"))
    shown = {"time": np.arange(3.0), "force": np.array([0.001, 0.052, 0.078])}
    assert si_columns(said, shown)["force_n"] == pytest.approx([0.0, -50.0, -75.0])
    assert said.force_calibration.words() == "2026-03-01"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('reference = ["0 N", "50 N"]\nshown = ["1 N"]', "2 reference forces and 1 displayed"),
        ('reference = ["0 N", "50 N"]\nshown = ["1 N", "0.9 N"]', "do not increase"),
        ('reference = ["0 N", "50 N"]\nshown = ["0 N", "500 N"]', "10 N per N"),
        ('hysteresis = "0.1 mm"', "force_calibration"),
        ('hysterisis = "0.1 N"', "Did you mean"),
        ('creep = "0.1 N"', "needs a range"),
    ],
)
def test_what_is_no_calibration_is_refused_with_its_place(lines, words):
    with pytest.raises(LayoutError) as error:
        Layout.loads(LAYOUT + lines + "\n", "bench.toml")
    assert words in str(error.value)
    assert "bench.toml:" in str(error.value)


def test_rig_json_is_checked_too(tmp_path):
    folder = shown_by(write_campaign(tmp_path / "c", World(**QUICK), 3), lambda f, _: f, gain=-1.0)
    with pytest.raises(CampaignError, match="shows -1 N per N"):
        campaign_friction(folder, processes=1)
