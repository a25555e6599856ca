"""Each view at four widths and in both looks: nothing is cut, keys and readers reach all, and phones scroll little."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import pytest

from page.conftest import ROOT, Server
from page.results import RECORDING, make_results
from page.test_journeys import AXE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from page.conftest import Tab

WIDTHS = (1440, 1280, 400, 320)
#: Widths at which axe looks: the others have the layout of one of them.
OF_AXE = (1440, 400)
MOST_HIGH = 3000  # of a document at 400 px, px
#: Each view as it is entered, and with an object: address, what is there once it is drawn, and its greatest height at
#: 400 px. Nothing is folded out.
VIEWS = {
    "studies/": ("main .holds", MOST_HIGH),
    "drive/": ("main h2", MOST_HIGH),
    "drive/axis.toml": ("g[data-key=cylinder]", MOST_HIGH),
    "simulate/": ("main h2", MOST_HIGH),
    "simulate/axis.toml": ("[data-end=position_m]", MOST_HIGH),
    "simulate/tripod.toml": (".turned svg", MOST_HIGH),
    "recording/": ("main h2", MOST_HIGH),
    f"recording/{RECORDING}": ("[data-from]", MOST_HIGH),
    "friction/": ("main h2", MOST_HIGH),
    "friction/results/new/map.parquet": ("[data-value=coulomb]", MOST_HIGH),
    "friction/fit.toml": ("[data-value='valve.conductance']", MOST_HIGH),
    "result/fit.toml": ("[data-value='valve.conductance']", MOST_HIGH),
    "validation/": ("text=Does my model hold?", MOST_HIGH),
    "validation/results/check/validation.toml": ("[data-leading=position]", MOST_HIGH),
    "sizing/": (".cm-content", MOST_HIGH),
    "sizing/push.toml": (".cm-content", MOST_HIGH),
    "sizing/results/push": ("[data-candidate]", MOST_HIGH),
    "campaign/": ("button:text-is('Plan and check')", MOST_HIGH),
    "campaign/campaigns/first": ("[data-state=none]", MOST_HIGH),
    "control/": ("[data-score=max_error_m]", MOST_HIGH),
    "control/results/laws": ("figure[data-plot=Errors] canvas", MOST_HIGH),
    "datasheet/axis.toml": ("[data-hero=circuit] svg.circuit", MOST_HIGH),
    "handover/": ("main h2", MOST_HIGH),
    "handover/drive.fmu": ("[data-copy=fmpy]", MOST_HIGH),
}

#: Ends when the page has kept its height and its elements for a while.
STEADY = """() => new Promise((done) => {
  let [last, same] = ["", 0];
  const look = () => {
    const now = `${document.documentElement.scrollHeight} ${document.querySelectorAll("body *").length}`;
    [last, same] = [now, now === last ? same + 1 : 0];
    if (same > 6) done();
    else setTimeout(look, 30);
  };
  look();
})"""

#: What is wider than the window, or a word that is broken in a table or a button.
CUT = """() => {
  const out = document.documentElement.scrollWidth > innerWidth ? ["the page"] : [];
  for (const one of document.querySelectorAll("main th, main button, main label, .verbs a")) {
    const words = one.textContent.trim();
    if (one.childElementCount || !/^[\\w.-]{1,24}$/.test(words) || !one.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(one);
    if (new Set([...range.getClientRects()].map((rect) => Math.round(rect.top))).size > 1) out.push(words);
  }
  return out;
}"""


#: What a pointer can press and a keyboard cannot. Points of a sizing are rows of its table too.
MOUSE_ONLY = """() => {
  const keyed = "a[href], button, input, select, textarea, summary, label, [tabindex], [contenteditable], .candidates";
  const pressed = [...document.querySelectorAll("body *")].filter((one) => getComputedStyle(one).cursor === "pointer");
  return pressed.filter((one) => !one.closest(keyed)).map((one) => one.outerHTML.slice(0, 80));
}"""

#: Text below 12 px, or 11 px in a drawing, where its scale counts. The circuit is zoomed, and left out.
SMALL = """() => {
  const out = new Set();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const [words, at] = [texts.currentNode.data.trim(), texts.currentNode.parentElement];
    if (!words || !at.checkVisibility() || at.closest(".circuit, script, style")) continue;
    const scale = at.ownerSVGElement ? Math.hypot(at.getScreenCTM().a, at.getScreenCTM().b) : 1;
    const size = scale * parseFloat(getComputedStyle(at).fontSize);
    if (size < (at.ownerSVGElement ? 10.9 : 11.9)) out.add(`${size.toFixed(1)} px: ${words.slice(0, 40)}`);
  }
  return [...out].slice(0, 9);
}"""

#: Violations of some rules or of all, and contrasts that axe cannot tell. Left out are three reasons that are not the
#: look of the page: a symbol is no text, text of a drawing lies on its own `svg`, and a row at the edge of a region
#: that scrolls is half covered.
FAULTS = """async (only) => {
  const asked = {elementRef: true, resultTypes: ["violations", "incomplete"], ...(only && {runOnly: only})};
  const found = await axe.run(document, asked);
  const open = found.incomplete.filter((rule) => rule.id === "color-contrast").flatMap((rule) => rule.nodes);
  const untold = open.filter((node) => {
    const [why, at] = [node.any[0]?.data?.messageKey, node.element];
    if (["shortTextContent", "nonBmp"].includes(why) || at?.ownerSVGElement) return false;
    return !(why === "elmPartiallyObscured" && at?.closest(".scroll, .cm-editor"));
  });
  const wrong = found.violations.flatMap((rule) => rule.nodes.map((node) => `${rule.id}: ${node.html}`));
  return [...wrong, ...untold.map((node) => `contrast not told, ${node.any[0]?.data?.messageKey}: ${node.html}`)];
}"""


def faults(page: Any, only: list[str] | None = None) -> list[str]:
    """Return the faults of a view in a window of its whole height, where nothing scrolls below what stays in place."""
    size = page.viewport_size
    for _ in range(3):  # a column of the height of the window grows with it
        high = page.evaluate("document.documentElement.scrollHeight")
        if high == page.viewport_size["height"]:
            break
        page.set_viewport_size({"width": size["width"], "height": high})
        page.evaluate(STEADY)
    found = page.evaluate(FAULTS, only)
    page.set_viewport_size(size)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Give a server over a folder with a result of every kind. Tests do not change it."""
    folder = tmp_path_factory.mktemp("views") / "studies"
    folder.mkdir()
    make_results(folder)
    shutil.copy(ROOT / "examples" / "tripod.toml", folder)
    made = Server.start(folder)
    yield made
    made.end()


def unfold_overview(page: Any) -> None:
    page.click("button[aria-label='Made from: results/check/validation.toml']")
    page.wait_for_selector("[data-input='friday.parquet']")
    for name in ("axis.toml", "after.toml"):
        page.check(f"input[aria-label='Compare {name}']")
    page.wait_for_selector("[data-differs]")


def unfold_run(page: Any) -> None:
    page.click("text=Copy as command or Python")
    page.wait_for_selector("[data-copy=python]")


def unfold_fit(page: Any) -> None:
    page.click("button:has-text('Residuals, profiles')")
    page.wait_for_selector("text=viscous over coulomb")
    page.click("text=Propose on the simulated rig")
    page.wait_for_selector("[aria-label^='expected half-width']")
    page.select_option("label:has-text('At one pressure') select", index=1)
    page.select_option("label:has-text('Compare with') select", index=1)
    page.wait_for_selector("[data-figure=compared]")


#: What a view shows after some clicks.
UNFOLDED: dict[str, Callable[[Any], None]] = {
    "studies/": unfold_overview,
    "simulate/axis.toml": unfold_run,
    "friction/results/new/map.parquet": unfold_fit,
}


@pytest.mark.parametrize("address", VIEWS)
def test_a_view_at_all_widths_in_both_looks(whole: Server, open_tab: Callable[..., Tab], address: str) -> None:
    drawn, most_high = VIEWS[address]
    view, _, path = address.partition("/")
    tab = open_tab(f"{whole.address}")
    page = tab.page
    page.wait_for_selector("header")  # the token is read
    page.evaluate(f"() => (location.hash = '#/{view}/{quote(path, safe='')}')")
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        if width in OF_AXE:  # a phone begins with the tree folded
            page.reload()
            page.wait_for_selector(drawn, state="attached", timeout=30_000)
            page.evaluate(AXE.read_text())
        page.evaluate(STEADY)
        assert page.evaluate(CUT) == [], width
        assert page.evaluate(SMALL) == [], width
        if width in OF_AXE:
            if width != WIDTHS[0]:  # there the last look below sees the same, folded out
                assert faults(page) == [], width
            page.emulate_media(color_scheme="dark")
            assert faults(page, ["color-contrast"]) == [], (width, "dark")
            tab.picture(f"view-{view}-{'object' if path else 'entry'}-{width}-dark")
            page.emulate_media(color_scheme="light")
        if width == OF_AXE[-1]:
            high = page.evaluate("document.documentElement.scrollHeight")
            assert high <= most_high, f"{high} px at {width} px"
    assert page.evaluate(MOUSE_ONLY) == []
    page.set_viewport_size({"width": WIDTHS[0], "height": 900})
    if address in UNFOLDED:
        UNFOLDED[address](page)
    for summary in page.locator("main summary:not(.more > summary)").all():  # a menu covers what stands below it
        summary.click()
    page.evaluate(STEADY)
    assert faults(page) == []
    tab.check()
