"""From nothing to a tuned controller and an FMU, and from a lift to a sheet to send: at most 12 clicks each."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import Server
from page.hands import MOST_CLICKS, Hand
from page.test_journeys import Open, settled, violations
from page.test_model_journeys import LIFT


def test_own_axis_to_tuned_controller_and_fmu_by_keyboard(own_server: Server, open_tab: Open) -> None:
    (own_server.folder / "axis.toml").unlink()
    tab = open_tab(own_server.address)
    page, hand = tab.page, Hand(tab, "keyboard")
    hand.press("a:text-is('Open an example drive')")
    hand.press(".verbs a:text-is('Drive')")
    hand.type("input[placeholder='axis.toml']", "my-axis.toml")
    hand.press("button:text-is('Save as a new file')")
    page.wait_for_selector(".tree a[title='my-axis.toml']")  # without a reload
    page.wait_for_selector(".verbs a:text-is('Control')")
    hand.reach("input[list=parts-cylinder]")
    page.wait_for_selector("#parts-cylinder option[value^='SMC CP96-40']", state="attached")
    title = page.locator("#parts-cylinder option[value^='SMC CP96-40']").get_attribute("value")
    hand.type("input[list=parts-cylinder]", title)
    page.wait_for_selector(".cm-content >> text=40 mm")
    values = {
        "cylinder.stroke": "300", "load.mass": "12", "cylinder.moving_mass": "1.5", "cylinder.incline": "0",
        "friction.coulomb": "40", "valve.conductance": "4", "supply.pressure": "7",
    }  # fmt: skip
    for key, value in values.items():
        hand.type(f"input[aria-label='{key}']", value)
    page.wait_for_selector(".cm-content >> text=300 mm")
    page.wait_for_selector("text=No problems.")
    assert violations(tab) == []
    hand.press("section[aria-label='Name and state'] button:text-is('Save')")
    page.wait_for_selector("[role=status] >> text=Saved my-axis.toml.")
    drive = pn.Drive.load(own_server.folder / "my-axis.toml")
    assert (drive.cylinder.bore_m, drive.cylinder.stroke_m, drive.load.mass_kg) == pytest.approx((0.04, 0.3, 12.0))

    hand.press(".verbs a:text-is('Control')")
    page.wait_for_selector("[data-leading=max_error_m]")
    hand.press("button:text-is('Try all laws')")
    laws = page.locator("label:has-text('Law') option").all_inner_texts()
    page.wait_for_selector(f"[data-figure='Largest error of each law'] text:text-is('{laws[-1]}')")
    hand.choose("label:has-text('Law') select", "inversion")
    settled(tab)
    page.wait_for_selector(".answer-card h2:has-text('inversion')")
    hand.press("button:text-is('Save the controller')")
    page.wait_for_selector("[role=status] >> text=Saved my-axis-inversion.toml.")
    controller = str(own_server.folder / "my-axis-inversion.toml")
    run = pn.control.run(drive, controller=controller, reference="138 mm; 0.1 s: 150 mm in 0.3 s")
    assert run.attrs["score"]["max_error_m"] < 1e-2

    hand.press("a:text-is('Export the drive')")
    page.wait_for_selector("button:text-is('Export'):enabled")
    name = page.input_value("label:has-text('Into results/') input")
    fmu = f"results/{name}.fmu"
    assert not (own_server.folder / fmu).exists()
    hand.press("button:text-is('Export'):enabled")
    page.wait_for_selector(f".job[data-state=done]:has-text('{fmu}')")
    assert (own_server.folder / fmu).stat().st_size > 0
    assert hand.clicks <= MOST_CLICKS
    tab.picture("journey-axis")
    with page.expect_download() as saved:
        page.click(f"text=Show the variables of {fmu}")
        page.click("button:text-is('Save the FMU')")
    assert Path(saved.value.path()).read_bytes() == (own_server.folder / fmu).read_bytes()
    tab.check()


def test_lift_to_a_sheet_for_the_customer_by_mouse(server: Server, open_tab: Open) -> None:
    (server.folder / "axis.toml").unlink()
    tab = open_tab(server.address)
    page, hand = tab.page, Hand(tab, "mouse")
    hand.press("button:text-is('Start with a task')")
    page.wait_for_selector("text=No problems.")
    hand.type(".cm-content", LIFT.replace('held_by = "machine"\n', ""))
    page.wait_for_selector("h2:has-text('lift at 30 degrees')")
    hand.press("button:text-is('Save')[aria-disabled=false]")
    hand.type("label:has-text('Samples of each') input", "8")
    hand.press("button:text-is('Size'):enabled")
    page.wait_for_selector("[data-state=done][data-simulated]")
    expect(page.locator(".answer-card h2").first).to_contain_text("Not ready to order")
    expect(page.locator(".findings").first).to_contain_text("hangs at pressure loss")

    hand.press("button:text-is('Set held_by = machine')")
    page.wait_for_selector(".cm-content >> text=held_by")
    hand.press("button:text-is('Save')[aria-disabled=false]")
    hand.press("button:text-is('Size'):enabled")  # the next free name stands in the field
    page.wait_for_selector("[data-state=done][data-simulated]")
    assert page.inner_text(".answer-card h2").removeprefix("in order").strip().startswith("Take ")
    expect(page.locator(".findings li")).to_have_count(0)
    assert violations(tab) == []
    with page.expect_download() as saved:
        hand.press("a:text-is('Save the sheet')")
    sheet = Path(saved.value.path()).read_text()
    assert saved.value.suggested_filename.endswith("-sheet-report.html")
    assert hand.clicks <= MOST_CLICKS
    for words in ("lift at 30 degrees", "Order list", "Parker Origa OSP-P", "time out, limit", "8 kg"):
        assert words in sheet
    assert "NOT KEPT" not in sheet
    tab.picture("journey-lift")
    tab.check()

    printed = page.context.new_page()
    printed.set_content(sheet)
    assert one_page(printed)
    printed.close()


def one_page(page: object) -> bool:
    """Whether a sheet prints on one A4 page."""
    data = page.pdf(format="A4", prefer_css_page_size=True)
    return data.count(b"/Type /Page\n") + data.count(b"/Type /Page ") + data.count(b"/Type /Page/") == 1


def test_hard_impacts_have_remedies_on_one_screen(server: Server, open_tab: Open) -> None:
    heavy = '[cylinder]\nstroke = "300 mm"\n[load]\nmass = "12 kg"\n[valve]\nconductance = "4 dm3/(s bar)"\n'
    (server.folder / "axis.toml").write_text(f'drive = "catalogue:reference"\nname = "heavy axis"\n{heavy}')
    tab = open_tab(server.address)
    page = tab.page
    page.set_viewport_size({"width": 1440, "height": 900})
    page.click("a[title='axis.toml']")
    page.wait_for_selector(".answer-card[data-state=bad] .severe")
    command = "label:has-text('Command') input >> nth=0"
    hardest = "[data-leading='hardest impact'] .number"
    settled(tab)
    pane = page.locator("[data-steps=Command]").bounding_box()
    assert pane["y"] + pane["height"] <= 900  # piston, four panes and the command
    expect(page.locator("[data-piston-at]")).to_have_count(1)
    before = float(page.inner_text(hardest).split()[0])
    page.click("button:text-is('Brake the command')")
    settled(tab)
    assert len(page.input_value(command).split(",")) == 4
    assert float(page.inner_text(hardest).split()[0]) < 0.5 * before

    page.focus("[data-steps] [role=slider] >> nth=1")
    at = page.input_value(command).split(",")[1]
    page.keyboard.press("ArrowRight")
    assert page.input_value(command).split(",")[1] != at
    page.click("button:text-is('Add a cushion')")
    page.wait_for_selector("textarea#command")  # the drive is a circuit now
    settled(tab)
    assert page.input_value("textarea#command").startswith("valve: 0 s: 1")
    assert violations(tab) == []
    page.click(".verbs a:text-is('Drive')")
    page.wait_for_selector(".cm-content >> text=needle_conductance")
    tab.picture("simulate-remedies")
    tab.check()
