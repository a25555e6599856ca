"""A model is judged by free runs: the true one passes, a wrong one does not, from foreign records as from own ones."""

import numpy as np
import polars as pl
import pytest

from oracle.drive_records import drive, record
from pneudrive.errors import LayoutError, RecordingError
from pneudrive.validate import validate
from pneudrive.validate.metrics import cross_correlations, metrics, whiteness


def test_the_true_model_passes_and_a_wrong_one_does_not():
    truth = drive()
    records = [record(truth, seed, name=f"run {seed}") for seed in (0, 2)]
    right = validate(truth, records)
    assert all(v.met in (True, None) for v in right.verdicts)
    assert right.verdicts[0].value > 99.0
    assert right.verdicts[1].value < 0.005
    wrong = validate(drive(valve__conductance="1.5 dm3/(s bar)"), records)
    assert wrong.verdicts[0].met is False
    assert wrong.verdicts[1].met is False
    # put back to measured states, errors have less time to grow
    channel = wrong.records[0].channels["position_m"]
    assert channel.restarted.rms < channel.free.rms
    assert channel.off_s is not None
    assert right.records[0].channels["position_m"].off_s is None


#: Slow rises of pressure after rests: the piston breaks away and runs.
RESTS = [(0.0, 0.0), (0.3, 0.02), (1.6, 0.0), (2.4, -0.03), (3.6, 0.0)]


def test_breakaway_is_compared_at_stops():
    truth = drive()
    own = record(truth, 0, duration_s=4.0, steps=RESTS)
    same = validate(truth, own).records[0].breakaways
    assert len(same) >= 2
    assert max(abs(b.error) for b in same) < 0.05
    more = validate(drive(friction__breakaway="60 N"), own)
    errors = [b.error for b in more.records[0].breakaways]
    assert min(errors) > 0.1  # the wrong model holds on for longer
    assert more.verdicts[2].met is False


def test_metrics_are_those_of_their_formulas():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    found = metrics(y, y + np.array([0.3, -0.3, 0.3, -0.3]))
    assert found.nrmse == pytest.approx(0.1)  # 0.3 of a span of 3
    assert found.fit_percent == pytest.approx(100.0 * (1.0 - 0.6 / np.sqrt(5.0)))
    assert metrics(y, np.full(4, y.mean())).fit_percent == pytest.approx(0.0)


def test_white_noise_is_white_and_what_follows_a_signal_is_told_with_its_lag():
    random = np.random.default_rng(5)
    ps = [whiteness(random.standard_normal(2000)).p for _ in range(200)]
    assert 0.01 < np.mean(np.array(ps) < 0.05) < 0.11
    signal = np.convolve(random.standard_normal(3000), np.ones(4), "same")
    late = np.roll(signal, 7) + 0.1 * random.standard_normal(3000)
    assert not whiteness(late).is_white
    best = cross_correlations(late, {"command": signal, "position": random.standard_normal(3000)}, 1e-3)[0]
    assert (best.signal, round(best.lag_s, 6)) == ("command", 0.007)


LAYOUT = """
delimiter = "semicolon"
decimal = ","
header = true
[columns]
time = { column = "t", unit = "ms" }
command = { column = "U", scale = 0.2, offset = -1.0 }    # 0 to 10 V, shut at 5 V
position = { column = "x", unit = "mm", positive = "-x" }
pressure_a = { column = "p1", unit = "bar gauge" }
pressure_b = { column = "p2", unit = "kPa abs" }
[rig]
ambient_pressure = "1.013 bar abs"
[labels]
pattern = "day{day}_{run}"
"""


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
    assert [(c.label, c.value) for c in found.conditions][:2] == [("day", "1"), ("day", "2")]


def test_records_that_cannot_be_used_say_why(tmp_path):
    truth = drive()
    good = record(truth, 0, duration_s=0.2).columns
    with pytest.raises(RecordingError, match="lacks command, pressure_b_pa"):
        validate(truth, {k: v for k, v in good.items() if k not in ("command", "pressure_b_pa")})
    with pytest.raises(RecordingError, match="command = 5"):
        validate(truth, {**good, "command": 5.0 * np.ones_like(good["time_s"])})
    with pytest.raises(RecordingError, match="time_s does not rise"):
        validate(truth, {**good, "time_s": good["time_s"][::-1]})
    (tmp_path / "run.csv").write_text("a,b\n1,2\n")
    with pytest.raises(RecordingError, match="not a recording of a drive"):
        validate(truth, tmp_path / "run.csv")
    layout = tmp_path / "own.toml"
    layout.write_text(LAYOUT.replace('position = { column = "x", unit = "mm", positive = "-x" }\n', ""))
    with pytest.raises(LayoutError, match="does not say where the position is"):
        validate(truth, tmp_path / "run.csv", layout=layout)
