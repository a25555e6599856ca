"""Does my model hold, and which drive to take: journeys in a browser, each with a picture in out/page/."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import DRIVE, PICTURES, Server, Tab
from page.test_journeys import Open, settled, violations
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.simulation.trajectory import save_columns
from web.test_sizing import TASK

STEPS = "0 s: 0.3, 0.7 s: -0.3, 1.4 s: 0.2, 2.2 s: -0.25"
LONG = 90_000  # ms; a job on a busy machine
#: Of the catalogue no more than a test has time for: with the smaller cylinder the impact is too hard.
LIFT = (Path(__file__).parents[1] / "data" / "model_journeys_lift.toml").read_text("utf-8")


def friday(server: Server) -> pn.Drive:
    """Write an identified drive, and a record of Friday, when the valve passed less; return the true drive."""
    before = pn.Drive.load("catalogue:parker-osp-p25-mpye")
    monday = pn.simulate(before, STEPS, "2.6 s", initial="position = 250 mm")
    pn.save(monday, server.folder / "monday.parquet")
    fit = pn.identify(before, server.folder / "monday.parquet", ["friction.coulomb"])
    fit.to_toml(server.folder / "monday-fit.toml")
    (server.folder / "axis.toml").write_text(pn.load(server.folder / "monday-fit.toml").apply().to_toml())
    truth = before.replace({"valve.conductance": f"{0.86 * before.valve.conductance_m3_s_pa!r} m3/(s Pa)"})
    run = pn.simulate(truth, STEPS, "2.6 s", initial="position = 250 mm")
    noise = np.random.default_rng(5)
    columns = {
        "time_s": run.time.to_numpy(),
        "command": run.command.to_numpy(),
        "position_m": run.position.to_numpy() + 2e-6 * noise.standard_normal(run.sizes["time"]),
        "pressure_a_pa": run.pressure_a.to_numpy() + 3e2 * noise.standard_normal(run.sizes["time"]),
        "pressure_b_pa": run.pressure_b.to_numpy() + 3e2 * noise.standard_normal(run.sizes["time"]),
    }
    save_columns(columns, {}, server.folder / "friday.parquet")
    return truth


def number(tab: Tab, selector: str) -> float:
    return float(tab.page.get_attribute(selector, "data-si"))


def test_does_my_model_hold(server: Server, open_tab: Open) -> None:
    truth = friday(server)
    tab = open_tab(server.address)
    page = tab.page
    page.click(".tree >> text=Validations")
    page.select_option("label:has-text('Drive or fit') select", "axis.toml")
    page.check("label:has-text('friday.parquet') input")
    page.fill("label:has-text('Into results/') input", "friday")
    assert violations(tab) == []
    page.click("button:text-is('Validate')")
    page.wait_for_selector("[data-leading=position].bad", timeout=LONG)  # the page opens the result
    page.wait_for_selector("b.badge:text-is('held out')")  # the values of the drive are those of monday
    drive = pn.Drive.load(server.folder / "axis.toml")
    found = pn.validate(drive, server.folder / "friday.parquet")
    settled(tab)
    for channel, one in found.records[0].channels.items():
        assert number(tab, f"[data-fit={channel}]") == one.free.fit_percent
    assert page.locator("[data-cause]").count() == len(found.diagnosis().culprits) == 1
    expect(page.locator("[data-cause=conductance]").first).to_contain_text("less conductance C of the valve")
    page.click("summary:text-is('Where each value comes from')")
    origin = page.inner_text("[data-origin='friction.coulomb']")
    assert "identified" in origin
    assert page.get_attribute("[data-origin='friction.coulomb'] >> a:text-is('monday-fit.toml')", "href")
    assert page.get_attribute("[data-origin='friction.coulomb'] >> a:text-is('monday')", "href")
    assert violations(tab) == []
    tab.picture("validation")

    before = settled(tab)
    page.focus("#suspect")
    for _ in range(56):  # 0.25 % of the value each: 14 % less
        page.keyboard.press("ArrowLeft")
    page.wait_for_selector("[data-changed=position_m]")
    counts = settled(tab)
    assert int(counts["sent"]) > int(before["sent"])
    assert counts["mostOnTheWay"] == "1"
    value = page.input_value("input[aria-label='valve.conductance, dm3/(s bar)']")
    moved = pn.validate(drive.replace({"valve.conductance": f"{value} dm3/(s bar)"}), server.folder / "friday.parquet")
    assert number(tab, "[data-changed=position_m]") == moved.records[0].channels["position_m"].free.fit_percent
    assert number(tab, "[data-changed=position_m]") > 97.0 > number(tab, "[data-fit=position_m]")
    tab.picture("validation-slider")

    page.click("text=Identify from these recordings")
    page.wait_for_selector("a:text-is('results/friday/fit-valve-conductance.toml')", timeout=LONG)
    page.click("text=Apply to a new drive file")
    page.click("text=Compare with axis.toml", timeout=LONG)
    page.wait_for_selector("[data-differs='valve.conductance']")
    fit = DriveFit.from_toml(server.folder / "results" / "friday" / "fit-valve-conductance.toml")
    low, high = fit.intervals["valve.conductance"]
    assert fit.values["valve.conductance"] == pytest.approx(truth.valve.conductance_m3_s_pa, rel=1e-3)
    after = pn.Drive.load(server.folder / "axis-identified.toml")
    assert low <= after.valve.conductance_m3_s_pa <= high
    row = page.inner_text("[data-differs='valve.conductance']")
    ends = after.provenance["valve.conductance"].interval
    assert " … ".join(ends).replace("dm3", "dm³") in row
    differ = [one.get_attribute("data-differs") for one in page.locator("[data-differs]").all()]
    assert differ == ["valve.conductance"]  # the nominal flow of before is compared as one
    page.click("summary:text-is('Lines that differ')")
    expect(page.locator("pre[aria-label='Lines that differ']").first).to_contain_text("+conductance")
    assert violations(tab) == []
    page.locator("section[aria-label='Differences']").scroll_into_view_if_needed()
    tab.picture("validation-identified")

    page.click(".home")
    page.click("button[aria-label='Made from: results/friday/validation.toml']")
    page.wait_for_selector("[data-input='axis.toml'] [data-input='monday-fit.toml'] [data-input='monday.parquet']")
    text = (server.folder / "friday.parquet").read_bytes()
    shutil.copy(server.folder / "monday.parquet", server.folder / "friday.parquet")
    page.click("text=Read the folder again")
    page.wait_for_selector("[data-stale='results/friday/validation.toml']")
    page.click("button[aria-label='Made from: results/friday/validation.toml']")
    page.wait_for_selector("[data-input='friday.parquet'][data-state=changed]")
    (server.folder / "friday.parquet").write_bytes(text)
    for name in ("axis.toml", "axis-identified.toml"):
        page.check(f"input[aria-label='Compare {name}']")
    page.wait_for_selector("[data-differs='valve.conductance']")
    expect(page.locator("[data-copy=command]").first).to_have_text(
        "pneudrive compare axis.toml axis-identified.toml", use_inner_text=True
    )
    assert violations(tab) == []
    tab.picture("studies")

    shutil.copytree(server.folder / "results/friday", server.folder / "results/validation")
    page.click("text=Read the folder again")
    page.wait_for_selector("a[title='results/validation/validation.toml']")
    page.click(".tree >> text=Validations")
    page.wait_for_selector("label:has-text('Into results/') input")
    expect(page.locator("label:has-text('Into results/') input")).to_have_value("validation-2")
    tab.check()


def test_size_a_drive(server: Server, open_tab: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    tab = open_tab(server.address)
    page = tab.page
    page.click(".tree >> text=Sizings")
    page.wait_for_selector(".cm-content")
    page.wait_for_selector("text=No problems.")
    assert violations(tab) == []
    page.click(".cm-line >> nth=2")
    page.keyboard.press("End")
    for _ in range(len('kg"')):
        page.keyboard.press("Backspace")
    page.keyboard.type('bar"')
    page.wait_for_selector(".problem >> text=is a pressure")
    expect(page.locator(".problem button").first).to_have_text("line 3", use_inner_text=True)
    tab.picture("sizing-problem")

    (server.folder / "lift.toml").write_text(LIFT)
    page.click(".home")
    page.click("text=Read the folder again")
    page.click("a[title='lift.toml']")
    page.wait_for_selector("td:has-text('0.8 J')")
    page.fill("label:has-text('Into results/') input", "lift")
    page.fill("label:has-text('Samples of each') input", "8")
    page.click("button:text-is('Size')")
    page.wait_for_selector("[data-state=done][data-simulated]", timeout=LONG)
    expect(page.locator(".answer-card h2").first).to_contain_text("Take Parker Origa OSP-P")
    expect(page.locator(".answer-card").first).to_have_attribute("data-state", "good")
    page.click("text=Copy as command or Python")
    asked: list = []
    monkeypatch.setattr(pn, "size", lambda *given, **options: asked.append((given, options)))
    exec(page.inner_text("[data-copy=python]"), {})
    assert asked == [(("lift.toml",), {"most": 160, "draws": 8, "draws_best": 32})]
    found = pn.load(server.folder / "results/lift")
    best = found.best
    assert best is not None
    columns = [one.get_attribute("data-column-of") for one in page.locator("[data-column-of]").all()]
    assert columns == [one.name for one in found.by_cylinder[:4]]
    for name, (value, limit, unit) in best.worst.items():  # each limit of the task, its value and its range
        words = page.inner_text(f"tr[data-limit='{name}']")
        assert f"limit {limit:.3g}" in words or unit == "Pa"
        assert f"{value:.3g}" in page.inner_text(f"tr[data-limit='{name}'] td >> nth=0") or unit == "Pa"
    expect(page.locator(".range.missed")).to_have_count(0)
    expect(page.locator("[data-order]").first).to_contain_text("6 bar gauge")
    assert page.get_by_text("Every simulated choice:").inner_text().endswith(str(len(found.simulated)))
    page.click("summary:has-text('Every simulated choice')")
    row = f"[data-candidate='{best.name}']"
    assert number(tab, f"{row} [data-column=energy]") == best.energy
    assert number(tab, f"{row} [data-column=air]") == best.air_litres_anr
    assert number(tab, f"{row} [data-column=place]") == 1.0
    assert best.load_ratio is not None
    assert number(tab, f"{row} [data-column=load_ratio]") == pytest.approx(100.0 * best.load_ratio)
    assert page.locator("[data-candidate]").first.get_attribute("data-candidate") == best.name
    assert page.locator("[data-candidate]").count() == len(found.simulated)
    page.select_option("label:has-text('Order by') select", "Margin, %")
    least = page.locator("[data-candidate]").first
    assert float(least.locator("[data-column=margin]").get_attribute("data-si")) == pytest.approx(
        100.0 * min(one.margin for one in found.simulated)
    )
    least.locator("button[aria-label^=Pin]").focus()
    page.keyboard.press("Space")
    pinned = least.get_attribute("data-candidate")
    assert page.locator("[data-column-of]").first.get_attribute("data-column-of") == pinned
    margins = next(one for one in found.simulated if one.name == pinned).margins.values()
    assert page.locator(".range.missed").count() == sum(margin < 0.0 for margin in margins)
    assert violations(tab) == []
    tab.picture("sizing")
    with page.context.expect_page() as opened:
        page.click("text=Open the report")
    report = opened.value
    report.wait_for_selector("#verdict li")
    for name in best.worst:  # the table of limits
        assert report.locator(f"#candidates td:has-text('{name}')").count() > 0
    assert f"({100.0 * best.margins['time out']:.0f}\u00a0%)" in report.inner_text("#candidates")
    line = report.inner_text("#again pre >> nth=0")
    assert line == "pneudrive size task.toml --samples 8 --out out"
    assert "Parker Origa OSP-P50" in report.inner_text("#verdict li >> nth=0")
    report.set_viewport_size({"width": 1200, "height": 1600})
    PICTURES.mkdir(parents=True, exist_ok=True)
    report.screenshot(path=PICTURES / "sizing-report.png", full_page=True)
    with report.expect_navigation():
        report.click("figcaption a:text-is('SVG') >> nth=0")
    assert report.url.endswith("figures/candidates.svg")
    report.close()
    with page.expect_download() as saved:
        page.click("text=Save the report")
    assert saved.value.suggested_filename == "lift-report.html"
    assert Path(saved.value.path()).read_bytes() == (server.folder / "results/lift/report.html").read_bytes()
    file = server.folder / "results/lift/01.toml"
    of_the_best = file.read_text()
    file.write_text(DRIVE)  # a sheet of a drive without tubes is written in a tenth of the time
    page.click("button:text-is('Data sheet of the best')")
    page.wait_for_selector("[data-sheet=done]", timeout=LONG)
    file.write_text(of_the_best)
    with page.context.expect_page() as opened:
        page.click("[data-sheet] >> text=Open the data sheet")
    opened.value.wait_for_selector("#numbers td")
    opened.value.wait_for_selector("text=my axis")
    opened.value.close()
    page.click(f"[data-column-of='{best.name}'] >> a")
    page.wait_for_selector("g[data-key=cylinder]")
    assert page.inner_text("h2 >> nth=0") == found.circuit().name
    tab.check()


def test_a_task_that_nothing_does_is_answered_in_words_light_and_dark(server: Server, open_tab: Open) -> None:
    text = TASK.replace('"2 kg"', '"200 kg"\nincline = "90 deg"')
    (server.folder / "push.toml").write_text(text)
    (server.folder / "results").mkdir()
    found = pn.size(server.folder / "push.toml", draws=16, draws_best=64, out=server.folder / "results" / "none")
    assert found.miss is not None
    for look in ("light", "dark"):
        tab = open_tab(server.address, look)
        page = tab.page
        page.click("a[title='results/none']")
        page.wait_for_selector(".findings li.bad")
        assert found.miss.gives in page.inner_text(".findings li.bad")
        assert violations(tab) == []
        page.evaluate("() => (location.hash = '#/sizing/push.toml')")
        page.wait_for_selector("text=No problems.")
        assert violations(tab) == []
        page.evaluate("() => (location.hash = '#/validation/')")
        page.wait_for_selector("text=Does my model hold?")
        assert violations(tab) == []
        tab.check()
        page.close()
