"""A real gas spring: all speed levels, against the mean of the raw columns, and wrong layouts that are named.

The other route reads the raw columns with NumPy and averages between two positions. It finds no strokes and chooses no
samples. The ambient air presses on the rod, which leaves through chamber b.
"""

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.characterise import characterise_recordings, load_recordings
from pneudrive.validate.motion import close_balance

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data" / "measurements" / "mbari-2022-gas-spring"
FILES = {name: DATA / f"{name}.exp.xz" for name in ("charged", "vented")}
LAYOUT = DATA / "layout.toml"


@pytest.fixture(scope="module")
def recorded():
    return dict(zip(FILES, load_recordings([*FILES.values()], LAYOUT), strict=True))


@pytest.fixture(scope="module")
def found():
    return characterise_recordings([*FILES.values()], LAYOUT)


@pytest.fixture(scope="module")
def independent():
    sys.path.insert(0, str(ROOT / "tools"))  # of the modules beside the tool
    balance = runpy.run_path(str(ROOT / "tools" / "real_drives.py"))["independent_balance"]
    return {name: np.array(balance(path)) for name, path in FILES.items()}


def extension(found, name):
    return [level for level in found.levels if level.recording == name and 1 in level.sides]


@pytest.mark.parametrize("name", FILES)
def test_all_extension_levels_agree_with_the_mean_of_the_raw_columns(found, independent, name):
    levels = extension(found, name)
    speeds, means = independent[name][independent[name][:, 0] > 0.0].T
    assert len(levels) == len(speeds) == 12
    for level, mean in zip(levels, means[np.argsort(speeds)], strict=True):
        assert level.friction_n == pytest.approx(mean, rel=0.10)


def test_the_interval_contains_five_percent_of_ram_area_and_30_ms(found, recorded):
    for recording in recorded.values():
        (ram,) = recording.parallel
        wider = replace(recording, parallel=(ram._replace(force_n=1.05 * ram.force_n),))
        late = {
            f"pressure_{side}_pa": np.interp(recording.time_s - 0.03, recording.time_s, values)
            for side, values in (("a", recording.pressure_a_pa), ("b", recording.pressure_b_pa))
        }
        for changed in (wider, replace(recording, **late)):
            others = extension(characterise_recordings([changed]), recording.name)
            for level, other in zip(extension(found, recording.name), others, strict=True):
                assert abs(other.friction_n - level.friction_n) < level.expanded_n


@pytest.mark.parametrize("seconds", [0.3, -0.3])
def test_the_force_balance_removes_a_delay_of_the_pressures(recorded, seconds):
    """The friction is that of the recording before the shift; both values are printed."""
    charged = recorded["charged"]
    time = charged.time_s
    names = ("pressure_a_pa", "pressure_b_pa")
    late = {name: np.interp(time - seconds, time, getattr(charged, name)) for name in names}
    found = close_balance(replace(charged, **late))
    base = close_balance(charged)
    assert base.recorded is None
    for speed in (0.05, 0.1, 0.3, 0.6):
        assert found.friction_at(speed) == pytest.approx(base.friction_at(speed), rel=0.07)
    assert abs(found.recorded.friction_at(0.6) / base.friction_at(0.6) - 1.0) > 0.5
    assert found.share < 0.005
    assert f"{abs(found.delay.value_s):.3f}" in str(found)
    assert "is removed" in str(found)


def test_the_interval_of_one_part_contains_the_value_of_the_next(recorded):
    """The second half of the recording counts as the next recording of the same machine."""
    charged = recorded["charged"]
    time = charged.time_s - charged.time_s[0]
    free = ["volumes", "heat"]
    first = pn.identify_motion(DATA / "spring.toml", charged.at(time < 225.0), free)
    second = pn.identify_motion(DATA / "spring.toml", charged.at(time >= 225.0), free, rivals=False)
    outside = 0
    for name, value in second.values.items():
        low, high = first.intervals[name]
        assert low <= value <= high, name
        assert np.log(high / low) < (0.15 if name.endswith("volume") else 0.8)
        outside += not first.details[name]["model_interval"][0] <= value <= first.details[name]["model_interval"][1]
    assert outside  # the interval of one model alone does not contain all of them


def test_recordings_of_one_machine_that_differ_are_reported(found, recorded):
    (note,) = (note for note in found.notes if "different friction" in note)
    assert "charged and vented" in note
    assert "cannot be more accurate" in note
    again = replace(recorded["vented"], name="again", force_n=recorded["vented"].force_n + 1.0)
    same = characterise_recordings([recorded["vented"], again])
    assert not any("different friction" in note for note in same.notes)


TRADED = (("UpperSpring", "other"), ("LowerSpring", "UpperSpring"), ("other", "LowerSpring"))
NO_RAM = "a parallel force that the layout does not describe"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ((), ""),
        ((('"psi abs"', '"psi gauge"'),), "read as gauge, but seem to be absolute"),
        ((('"psi abs"', '"bar abs"'),), "check the unit"),
        (TRADED, "seem to be swapped"),
        ((('"lbf", positive = "+x"', '"lbf", positive = "-x"'),), "the force has the wrong sign"),
        ((), NO_RAM),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_wrong_layout_of_the_vented_recording_is_named(tmp_path, changes, words):
    text = LAYOUT.read_text(encoding="utf-8")
    if words == NO_RAM:
        text = text.partition("[[force]]")[0]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    layout = tmp_path / "layout.toml"
    layout.write_text(text, encoding="utf-8")
    shown = str(pn.validate_motion(DATA / "spring.toml", [FILES["vented"]], layout=layout))
    if words:
        assert words in shown
    else:
        assert not any(word in shown for word in ("seem", "check", "lacks", "other sign"))


@pytest.mark.filterwarnings("ignore")
def test_a_model_that_is_not_identified_blames_no_sensor():
    """The start values of the circuit miss by 12 % of the range: that says nothing about gauge, clocks or sensors."""
    shown = str(pn.validate_motion(DATA / "spring.toml", [FILES["charged"]], layout=LAYOUT))
    assert "Identify volumes and heat transfer first" in shown
    assert not any(words in shown for words in ("seem to be", "clocks of the loggers differ"))
