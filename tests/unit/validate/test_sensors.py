"""What is known of sensors is taken off before a model is judged; what no drive file can say is said in words."""

from __future__ import annotations

import re

import numpy as np
import pytest

import pneudrive as pn
from oracle.diagnosis_hits import Case
from oracle.drive_records import drive, record
from pneudrive.cli.main import run
from pneudrive.errors import Cancelled, FitError
from pneudrive.signals.drive_recording import drive_recording
from pneudrive.validate import validate

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
    best = max(found.alone, key=lambda one: one[2])[0]
    assert best == "zero of pressure a"
    assert [c.key for c in found.culprits] == [best]
    assert found.culprits[0].amount == pytest.approx(sign * ZERO_PA, rel=0.05)


def test_zeros_that_a_fit_found_are_taken_off(tmp_path, capsys):
    truth = drive()
    fit = pn.identify(
        truth.replace({"friction.coulomb": "25 N"}),
        [shown(0), shown(2)],
        ["friction.coulomb"],
        sensors={"pressure_a": {"offset": "free"}},
    )
    assert fit.sensors_of("run 0")["pressure_a"]["offset"] == pytest.approx(ZERO_PA, abs=50.0)
    assert fit.sensors_of("a new one")["pressure_a"]["offset"] == pytest.approx(ZERO_PA, abs=50.0)
    with_zeros = validate(fit, shown(0))
    assert with_zeros.diagnosis().is_clean
    assert any(re.search(r"pressure_a offset 0\.0(20|199|201)", note) for note in with_zeros.notes)
    assert not validate(fit.apply(), shown(0)).diagnosis().is_clean
    assert validate(truth, shown(0), sensors={"pressure_a": {"offset": "0.02 bar"}}).diagnosis().is_clean
    with pytest.raises(FitError, match="fits no numbers"):
        validate(truth, shown(0), sensors={"pressure_a": {"offset": "free"}})
    fit.to_toml(tmp_path / "fit.toml")
    import polars as pl

    pl.DataFrame(shown(0).columns).write_parquet(tmp_path / "run 0.parquet")
    assert run(["validate", str(tmp_path / "fit.toml"), str(tmp_path / "run 0.parquet"), "--out", str(tmp_path)]) == 0
    assert "pressure_a offset 0.0" in capsys.readouterr().out


def test_a_command_that_acts_late_is_taken_off():
    made = record(drive(), 5, duration_s=4.0)
    early = np.r_[made["command"][4:], np.repeat(made["command"][-1], 4)]
    shifted = drive_recording({**made.columns, "command": early}, made.name)
    assert validate(drive(), shifted).verdicts[0].value < 99.0
    assert validate(drive(), shifted, sensors={"command": {"delay": "4 ms"}}).verdicts[0].value > 99.0


def test_what_a_drive_file_cannot_say_is_said():
    made = record(drive(), 6, duration_s=4.0)
    leak = Case("x", frozenset(), {}, lambda c: {**c, "command": np.clip(c["command"] + 0.02, -1.0, 1.0)})
    (text,) = (c.text for c in leak.diagnosed(3, 2e-6, 300.0).culprits[:1])
    assert "A drive file cannot describe it yet" in text
    assert made.name


def test_progress_is_told_and_the_call_can_be_cancelled():
    import threading

    said = []
    validate(drive(), shown(0), progress=lambda done, total, task: said.append((done, total, task)))
    assert {"recordings simulated"} < {task for _, _, task in said}
    flag = threading.Event()
    flag.set()
    with pytest.raises(Cancelled):
        validate(drive(), shown(0), cancel=flag)
