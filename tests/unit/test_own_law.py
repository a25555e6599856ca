"""A friction law of one's own: from files and from Python into a drive, with one message for what is wrong."""

from __future__ import annotations

import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core
from pneudrive.batching import in_processes
from pneudrive.describe import FrictionLaw
from pneudrive.errors import DescriptionError, PneudriveWarning
from pneudrive.free.parameters import numbers_of

LAWS = Path(__file__).parents[2] / "examples" / "laws"
COMMAND = [(0.0, 0.6), (0.5, -0.4), (0.9, 0.05), (1.4, -1.0)]
FRICTION = (Path(__file__).parents[1] / "data" / "own_law_friction.toml").read_text("utf-8")
BUILT_IN = FRICTION.replace("file:laws/lugre.toml", "lugre")
ON_IT = """
pressure = { coulomb = { a = "2 N/bar", b = "1 N/bar" }, breakaway = { a = "2 N/bar", b = "1 N/bar" } }
dwell = { growth = "log", increment = "2 N", time = "50 ms", distance = "50 um" }
direction = { positive = 1.1, negative = 0.95 }
position = { slope = "20 %/m", reference = "250 mm" }
side_load = { force = "20 N", coefficient = 0.1 }
relaxation = { share = 0.3, time = "0.3 s", distance = "0.2 mm" }
"""


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(LAWS, tmp_path / "laws")
    return tmp_path


def load(folder, text):
    path = folder / "drive.toml"
    path.write_text(text)
    return pn.Drive.load(path)


def run(drive):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        return pn.simulate(drive, command=COMMAND, duration="2 s")


@pytest.mark.parametrize("more", ["", ON_IT], ids=["alone", "with all that acts on a law"])
def test_lugre_from_a_file_is_lugre(folder, more):
    """Every variable at every sample, bit for bit, and the same law again from what the drive writes."""
    built_in, own = load(folder, BUILT_IN + more), load(folder, FRICTION + more)
    expected, found = run(built_in), run(own)
    for name in expected.data_vars:
        np.testing.assert_array_equal(found[name].to_numpy(), expected[name].to_numpy(), err_msg=str(name))
    assert found.attrs["statistics"] == expected.attrs["statistics"]
    assert found.attrs["description_hash"] != expected.attrs["description_hash"]
    assert "canudas1995" in pn.citations(found)
    shutil.rmtree(folder / "laws")
    again = load(folder, own.to_toml())
    assert again.core_json() == own.core_json()
    assert again.friction == own.friction


def test_exact_sensitivities_go_through_formulas(folder):
    """By parameters that are levels, that are folded into constants, and by the start: those of the built-in law."""
    names = [
        f"cylinder.friction.parameters.{key}"
        for key in ("coulomb", "breakaway", "stribeck_velocity", "bristle_stiffness")
    ]
    start = np.array([[0.25, 0.0, 3e5, 293.15, 3e5, 293.15, 0.0]])
    outputs = ["position_m", "velocity_m_s", "pressure_a_pa", "friction_force_n"]

    def shoot(text):
        core = load(folder, text).system.compiled()
        asked = {"times": [0.0, 0.15], "commands": [0.3, -0.3], "sample_times": np.linspace(0.0, 0.3, 31)}
        asked |= {"starts": [0], "initial": start, "parameters": names, "with_initial": True}
        return core.shoot("command", asked | {"outputs": outputs, "rtol": 1e-8})

    built_in, own = shoot(BUILT_IN), shoot(FRICTION)
    assert not any(own["failures"])
    assert np.abs(own["sensitivities"][-1, 0]).min() > 0.0
    for key in ("values", "sensitivities", "ends", "end_sensitivities"):
        np.testing.assert_allclose(own[key], built_in[key], rtol=1e-9, err_msg=key)


def test_from_python(folder):
    law = FrictionLaw.load(LAWS / "lugre.toml")
    again = FrictionLaw.of(law.to_dict())
    assert (again, hash(again)) == (law, hash(law))
    (folder / "again.toml").write_text(law.to_toml())
    assert FrictionLaw.load(folder / "again.toml") == law
    drive = load(folder, FRICTION)
    values = {key: value for key, value in drive.friction.to_dict().items() if key != "law"}
    friction = pn.Friction(law=law, **values)
    assert friction == drive.friction
    assert drive.replace({"friction": friction}).core_json() == drive.core_json()
    assert drive.replace({"friction.coulomb": "20 N"}).friction.parameters["coulomb"] == 20.0
    built_in = drive.replace({"friction.law": "lugre"} | {f"friction.{k}": v for k, v in values.items()})
    assert built_in.friction.formula is None


def test_numbers_of_a_circuit_have_the_bounds_of_those_of_a_drive():
    law = FrictionLaw(
        name="sloped",
        parameters={"slope": {"unit": "N", "at_least": 0}, "force": {"unit": "N"}, "w": {"unit": "m/s", "above": 0}},
        force="(slope + force)*tanh(v/w)",
    )
    friction = pn.Friction(law=law, slope="1 N", force="2 N", w="1 mm/s")
    drive = pn.Drive.load("catalogue:reference").replace({"friction": friction})
    numbers, of_circuit = numbers_of(drive), numbers_of(drive.circuit)
    for name in ("friction.slope", "friction.force", "ambient.pressure", "ambient.temperature"):
        number, other = numbers[name], of_circuit[name.replace("friction", "cylinder.friction")]
        assert (number.lower, number.upper, number.size) == (other.lower, other.upper, other.size), name


def test_a_law_with_a_film_and_pressure_runs_and_feels_them(folder):
    text = FRICTION.replace("lugre.toml", "pressed_lip.toml")
    text = re.sub(r"(stribeck_velocity|bristle_\w+) = .*\n", "", text)
    drive = load(folder, text)
    film = run(drive).film
    assert float(film.min()) >= 0.0
    assert 0.5 < float(film.max()) < 1.0
    core = drive.friction.core()
    velocity = np.array([-0.3, 1e-3, 0.3])
    steady = lambda a: _core.steady_friction(  # noqa: E731
        core["law"], core["parameters"], velocity, a, 0.0, None, {"formula": core["formula"]}
    )
    speed = np.abs(velocity) / 0.02
    level = (45.0 - 15.0 * speed / (1.0 + speed)) * np.sign(velocity)
    np.testing.assert_allclose(steady(0.0), level + 200.0 * velocity, rtol=1e-12)
    np.testing.assert_allclose(steady(4e5), level * (1.0 + 0.5 * np.tanh(2.0)) + 200.0 * velocity, rtol=1e-12)


LUGRE = (LAWS / "lugre.toml").read_text()
# (old, new, what the message says, also), each in the file of lugre
REFUSED = [
    ("exp(-(v/stribeck", "exq(-(v/stribeck", "let.g: the function 'exq' is unknown (column 33)", "Did you mean 'exp'?"),
    ('"elastic + ', '"z + ', "+ needs the same unit on both sides, not m and N", "^^^"),
    (
        "v - abs(v)*elastic/g",
        "v - abs(v)*elastic/v",
        "states.z.rate: this divisor can be zero",
        "                       ^",
    ),
    ("*z*z", "*z", "output.energy: the formula gives N; J is needed", ""),
    ('rate = "v -', 'rate = "elastic*v -', "- needs the same unit on both sides", ""),
    ('rate = "v - abs(v)*elastic/g"', 'rate = "elastic"', "states.z.rate: the formula gives N; m/s is needed", ""),
    ("^2)", "^2", "let.g: this ( is not closed", "Add a )."),
    ("breakaway - coulomb", "breakaway coulomb", "a sign or ) is missing before this", "2*v"),
    ('elastic = "bristle_stiffness*z"', 'elastic = "g*z/z0"', "'g' comes later in [let]", "in their order"),
    ("abs(v)*elastic/g", "abs(v)*z_rate", "'z_rate' is not defined yet here", "force and slip"),
    ('unit = "N/m"', 'unit = "N/mm"', 'parameters.bristle_stiffness.unit: unit "N/mm"', "20 mm/s"),
    ("[states]", "[states]\nv = { unit = 'm', rate = '0' }", 'the name "v" is reserved', ""),
    ("[let]", "[let]\nviscous = '1'", 'the name "viscous" is given twice', ""),
    ('name = "own-lugre"', 'name = "lugre"', '"lugre" is a law that pneudrive has', ""),
    ('"bristle_deflection_m"', '"position_m"', 'a trajectory already has a column "position_m"', "another name"),
    ("coulomb = {", "dwell = {", '"dwell" is a key of the friction table', ""),
    ("[output]", "", "force is an output, but is listed under [let]", "[output]"),
    ('force = "elastic', 'forces = "elastic', "output.forces is not a known key", "[output] needs force, in N"),
    ("[output]\nforce", "[output]\n# force", "output.force is missing", 'Add [output] with force = "...", in N.'),
    ("[states]", '[levels]\ncoulomb = "colomb"\n[states]', "levels.coulomb: 'colomb' is not a parameter", "coulomb"),
    ('scale = "1 mm"', 'scale = "1 mm", above = 0', "starts at 0, which is not greater than 0", ""),
]


@pytest.mark.parametrize(("old", "new", "what", "also"), REFUSED, ids=[row[2][:50] for row in REFUSED])
def test_a_wrong_law_gets_one_message_with_its_place(folder, old, new, what, also):
    assert old in LUGRE
    (folder / "laws" / "lugre.toml").write_text(LUGRE.replace(old, new, 1))
    with pytest.raises(DescriptionError) as caught:
        load(folder, FRICTION)
    assert what in str(caught.value)
    assert also in str(caught.value)
    assert re.match(rf"{re.escape(str(folder))}/laws/lugre\.toml:\d+$", caught.value.where)


def law(force, states=None, let=None, **more):
    parameters = {
        "Fc": {"unit": "N", "above": 0, "default": 30},
        "k": {"unit": "N/m", "above": 0, "default": 1e5},
        "d": {"unit": "N s/m", "above": 0, "default": 300},
        "v0": {"unit": "m/s", "above": 0, "default": "1 mm/s"},
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)  # parameters that a case does not use
        return FrictionLaw(name="mine", parameters=parameters, force=force, states=states or {}, let=let or {}, **more)


DAHL = {"z": {"unit": "m", "rate": "v - abs(v)*k*z/Fc"}}
# laws that are well written, but not what friction is with the values given
UNUSABLE = [
    (law("Fc*tanh(v/v0)*exp(v/v0)"), "force is not finite at v = 5 m/s"),
    (law("Fc*sign(v)"), "the force jumps by 60.0000 N where v changes its sign"),
    (law("-Fc*tanh(v/v0)"), "drives the motion at every tested speed"),
    (
        law("k*z", {"z": {"unit": "m", "rate": "v"}}),
        "state z does not come to rest in steady sliding at 0.1 mm/s: its rate is",
    ),
    (law("k*z", DAHL, steady="0.5*Fc*tanh(v/v0)"), "but the force settles at"),
    (law("Fc*tanh(v/v0) + Fc*(v/v0)^2*exp(-(v/v0)^2)", odd=True), "has odd = true, but"),
]


@pytest.mark.parametrize(("own", "what"), UNUSABLE, ids=[row[1][:40] for row in UNUSABLE])
def test_a_law_that_cannot_be_friction_is_refused(own, what):
    drive = pn.Drive.load("catalogue:reference").replace({"friction": pn.Friction(law=own)})
    with pytest.raises(DescriptionError, match=re.escape(what)):
        pn.simulate(drive, command=COMMAND, duration="10 ms")


def messages(own):
    drive = pn.Drive.load("catalogue:reference").replace({"friction": pn.Friction(law=own)})
    return drive.system.compiled().warnings


def test_what_may_be_a_mistake_is_said():
    with pytest.warns(PneudriveWarning, match="parameter 'k' is not used by force or rates"):
        FrictionLaw(name="a", parameters={"k": {"unit": "N/m"}, "c": {"unit": "N s/m", "default": 1}}, force="c*v")
    assert messages(law("k*z", DAHL, energy="0.5*k*z^2")) == []
    assert messages(law("k*z", DAHL)) == []
    (pushes,) = messages(law("Fc*tanh(v/v0) - 3*Fc*exp(-((v - 20*v0)/(4*v0))^2)"))
    assert "drives the motion" in pushes
    assert "in steady sliding at 20 mm/s" in pushes
    # A damper with the wrong sign: seen by its power where an energy is given, else by motions at random.
    (power,) = messages(law("k*z - d*z_rate", DAHL, energy="0.5*k*z^2"))
    before, after, given = numbers_in(r"sliding at (\S+) mm/s changes suddenly to (\S+) mm/s, it gives (\S+) W", power)
    assert before * after < 0.0  # bristles at 30 N, whose rate is then 2 v: 2 d v^2 less Fc |v|
    assert given == pytest.approx(600.0 * (1e-3 * after) ** 2 - 30.0 * abs(1e-3 * after), rel=1e-4)
    (motion,) = messages(law("k*z + d*v - 1.5*d*z_rate", DAHL))
    time, got, v, z = numbers_in(r"of (\S+) s got (\S+) mJ more .* when v = (\S+) mm/s, z = (\S+) m;", motion)
    x, v = -3e-4 * np.log(1.0 - abs(z) / 3e-4), 1e-3 * abs(v)  # one piece from rest: z = Fc/k (1 - exp(-k x/Fc))
    assert x / v == pytest.approx(time, abs=5e-4)
    assert got == pytest.approx(1e3 * (450.0 * v * abs(z) - 300.0 * v * x - 30.0 * (x - abs(z))), rel=0.01)


def numbers_in(pattern, text):
    return map(float, re.search(pattern, text).groups())


def test_levels_are_needed_by_what_acts_on_them():
    own = law("Fc*tanh(v/v0)")
    friction = pn.Friction(law=own, side_load={"force": "10 N", "coefficient": 0.1})
    drive = pn.Drive.load("catalogue:reference").replace({"friction": friction})
    with pytest.raises(DescriptionError, match=r"side_load acts on levels, but law \"mine\" has none.*\[levels\]"):
        pn.simulate(drive, command=COMMAND, duration="10 ms")
    with pytest.raises(DescriptionError, match="relaxation is not a known key of law"):
        pn.Friction(law=own, relaxation={"share": 0.3, "time": "5 s", "distance": "0.2 mm"})
    with pytest.raises(DescriptionError, match=r"stribeck_shape is not a known key.*\n.*Laws with this key: stribeck"):
        pn.Friction(law=own, stribeck_shape="gaussian")
    with pytest.raises(DescriptionError, match=r"friction\.Fc: \"0 N\" is out of bounds"):
        pn.Friction(law=own, Fc="0 N")


def test_units_of_parameters_are_any_of_their_dimension():
    about = {
        "c2": {"unit": "N s2/m2", "at_least": 0},
        "area": {"unit": "m2", "above": 0, "at_most": "10 cm2"},
        "fall": {"unit": "1/Pa", "default": "10 %/bar"},
    }
    own = FrictionLaw(name="square", parameters=about, force="c2*v*abs(v) + area*fall*pressure_a*c2*v*abs(v)/area")
    friction = pn.Friction(law=own, c2="3 N s2/m2", area="4 cm2")
    assert dict(friction.parameters) == {"c2": 3.0, "area": 4e-4, "fall": 1e-6}
    with pytest.raises(DescriptionError, match=r"not more than 0\.001"):
        pn.Friction(law=own, c2="3 N s2/m2", area="11 cm2")


def test_a_rig_file_takes_it(folder):
    from pneudrive.rig.description import DEFAULT, read_description
    from pneudrive.rig.machine import core_friction, steady_friction_n

    text = Path(DEFAULT).read_text()
    table = text[text.index("[friction]") :].split("\n[", 1)[0]
    values = re.sub(r"law = .*\n", "", FRICTION[FRICTION.index("coulomb") :])
    sourced = re.sub(r'= ("[^"]*")', r'= { value = \1, source = "assumed", reason = "a test" }', values)
    (folder / "rig.toml").write_text(text.replace(table, f'[friction]\nlaw = "file:laws/lugre.toml"\n{sourced}'))
    rig = read_description(folder / "rig.toml")
    assert rig.friction["law"] == "own-lugre"
    force = steady_friction_n(core_friction(rig), 0.3)
    np.testing.assert_allclose(force, 30.0 + 0.3 * 200.0, rtol=1e-12)


# --- Python runs because the user of this run names it: never because it lies in the folder that one stands in.


def test_a_worker_process_imports_nothing_from_the_folder_one_stands_in(tmp_path, monkeypatch):
    for name in ("numpy", "polars", "pickle", "json", "pneudrive"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('it ran')")
    monkeypatch.chdir(tmp_path)
    assert in_processes(sorted, [([2, 1],)]) == [[1, 2]]
