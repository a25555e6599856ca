"""In a notebook: a drive with its circuit, a run in units of one's own, its strokes and its energy."""

import math
import xml.etree.ElementTree as ET
from importlib import import_module

import numpy as np
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.errors import CommandError, PneudriveWarning
from pneudrive.simulation.trajectory import save

COMMAND = "0 s: 0.6, 1 s: -0.6"


@pytest.fixture(scope="module")
def drive():
    return pn.Drive.load("catalogue:reference")


@pytest.fixture(scope="module")
def run(drive):
    return pn.simulate(drive, COMMAND, "2 s", ledger=True)


def test_a_drive_and_a_circuit_show_their_circuit_and_escape_every_text(drive):
    hostile = "<script>alert(1)</script>"
    for described in (drive, drive.circuit):
        html = described.replace({"name": hostile})._repr_html_()
        assert "<script" not in html
        root = ET.fromstring(f"<div>{html}</div>")
        drawing, card = root
        assert drawing.tag == "{http://www.w3.org/2000/svg}svg"
        texts = [one.text for one in drawing if one.tag.endswith("text")]
        assert hostile in texts
        assert any("25 mm" in str(text) for text in texts), "the bore beside its cylinder"
        assert hostile in next(card.itertext())
        assert not [one for one in root.iter() for name in one.attrib if name.startswith("on") or name == "href"]


def test_a_drawing_has_every_shape_where_it_is_with_y_down(drive):
    from pneudrive.report.circuit.svg import circuit_shapes, circuit_svg

    paper, shapes, *_ = circuit_shapes(drive)
    drawing = ET.fromstring(circuit_svg(drive))
    assert len(drawing) == len(shapes)
    left, top, width, height = map(float, drawing.attrib["viewBox"].split())
    assert (left, -top, left + width, -top - height) == pytest.approx(
        (paper[0], paper[3], paper[2], paper[1]), rel=0.01
    )
    for one, shape in zip(drawing, shapes, strict=True):
        if "points" in one.attrib:
            drawn = np.array([pair.split(",") for pair in one.attrib["points"].split()], float)
            assert drawn[0] * [1, -1] == pytest.approx(
                np.array(shape.outline(("arc", "dot"), 48)[0]), rel=1e-3, abs=1e-3
            )


def test_one_unit_converts_all_columns_of_its_quantity(run):
    shown = run.pneu.to("kPa", "bar", "mm", "degC", "ms")
    assert shown.pressure_a.to_numpy() == pytest.approx(run.pressure_a.to_numpy() / 1e5)
    assert shown.pressure_b.units == "bar"
    assert shown.bristle_deflection.to_numpy() == pytest.approx(1e3 * run.bristle_deflection.to_numpy())
    assert float(shown.temperature_a[0]) == pytest.approx(float(run.temperature_a[0]) - 273.15)
    assert float(shown.time[-1]) == 2000.0
    assert (shown.velocity.to_numpy() == run.velocity.to_numpy()).all()
    assert run.position.units == "m", "the run itself stays"
    with pytest.raises(CommandError, match='no column of this run can be converted to "kV"'):
        run.pneu.to("kV")


def test_a_run_in_other_units_is_no_run_in_si(drive, run, tmp_path):
    """Its strokes, its file and its figure would be wrong by a thousand without a word."""
    for unit, told in (("mm", "position of this run is in mm"), ("ms", "time of this run is in ms")):
        shown = run.pneu.to(unit)
        for use in (
            lambda: shown.pneu.strokes(drive),  # noqa: B023
            lambda: save(shown, tmp_path / "run.csv"),  # noqa: B023
            lambda: save(shown, tmp_path / "run.nc"),  # noqa: B023
            lambda: pn.report.plot(shown),  # noqa: B023
        ):
            with pytest.raises(CommandError, match=told):
                use()
    assert not list(tmp_path.iterdir())
    back = run.pneu.to("mm").pneu.to("m")
    assert back.position.to_numpy() == pytest.approx(run.position.to_numpy())
    assert back.pneu.strokes(drive)[0].way == pytest.approx(run.pneu.strokes(drive)[0].way)


def test_strokes_are_those_between_the_commands(drive, run):
    away, back = run.pneu.strokes(drive)
    assert (away.direction, back.direction) == (1, -1)
    impacts = run.attrs["impacts"]
    assert away.stroke_time == pytest.approx(impacts[0]["time_s"], abs=1e-3)
    assert away.end_speed == pytest.approx(impacts[0]["speed_m_s"], rel=1e-6)
    first_back = next(one for one in impacts if one["end"] == "a")
    assert back.stroke_time == pytest.approx(first_back["time_s"] - 1.0, abs=1e-3)
    with pytest.raises(CommandError, match="another description"):
        run.pneu.strokes(drive.replace({"load.mass": "1 kg"}))


def test_a_run_read_from_its_file_is_the_run(drive, run, tmp_path):
    read = xr.load_dataset(save(run, tmp_path / "run.nc"))
    assert [str(one) for one in read.pneu.strokes(drive)] == [str(one) for one in run.pneu.strokes(drive)]
    assert read.pneu.energy() == run.pneu.energy()
    assert read.pneu.view().text() == run.pneu.view().text()


def test_energy_leaves_as_the_heat_of_friction(drive, run):
    found = run.pneu.energy()
    x, force = run.position.to_numpy(), run.friction_force.to_numpy()
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x))
    assert found["cylinder: friction heat"] == pytest.approx(-work, rel=0.01)
    assert str(found["valve: enthalpy over the boundary"]).endswith(" J")
    assert all(math.isfinite(one) for one in found.values())
    with pytest.raises(CommandError, match="ledger=True"):
        pn.simulate(drive, 0.6, "0.1 s").pneu.energy()


def test_without_a_live_notebook_sliders_are_text(drive, monkeypatch):

    monkeypatch.setattr(import_module("pneudrive.explore"), "is_live", lambda: False)
    shown = pn.explore(drive, COMMAND, "2 s")
    bundle = shown._repr_mimebundle_()
    assert 'pip install "pneudrive[notebook]"' in bundle["text/plain"]
    assert f"{float(shown.simulate().position[-1]):.6g} m" in bundle["text/plain"]
    assert bundle["text/html"].startswith("<svg ")
    with pytest.raises(CommandError, match=r'"friction\.law" has no slider'):
        pn.explore(drive, sliders=["friction.law"])


@pytest.mark.parametrize("rate", ["50 Hz", "1 kHz"])
def test_a_stroke_begins_at_its_command_and_not_at_the_next_sample(drive, rate):
    """Its time is then that of the contact less that of the command, at any rate of the samples."""
    run = pn.simulate(drive, [(0.0, 0.6), (1.00037, -0.6)], "2 s", sample_rate=rate)
    back = run.pneu.strokes(drive)[1]
    touched = next(one["time_s"] for one in run.attrs["impacts"] if one["end"] == "a")
    assert back.stroke_time == pytest.approx(touched - 1.00037, abs=1e-12)
    fine = pn.simulate(drive, [(0.0, 0.6), (1.00037, -0.6)], "2 s", sample_rate="100 kHz").pneu.strokes(drive)[1]
    assert back.way == pytest.approx(fine.way, abs=1e-5)
    assert back.dead_time == pytest.approx(fine.dead_time, rel=0.05)
    assert back.begin_within == 0.0


def test_a_run_that_shows_its_command_only_at_samples_says_how_late_that_is(drive):
    run = pn.simulate(drive, [(0.0, 0.6), (1.00037, -0.6)], "2 s", sample_rate="50 Hz")
    told = run.attrs["command_steps"]
    assert told == [[0.0, 0.6], [1.00037, -0.6]]
    older = run.assign_attrs({})
    del older.attrs["command_steps"]
    away, back = older.pneu.strokes(drive)
    assert (away.begin_within, back.begin_within) == pytest.approx((0.0, 0.02))
    assert "may be longer by up to 0.02 s" in str(back)
    exact = run.pneu.strokes(drive)[1].stroke_time
    assert back.stroke_time < exact < back.stroke_time + back.begin_within


def test_a_run_with_derivatives_is_used_and_written_as_any_other(drive, tmp_path):
    plain = pn.simulate(drive, COMMAND, "2 s")
    run = pn.simulate(drive, COMMAND, "2 s", sensitivities=["friction.coulomb", "load.mass"])
    assert run.pneu.strokes(drive) == plain.pneu.strokes(drive)
    assert float(run.pneu.to("%", "mm").command[0]) == pytest.approx(60.0)
    with pytest.raises(CommandError, match="the unit 5 is not a string"):
        run.pneu.to(5)
    xr.testing.assert_equal(xr.load_dataset(save(run, tmp_path / "run.nc")), run)
    for name in ("run.csv", "run.parquet"):
        with pytest.warns(PneudriveWarning, match=rf"{name} leaves out .*sensitivity_position.* suffix \.nc"):
            save(run, tmp_path / name)
    save(plain, tmp_path / "plain.csv")
    assert (tmp_path / "run.csv").read_bytes() == (tmp_path / "plain.csv").read_bytes()
