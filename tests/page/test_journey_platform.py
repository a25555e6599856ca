"""A tripod is described, moved and exported: with the mouse in at most 12 clicks, and by the keyboard alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import pneudrive as pn
from page.test_journeys import Open, reach
from pneudrive.fmu.description import read_fmu

if TYPE_CHECKING:
    from pathlib import Path

    from page.conftest import Server

MOST_CLICKS = 12
COMMANDS = {f"valve_{i}": f"0 s: {0.05 * i:.2f}, 0.2 s: 0" for i in (1, 2, 3)}
TYPED = "\n".join(f"{name}: {text}" for name, text in COMMANDS.items())


class Mouse:
    """Hands that count: each click, drag and choice from a menu is one."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks = page, 0

    def click(self, selector: str) -> None:
        self.page.click(selector)
        self.clicks += 1

    def write(self, selector: str, text: str) -> None:
        """Click into a field, and type over what it holds."""
        self.click(selector)
        self.page.keyboard.press("Control+a")
        self.page.keyboard.insert_text(text)

    def drag(self, selector: str, by: float) -> None:
        self.page.locator(selector).scroll_into_view_if_needed()
        box = self.page.locator(selector).bounding_box()
        self.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.page.mouse.down()
        self.page.mouse.move(box["x"] + box["width"] / 2 + by, box["y"] + box["height"] / 2, steps=4)
        self.page.mouse.up()
        self.clicks += 1


class Keyboard(Mouse):
    """Hands that never touch the mouse: Tab to what is wanted, then Enter, Space or arrows."""

    def click(self, selector: str) -> None:
        reach(self.page, selector)
        if self.page.evaluate("!document.activeElement.matches('input, textarea')"):
            self.page.keyboard.press("Enter")

    def drag(self, selector: str, by: float) -> None:
        reach(self.page, selector)
        self.page.keyboard.press("ArrowLeft" if by > 0 else "ArrowRight")


def describe_move_and_export(hands: Mouse, folder: Path) -> None:
    page = hands.page
    hands.write(".starts form input", "lift table")
    hands.click("button:text-is('Start with a platform')")
    page.wait_for_selector(".turned svg", timeout=60_000)  # the server imports what draws
    hands.click(".verbs a:text-is('Drive')")
    hands.write("input[aria-label='components.tripod.mass']", "8 kg")
    page.keyboard.press("Tab")
    page.wait_for_selector(".cm-content >> text=8 kg")
    hands.click("button:text-is('Save')")
    page.wait_for_selector("text=Saved lift table.toml.")
    hands.click(".verbs a:text-is('Simulate')")
    page.wait_for_selector(".turned svg")
    hands.write(".run textarea", TYPED)
    page.wait_for_selector(".platform [data-state=good]")
    before = page.get_attribute(".turned polyline.platform", "points")
    hands.drag(".turned", 120)
    page.wait_for_function(
        "(before) => document.querySelector('.turned polyline.platform').getAttribute('points') !== before", arg=before
    )
    hands.click(".verbs a:text-is('Export')")
    hands.click("button:text-is('Export')")
    fmu = folder / "results" / "drive.fmu"
    page.wait_for_selector("[data-state=done] >> text=results/drive.fmu", timeout=60_000)
    assert "tripod.heave" in {one.name for one in read_fmu(fmu).variables}
    assert pn.Circuit.load(folder / "lift table.toml").name == "lift table"


@pytest.mark.parametrize("hands", [Mouse, Keyboard])
def test_a_tripod_is_described_moved_and_exported(own_server: Server, open_tab: Open, hands: type[Mouse]) -> None:
    (own_server.folder / "axis.toml").unlink()
    tab = open_tab(own_server.address)
    used = hands(tab.page)
    describe_move_and_export(used, own_server.folder)
    assert used.clicks <= MOST_CLICKS
    tab.check()
