"""What acts on a friction law in a drive file: read to SI, written back, refused with one message, simulated."""

import json
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import pneudrive as pn
from pneudrive import _core
from pneudrive.describe.files.load import drive_schema
from pneudrive.describe.tables.friction import friction_laws
from pneudrive.errors import DescriptionError, PneudriveWarning

TABLES = (Path(__file__).parents[1] / "data" / "dependences.toml").read_text("utf-8")


@pytest.fixture
def text(drive_file):
    elasto_plastic = drive_file.replace('law = "lugre"', 'law = "elasto-plastic"', 1)
    damping = 'bristle_damping = "300 N s/m"\n'
    shared = elasto_plastic.replace(damping, damping + "breakaway_share = 0.85\n")
    return shared.replace("[load]", TABLES + "\n[load]", 1)


def load(tmp_path, text):
    path = tmp_path / "drive.toml"
    path.write_text(text)
    return pn.Drive.load(path)


def test_tables_reach_the_core_in_si(tmp_path, text):
    drive = load(tmp_path, text)
    friction = drive.short_form()["friction"]
    assert friction["law"] == "elasto-plastic"
    assert friction["parameters"]["breakaway_share"] == 0.85
    assert friction["pressure"]["coulomb_a"] == 1e-5
    assert friction["dwell"] == {
        "growth": "saturating",
        "increment_n": 1.5,
        "time_s": 54000.0,
        "exponent": 0.5,
        "distance_m": 2e-5,
        "pressure_a": 1e-6,
        "pressure_b": 2e-6,
    }
    waves = [
        {"period_m": 0.05, "amplitude": 0.04, "phase_rad": pytest.approx(math.pi / 6)},
        {"period_m": 0.007, "amplitude": 0.02, "phase_rad": 0.0},
    ]
    points = [{"position_m": x, "factor": f} for x, f in [(0.05, 1.1), (0.2, 0.95), (0.45, 1.05)]]
    assert friction["position"] == {"table": points, "harmonics": waves, "slope_per_m": 0.05, "reference_m": 0.25}
    assert drive.friction.with_defaults()["position"]["harmonics"][1]["phase"] == "0 deg"
    assert [*friction["relaxation"].values(), *friction["direction"].values()] == [0.3, 5.0, 2e-4, 1.1, 0.9]
    assert friction["side_load"] == {"force_n": 20.0, "coefficient": 0.1}
    assert friction["temperature"] == {
        "reference_k": 293.15,
        "viscous_per_k": 0.03,
        "levels_per_k": -0.004,
        "resistance_k_w": 0.8,
        "time_s": 300.0,
    }
    assert friction["wear"] == {"run_in": 0.2, "run_in_distance_m": 2000.0, "rate_per_m": 5e-6, "slid_m": 300.0}
    drive.system.compiled()


def test_a_drive_with_tables_is_written_and_read_to_the_same_bits(tmp_path, text):
    drive = load(tmp_path, text)
    again = load(tmp_path, drive.to_toml())
    assert again.core_json() == drive.core_json()
    assert again == drive


def test_another_law_keeps_what_acts_on_it(tmp_path, text):
    """Relaxation goes where the new law has no bristles; the rest stays."""
    old = load(tmp_path, text)
    other = {"law": "stribeck", "coulomb": "20 N", "breakaway": "25 N", "stribeck_velocity": "10 mm/s"}
    new = old.replace({"friction": other}).friction
    assert new.relaxation is None
    assert (new.dwell, new.position, new.side_load) == (
        old.friction.dwell,
        old.friction.position,
        old.friction.side_load,
    )


WRONG = [
    ('"saturating"', '"log"', 'friction.dwell.exponent has no effect with growth = "log"', "saturating"),
    ('increment = "1.5 N"\n', "", "friction.dwell.increment is missing", "a force is needed"),
    ('"20 um"', '"20 s"', 'unit "s" is a time', "a length is needed"),
    ('"10 %/bar"', '"10 N/bar"', 'unit "N/bar" is a force per pressure', "a fraction per pressure"),
    ("share = 0.3", "share = 1", "friction.relaxation.share: 1 is out of bounds", "less than 1"),
    ('"5 %/m"', '"5 mm"', 'unit "mm" is a length', "a fraction per length"),
    ("amplitude = 0.04", "amplitude = 0.99", "add up to 1.01, so friction would change its sign", "less than 1"),
    ('"45 cm"', '"45 mm"', "friction.position.table: the position 45 mm follows 200 mm", "positions must increase"),
    ('"0.8 K/W"', '"0.8 W"', "W", "a thermal resistance is needed"),
    ('reference = "20 degC"', "", "friction.temperature.reference is missing", "a temperature is needed"),
    ("[friction.dwell]", "[friction.dwel]", "friction.dwel is not a known key", "Did you mean 'dwell'"),
]


@pytest.mark.parametrize(("old", "new", "what", "also"), WRONG, ids=[row[2][:45] for row in WRONG])
def test_wrong_tables_get_one_message(tmp_path, text, old, new, what, also):
    assert old in text
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path, text.replace(old, new, 1))
    assert what in str(caught.value)
    assert also in str(caught.value)
    assert caught.value.where.startswith(str(tmp_path / "drive.toml"))


def test_the_schema_knows_the_tables_of_each_law():
    *built_in, default, own = drive_schema()["$defs"]["Friction"]["oneOf"]
    assert "law" not in default["properties"]
    assert default["required"] == ["coulomb", "breakaway"]
    assert own["properties"]["law"]["anyOf"][0]["anyOf"][0]["pattern"] == "^file:"
    alternatives = {a["properties"]["law"]["anyOf"][0]["const"]: a for a in built_in}
    assert set(alternatives) == set(friction_laws())
    for name, alternative in alternatives.items():
        properties = {key: form["anyOf"][0] for key, form in alternative["properties"].items()}
        assert properties["dwell"]["properties"]["increment"]["x-unit"] == "N"
        assert properties["position"]["properties"]["harmonics"]["items"]["required"] == ["period", "amplitude"]
        assert ("relaxation" in properties) == (name in {"lugre", "elasto-plastic", "dahl", "bouc-wen"})
    assert "$ref" not in json.dumps(alternatives)


def test_an_old_contact_holds_a_piston_that_a_fresh_one_lets_go(tmp_path, text):
    """60 N push against some 50 N of friction: what a day of standing adds decides."""
    text = text.replace('increment = "1.5 N"', 'increment = "80 N"').replace("[load]", '[load]\nforce = "60 N"')
    drive = load(tmp_path, text)

    def travel(initial):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PneudriveWarning)
            run = pn.simulate(drive, "0 s: 0", "0.3 s", initial=initial)
        assert (run.contact_age.units, run.contact_age.long_name) == ("s", "age of the contact")
        assert run.relaxed_deflection.attrs["units"] == "m"
        return run

    fresh, old = travel(None), travel("contact_age = 24 h")
    assert fresh.contact_age[0] == 0.0
    assert old.contact_age[0] == 86400.0
    assert float(np.ptp(fresh.position.to_numpy())) > 1e-3
    assert float(np.ptp(old.position.to_numpy())) < 1e-3
    assert {"@article{dupont2002", "@article{kato1972", "@book{ferry1980"} <= {
        entry.split(",")[0] for entry in pn.citations(fresh).split("\n\n")
    }


def test_steady_friction_with_what_acts_on_it():
    parameters = {"coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "bristle_stiffness": 1e5}
    parameters |= {"bristle_damping": 0.0, "viscous": 40.0}
    velocity = np.array([-0.3, 0.002, 0.05])
    dwell = {"growth": "log", "increment_n": 1.5, "time_s": 1e-3, "distance_m": 2e-5, "pressure_a": 1e-6}
    dependences = {
        "dwell": dwell,
        "relaxation": {"share": 0.3, "time_s": 5.0, "distance_m": 2e-4},
        "position": {"harmonics": [{"period_m": 0.05, "amplitude": 0.1}], "slope_per_m": 0.2, "reference_m": 0.1},
        "direction": {"positive": 1.1, "negative": 0.8},
        "side_load": {"force_n": -20.0, "coefficient": 0.1},
    }
    pressure = {"coulomb_a": 1e-5, "breakaway_a": 2e-5}
    at = (2e5, 0.0)
    got = _core.steady_friction("elasto-plastic", parameters, velocity, *at, pressure, dependences, position_m=0.11)
    place = 1.0 + 0.2 * 0.01 + 0.1 * math.cos(2 * math.pi * 0.01 / 0.05)
    factor = place * np.where(velocity > 0.0, 1.1, 0.8)
    aged = 1.5 * 1.2 * np.log(1.0 + 2e-5 / np.abs(velocity) / 1e-3)
    coulomb, breakaway = (level * factor + 2.0 + aged for level in (32.0, 49.0))
    level = coulomb + (breakaway - coulomb) * np.exp(-((velocity / 0.02) ** 2))
    np.testing.assert_allclose(got, np.sign(velocity) * level + 40.0 * velocity, rtol=1e-13)
    with pytest.raises(ValueError, match="unknown field `dwel`"):
        _core.steady_friction("lugre", parameters, velocity, dependences={"dwel": dwell})


def test_a_table_that_names_no_law_says_what_it_assumes():
    """Elasto-plastic; breakaway after 0.1 mm, 1 ms of damping, passive however great the viscous friction is."""
    with pytest.warns(
        PneudriveWarning, match=r'"elasto-plastic" is used with assumed values: stribeck_velocity = "20 mm/s"'
    ) as told:
        friction = pn.Friction(coulomb="30 N", breakaway="45 N", direction={"positive": 1.1})
    assert 'bristle_stiffness = "450000 N/m", bristle_damping = "450 N s/m"' in str(told[0].message)
    assert friction.law == "elasto-plastic"
    assert friction.parameters["bristle_stiffness"] == 4.5e5
    fade, damping = friction.parameters["damping_fade_velocity"], friction.parameters["bristle_damping"]
    assert damping * fade / math.sqrt(2 * math.e) < 0.55 * 4 * 30.0
    # Written out, what was assumed stands there for all to see, and is no longer told.
    assert pn.Friction(**friction.to_dict()) == friction
    with pytest.warns(PneudriveWarning, match=r'elasto-plastic" is used\.'):
        pn.Friction(**{key: value for key, value in friction.to_dict().items() if key != "law"})
    with pytest.raises(DescriptionError, match=r"friction\.breakaway is missing"):
        pn.Friction(coulomb="30 N")
    with pytest.raises(DescriptionError, match=r"friction\.coulomb: .*has no unit"):
        pn.Friction(coulomb=30.0, breakaway="45 N")


def test_a_table_of_positions_is_a_monotone_cubic(drive_file):
    """Against SciPy's, away from the ends; beyond them and at its points the factors are those of the table."""
    x = np.array([10.0, 80.0, 120.0, 200.0, 330.0, 460.0]) * 1e-3
    factor = np.array([1.0, 1.3, 1.1, 0.8, 0.7, 0.9])
    table = [{"position_m": a, "factor": b} for a, b in zip(x, factor, strict=True)]
    parameters = {"coulomb": 10.0}

    def friction(position: float) -> float:
        tables = {"position": {"table": table}}
        return float(_core.steady_friction("coulomb", parameters, np.ones(1), 0.0, 0.0, None, tables, position)[0])

    for a, b in zip([0.0, *x, 0.5], [1.0, *factor, 0.9], strict=True):
        assert friction(a) == pytest.approx(10.0 * b, rel=1e-14)
    scipy = PchipInterpolator(x, factor)
    for a in np.linspace(x[1], x[-2], 40):
        assert friction(a) == pytest.approx(10.0 * float(scipy(a)), rel=1e-12)
    last = np.array([friction(a) for a in np.linspace(x[-2], x[-1], 40)])
    assert (np.diff(last) >= 0.0).all()
    assert abs(friction(x[-1] - 1e-7) - friction(x[-1])) < 1e-10
