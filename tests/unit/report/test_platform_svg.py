"""The drawing of a platform: every mechanism has one, and its labels lie apart from each other."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.report.circuit.platform_svg import FONT, platform_svg

KINDS = ["platform/3-rps", "platform/3-upu", "platform/6-ups", "platform/linear-delta"]


def machine(kind, rng):
    n = 6 if kind == "platform/6-ups" else 3
    base, top = rng.uniform(150.0, 400.0), rng.uniform(60.0, 250.0)
    table = {"kind": kind, "base_radius": f"{base} mm", "platform_radius": f"{top} mm", "mass": "6 kg"}
    table["length"] = f"{abs(base - top) + rng.uniform(200.0, 400.0)} mm"
    if kind in ("platform/3-rps", "platform/6-ups"):
        table["inertia"] = {"x": "0.09 kg m2", "y": "0.09 kg m2", "z": "0.17 kg m2"}
    if n == 6:
        table |= {"base_angle": f"{rng.uniform(2.0, 25.0)} deg", "platform_angle": f"{rng.uniform(2.0, 25.0)} deg"}
    slides = {f"leg_{i}": {"kind": "slide", "mass": "0.6 kg"} for i in range(1, n + 1)}
    joints = [f"leg_{i}.1 -> own.{i}" for i in range(1, n + 1)]
    return pn.platform(pn.Circuit(components=slides | {"own": table}, connections=joints))


@pytest.mark.parametrize("kind", KINDS)
def test_labels_lie_apart_and_inside(kind):
    rng = np.random.default_rng(4)
    for _ in range(10):
        own = machine(kind, rng)
        svg = ET.fromstring(platform_svg(own, path=own.home + 0.01 * rng.standard_normal((20, len(own.home)))))
        width, height = (float(number) for number in svg.attrib["viewBox"].split()[2:])
        texts = [element for element in svg.iter() if element.tag.endswith("text")]
        assert len(texts) == len(own.legs)
        places = np.array([[float(text.attrib["x"]), float(text.attrib["y"])] for text in texts])
        assert np.all(places > 0.5 * FONT)
        assert np.all(places < [width - 0.3 * FONT, height])
        apart = np.abs(places[:, None] - places[None]) / [0.65 * FONT, FONT]
        assert np.all(np.max(apart, axis=-1)[~np.eye(len(places), dtype=bool)] >= 1.0)
        assert not re.search("nan|inf", ET.tostring(svg, encoding="unicode"))
