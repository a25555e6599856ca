"""The documentation in a browser: its figures and formulas are there, and nothing is asked of any other machine."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from documentation.conftest import BUILT
from page.conftest import Tab

#: Page -> least number of figures; drawings of circuits and formulas count apart.
PAGES = {
    "index": 0,
    "gallery/index": 0,
    "gallery/first-minute": 1,
    "gallery/own-recording": 0,
    "gallery/campaign": 1,
    "gallery/model-holds": 0,
    "gallery/servo-axis": 1,
    "gallery/size-a-drive": 2,
    "gallery/hand-over": 0,
    "guide/circuits": 1,
    "guide/web": 4,
    "guide/fmu": 0,
    "guide/c": 0,
    "guide/control": 1,
    "theory/friction": 0,
    "theory/control": 0,
}
FORMULAS = ("theory/control", "theory/friction")
CIRCUITS = ("gallery/first-minute", "gallery/size-a-drive")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_needs_no_other_machine(name: str, site: str, open_tab: Callable[..., Tab]) -> None:
    tab = open_tab(f"{site}/{name}.html")
    tab.origin = site
    page = tab.page
    page.wait_for_load_state("networkidle")
    figures = page.locator("article img").all()
    assert len(figures) >= PAGES[name]
    assert not [one.get_attribute("src") for one in figures if not one.evaluate("one => one.naturalWidth > 100")]
    if name in FORMULAS:
        page.wait_for_selector("article mjx-container svg path", state="attached")
        assert page.locator("article mjx-container").count() == page.locator("article .math").count()
        assert page.locator("article mjx-merror").count() == 0
    if name in CIRCUITS:
        box = page.locator("article .cell_output svg >> nth=0").bounding_box()
        assert min(box["width"], 2 * box["height"]) > 200
    tab.picture("site-" + name.replace("/", "-"))
    tab.foreign = [one for one in tab.foreign if not one.startswith(site)]
    tab.check()


def test_the_page_of_no_site_asks_for_an_address_of_another_machine() -> None:
    """Nor does one that is not opened here."""
    for path in BUILT.rglob("*.html"):
        text = path.read_text("utf-8")
        for word in ('<script src="http', '<script async="async" src="http', '<img src="http', 'url("http'):
            assert word not in text, path
