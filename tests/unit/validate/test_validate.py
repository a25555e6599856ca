"""A model is judged by free runs: the true one passes, a wrong one does not, from foreign records as from own ones."""

from __future__ import annotations

import re
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.drive_records import drive, record
from pneudrive.errors import Cancelled, FitError, LayoutError, RecordingError
from pneudrive.signals.drive_recording import drive_recording
from pneudrive.validate import validate
from pneudrive.validate.balance import Signals, cross_correlations, metrics, run_model, whiteness
from trials.diagnosis_hits import Case


def test_the_true_model_passes_and_a_wrong_one_does_not():
    truth = drive()
    records = [record(truth, seed, name=f"run {seed}") for seed in (0, 2)]
    right = validate(truth, records)
    assert all(v.met in (True, None) for v in right.verdicts)
    assert right.verdicts[0].value > 99.0
    assert right.verdicts[1].value < 0.005
    wrong = validate(drive(valve__conductance="1.5 dm3/(s bar)"), records)
    assert [v.met for v in wrong.verdicts[:2]] == [False, False]
    # put back to measured states, errors have less time to grow
    channel = wrong.records[0].channels["position_m"]
    assert channel.restarted.rms < channel.free.rms
    assert channel.off_s is not None
    assert right.records[0].channels["position_m"].off_s is None


def test_no_cause_is_named_for_a_valve_with_switching_times():
    """The balances would name a delay of 20 ms, which is the switching time of the description."""
    truth = pn.Drive.load("catalogue:parker-osp-p40-sy7000")
    steps = "0 s: 1, 0.2 s: 0, 0.4 s: -1, 0.6 s: 0, 0.8 s: 1"
    found = validate(truth, pn.simulate(truth, steps, "1 s", initial="position = 100 mm"))
    position = found.records[0].channels["position_m"]  # also from states at which the valve is on its way
    assert (max(position.free.nrmse, position.restarted.nrmse) < 1e-5, found.diagnosis().culprits) == (True, ())
    assert [one.met for one in found.verdicts] == [True, True, True]
    assert "switching times" in " ".join(found.notes)


#: Slow rises of pressure after rests: the piston breaks away and runs.
RESTS = [(0.0, 0.0), (0.3, 0.02), (1.6, 0.0), (2.4, -0.03), (3.6, 0.0)]


def test_breakaway_is_compared_at_stops():
    truth = drive()
    own = record(truth, 0, duration_s=4.0, steps=RESTS)
    same = validate(truth, own).records[0].breakaways
    assert len(same) >= 2
    assert max(abs(b.error) for b in same) < 0.05
    more = validate(drive(friction__breakaway="60 N"), own)
    assert min(b.error for b in more.records[0].breakaways) > 0.1  # the wrong model holds on for longer
    assert more.verdicts[2].met is False


def test_a_run_reset_to_its_own_states_is_the_same_run():
    """Bristles and temperatures, which nobody measures, continue over a reset."""
    truth = drive()
    signals = Signals.of(record(truth, 0, duration_s=2.0))
    whole = run_model(truth, signals)
    own = replace(signals, **{name: whole[name] for name in ("position_m", "pressure_a_pa", "pressure_b_pa")})
    parts = run_model(truth, own, np.array([0, 300, 700]))
    assert whole.failures == parts.failures == ()
    for name, bound in (("position_m", 1e-4), ("pressure_a_pa", 300.0), ("friction_force_n", 3.0)):
        assert np.abs(parts[name] - whole[name]).max() < bound, name


def test_a_piston_that_rests_under_pressure_stays():
    """0.8 bar on 4.9 cm2 are 39 N of 45 N: bristles that were straight at the start would bend by 0.4 mm."""
    reference = pn.Drive.load("catalogue:reference")
    time = np.arange(101) * 1e-3
    columns = {"time_s": time, "command": 0.0 * time, "position_m": 0.1 + 0.0 * time}
    columns |= {"pressure_a_pa": 3.8e5 + 0.0 * time, "pressure_b_pa": 3e5 + 0.0 * time}
    run = run_model(reference, Signals.of(drive_recording(columns)))
    assert abs(run["position_m"][-1] - 0.1) < 5e-6


def test_metrics_are_those_of_their_formulas():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    found = metrics(y, y + np.array([0.3, -0.3, 0.3, -0.3]))
    assert found.nrmse == pytest.approx(0.1)  # 0.3 of a span of 3
    assert found.fit_percent == pytest.approx(100.0 * (1.0 - 0.6 / np.sqrt(5.0)))
    assert metrics(y, np.full(4, y.mean())).fit_percent == pytest.approx(0.0)


def test_white_noise_is_white_and_what_follows_a_signal_is_told_with_its_sign():
    random = np.random.default_rng(5)
    ps = [whiteness(random.standard_normal(2000))["p"] for _ in range(200)]
    assert 0.01 < np.mean(np.array(ps) < 0.05) < 0.11
    signal = np.convolve(random.standard_normal(3000), np.ones(4), "same")
    late = np.roll(signal, 7) + 0.1 * random.standard_normal(3000)
    assert whiteness(late)["p"] < 0.05
    found = cross_correlations(-late, {"position": random.standard_normal(3000), "command": signal})
    assert list(found) == ["command", "position"]
    assert found["command"] == pytest.approx(-1.0, abs=0.05)


LAYOUT = (Path(__file__).parents[2] / "data" / "validate_layout.toml").read_text("utf-8")


def test_foreign_records_are_read_through_a_layout(tmp_path):
    truth = drive()
    (tmp_path / "layout.toml").write_text(LAYOUT)
    for day, seed in (("1", 0), ("2", 2)):
        own = record(truth, seed, duration_s=2.0)
        table = {
            "t": 1e3 * own["time_s"],
            "U": 5.0 + 5.0 * own["command"],
            "x": -1e3 * own["position_m"],
            "p1": (own["pressure_a_pa"] - 1.013e5) / 1e5,
            "p2": own["pressure_b_pa"] / 1e3,
        }
        text = pl.DataFrame(table).write_csv(separator=";").replace(".", ",")
        (tmp_path / f"day{day}_{seed}.csv").write_text(text)
    files = sorted(tmp_path.glob("*.csv"))
    found = validate(truth, files)
    assert found.verdicts[0].met
    direct = validate(truth, record(truth, 0, duration_s=2.0))
    rms = [v.records[0].channels["position_m"].free.rms for v in (found, direct)]
    assert rms[0] == pytest.approx(rms[1], rel=1e-3)
    assert [(c["label"], c["value"]) for c in found.conditions][:2] == [("day", "1"), ("day", "2")]


def test_records_that_cannot_be_used_say_why(tmp_path):
    truth = drive()
    good = record(truth, 0, duration_s=0.2).columns
    (tmp_path / "run.csv").write_text("a,b\n1,2\n")
    for unusable, message in (
        ({k: good[k] for k in good if k not in ("command", "pressure_b_pa")}, "lacks command, pressure_b_pa"),
        ({**good, "command": 5.0 * np.ones_like(good["time_s"])}, "command = 5"),
        ({**good, "time_s": good["time_s"][::-1]}, "time_s does not increase"),
        (tmp_path / "run.csv", "not a recording of a drive"),
    ):
        with pytest.raises(RecordingError, match=message):
            validate(truth, unusable)
    layout = tmp_path / "own.toml"
    layout.write_text(LAYOUT.replace('position = { column = "x", unit = "mm", positive = "-x" }\n', ""))
    with pytest.raises(LayoutError, match="does not name the column of the position"):
        validate(truth, tmp_path / "run.csv", layout=layout)


# --- What is known of sensors is taken off before a model is judged; what no drive file can say is said in words.

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
ZERO_PA = 2e3


def shown(seed: int, which: str = "pressure_a_pa", zero: float = ZERO_PA):
    made = record(drive(), seed, duration_s=4.0, name=f"run {seed}")
    return drive_recording({**made.columns, which: made[which] + zero}, made.name)


@pytest.mark.parametrize(("seed", "sign"), [(1, 1.0), (1, -1.0), (2, -1.0)])
def test_a_zero_of_a_transducer_is_named_and_not_what_it_looks_like(seed, sign):
    """0.02 bar on 4.9 cm2 are 1 N: as much as a little more friction one way, which explains less."""
    zero = Case("zero", frozenset(), {}, lambda c: {**c, "pressure_a_pa": c["pressure_a_pa"] + sign * ZERO_PA})
    found = zero.diagnosed(seed, 2e-6, 300.0)
    assert [c.key for c in found.culprits] == ["zero of pressure a"]
    assert found.culprits[0].amount == pytest.approx(sign * ZERO_PA, rel=0.05)


def test_zeros_that_a_fit_found_are_taken_off(tmp_path, printed):
    truth = drive()
    start, zeros = truth.replace({"friction.coulomb": "25 N"}), {"pressure_a": {"offset": "free"}}
    fit = pn.identify(start, [shown(0), shown(2)], ["friction.coulomb"], sensors=zeros)
    for name in ("run 0", "a new one"):
        assert fit.sensors_of(name)["pressure_a"]["offset"] == pytest.approx(ZERO_PA, abs=50.0)
    with_zeros = validate(fit, shown(0))
    assert with_zeros.diagnosis().is_clean
    assert any(re.search(r"pressure_a offset 0\.0(20|199|201)", note) for note in with_zeros.notes)
    assert not validate(fit.apply(), shown(0)).diagnosis().is_clean
    assert validate(truth, shown(0), sensors={"pressure_a": {"offset": "0.02 bar"}}).diagnosis().is_clean
    with pytest.raises(FitError, match="does not fit sensor values"):
        validate(truth, shown(0), sensors=zeros)
    fit.to_toml(tmp_path / "fit.toml")
    pl.DataFrame(shown(0).columns).write_parquet(tmp_path / "run 0.parquet")
    assert "pressure_a offset 0.0" in printed(
        ["validate", tmp_path / "fit.toml", tmp_path / "run 0.parquet", "--out", tmp_path]
    )


def test_a_command_that_acts_late_is_taken_off():
    made = record(drive(), 5, duration_s=4.0)
    early = np.r_[made["command"][4:], np.repeat(made["command"][-1], 4)]
    shifted = drive_recording({**made.columns, "command": early}, made.name)
    assert validate(drive(), shifted).verdicts[0].value < 99.0
    assert validate(drive(), shifted, sensors={"command": {"delay": "4 ms"}}).verdicts[0].value > 99.0


def test_what_a_drive_file_cannot_say_is_said():
    leak = Case("x", frozenset(), {}, lambda c: {**c, "command": np.clip(c["command"] + 0.02, -1.0, 1.0)})
    (text,) = (c.text for c in leak.diagnosed(3, 2e-6, 300.0).culprits[:1])
    assert "A drive file cannot describe this cause yet" in text


def test_progress_is_told_and_the_call_can_be_cancelled():
    said = []
    validate(drive(), shown(0), progress=lambda done, total, task: said.append((done, total, task)))
    assert {"recordings simulated"} < {task for _, _, task in said}
    flag = threading.Event()
    flag.set()
    with pytest.raises(Cancelled):
        validate(drive(), shown(0), cancel=flag)
