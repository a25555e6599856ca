"""A fixed volume is identified from its pressure: conductance, critical ratio, heat and leak of an independent model.

What the pressure does not show is called not determined, with the limit that it gives and what to record.
"""

import re

import numpy as np
import pytest

import pneudrive as pn
from oracle.tank import pressure
from pneudrive.errors import DescriptionError, FitError, LayoutError, RecordingError

C, B, VOLUME, HEAT, LEAK = 0.62e-8, 0.38, 2e-3, 0.8, 4e-12
TANK = {
    "volume": {"value": "2 dm3", "heat_transfer": "0.3 W/K"},
    "line": {"conductance": "0.4 dm3/(s bar)", "critical_pressure_ratio": 0.25},
}
NOISE = 300.0


def record(rate: float, duration: float, seed: int, **model) -> dict[str, np.ndarray]:
    """Columns as a rig writes them: 3 mbar of noise on the independent model."""
    time = np.arange(0.0, duration, 1.0 / rate)
    values = pressure(time, model.pop("p_start", 7e5), volume=VOLUME, **{"c": C, "b": B, "heat": HEAT, **model})
    opening = ((time >= model.get("opens", 0.0)) & (time < model.get("shuts", np.inf))).astype(float)
    noisy = values + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    return {"time_s": time, "pressure_pa": noisy, "command": opening}


def test_a_discharge_gives_conductance_ratio_and_heat_within_their_intervals():
    truth = {"line.conductance": C, "line.critical_pressure_ratio": B, "volume.heat_transfer": HEAT}
    inside = 0
    for seed in range(3):
        fit = pn.identify_volume(pn.Tank.model_validate(TANK), record(20.0, 12.0, seed))
        assert fit.converged
        for name, value in truth.items():
            low, high = fit.intervals[name]
            inside += low <= value <= high
            assert high - low < 0.1 * value
            assert fit.values[name] == pytest.approx(value, rel=0.03)
        assert fit.statistics["rms_share.pressure"] < 0.005
    assert inside >= 7, "9 intervals of 95 %: more than 2 outside in one of 100"
    assert [u.parameter for u in fit.undetermined] == ["volume.leakage"]
    assert "leads to the ambient air, like the leak" in fit.statements()[0]
    assert fit.apply().line.conductance_m3_s_pa == pytest.approx(C, rel=0.01)


def test_charging_shutting_and_leaking_at_one_hertz():
    shape = {"other": 7e5, "p_start": 1.013e5, "leak": LEAK, "shuts": 40.0}
    slow = record(1.0, 400.0, 3, **shape, c=0.05e-8)
    tank = pn.Tank.model_validate({**TANK, "line": {**TANK["line"], "pressure": "7 bar abs"}})
    fit = pn.identify_volume(tank.replace({"line.conductance": "0.1 dm3/(s bar)"}), slow)
    for name, value in {"line.conductance": 0.05e-8, "volume.leakage": LEAK}.items():
        low, high = fit.intervals[name]
        assert low <= value <= high
        assert fit.values[name] == pytest.approx(value, rel=0.02)
    assert fit.statistics["rms_share.pressure"] < 0.05


def test_a_shut_tank_has_a_leak_and_a_tight_one_a_limit():
    shut = pn.Tank.model_validate({"volume": {"value": "2 dm3", "heat_transfer": "0.8 W/K"}})
    fit = pn.identify_volume(shut, record(1.0, 300.0, 1, opens=1e9, leak=LEAK))
    assert fit.intervals["volume.leakage"][0] <= LEAK <= fit.intervals["volume.leakage"][1]
    assert "volume.leakage" in fit.determined
    tight = pn.identify_volume(shut, record(1.0, 300.0, 1, opens=1e9), free=["volume.leakage"])
    assert not tight.intervals, "a limit is said in words: what is not determined has no interval"
    limit = re.search(r"only an upper limit is known.*?([0-9.e-]+) dm3/\(s bar\)", tight.statements()[0])
    assert tight.determined == ()
    assert tight.apply().volume.leakage_m3_s_pa == 0.0, "what is not determined stays as it was"
    wrong = shut.replace({"volume.leakage": "0.01 dm3/(s bar)"})
    found = pn.identify_volume(wrong, record(1.0, 300.0, 1, opens=1e9), free=["volume.leakage"])
    low, high = found.intervals["volume.leakage"]
    assert low == 0.0 < high < 1e-13, "the recording excludes the start value, which does not stay"
    assert 1e-8 * float(limit[1]) == pytest.approx(high, rel=0.3), "one limit, whatever the search began with"
    assert found.apply().volume.leakage_m3_s_pa < high


def test_gas_that_keeps_the_temperature_of_the_wall_is_found_from_a_guess_that_does_not():
    fit = pn.identify_volume(pn.Tank.model_validate(TANK), record(10.0, 8.0, 4, heat=1e4))
    assert fit.statistics["rms.pressure"] < 1.1 * NOISE
    assert fit.intervals["line.conductance"][0] <= C <= fit.intervals["line.conductance"][1]
    assert [u.parameter for u in fit.undetermined] == ["volume.leakage", "volume.heat_transfer"]


def test_choked_flow_alone_does_not_tell_the_critical_ratio():
    fit = pn.identify_volume(pn.Tank.model_validate(TANK), record(50.0, 1.5, 2, p_start=9e5))
    (said,) = [u for u in fit.undetermined if u.parameter == "line.critical_pressure_ratio"]
    assert "was at most 0." in said.reason
    assert "nearly equal" in said.remedy
    assert fit.intervals["line.conductance"][0] <= C <= fit.intervals["line.conductance"][1]


def test_a_wrong_model_is_called_one():
    other = record(20.0, 12.0, 0, other=2e5)
    fit = pn.identify_volume(pn.Tank.model_validate(TANK), other)
    assert any("does not fit" in note for note in fit.notes)


LAYOUT = """
kind = "fixed-volume"
delimiter = "semicolon"
decimal = ","
[columns]
time = { column = 0, unit = "s" }
pressure = { column = 1, unit = "bar gauge" }
command = { column = 2, unit = "V", range = "0 V .. 10 V" }
[rig]
ambient_pressure = "1.013 bar abs"
"""


def test_from_files_on_the_command_line(tmp_path, printed, refusal):
    from pneudrive.cli.main import run
    from pneudrive.identify.files import read_fit

    columns = record(20.0, 12.0, 0, opens=1.0)
    rows = zip(columns["time_s"], columns["pressure_pa"] / 1e5 - 1.013, 10 * columns["command"], strict=True)
    (tmp_path / "fill.csv").write_text("\n".join(";".join(f"{v:.6f}" for v in row).replace(".", ",") for row in rows))
    (tmp_path / "layout.toml").write_text(LAYOUT)
    (tmp_path / "tank.txt").write_text(  # the tables decide what a file describes, not its suffix
        'name = "bottle"\n[volume]\nvalue = "2 dm3"\n[line]\nconductance = "0.4 dm3/(s bar)"\n'
        "critical_pressure_ratio = 0.25\n"
    )
    call = ["identify", str(tmp_path / "tank.txt"), str(tmp_path / "fill.csv")]
    said = printed([*call, "--out", tmp_path / "fit.toml"])
    assert "line.conductance" in said
    assert "dm3/(s bar)" in said
    assert 'kind = "volume"' in (tmp_path / "fit.toml").read_text()
    assert run(["apply", str(tmp_path / "fit.toml"), "--out", str(tmp_path / "after.toml")]) == 0
    found, after = read_fit(tmp_path / "fit.toml"), pn.Tank.load(tmp_path / "after.toml")
    assert after.line.conductance_m3_s_pa == pytest.approx(found.values["line.conductance"], rel=1e-12)
    assert after == found.apply(pn.Tank.load(tmp_path / "tank.txt"))
    refusal([*call, "--free", "line.conductence"], "Did you mean 'line.conductance'")
    refusal(["identify", "a" * 300, tmp_path / "fill.csv"], "there is no file aaa")
    (tmp_path / "stray.toml").write_text('regulator = 3\n[volume]\nvalue = "2 dm3"\n')
    refusal(["identify", tmp_path / "stray.toml", tmp_path / "fill.csv"], "regulator is not a known key")
    refusal(["characterise", tmp_path / "fill.csv", "--out", tmp_path / "out"], "fixed volume")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time_s": None}, "lacks time_s"),
        ({"time_s": lambda t: -t}, "time runs backwards"),
        ({"pressure_pa": lambda p: p - 9e5}, "below vacuum"),
        ({"command": lambda u: u * 5}, "fraction of the line's full opening"),
        ({"time_s": lambda t: t[:5], "pressure_pa": lambda p: p[:5], "command": lambda u: u[:5]}, "5 samples are left"),
    ],
)
def test_what_is_no_recording_of_a_volume_is_refused(change, words):
    columns = record(20.0, 2.0, 0)
    for name, how in change.items():
        columns[name] = None if how is None else how(columns[name])
    columns = {name: values for name, values in columns.items() if values is not None}
    with pytest.raises(RecordingError, match=f"(?s){words}"):
        pn.identify_volume(pn.Tank.model_validate(TANK), columns)


def test_mistakes_are_one_message(tmp_path):
    with pytest.raises(DescriptionError, match=r"line\.linear_above"):
        pn.Tank.model_validate({**TANK, "line": {**TANK["line"], "linear_above": 0.2}})
    with pytest.raises(FitError, match="cannot be a free number of this tank"):
        pn.identify_volume(
            pn.Tank.model_validate({"volume": {"value": "1 l"}}), record(20.0, 2.0, 0), ["line.conductance"]
        )
    (tmp_path / "layout.toml").write_text('kind = "fixed volume"\n[columns]\n')
    (tmp_path / "a.csv").write_text("0 1\n" * 20)
    with pytest.raises(LayoutError, match="kind = 'fixed volume' is not known"):
        pn.identify_volume(pn.Tank.model_validate(TANK), tmp_path / "a.csv")


def test_a_tube_between_line_and_volume_gives_its_friction_from_the_pressures_at_its_ends():
    hose = {"kind": "tube/distributed", "length": "1.3 m", "diameter": "4 mm", "friction_scale": 1.3}
    tank = {"kind": "tank", "volume": "0.4 dm3", "wall_area": "0.04 m2", "heat_transfer": "10 W/(m2 K)"}
    nozzle = {"kind": "fitting", "conductance": "0.8 dm3/(s bar)", "critical_pressure_ratio": 0.35}
    mains = {"kind": "reservoir", "pressure": "7 bar abs"}
    circuit = pn.Circuit(
        components={"mains": mains, "nozzle": nozzle, "hose": hose, "tank": tank},
        connections=["mains -> nozzle -> hose -> tank"],
    )
    run = circuit.simulate(None, 1.5, initial={"tank.pressure": "1 bar abs"}, sample_rate="50 Hz", rtol=1e-8)
    noise = NOISE * np.random.default_rng(5).standard_normal((2, run.time.size))
    columns = {
        "time_s": run.time.to_numpy(),
        "pressure_pa": run["tank.pressure"].to_numpy() + noise[0],
        "inlet_pressure_pa": run["nozzle.2.pressure"].to_numpy() + noise[1],
    }
    started = {
        "volume": {"value": "0.4 dm3", "heat_transfer": "0.2 W/K"},
        "line": {"conductance": "0.5 dm3/(s bar)", "critical_pressure_ratio": 0.25, "pressure": "7 bar abs"},
        "tube": {"length": "1.3 m", "diameter": "4 mm"},
    }
    truth = {
        "line.conductance": 0.8e-8,
        "line.critical_pressure_ratio": 0.35,
        "tube.friction_scale": 1.3,
        "volume.heat_transfer": 0.4,
    }
    fit = pn.identify_volume(pn.Tank.model_validate(started), columns, free=list(truth))
    for name, value in truth.items():
        low, high = fit.intervals[name]
        assert low <= value <= high
        assert high - low < 0.25 * value
    assert fit.apply().tube.friction_scale == fit.values["tube.friction_scale"]
    with pytest.raises(DescriptionError, match="the tube is not connected"):
        pn.Tank.model_validate({key: started[key] for key in ("volume", "tube")})
    with pytest.raises(DescriptionError, match=r"tube\.diameter is missing"):
        pn.Tank.model_validate({**started, "tube": {"length": "1 m"}})
