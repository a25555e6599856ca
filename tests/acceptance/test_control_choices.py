"""Factors of gains from files to runs, what is refused, and what was removed."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import DescriptionError

AXIS = Path(__file__).parents[2] / "examples/controlled_axis.toml"
MOVE = "240 mm; 50 ms: 245 mm in 0.15 s"


@pytest.fixture(scope="module")
def axis():
    return pn.Circuit.load(AXIS)


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
        ('law = "nmpc"\n[nmpc]\npredictor = "circuit"', "Leave the table out: the model is used"),
        ('law = "pid"\n[on_fault]\nsupply = "slow"', 'Use "tell", "stop" or "block", or a slower reference'),
        ('law = "inversion"\n[factors]\ndamping = 2', "the law inversion does not use it; its factors are gain"),
        ('law = "pid"\n[factors]\ngain = 11', "not more than 10"),
        ('law = "pva"', 'The controller "pva" was removed. Use "inversion"'),
        ('law = "pid"\n[observer]\nkind = "levant"\njerk = "400 m/s3"', "Leave the table out: kalman is used"),
        ('law = "fuzzy"\n[fuzzy]\ninference = "mamdani"', "Leave the table out: sugeno is used"),
        ('law = "pid"\n[on_fault]\nlaw = "pva"', 'The controller "pva" was removed. Use "inversion"'),
    ],
)
def test_a_wrong_choice_is_told_with_its_place(text, says, axis, tmp_path):
    file = tmp_path / "controller.toml"
    file.write_text(f"schema = 1\n{text}\n")
    with pytest.raises(DescriptionError) as caught:
        pn.control.tune(axis, controller=file)
    assert says in str(caught.value)
    assert "controller.toml" in str(caught.value)


def test_factors_of_a_setup_are_told_to_be_removed():
    with pytest.raises(DescriptionError, match=r"Give factors in the controller file"):
        pn.control.Setup(factors=[{"at": "0.1 s", "gain": 2.0}])


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


def test_laws_know_friction_that_is_written_as_formulas(axis, tmp_path):
    """At rest such a law says that friction is none, as it has no direction there."""
    folder = AXIS.parent
    text = AXIS.read_text().replace('law = "lugre"', f'law = "file:{folder}/laws/lugre.toml"')
    (tmp_path / "axis.toml").write_text(text)
    written = pn.Circuit.load(tmp_path / "axis.toml")
    run, same = (pn.control.run(one, "inversion", reference=MOVE, duration="0.3 s") for one in (axis, written))
    assert run.position.values.tobytes() == same.position.values.tobytes()


def test_tune_names_a_spring_at_the_rod_that_it_leaves_out(tmp_path):
    text = AXIS.read_text().replace('"valve.2 -> cylinder.b"]', '"valve.2 -> cylinder.b", "cylinder.rod -> spring.1"]')
    spring = '[components.spring]\nkind = "spring"\nstiffness = "500 N/m"\nrest_position = "0.1 m"\n'
    (tmp_path / "axis.toml").write_text(f"{text}\n{spring}")
    sprung = pn.Circuit.load(tmp_path / "axis.toml")
    assert pn.control.tune(sprung, "nmpc").plant.left_out == ["spring"]


def test_a_reference_that_is_lost_is_still_the_one_that_counts(axis):
    lost = pn.control.Setup(faults=[{"kind": "reference", "at": "0.1 s"}]).faults
    setup = pn.control.read_setup("real")[0].model_copy(update={"faults": lost})
    run = pn.control.run(axis, "inversion", reference=MOVE, duration="0.4 s", setup=setup)
    assert run.reference.values[-1] == pytest.approx(0.245)
    assert run.attrs["score"]["max_error_m"] > 1e-3


def test_tune_says_which_controller_suits_a_light_sticky_piston():
    """Half of its mass loses sliding-mode and the baselines; nmpc comes first."""
    found = pn.control.suitability(pn.Circuit.load(AXIS.parent / "axes/starter.toml"))
    assert found[0].law == "nmpc"
    assert found[0].suits
    by_law = {one.law: one for one in found}
    assert not by_law["sliding-mode"].suits
    assert "lost" in by_law["sliding-mode"].reason
    assert not by_law["pid"].suits
