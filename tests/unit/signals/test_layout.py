"""Layout files: every key read, every mistake one message with file, line, rule and remedy."""

from pathlib import Path

import numpy as np
import pytest

from pneudrive.characterise import load_recordings
from pneudrive.errors import LayoutError, PneudriveWarning, RecordingError

PLAIN = (Path(__file__).parents[2] / "data" / "layout_plain.toml").read_text("utf-8")
ROWS = "\n".join(f"{10 * i} {0.5 * i} {2.0 + 0.01 * i} {100.0 + i}" for i in range(30))


def read(tmp_path: Path, layout: str = PLAIN, rows: str = ROWS, name: str = "lip_2bar.csv"):
    (tmp_path / "layout.toml").write_text(layout)
    (tmp_path / name).write_text(rows)
    return load_recordings([tmp_path / name])[0]


def test_units_pressures_and_labels(tmp_path):
    recording = read(tmp_path)
    assert len(recording) == 28
    assert recording.time_s[0] == pytest.approx(0.02)
    assert recording.position_m[:2] == pytest.approx([1e-3, 1.5e-3])
    assert recording.pressure_b_pa[0] == pytest.approx(101325 + 2.02e5)
    assert (recording.pressure_a_pa == 101325).all()
    assert recording.area_a_m2 == recording.area_b_m2 == pytest.approx(np.pi / 4 * 0.025**2)
    assert recording.labels == {"seal": "lip", "pressure": "2"}
    assert len(recording.sha256) == 64


def test_scale_offset_sign_delay_and_accuracy(tmp_path):
    layout = PLAIN.replace(
        'unit = "N", positive = "+x" }',
        'unit = "N", positive = "-x", scale = 2.0, offset = 5.0, delay = "10 ms", accuracy = "0.5 N" }',
    ).replace(
        'unit = "bar gauge" }', 'unit = "bar gauge", accuracy = "0.03 bar", range = "0 bar gauge .. 10 bar gauge" }'
    )
    recording = read(tmp_path, layout)
    # Raw 102 at 20 ms is -(2 * 102 + 5); read 10 ms late, the value at 20 ms stands in the next row.
    assert recording.force_n[0] == pytest.approx(-(2 * 103 + 5))
    assert recording.accuracy == {"force_n": 0.5, "pressure_b_pa": pytest.approx(3000.0)}
    assert recording.limits["pressure_b_pa"] == pytest.approx((101325, 101325 + 10e5))


def test_rig_geometry_and_window(tmp_path):
    layout = PLAIN.replace('kind = "rodless"', 'kind = "single-rod"\nrod_diameter = "10 mm"\nbore_accuracy = "20 um"')
    layout = layout.replace("[chamber_a]\nopen_to_ambient = true", '[chamber_a]\npressure = "3 bar abs"')
    layout += '[rig]\nambient_pressure = "0.95 bar abs"\nincline = "30 deg"\nmass_beyond_sensor = "2 kg"\n'
    layout += 'stiffness = "20 N/um"\nalignment = "0.5 deg"\n[window]\nposition = "5 mm .. 30 mm"\n'
    recording = read(tmp_path, layout.replace("20 N/um", "2e4 N/mm"))
    assert recording.area_a_m2 == pytest.approx(np.pi / 4 * 0.025**2)
    assert recording.area_b_m2 == pytest.approx(np.pi / 4 * (0.025**2 - 0.01**2))
    assert recording.pressure_a_pa[0] == pytest.approx(3e5)
    assert recording.pressure_b_pa[0] == pytest.approx(0.95e5 + 2.02e5)
    assert recording.incline_rad == pytest.approx(np.pi / 6)
    assert recording.stiffness_n_m == pytest.approx(2e7)
    assert recording.window_m == pytest.approx((0.005, 0.03))
    assert recording.accuracy == {"bore_m": pytest.approx(2e-5), "alignment_rad": pytest.approx(np.pi / 360)}


def test_areas_of_a_piston_that_is_not_round(tmp_path):
    layout = PLAIN.replace(
        'kind = "rodless"\nbore = "25.0 mm"', 'area_a = "5 cm2"\narea_b = "4 cm2"\narea_accuracy = "0.5 %"'
    )
    recording = read(tmp_path, layout)
    assert (recording.area_a_m2, recording.area_b_m2) == pytest.approx((5e-4, 4e-4))
    assert recording.accuracy == {"area": 0.005}


def test_overrides_by_file_name(tmp_path):
    layout = PLAIN + '\n[[for]]\nmatch = "*257*"\ngeometry.bore = "25.7 mm"\n\n[[for]]\nmatch = "[0-9]_*"\n'
    layout += 'labels.pattern = "{run}_{seal}_{pressure}bar"\n'
    recording = read(tmp_path, layout, name="3_lip257_2bar.csv")
    assert recording.area_a_m2 == pytest.approx(np.pi / 4 * 0.0257**2)
    assert recording.labels == {"run": "3", "seal": "lip257", "pressure": "2"}
    assert read(tmp_path, layout).area_a_m2 == pytest.approx(np.pi / 4 * 0.025**2)


def test_decimal_comma_header_units_row_and_lines_above(tmp_path):
    layout = PLAIN.replace('"whitespace"', '";"\nheader = true\ndecimal = ","\nskip_lines = 1')
    layout = layout.replace("column = 0", 'column = "t"').replace("column = 1", 'column = "weg"')
    rows = "Bench 3\nt;weg;p;F\nms;m;bar;N\n" + ROWS.replace(".", ",").replace(" ", ";")
    with pytest.warns(PneudriveWarning, match='"weg" of position is in m in the file, but in mm in the layout'):
        recording = read(tmp_path, layout, rows)
    assert recording.position_m[0] == pytest.approx(1e-3)
    assert recording.flags == {}


def test_lines_that_are_no_data_are_left_out(tmp_path):
    rows = "// made by hand\n" + ROWS.replace("\n30 ", "\n// pause\n30 ")
    assert len(read(tmp_path, PLAIN.replace("skip_samples = 2", 'comment = "//"'), rows)) == 30
    assert len(read(tmp_path, PLAIN.replace("skip_samples = 2", 'comment = ""'), ROWS)) == 30


def test_a_dot_that_is_decimal_and_thousands_separator(tmp_path):
    rows = "\n".join(f"{t} {i} 2.0 1.0" for i, t in enumerate(["903.000", "1.003.000", "1.103.000", "12.103.000"]))
    recording = read(tmp_path, PLAIN.replace("skip_samples = 2", 'thousands = "."'), rows)
    assert recording.time_s == pytest.approx([0.903, 1.003, 1.103, 12.103])


@pytest.mark.parametrize("suffix", [".gz", ".xz", ".bz2"])
def test_compressed_files_read_the_same(tmp_path, suffix):
    import bz2
    import gzip
    import lzma

    plain = read(tmp_path)
    packed = {".gz": gzip.compress, ".xz": lzma.compress, ".bz2": bz2.compress}[suffix](ROWS.encode())
    (tmp_path / f"lip_2bar.csv{suffix}").write_bytes(packed)
    again = load_recordings([tmp_path / f"lip_2bar.csv{suffix}"])[0]
    assert again.sha256 == plain.sha256
    assert again.labels == plain.labels
    assert (again.force_n == plain.force_n).all()


# what is changed, into what, line of the message, words of the message
MISTAKES = [
    (', unit = "mm" }', " }", 7, 'columns.position.unit is missing(?s:.*)unit = "mm"'),
    ('"bar gauge"', '"bar"', 8, "does not state gauge or abs"),
    ('"bar gauge"', '"mm"', 8, "is a length"),
    ('unit = "ms"', 'unit = "ms", format = "%H:%M"', 6, 'only for a time with unit = "date-time"'),
    ("skip_samples", "skip_sample", 3, "Did you mean 'skip_samples'"),
    ("skip_samples = 2", "skip_samples = -1", 3, "at least 0"),
    ('"csv"', '"xls"', 1, "format: 'xls' is not known"),
    ('positive = "+x"', 'positive = "up"', 9, '\'"\\+x" or "-x"\'|\\+x'),
    ('positive = "+x"', "scale = 0", 9, "scale = 0 makes all"),
    ("column = 3, ", "", 9, "columns.force.column is missing"),
    ('kind = "rodless"', 'kind = "single-rod"\nrod_diameter = "30 mm"', 13, "Check whether bore and rod are swapped"),
    ('kind = "rodless"', 'kind = "single-rod"', 11, "rod_diameter is missing"),
    ('kind = "rodless"', 'area_a = "5 cm2"', 11, "must give the piston areas exactly once"),
    ("open_to_ambient = true", "", 15, "does not state the pressure in chamber a"),
    ("open_to_ambient = true", 'open_to_ambient = true\npressure = "3 bar abs"', 15, "more than once"),
    ('pattern = "{seal}_{pressure}bar"', 'pattern = "{seal}_{seal}"', 19, "not a valid pattern"),
    ("[labels]", '[window]\nposition = "30 mm .. 5 mm"\n[labels]', 19, "empty"),
    ("[labels]", '[rig]\nambient_pressure = "1 bar gauge"\n[labels]', 19, "must be absolute"),
    (
        "[labels]",
        '[rig]\nambient_pressure = "1 bar"\n[labels]',
        19,
        '(?s)not state abs or gauge\\..*: Write "1 bar abs"\\.$',
    ),
    ("[labels]", '[[for]]\ngeometry.bore = "1 mm"\n[labels]', 18, "does not say which files"),
    ("[labels]", '[[for]]\nmatch = "a*"\n[[for]]\nmatch = "b*"\ngeometry.bore = "1"\n[labels]', 22, "no unit"),
    ("[columns]", "[columns", 5, "not TOML"),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), MISTAKES)
def test_a_mistake_is_one_message_with_its_line(tmp_path, old, new, line, words):
    assert old in PLAIN
    with pytest.raises(LayoutError, match=words) as caught:
        read(tmp_path, PLAIN.replace(old, new))
    assert f"layout.toml:{line}" in str(caught.value)


def test_the_layout_of_the_folder_above_holds_for_a_bare_name_too(tmp_path, monkeypatch):
    (tmp_path / "inner").mkdir()
    (tmp_path / "layout.toml").write_text(PLAIN)
    (tmp_path / "inner" / "NBR_1bar.txt").write_text("".join(f"{10 * k} {k} 1 {3 * k}\n" for k in range(30)))
    monkeypatch.chdir(tmp_path / "inner")
    assert load_recordings(["NBR_1bar.txt"])[0].position_m[-1] == 0.029


def test_no_layout_an_empty_one_and_one_that_is_not_there(tmp_path):

    (tmp_path / "a.csv").write_text(ROWS)
    with pytest.raises(RecordingError, match="there is no layout for this file"):
        load_recordings([tmp_path / "a.csv"])
    with pytest.raises(LayoutError, match="there is no file"):
        load_recordings([tmp_path / "a.csv"], tmp_path / "none.toml")
    (tmp_path / "empty.toml").write_text("")
    with pytest.raises(LayoutError, match=r"(?s)empty.*pneudrive layout"):
        load_recordings([tmp_path / "a.csv"], tmp_path / "empty.toml")


def test_a_pattern_that_does_not_fit_a_name_is_an_error_that_says_where(tmp_path):
    for pattern, name, words in (
        (
            "Messung_{run}_{seal}_{pressure}",
            "Messung_01_DichtungA_xbar.csv",
            r"at \{pressure\} \(a number, .*'xbar'",
        ),
        ("{seal}_{pressure}bar", "lip-2bar.csv", r"at '_', '.*' of the name is not matched"),
        ("{seal}_{pressure}bar_{run}", "lip_2bar.csv", r"at 'bar_', the name is too short"),
    ):
        with pytest.raises(
            LayoutError, match=rf"(?s)does not match the file {name}.*layout.toml:19.*{words}.*\[\[for\]\]"
        ):
            read(tmp_path, PLAIN.replace('"{seal}_{pressure}bar"', f'"{pattern}"'), name=name)
    recording = read(
        tmp_path,
        PLAIN.replace('"{seal}_{pressure}bar"', '"Messung_{run}_{seal}_{pressure}"'),
        name="Messung_01_A_1bar.csv",
    )
    assert recording.labels == {"run": "01", "seal": "A", "pressure": "1bar"}
    other = PLAIN + '\n[[for]]\nmatch = "spare*"\nlabels.pattern = ""\n'
    assert read(tmp_path, other, name="spare.csv").labels == {}
    with pytest.raises(LayoutError, match="a label cannot be called 'recording'"):
        read(tmp_path, PLAIN + 'recording = "3"\n')


def test_a_for_says_a_whole_column_anew_and_the_base_need_not_be_whole(tmp_path):
    dated = PLAIN.replace('unit = "N", positive = "+x"', 'unit = "N", positive = "-x", scale = 2.0')
    dated += '\n[[for]]\nmatch = "lip_*"\ncolumns.force = { column = 3, unit = "kN" }\n'
    assert read(tmp_path, dated).force_n[0] == pytest.approx(102e3), "no scale and no sign of the base are left"
    change = dated.replace('{ column = 3, unit = "kN" }', '{ unit = "kN" }')
    assert read(tmp_path, change).force_n[0] == pytest.approx(-204e3), "a single key changes that key alone"
    held = PLAIN + '\n[[for]]\nmatch = "lip_*"\nchamber_b.pressure = "3 bar abs"\n'
    assert (read(tmp_path, held).pressure_b_pa == 3e5).all()
    measured = PLAIN + '\n[[for]]\nmatch = "lip_*"\ncolumns.pressure_a = { column = 2, unit = "bar abs" }\n'
    assert read(tmp_path, measured).pressure_a_pa[0] == pytest.approx(2.02e5)
    force = 'force = { column = 3, unit = "N", positive = "+x" }\n'
    each = PLAIN.replace(force, "") + "".join(
        f'\n[[for]]\nmatch = "{name}_*"\ncolumns.{force}' for name in ("lip", "cup")
    )
    assert read(tmp_path, each).force_n[0] == pytest.approx(102)
    with pytest.raises(LayoutError, match="does not name the column of the force"):
        read(tmp_path, each, name="none_2bar.csv")
