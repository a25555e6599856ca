"""What a law chooses, factors of its gains, the answer to a fallen supply: from files to runs, and what is refused."""

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


@pytest.mark.parametrize(
    ("law", "chosen"),
    [
        ("nmpc", '[nmpc]\npredictor = "circuit"'),
        ("pid", "[factors]\ngain = 2\nfilter = 0.5"),
    ],
)
def test_a_choice_goes_through_a_file_into_a_run(law, chosen, axis, tmp_path):
    usual, file = pn.control.tune(axis, law), tmp_path / "controller.toml"
    file.write_text(f'schema = 1\nlaw = "{law}"\n{chosen}\n')
    given = pn.control.tune(axis, controller=file)
    again = pn.control.tune(axis, controller=given.save(tmp_path / "again.toml"))
    assert again.core() == given.core() != usual.core()
    run, other = ran(axis, file), ran(axis, usual.save(tmp_path / "usual.toml"))
    assert np.abs(run.command - other.command).max() > 1e-4, "it changes the run"
    assert float(run.position[-1] - run.position[0]) > 2e-3, "it leads the drive"


def test_factors_change_gains_while_a_drive_runs(axis, tmp_path):
    file = tmp_path / "setup.toml"
    file.write_text('schema = 1\n[[factors]]\nat = "0.15 s"\ngain = 3\n')
    run, usual = (
        pn.control.run(axis, "pid", reference=MOVE, duration="0.3 s", setup=setup)
        for setup in (file, pn.control.Setup())
    )
    same = (run.command == usual.command).values
    assert same[:151].all()
    assert not same[151:].all()
    late = (np.abs(one.reference - one.position)[-100:].mean() for one in (run, usual))
    assert float(next(late)) < float(next(late)), "a larger gain leaves less of the error"


def test_a_reference_is_slowed_on_a_fallen_supply(axis):
    fallen = pn.control.Setup(faults=[{"kind": "supply-fallen", "at": "1.5 s", "value": "2.6 bar"}]).faults
    setup = pn.control.read_setup("real")[0].model_copy(update={"faults": fallen})
    on_fault = {"supply": "slow"}
    run = pn.control.run(
        axis,
        controller=pn.control.Controller(law="inversion", on_fault=on_fault),
        reference="sine 120 mm 1.6 Hz around 250 mm",
        setup=setup,
        duration="5 s",
    )
    told = [one["value"] for one in run.attrs["events"] if one["kind"] == "slowed"]
    assert told == sorted(told)
    assert 1.2 < told[-1] < 3.0
    late = np.abs(run.reference - run.position)[3000:]
    assert float(late.max()) < 6e-3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('law = "nmpc"\n[nmpc]\npredictor = "circuits"', "nmpc.predictor: 'circuits' is not known"),
        ('law = "pid"\n[nmpc]\npredictor = "circuit"', 'a table [nmpc] and law = "pid"'),
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


def test_moves_of_switching_valves_are_no_plan_for_a_circuit():
    switching = pn.Circuit.load(AXIS.parent / "axes/switching.toml")
    with pytest.raises(DescriptionError, match=r"in_a, out_a, in_b, out_b switches"):
        pn.control.tune(switching, controller=pn.control.Controller(law="nmpc", nmpc={"predictor": "circuit"}))


def test_friction_that_sticks_exactly_is_no_plan_for_a_circuit(axis):
    """No opening moves a piston in stick: the drive stood still, for good and without a word."""
    friction = {"law": "coulomb", "coulomb": "30 N", "viscous": "40 N s/m"}
    told = {"controller": pn.control.Controller(law="nmpc", nmpc={"predictor": "circuit"})}
    with pytest.raises(DescriptionError, match=r"cylinder.friction of the law coulomb, which sticks exactly"):
        pn.control.tune(axis.replace({"components.cylinder.friction": friction}), **told)
    assert pn.control.tune(axis, **told).choices == {"predictor": "circuit"}


def test_factors_of_a_run_are_checked_before_it(axis):
    changed = pn.control.Setup(factors=[{"at": "0.1 s", "filter": 2.0}])
    with pytest.raises(pn.errors.CommandError, match=r"the law nmpc does not use it"):
        pn.control.run(axis, "nmpc", reference=MOVE, setup=changed, duration="0.3 s")


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


def test_a_spring_at_the_rod_is_no_part_of_a_horizon_by_the_circuit(tmp_path):
    text = AXIS.read_text().replace('"valve.2 -> cylinder.b"]', '"valve.2 -> cylinder.b", "cylinder.rod -> spring.1"]')
    spring = '[components.spring]\nkind = "spring"\nstiffness = "500 N/m"\nrest_position = "0.1 m"\n'
    (tmp_path / "axis.toml").write_text(f"{text}\n{spring}")
    sprung = pn.Circuit.load(tmp_path / "axis.toml")
    assert pn.control.tune(sprung, "nmpc").plant.left_out == ["spring"]
    with pytest.raises(DescriptionError, match=r"spring\.1 is at the rod, and its force is in the unknown one"):
        pn.control.tune(sprung, controller=pn.control.Controller(law="nmpc", nmpc={"predictor": "circuit"}))


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
