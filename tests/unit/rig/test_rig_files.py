"""Rig files extend one another; what does not fit together is refused with one message."""

from __future__ import annotations

import pytest

from pneudrive.errors import DescriptionError
from pneudrive.rig import SimulatedRig, shipped_rigs
from pneudrive.rig.description import DEFAULT, bare, read_description

ASSUMED = 'source = "assumed", reason = "for this test"'


def written(tmp_path, text, name="rig.toml"):
    path = tmp_path / name
    path.write_text("schema = 1\n" + text, encoding="utf-8")
    return path


def test_a_file_takes_what_it_does_not_say_from_the_one_that_it_extends(tmp_path):
    text = f'extends = "common-manifold"\nname = "Mine"\n[cylinder]\nbore = {{ value = "32 mm", {ASSUMED} }}\n'
    base = read_description(shipped_rigs()["common-manifold"])
    mine = read_description(written(tmp_path, text))
    assert mine.name == "Mine"
    assert mine.tables.cylinder.bore == 0.032
    assert mine.tables.chambers == base.tables.chambers
    assert mine.sources["cylinder.bore"].reason == "for this test"
    again = f'extends = "rig.toml"\n[cylinder]\nstroke = {{ value = "200 mm", {ASSUMED} }}\n'
    beside = read_description(written(tmp_path, again, "second.toml"))
    assert (beside.tables.cylinder.bore, beside.stroke_m) == (0.032, 0.2)


def test_another_law_takes_no_values_of_the_old_one(tmp_path):
    text = f'extends = "default"\n[friction]\nlaw = "coulomb"\ncoulomb = {{ value = "7 N", {ASSUMED} }}\n'
    mine = read_description(written(tmp_path, text))
    assert mine.parameters == {"coulomb": 7.0, "viscous": 0.0}
    assert mine.pressure == read_description(DEFAULT).pressure
    assert SimulatedRig(mine).true_friction(0.1) == pytest.approx(7.0)


def test_a_list_of_the_friction_table_gives_its_source_once(tmp_path):
    values = {"coulomb": "20 N", "breakaway": "28 N", "stribeck_velocity": "20 mm/s", "attraction": "2000 N/s"}
    lines = [f'{key} = {{ value = "{value}", {ASSUMED} }}' for key, value in values.items()]
    elements = '[{ stiffness = "4e4 N/m", share = 0.15 }, { stiffness = "6e4 N/m", share = 0.85 }]'
    head = ['extends = "default"', "[friction]", 'law = "gms"', f"elements = {{ value = {elements}, {ASSUMED} }}"]
    mine = read_description(written(tmp_path, "\n".join([*head, *lines]) + "\n"))
    assert mine.dependences["elements"] == [
        {"stiffness_n_m": 4e4, "share": 0.15},
        {"stiffness_n_m": 6e4, "share": 0.85},
    ]
    assert SimulatedRig(mine).true_friction(1e-4) == pytest.approx(28.0, abs=0.02)


@pytest.mark.parametrize(("text", "value"), [("2", 2.0), (" 2e0 ", 2.0), ("50 %", 0.5), (" 50%", 0.5), ("2 N", "2 N")])
def test_pure_numbers_stand_in_quotes(text, value):
    assert bare(text) == value


def extending(table, key, value):
    return f'extends = "default"\n[{table}]\n{key} = {{ value = "{value}", {ASSUMED} }}\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('extends = "rig.toml"\n', "extends itself"),
        ('extends = "nothing"\n', "there is no file"),
        (extending("chambers", "kind", "common"), "chambers.dead_volume is missing"),
        (extending("servo", "bandwidth", "50 Hz"), "are needed together"),
        (extending("servo", "ripple", "1 %"), "needs servo.pitch"),
        (extending("servo", "ripple", "-1 %"), "(?s)servo.ripple: -0.01 is out of bounds.*not less than 0"),
        (extending("servo", "ripple", "100 %"), "(?s)servo.ripple: 1.0 is out of bounds.*less than 1"),
        (extending("thermal", "room_amplitude", "1 degC"), "(?s)not a difference of temperatures.*in K"),
        (extending("cylinder", "rod_diameter", "25 mm"), "is not smaller than the bore"),
        (extending("mounting.odd", "side_lode", "5 N"), "side_lode is not a known key"),
        (extending("friction", "coulomb", "9 mm"), "friction.coulomb"),
        (extending("friction", "sigma", "9 N"), "friction.sigma is not a known key"),
        (extending("friction", "law", "gms"), "friction.law takes a name without a source"),
        (extending("encoder", "resolution", "1 um").replace(" }", ', sauce = "x" }'), "'sauce' is unknown"),
    ],
)
def test_files_that_do_not_fit_together(tmp_path, text, message):
    with pytest.raises(DescriptionError, match=message):
        read_description(written(tmp_path, text))
