"""Each file that a user writes is looked at to its end: one message names all that is wrong with it, line by line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pneudrive.errors import DescriptionError, LayoutError, PneudriveError, RigError
from pneudrive.rig.description import DEFAULT, read_description
from pneudrive.rig.opcua.client import load_opcua
from pneudrive.rig.opcua.nodes import DEFAULT_MAP, load_map
from pneudrive.signals.layout import Layout

LAYOUT = (Path(__file__).parents[1] / "data" / "all_problems_layout.toml").read_text("utf-8")
RIG = (Path(__file__).parents[1] / "data" / "all_problems_rig.toml").read_text("utf-8")


def told(read, kind: type[PneudriveError]) -> str:
    with pytest.raises(kind) as caught:
        read()
    return str(caught.value)


def test_a_layout():
    text = told(lambda: Layout.loads(LAYOUT), LayoutError)
    for line, word in (
        (2, "decimal"), (3, "skip_sample"), (7, "is a force"), (8, "columns.force.unit is missing"),
        (9, "columns.pressure_a.sale"),
        (12, "geometry.bore"), (15, "rig.incline"), (18, "chamber_b.pressure"), (20, "flags"),
    ):  # fmt: skip
        assert word in text
        assert text.count(f"layout:{line}\n") == 1, f"line {line} once: {text}"


def test_what_each_override_of_a_layout_lacks_is_told_once():
    sound = (
        LAYOUT.replace('column = 1, unit = "N"', 'column = 1, unit = "mm"')
        .replace("column = 2 }", 'column = 2, unit = "N" }')
        .replace("sale", "scale")
    )
    sound = (
        sound.replace('";"', '"."')
        .replace("skip_sample ", "skip_samples ")
        .replace("-25", "25")
        .replace("100 deg", "1 deg")
    )
    sound = sound.replace('"3 bar"', '"3 bar abs"').replace("flags", "seal")
    Layout.loads(sound)
    wrong = '\n[[for]]\nmatch = "a*"\nrig.incline = "300 deg"\n[[for]]\nrig.mass_beyond_sensor = "-1 kg"\n'
    text = told(lambda: Layout.loads(sound.replace("1 deg", "200 deg") + wrong), LayoutError)
    assert text.count("rig.incline: ") == 2
    assert text.count("mass_beyond_sensor: ") == 1
    assert text.count("does not say which files") == 1


def test_a_simulated_rig(tmp_path):
    text = DEFAULT.read_text(encoding="utf-8")
    for old, new in (
        ("stroke = {", "strok = {"), ("bore = {", "bore_ = 3\nbore = {"),
        ("[encoder]", "[decoder]"), ("[servo]", "[servo]\nwheels = 4"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    said = told(lambda: read_description(tmp_path / "rig.toml"), DescriptionError)
    for word in (
        "cylinder.strok is not a known key",
        "cylinder.bore_ is not a known key",
        "decoder is not a known key",
        "encoder.resolution is missing",
        "servo.wheels",
    ):
        assert said.count(word) == 1, word


def test_a_rig_behind_opc_ua_and_a_node_map(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    said = told(lambda: load_opcua(path), RigError)
    for word in (
        "colour is not a known key", "'http://x' is not an address", "reconnect: ", "identity.name is missing",
        "identity.bore: ", "identity.stiffness: ", "limits.position: ", "limits.speed: ",
        "limits.acceleration is missing",
        "limits.jerk is missing",
    ):  # fmt: skip
        assert said.count(word) == 1, word
    text = DEFAULT_MAP.read_text(encoding="utf-8").replace("[command]", "[command]\nwish = 3", 1)
    path.write_text(
        text.replace("[handshake]", "[handshake]\nslits = 3", 1).replace("schema = 1", 'schema = 1\nhue = "x"', 1)
    )
    said = told(lambda: load_map(path), RigError)
    assert "hue" in said
    path.write_text(text.replace("[handshake]", "[handshake]\nslits = 3", 1))
    said = told(lambda: load_map(path), RigError)
    assert "command.wish" in said
    assert "handshake.slits" in said


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('decimal = ";"', "delimiter = []"),
        ('format = "csv"', "kind = []"),
        ("{ column = 2 }", '{ column = 2, unit = "N", accuracy = {} }'),
        ("{ column = 2 }", "{ column = [], unit = [] }"),
        ('bore = "-25 mm"', "bore = [{}]"),
    ],
)
def test_a_value_of_any_type_is_refused_in_words(old, new):
    assert old in LAYOUT
    told(lambda: Layout.loads(LAYOUT.replace(old, new)), LayoutError)


def test_a_list_in_place_of_the_friction_of_a_rig_is_refused_in_words(tmp_path):
    (tmp_path / "rig.toml").write_text('schema = 1\nextends = "default"\nfriction = []\n', encoding="utf-8")
    assert "friction = [] is not a table" in told(lambda: read_description(tmp_path / "rig.toml"), DescriptionError)
