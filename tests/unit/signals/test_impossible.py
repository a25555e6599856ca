"""Numbers that no rig can have measured never come out as friction.

The right line is the header, one name is one column, impossible quantities are refused with what to look at, and
unlikely ones carry a flag and a sentence.
"""

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.characterise import Layout, characterise, characterise_recordings
from pneudrive.errors import LayoutError, RecordingError
from pneudrive.signals.proposal import propose_layout

HEAD = "Zeit [s];Weg [mm];Kraft [N];p_A [bar];p_B [bar]"
PREAMBLES = {
    "padded": ["Pruefstand;Reibung;;;", "Bediener;Mueller;;;", HEAD],
    "padded to words": ["Pruefstand;3;Reibung;von;Mueller", HEAD],
    "units below": ["Bench;x;;;", "Zeit;Weg;Kraft;p_A;p_B", "[s];[mm];[N];[bar];[bar]"],
    "numbers in it": ["Samples;5;5;5;5", "1;2;3;4;5", HEAD],
    "comments behind": [
        "***End_of_Header***;;;;",
        ";;;;",
        "Channels;4;;;",
        "***End_of_Header***;;;;",
        HEAD + ";Comment",
    ],
    "no names": ["***End_of_Header***;;;;"],
    "equal names": ["Zeit;Weg;Signal;Signal;Signal"],
    "empty names": ["Zeit;Weg;;p_A;p_B"],
}


@pytest.fixture(scope="module")
def rows() -> list[str]:
    """Friction of 15 N and an offset of 1 N at 100 mm/s, both chambers at 2 bar gauge; the sensor sees -x."""
    t = np.arange(0, 24, 0.01)
    phase = (t / 6) % 1
    x = 20 + 300 * np.where(phase < 0.5, 2 * phase, 2 - 2 * phase)
    rng = np.random.default_rng(0)
    force = np.where(phase < 0.5, 15.0, -15.0) + 1 + 0.2 * rng.standard_normal(t.size)
    p, q = 2 + 0.002 * rng.standard_normal((2, t.size))
    table = zip(t, x, -force, p, q, strict=True)
    return [";".join(f"{v:.4f}" for v in row).replace(".", ",") for row in table]


@pytest.mark.parametrize("kind", PREAMBLES)
def test_the_line_of_names_is_found_whatever_stands_above(rows, tmp_path, kind):
    (tmp_path / "a.csv").write_text("\n".join([*PREAMBLES[kind], *rows]))
    proposal = propose_layout(tmp_path / "a.csv")
    text = proposal.text
    if kind in ("no names", "equal names"):  # equal pressures without names: nothing tells their chambers
        assert proposal.problem.startswith(
            "the file does not contain all information. pressure_a and pressure_b: neither names nor"
        )
        for side in "ab":
            text = text.replace("# pressure = {", f"pressure_{side} = {{", 1)
    else:
        assert proposal.problem == ""
    curves = characterise(tmp_path / "a.csv", Layout.loads(text))
    assert curves.friction_n.to_numpy() == pytest.approx(15.0, abs=0.05)
    assert curves.pressure_a_pa.to_numpy() == pytest.approx(301325, abs=100)
    assert curves.offset_n.to_numpy() == pytest.approx(1.0, abs=0.05)


def test_a_name_of_several_columns_and_a_column_of_two_quantities_are_refused(rows, tmp_path):
    (tmp_path / "a.csv").write_text("\n".join([*PREAMBLES["equal names"], *rows]))
    text = propose_layout(tmp_path / "a.csv").text
    for side in "ab":
        text = text.replace("# pressure = {", f"pressure_{side} = {{", 1)
    with pytest.raises(RecordingError, match=r"(?s)3 columns are named 'Signal'.*column = 2 or 3 or 4"):
        characterise(tmp_path / "a.csv", Layout.loads(text.replace("column = 3", 'column = "Signal"')))
    with pytest.raises(LayoutError, match=r"columns\.\w+ and columns\.\w+ read the same column: 2"):
        Layout.loads(text.replace("column = 3", "column = 2"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: {"pressure_b_pa": r.pressure_b_pa - 27e5}, r"pressure_b is -22\.\d+ bar absolute.*below vacuum"),
        (lambda r: {"pressure_b_pa": r.pressure_b_pa * 50}, r"pressure_b is 200\.\d bar absolute.*no pneumatic rig"),
        (lambda r: {"time_s": r.time_s * 1e-4}, r"moves at 100 m/s.*unit of the time"),
        (lambda r: {"position_m": r.position_m * 1e4, "time_s": r.time_s * 1e4}, r"strokes are \d+ m long"),
        (lambda r: {"force_n": r.force_n * 1e6}, r"force reaches .* N.*unit of the force"),
    ],
)
def test_what_no_rig_does_is_refused_with_what_to_look_at(make, change, words):
    recording = make(strokes=4)
    with pytest.raises(RecordingError, match="(?s)" + words):
        characterise(replace(recording, **change(recording)))


@pytest.mark.parametrize(
    ("change", "flag", "words"),
    [
        (lambda r: {"pressure_b_pa": r.pressure_b_pa - 3.3e5}, "below_ambient", "gauge pressures"),
        (lambda r: {"pressure_b_pa": r.pressure_b_pa * 10}, "beyond_usual", "units of pressure"),
        (lambda r: {"time_s": r.time_s / 2000}, "beyond_usual", "a speed of 20000 mm/s is unusual"),
        (lambda r: {"force_n": -r.force_n}, "force_not_pressure", "sign and unit of the force"),
        (lambda r: {"force_n": r.force_n - 147}, "force_not_pressure", "zeroed under pressure"),
        (lambda r: {"pressure_a_pa": r.pressure_b_pa, "pressure_b_pa": r.pressure_a_pa}, "force_not_pressure", "cham"),
        (lambda r: {"force_n": r.force_n * 1000}, "friction_beyond_piston", "unit and sign of the force"),
        (lambda r: {"force_n": 147 + (r.force_n - 147) * 1e-5}, "no_friction", "column and unit"),
    ],
)
def test_what_is_unlikely_carries_a_flag_and_a_sentence(make, change, flag, words):
    recording = make(strokes=4, gauge_b=3e5)
    fine = characterise_recordings(recording)
    assert not any(doubt in fine.friction_map["flags"].item(0) for doubt in ("below", "beyond", "force_not", "no_f"))
    found = characterise_recordings(replace(recording, **change(recording)))
    assert flag in found.friction_map["flags"].item(0)
    assert any(note.startswith("Check the layout of made") and words in note for note in found.notes)
