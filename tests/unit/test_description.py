"""A drive file becomes SI, is refused with one message that names file, line, rule and remedy, and is written back."""

import copy
import math
import pickle
import re

import pytest

import pneudrive as pn
from pneudrive.describe.components import component
from pneudrive.errors import DescriptionError


def load(tmp_path, text):
    path = tmp_path / "drive.toml"
    path.write_text(text)
    return pn.Drive.load(path)


def test_values_reach_the_core_in_si(tmp_path, drive_file):
    core = load(tmp_path, drive_file).short_form()
    assert core["cylinder"]["bore_m"] == 0.025
    assert core["cylinder"]["dead_volume_b_m3"] == 1e-5
    assert core["supply"] == {"pressure_pa": 7e5, "temperature_k": 293.15}
    assert core["ambient"]["pressure_pa"] == 101300.0
    assert core["valve"]["conductance_m3_s_pa"] == 2e-8
    assert core["friction"]["parameters"]["stribeck_velocity"] == 0.02
    assert core["friction"]["pressure"] == {
        "coulomb_a": 1e-5,
        "coulomb_b": 1e-5,
        "breakaway_a": 1.5e-5,
        "breakaway_b": 1.5e-5,
    }
    assert core["load"] == {"mass_kg": 3.0, "force_n": 0.0, "spring": None}


def test_what_is_left_out_follows_the_ambient_air(tmp_path, drive_file):
    text = drive_file.replace('wall_temperature = "293.15 K"\n', "").replace('"293.15 K"              #', '"50 degC" #')
    text = text.replace('pressure = "7 bar abs"\ntemperature = "293.15 K"', 'pressure = "6 bar gauge"')
    core = load(tmp_path, text).short_form()
    assert core["supply"] == {"pressure_pa": 701300.0, "temperature_k": 323.15}
    assert core["cylinder"]["wall_temperature_k"] == 323.15
    assumed = load(tmp_path, text.replace("end_stop = {", "#")).assumed()
    assert [line.split(" = ")[0] for line in assumed] == [
        f"cylinder.end_stop.{key}" for key in ("stiffness", "damping", "damping_depth")
    ]


def test_written_and_read_back(tmp_path, drive_file):
    drive = load(tmp_path, drive_file)
    again = load(tmp_path, drive.to_toml())
    assert again == drive
    assert again.description_hash == drive.description_hash
    assert pickle.loads(pickle.dumps(drive)) == copy.deepcopy(drive) == drive


def test_python_and_file_give_the_same_drive(tmp_path):
    drive = pn.Drive(
        supply=pn.Supply(pressure="6 bar gauge"),
        cylinder=pn.Cylinder(
            kind="single-rod",
            bore="32 mm",
            rod_diameter="12 mm",
            stroke="100 mm",
            dead_volume={"a": "8 cm3", "b": "6 cm3"},
            moving_mass="300 g",
            incline="30 deg",
        ),
        valve=pn.Valve(kind="proportional-5/3", cv=0.9, critical_pressure_ratio=0.37),
        friction=pn.Friction(law="coulomb", coulomb="20 N"),
        load=pn.Load(force="-5 N", spring=pn.Spring(stiffness="2 N/mm", rest_position="50 mm")),
    )
    assert drive.cylinder.area_a_m2 == pytest.approx(math.pi / 4 * 0.032**2)
    assert drive.cylinder.area_b_m2 == pytest.approx(math.pi / 4 * (0.032**2 - 0.012**2))
    assert drive.friction.parameters["viscous"] == 0.0
    assert load(tmp_path, drive.to_toml()).core_json() == drive.core_json()


def test_a_change_is_checked_and_replaces_what_it_excludes():
    drive = pn.Drive.load("catalogue:reference")
    other = drive.replace({"valve.nominal_flow": "700 l/min ANR", "friction": {"law": "coulomb", "coulomb": "25 N"}})
    assert dict(other.friction.parameters) == {"coulomb": 25.0, "viscous": 0.0}
    assert other.valve.conductance_m3_s_pa == pytest.approx(2.753e-8, rel=1e-3)
    assert drive.friction.parameters["coulomb"] == 30.0
    with pytest.raises(DescriptionError, match="must not be below"):
        drive.replace({"friction.breakaway": "5 N"})


def test_a_file_may_start_from_the_catalogue(tmp_path):
    drive = load(tmp_path, 'drive = "catalogue:reference"\n[supply]\npressure = "5 bar abs"\n')
    assert drive.supply_pressure_pa == 5e5
    assert drive.cylinder.stroke_m == 0.5


# old text, new text, what the message says, text of the line that it points at
WRONG = [
    ("bore =", "boer =", "cylinder.boer is not a known key", "Did you mean 'bore'"),
    ("bore =", 'rod = "12 mm"\nbore =', "cylinder.rod is not a known key", "Did you mean 'rod_diameter'"),
    ("bore =", 'use = "catalogue:x"\nbore =', "cylinder.use is not a known key", "[components.cylinder]"),
    ("[valve]", '[valve]\nbandwidth = "90 Hz"', "valve.bandwidth is not a known key", "frequency and damping_ratio"),
    ("[supply]", "[suply]", "suply is not a known key", "Did you mean 'supply'"),
    ("viscous =", "viscos =", 'not a known key of law "lugre"', "Did you mean 'viscous'"),
    ('"lugre"', '"lugree"', 'friction.law = "lugree" is not known', "Did you mean 'lugre'"),
    ('"25 mm"', '"25"', 'cylinder.bore: "25" has no unit', 'bore = "25"'),
    ('"25 mm"', "25", "cylinder.bore: 25 has no unit", "bore = 25"),
    ('"25 mm"', '"25 bar"', 'unit "bar" is a pressure', "a length is needed"),
    ('"7 bar abs"', '"7 bar"', "does not state abs or gauge", '"7 bar abs" or "7 bar gauge"'),
    ('"1.013 bar abs"', '"0 bar gauge"', "ambient.pressure", "abs"),
    ('"7 bar abs"', '"-7 bar abs"', "supply.pressure", "greater than 0"),
    ('"7 bar abs"', '"-2 bar gauge"', "supply.pressure is below vacuum", "gauge pressure + ambient pressure > 0"),
    ('kind = "rodless"', 'kind = "through-rod"', "cylinder.rod_diameter is missing", "has a rod"),
    ('kind = "rodless"', 'kind = "rodless"\nrod_diameter = "5 mm"', "has no rod", "rod_diameter"),
    ('kind = "rodless"', 'kind = "single-acting"', "exists only in circuits", "components.cylinder"),
    ('"2 kg"', '"nan kg"', "is not finite", "moving_mass"),
    ("ratio = 0.3", "ratio = 1.0", "valve.critical_pressure_ratio: 1.0 is out of bounds", "less than 1"),
    ("ratio = 0.3", 'ratio = "0.3"', "is not a number", "without unit and quotes"),
    ("_ratio = 1.4", "_ratio = inf", "gas.heat_capacity_ratio: inf is out of bounds", "finite"),
    ('"45 N"', '"5 N"', "friction.breakaway = 5 N must not be below friction.coulomb = 30 N", "swapped"),
    ('coulomb = "30 N"\n', "", 'friction.coulomb is missing; law "lugre" needs it', "[friction]"),
    ('coulomb = { a = "1.0 N/bar"', 'coulomb = { a = "1.0 N"', "friction.pressure.coulomb.a", "a force per pressure"),
    ('(s bar)"', '(s bar)"\ncv = 0.5', "flow path is given 2 times: conductance, cv", "Keep one"),
    ('conductance = "2 dm3/(s bar)"\n', "", "valve.conductance is missing", "exactly one of"),
    ("schema = 1", "schema = 2", "schema = 2 is not known", "1"),
    ("[supply]", "[supply", "the file is not TOML", "[supply"),
    ("schema = 1", 'drive = "catalogue:refrence"', "the catalogue has no drive 'refrence'", "Did you mean 'reference'"),
]


@pytest.mark.parametrize(("old", "new", "what", "also"), WRONG, ids=[row[2][:50] for row in WRONG])
def test_wrong_files_get_one_message(tmp_path, drive_file, old, new, what, also):
    assert old in drive_file
    text = drive_file.replace(old, new, 1)
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert what in message
    assert also in message
    path, _, line = caught.value.where.rpartition(":")
    assert path == str(tmp_path / "drive.toml")
    # the line is that of the key, or of its table where the key itself is missing
    changed = [
        i for i, (a, b) in enumerate(zip(drive_file.splitlines(), text.splitlines(), strict=False), start=1) if a != b
    ]
    if "missing" not in what and "vacuum" not in what:
        assert changed[0] <= int(line) <= changed[0] + new.count("\n")
    assert caught.value.value == text.splitlines()[int(line) - 1].strip()


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (None, "there is no file"),
        (b"", "is empty"),
        (b"  \n", "is empty"),
        (b"\x00\x01PNG", "is binary, not text"),
        (b"name = '\xff\xfe'", "not text in UTF-8"),
        (b"this is not TOML", "the file is not TOML"),
    ],
)
def test_files_that_are_none(tmp_path, content, what):
    path = tmp_path / "drive.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DescriptionError, match=what):
        pn.Drive.load(path)
    with pytest.raises(DescriptionError, match="this is a folder, but a file is needed"):
        pn.Drive.load(tmp_path)


def test_an_upright_drive_sinks_towards_chamber_a_and_the_load_says_where_to_write_it():
    drive = pn.Drive.load("catalogue:reference").replace({"friction": {"law": "coulomb", "coulomb": "1 N"}})
    with pytest.raises(DescriptionError, match=r'load.incline[\s\S]*incline = "90 deg" under \[cylinder\]'):
        drive.replace({"load.incline": "90 deg"})
    for incline, sign in (("90 deg", -1.0), ("-90 deg", 1.0)):
        run = pn.simulate(drive.replace({"cylinder.incline": incline, "load.mass": "3 kg"}), 0, "2 ms")
        assert sign * float(run.acceleration[1]) == pytest.approx(9.8 - 1.0 / 5.0, rel=0.01)


def test_a_file_shows_all_its_problems_at_once(tmp_path, drive_file):
    """Eight mistakes in five tables: eight messages in the order of the lines, each with its own line."""
    mistakes = {
        '"7 bar abs"': '"7 bar"',
        'kind = "rodless"': 'kind = "rodles"',
        'bore = "25 mm"': 'boer = "25 mm"',
        'stroke = "500 mm"': 'stroke = "500"',
        'moving_mass = "2 kg"': 'moving_mass = "-2 kg"',
        'b = "10 cm3"': 'b = "10 mm"',
        "critical_pressure_ratio = 0.3": "critical_pressure_ratio = 3",
        'viscous = "40 N s/m"': 'viscous = "40 N"',
    }
    text = drive_file
    for good, bad in mistakes.items():
        assert text.count(good) == 1
        text = text.replace(good, bad)
    path = tmp_path / "drive.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DescriptionError) as caught:
        pn.Drive.load(path)
    lines = text.splitlines()
    wanted = sorted(next(i for i, line in enumerate(lines, start=1) if bad in line) for bad in mistakes.values())
    assert [error.where for error in caught.value.each()] == [f"{path}:{line}" for line in wanted]
    shown = str(caught.value)
    assert all(f"{path}:{line}" in shown for line in wanted)
    assert str(pickle.loads(pickle.dumps(caught.value))) == shown
    with pytest.raises(DescriptionError, match=r"(?s)valve.kind.*valve.conductance"):
        pn.Valve(kind="proportional", conductance="2 dm3", critical_pressure_ratio=0.3)


def test_wrong_python_gets_the_same_message():
    with pytest.raises(DescriptionError, match=r"valve.conductanc is not a known key[\s\S]*Did you mean 'conductance'"):
        pn.Valve(kind="proportional-5/3", conductanc="2 dm3/(s bar)", critical_pressure_ratio=0.3)


def test_the_start_lies_in_the_stroke():
    drive = pn.Drive.load("catalogue:reference")
    assert drive.core_initial(None)["position_m"] == 0.25
    start = drive.core_initial(pn.Initial(pressure_a="2 bar gauge", temperature_b="30 degC"))
    assert start["pressure_a_pa"] == 301300.0
    assert start["temperature_b_k"] == 303.15
    with pytest.raises(DescriptionError, match="is outside the stroke"):
        drive.core_initial(pn.Initial(position="501 mm"))


def test_drives_recordings_and_rigs_that_say_nothing_stand_in_the_same_air():
    from dataclasses import fields

    from pneudrive.rig.interface import Identity
    from pneudrive.signals.recording import Recording

    defaults = {
        kind: {f.name: f.default for f in fields(kind)}["ambient_pressure_pa"] for kind in (Recording, Identity)
    }
    assert {*defaults.values(), pn.Ambient().pressure_pa} == {101325.0}


def test_a_text_in_place_of_a_file_is_told():
    text = pn.Drive.load("catalogue:reference").to_toml()
    with pytest.raises(DescriptionError, match="this is a text of several lines"):
        pn.Drive.load(text)
    with pytest.raises(DescriptionError, match="there is no file"):
        pn.Drive.load(f"folder/{'x' * 5000}/drive.toml")


@pytest.mark.parametrize("size", [{"nominal_flow": "300 l/min ANR"}, {"kv": 0.3}, {"cv": 0.3}])
def test_a_valve_by_a_flow_without_its_ratio_has_the_usual_one_as_an_assumption(size):
    tables = pn.Drive.load("catalogue:reference").to_dict() | {"valve": {"kind": "proportional-5/3"} | size}
    drive = pn.Drive.model_validate(tables)
    whole = pn.Drive.model_validate(tables | {"valve": tables["valve"] | {"critical_pressure_ratio": 0.3}})
    assert drive.valve.conductance_m3_s_pa == whole.valve.conductance_m3_s_pa
    said = "valve.critical_pressure_ratio = 0.3"
    assert [said in line for line in drive.assumed()].count(True) == 1
    assert not any(said in line for line in whole.assumed())
    tubed = pn.Drive.model_validate(tables | {"tubing": {"a": {"length": "1 m", "diameter": "6 mm"}}})
    assert any(said in line for line in tubed.assumed())
    with pytest.raises(DescriptionError, match=r"valve\.critical_pressure_ratio is missing"):
        pn.Valve(kind="proportional-5/3", conductance="2 dm3/(s bar)")


def test_a_component_by_a_flow_without_its_ratio_writes_the_assumption_down():
    valve = component({"kind": "valve/switching-5/2", "cv": 1.0, "time_on": "10 ms", "time_off": "10 ms"})
    assert any("critical_pressure_ratio = 0.3, usual for valves" in line for line in valve.assumed())
    assert component(valve.to_dict()).to_dict() == valve.to_dict()
    with pytest.raises(DescriptionError, match="critical_pressure_ratio is missing"):
        component({"kind": "fitting", "conductance": "1 dm3/(s bar)"})


@pytest.mark.parametrize("digits", [20, 400, 5000])
def test_numbers_of_many_digits_are_refused_in_words(tmp_path, digits):
    text = pn.Drive.load("catalogue:reference").to_toml()
    (tmp_path / "drive.toml").write_text(re.sub(r"(ratio = { value =) [0-9.]+", rf"\1 {'9' * digits}", text))
    with pytest.raises(DescriptionError, match=r"whole number|digits"):
        pn.Drive.load(tmp_path / "drive.toml")
    with pytest.raises(DescriptionError, match="is out of bounds"):
        pn.Valve(kind="proportional-5/3", cv=0.3, critical_pressure_ratio=10**400)
