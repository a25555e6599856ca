"""A user of the page who counts clicks."""

from __future__ import annotations

from page.conftest import Tab
from page.test_journeys import reach

MOST_CLICKS = 12
LONG = 360_000  # ms; a job on a busy machine


class Hand:
    """A user with a mouse, or with a keyboard alone. Clicks and menu choices count; typing and Tab do not."""

    def __init__(self, tab: Tab, by: str) -> None:
        self.page, self.has_mouse, self.clicks = tab.page, by == "mouse", 0
        self.page.set_default_timeout(LONG)

    def reach(self, selector: str) -> None:
        """Move the focus to an element, by keyboard as Tab does it."""
        if self.has_mouse:
            self.page.locator(selector).first.focus()
        else:
            self.page.wait_for_selector(selector)
            reach(self.page, selector)

    def press(self, selector: str) -> None:
        """Press a button, a link or a box."""
        self.clicks += 1
        if self.has_mouse:
            self.page.locator(selector).first.click()
            return
        self.reach(selector)
        is_box = self.page.locator(selector).first.get_attribute("type") == "checkbox"
        self.page.keyboard.press("Space" if is_box else "Enter")

    def type(self, selector: str, text: str) -> None:
        """Type into a field, and leave it."""
        self.reach(selector)
        self.page.keyboard.press("ControlOrMeta+A")
        self.page.keyboard.press("Delete")  # by the editor: the browser would insert styles, which the page forbids
        self.page.keyboard.type(text)
        self.page.keyboard.press("Tab")

    def choose(self, selector: str, words: str) -> None:
        """Choose an entry of a menu, by its text or by typing it."""
        self.clicks += 1
        self.page.wait_for_selector(f"{selector} >> option:text-is('{words}')", state="attached")
        if self.has_mouse:
            self.page.select_option(selector, words)
        else:
            self.reach(selector)
            self.page.keyboard.type(words)
        assert self.page.eval_on_selector(selector, "at => at.selectedOptions[0].textContent") == words
