"""Every flag that a map can carry is explained, in the report and in the guide alike."""

import inspect
import re
from pathlib import Path

from pneudrive.friction import level
from pneudrive.report.topics import Topic
from pneudrive.signals import samples
from pneudrive.signals.tables import text_table

FLAGS = Topic("recordings", "flags").texts["meaning"]
GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "recordings.md"


def test_the_guide_explains_the_flags_of_the_report():
    table = GUIDE.read_text(encoding="utf-8").partition("| flag | meaning |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) == set(FLAGS)


def test_what_the_code_raises_is_explained():
    of_levels = set(re.findall(r'"(\w+)":', inspect.getsource(level.level_flags)))
    of_levels |= set(re.findall(r'"(\w+)": .*(?:[<>]|any)', inspect.getsource(level.doubts_of)))
    of_samples = set(re.findall(r'_count\(counts, "(\w+)"', inspect.getsource(samples.clean)))
    of_samples |= set(
        re.findall(r'"(\w+)"', inspect.getsource(samples._bad_samples).split("masks = ")[1].split("}")[0])
    )
    of_rows = set(re.findall(r'\{"(\w+)": \w+', inspect.getsource(text_table)))
    assert len(of_levels) >= 14
    assert len(of_samples) >= 6
    assert of_rows == {"unreadable_row"}
    assert of_levels | of_samples | of_rows <= set(FLAGS)
