"""A stroke that does not enter the result is counted, and its reason stands in notes, map, terminal and report."""

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings, read_map
from pneudrive.cli.main import run
from pneudrive.friction.strokes import StrokeUse, stroke_notes

CHANNELS = ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
WINDOW_M = (0.015, 0.030)
LAYOUT = """
format = "csv"
header = true
delimiter = "comma"
[columns]
time = { column = "time_s", unit = "s" }
position = { column = "position_m", unit = "m" }
force = { column = "force_n", unit = "N", positive = "+x" }
pressure_b = { column = "pressure_b_pa", unit = "Pa abs" }
[geometry]
kind = "rodless"
bore = "25 mm"
[chamber_a]
open_to_ambient = true
[window]
position = "15 mm .. 30 mm"
"""


@pytest.fixture
def partial(make):
    """Return a recording of ten whole strokes and six short ones; the last one damaged in the window of one stroke."""
    whole, short = make(strokes=10), make(strokes=6, travel=0.012, seed=2)
    joined = {c: np.concatenate([getattr(whole, c), getattr(short, c)]) for c in CHANNELS}
    time = np.concatenate([whole.time_s, short.time_s + whole.time_s[-1] + 0.01])
    lost = (time > 4.7) & (time < 7.6)  # settled samples of the second stroke, which returns through the window
    joined["force_n"][lost] = np.nan
    return replace(whole, time_s=time, **joined, window_m=WINDOW_M, name="partial")


def test_strokes_that_miss_the_window_are_counted_with_their_reason(partial):
    found = characterise_recordings(partial)
    use = found.stroke_uses["partial"]
    assert (use.recorded, use.used) == (16, 9)
    assert use.left_out == {"window": 6, "unsettled": 1}
    assert any(
        note == "partial: 9 of 16 strokes are used; not used: 6 across less than a quarter of the window, "
        "1 with too few settled samples in the window."
        for note in found.notes
    )
    rows = found.friction_map
    assert rows["strokes"].to_numpy().tolist() == [5, 4]
    assert rows["strokes_recorded"].to_numpy().tolist() == [8, 8]
    assert rows["friction_n"].to_numpy() == pytest.approx(5.0, abs=0.1)


def test_a_recording_whose_strokes_all_count_has_no_note(make):
    found = characterise_recordings(make(window_m=WINDOW_M))
    assert found.stroke_uses["made"] == StrokeUse(10, {})
    assert not any("strokes are used" in note for note in found.notes)


def test_terminal_map_and_report_say_the_same(partial, tmp_path, capsys):
    columns = np.column_stack([partial.time_s, *(getattr(partial, c) for c in ("position_m", "force_n"))])
    columns = np.column_stack([columns, partial.pressure_b_pa])
    head = "time_s,position_m,force_n,pressure_b_pa"
    np.savetxt(tmp_path / "partial.csv", columns, delimiter=",", header=head, comments="")
    (tmp_path / "layout.toml").write_text(LAYOUT)
    out = tmp_path / "out"
    assert run(["characterise", str(tmp_path / "partial.csv"), "--out", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "9 of 16" in said
    assert "6 across less than a quarter of the window" in said
    assert read_map(out / "map.csv")["strokes_recorded"].to_numpy().tolist() == [8, 8]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "9 of 16 strokes are used" in page
    assert "6 across less than a quarter of the window" in page


def test_many_partial_recordings_have_one_sentence_for_the_rest():
    notes = list(stroke_notes({f"r{i}": StrokeUse(10, {"window": 10 - i % 9}) for i in range(40)}))
    assert len(notes) == 13
    assert notes[-1].startswith("28 more recordings: ")
