"""The datasheet as a user makes it: pages, recordings beside, hostile texts."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.datasheet import sheet
from pneudrive.datasheet.measured import beside, response_of
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.sheet import build
from pneudrive.progress import UNWATCHED
from pneudrive.report.datasheet import write_datasheet
from pneudrive.simulation.trajectory import columns
from pneudrive.validate.validation import validate

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "case_a.npz"
DRIVE = pn.Drive.load("catalogue:reference")
QUICK = ("square-response", "stiffness", "natural-frequency", "bode")


def golden_file(folder):
    """Write the trajectory of an independent model of the reference drive as a recording."""
    want, noise = np.load(GOLDEN), np.random.default_rng(1)
    t = np.arange(len(want["position_m"])) / 1000.0
    deviations = {"position_m": 1e-5, "pressure_a_pa": 500.0, "pressure_b_pa": 500.0}
    measured = [want[name] + size * noise.standard_normal(t.size) for name, size in deviations.items()]
    table = np.column_stack([t, np.where(t < 1.0, 0.6, -0.6), *measured])
    path, head = folder / "golden.csv", ",".join(("time_s", "command", *deviations))
    np.savetxt(path, table, delimiter=",", header=head, comments="")
    names = {"time": "time_s", "command": "command", "position": "position_m"}
    names |= {f"pressure_{side}": f"pressure_{side}_pa" for side in "ab"}
    units = {"time": "s", "position": "m", "pressure_a": "Pa abs", "pressure_b": "Pa abs"}
    lines = ['delimiter = ","', "header = true", "[columns]"]
    for key, column in names.items():
        unit = f', unit = "{units[key]}"' if key in units else ""
        lines.append(f'{key} = {{ column = "{column}"{unit} }}')
    (folder / "layout.toml").write_text("\n".join([*lines, "[labels]", 'synthetic = "oracle"']) + "\n")
    return path


def test_a_datasheet_beside_an_independent_model(tmp_path, monkeypatch, printed):
    monkeypatch.setattr(sheet, "OF_A_SHEET", QUICK)
    recording, page = golden_file(tmp_path), tmp_path / "sheet.html"
    layout = str(tmp_path / "layout.toml")
    said = printed(["datasheet", "catalogue:reference", recording, "--layout", layout, "--out", page])
    assert "22 of 22 numbers agree" in said.replace("\n", " ")
    text = page.read_text(encoding="utf-8")
    assert re.search(r"end energy</td>.*?11\.8 J", text, re.DOTALL)
    assert text.count("<svg") == 3
    assert not re.search(r'(src|href)="(?!#|data:)', text)
    assert "assumed: reference drive" in text
    assert "simulated, compared with synthetic recordings</h1>" in text


def test_a_wrong_drive_differs_from_the_recording(tmp_path):
    slower = DRIVE.replace({"valve.conductance": "1.5 dm3/(s bar)"})
    found = beside(slower, [golden_file(tmp_path)], None, UNWATCHED)
    by_name = {(one.stroke, one.name): one for one in found.numbers}
    assert not by_name["command +0.6", "stroke_time"].agrees
    assert by_name["command +0.6", "stroke_time"].measured == pytest.approx(0.2084, abs=5e-4)
    assert by_name["command +0.6", "stroke_time"].simulated > 0.24
    assert [each.state for each in found.findings if "numbers" in each.text] == ["bad"]


def test_the_pdf_has_two_pages(tmp_path, monkeypatch):
    pytest.importorskip("typst")
    monkeypatch.setattr(sheet, "OF_A_SHEET", ("natural-frequency",))
    drive = DRIVE.replace({"name": 'A #panic("x") <b>drive</b> \\ $ * _ @'})
    target = write_datasheet(build(drive, [], None, UNWATCHED), tmp_path / "sheet.pdf")
    pdf = target.read_bytes()
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 2


def test_strokes_that_the_drive_does_not_do_count_against_it(tmp_path):
    stuck = DRIVE.replace({"cylinder.incline": "90 deg", "load.mass": "200 kg"})
    found = beside(stuck, [golden_file(tmp_path)], None, UNWATCHED)
    by_name = {(one.stroke, one.name): one for one in found.numbers}
    for name in ("stroke_time", "end_speed", "rise_time"):
        one = by_name["command +0.6", name]
        assert (np.isfinite(one.measured), np.isnan(one.simulated), one.agrees) == (True, True, False)
    assert len(found.numbers) == 22  # as many as beside a drive that moves


def test_a_drive_that_cannot_move_its_load_is_a_hazard(monkeypatch):
    monkeypatch.setattr(sheet, "OF_A_SHEET", ("square-response",))
    stuck = DRIVE.replace({"cylinder.incline": "90 deg", "load.mass": "200 kg"})
    texts = [one.text for one in build(stuck, [], None, UNWATCHED, intervals=False).hazards]
    assert any("does not reach both ends" in text for text in texts)
    for name, said in (("air", "does not reach both ends"), ("bode", "does not move in")):
        with pytest.warns(pn.errors.PneudriveWarning, match=said):
            pn.drive_characteristic(stuck, name, intervals=False)


def test_a_pressure_peak_and_a_lock_that_slips_are_hazards(monkeypatch):
    """A closed cushion compresses to far above 16 bar; 90 kg hang on a lock of 800 N and friction of 45 N."""
    monkeypatch.setattr(sheet, "OF_A_SHEET", ("square-response",))
    cushioned = pn.Circuit.load(Path(__file__).resolve().parents[3] / "examples" / "cushioned_axis.toml")
    (peak,) = build(cushioned, [], None, UNWATCHED, intervals=False).hazards
    assert re.search(r"rises to \d\d\.\d bar abs, above the 16 bar abs .* \(assumed", peak.text)
    tables = DRIVE.replace({"cylinder.incline": "90 deg", "load.mass": "90 kg"}).circuit.to_dict()
    tables["components"]["lock"] = {"kind": "rod-lock", "holding_force": "800 N"}
    tables["connections"] = [*tables["connections"], "cylinder.rod -> lock"]
    (slips, *_) = build(type(DRIVE.circuit).model_validate(tables), [], None, UNWATCHED, intervals=False).hazards
    assert slips.text.endswith("friction at rest and locks hold only 845 N.")
    tables["components"]["lock"]["holding_force"] = "1 kN"
    held = build(type(DRIVE.circuit).model_validate(tables), [], None, UNWATCHED, intervals=False).hazards
    assert not any("locks hold" in one.text for one in held)


def test_intervals_reach_the_numbers_of_the_page(monkeypatch):
    monkeypatch.setattr(sheet, "OF_A_SHEET", ("minimum-pressure",))
    monkeypatch.setattr("pneudrive.datasheet.characteristics.steady.least_pressure", lambda *_: 2e5)
    origin = {"interval": ["43 N", "47 N"], "source": "stops.csv"}
    found = build(DRIVE.replace({"provenance": {"friction.breakaway": origin}}), [], None, UNWATCHED)
    force = next(one for one in found.numbers if one.name == "breakaway force")
    assert force.out == force.back == "45 N (43 .. 47)"
    value = next(one for one in found.values if one.key == "friction.breakaway")
    assert value.origin == "identified: 43 N .. 47 N (95 %), stops.csv"


def test_a_sweep_has_a_frequency_response_with_coherence():
    rate, lasting = 500.0, 16.0
    t = np.arange(0.0, lasting, 1.0 / rate)
    sweep = 0.15 * np.sin(2.0 * np.pi * (1.0 * t + 0.25 * t * t / 2.0))
    steps = list(zip(t[::5].tolist(), sweep[::5].tolist(), strict=True))
    made = pn.simulate(DRIVE, steps, lasting - 0.01, sample_rate=rate, initial={"position": "250 mm"})
    record = validate(DRIVE, columns(made)).records[0]
    found = response_of(record)
    assert found is not None
    assert found.coherence.min() >= 0.8
    middle = (found.frequency_hz > 1.0) & (found.frequency_hz < 4.0)
    assert middle.any()
    assert found.measured_m_s[middle] == pytest.approx(found.simulated_m_s[middle], rel=0.02)
    assert 1.0 < np.median(found.measured_m_s[middle]) < 8.0


def test_air_of_a_cycle_by_the_tank_method(tmp_path):
    tables = DRIVE.circuit.to_dict()
    # The wall is so large that rest comes within seconds.
    tank = {"kind": "tank", "volume": "20 l", "wall_area": "10 m2", "heat_transfer": "20 W/(m2 K)"}
    tables["components"]["supply"] = tank
    cycles, half = 5, 0.8
    fed = pn.Circuit.model_validate(tables)
    start = {"supply": "7 bar abs", "cylinder.position": "0 mm", "cylinder.b": "7 bar abs"}
    steps = [(0.0, -1.0), *((2.0 + k * half, 1.0 - 2.0 * (k % 2)) for k in range(2 * cycles))]
    run = fed.simulate({"valve": steps}, 40.0, sample_rate=50.0, initial=start)
    noise_pa = np.random.default_rng(2).normal(0.0, 20.0, run.time.size)
    table = np.column_stack([run.time, run["supply.pressure"] + noise_pa])
    recording, layout = tmp_path / "tank.csv", tmp_path / "layout.toml"
    np.savetxt(recording, table, delimiter=",", header="t,p", comments="")
    text = f"""kind = "fixed-volume"
delimiter = ","
header = true
[columns]
time = {{ column = "t", unit = "s" }}
pressure = {{ column = "p", unit = "Pa abs" }}
[labels]
tank_volume = "20 l"
cycles = "{cycles}"
half_period = "{half} s"
synthetic = "circuit"
"""
    layout.write_text(text)
    found = beside(DRIVE, [recording], None, UNWATCHED)
    (air,) = found.numbers
    assert found.synthetic
    assert (air.name, air.unit, air.agrees) == ("air_per_cycle", "l ANR", True)
    assert air.measured == pytest.approx(air.simulated, rel=0.01)
    assert 2.5 < air.measured < 3.6  # chambers that fill and vent take 3.566 l at 7 bar
    (argon,) = beside(DRIVE.replace({"gas.name": "argon"}), [recording], None, UNWATCHED).numbers
    # A litre is one of the gas that is there; dry gas is 0.3 % denser than the humid air of ISO 8778.
    assert argon.measured == pytest.approx(air.measured / 1.0028, rel=1e-4)
    for wrong, said in (("20 l", "20 kg"), (f'cycles = "{cycles}"', 'cycles = "0"'), ("tank_volume", "volume")):
        layout.write_text(text.replace(wrong, said))
        with pytest.raises(pn.PneudriveError, match=r"tank.volume|cycles"):
            beside(DRIVE, [recording], None, UNWATCHED)
    layout.write_text(text)
    np.savetxt(recording, table[:310], delimiter=",", header="t,p", comments="")
    with pytest.raises(pn.PneudriveError, match="not at rest when its recording ends"):
        beside(DRIVE, [recording], None, UNWATCHED)


def test_the_circuit_of_a_drive_has_the_numbers_of_the_drive(tmp_path, printed, monkeypatch):
    monkeypatch.setattr("pneudrive.datasheet.sheet.OF_A_SHEET", ("force-speed", "square-response"))
    (tmp_path / "drive.toml").write_text(DRIVE.to_toml(), encoding="utf-8")
    (tmp_path / "circuit.toml").write_text(DRIVE.circuit.to_toml(), encoding="utf-8")
    said = []
    for name in ("drive", "circuit"):
        page = tmp_path / f"{name}.html"
        said.append(printed(["datasheet", tmp_path / f"{name}.toml", "--out", page]).splitlines()[0])
        assert "blocked force" in page.read_text(encoding="utf-8")
    assert said[0] == said[1]


def test_a_number_is_zero_only_within_the_error_of_its_computation():
    numbers = {"leak": (-1.93e-8, "1/s"), "conductance": (9e-10, "m3/(s Pa)"), "speed": (1e-12, "m/s")}
    found = xr.Dataset({name: ((), value, {"units": unit}) for name, (value, unit) in numbers.items()})
    assert [sheet.shown(found, name, {}) for name in numbers] == ["0 1/s", "0.0900 dm3/(s bar)", "0 m/s"]


def test_hazards_are_the_first_lines_of_a_sheet(monkeypatch):
    """A load that hangs, and an impact above 4 mJ for each mm2: 1.96 J at a bore of 25 mm."""
    monkeypatch.setattr(sheet, "OF_A_SHEET", ("square-response",))
    heavy = DRIVE.replace({"load.mass": "9 kg"})
    level, upright = (
        build(heavy.replace({"cylinder.incline": angle}), [], None, UNWATCHED, intervals=False)
        for angle in ("0 deg", "90 deg")
    )
    assert "exceeds the 1.96 J that a cylinder of this bore usually takes (assumed" in level.findings[0].text
    assert len(level.hazards) == 1
    weight = 9.80665 * (9.0 + DRIVE.cylinder.moving_mass)
    assert upright.findings[0].text.endswith(f"with {weight:.3g} N, but friction at rest and locks hold only 45 N.")
    assert all(finding.text.startswith("Hazard: ") for finding in upright.hazards)
    light = DRIVE.replace({"load.mass": "1 kg", "cylinder.incline": "90 deg"})  # friction alone would hold it
    measured = light.replace(
        {"friction.coulomb": "30 N", "friction.pressure": {"coulomb": {"a": "1 N/bar", "b": "1 N/bar"}}}
    )
    task = {"labels": {"held_by": "clamp", "clamp_force": "40 N", "impact_energy": "5 J"}}
    labelled = type(DRIVE.circuit).model_validate(light.circuit.to_dict() | task)
    friction, known, clamped = (build(one, [], None, UNWATCHED, intervals=False) for one in (light, measured, labelled))
    assert friction.hazards[0].state == "open"
    assert "locks hold only 0 N: the rest is friction, and no measurement" in friction.hazards[0].text
    assert not any("friction" in one.text for one in (*known.hazards, *clamped.hazards))
    assert next(value.limit for value in clamped.view().leading if value.key == "impact") == 5.0
    tables = DRIVE.replace({"cylinder.incline": "90 deg", "load.force": "-60 N"}).circuit.to_dict()
    assert HeldDrive(type(DRIVE.circuit).model_validate(tables)).hanging_n == pytest.approx(
        weight - 9.0 * 9.80665 + 60.0
    )
    slide, arm = {"kind": "slide", "mass": "9 kg", "incline": "90 deg"}, {"kind": "coupling", "stiffness": "1e6 N/m"}
    tables["components"] |= {"load": slide, "arm": arm}
    tables["connections"] = [*tables["connections"][:3], "cylinder.rod -> arm -> load"]
    assert HeldDrive(type(DRIVE.circuit).model_validate(tables)).hanging_n == pytest.approx(weight, rel=1e-6)
