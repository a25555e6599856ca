"""Every flag that a map can carry has a meaning and a remedy, which terminal, report, page and guide take."""

import inspect
import re
from pathlib import Path

from pneudrive.characterise import characterise_recordings
from pneudrive.friction import level
from pneudrive.friction.sentences import flag_sentences, flag_table
from pneudrive.signals import recording, text_table

FLAGS = flag_table()
GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "recordings.md"


def test_the_guide_has_the_meanings_and_remedies_of_the_table():
    table = GUIDE.read_text(encoding="utf-8").partition("| --- | --- | --- |\n")[2].partition("\n\n")[0]
    rows = [re.findall(r"[^|]+", line) for line in table.splitlines()]
    assert len(rows) >= 26
    for name, means, do in rows:
        assert FLAGS[name.strip(" `")] == {"means": means.strip(), "do": do.strip()}


def test_terminal_and_notebook_explain_the_raised_flags(make):
    found = characterise_recordings(make(friction=-4.0))
    assert flag_sentences(["negative_friction"])[0] in found.view().notes
    assert not any("unpaired:" in note for note in found.view().notes)


def test_what_the_code_raises_is_explained():
    of_levels = set(re.findall(r'"(\w+)":', inspect.getsource(level.level_flags)))
    of_levels |= set(re.findall(r'"(\w+)": .*(?:[<>]|any)', inspect.getsource(level.doubts_of)))
    of_samples = set(re.findall(r'count\("(\w+)"', inspect.getsource(recording.clean)))
    of_samples |= set(
        re.findall(r'"(\w+)"', inspect.getsource(recording._bad_samples).split("masks = ")[1].split("}")[0])
    )
    of_rows = set(re.findall(r'\{"(\w+)": \w+', inspect.getsource(text_table.read_text)))
    assert len(of_levels) >= 14
    assert len(of_samples) >= 6
    assert of_rows == {"unreadable_row"}
    assert of_levels | of_samples | of_rows <= set(FLAGS)
