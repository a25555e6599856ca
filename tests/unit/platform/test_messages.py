"""Faults of a file with a platform: file, line, value, rule and remedy, from `pneudrive platform`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

EXAMPLE = (Path(__file__).parents[3] / "examples" / "tripod.toml").read_text("utf-8")
DELTA = EXAMPLE.replace("3-rps", "linear-delta").replace("centre =", "#").replace("inertia =", "#")
STROKE, JOINED = 'stroke = "200 mm"', '"leg_3.rod -> tripod.3"'
#: Text of the file, the marked line, and what the message says: fault with value, rule, remedy.
CASES = {
    "leg without cylinder": (
        EXAMPLE.replace(f"    {JOINED},\n", ""),
        "[components.tripod]",
        ["port tripod.3 is not connected", "each leg needs a cylinder", 'Write "leg_3.rod -> tripod.3"'],
    ),
    "leg without rod": (
        EXAMPLE.replace(JOINED, '"weight -> tripod.3"') + '[components.weight]\nkind = "load"\nmass = "3 kg"\n',
        "weight -> tripod.3",
        ["leg 3 of tripod has no cylinder", "each leg needs a cylinder or a slide", "Join the rod of a cylinder"],
    ),
    "two cylinders on a leg": (
        EXAMPLE.replace(JOINED, '"leg_3.rod -> tripod.2"'),
        "leg_2.rod -> tripod.2",
        ["leg_2 and leg_3 both move leg 2 of tripod", "each leg accepts only one cylinder", "put a coupling between"],
    ),
    "inertia": (
        EXAMPLE.replace('z = "0.17 kg m2"', 'z = "0.19 kg m2"'),
        "inertia = ",
        ["tripod.inertia.z = 0.19 kg m2 is impossible", "z <= x + y = 0.18 kg m2", "through the centre of mass"],
    ),
    "sticking friction": (
        re.sub(r", bristle_.*}", " }", EXAMPLE.replace("lugre", "stribeck")),
        "friction = ",
        ["leg_1.friction: this law sticks", "Choose a law without such a mode", "or put a coupling"],
    ),
    "start without a pose": (
        EXAMPLE.replace(STROKE, 'stroke = "400 mm"')
        + "".join(f'leg_{i}.position = "{x} mm"\n' for i, x in ((1, 0), (2, 400), (3, 400))),
        "leg_1.position = ",
        ["no pose of tripod has its legs at 0, 400, 400 mm", "in the nearest pose leg_1.position", "Start from a pose"],
    ),
    "start beyond a stroke": (
        EXAMPLE + 'tripod.heave = "600 mm"\n',
        "tripod.heave = ",
        ["the pose of tripod needs leg_1.position = 252.1 mm", "0 mm <= position <= 200 mm", "nearer to mid stroke"],
    ),
    "pose and positions": (
        EXAMPLE + 'tripod.heave = "450 mm"\nleg_1.position = "90 mm"\n',
        "leg_1.position = ",
        ["leg_1.position and a pose of tripod are both given", "from a pose or from positions", "Remove one"],
    ),
    "delta with short arms": (
        DELTA.replace('length = "350 mm"', 'length = "40 mm"'),
        "[components.tripod]",
        [
            "the arm of leg_1 does not reach tripod from leg_1.position = 100 mm",
            "the arm must reach from",
            "Lengthen the arms",
        ],
    ),
    "delta far away": (
        DELTA + 'tripod.x = "400 mm"\n',
        "tripod.x = ",
        ["the arm of leg_1 does not reach the pose x = 400 mm", "the arm must reach from", "nearer to mid stroke"],
    ),
    "singular start": (
        EXAMPLE.replace('length = "350 mm"', 'length = "50 mm"')
        + "".join(f'leg_{i}.position = "0 mm"\n' for i in (1, 2, 3)),
        "leg_1.position = ",
        ["the start pose of tripod is singular: heave =", "must be above 1e-06", "Start from another pose"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_told_with_its_line_rule_and_remedy(case, tmp_path, refusal):
    text, mark, words = CASES[case]
    path = tmp_path / "machine.toml"
    path.write_text(text)
    said = " ".join(refusal(["platform", path]).split())
    line = next(number for number, one in enumerate(text.splitlines(), start=1) if mark in one)
    assert f"{path}:{line} " in said
    for word in words:
        assert word in said
    assert "nan" not in said
