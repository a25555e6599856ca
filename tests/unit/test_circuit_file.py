"""A circuit file becomes components and joints; each fault of it is told with file, line, value, rule and remedy."""

from __future__ import annotations

import copy
import json
import math
import pickle
import re
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.campaign.planning.protocol import ready_protocols
from pneudrive.describe import components
from pneudrive.describe.files.load import circuit_schema
from pneudrive.describe.kinds import component_kinds
from pneudrive.errors import DescriptionError, PneudriveWarning
from pneudrive.rig import shipped_rigs

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "two_cylinders.toml"
TEXT = EXAMPLE.read_text("utf-8")
FITTING = 'kind = "fitting"\nconductance = "1 dm3/(s bar)"\ncritical_pressure_ratio = 0.3\n'


def changed(*changes: tuple[str, str]) -> str:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def line_of(text: str, mark: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), start=1) if mark in line)


FAULTS = {
    "copies of a part that is none": (
        changed(('copies = ["fc_la"', 'use = "catalogue:none"\ncopies = ["fc_la"')),
        ("the catalogue has no part 'none'", '"catalogue:none"', "", "Known"),
    ),
    "a number in place of a table": (
        changed(("dead_volume = {", 'dead_volume = "9 cm3" # {')),
        ("dead_volume = '9 cm3' is not a table", "dead_volume", "", "{ a = ..., b = ... }"),
    ),
    "two volumes": (
        changed(('"tank -> valve_r.1",', '"tank -> valve_r.1",\n    "tank -> left.a",')),
        ("tank and left.a are in one joint, but each has a volume", '"tank -> left.a"', "or one volume", "a fitting"),
    ),
    "short circuit": (
        changed(('"mains -> inlet', '"mains -> ambient",\n    "mains -> inlet')),
        ("mains -> ambient has no restriction", '"mains -> ambient"', "at most one fixed pressure", "a fitting"),
    ),
    "dangling": (
        changed(('    "valve_l.2 -> fc_lb -> left.b",\n', "")),
        ("port valve_l.2 is not connected", 'copies = ["valve_l"', "joined or plugged", '"valve_l.2 -> fc_lb.1"'),
        ("port fc_lb.1 is not connected", 'copies = ["fc_la"', "joined or plugged", 'plugged = ["fc_lb.1"]'),
        ("port fc_lb.2 is not connected", 'copies = ["fc_la"', "joined or plugged", 'plugged = ["fc_lb.2"]'),
        ("port left.b is not connected", 'copies = ["left"', "joined or plugged", 'plugged = ["left.b"]'),
    ),
    "two sources": (
        changed(('"tank -> valve_r.1",', '"tank -> valve_r.1",\n    "second -> mains",'))
        + '[components.second]\nkind = "reservoir"\npressure = "9 bar abs"\n',
        (
            "mains and second fix the pressure of the same joint (inlet.1) at 6 bar gauge and 9 bar abs",
            '"second -> mains"',
            "at most one fixed pressure",
            "a fitting",
        ),
    ),
    "a tank at the mains": (
        changed(
            ("mains -> inlet -> tank", "mains -> tank"),
            ("[components.inlet]", "[components.inlet]\ncopies = []"),
            ("schema = 1", 'schema = 1\nplugged = ["inlet.1", "inlet.2"]'),
        ),
        ("mains fixes the pressure in tank", '"mains -> tank"', "one volume", "a fitting"),
        ("inlet.copies = [] is not a list of names", "copies = []", "", 'copies = ["left"'),
    ),
    "itself": (
        changed(('"tank -> valve_r.1",', '"tank -> valve_r.1",\n    "extra.1 -> extra.2",'))
        + f"[components.extra]\n{FITTING}",
        ("extra connects joint {extra.1, extra.2} with itself", '"extra.1 -> extra.2"', "two different joints", ""),
    ),
    "no pressure": (
        changed(('"tank -> valve_r.1",', '"tank -> valve_r.1",\n    "one -> two -> one.1",'))
        + f'[components.pair]\ncopies = ["one", "two"]\n{FITTING}',
        (
            "joint {one.2, two.1} has no path to a volume or a reservoir",
            '"one -> two',
            "from a volume or a reservoir",
            "Join a tank",
        ),
    ),
    "kind": (
        changed(("fc_la -> left.a", "fc_la -> left.rod")),
        ("fc_la.2 is gas, left.rod is an axis", "left.rod", "a gas port joins a gas port", ""),
    ),
    "twice": (
        changed(('"tank -> valve_r.1",', '"tank -> valve_r.1",\n    "valve_l.4 -> tank",')),
        (
            'valve_l.4 is joined twice: by "valve_l.4 -> tank" and by "valve_l.4 -> fc_la -> left.a"',
            '"valve_l.4 -> fc_la',
            "one connection",
            "a tank",
        ),
    ),
    "copies of one name": (
        changed(('"right"]', '"left", "tank"]')),
        ('two components have the name "left"', 'copies = ["left"', "a different name", "Rename"),
        ('two components have the name "tank"', 'copies = ["left"', "a different name", "Rename"),
        ('there is no component "right"', '"valve_r.4 -> fc_ra', "", ""),
    ),
    "unknown": (
        changed(("fc_la -> left.a", "fc_la -> lef.a"), ("valve_r.4 ->", "valve_r.A ->"), ('"tank"', '"tnak"')),
        ('there is no component "lef"', "lef.a", "", "Did you mean 'left'?"),
        ('valve_r has no port "A"', "valve_r.A", "", "Ports of valve/proportional-5/3: 1, 4, 2, 5, 3"),
        ("tank.kind = 'tnak' is not known", '"tnak"', "", "Did you mean 'tank'?"),
    ),
    "a template": (
        changed(("tank -> valve_l.1", "tank -> valve.1")),
        ("valve is a table of copies", "tank -> valve.1", "", "Name a copy: valve_l, valve_r"),
    ),
    "a component without a port": (
        changed(("tank -> valve_l.1", "tank -> valve_l")),
        ("valve_l has 5 ports; the connection must name one", '"tank -> valve_l"', "", "valve_l.1, valve_l.4"),
    ),
    "units": (
        changed(
            ("6 bar gauge", "6 bar"),
            ('conductance = "1.2 dm3/(s bar)"', 'conductance = "1.2 dm3/(s bar)"\nnominal_flow = "300 l/min ANR"'),
            ('throttles = "out"', 'throttles = "uot"'),
            ('b = "8 cm3" }', 'b = "8 cm2" }'),
        ),
        ('mains.pressure: pressure "6 bar" does not state', 'pressure = "6 bar"', "absolute", '"6 bar abs"'),
        ("valve: the flow path is given 2 times: conductance, nominal_flow", "nominal_flow", "", "Keep one"),
        ("flow_control.throttles = 'uot' is not known", "uot", "", "Did you mean 'out'?"),
        ('cylinder.dead_volume_b: unit "cm2" is an area', "dead_volume", "a volume is needed", ""),
    ),
    "start": (
        changed(('left.b = "6 bar gauge"', 'left.b = "6 bar"\nright.c = "1 bar abs"'), ('"0 mm"', '"101 mm"')),
        ("left.position = 101 mm is outside the stroke", "101 mm", "left.stroke = 100 mm", ""),
        ('left.b: pressure "6 bar" does not state', 'left.b = "6 bar"', "absolute", '"6 bar abs"'),
        ("right.c is not a start value", "right.c", "", "right.a.pressure"),
    ),
    "a key and a table": (
        changed(("dead_volume = {", 'dead_volume_a = "9 cm3"\ndead_volume = {')),
        ("dead_volume_a is given twice", "dead_volume", "", "Keep one"),
    ),
    "plugs": (
        changed(("[components.mains]", 'plugged = ["valve_l.4", "tank", "x.1"]\n[components.mains]')),
        ("valve_l.4 is plugged, but also joined to valve_l.4, fc_la.1", "plugged", "", "Remove one of the two"),
        ('"tank" is not a port', "plugged", "a plug closes a port", ""),
        ('there is no component "x"', "plugged", "", "Known: ambient"),
    ),
    "tables of a drive": (
        changed(
            (
                "[initial]",
                '[supply]\npressure = "3 bar"\n[load]\nmass = "1 kg"\n[tubing]\na = 3\n'
                '[components.supply]\nkind = "silencer"\n[initial]',
            )
        ),
        ('supply.pressure: pressure "3 bar" does not state', '"3 bar"', "absolute", '"3 bar abs"'),
        ("port supply.1 is not connected", "[supply]", "each port must be joined", "Join it"),
        ("[load] belongs to a [cylinder]; missing: [cylinder]", "[load]", "", "[components.NAME]"),
        ("[tubing] belongs to a [cylinder] behind a [valve]", "[tubing]", "", "Add [valve] and [cylinder]"),
        (
            'two components have the name "supply"; the other one is [supply]',
            '"silencer"',
            "a different name",
            "Rename this component",
        ),
    ),
    "size": (
        changed(
            (
                '    "tank -> valve_r.1",',
                '    "tank -> valve_r.1",\n'
                + "".join(f'    "t{i} -> f{i} -> t{i + 1}",\n' for i in range(259))
                + '    "tank -> f259 -> t0",',
            )
        )
        + f'[components.t]\nkind = "tank"\nvolume = "1 l"\ncopies = {json.dumps([f"t{i}" for i in range(260)])}\n'
        + f"[components.f]\ncopies = {json.dumps([f'f{i}' for i in range(260)])}\n{FITTING}",
        ("states", "", "", ""),
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_told_with_its_line_rule_and_remedy(tmp_path, fault):
    text, *expected = FAULTS[fault]
    path = tmp_path / "circuit.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(DescriptionError) as caught:
        pn.Circuit.load(path)
    errors = caught.value.each()
    for what, mark, rule, remedy in expected:
        (error,) = (one for one in errors if what in one.what)
        if mark:
            assert error.where == f"{path}:{line_of(text, mark)}"
            assert mark in error.value
        assert rule in (error.rule or "")
        assert remedy in (error.remedy or "")
    assert len(errors) == len(expected), str(caught.value)


def test_gas_that_cannot_come_or_go_is_told():
    text = changed(
        ('"tank -> valve_r.1"', '"ambient -> valve_r.1"'),
        ('"valve_r.4 -> fc_ra -> right.a"', '"valve_r.4 -> ambient", "fc_ra.2 -> right.a"'),
        ('"valve_r.2 -> fc_rb -> right.b"', '"valve_r.2 -> ambient", "right.b -> fc_rb -> fc_ra.1"'),
    )
    with pytest.warns(PneudriveWarning, match="no reservoir is connected: right"):
        circuit = pn.Circuit.load(text)
    assert circuit.notes == ["gas cannot enter or leave, because no reservoir is connected: right"]


def test_an_island_of_many_is_told_once():
    tanks, links = ([f"{letter}{i}" for i in range(7)] for letter in "tf")
    pair = {"kind": "fitting", "conductance": "1 dm3/(s bar)", "critical_pressure_ratio": 0.3, "copies": links}
    chains = [f"{one} -> {link} -> {other}" for one, link, other in zip(tanks, links, [*tanks[1:], "t0"], strict=True)]
    with pytest.warns(PneudriveWarning, match="connected: t0, t1, t2, t3, t4, ...") as told:
        pn.Circuit(components={"t": {"kind": "tank", "volume": "1 l", "copies": tanks}, "f": pair}, connections=chains)
    assert len(told) == 1


def test_a_chain_passes_a_silencer_on_its_way_to_the_air():
    text = TEXT + f"[components.quiet]\n{FITTING.replace('fitting', 'silencer')}"
    for chain in ("valve_l.3 -> quiet -> ambient", "valve_l.3 -> quiet", "quiet -> valve_l.3"):
        joints = json.loads(pn.Circuit.load(text.replace("connections = [", f'connections = ["{chain}",')).core_json())[
            "joints"
        ]
        assert {"valve_l.3", "quiet.1"} in map(set, joints)
        assert ["quiet.2", "ambient"] in joints


def test_kinds_that_are_none_are_told():
    for kind in ('["tank"]', "3", "{ a = 1 }"):
        with pytest.raises(DescriptionError, match=r"tank\.kind = .* is not known"):
            pn.Circuit.load(changed(('kind = "tank"', f"kind = {kind}")))
    with pytest.raises(DescriptionError, match=r"cylinder\.friction\.law = .* is not known"):
        pn.Circuit.load(changed(('law = "stribeck"', "law = [1]")))


def test_keys_of_a_kind_are_no_words_of_its_class():
    for kind, entry in component_kinds().items():
        names = [one["key"] for one in entry["parameters"]] + [one["name"] for one in entry["choices"]]
        assert not [name for name in names if hasattr(components.Component, name)], kind


def test_written_and_read_back():
    circuit = pn.Circuit.load(EXAMPLE)
    again = pn.Circuit.load(circuit.to_toml())
    assert again == circuit
    assert again.core_json() == circuit.core_json()
    assert again.core_initial() == circuit.core_initial()
    assert pickle.loads(pickle.dumps(circuit)) == copy.deepcopy(circuit) == circuit
    assert circuit.replace({"components.left.bore": "40 mm"}).components["left"].bore_m == 0.04
    other = circuit.replace({"components.inlet.kv": 0.4}).components["inlet"].to_dict()
    assert "conductance" not in other


def test_what_counts_for_the_hash():
    circuit = pn.Circuit.load(EXAMPLE)
    named = circuit.replace({"name": "other", "labels": {"by": "me"}, "initial": {}})
    assert named.description_hash == circuit.description_hash
    assert circuit.replace({"components.left.bore": "40 mm"}).description_hash != circuit.description_hash


def test_python_and_file_give_the_same_circuit():
    tables = {
        "components": {
            "tank": {"kind": "tank", "volume": "2 l"},
            "nozzle": {"kind": "fitting", "nominal_flow": "300 l/min ANR", "critical_pressure_ratio": 0.5},
        },
        "connections": ["tank -> nozzle -> ambient"],
    }
    text = """
connections = ["tank -> nozzle -> ambient"]
[components]
tank = { kind = "tank", volume = "2 dm3" }
nozzle = { kind = "fitting", nominal_flow = "300 l/min ANR", critical_pressure_ratio = 0.5 }
"""
    circuit = pn.Circuit(**tables)
    assert circuit.core_json() == pn.Circuit.load(text).core_json()
    nozzle = json.loads(circuit.core_json())["components"][1]["numbers"]
    valve = pn.Valve(kind="proportional-5/3", nominal_flow="300 l/min ANR", critical_pressure_ratio=0.5)
    assert nozzle["conductance"] == valve.conductance_m3_s_pa


def test_a_plugged_port_is_a_joint_of_its_own():
    text = changed(
        ('    "valve_r.2 -> fc_rb -> right.b",\n', ""),
        ("schema = 1", 'schema = 1\nplugged = ["valve_r.2", "right.b"]'),
        (', "fc_rb"]', "]"),
    )
    circuit = pn.Circuit.load(text)
    assert ["valve_r.2"] in json.loads(circuit.core_json())["joints"]
    assert circuit.simulate({"valve_r": 1.0}, "0.1 s")["right.b.pressure"][-1] > 1.1e5


def test_starts_settle_over_what_is_always_open():
    """Over the fitting from the mains, over the needle of a flow control; not over the valve."""
    circuit = pn.Circuit.load(EXAMPLE)
    start = circuit.core_initial()
    assert start["tank.pressure_pa"] == start["left.b.pressure_pa"] == start["valve_l.2.pressure_pa"] == 701325.0
    assert start["left.a.pressure_pa"] == start["valve_l.4.pressure_pa"] == 101325.0
    assert start["left.position_m"] == 0.0
    assert "the joint of valve_l.2 has 0.4 cm3, from the volumes of its ports" in circuit.assumed()
    assert "tank starts at 7.01325 bar abs, the pressure of mains" in circuit.assumed()
    assert "valve_l.2 starts at 7.01325 bar abs, like left.b" in circuit.assumed()
    given = circuit.core_initial({"tank": "3 bar abs", "fc_la.1.pressure": "2 bar abs", "left": {"position": "5 mm"}})
    assert (given["tank.pressure_pa"], given["valve_l.4.pressure_pa"], given["left.position_m"]) == (3e5, 2e5, 0.005)
    assert given["left.a.pressure_pa"] == 2e5


def test_a_circuit_is_no_drive():
    with pytest.raises(DescriptionError, match="describes a circuit") as caught:
        pn.Drive.load(EXAMPLE)
    assert "pn.Circuit.load" in str(caught.value)


def test_the_schema_takes_the_example():
    jsonschema = pytest.importorskip("jsonschema")
    tomllib = pytest.importorskip("tomllib")
    schema = circuit_schema()
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    held = kind(schema)
    tables = tomllib.loads(TEXT)
    held.validate(tables)
    tables["components"]["inlet"] = {"use": "catalogue:smc-kqgh06-01s", "conductance": "1 dm3/(s bar)"}
    tables["components"]["tank"]["volume"] = {"value": "0.5 l", "source": "name plate"}
    held.validate(tables)
    tables["components"]["tank"]["volum"] = "1 l"
    with pytest.raises(jsonschema.ValidationError):
        held.validate(tables)


SHIPPED = {
    "layout": ROOT.glob("data/measurements/*/layout.toml"),
    "rig": shipped_rigs().values(),
    "protocol": ready_protocols().values(),
    "task": ROOT.glob("examples/sizing/*.toml"),
}


@pytest.mark.parametrize(("kind", "file"), [(kind, file) for kind, files in SHIPPED.items() for file in files])
def test_the_printed_schema_takes_shipped_files_and_finds_a_wrong_key(kind, file, printed):
    jsonschema, tomllib = pytest.importorskip("jsonschema"), pytest.importorskip("tomllib")
    schema = json.loads(printed(["schema", kind]))
    held = jsonschema.validators.validator_for(schema)(schema)
    tables = tomllib.loads(file.read_text())
    held.validate(tables)
    if kind != "rig":  # own kinds of rigs have further keys
        assert not held.is_valid(tables | {"colour": "red"})


def test_a_frozen_description_says_how_to_change_it():
    drive = pn.Drive.load("catalogue:reference")
    with pytest.raises(DescriptionError, match=r'drive.replace\(\{"cylinder.bore": "32 mm"\}\)'):
        drive.cylinder.bore = "32 mm"


def test_what_lies_behind_a_regulator_starts_at_its_set_pressure():
    """Also where the tank is behind a hose; the mains is not reached through the regulator."""
    circuit = pn.Circuit.load(EXAMPLE.with_name("one_cylinder_with_lines.toml")).replace({"initial": {}})
    start = circuit.core_initial()
    assert start["tank.pressure_pa"] == start["regulator.2.pressure_pa"] == 701325.0
    assert "tank starts at 7.01325 bar abs, the pressure of regulator" in circuit.assumed()
    assert start["valve.4.pressure_pa"] == 101325.0
    # Half of a tube of 4 mm and 1 m, and the port of the valve.
    assert "the joint of valve.4 has 6.48 cm3, from the volumes of its ports" in circuit.assumed()


def test_a_number_that_is_zero_is_given():
    spring = {"kind": "spring", "stiffness": "100 N/m", "rest_position": "0 mm"}
    assert components.component(spring).rest_position_m == 0.0


VALVE = {"kind": "valve/proportional-5/3", "conductance": "1 dm3/(s bar)", "critical_pressure_ratio": 0.3}
CONTROL = {"kind": "flow-control", "needle_conductance": "0.1 dm3/(s bar)"}


def test_what_has_no_effect_is_not_assumed_and_is_told_where_it_is_given():
    ideal, slow = components.component(VALVE), components.component(VALVE | {"frequency": "100 Hz"})
    keys = [{line.split(" ")[0] for line in one.assumed()} for one in (ideal, slow)]
    assert keys[1] - keys[0] == {"damping_ratio", "stroke_time"}
    assert "leakage_width" not in keys[1]
    circuit = pn.Circuit.load(EXAMPLE)
    assert circuit.notes == []
    timed = circuit.replace({"components.valve_l.stroke_time": "5 ms"})
    assert timed.notes == ["valve_l.stroke_time has no effect without frequency"]
    regulator = {"kind": "regulator", "set_pressure": "5 bar abs", "conductance": "1 dm3/(s bar)"}
    shut = components.component(regulator | {"relieving": "no", "relief_rise": "0.1 bar"})
    assert list(shut.idle) == ["relief_rise has no effect without relieving = 'yes'"]
    assert not any(line.startswith("relief") for line in shut.assumed())
    assert any(line.startswith("relief_rise") for line in components.component(regulator).assumed())


def test_the_check_valve_of_a_flow_control_has_the_name_of_before_too():
    now, before = ({f"{name}nominal_flow": "60 l/min ANR"} for name in ("check_", ""))
    one, other = (components.component(CONTROL | own) for own in (now, before))
    assert one == other
    assert other.to_dict()["check_nominal_flow"] == "60 l/min ANR"
    with pytest.raises(DescriptionError, match="check_conductance is given twice"):
        components.component(CONTROL | dict.fromkeys(("conductance", "check_conductance"), "1 dm3/(s bar)"))


def test_default_end_stops_are_told_with_what_they_follow_from():
    lines = {line.split(" ")[0]: line for line in pn.Circuit.load(EXAMPLE).assumed()}
    said = lines["left.end_stop_stiffness"]
    number = r"([\d.e]+)"
    found = re.search(f"= {number} N/m, .* {number} kg at {number} m/s, .* {number} N, stops in {number} mm", said)
    k, mass, speed, force, depth = map(float, found.groups())
    assert k == pytest.approx((mass * speed**2 + 2.0 * force * 1e-3 * depth) / (1e-3 * depth) ** 2, rel=0.02)
    beyond = float(re.search(f"presses the piston {number} mm beyond", said)[1])
    assert beyond == pytest.approx(1e3 * force / k, rel=0.05)


def test_what_is_assumed_of_end_stops_follows_from_the_start():
    tables = {
        "components": {
            "left": {"kind": "cylinder/rodless", "bore": "32 mm", "stroke": "200 mm", "moving_mass": "1 kg"}
            | {"dead_volume": {"a": "10 cm3", "b": "10 cm3"}, "friction": {"law": "coulomb", "coulomb": "20 N"}}
        },
        "plugged": ["left.a", "left.b"],
    }

    def force(pressure: str) -> float:
        given = pn.Circuit.model_validate(tables | {"initial": {"left.a": pressure}})
        (line,) = (line for line in given.assumed() if line.startswith("left.end_stop_stiffness"))
        return float(line.partition("driven by ")[2].split(" N")[0])

    area = 0.25 * math.pi * 0.032**2
    assert force("8 bar abs") - force("1 bar abs") == pytest.approx((8e5 - 101325.0) * area, rel=0.01)
    assert force("1 bar abs") == force("0.5 bar abs")


def test_a_wrong_value_is_found_under_its_name_of_before(tmp_path):
    text = changed(('check_conductance = "0.8 dm3/(s bar)"', 'conductance = "-1 dm3/(s bar)"'))
    path = tmp_path / "circuit.toml"
    path.write_text(text)
    line = 1 + text.splitlines().index('conductance = "-1 dm3/(s bar)"')
    with pytest.raises(DescriptionError, match=f"circuit.toml:{line}"):
        pn.Circuit.load(path)


def test_a_copy_with_other_fields_computes_what_follows_from_them_again():
    circuit = pn.Circuit.load(EXAMPLE)
    wanted = circuit.replace({"ambient.pressure": "0.9 bar abs"})
    assert circuit.assumed() != wanted.assumed()
    copied = circuit.model_copy(update={"ambient": wanted.ambient})
    assert (copied.assumed(), copied.system) == (wanted.assumed(), wanted.system)
