"""Lag and gain from command to pressure: they return with intervals, and what is not determined is named."""

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from pneudrive.errors import FitError
from pneudrive.identify.volume import Regulator, identify_regulator
from pneudrive.signals.drive_recording import volume_recording

DATA = Path(__file__).parents[3] / "data/measurements/affetto-2024"
START = {"regulator": {"full_pressure": "600 kPa gauge", "lag": "100 ms"}}


def run(seed, filling=0.2, venting=0.3, gain=5e5, zero=1.2e5):
    """Return random steps of the command and the pressure behind the lag, integrated in steps of 0.1 ms."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0.0, 10.0, 1e-4)
    command = np.repeat(rng.uniform(0.1, 0.9, 25), fine.size // 25)
    p = np.empty(fine.size)
    p[0] = 1e5
    for k, u in enumerate(command[:-1]):
        goal = zero + gain * u
        p[k + 1] = p[k] + 1e-4 * (goal - p[k]) / (filling if goal > p[k] else venting)
    kept = slice(None, None, 100)
    noisy = p[kept] + rng.normal(0.0, 500.0, p[kept].size)
    return volume_recording({"time_s": fine[kept], "pressure_pa": noisy, "command": command[kept]}, f"run {seed}")


def test_gain_and_both_lags_return():
    fit = identify_regulator(Regulator.model_validate(START), [run(seed) for seed in range(3)])
    assert list(fit.values.values()) == pytest.approx([5e5, 1.2e5, 0.2, 0.3], rel=0.03)
    for name, value in zip(fit.values, (5e5, 1.2e5, 0.2, 0.3), strict=True):
        low, high = fit.intervals[name]
        assert low - 0.03 * value <= value <= high + 0.03 * value
    assert max(fit.statistics[key] for key in ("rms", "predicted")) < 0.02
    with pytest.raises(FitError, match=r"a fit of a regulator has no profile likelihood"):
        fit.profile()
    alone = identify_regulator(Regulator.model_validate(START), [run(0)])  # one recording is enough
    assert list(alone.values.values()) == pytest.approx([5e5, 1.2e5, 0.2, 0.3], rel=0.05)


def test_a_command_that_does_not_change_is_refused():
    one = run(1)
    still = volume_recording({"time_s": one.time_s, "pressure_pa": one.pressure_pa, "command": 0 * one.time_s + 0.5})
    with pytest.raises(FitError, match="the command does not change"):
        identify_regulator(Regulator.model_validate(START), [still])


def test_a_fit_is_validated_on_further_runs(tmp_path, monkeypatch, capsys):
    runs = sorted(DATA.glob("run_*.csv.xz"))
    layout = DATA / "joint_5_a.toml"
    fit = pn.identify_regulator(DATA / "regulator.toml", runs[:3], layout)
    monkeypatch.chdir(tmp_path)
    fit.to_toml("lag.toml")
    checked = pn.validate(fit, runs[2:4], layout=layout)
    assert [r["badge"] for r in checked.runs] == ["made the fit", "held out"]
    assert 2.0 < checked.runs[1]["percent"] < 6.0
    assert checked.runs[1]["rms_pa"] == pytest.approx(checked.runs[1]["percent"] * 4400.0, rel=0.3)
    assert not run_command(["validate", "lag.toml", str(runs[3]), "--layout", str(layout), "--out", "check"])
    shown = capsys.readouterr().out
    assert f"largest rms, run_003 {checked.runs[1]['rms_pa'] / 1e5:.3g} bar" in shown
    assert "held out" in shown
    assert not run_command(["validate", "lag.toml", str(runs[0]), "--layout", str(layout), "--out", "check"])
    assert "no recording was held out" in capsys.readouterr().out


@pytest.mark.parametrize("side", ["a", "b"])
def test_joints_of_a_humanoid(side, tmp_path):
    """Each run is predicted from the other five within 5 % of the range; gain and offset are not separated."""
    runs = sorted(DATA.glob("run_*.csv.xz"))
    fit = identify_regulator(DATA / "regulator.toml", runs, DATA / f"joint_5_{side}.toml")
    assert len(fit.runs) == 6
    assert fit.statistics["predicted"] < 0.05
    assert 0.14 < fit.values["filling_s"] < 0.22
    assert fit.statistics["correlation"] < -0.95
    said = " ".join(fit.undetermined)
    for words in ("dead time is not determined", "gain and offset are not separated", "conductance"):
        assert words in said
    fit.to_toml(tmp_path / "lag.toml")
    assert "conductance" not in (tmp_path / "lag.toml").read_text("utf-8").partition("[values")[2]
