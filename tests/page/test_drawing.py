"""The drawing of a circuit in a browser: edited there and in the text beside it, and moved by a run."""

from __future__ import annotations

from pathlib import Path

import pneudrive as pn
from page.conftest import Server
from page.test_journeys import Open, violations
from page.test_nothing_lost import go

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


def test_a_drive_is_opened_as_a_circuit(server: Server, open_tab: Open) -> None:
    tab = open_tab(server.address)
    page = tab.page
    go(page, "drive", "axis.toml")
    page.click("button:text-is('Edit the circuit')")
    page.click("button:text-is('Open it as a circuit')")
    page.click("[aria-label='Port cylinder.a']")
    page.select_option("[aria-label='Component to add']", "flow-control")
    page.click("button:text-is('Add here')")
    page.wait_for_selector("g[data-key=flow_control]")
    page.wait_for_selector(".cm-content >> text=valve.4 -> flow_control -> cylinder.a")
    tab.check()


def test_a_run_moves_the_drawing(server: Server, open_tab: Open) -> None:
    tab = open_tab(server.address)
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
