"""A tripod is described, moved and exported: by the keyboard alone, with few keys beside Tab."""

from __future__ import annotations

import pneudrive as pn
from page.conftest import Server
from page.hands import MOST_CLICKS, Hand
from page.test_journeys import Open
from pneudrive.fmu.package import read_fmu

COMMANDS = {f"valve_{i}": f"0 s: {0.05 * i:.2f}, 0.2 s: 0" for i in (1, 2, 3)}
TYPED = "\n".join(f"{name}: {text}" for name, text in COMMANDS.items())


def test_a_tripod_is_described_moved_and_exported_by_keyboard(own_server: Server, open_tab: Open) -> None:
    folder = own_server.folder
    (folder / "axis.toml").unlink()
    tab = open_tab(own_server.address)
    page, hand = tab.page, Hand(tab, "keyboard")
    hand.type(".starts form input", "lift table")
    hand.press("button:text-is('Start with a platform')")
    page.wait_for_selector(".turned svg")  # the server imports what draws
    hand.press(".verbs a:text-is('Drive')")
    hand.type("input[aria-label='components.tripod.mass']", "8 kg")
    page.wait_for_selector(".cm-content >> text=8 kg")
    hand.press("button:text-is('Save')")
    page.wait_for_selector("text=Saved lift table.toml.")
    hand.press(".verbs a:text-is('Simulate')")
    page.wait_for_selector(".turned svg")
    hand.type(".run textarea", TYPED)
    page.wait_for_selector(".platform [data-state=good]")
    before = page.get_attribute(".turned polyline.platform", "points")
    hand.reach(".turned")
    page.keyboard.press("ArrowLeft")
    page.wait_for_function(
        "(before) => document.querySelector('.turned polyline.platform').getAttribute('points') !== before", arg=before
    )
    hand.press(".verbs a:text-is('Export')")
    hand.press("button:text-is('Export')")
    fmu = folder / "results" / "drive.fmu"
    page.wait_for_selector("[data-state=done] >> text=results/drive.fmu")
    assert "tripod.heave" in {one.name for one in read_fmu(fmu).variables}
    assert pn.Circuit.load(folder / "lift table.toml").name == "lift table"
    assert hand.clicks <= MOST_CLICKS
    tab.check()
