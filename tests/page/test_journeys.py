"""What people do with the page, in a browser, each with a picture at its end in out/page/."""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import DRIVE, ROOT, Server, Tab
from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.campaign.storage.control import holder
from pneudrive.campaign.storage.folder import status_of
from pneudrive.characterise import load_recordings, write_map
from pneudrive.identify.static.result import FrictionFit
from pneudrive.rig import load_rig

AXE = ROOT / "page" / "browser" / "node_modules" / "axe-core" / "axe.min.js"
Open = Callable[..., Tab]


def drag(tab: Tab, key: str, to: float) -> None:
    """Drag a slider to a share of its way, in many small moves."""
    box = tab.page.locator(f"input[type=range]#slider-{key.replace('.', chr(92) + '.')}").bounding_box()
    y, left, width = box["y"] + 0.5 * box["height"], box["x"] + 8, box["width"] - 16
    tab.page.mouse.move(left + 0.3 * width, y)
    tab.page.mouse.down()
    for step in range(31):
        tab.page.mouse.move(left + (0.3 + (to - 0.3) * step / 30) * width, y)
    tab.page.mouse.up()


def settled(tab: Tab) -> dict[str, str]:
    """Wait until the newest answer is drawn; return what the page counts."""
    for _ in range(300):
        counts = dict(tab.page.evaluate("() => ({...document.documentElement.dataset})"))
        if counts.get("sent") and counts["sent"] == counts.get("drawn"):
            tab.page.wait_for_timeout(60)
            again = dict(tab.page.evaluate("() => ({...document.documentElement.dataset})"))
            if again == counts:
                return counts
        tab.page.wait_for_timeout(30)
    raise AssertionError(counts)


def at_end(tab: Tab, column: str) -> float:
    return float(tab.page.get_attribute(f"[data-end={column}]", "data-si"))


def violations(tab: Tab) -> list[str]:
    tab.page.evaluate(AXE.read_text())
    found = tab.page.evaluate("() => axe.run(document, {resultTypes: ['violations']})")
    return [f"{one['id']}: {node['html']}" for one in found["violations"] for node in one["nodes"]]


def test_first_minute(server: Server, open_tab: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    tab = open_tab(server.address)
    page = tab.page
    page.click("text=axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    assert "token" not in page.url
    before = settled(tab)
    start = at_end(tab, "position_m")
    drive = pn.Drive.load(server.folder / "axis.toml")
    assert start == pn.simulate(drive, "0 s: 1, 1 s: -1", "2 s").position[-1]

    page.fill("label:has-text('Duration') input", "0.2 s")
    page.click("text=Freeze the curves")
    drag(tab, "friction.coulomb", 0.45)
    counts = settled(tab)
    assert int(counts["sent"]) > int(before["sent"]) + 3  # it follows while it is dragged
    assert counts["mostOnTheWay"] == "1"
    page.click("text=Copy as command or Python")
    code = page.inner_text("[data-copy=python]")
    monkeypatch.chdir(server.folder)
    names: dict = {}
    exec(code, names)
    assert "friction.coulomb" in code
    assert at_end(tab, "position_m") == names["run"].position[-1]
    assert at_end(tab, "pressure_a_pa") == names["run"].pressure_a[-1]
    expect(page.locator("figure.plot")).to_have_count(4)
    tab.picture("first-minute")
    tab.check()


def test_drive_by_text_and_by_form(server: Server, tab: Tab) -> None:
    page = tab.page
    page.click("text=axis.toml")
    page.click(".verbs >> text=Drive")
    page.wait_for_selector(".cm-content")
    page.wait_for_selector(".fields")
    page.fill("input[aria-label='friction.coulomb']", "31 N")
    page.keyboard.press("Tab")
    page.wait_for_selector(".cm-content >> text=31 N")
    expect(page.locator(".cm-content").first).to_contain_text("# measured")

    page.click(".cm-line >> nth=4")
    page.keyboard.press("End")
    page.keyboard.type("\nbreakaway = 3")
    page.wait_for_selector(".problem >> text=has no unit")
    expect(page.locator(".problem button").first).to_have_text("line 6", use_inner_text=True)
    expect(page.locator(".cm-lint-marker-error")).to_have_count(1)
    tab.picture("drive-problem")
    for _ in range(len("\nbreakaway = 3")):
        page.keyboard.press("Backspace")
    page.wait_for_selector("text=No problems.")

    page.select_option("[aria-label='Unit of friction.coulomb']", "kN")
    page.wait_for_selector(".cm-content >> text=0.031 kN")
    page.select_option("[aria-label='Unit of friction.coulomb']", "N")
    page.wait_for_selector(".cm-content >> text=31 N")
    page.wait_for_selector("g[data-key=cylinder]")
    for symbol in page.locator("g[data-key]").all():
        symbol.click()
        page.wait_for_selector(f"text=Values of {symbol.get_attribute('data-key')}.")
        assert page.locator(".fields tbody tr").count() > 1
    page.click("text=Show all")
    page.focus("g[data-key=cylinder]")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Values of cylinder.")
    expect(page.locator("input[aria-label='valve.kind']")).to_have_count(0)
    page.click("button:text-is('Save')")
    page.wait_for_selector("text=Saved axis.toml.")
    assert (server.folder / "axis.toml").read_text() == DRIVE.replace("28 N", "31 N")

    (server.folder / "axis.toml").write_text("name = 'theirs'\n")
    page.fill("input[aria-label='friction.coulomb']", "32 N")
    page.keyboard.press("Tab")
    page.click("button:text-is('Save')")
    page.wait_for_selector("text=changed on disk")
    assert (server.folder / "axis.toml").read_text() == "name = 'theirs'\n"
    tab.picture("drive")
    assert len(tab.complaints) == 1  # the browser's own line on the refused request
    assert "412" in tab.complaints.pop()
    tab.check()


#: A file that is dropped onto the page.
DROPPED = """([name, packed]) => {
  const bytes = Uint8Array.from(atob(packed), (one) => one.charCodeAt(0));
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([bytes], name));
  const event = new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true });
  document.querySelector("main").dispatchEvent(event);
}"""


def test_own_recording(server: Server, open_tab: Open) -> None:
    name = "O-ring_1bar.csv.xz"
    measured = ROOT / "data" / "measurements" / "zillen-2021-pneumatic-piston"
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector("text=axis.toml")
    packed = (measured / "friction" / name).read_bytes()
    shutil.copy(measured / "friction" / "O-ring_5bar.csv.xz", server.folder)
    page.evaluate(DROPPED, [name, base64.b64encode(packed).decode()])
    page.wait_for_selector("[data-from]")  # it was copied, and is opened
    assert (server.folder / name).read_bytes() == packed
    page.click("text=Propose a layout")
    page.wait_for_selector("td:has-text('mm')")
    assert "guess" in page.input_value("textarea.text")
    assert violations(tab) == []
    page.fill("textarea.text", (measured / "layout.toml").read_text())
    page.click("text=Accept: write layout.toml")
    page.wait_for_selector("text=darker: towards +x")
    assert (server.folder / "layout.toml").read_text() == (measured / "layout.toml").read_text()
    page.wait_for_selector("figure.plot[data-plot^=force]")
    tab.picture("recording")

    whole = page.get_attribute("[data-from]", "data-to")
    page.wait_for_selector(".answer-card")  # it stands above the plots, and moves them when it comes
    plot = page.locator("figure.plot .u-over >> nth=0")
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    page.mouse.up()
    page.wait_for_selector(f"[data-to]:not([data-to='{whole}'])")
    span = [float(page.get_attribute("[data-from]", f"data-{end}")) for end in ("from", "to")]
    assert span[1] - span[0] == pytest.approx(0.2 * float(whole), rel=0.1)
    page.click("button:text-is('Later')")
    page.wait_for_timeout(200)
    assert int(page.evaluate("() => document.documentElement.dataset.points")) <= 4 * 1400
    measured_beside_another(server, tab, name)
    assert violations(tab) == []
    tab.picture("recording-measured")
    tab.check()


def measured_beside_another(server: Server, tab: Tab, name: str) -> None:
    """Draw a second recording over one, aligned on its third stroke, and measure both between two cursors."""
    page = tab.page
    page.select_option("section[aria-label='Another recording'] select", "O-ring_5bar.csv.xz")
    page.wait_for_selector("[data-shift]")
    page.fill("label:has-text('begin of stroke') input", "3")
    page.keyboard.press("Tab")
    page.fill("label:has-text('with that of stroke') input", "5")
    page.keyboard.press("Tab")
    page.check("text=measure between two cursors")
    page.fill("input[aria-label='Cursor 1, s']", "8")
    page.wait_for_selector("[data-plots][aria-busy=false]")  # a click is where the plot is, not where it will be
    box = page.locator("figure.plot .u-over >> nth=0").bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 40)  # the second one is nearer
    row = "[data-measured^='{}/force']"
    page.wait_for_selector(f"[data-is-current=true] {row.format('O-ring_5bar.csv.xz')}")
    shift = float(page.get_attribute("[data-shift]", "data-shift"))
    low, high = (float(page.get_attribute("[data-from]", f"data-{end}")) for end in ("from", "to"))
    for file, late in ((name, 0.0), ("O-ring_5bar.csv.xz", shift)):
        read = load_recordings([server.folder / file], server.folder / "layout.toml")[0]
        first, second = (int(np.argmin(np.abs(read.time_s + late - at))) for at in (8.0, low + 0.8 * (high - low)))
        wide = 1 + int(np.ceil((high - low) / box["width"] / np.median(np.diff(read.time_s))))  # samples of one pixel
        near = [read.force_n[at - wide : at + wide + 1] for at in (first, second)]
        shown = page.locator(row.format(file))
        difference = float(shown.get_attribute("data-difference"))
        lowest, highest = near[1].min() - near[0].max(), near[1].max() - near[0].min()
        assert lowest - 1e-9 <= difference <= highest + 1e-9
        seconds = difference / float(shown.get_attribute("data-slope"))
        assert seconds == pytest.approx(read.time_s[second] - read.time_s[first], abs=0.05)


def test_friction_of_a_recording(server: Server, open_tab: Open) -> None:
    measured = ROOT / "data" / "measurements" / "zillen-2021-pneumatic-piston"
    shutil.copy(measured / "layout.toml", server.folder)
    names = [f"O-ring_{pressure}bar.csv.xz" for pressure in (1, 5)]
    for name in names:
        shutil.copy(measured / "friction" / name, server.folder)
    folder = server.folder / "results" / "o-rings"
    folder.mkdir(parents=True)
    curves = pn.characterise([server.folder / name for name in names])
    write_map(curves, folder / "map.parquet")
    fit = pn.fit_friction(curves)
    fit.to_toml(folder / "fit.toml")
    (server.folder / "axis.toml").write_text(pn.Drive.load("catalogue:reference").to_toml())
    (server.folder / "results" / "worn").mkdir()
    write_map(curves.assign(friction_n=1.2 * curves["friction_n"]), server.folder / "results" / "worn" / "map.parquet")
    tab = open_tab(server.address)
    page = tab.page
    page.click("text=results/o-rings/map.parquet")
    page.wait_for_selector("figure[data-figure='Friction over pressure'][data-points='4']")  # pressure was varied most
    page.wait_for_selector("[data-value=coulomb]")
    assert float(page.get_attribute("[data-value=coulomb]", "data-si")) == fit.values["coulomb"]
    shown = sorted(float(cell.get_attribute("data-si")) for cell in page.locator(".scroll tr[data-si]").all())
    assert shown == sorted(curves["friction_n"].to_numpy())
    page.select_option("label:has-text('At one speed') select", index=1)
    page.wait_for_selector("figure[data-figure='Friction over pressure']:not([data-points='4'])")
    page.click("[aria-label='Friction over'] >> text=speed")
    page.wait_for_selector("figure[data-figure='Friction over speed'][data-points='4']")
    page.check("text=logarithmic scale")
    page.select_option("label:has-text('At one pressure') select", index=1)
    page.wait_for_selector("figure[data-figure='Friction over speed'][data-points='2']")
    page.select_option("label:has-text('Compare with') select", "results/worn/map.parquet")
    page.wait_for_selector("figure[data-figure=compared] .panel-drawing")
    assert "over=speed" in page.url
    assert violations(tab) == []
    page.select_option("label:has-text('Compare with') select", "")
    expect(page.locator("main").first).to_contain_text("breakaway")
    assert violations(tab) == []
    tab.picture("friction")
    page.click("summary:text-is('Fit another law')")
    page.select_option("label:has-text('Law') select", "coulomb")
    page.select_option("[data-form=fit] label:has-text('Pressure') select", "linear")
    page.click("button:text-is('Fit again')")
    fitted = "label:has-text('Curves of') option:text-is('results/o-rings/fit-2.toml')"
    page.wait_for_selector(fitted, state="attached", timeout=60_000)  # a job on a busy machine
    again = FrictionFit.from_toml(folder / "fit-2.toml").values["coulomb"]
    assert again != fit.values["coulomb"]
    page.wait_for_selector(f"[data-value=coulomb][data-si='{again}']")
    page.click("summary:text-is('Apply it to a drive')")
    page.select_option("[data-form=apply] label:has-text('Drive') select", "axis.toml")
    page.click("button:text-is('Apply to a new drive file'):enabled")
    page.wait_for_selector(".tree >> text=fit-2-identified.toml", timeout=60_000)
    applied = pn.Drive.load(folder / "fit-2-identified.toml").friction.parameters["coulomb"]
    assert applied == pytest.approx(again, rel=1e-3)
    page.click("button:has-text('Residuals, profiles and next points of results/o-rings/fit-2.toml')")
    page.wait_for_selector("figure[data-figure='Friction and residuals over speed'] .panel-drawing")
    page.wait_for_selector("text=coulomb_b over coulomb")
    page.click("text=Propose on the simulated rig")
    page.wait_for_selector("[aria-label^='expected half-width']")
    assert violations(tab) == []
    tab.picture("friction-again")
    page.click("summary:text-is('Measured points')")
    page.click("[aria-label='Points of the map'] a >> nth=0")
    page.wait_for_selector("text=darker: towards +x")
    page.click("section[aria-label=Friction] >> text=Copy as command or Python")
    expect(page.locator("[data-copy=command]").first).to_contain_text("pneudrive characterise O-ring_")
    page.click("section[aria-label=Friction] button:text-is('All 2')")
    page.wait_for_function("document.querySelectorAll('section[aria-label=Friction] input:checked').length === 2")
    assert violations(tab) == []
    tab.check()


def test_campaign_paused_killed_and_resumed(own_server: Server, open_tab: Open) -> None:
    tab = open_tab(own_server.address)
    page = tab.page
    page.click(".tree >> text=Campaigns")
    page.select_option("label:has-text('Protocol') select", "stops-pressure")
    page.click("text=Plan and check")
    page.wait_for_selector("[data-plan]")
    expect(page.locator("[data-plan] pre >> nth=0")).to_contain_text(
        "pre-flight: passed (speed 100 of 500 mm/s", use_inner_text=True
    )
    rig, asked = load_rig("default"), read_protocol("stops-pressure")
    assert float(page.get_attribute("[data-plan]", "data-si")) == lay_out(asked, rig.identity(), rig.limits()).time_s
    expect(page.locator("[data-copy=command]").first).to_have_text(
        "pneudrive campaign plan stops-pressure --rig default", use_inner_text=True
    )
    tab.picture("campaign-plan")
    page.select_option("label:has-text('Protocol') select", "quick-look")
    page.fill("input[placeholder=fastest]", "40")
    assert violations(tab) == []
    page.click("button:text-is('Run')")
    page.wait_for_selector("[data-state=running]")
    page.wait_for_selector("[data-cycle] figure path[stroke-linejoin]")  # the cycle in progress
    assert violations(tab) == []
    tab.picture("campaign-cycle")
    page.wait_for_selector("figure[data-figure='Friction so far']")  # the map grows
    page.click("text=Pause after the cycle")
    page.wait_for_selector("[data-state=paused]")
    expect(page.locator("[aria-label=Requests]").first).to_contain_text("Not an emergency stop.")
    expect(page.locator(".journal").first).to_contain_text("from the page")
    assert violations(tab) == []
    tab.picture("campaign-paused")
    folder = own_server.folder / "campaigns" / "first"
    running = holder(folder)
    assert running is not None
    own_server.end()
    os.kill(running.pid, signal.SIGKILL)
    page.close()

    again = Server.start(own_server.folder)
    try:
        tab = open_tab(again.address)
        page = tab.page
        page.click("text=campaigns/first")
        done = int(page.get_attribute("[data-done]", "data-done"))
        assert 0 < done < 17
        page.click("text=Resume on the simulated rig")
        page.wait_for_selector("[data-state=none][data-done='17']", timeout=30_000)
        assert status_of(folder).to_do == 0
        expect(page.locator("text=Pause after the cycle")).to_have_count(0)  # this server only watches
        tab.picture("campaign")
        tab.check()
    finally:
        again.end()


def reach(page: object, selector: str) -> None:
    """Move the focus to an element with Tab, from where it is."""
    target = page.locator(selector).first
    target.wait_for(timeout=60_000)
    for _ in range(400):
        if target.evaluate("element => element === element.getRootNode().activeElement"):
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"Tab does not reach {selector}")


def test_the_server_is_killed_while_a_slider_is_dragged(own_server: Server, open_tab: Open) -> None:
    tab = open_tab(own_server.address)
    page = tab.page
    page.click("text=axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    drag(tab, "friction.coulomb", 0.4)
    os.kill(own_server.process.pid, signal.SIGKILL)
    drag(tab, "friction.coulomb", 0.44)
    page.wait_for_selector("[data-connection=lost]")
    expect(page.locator("[data-connection]").first).to_contain_text("does not answer")
    kept = page.input_value("input[aria-label='friction.coulomb, N']")
    tab.picture("server-gone")

    again = Server.start(own_server.folder, own_server.port)
    try:
        open_tab(again.address).page.wait_for_selector("text=axis.toml")
        page.wait_for_selector("[data-connection=open]", state="attached")
        settled(tab)
        expect(page.locator("input[aria-label='friction.coulomb, N']")).to_have_value(kept)
        drive = pn.Drive.load(own_server.folder / "axis.toml").replace({"friction.coulomb": f"{kept} N"})
        expected = pn.simulate(drive, "0 s: 1, 1 s: -1", "2 s")
        assert at_end(tab, "pressure_a_pa") == expected.pressure_a[-1]
    finally:
        again.end()


def test_text_of_files_stays_text(server: Server, open_tab: Open) -> None:
    hostile = "<img src=x onerror=document.title=1><script>document.title=2</script>"
    (server.folder / "evil.toml").write_text(DRIVE.replace("my axis", hostile))
    (server.folder / "<img src=x onerror=document.title=3>.toml").write_text(DRIVE)
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector("text=<img src=x onerror=document.title=3>.toml")
    page.click("text=evil.toml")
    page.click("summary:has-text('Circuit, as it moves')")
    page.wait_for_selector("svg.circuit")
    expect(page.locator("h2 >> nth=0")).to_have_text(hostile, use_inner_text=True)
    expect(page.locator("img")).to_have_count(0)
    assert page.title() == "evil.toml · Simulate · pneudrive"
    tab.check()


def test_a_browser_whose_system_has_no_language(server: Server, browser: object) -> None:
    """Chromium says so under LANG=C, and what formats numbers refuses that."""
    page = browser.new_page()
    page.add_init_script("Object.defineProperty(Navigator.prototype, 'language', {get: () => 'en-US@posix'})")
    page.goto(server.address)
    page.wait_for_selector("text=axis.toml", timeout=15_000)
    page.close()


def test_the_first_page_is_small() -> None:
    import gzip
    import re

    built = ROOT / "python" / "pneudrive" / "web" / "built"
    index = (built / "index.html").read_text()
    files = [built / "index.html", *(built / name for name in re.findall(r'(?:src|href)="/(assets/[^"]+)"', index))]
    assert len(files) >= 3
    sizes = [len(gzip.compress(path.read_bytes())) for path in files]
    assert sum(sizes) < 100_000
    assert np.all(sizes)
    assert Path(AXE).is_file()


IDENTIFIED = """
[provenance.'friction.coulomb']
interval = ["27.1 N", "28.9 N"]
source = "monday"
"""


def test_hand_over(server: Server, open_tab: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    (server.folder / "axis.toml").write_text(DRIVE + IDENTIFIED)
    tab = open_tab(server.address)
    page = tab.page
    page.click(".tree >> text=Exports")
    page.select_option("label:has-text('Drive or circuit') select", "axis.toml")
    page.fill("label:has-text('Start state') input", "position = 50 mm")
    page.fill("label:has-text('Into results/') input", "another")
    page.click("text=Copy as command or Python")
    page.wait_for_selector("[data-copy=python]")
    page.fill("label:has-text('Into results/') input", "axis")
    page.wait_for_selector("[data-copy=python]", state="detached")  # they were those of another export
    page.click("text=Copy as command or Python")
    page.wait_for_selector("[data-copy=python]")
    assert violations(tab) == []
    page.click("button:text-is('Export')")
    page.click("text=Show the variables of results/axis.fmu", timeout=30_000)
    page.wait_for_selector("tr:has(th:text-is('command'))")

    fmu = server.folder / "results" / "axis.fmu"
    assert page.get_attribute("[data-sha256]", "data-sha256") == hashlib.sha256(fmu.read_bytes()).hexdigest()
    expect(page.locator("tr:has(th:text-is('friction.coulomb')) td >> nth=1")).to_contain_text("28")
    expect(page.locator("tr:has(th:text-is('pressure_a')) td >> nth=0")).to_have_text("Pa", use_inner_text=True)
    lines = page.inner_text("[data-copy=fmpy]")
    assert len([line for line in lines.splitlines() if line]) == 3
    monkeypatch.chdir(server.folder)
    names: dict = {}
    exec(lines, names)
    drive = pn.Drive.load("axis.toml")
    own = pn.simulate(drive, 1.0, "0.5 s", initial="position = 50 mm", rtol=1e-9)
    assert abs(names["run"]["position"][-1] - own.position[-1].item()) < 0.02e-6
    assert violations(tab) == []
    tab.picture("hand-over")
    page.click(".home")
    page.click("a[title='results/axis.fmu']")
    page.wait_for_selector("tr:has(th:text-is('command'))")
    tab.check()
