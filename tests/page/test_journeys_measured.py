"""Two journeys through measurements: each with few clicks, by mouse and by keyboard alone, and without a dead end."""

from __future__ import annotations

import shutil
from pathlib import Path

import polars as pl
from playwright.sync_api import expect

import pneudrive as pn
from oracle.drive_records import drive, record
from page.conftest import ROOT, Server
from page.hands import MOST_CLICKS, Hand
from page.test_journeys import Open, violations

MEASURED = ROOT / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def seals(folder: Path, names: tuple[str, ...]) -> int:
    """Copy recordings of some seals, of several pressures each; return their number."""
    found = [path for name in names for path in (MEASURED / "friction").glob(f"{name}.csv.xz")]
    for path in (MEASURED / "layout.toml", *found):
        shutil.copy(path, folder)
    return len(found)


def test_recordings_to_a_comparison_of_two_seals_by_mouse(own_server: Server, open_tab: Open) -> None:
    names = ("NAPN_*", "PK_*")
    many = seals(own_server.folder, names)
    tab = open_tab(own_server.address)
    page, hand = tab.page, Hand(tab, "mouse")
    page.wait_for_selector("[data-label=NAPN]")  # rows by seal, as the layout names them
    page.wait_for_selector("[data-label=PK] >> text=not characterised")
    hand.press(f"input[aria-label='Choose all {many} recordings']")
    hand.press(f"button:text-is('Characterise {many} together')")
    page.wait_for_selector(".chosen [data-form=characterise]")
    assert violations(tab) == []
    hand.press(".chosen button:text-is('Characterise')")
    hand.press("text=Show the friction map of results/friction")
    panels = page.locator(".friction figure[data-figure='Friction over pressure'] .panel-drawing")  # not the overview's
    panels.nth(len(names) - 1).wait_for()
    assert panels.count() == len(names)
    hand.choose("label:has-text('Seal or mounting') select", "NAPN")
    hand.choose("label:has-text('Compare with') select", "PK")
    page.wait_for_selector(".answer:has-text('PK has less friction than NAPN')")
    panels = page.locator("[data-figure=compared] .panel-drawing")
    assert panels.count() == 2  # both laws, and their difference
    assert "PK less NAPN" in panels.nth(1).text_content()
    folder = own_server.folder / "results" / "friction"
    compared = pn.compare_results(folder / "fit-NAPN.toml", folder / "fit-PK.toml", ("NAPN", "PK"))
    assert page.inner_text(".answer") == compared.sentence
    expect(page.locator("[data-differs=coulomb_b]").first).to_contain_text("differs")
    assert violations(tab) == []
    tab.picture("journey-seals")
    assert hand.clicks <= MOST_CLICKS, hand.clicks
    page.reload()  # the address keeps the comparison
    page.wait_for_selector("[data-figure=compared] .panel-drawing")
    page.click(".home")
    page.wait_for_selector("[data-label=NAPN] .pill:has-text('flag')")
    page.check("input[aria-label='Choose all of PK']")
    page.check("input[aria-label='Choose all of NAPN']")
    assert "with=" in page.get_attribute(".chosen a:has-text('Compare')", "href")
    with page.expect_download() as saved:
        page.click("button:text-is('Export table')")
    rows = Path(saved.value.path()).read_text().splitlines()
    assert len(rows) == 1 + 2 * 8  # both directions of each recording
    tab.check()


def test_a_recording_to_a_drive_that_holds_on_held_out_data_by_keyboard(server: Server, open_tab: Open) -> None:
    (server.folder / "axis.toml").write_text(drive().to_toml())
    truth = drive(valve__conductance="1.6 dm3/(s bar)")
    for name, seed in (("monday", 3), ("friday", 4)):
        pl.DataFrame(record(truth, seed, duration_s=1.0).columns).write_parquet(server.folder / f"{name}.parquet")
    seals(server.folder, ("O-ring_1bar",))  # a recording of another rig, which cannot work
    tab = open_tab(server.address)
    page, hand = tab.page, Hand(tab, "keyboard")
    hand.press("main a[title='monday.parquet']")
    hand.press(".verbs a:text-is('Validate')")
    hand.choose("label:has-text('Drive or fit') select", "axis.toml")
    page.wait_for_selector("text=Not offered: 1 recordings")
    expect(page.locator("label:has-text('O-ring_1bar') input")).to_have_count(0)
    hand.press("button:text-is('Validate')")
    page.wait_for_selector("[data-leading=position].bad")
    page.wait_for_selector("[data-cause=conductance]")
    hand.press("button:text-is('Identify from these recordings'):enabled")
    hand.press("button:text-is('Apply to a new drive file'):enabled")
    hand.press("a:text-is('Validate it on held-out recordings')")
    page.wait_for_selector("label:has-text('monday.parquet') >> text=made the fit")
    page.wait_for_selector("label:has-text('friday.parquet') >> text=held out")
    page.wait_for_selector("label:has-text('friday.parquet') input:checked")
    assert not page.is_checked("label:has-text('monday.parquet') input")
    expect(page.locator("label:has-text('Into results/') input")).to_have_value("validation-2")
    assert violations(tab) == []
    hand.press("button:text-is('Validate')")
    page.wait_for_selector("[data-leading=position].good")
    page.wait_for_selector("[aria-label='Recordings of the validation'] .badge:text-is('held out')")
    found = pn.validate(pn.Drive.load(server.folder / "axis-identified.toml"), server.folder / "friday.parquet")
    shown = float(page.get_attribute("[data-fit=position_m]", "data-si"))
    assert shown == found.records[0].channels["position_m"].free.fit_percent > 90.0
    assert violations(tab) == []
    tab.picture("journey-held-out")
    assert hand.clicks <= MOST_CLICKS, hand.clicks
    tab.check()


def test_a_plot_of_reduced_data_offers_all_samples(server: Server, open_tab: Open) -> None:
    seals(server.folder, ("NAPN_3bar",))
    tab = open_tab(server.address)
    page = tab.page
    page.click("main a[title='NAPN_3bar.csv.xz']")
    page.click("figure[data-plot^=force] summary")
    page.wait_for_selector("button:text-is('CSV of lowest and highest')")
    with page.expect_download() as saved:
        page.click("button:text-is('CSV of all samples')")
    head, *rows = Path(saved.value.path()).read_text().splitlines()
    assert head == '"time, s","force (column 6), N"'
    samples = int(page.inner_text("[role=status][data-to]").split(" of ")[1].split()[0].replace(",", ""))
    assert len(rows) == samples > 8000
    tab.check()
