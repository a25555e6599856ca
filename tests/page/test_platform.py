"""A platform that moves in a browser: on a canvas below the circuit, by the slider and by Play."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from page.conftest import Server
from page.test_journeys import Open, violations
from page.test_nothing_lost import go

TRIPOD = Path(__file__).parents[2] / "examples" / "tripod.toml"
#: Text of the commands that the page puts in for a new circuit, and duration.
COMMANDS, DURATION = {f"valve_{i}": "0 s: 1, 1 s: -1" for i in (1, 2, 3)}, "2 s"
OUTPUTS = ["heave", "tilt_1", "smallest_singular_value", "leg_1_force", "leg_3_side_force"]
#: Number of different pixels of a canvas.
PIXELS = """(canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
}"""

#: Pairs of texts of the circuit whose boxes overlap.
OVERLAPS = """() => {
  const texts = [...document.querySelectorAll("svg.circuit text")];
  const own = texts.map((one) => [one.textContent, one.getBoundingClientRect()]);
  const across = (a, b) => a.left < b.right - 0.5 && b.left < a.right - 0.5;
  const meet = (a, b) => across(a, b) && a.top < b.bottom - 0.5 && b.top < a.bottom - 0.5;
  return own.flatMap(([text, a], i) => own.slice(i + 1).filter(([, b]) => meet(a, b)).map(([other]) => [text, other]));
}"""


def cell(page: object, column: str) -> float:
    return float(page.get_attribute(f"[data-output='{column}']", "data-si"))


@pytest.mark.parametrize("look", ["light", "dark"])
def test_the_slider_shows_the_recorded_poses(server: Server, open_tab: Open, look: str) -> None:
    (server.folder / "tripod.toml").write_text(TRIPOD.read_text())
    tab = open_tab(server.address, look)
    page = tab.page
    go(page, "drive", "tripod.toml")
    page.click("button:text-is('Run in the drawing')")
    page.wait_for_selector(".platform canvas")
    assert page.locator(".motion button:text-is('Play')").count() == 0  # reduced motion: only the slider moves it
    circuit = pn.Circuit.load(TRIPOD)
    run = pn.platform(circuit).outputs(circuit.simulate(COMMANDS, DURATION))
    samples = np.linspace(0, run.sizes["time"] - 1, 400).round().astype(int)
    page.focus(".motion input[type=range]")
    for key, sample in (("End", 399), ("Home", 0)):
        page.keyboard.press(key)
        page.wait_for_selector(f".platform[data-sample='{sample}']")
        assert page.evaluate(OVERLAPS) == []
        for name in OUTPUTS:
            own = run[f"tripod.{name}"]
            assert cell(page, own.attrs["column"]) == pytest.approx(float(own[samples[sample]]), rel=1e-9, abs=1e-9)
    assert page.locator(".platform canvas").evaluate(PIXELS) > 3
    assert violations(tab) == []
    tab.picture(f"platform-{look}")
    page.set_viewport_size({"width": 400, "height": 800})
    page.wait_for_selector(".platform canvas")
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    tab.picture(f"platform-narrow-{look}")
    page.set_viewport_size({"width": 1400, "height": 1000})
    tab.check()


def hexapod() -> str:
    """Return the tripod with six legs: more pressures than a plot has curves."""
    text = TRIPOD.read_text().replace("3-rps", "6-ups").partition("[initial]")[0]
    for kind in ("valve", "leg"):
        text = re.sub(rf"copies = .*{kind}_1.*", f"copies = {[f'{kind}_{i}' for i in range(1, 7)]}", text)
    each = (
        '"mains -> valve_{0}.1", "valve_{0}.4 -> leg_{0}.a", "valve_{0}.2 -> leg_{0}.b", "leg_{0}.rod -> tripod.{0}",'
    )
    joined = "\n".join(each.format(i) for i in range(1, 7))
    text = re.sub(r"connections = \[.*?\n\]", f"connections = [{joined}]", text, flags=re.DOTALL)
    return f'{text}base_angle = "15 deg"\nplatform_angle = "20 deg"\n'


@pytest.mark.parametrize("text", [TRIPOD.read_text(), hexapod()], ids=["tripod", "hexapod"])
def test_play_moves_the_platform(server: Server, browser: object, text: str) -> None:
    (server.folder / "tripod.toml").write_text(text)
    page = browser.new_context(locale="en-GB", reduced_motion="no-preference").new_page()
    page.goto(server.address)
    go(page, "drive", "tripod.toml")
    page.click("button:text-is('Run in the drawing')")
    page.wait_for_selector(".platform[data-sample='0']")
    before = page.locator(".platform canvas").evaluate("(canvas) => canvas.toDataURL()")
    page.click("button:text-is('Play')")
    page.wait_for_selector(".platform[data-sample='399']")
    page.wait_for_selector("button:text-is('Play')")  # it has stopped at the end
    assert page.locator(".platform canvas").evaluate("(canvas) => canvas.toDataURL()") != before
    page.context.close()
