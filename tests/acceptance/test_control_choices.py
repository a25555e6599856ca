"""Factors of gains from files to runs, what is refused, and what was removed."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, DescriptionError

AXIS = Path(__file__).parents[2] / "examples/controlled_axis.toml"
SWITCHING = AXIS.parent / "axes/switching.toml"
MOVE = "240 mm; 50 ms: 245 mm in 0.15 s"


def ran(axis, file, **told):
    return pn.control.run(axis, controller=file, reference=MOVE, duration="0.3 s", **told)


def test_factors_go_through_a_file_into_a_run(axis, tmp_path):
    usual, file = pn.control.tune(axis, "pid"), tmp_path / "controller.toml"
    file.write_text('schema = 1\nlaw = "pid"\n[factors]\ngain = 2\nfilter = 0.5\n')
    given = pn.control.tune(axis, controller=file)
    again = pn.control.tune(axis, controller=given.save(tmp_path / "again.toml"))
    assert again.core() == given.core() != usual.core()
    run, other = ran(axis, file), ran(axis, usual.save(tmp_path / "usual.toml"))
    assert np.abs(run.command - other.command).max() > 1e-4, "it changes the run"
    assert float(run.position[-1] - run.position[0]) > 2e-3, "it leads the drive"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('law = "inversion"\n[factors]\ndamping = 2', "the law inversion does not use it; its factors are gain"),
        ('law = "pid"\n[factors]\ngain = 11', "not more than 10"),
        ('law = "pid"\ndrive = "gone.toml"', 'controller.toml:3\n    drive = "gone.toml"'),
        ('law = "inversion"\n[valves]\nstiffnes = "2 N/mm"', "valves.stiffnes is not a gain of these valves"),
        ('law = "inversion"\n[valves]\nstiffness = "-2 N/mm"', "out of bounds"),
    ],
)
def test_a_wrong_choice_is_told_with_its_place(text, says, tmp_path):
    file = tmp_path / "controller.toml"
    file.write_text(f"schema = 1\n{text}\n")
    with pytest.raises(DescriptionError) as caught:
        pn.control.tune(pn.Circuit.load(SWITCHING if "[valves]" in text else AXIS), controller=file)
    assert says in str(caught.value)
    assert "controller.toml" in str(caught.value)


@pytest.mark.parametrize(("mass_kg", "told"), [(3.0, None), (42.0, "little is left"), (55.0, "cannot move")])
def test_tune_says_where_the_supply_hardly_lifts_a_mass(mass_kg, told):
    upright = pn.Circuit.load(AXIS.parent / "axes/upright.toml")
    heavy = upright.replace({"components.cylinder.moving_mass": f"{mass_kg} kg"})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pn.control.tune(heavy, "pid")
    said = " ".join(str(one.message) for one in caught)
    # Weight and breakaway friction beside 7 bar abs under a bore of 32 mm; the rod points upwards.
    share = (mass_kg * 9.80665 + 40.0) / ((7e5 - 101325.0) * np.pi / 4 * 0.032**2)
    assert (f"take {100 * share:.0f} % of the force" in said) == (told is not None)
    assert told is None or told in said


def test_laws_know_friction_that_is_written_as_formulas(axis):
    """At rest such a law says that friction is none, as it has no direction there."""
    folder = AXIS.parent
    text = AXIS.read_text().replace('law = "lugre"', f'law = "file:{folder}/laws/lugre.toml"')
    written = pn.Circuit.load(text)
    run, same = (pn.control.run(one, "inversion", reference=MOVE, duration="0.3 s") for one in (axis, written))
    assert run.position.values.tobytes() == same.position.values.tobytes()


def test_tune_names_a_spring_at_the_rod_that_it_leaves_out():
    text = AXIS.read_text().replace('"valve.2 -> cylinder.b"]', '"valve.2 -> cylinder.b", "cylinder.rod -> spring.1"]')
    spring = '[components.spring]\nkind = "spring"\nstiffness = "500 N/m"\nrest_position = "0.1 m"\n'
    assert pn.control.tune(pn.Circuit.load(f"{text}\n{spring}"), "nmpc").plant.left_out == ["spring"]


def test_a_reference_that_is_lost_is_still_the_one_that_counts(axis):
    lost = pn.control.Setup(faults=[{"kind": "reference", "at": "0.1 s"}]).faults
    setup = pn.control.read_setup("real")[0].model_copy(update={"faults": lost})
    run = pn.control.run(axis, "inversion", reference=MOVE, duration="0.4 s", setup=setup)
    assert run.reference.values[-1] == pytest.approx(0.245)
    assert run.attrs["score"]["max_error_m"] > 1e-3


def test_tune_says_which_controller_suits_a_light_sticky_piston():
    """With half of its mass, sliding-mode loses the reference and pid oscillates; nmpc comes first."""
    rows = pn.control.suitability(pn.Circuit.load(AXIS.parent / "axes/starter.toml")).rows
    found = {row.key: row.value for row in rows}
    assert rows[0].key == "nmpc.suits"
    suits = [found[f"{law}.suits"] for law in ("nmpc", "sliding-mode", "pid")]
    assert suits == ["suits", "does not suit", "does not suit"]
    assert "loses the reference" in str(found["sliding-mode.because"])


# --- Several and switching valves under a law, and the choice of an observer: from files to runs, and what is refused.


def test_numbers_of_switching_valves_go_through_a_file_into_a_run(tmp_path):
    drive = pn.Circuit.load(SWITCHING)
    tuning = pn.control.tune(drive, "inversion")
    assert tuning.plant.valves == ["in_a", "out_a", "in_b", "out_b"]
    file = tmp_path / "controller.toml"
    file.write_text('schema = 1\nlaw = "inversion"\n[valves]\nstiffness = "1.6 N/mm"\n')
    given = pn.control.tune(drive, controller=file)
    told = {one.key: one.value for one in given.numbers if one.given}
    assert told == {"stiffness": pytest.approx(1600.0)}
    given.save(tmp_path / "again.toml")
    again = pn.control.tune(drive, controller=tmp_path / "again.toml")
    assert again.core() == given.core()
    run = pn.control.run(drive, reference=MOVE, controller=file, duration="0.25 s")
    commands = np.array([run[f"{name}.command"] for name in tuning.plant.valves])
    assert set(np.unique(commands)) == {0.0, 1.0}
    assert not (commands[0] * commands[1]).any(), "a chamber is never filled and vented"
    assert float(run.position[-1] - run.position[0]) > 2e-3, "it moves"


def test_tune_tells_the_cost_of_an_ideal_valve(printed):
    assert "spool_frequency 75 Hz" in printed(["control", "tune", "catalogue:reference", "--law", "super-twisting"])


def test_what_has_no_several_valves_says_so(tmp_path):
    file = tmp_path / "controller.toml"
    file.write_text('schema = 1\nlaw = "inversion"\n[valves]\nstiffness = "2 N/mm"\n')
    with pytest.raises(DescriptionError, match=r"the drive has one proportional 5/3 valve"):
        pn.control.tune(pn.Circuit.load(AXIS), controller=file)
    tuning = pn.control.tune(pn.Circuit.load(SWITCHING), "inversion")
    with pytest.raises(CommandError, match="one command"):
        pn.control.export(tuning, "c", tmp_path / "law")
    with pytest.raises(CommandError, match="one command"):
        pn.control.export(tuning, "fmu", tmp_path / "law.fmu")
    with pytest.raises(DescriptionError, match="spool is not modelled"):
        pn.control.run(pn.Circuit.load(SWITCHING), "inversion", reference=MOVE, mismatch="slow-spool")


@pytest.mark.parametrize("at", [[], ["2 s"]])
def test_switching_valves_tell_of_a_fallen_supply_and_of_no_other(at):
    """What a sensor tells late of a chamber that has just been shut is the flow before, no filling that fails."""
    told = pn.control.Setup(faults=[{"kind": "supply-fallen", "at": one, "value": "3 bar"} for one in at]).faults
    setup = pn.control.read_setup("real")[0].model_copy(update={"faults": told})
    run = pn.control.run(pn.Circuit.load(SWITCHING), "inversion", reference="R3", setup=setup, duration="7 s", seed=1)
    supplies = [one for one in run.attrs["events"] if one["kind"] == "supply"]
    assert len(supplies) == len(at)
    assert all(2.0 < one["time_s"] < 4.5 and one["value"] < 4.5e5 for one in supplies)


def test_a_valve_whose_flow_is_a_table_is_refused_with_a_way_out():
    """The remedy is not to add a conductance: a description takes one of the two."""
    text = AXIS.read_text()
    points = (
        '{ opening = -1, supply_2 = "2 dm3/(s bar)" }, { opening = 0 }, { opening = 1, supply_4 = "2 dm3/(s bar)" }'
    )
    text = text.replace('conductance = "2 dm3/(s bar)"', f"flow_table = [{points}]")
    for key in ("overlap = 0.02", "leakage = 0.003"):
        text = text.replace(key, "")
    with pytest.raises(DescriptionError, match=r"valve has a flow_table[\s\S]*leakage instead"):
        pn.control.tune(pn.Circuit.load(text))
