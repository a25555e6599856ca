"""A platform that moves in a browser: turned by mouse and keys, moved by the slider and by Play."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import Server, Tab
from page.test_journeys import Open, violations
from page.test_nothing_lost import go
from pneudrive.simulation.trajectory import columns as columns_of
from pneudrive.simulation.trajectory import save_columns

TRIPOD = Path(__file__).parents[2] / "examples" / "tripod.toml"
#: Text of the commands that the page puts in for a new circuit, and duration.
COMMANDS, DURATION = {f"valve_{i}": "0 s: 1, 1 s: -1" for i in (1, 2, 3)}, "2 s"
OUTPUTS = ["heave", "tilt_1", "smallest_singular_value", "leg_1_force", "leg_3_side_force"]
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
def test_a_platform_is_moved_and_turned(server: Server, open_tab: Open, look: str) -> None:
    (server.folder / "tripod.toml").write_text(TRIPOD.read_text())
    tab = open_tab(server.address, look)
    page = tab.page
    page.set_viewport_size({"width": 1440, "height": 900})
    go(page, "simulate", "tripod.toml")
    page.wait_for_selector(".turned svg", timeout=60_000)  # the server imports what draws
    expect(page.locator(".platform .answer-card h2").first).to_contain_text("3 of 3 legs reach an end")
    assert 1 <= page.locator(".platform [data-leading]").count() <= 5
    assert page.locator(".turned svg").bounding_box()["y"] < 600
    expect(page.locator(".motion button:text-is('Play')")).to_have_count(0)  # reduced motion: only the slider moves it
    circuit = pn.Circuit.load(TRIPOD)
    run = pn.platform(circuit).outputs(circuit.simulate(COMMANDS, DURATION))
    samples = np.linspace(0, run.sizes["time"] - 1, 400).round().astype(int)
    page.click("summary:text-is('Circuit')")
    page.focus(".motion input[type=range]")
    for key, sample in (("End", 399), ("Home", 0)):
        page.keyboard.press(key)
        page.wait_for_selector(f".platform[data-sample='{sample}']")
        assert page.evaluate(OVERLAPS) == []
        for name in OUTPUTS:
            own = run[f"tripod.{name}"]
            assert cell(page, own.attrs["column"]) == pytest.approx(float(own[samples[sample]]), rel=1e-9, abs=1e-9)
    page.focus(".turned")
    page.keyboard.press("ArrowRight")
    page.wait_for_selector("[aria-label='View of tripod, turned -40 degrees, lifted 22 degrees']")
    box = page.locator(".turned").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 100, box["y"] + 150, steps=4)
    page.mouse.up()
    page.wait_for_selector("[aria-label='View of tripod, turned 0 degrees, lifted 42 degrees']")
    assert "view3d=0%2C42%2C1" in page.url  # a shared link shows it so
    page.click("button:text-is('Top')")
    page.wait_for_selector("[aria-label='View of tripod, turned -90 degrees, lifted 90 degrees']")
    x, y = zip(
        *(map(float, point.split(",")) for point in page.get_attribute(".turned polyline.platform", "points").split()),
        strict=True,
    )
    assert max(x) - min(x) == pytest.approx((max(y) - min(y)) * np.cos(np.radians(30)), rel=0.02)  # not foreshortened
    assert violations(tab) == []
    tab.picture(f"platform-{look}")
    page.set_viewport_size({"width": 400, "height": 800})
    page.wait_for_function("document.querySelector('.turned svg').getBoundingClientRect().right <= 400")
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    tab.picture(f"platform-narrow-{look}")
    page.set_viewport_size({"width": 1400, "height": 1000})
    tab.check()


def test_the_path_of_another_run_and_its_reference_lie_in_the_view(server: Server, open_tab: Open) -> None:
    (server.folder / "tripod.toml").write_text(TRIPOD.read_text())
    circuit = pn.Circuit.load(TRIPOD)
    columns = dict(columns_of(circuit.simulate(COMMANDS | {"valve_1": "0 s: -1"}, DURATION)))
    for key, unit in (("heave", "m"), ("tilt_1", "rad"), ("tilt_2", "rad")):  # as a run under control has them
        columns[f"tripod.{key}_reference_{unit}"] = columns[f"tripod.{key}_{unit}"] + 0.01
    save_columns(columns, {}, server.folder / "run.parquet")
    page = open_tab(server.address).page
    go(page, "simulate", "tripod.toml")
    page.wait_for_selector(".turned svg")
    page.select_option("label:has-text('Compare with') select", "run.parquet")
    for label in ("run.parquet", "reference of run.parquet"):
        page.wait_for_selector(f"[data-path='{label}'] polyline", state="attached")


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
    page.wait_for_selector(".platform[data-sample='0'] svg polyline.platform")
    before = page.get_attribute(".turned polyline.platform", "points")
    page.click("button:text-is('Play')")
    page.wait_for_selector(".platform[data-sample='399']")
    page.wait_for_selector("button:text-is('Play')")  # it has stopped at the end
    assert page.get_attribute(".turned polyline.platform", "points") != before
    page.context.close()


# --- A new class of results costs one function: the page shows what its `view` returns.

#: The class, and a reader of its files, before the server starts.
MAIN = (Path(__file__).parents[1] / "data" / "platform_main.py.txt").read_text("utf-8")


def test_a_view_of_a_new_class_is_shown(tmp_path: Path, open_tab: Open) -> None:
    (tmp_path / "main.py").write_text(MAIN)
    folder = tmp_path / "studies"
    folder.mkdir()
    (folder / "cheap.toml").write_text("[sensors]\nposition = 1\n")
    words = [sys.executable, str(tmp_path / "main.py"), "web", str(folder), "--no-browser", "--port", "0"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    server = Server(folder, process.stdout.readline().strip(), process)
    try:
        tab = open_tab(server.address)
        page = tab.page
        go(page, "result", "cheap.toml")
        page.wait_for_selector("td[data-value=reach][data-si='0.25']")
        expect(page.locator("td[data-value=reach]").first).to_have_text("250 ± 10", use_inner_text=True)
        page.wait_for_selector("figure[data-figure='friction over speed'][data-points='3'] .panel-drawing")
        page.wait_for_selector("text=noted by the toy")
        assert violations(tab) == []
        tab.picture("toy-view")
        tab.check()
    finally:
        server.end()


# --- The drawing of a circuit in a browser: edited there and in the text beside it, and moved by a run.

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_circuit_is_edited_in_the_drawing_and_in_the_text(server: Server, open_tab: Open) -> None:
    text = (EXAMPLES / "two_cylinders.toml").read_text()
    (server.folder / "pair.toml").write_text(text)
    tab = open_tab(server.address)
    page = tab.page
    go(page, "drive", "pair.toml")
    page.wait_for_selector("g[data-key=fc_la]")
    page.click("button:text-is('Edit the circuit')")
    page.focus("[aria-label='Port valve_l.4']")  # by the keyboard alone
    page.keyboard.press("Enter")
    page.select_option("[aria-label='Component to add']", "tube")
    page.click("button:text-is('Add here')")
    page.wait_for_selector("g[data-key=tube]")
    page.wait_for_selector(".cm-content >> text=valve_l.4 -> tube -> fc_la -> left.a")
    page.wait_for_selector("text=Values of tube.")
    assert violations(tab) == []
    tab.picture("circuit-edited")
    page.click("button:text-is('Remove tube')")
    page.wait_for_selector("g[data-key=tube]", state="detached")
    page.click("button:text-is('Undo')")
    page.wait_for_selector("g[data-key=tube]")
    for _ in range(2):
        page.keyboard.press("Control+z")  # the last one is one too many
    page.wait_for_selector("g[data-key=tube]", state="detached")
    assert page.locator("button:text-is('Undo')").is_disabled()

    page.click("[aria-label='Port left.a']")
    page.click("button:text-is('Cut its line')")
    page.wait_for_selector(".cm-content >> text=plugged")
    for port in ("left.a", "fc_la.2"):  # wherever the new drawing moves them just now
        page.dispatch_event(f"[aria-label='Port {port}']", "click")
    page.wait_for_selector(".cm-content >> text=left.a -> fc_la.2")
    page.dispatch_event("g[data-key=right]", "click")
    page.wait_for_selector("g[data-key=right][aria-pressed=true]")
    page.focus("g[data-key=right]")
    page.keyboard.press("Delete")
    page.wait_for_selector("g[data-key=right]", state="detached")
    page.click("button:text-is('Undo')")
    page.wait_for_selector("g[data-key=right]")

    page.click(".cm-content >> text=mains -> inlet -> tank")  # the other way round
    page.keyboard.press("Home")
    page.keyboard.type('"tank -> silencer", ')
    page.wait_for_selector(".problem >> text=silencer")
    page.click("button:text-is('Undo')")
    page.wait_for_selector("text=No problems.")
    page.click("button:text-is('Save')")
    page.wait_for_selector("text=Saved pair.toml.")
    saved = pn.Circuit.load(server.folder / "pair.toml")
    assert {frozenset(one) for one in saved.wiring.core()} == {
        frozenset(one) for one in pn.Circuit.load(EXAMPLES / "two_cylinders.toml").wiring.core()
    }
    tab.check()


def test_a_run_moves_the_drawing(server: Server, tab: Tab) -> None:
    page = tab.page
    go(page, "drive", "axis.toml")
    page.click("button:text-is('Run in the drawing')")
    page.wait_for_selector("[data-piston=cylinder]")
    page.focus(".motion input[type=range]")
    page.keyboard.press("End")
    run = pn.simulate(pn.Drive.load(server.folder / "axis.toml"), "0 s: 1, 1 s: -1", "2 s")
    page.wait_for_selector(f"[data-piston=cylinder][data-position='{float(run.position[-1])!r}']")
    shift = "g[data-key=valve] [data-shift]"
    assert float(page.get_attribute(shift, "data-shift")) == -4.0  # modules: one box
    page.keyboard.press("Home")
    page.wait_for_selector(f"{shift}[data-shift='4']")
    page.keyboard.press("End")
    pressure = float(run.pressure_b[-1]) / 1e5
    line = page.locator("g.net[data-net*='cylinder.b']")
    line.dispatch_event("pointerenter")
    page.wait_for_selector(f".pointed >> text={pressure:.3g} bar absolute")
    assert "g/s" in line.get_attribute("data-net")
    page.check("input[aria-label='Slider for cylinder.bore in Simulate']")  # any value becomes a slider here
    page.wait_for_selector(".pinned [id='slider-cylinder.bore']")
    before = page.get_attribute("[data-piston=cylinder]", "data-position")
    page.fill("input[aria-label='cylinder.bore']", "16 mm")
    page.keyboard.press("Tab")
    page.wait_for_selector(f"[data-piston=cylinder]:not([data-position='{before}'])")
    assert violations(tab) == []
    tab.picture("drawing-in-a-run")
    tab.check()
