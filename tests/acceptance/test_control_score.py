"""The score card of control: mismatches and spreads of the true drive, references of files, feasibility, air."""

from __future__ import annotations

import dataclasses
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.control import motion
from pneudrive.control.mismatch import Mismatch, ready_mismatches
from pneudrive.control.scores import SCORED, score_of
from pneudrive.errors import PneudriveWarning
from pneudrive.report.render import draw_figure
from pneudrive.simulation.trajectory import save

EXAMPLES = Path(__file__).parents[2] / "examples"
AXIS = EXAMPLES / "controlled_axis.toml"
STEP = "220 mm; 0.1 s: 280 mm in 0.3 s"
CLOCKS = ("step_time", "least_step_time")


def test_a_mismatch_is_the_drive_that_it_says(axis):
    """Of a heavier drive with less friction: the bits of that drive under a law that believes in the other one."""
    true = axis.replace(
        {
            "components.cylinder.moving_mass": "2.6 kg",
            "components.cylinder.friction.coulomb": "15 N",
            "components.cylinder.friction.breakaway": "22.5 N",
            "components.valve.delay": "1.5 ms",
        }
    )
    told = {"reference": STEP, "duration": "0.6 s", "seed": 2}
    expected = pn.control.run(true, "inversion", believes=axis, **told)
    mismatch = Mismatch(moving_mass=1.3, friction_level=0.5, delay="1.5 ms")
    found = pn.control.run(axis, "inversion", mismatch=mismatch, **told)
    assert found.drop_vars(CLOCKS).equals(expected.drop_vars(CLOCKS))
    assert found.attrs["deviations"] == {"moving_mass": 1.3, "friction_level": 0.5, "delay_s": 0.0015}


def test_a_factor_of_the_moving_mass_is_one_of_its_load_too():
    """A carriage of 2 kg with 10 kg on it, 1.3 times as heavy: all of it."""
    drive = pn.Drive.load("catalogue:reference")
    loaded, heavier = (
        drive.replace({"cylinder.moving_mass": f"{2.0 * by} kg", "load": {"mass": f"{10.0 * by} kg"}})
        for by in (1.0, 1.3)
    )
    told = {"reference": STEP, "duration": "0.6 s"}
    expected = pn.control.run(heavier, "inversion", believes=loaded, **told)
    found = pn.control.run(loaded, "inversion", mismatch="mass+30", **told)
    assert found.drop_vars(CLOCKS).equals(expected.drop_vars(CLOCKS))


def test_a_factor_of_the_conductance_is_one_of_each_way_through_a_valve(axis):
    """3/2 valves may give the conductance of their exhaust apart: a smaller valve is smaller there, too."""
    pair = AXIS.read_text().replace("valve/proportional-5/3", "valve/proportional-3/2")
    pair = pair.replace('["supply -> valve.1", "valve.4 -> cylinder.a", "valve.2 -> cylinder.b"]', JOINTS)
    pair = pair.replace("[components.valve]", '[components.valve]\ncopies = ["valve_a", "valve_b"]')
    drive, smaller = (
        pn.Circuit.load(
            pair.replace('"2 dm3/(s bar)"', f'"{by} dm3/(s bar)"\nexhaust_conductance = "{by} dm3/(s bar)"')
        )
        for by in (2.0, 1.6)
    )
    told = {"reference": STEP, "duration": "0.5 s"}
    expected = pn.control.run(smaller, "inversion", believes=drive, **told)
    found = pn.control.run(drive, "inversion", mismatch="conductance-20", **told)
    assert np.abs(found.position - expected.position).max() < 1e-9


JOINTS = '["supply -> valve_a.1", "valve_a.2 -> cylinder.a", "supply -> valve_b.1", "valve_b.2 -> cylinder.b"]'


def test_forces_of_a_setup_and_of_a_mismatch_add(axis):
    """Each holds until the next one of its own: together they are what one list of their sums is."""
    setup = pn.control.Setup(disturbances=[{"at": "0.1 s", "force": "-20 N"}])
    mismatch = Mismatch(disturbances=[{"at": "0.1 s", "force": "5 N"}, {"at": "0.3 s", "force": "0 N"}])
    sums = [{"at": "0.1 s", "force": "-15 N"}, {"at": "0.3 s", "force": "-20 N"}]
    told = {"reference": STEP, "duration": "0.5 s"}
    expected = pn.control.run(axis, "inversion", setup=pn.control.Setup(disturbances=sums), **told)
    found = pn.control.run(axis, "inversion", setup=setup, mismatch=mismatch, **told)
    assert found.drop_vars(CLOCKS).equals(expected.drop_vars(CLOCKS))


def test_a_wrong_pressure_sensor_that_is_not_there_is_no_deviation(axis):
    told = {"reference": STEP, "duration": "0.1 s", "setup": "cheap"}
    with pytest.warns(PneudriveWarning, match="pressure_zero_pa has no effect: the setup has no pressure sensors"):
        found = pn.control.run(axis, "inversion", mismatch=Mismatch(pressure_zero="5 kPa", overlap=0.03), **told)
    assert found.attrs["deviations"] == {"overlap": 0.03}


ELEMENTS = [{"stiffness": "3e4 N/m", "share": 0.15}, {"stiffness": "7e4 N/m", "share": 0.85}]
SLIDES = {"coulomb": "30 N", "breakaway": "45 N", "stribeck_velocity": "20 mm/s", "viscous": "40 N s/m"}


@pytest.mark.parametrize(
    ("described", "true"),
    [
        (
            SLIDES | {"law": "gms", "attraction": "900 N/s", "elements": ELEMENTS},
            {"law": "dahl", "coulomb": "30 N", "viscous": "40 N s/m", "bristle_stiffness": "1e5 N/m"},
        ),
        (
            SLIDES | {"law": "stribeck", "stribeck_shape": "exponential"},
            {"law": "coulomb", "coulomb": "30 N", "viscous": "40 N s/m"},
        ),
    ],
    ids=["elements", "shape"],
)
def test_another_law_leaves_choices_that_it_has_not(axis, described, true):
    """The stiffness of all elements is that of the contact in stick."""
    drives = [axis.replace({"components.cylinder.friction": one}) for one in (described, true)]
    told = {"reference": STEP, "duration": "0.3 s"}
    expected = pn.control.run(drives[1], "inversion", believes=drives[0], **told)
    found = pn.control.run(drives[0], "inversion", mismatch=Mismatch(friction_law=true["law"]), **told)
    assert found.drop_vars(CLOCKS).equals(expected.drop_vars(CLOCKS))


def test_ready_mismatches_change_what_a_law_that_does_not_learn_reaches(axis, tmp_path):
    """Each makes another run; a weak supply and a force of 20 N a worse one."""
    (tmp_path / "fixed.toml").write_text('schema = 1\nlaw = "super-twisting"\nadaptation = false\n')
    load = Mismatch(disturbances=[{"at": "0.2 s", "force": "-20 N"}])
    cases = {name: name for name in ready_mismatches() if name not in ("standard", "load-step")} | {"load": load}
    error = {
        name: pn.control.run(
            axis, controller=tmp_path / "fixed.toml", reference=STEP, duration="0.8 s", mismatch=given
        ).attrs["score"]["max_error_m"]
        for name, given in ({"none": None} | cases).items()
    }
    assert len(set(error.values())) == len(error)
    assert min(error["all"], error["load"]) > 1.5 * error["none"]


def test_air_is_that_of_the_supply(axis):
    """The mass from the ledger against the flow from the supply along the same commands."""
    found = pn.control.run(axis, "inversion", reference=STEP, setup="ideal", duration="0.6 s")
    start = {"cylinder.position": "220 mm", "cylinder.a.pressure": "4.006625 bar abs"}
    start["cylinder.b.pressure"] = start["cylinder.a.pressure"]
    commands = list(zip(found.time.to_numpy(), found.command.to_numpy(), strict=True))
    again = pn.simulate(axis, commands, "0.6 s", initial=start, sample_rate="10 kHz")
    mass = np.trapezoid(again["supply.mass_flow"], again.time)
    assert found.attrs["air"]["mass_kg"] == pytest.approx(abs(mass), rel=2e-3)
    volume = found.attrs["score"]["air_anr_m3_s"] * 0.6
    assert volume == pytest.approx(found.attrs["air"]["mass_kg"] / 1.185)


def test_another_gas_has_its_own_volume_and_exergy(axis):
    """Helium of 7 bar abs at the temperature of the ambient: m R T0/p at the reference atmosphere, m R T0 ln(p/p0)."""
    found = pn.control.run(
        axis.replace({"gas": {"name": "helium"}}), "inversion", reference=STEP, duration="0.6 s"
    ).attrs
    per_kg = 2077.1 * 293.15
    assert found["air"]["anr_m3"] == pytest.approx(found["air"]["mass_kg"] * per_kg / 1e5, rel=5e-3)
    assert found["air"]["exergy_j"] == pytest.approx(
        found["air"]["mass_kg"] * per_kg * np.log(7e5 / 101325.0), rel=1e-3
    )


def test_members_of_a_spread_are_the_same_for_any_number_of_threads(axis, tmp_path, capsys):
    command = ["control", "benchmark", str(AXIS), "--laws", "pid,inversion", "--references", STEP]
    options = ["--spread", "standard", "--members", "4", "--out", str(tmp_path / "one")]
    assert run([*command, *options]) == 0
    told = {"laws": ["pid", "inversion"], "references": [STEP], "spread": "standard"}
    pn.control.benchmark(axis, **told, members=4, threads=3, out=tmp_path / "three")
    pn.control.benchmark(axis, **told, members=2, threads=2, out=tmp_path / "two")
    tables = [pl.read_parquet(tmp_path / name / "score.parquet") for name in ("one", "three", "two")]
    clocks = [name for name in tables[0].columns if name.startswith("step_")]
    one, three, two = (table.drop(clocks) for table in tables)
    assert one.equals(three)
    assert one.filter(pl.col("seed") <= 2).equals(two)
    truths = one.unique("seed", keep="first")["true_moving_mass"]
    assert truths.n_unique() == 4
    assert truths.is_between(0.5, 1.6).all()
    assert "95 % quantile and maximum" in capsys.readouterr().out
    page = (tmp_path / "one" / "report.html").read_text("utf-8")
    assert "True drive" in page
    assert "whiskers from 5 to 95 %" in page
    # A line that a kill has cut is run again, all others are not.
    kept = tmp_path / "one" / "scores.jsonl"
    lines = kept.read_text("utf-8").splitlines()
    assert len(lines) == 6  # of 8 runs: member 1 has files
    kept.write_text("\n".join([*lines[:-1], lines[-1][:40]]), "utf-8")
    again = pn.control.benchmark(axis, **told, members=4, threads=1, out=tmp_path / "one")
    assert len(kept.read_text("utf-8").splitlines()) == 7
    largest = one.filter(pl.col("law") == "pid")["max_error_m"].max()
    assert again.within("pid", pn.control.reference(STEP).text, "max_error_m", 1.0) == largest


POINTS = """schema = 1
[[points]]
at = "0 s"
to = "100 mm"
[[points]]
at = "0.6 s"
to = "250 mm"
[[points]]
at = "1 s"
to = "200 mm"
"""
LIMITED = """schema = 1
start = "100 mm"
[limits]
velocity = "0.8 m/s"
acceleration = "8 m/s2"
jerk = "300 m/s3"
snap = "3e4 m/s4"
[[moves]]
at = "0.2 s"
to = "400 mm"
"""


def test_references_of_files(tmp_path):
    """Each goes where its file says, with continuous jerk, within its limits."""
    read = pn.control.reference
    for name, text in {
        "points.toml": POINTS,
        "limited.toml": LIMITED,
    }.items():
        (tmp_path / name).write_text(text)
    passes = read(tmp_path / "points.toml")
    assert passes.at([0.0, 0.6, 1.0])[:, 0] == pytest.approx([0.1, 0.25, 0.2])
    assert abs(passes.at([0.6])[0, 1]) > 0.01
    limited = read(tmp_path / "limited.toml")
    time = np.linspace(0.0, limited.duration_s, 40_001)
    most = np.abs(limited.at(time)).max(axis=0)
    assert most[1:] == pytest.approx([0.8, 8.0, 300.0], rel=1e-3)
    assert limited.at([limited.duration_s])[0] == pytest.approx([0.4, 0, 0, 0], abs=1e-9)
    moves = read("100 mm; 0.2 s: 400 mm in 0.5 s")
    time = np.linspace(0.0, 1.0, 1001)
    pl.DataFrame({"time_s": time, "position_m": moves.at(time)[:, 0]}).write_csv(tmp_path / "record.csv")
    record = read(tmp_path / "record.csv")
    assert record.points_missed_m < 4e-5
    for one in (moves, record, limited, passes):
        time = np.arange(0.0, one.duration_s, 1e-4)
        slopes = np.gradient(one.at(time), 1e-4, axis=0)
        largest = np.abs(one.at(time)).max(axis=0)
        for order in range(3):
            off = np.abs(slopes[1:-1, order] - one.at(time)[1:-1, order + 1]).max()
            assert off < 0.02 * largest[order + 1], (one.text, order)


WRONG = {
    "a.csv": ("time_s;position_m\n0,0;0,1\n", "Separate the columns of a CSV file by commas"),
    "b.csv": ("time_s,position_m\n0,0.1\n1,0.1\n1,0.2\n2,0.2\n3,0.2\n", "times"),
    "f.toml": (LIMITED.split("[limits]")[0] + '[[moves]]\nat = "1 s"\nto = "2 mm"\n', "duration is missing"),
    "h.toml": (POINTS + '[[points]]\nat = "1 s"\nto = "1 mm"\n', "times increase"),
    "o.toml": (
        POINTS + LIMITED[LIMITED.index("[limits]") : LIMITED.index("[[moves]]")],
        "limits have no effect",
    ),
    "p.toml": (LIMITED + 'duration = "1 s"\n', "limits have no effect"),
    "n.csv": (
        "time_s,position_m\n0,0.2\n0.1,0.25\n0.2,0.2\n0.3,0.25\n3,0.2\n3.1,0.25\n3.2,0.2\n",
        "no sample from 0.3 s to 3 s",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_references_give_one_message(name, tmp_path, refusal, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, said = WRONG[name]
    Path(name).write_text(text)
    refusal(["control", "run", AXIS, "--reference", name], said)


def test_a_record_that_its_curve_misses_is_told(tmp_path, capsys, axis):
    """A gap of 1 s makes knots 2 s apart: the curve goes nowhere near a sine of 1 s. Names of files in any case."""
    time = np.concatenate([np.arange(0.0, 2.0, 0.01), np.arange(3.0, 5.0, 0.01)])
    path = tmp_path / "REC.CSV"
    pl.DataFrame({"time_s": time, "position_m": 0.25 + 0.02 * np.sin(2.0 * np.pi * time)}).write_csv(path)
    missed = pn.control.reference(path).points_missed_m
    assert 0.01 < missed < 0.04
    words = f"misses its points by up to {1e3 * missed:.3g} mm"
    options = ["--reference", str(path), "--controller", "inversion", "--duration", "50 ms"]
    assert run(["control", "run", str(AXIS), *options]) == 0
    assert words in capsys.readouterr().err
    out = tmp_path / "compared"
    with pytest.warns(PneudriveWarning, match=words):
        pn.control.benchmark(axis, "inversion", {"record": path}, seeds=1, out=out)
    assert pn.control.read_comparison(out).about["points_missed_m"] == {"record": missed}


def test_overshoot_is_that_of_each_way(axis):
    """Of two moves back to back: as moves, as polynomials, and of a path that turns around within a polynomial."""
    moves = "220 mm; 1 s: 280 mm in 0.3 s; 1.3 s: 220 mm in 0.3 s"
    out, back = motion.blended(1.0, 0.3, 0.22, 0.28), motion.blended(1.3, 0.3, 0.28, 0.22)
    found = [
        pn.control.run(axis, "nmpc", reference=one, duration="2.5 s").attrs["score"]["overshoot_m"]
        for one in (moves, dataclasses.replace(pn.control.reference(moves), moves=(), pieces=(*out, *back)))
    ]
    assert max(found) < 5e-4
    assert found[1] == pytest.approx(found[0], abs=1e-4)
    ramps = pn.control.standard(axis)["R4"]
    time = np.arange(0.0, ramps.duration_s, 1e-3)
    wanted = ramps.at(time)[:, 0]
    named = dict.fromkeys(SCORED, 0.0 * time) | {"reference": wanted}
    assert score_of(time, named | {"position": wanted}, ramps.core()).overshoot_m < 1e-5
    named["position"] = wanted + 2e-3 * np.sign(ramps.at(time)[:, 1])
    assert score_of(time, named, ramps.core()).overshoot_m == pytest.approx(2e-3, abs=1e-4)


def test_a_reference_is_read_as_its_user_means_it():
    """Inches, whose unit is also the word before a duration."""
    assert pn.control.reference("10 in; 1 s: 12 in in 0.3 s").moves[0] == pytest.approx((1.0, 0.3, 0.3048))


def test_reach_is_that_of_the_whole_path(tmp_path):
    """Of a spline that swings below its points, in a long piece: within 1 um, so that it is refused."""
    times, points = (0.0, 1.0, 1.1, 5.0), ("200 mm", "300 mm", "301 mm", "250 mm")
    tables = [f'[[points]]\nat = "{at} s"\nto = "{to}"' for at, to in zip(times, points, strict=True)]
    (tmp_path / "swings.toml").write_text("\n".join(["schema = 1", *tables]))
    swings = pn.control.reference(tmp_path / "swings.toml")
    lowest = swings.at(np.linspace(1.1, 5.0, 1_000_000))[:, 0].min()
    assert lowest < 0.0
    assert swings.reach().lowest_m == pytest.approx(lowest, abs=1e-6)


def test_two_moves_without_a_dwell_settle_behind_the_second():
    """The drive is off by 0.2 mm as the first ends, where the second begins, and never later."""
    time = np.arange(0.0, 2.0, 1e-3)
    motion = {"kind": "moves", "start_m": 0.2, "moves": [[0.1, 0.3, 0.3], [0.1 + 0.3, 0.3, 0.2]]}
    named = dict.fromkeys(SCORED, 0.0 * time) | {"position": np.where(time < 0.5, 2e-4, 0.0)}
    assert score_of(time, named, motion).settling_100_um_s == 0.0


def test_a_dwell_of_just_the_time_that_is_looked_at_counts():
    """0.2 s + 0.4 s is more than 0.6 s in binary: the drive is off by 1 mm and swings by 2 mm in that dwell alone."""
    time = np.arange(0.0, 4.0, 1e-3)
    for begin, dwell, name, size in ((0.2, 0.2, "rest_error_m", 1e-3), (0.2, 0.6, "hunting_m", 2e-3)):
        end = begin + 0.4
        until = round(end + dwell, 9)
        assert until - end < dwell
        motion = {"kind": "moves", "start_m": 0.2, "moves": [[begin, 0.4, 0.3], [until, 0.3, 0.2]]}
        swings = np.where((time > end) & (time < until), 1e-3 * (-1.0) ** np.arange(len(time)), 0.0)
        named = dict.fromkeys(SCORED, 0.0 * time) | {"position": swings}
        assert getattr(score_of(time, named, motion), name) == pytest.approx(size, rel=0.02)


def read_program_text(folder, text):
    """Read a program with the reader of the examples."""
    reader = runpy.run_path(str(EXAMPLES / "gcode_reference.py"))
    (folder / "program.nc").write_text(text)
    return reader["references"](folder / "program.nc")


def test_programs_are_read_by_a_custom_reader(tmp_path):
    """G-code: 100 mm at 100 mm/s, taken up within 0.1 s, 0.5 s of rest, 30 mm of Y alone, then X back by 20 mm."""
    text = "(two axes)\nG21 G90\nG0 X100 Y50\nG1 X200 Y50 F6000\nG4 P0.5\nG91\nY30\nG0 X-20\n"
    x, y = read_program_text(tmp_path, text).values()
    assert x.at([0.0, 0.6, 1.1, 1.6, 9.0])[:, 0] == pytest.approx([0.1, 0.155, 0.2, 0.2, 0.18])
    assert y.at([1.6, 1.8, 2.0])[:, 0] == pytest.approx([0.05, 0.065, 0.08])
    for wrong, said in {
        "G21\nG2 X10\n": "nc:2",
        "G0 X10\nG1 X20\n": "needs a feed F",
        "G91 X10": "begins is not said",
        f"G0 X{'9' * 400}": "the number of X is out of bounds",
        "G0 X100\nX280 X290": "X stands twice",
        "G0 X100\nG0 G1 X290 F100": "G0 and G1 stand in one block",
        "G0 X100\nG4 P2000000": "takes 2e\\+06 s",
    }.items():
        with pytest.raises(pn.errors.CommandError, match=said):
            read_program_text(tmp_path, wrong)
    with pytest.raises(pn.errors.CommandError, match=r"gcode_reference\.py"):
        pn.control.reference("program.nc:X")


def test_a_path_may_end_where_the_stroke_ends(tmp_path, axis):
    """Sums of steps miss zero by 1e-19 m; what leaves the stroke by 1 um is refused."""
    back = read_program_text(tmp_path, "G0 X0\nG91\nG1 X1 F60\nX1\nX1\nG90 X0\n")["X"]
    assert back.reach().lowest_m < 0.0
    tuning = pn.control.tune(axis, "inversion")
    assert pn.control.feasibility(tuning, back).is_feasible
    assert not pn.control.run(axis, controller=tuning, reference=back, duration="0.1 s").attrs["score"]["lost"]
    with pytest.raises(pn.errors.CommandError, match=r"leads to 500.001 mm"):
        pn.control.run(axis, "inversion", reference="490 mm; 0.1 s: 500.001 mm in 0.3 s")


def test_a_run_that_was_read_again_has_its_score(axis, tmp_path):
    import xarray as xr

    made = pn.control.run(axis, "inversion", reference=STEP)
    save(made, tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as read:
        assert pn.control.score(read).to_dict() == made.attrs["score"]
    with pytest.raises(pn.errors.CommandError, match="has 500 of the 2401 samples of a run"):
        pn.control.score(made.isel(time=slice(500)))  # the air, for one, is that of all of it


def test_a_verdict_says_what_the_model_leaves_out(axis, tmp_path, printed):
    """Needles of a fifth of the valve limit the speed, though the model of the controllers leaves them out."""
    needle = 'needle_conductance = "0.4 dm3/(s bar)"'
    file = tmp_path / "drive.toml"
    file.write_text(f'drive = "catalogue:reference"\n[flow_control]\na = {{ {needle} }}\nb = {{ {needle} }}\n')
    along = "100 mm; 0.1 s: 400 mm in 1.5 s"
    assert (
        "not decided: at most 85 % of each limit of a model without flow_control_a, flow_control_b is needed;"
        in printed(["control", "reference", along, "--drive", file])
    )
    assert run(["control", "reference", along.replace("1.5 s", "0.3 s"), "--drive", str(file)]) == 2
    assert "left out" not in str(pn.control.feasibility(pn.control.tune(axis), pn.control.reference(along)))


@pytest.mark.parametrize(("pressure", "load", "out"), [("2.2 bar abs", "0 N", 0.6693), ("7 bar abs", "-150 N", 2.038)])
def test_a_reference_is_judged_by_the_steady_speed_in_its_direction(pressure, load, out):
    """The speed of the simulated drive with its valve fully open, slower against a load than with it."""
    drive = pn.Drive.load("catalogue:reference").replace({"supply.pressure": pressure, "load.force": load})
    speed = pn.simulate(drive, 1.0, "1 s", initial={"position": "0 mm"}).velocity.max()
    tuning, along = pn.control.tune(drive), pn.control.reference("1 mm; 0 s: 101 mm in 0.5 s; 1 s: 1 mm in 0.5 s")
    assert (tuning.speeds_m_s[0], float(speed)) == (pytest.approx(out, rel=1e-3), pytest.approx(out, rel=0.02))
    assert pn.control.feasibility(tuning, along).demand.speed_share == pytest.approx(0.4375 / out, rel=1e-3)


def test_a_reference_that_friction_at_rest_would_stop_is_slowed_where_that_helps(axis):
    """Within a reversal that is not too slow friction never rises to that at rest."""
    tuning = pn.control.tune(axis.replace({"components.supply.pressure": "2 bar abs"}))
    assert max(tuning.plant.least_force_shares) > 0.9
    found = pn.control.feasibility(tuning, pn.control.reference("sine 60 mm 1 Hz around 250 mm"))
    assert not found.is_feasible
    slower = pn.control.feasibility(tuning, pn.control.reference(f"sine 60 mm {1 / found.factor} Hz around 250 mm"))
    assert slower.is_feasible


def test_a_reference_is_checked_against_the_valve_and_slowed(axis):
    """A move that the drive's speed allows and its valve does not; slowed by the factor, it is feasible."""
    fast = "100 mm; 0.2 s: 400 mm in 0.22 s"
    tuning = pn.control.tune(axis)
    found = pn.control.feasibility(tuning, pn.control.reference(fast))
    assert not found.is_feasible
    assert found.demand.valve_share > found.demand.speed_share
    slower = pn.control.feasibility(tuning, found.reference.stretched(found.factor))
    assert max(slower.demand.valve_share, slower.demand.force_share, slower.demand.speed_share) <= 0.855
    for reference, bound in ((found.reference, 1e-3), (slower.reference, 5e-4)):
        reached = pn.control.run(axis, "nmpc", reference=reference, setup="ideal").attrs["score"]["max_error_m"]
        assert (reached > bound) is (reference is found.reference)


def test_what_a_verdict_advises_is_feasible(tmp_path, capsys):
    """A sine whose peaks lie between other steps once it is slowed; a path without a text is not quoted."""
    upright = AXIS.parent / "axes" / "upright.toml"
    tuning = pn.control.tune(pn.Circuit.load(upright))
    found = pn.control.feasibility(tuning, pn.control.reference("sine 100 mm 3 Hz around 150 mm"))
    slower = found.reference.stretched(found.factor)
    assert 1.7 < found.factor < 1.8
    assert pn.control.feasibility(tuning, pn.control.reference(slower.text)).is_feasible
    path = tmp_path / "moves.toml"
    path.write_text(LIMITED.replace('"400 mm"', '"250 mm"\nduration = "50 ms"\n[[moves]]\nat = "2 s"\nto = "240 mm"'))
    assert run(["control", "reference", str(path), "--drive", str(upright)]) == 2
    said = capsys.readouterr()
    assert re.search(r"slowed by a factor of 3\.83\d*,", said.out)
    assert re.search(r"Stretch it in time by 3\.256\.\n", said.err)


SPREADS = {
    "both": (["--spread", "standard", "--mismatch", "all"], "a spread and a mismatch cannot be given"),
    "members": (["--members", "3"], "members = 3 needs a spread"),
    "a range as a mismatch": (["--mismatch", "standard"], "is a spread"),
    "unknown": (["--spread", "standards"], "'standard'"),
    "file": (["--spread", "given.toml"], "LOW .. HIGH"),
}


@pytest.mark.parametrize("case", SPREADS)
def test_wrong_spreads_give_one_message(case, tmp_path, refusal, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("given.toml").write_text('schema = 1\nmoving_mass = "1.6 .. 1"\n')
    options, said = SPREADS[case]
    said = "the first end must not exceed" if said == "LOW .. HIGH" else said
    refusal(["control", "benchmark", AXIS, "--laws", "inversion", *options, "--out", "out"], said)
    shutil.rmtree("out", ignore_errors=True)


WRONG_CALLS = {
    "no drive is named": lambda _: pn.control.tune(None),
    "seed = '3' is not a whole number": lambda axis: pn.control.run(axis, "inversion", reference=STEP, seed="3"),
    "seed = -1 is out of bounds": lambda axis: pn.control.run(axis, "inversion", reference=STEP, seed=-1),
    "seeds = 2.0 is not a whole number": lambda axis: pn.control.benchmark(
        axis, "inversion", [STEP], out=".", seeds=2.0
    ),
    "the standard reference R1 depends on the drive": lambda _: pn.control.reference("R1"),
    "law and a tuning of inversion for controlled axis cannot be given together": lambda axis: pn.control.run(
        axis, "pid", reference=STEP, controller=pn.control.tune(axis, "inversion")
    ),
    "believes and a tuning of inversion": lambda axis: pn.control.run(
        axis, reference=STEP, controller=pn.control.tune(axis, "inversion"), believes=axis
    ),
    "tuning is a str": lambda _: pn.control.export("inversion", "c", "."),
    "tuning is a NoneType": lambda _: pn.control.feasibility(None, pn.control.reference(STEP)),
    'two references are called "220 mm"': lambda axis: pn.control.benchmark(
        axis, "inversion", [one := pn.control.reference("220 mm"), dataclasses.replace(one, start_m=0.3)], out="."
    ),
    "the drive already has lugre": lambda axis: pn.control.run(
        axis, reference=STEP, mismatch=Mismatch(friction_law="lugre")
    ),
}


@pytest.mark.parametrize("message", WRONG_CALLS)
def test_a_wrong_call_gives_one_message(message, axis):
    with pytest.raises(pn.errors.PneudriveError, match=re.escape(message)):
        WRONG_CALLS[message](axis)


def test_what_is_damaged_is_run_again_and_a_lost_law_is_drawn_as_nothing(axis, tmp_path):
    told = {"references": [STEP], "spread": "standard", "members": 3, "out": tmp_path}
    made = pn.control.benchmark(axis, ["pid", "inversion"], **told)
    kept = tmp_path / "scores.jsonl"
    kept.write_bytes(b"\xff\xfe" + kept.read_bytes() + b'{"key": "1", "reason": ""}\n')
    again = pn.control.benchmark(axis, ["pid", "inversion"], **told)
    assert [one.score.max_error_m for one in again.runs] == [one.score.max_error_m for one in made.runs]
    lost = tuple(one._replace(score=None) if one.law == "pid" else one for one in made.runs)
    for runs in (lost, tuple(one._replace(score=None) for one in made.runs)):
        for shown in dataclasses.replace(made, runs=runs).view().figures:
            draw_figure(shown.figure, tmp_path / f"{shown.name}.png")
    table = tmp_path / "score.parquet"
    table.write_bytes(table.read_bytes()[:-9])
    with pytest.raises(pn.errors.CommandError, match="cut off"):
        pn.control.read_comparison(tmp_path)


def test_a_comparison_takes_one_reference_of_any_kind(axis, tmp_path):
    read = pn.control.reference(STEP)
    for one in (STEP, read, [read]):
        made = pn.control.benchmark(axis, "inversion", one, seeds=1, out=tmp_path)
        assert list(made.references) == [STEP]


def test_a_comparison_of_no_reference_is_refused(axis, tmp_path):
    for references in ({}, [], None):
        with pytest.raises(pn.errors.CommandError, match="no reference"):
            pn.control.benchmark(axis, ["pid"], references, out=tmp_path / "compared")
    assert not (tmp_path / "compared").exists()
