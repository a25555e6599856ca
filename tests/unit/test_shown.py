"""A bare name shows a short table, escaped; a quantity shows its unit and computes as the SI number that it is."""

import copy
import dataclasses
import importlib
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import repr_tables, units
from pneudrive.describe.base import Described
from pneudrive.errors import DescriptionError
from pneudrive.identify.files import read_fit

REFERENCE = Path(__file__).parents[2] / "docs/reference/python.md"
OLD = Path(__file__).parents[1] / "old_files"
#: No card is longer, whatever it shows.
MOST = 12_000


def test_names_read_as_in_the_file_and_show_their_unit():
    drive = pn.Drive.load("catalogue:starter")
    shown = [drive.cylinder.bore, drive.cylinder.dead_volume.a, drive.friction.coulomb, drive.friction.dwell.increment]
    assert [str(one) for one in shown] == ["25 mm", "10 cm3", "33 N", "1.2 N"]
    assert shown == [0.025, 1e-5, 33.0, 1.2]
    assert str(drive.friction.pressure.breakaway.b) == "1.3 N/bar"
    assert str(drive.load.mass) == "0 kg"
    assert str(drive.supply.pressure) == "6 bar gauge"
    assert drive.friction.parameters["coulomb"] == drive.friction.coulomb
    assert {"coulomb", "stribeck_velocity"} <= set(dir(drive.friction))
    with pytest.raises(AttributeError, match="Did you mean 'coulomb'"):
        _ = drive.friction.coulom


def tables(part, path=""):
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Described):
            yield from tables(value, f"{path}{field.alias or name}.")
    yield path, part


def test_every_key_of_the_file_is_a_name_in_python(drive_file, tmp_path):
    path = tmp_path / "drive.toml"
    path.write_text(drive_file)
    seen = 0
    for prefix, part in tables(pn.Drive.load(path)):
        for key in type(part).keys():  # noqa: SIM118 - not a dict
            if key not in {"schema", "law", "formula", "parameters", "given"}:
                value = getattr(part, key)
                assert not isinstance(value, str) or key in {"name", "kind", "model", "chamber_law", "growth"}, (
                    prefix + key
                )
                assert not callable(value), prefix + key
                seen += 1
    assert seen > 40


def test_a_quantity_is_a_number_and_goes_back_into_a_description():
    drive = pn.Drive.load("catalogue:starter")
    bore = drive.cylinder.bore
    assert np.asarray([bore]).dtype == np.float64
    assert json.dumps(bore) == "0.025"
    assert type(2 * bore) is float
    assert f"{bore:.1f}" == "25.0 mm"
    assert pickle.loads(pickle.dumps(bore)).unit == copy.copy(bore).unit == "mm"
    assert drive.ambient.temperature.to("degC") == 20.0
    same = drive.replace({"cylinder.bore": bore, "friction.coulomb": drive.friction.coulomb})
    assert same.description_hash == drive.description_hash
    with pytest.raises(DescriptionError, match="is a force"):
        drive.replace({"cylinder.bore": drive.friction.coulomb})
    with pytest.raises(DescriptionError, match="is not a number"):
        drive.replace({"gas.heat_capacity_ratio": bore})


def test_a_card_is_short_and_escaped():
    drive = pn.Drive.load("catalogue:reference").replace(
        {"name": "<script>alert(1)</script>", "labels.seal": "A" * 9999}
    )
    html = drive._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert len(html) + len(repr(drive)) < MOST
    assert "bore 25 mm" in repr(drive)
    assert "bore  " in repr(drive.cylinder)
    assert "default" in repr(drive.cylinder)


def test_long_lists_are_cut_and_say_so():
    card = repr_tables.Card("t", rows=[(str(n), "x") for n in range(1000)], notes=["n"] * 100)
    text = repr_tables.text_of(card)
    assert len(text.splitlines()) < 50
    assert "970 more" in text
    assert "92 more" in text


def test_every_parameter_of_a_fit_is_a_row_of_its_card():
    """The longest name, not determined, fell out of the table."""
    fit = read_fit(OLD / "4f85f3b" / "map-fit.toml")
    shown = {row[0]: row[1] for row in fit._card().rows}
    assert shown.keys() >= {"coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous"}
    assert shown["stribeck_velocity"] == "not determined"


def results():
    """Dataclasses of the reference that hold arrays, data sets or others that do."""
    big = ("ndarray", "Array", "xr.Dataset", "CampaignCharacteristics", "Recording")
    for block in REFERENCE.read_text(encoding="utf-8").split(".. automodule:: ")[1:]:
        module, members = block.split("\n")[:2]
        for name in members.partition(":members:")[2].split(","):
            kind = getattr(importlib.import_module(module), name.strip(), None) if name.strip() else None
            types = [str(field.type) for field in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []
            if module != "pneudrive.views" and any(word in text for text in types for word in big):
                yield kind


def test_public_results_show_a_card():
    found = set(results())
    assert len(found) > 15
    assert not [kind for kind in found if not issubclass(kind, repr_tables.Shown)]


def test_arrays_are_shown_by_their_shape():
    made = repr_tables.brief(np.zeros((1000, 2)))
    assert made == "array (1000, 2)"
    assert len(repr_tables.brief({str(k): np.zeros(3) for k in range(999)})) < 100
    assert (repr_tables.brief(17), repr_tables.brief(True)) == ("17", "True")
    assert repr_tables.brief(units.UnitFloat(0.025, "m", "mm")) == "25 mm"
