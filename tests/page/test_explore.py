"""The widget of `pn.explore` in a browser, with Python behind it as a notebook has it."""

from __future__ import annotations

import base64
import json
from importlib import import_module
from pathlib import Path

import anywidget
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import PICTURES, ROOT

BUILT = ROOT / "python" / "pneudrive" / "web" / "built"
#: The two sides of a notebook's widget: messages to Python, frames back.
NOTEBOOK = (Path(__file__).parents[1] / "data" / "explore_notebook.txt").read_text("utf-8")
COMMAND, DURATION = "0 s: 0.6, 0.5 s: -0.6", "1 s"


@pytest.fixture
def drive() -> pn.Drive:
    return pn.Drive.load("catalogue:reference")


def serve(route: object, shown: object) -> None:
    """Answer a notebook's requests."""
    name = route.request.url.rpartition("/")[2]
    if name in ("widget.js", "widget.css"):
        route.fulfill(path=BUILT / name)
    else:
        route.fulfill(body=NOTEBOOK.replace("BEGIN", json.dumps(shown.begin())), content_type="text/html")


def test_sliders_in_a_notebook_give_the_run_of_python(browser: object, drive: pn.Drive) -> None:
    shown = pn.explore(drive, COMMAND, DURATION, sliders=["friction.coulomb", "supply.pressure"])
    page = browser.new_page(viewport={"width": 1200, "height": 900}, locale="en-GB")
    asked, foreign, complaints = [], [], []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)

    def answer(content: dict) -> str:
        asked.append(content)
        return base64.b64encode(shown.answer(content)).decode()

    page.on("request", lambda one: None if one.url.startswith("http://notebook/") else foreign.append(one.url))
    page.route("**/*", lambda route: serve(route, shown))
    page.expose_function("answer", answer)
    page.goto("http://notebook/")
    page.wait_for_selector("figure.plot canvas")
    expect(page.locator("figure.plot")).to_have_count(4)

    slider = page.locator("input[aria-label='friction.coulomb']")
    box = slider.bounding_box()
    page.mouse.move(box["x"] + 20, box["y"] + 0.5 * box["height"])
    page.mouse.down()
    for step in range(20):
        page.mouse.move(box["x"] + 20 + 4 * step, box["y"] + 0.5 * box["height"])
    page.mouse.up()
    page.wait_for_function(
        "() => { const d = document.querySelector('.pneudrive').dataset; return d.sent === d.drawn }"
    )
    page.wait_for_timeout(300)
    assert page.locator(".pneudrive").get_attribute("data-most") == "1"
    said = asked[-1]["changes"]["friction.coulomb"]
    assert shown.drive.friction.coulomb == pn.units.parse(said, "N") != drive.friction.coulomb
    run = pn.simulate(drive.replace({"friction.coulomb": said}), COMMAND, DURATION)
    for name in ("position", "pressure_a"):
        at_end = page.get_attribute(f"[data-end={run[name].column}]", "data-si")
        assert float(at_end) == float(run[name][-1]) == float(shown.simulate()[name][-1])

    page.evaluate("() => document.querySelector('input[type=range]').focus()")
    page.keyboard.press("Home")
    page.wait_for_timeout(300)
    assert len(asked) > 2
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / "explore.png")
    assert (foreign, complaints) == ([], [])
    page.close()


def test_two_views_move_together_on_the_paper_of_the_notebook(browser: object, drive: pn.Drive) -> None:
    """The paper of a notebook is not that of the browser: dark curves on a dark page would not be seen."""
    shown = pn.explore(drive, 0.6, "50 ms", sliders="friction.coulomb")
    page = browser.new_page(color_scheme="light")
    page.route("**/*", lambda route: serve(route, shown))
    page.expose_function("answer", lambda content: base64.b64encode(shown.answer(content)).decode())
    page.goto("http://notebook/")
    page.wait_for_selector("figure.plot canvas")
    page.evaluate("void again()")
    page.wait_for_selector(".pneudrive >> nth=1 >> canvas >> nth=0")
    marks = ".legend path"
    assert page.get_attribute(marks, "stroke") == "#2a50e8"
    page.evaluate("document.body.style.color = 'oklch(0.95 0 0)'")
    page.wait_for_function(f"() => document.querySelector('{marks}').getAttribute('stroke') === '#6187ff'")
    page.locator("input[type=range]").first.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_function("() => new Set([...document.querySelectorAll('output')].map((one) => one.value)).size === 1")
    seen = page.locator("output").all_inner_texts()
    assert seen == [str(shown.drive.friction.coulomb)] * 2 != [str(drive.friction.coulomb)] * 2
    ends = page.eval_on_selector_all("[data-end=position_m]", "all => all.map((one) => Number(one.dataset.si))")
    assert ends == [float(shown.simulate().position[-1])] * 2
    page.keyboard.press("End")  # above the breakaway force
    page.wait_for_selector(".wrong")
    colour = page.eval_on_selector(".wrong", "one => getComputedStyle(one).color")
    assert colour == "rgb(255, 156, 152)", "red on dark paper"
    page.close()


def test_a_value_that_the_drive_does_not_take_is_answered_in_words(drive: pn.Drive) -> None:
    from web.frames import unpack

    shown = pn.explore(drive, COMMAND, DURATION)
    head, arrays = unpack(shown.answer({"number": 3, "changes": {"friction.coulomb": "-1 N"}}))
    assert head["number"] == 3
    assert "coulomb" in json.dumps(head["problems"])
    assert arrays == {}
    assert shown.changes == {}, "what is not valid changes nothing"


def test_a_notebook_gets_a_widget_with_the_text_beside_it(drive: pn.Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = pn.explore(drive, COMMAND, DURATION)
    bundle, _ = shown._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert isinstance(shown._widget, anywidget.AnyWidget)
    sent = []
    monkeypatch.setattr(shown._widget, "send", lambda content, buffers: sent.append(buffers))
    shown._widget._handle_custom_msg({"number": 1, "changes": {}}, [])
    assert len(sent) == 1
    assert len(sent[0][0]) > 10_000
    monkeypatch.setattr(import_module("pneudrive.explore"), "is_live", lambda: False)
    assert set(shown._repr_mimebundle_()) == {"text/plain", "text/html"}
