"""Every drive of the catalogue simulates, and every value has a source that is in references.bib, or a reason."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive import _core, units
from pneudrive.cli.main import run
from pneudrive.cli.main import run as command
from pneudrive.describe.components import component, component_class
from pneudrive.describe.files import catalogue
from pneudrive.describe.files.catalogue import find_parts
from pneudrive.describe.tables.parts import piston_areas
from pneudrive.errors import DescriptionError, PneudriveWarning
from pneudrive.references import bibtex
from pneudrive.sizing.task import SizingTask, choices

DRIVES = [name for name, e in catalogue.entries().items() if e.is_drive]
PARTS = [e for e in catalogue.entries().values() if not e.is_drive]

#: What the parts leave open, so that each can be read as a component.
REST = {
    "stroke": "100 mm",
    "dead_volume": {"a": "5 cm3", "b": "5 cm3"},
    "moving_mass": "1 kg",
    "friction": {"law": "coulomb", "coulomb": "10 N"},
    "length": "1 m",
    "time_on": "10 ms",
    "time_off": "10 ms",
    "conductance": "1 dm3/(s bar)",
    "needle_conductance": "0.1 dm3/(s bar)",
    "check_conductance": "1 dm3/(s bar)",
}

# What a trajectory calls its drive: another hash means that runs of before are of another drive.
HASHES = {
    "festo-dsbg-32-100-sy3000": "e9e24076503d6829a995a31af60a07cf7134cb67a3b4a802f8ab25bed9221946",
    "parker-osp-p25-mpye": "9dc314f003b138b6e56e9830e21a6cbeb8903b83bdcc558b1715f505e3891b26",
    "parker-osp-p25-sy5000": "cf5fe7a65d5e2a31e824ae2d359f9be78e6c952fadc67572b1f0ae735eb1cc49",
    "parker-osp-p40-sy7000": "e39e971af136b0c77d5ec7e83cd267404e00625aaab0936131e3b5ef77a80a16",
    "reference": "6dd42b38838bd530334e75ffcda9d794a940c8a1734304a60ebb3537f6798480",
    "smc-cm2y-25-sy3000": "de20e0d7a61fa5378054adfdcdfdec8cdfb7bb90a1326d11605597e64700e115",
    "starter": "ba4426f8031ac433e4adcfcebde4b08e8a98934760d51a1ce663dd4cdd2ee39b",
}


def test_a_description_keeps_its_hash():
    assert {name: pn.Drive.load(f"catalogue:{name}").description_hash for name in DRIVES} == HASHES


def test_no_entry_is_on_or_off_and_proportional_and_no_note_is_stale():
    for entry in catalogue.entries().values():
        said = " ".join([entry.title, entry.note, *(str(one.value) for one in entry.printed)])
        assert not (entry.kind.startswith("valve/proportional") and re.search("switch|solenoid|on/off", said)), (
            entry.name
        )
        assert "not part of the model" not in entry.note


def test_the_catalogues_on_off_valves_refuse_fractions_everywhere(tmp_path, refusal):
    name = "catalogue:parker-osp-p25-sy5000"
    message = refusal(["simulate", name, "--command", "0.3", "--duration", "0.1 s"])
    assert all(words in message for words in ("command = 0.3 at 0 s", "-1, 0 or 1", "use a proportional valve"))
    text = CIRCUIT.replace('[components.left]\nuse = "catalogue:ours"', OWN_CYLINDER)
    (tmp_path / "old.toml").write_text(text.replace('law = "coulomb"', 'law = "coulomb", coulomb = "9 N"'))
    old = pn.Circuit.load(tmp_path / "old.toml")
    drive = pn.Drive.load(name)
    for call in (
        lambda: pn.simulate(drive, lambda t: 0.5, "10 ms"),
        lambda: pn.simulate_many(drive, [1.0, 0.3], "10 ms", vary={"supply.pressure": ["5 bar gauge"] * 2}),
        lambda: pn.Differentiable(drive, 0.6, "10 ms", vary=["friction.coulomb"], outputs=["final(position)"]),
        lambda: drive.start().set("command", 0.3),
        lambda: pn.simulate(old, {"valve": 0.3}, "10 ms"),
        lambda: pn.linearise(drive),
    ):
        with pytest.raises(pn.PneudriveError) as refused:
            call()
        assert all((refused.value.rule, refused.value.remedy)), refused.value
    with pytest.raises(pn.PneudriveError, match=r"valve\.overlap belongs to a proportional valve"):
        drive.replace({"valve.overlap": 0.02})
    delayed = (tmp_path / "old.toml").read_text().replace("nominal_flow", 'delay = "5 ms"\nnominal_flow')
    (tmp_path / "delayed.toml").write_text(delayed)
    with pytest.raises(pn.PneudriveError, match=r"valve\.delay is not a known key") as refused:
        pn.Circuit.load(tmp_path / "delayed.toml")
    assert "time_on" in str(refused.value.remedy)


def test_every_value_has_a_source_or_a_reason():
    values = [v for e in catalogue.entries().values() for v in e.values]
    for v in values:
        assert bibtex(v.source).startswith("@") if v.source else v.assumed
    real = [name for name in DRIVES if name != "reference"]
    assert len(real) >= 3
    for name in real:
        assert any(v.source for v in catalogue.all_values(catalogue.entry(name)))


def si(value):
    """Return the SI number of a printed figure."""
    number, unit = value.split(" ", 1)
    known = {"N": "N", "mm2": "m^2", "cm2": "m^2", "l": "m^3", "l/min ANR": "m^3/s ANR"}
    return units.parse(f"{number} {unit}", known[unit])


def made(part):
    table = catalogue.part_table(f"catalogue:{part.name}")
    own = {
        key: given
        for key, given in REST.items()
        if any(one.startswith(key) or one.endswith(f" {key}") for one in part.open)
    }
    return component(component_class(part.kind).over(table, own))


def test_each_part_is_a_component_once_what_it_leaves_open_is_given():
    assert len(PARTS) >= 90
    for part in PARTS:
        one = made(part)
        assert one.kind == part.kind
        assert len([v for v in one.origins.values() if v.source]) + len(list(one.assumed())) >= len(part.values) - 1


def test_printed_figures_come_out_of_the_model():
    """Nominal flow from C and b, force from the bore, C from the effective area, areas, air of a cycle."""
    checked = 0
    for part in PARTS:
        printed = {v.key: v.value for v in part.printed}
        one = made(part)
        numbers = one.numbers(1.013e5)
        if "nominal_flow" in printed:
            flow = numbers["conductance"] * 7e5 * _core.flow_ratio(6 / 7, numbers["critical_pressure_ratio"], 0.5)
            assert flow * 6e4 == pytest.approx(si(printed["nominal_flow"]) * 6e4, abs=0.5), part.name
            checked += 1
        if "theoretical_force_6bar" in printed:
            force = 6e5 * math.pi / 4 * numbers["bore"] ** 2
            assert force == pytest.approx(si(printed["theoretical_force_6bar"]), rel=6e-3), part.name  # OSP-P16: 0.5 %
            checked += 1
        if "effective_area" in printed:  # C in dm3/(s bar) is S in mm2 over 5, as printed with three digits
            area = si(printed["effective_area"]) * 1e6
            assert numbers["conductance"] * 1e8 == pytest.approx(area / 5.0, rel=4e-3), part.name
            checked += 1
        if "area_b" in printed:
            areas = piston_areas("single-rod", numbers["bore"], numbers["rod_diameter"])
            assert areas == pytest.approx([si(printed["area_a"]), si(printed["area_b"])], rel=6e-4)
            air = 7.0 * 0.05 * sum(areas)
            assert air == pytest.approx(si(printed["air_per_cycle_50mm_6bar"]), rel=2e-3)  # printed with pi = 3.14
            checked += 1
    assert checked == 4 + 8 + 13 + 1


PART = (Path(__file__).parents[1] / "data/catalogue_cylinder.toml").read_text("utf-8")
CIRCUIT = (Path(__file__).parents[1] / "data/catalogue_circuit.toml").read_text("utf-8")

OWN_CYLINDER = """[components.left]
kind = "cylinder/rodless"
bore = "20 mm"
dead_volume = { a = "5 cm3", b = "5 cm3" }"""


@pytest.fixture
def shelf(tmp_path):
    folder = tmp_path / "shelf"
    folder.mkdir()
    (folder / "ours.toml").write_text(PART)
    (tmp_path / "circuit.toml").write_text(CIRCUIT)
    return folder


def test_a_component_uses_a_part_and_own_keys_override(shelf, tmp_path, capsys):
    file, out = str(tmp_path / "circuit.toml"), tmp_path / "run.parquet"
    asked = ["simulate", file, "--command", "1", "--duration", "0.1 s", "--out", str(out)]
    assert run([*asked, "--catalogue", str(shelf)]) == 0
    capsys.readouterr()
    assert run(asked) == 2  # the folder counts for the command that names it
    assert "the catalogue has no part 'ours'.   " + f"{file}:10" in capsys.readouterr().err
    with pn.catalogue_folders(shelf):
        circuit = pn.Circuit.load(file)
    left = circuit.components["left"]
    assert (left.bore_m, left.stroke_m, left.dead_volume_b_m3, left.friction.coulomb) == (0.02, 0.09, 5e-6, 9.0)
    assert circuit.components["valve"].plain() == {
        "kind": "valve/switching-5/3",
        "critical_pressure_ratio": 0.28,
        "nominal_flow": "200 l/min ANR",
        "time_on": "0.02 s",
        "time_off": "0.03 s",
    }
    sheet = "Our sheet, drawer 3, 2026-11-02"
    assert set(circuit.sources()) == {
        "valve.critical_pressure_ratio = 0.28 [smc-eus11-83]",
        f"left.bore = 20 mm [{sheet}]",
        f"left.friction.coulomb = 9 N [{sheet}]",
    }
    assert "left.dead_volume_b = 5 cm3, measured with water once" in circuit.assumed()
    assert not any("left.stroke" in line for line in circuit.assumed())  # it is the user's own
    ran = circuit.simulate(1.0, "0.01 s", sample_rate="100 Hz")
    assert "smc-eus11-83" in ran.attrs["citations"]
    # What is written needs no catalogue, and keeps what is known of the values.
    again = pn.Circuit.load(circuit.to_toml())
    assert again.core_json() == circuit.core_json()
    assert (again.sources(), again.assumed()) == (circuit.sources(), circuit.assumed())
    assert circuit.replace({"left.bore": "21 mm"}).sources()[-1].startswith("left.friction.coulomb")


def test_a_part_of_ones_own_takes_the_place_of_another(shelf):
    (shelf / "smc-sy3000.toml").write_text(
        'title = "x"\n[values]\nkind = { value = "fitting", assumed = "x" }\n'
        'conductance = { value = "1 dm3/(s bar)", assumed = "x" }\n'
    )
    with pn.catalogue_folders(shelf), pytest.warns(PneudriveWarning, match="smc-sy3000 of .* replaces"):
        assert catalogue.entry("smc-sy3000").kind == "fitting"
    assert catalogue.entry("smc-sy3000").kind == "valve/switching-5/3"


def test_a_law_in_one_value_is_read_alike_by_circuit_and_sizing_and_other_printed_keys_are_told(shelf):
    law = (
        '{ value = { law = "stribeck", coulomb = "25 N", breakaway = "35 N", viscous = "9 N s/m" }, assumed = "once" }'
    )
    text = PART.replace(
        'friction.coulomb = { value = "9 N", source = "sheet", note = "printed as 0.9 kgf" }', f"friction = {law}"
    )
    assert law in text
    (shelf / "ours.toml").write_text(text + '\n[printed]\nmax_impact_energy = { value = "1 J", assumed = "x" }\n')
    task = {"mass": "1 kg", "stroke": "90 mm", "time": "1 s", "supply": {"pressure": "6 bar gauge"}}
    with (
        pn.catalogue_folders(shelf),
        pytest.warns(PneudriveWarning, match="printed.max_impact_energy of ours.* Known: .*max_load"),
    ):
        made = next(one for one in choices(SizingTask(**task))["cylinder"] if one.name == "ours")
    numbers = [made.numbers[f"friction.parameters.{key}"] for key in ("coulomb", "breakaway", "viscous")]
    assert (numbers, "friction.coulomb" in made.assumed) == ([25.0, 35.0, 9.0], True)
    with pn.catalogue_folders(shelf), pytest.warns(PneudriveWarning):
        assert catalogue.part_table("catalogue:ours")["friction"]["coulomb"] == {"value": "25 N", "assumed": "once"}


SHELF_FAULTS = {
    "both": (
        ('assumed = "ordered so"', 'assumed = "x", source = "sheet"'),
        "stroke has both a source and",
        ":6",
        "Write",
    ),
    "source": (
        ('"20 mm", source = "sheet"', '"20 mm", source = "shet"'),
        'source "shet" is not known',
        ":5",
        "[sources.shet]",
    ),
    "key": (("title", "tilte"), "tilte is not a known key", ":1", "Did you mean 'title'?"),
    "unknown kind": (("cylinder/rodless", "cylinder/rodles"), "kind = 'cylinder/rodles' is not known", ":4", "rodless"),
    "no key of the kind": (("bore =", "bor ="), "ours: bor is not a known key", ":5", "Did you mean 'bore'?"),
    "inside a table": (('"5 cm3"', '"5 cm2"'), 'ours: dead_volume_b: unit "cm2" is an area', ":7", ""),
    "no kind": (
        ('kind = { value = "cylinder/rodless", source = "sheet" }\n', ""),
        "ours: kind is missing",
        "",
        "",
    ),
}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('title = "X"\nkind = "drive"\nvalues = 5', {"values: 5 is not a table": ":3"}),
        ('title = "X"\nkind = "drive"\nparts = ["a"]', {"parts = ['a'] is not a table": ":3"}),
        ('title = "X"\nkind = "drive"\nsources = 3', {"sources = 3 is not a table": ":3"}),
        ("part = [1]", {"part.0: 1 is not a table": ":1"}),
        (
            '[[part]]\nname = "a"\n[[part]]\nname = "b"\ntitle = "B"\nfoo = 2',
            {"part.0.title is missing": ":1", "part.1.foo is not a known key": ":6"},
        ),
    ],
)
def test_all_that_is_wrong_with_the_form_of_a_file_is_told_with_its_lines(tmp_path, text, told):
    (tmp_path / "own.toml").write_text(text)
    with pn.catalogue_folders(tmp_path), pytest.raises(DescriptionError) as caught:
        catalogue.entries()
    assert {one.what: one.where.removeprefix(str(tmp_path / "own.toml")) for one in caught.value.each()} == told


USE_FAULTS = {
    "unknown": (("catalogue:smc-sy3000", "catalogue:smc-sy300"), "has no part 'smc-sy300'", ":7", "smc-sy3000"),
    "a drive": (("catalogue:smc-sy3000", "catalogue:reference"), "has no part 'reference'", ":7", "Known"),
    "no catalogue": (("catalogue:smc-sy3000", "smc-sy3000"), "is not a part of the catalogue", ":7", "catalogue:NAME"),
    "kind": (
        ('moving_mass = "1 kg"', 'kind = "tank"'),
        "kind = 'tank', but catalogue:ours is a cylinder/rodless",
        ":11",
        "Remove kind",
    ),
    "left open": (('moving_mass = "1 kg"\n', ""), "left.moving_mass is missing", ":9", "a mass"),
    "own key": (('stroke = "90 mm"', 'strok = "90 mm"'), "left.strok is not a known key", ":12", "stroke"),
    "own source": (('"90 mm"', '{ value = "90 mm" }'), "stroke has neither a source", ":12", "Write"),
}


@pytest.mark.parametrize("fault", [*SHELF_FAULTS.values(), *USE_FAULTS.values()], ids=[*SHELF_FAULTS, *USE_FAULTS])
def test_a_fault_of_a_part_or_of_its_use_is_told_with_its_line(shelf, tmp_path, fault):
    (old, new), what, line, remedy = fault
    file, text = (shelf / "ours.toml", PART) if fault in SHELF_FAULTS.values() else (tmp_path / "circuit.toml", CIRCUIT)
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pn.catalogue_folders(shelf), pytest.raises(DescriptionError) as caught:
        pn.Circuit.load(tmp_path / "circuit.toml")
    assert len(caught.value.each()) == 1, str(caught.value)
    assert what in caught.value.what
    assert caught.value.where == f"{file}{line}"
    assert remedy in (caught.value.remedy or "")


def test_the_catalogue_lists_parts_and_what_they_leave_open(shelf, capsys, printed, refusal):
    listed = printed(["catalogue", "--catalogue", shelf])
    assert all(f"\n  {name} " in listed for name in catalogue.entries())
    assert "cylinder/rodless: Cylinder of ours (3 of 5 values with a source)" in listed
    for part in PARTS:
        assert run(["catalogue", part.name]) == 0
    capsys.readouterr()
    shown = printed(["catalogue", "ours", "--catalogue", shelf])
    assert "[Our sheet, drawer 3, 2026-11-02] printed as 0.9 kgf" in shown
    assert "Not in the catalogue; give these values with the part: moving_mass, the rest of friction." in shown
    refusal(["catalogue", "--catalogue", shelf / "no"], "there is no folder")


def test_parts_are_found_by_kind_bore_stroke_and_flow(printed):
    rodless = {one.name for one in find_parts("cylinder/rodless", bore="20 mm .. 25 mm")}
    assert rodless == {"parker-osp-p25", "smc-cy1b20h", "smc-cy1b25h", "smc-cy1b25l"}
    assert "festo-dsbg-32-100" in {one.name for one in find_parts("cylinder", stroke="100 mm")}
    longer = {one.name for one in find_parts("cylinder", stroke="200 mm .. 300 mm")}
    assert "festo-dsbg-32-100" not in longer
    assert "smc-cm2y-25" in longer  # made to order
    valves = {one.name for one in find_parts("valve", flow="700 l/min ANR .. 750 l/min ANR")}
    assert {"smc-sy5000", "festo-mpye-5-1-8-hf-010-b"} <= valves  # from C and b, and as printed
    assert {one.name for one in find_parts("*5/3", flow="4.5 dm3/(s bar)")} == {"smc-sy7000"}
    assert "smc-tu0604" in printed(["catalogue", "--kind", "tube"])
    for wrong in (["--kind", "vlave"], ["--bore", "3 kg"], ["--flow", "7"], ["smc-sy3000", "--kind", "valve"]):
        assert command(["catalogue", *wrong]) == 2
    assert find_parts("tube", bore="1 m") == []
