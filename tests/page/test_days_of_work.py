"""What happens in a day of work with the page: left, reloaded, refused and done by keyboard, and nothing misleads."""

from __future__ import annotations

import json

from playwright.sync_api import expect

from page.conftest import DRIVE, Server, Tab
from page.test_journeys import Open
from page.test_nothing_lost import EDITOR, go, type_at_end
from pneudrive.sizing.folder import SizingFolder
from pneudrive.sizing.task import SizingTask
from web.test_lineage import PROTOCOL
from web.test_sizing import TASK


def test_the_sliders_are_those_of_the_law_that_is_chosen(tab: Tab) -> None:
    page = tab.page
    held: list = []

    def through(own: object) -> None:
        there = own.connect_to_server()
        own.on_message(there.send)
        there.on_message(lambda message: held.append((own, message)))

    def answer(number: int) -> None:
        for _ in range(300):
            if len(held) > number:
                own, message = held[number]
                return own.send(message)
            page.wait_for_timeout(50)
        raise AssertionError(len(held))

    page.route_web_socket("**/api/live", through)
    go(page, "control")
    answer(0)
    page.wait_for_selector("label:text-is('move_penalty: r')")
    page.select_option("label:has-text('Setup') select", "cheap")
    page.select_option("label:has-text('Law') select", "pid")
    answer(1)  # of the law before
    page.wait_for_timeout(200)
    expect(page.locator(".slider")).to_have_count(0)
    expect(page.locator(".controls > [role=status]").first).to_have_text("Running.", use_inner_text=True)
    answer(2)
    page.wait_for_selector("label:has-text('integral_time')")
    expect(page.locator(".controls > [role=status]").first).to_contain_text("Simulated in")
    tab.check()


def test_a_drive_that_deviates_is_not_said_to_be_as_described(tab: Tab) -> None:
    page = tab.page
    go(page, "control")
    page.wait_for_selector("text=The drive my axis, as described.")
    page.select_option("label:has-text('Law') select", "pid")
    page.select_option("label:has-text('True drive') select", "other-friction")
    page.wait_for_selector("text=The drive my axis, changed by other-friction. Friction of another law")
    page.select_option("label:has-text('True drive') select", "load-step")
    page.wait_for_selector(".note:has-text('the entry at 13.3 s has no effect')")
    page.wait_for_selector("label:has-text('integral_time')")
    field = page.locator("input[aria-label='integral_time, s']")
    field.fill("0.2")
    field.press("Enter")
    page.wait_for_selector("text=not with the gains changed there")
    tab.check()


def test_a_page_that_is_loaded_again_has_its_jobs(tab: Tab) -> None:
    page = tab.page
    job = {"number": 1, "command": "", "kind": "control", "out": "results/laws", "state": "running", "tail": ""}
    page.route("**/api/jobs*", lambda route: route.fulfill(json={"jobs": [{**job, "progress": None}]}))
    for view in ("control", "campaign"):
        go(page, view)
        page.reload()
        page.click(".tray summary:has-text('1 running')")
        page.wait_for_selector("button:text-is('Cancel results/laws')")
    tab.check()


def test_what_a_job_wrote_is_in_the_lists(server: Server, tab: Tab) -> None:
    page = tab.page
    job = {"number": 1, "command": "", "kind": "design", "out": "next.toml", "tail": "", "progress": None}
    state = ["running"]
    page.route("**/api/jobs*", lambda route: route.fulfill(json={"jobs": [{**job, "state": state[0]}]}))
    go(page, "campaign")
    page.wait_for_selector("button:text-is('Cancel next.toml')")
    (server.folder / "next.toml").write_text(PROTOCOL)
    state[0] = "done"
    page.wait_for_selector("[role=status]:text-is('next.toml: done')", state="attached")
    page.wait_for_selector("option:text-is('next.toml')", state="attached")
    tab.check()


def test_a_resume_that_is_refused_says_so_as_long_as_it_is(tab: Tab) -> None:
    page = tab.page
    told = {"title": "Assumed", "state": "good"} | {
        key: [] for key in ("leading", "findings", "head", "table", "rows", "curves", "tables", "figures", "notes")
    }
    card = {
        "spread": "", "total": 2, "finished": False, "done": 0, "laws": ["pid"], "references": [], "measures": [],
        "cells": [], "each": [], "failed": [], "told": told, "command": "", "python": "",
    }  # fmt: skip
    busy = dict.fromkeys(("line", "key", "value", "rule", "remedy")) | {"what": "2 jobs are running"}
    page.route("**/api/comparison?*", lambda route: route.fulfill(json=card))
    page.route("**/api/comparisons", lambda route: route.fulfill(status=400, json={"problems": [busy]}))
    go(page, "control", "results/laws")
    page.click("button:text-is('Resume')")
    page.wait_for_selector(".problem >> text=2 jobs are running")
    with page.expect_response("**/api/comparison?*"):
        pass
    page.wait_for_timeout(100)
    expect(page.locator(".problem >> text=2 jobs are running")).to_have_count(1)


def test_tasks_and_searches_lead_to_a_new_task(server: Server, open_tab: Open) -> None:
    (server.folder / "PUSH.TOML").write_text(TASK)
    folder = server.folder / "results" / "push"
    with SizingFolder(folder, SizingTask.load(server.folder / "PUSH.TOML"), (16, 64)):
        pass  # it was ended at once
    tab = open_tab(server.address)
    page = tab.page
    go(page, "sizing", "PUSH.TOML")
    page.wait_for_selector(f"{EDITOR} >> text=push")
    late: list = []
    page.route("**/api/task", lambda route: late.append(route))  # noqa: PLW0108 - it takes no builtin
    page.click("text=A new task, and all sizings")
    page.wait_for_selector("h2:text-is('A new task')")
    page.fill("label:has-text('Name of the file') input", "axis.toml")  # before there is a text to save
    page.wait_for_selector("button:text-is('Save as a new file'):disabled")
    late[0].continue_()
    page.unroute("**/api/task")
    for name, answer in (("", "axis.toml is there already"), ("none", ""), ("mine.toml", "Saved mine.toml.")):
        if name:
            page.fill("label:has-text('Name of the file') input", name)
        page.click("button:text-is('Save as a new file')")
        page.wait_for_selector(
            ".problem >> text=does not know this ending" if not answer else f"[role=status] >> text={answer}"
        )
        assert (page.locator("[role=status] >> text=is there already").count() == 1) == (not name)
    page.wait_for_selector("h2:text-is('mine.toml')")
    page.wait_for_timeout(200)
    expect(page.locator("[role=status] >> text=Saved mine.toml.")).to_have_count(1)
    page.click("text=A new task, and all sizings")
    page.wait_for_load_state("networkidle")  # the list comes anew, and takes the focus with it
    page.press("a[title='results/push']", "Enter")
    page.wait_for_selector("button:text-is('Resume')")
    assert page.evaluate("() => document.activeElement.id") == "main"  # the link is gone, and nothing is lost
    expect(page.locator("label:has-text('Samples of each')")).to_have_count(0)  # they are those that it began with
    (server.folder / "PUSH.TOML").write_text(TASK.replace("2 kg", "3 kg"))
    page.reload()
    page.wait_for_selector("text=results/push/sizing.json has the values")
    assert json.loads((folder / "sizing.json").read_text())["task"]["mass"]
    go(page, "validation", "results/none/validation.toml")
    page.click("text=A new validation, and all of them")
    page.wait_for_selector("h2:text-is('Does my model hold?')")


def test_who_saves_by_keyboard_stays_where_they_are(server: Server, tab: Tab) -> None:
    page = tab.page
    go(page, "drive", "axis.toml")
    page.wait_for_selector(EDITOR)
    type_at_end(page, "# mine")
    page.focus("button:text-is('Save')[aria-disabled=false]")
    page.keyboard.press("Enter")
    page.wait_for_selector("[role=status] >> text=Saved axis.toml.")
    assert page.evaluate("() => document.activeElement.textContent") == "Save"
    page.keyboard.press("Enter")
    assert (server.folder / "axis.toml").read_text() == f"{DRIVE}# mine"
    tab.check()


def test_a_name_that_is_refused_is_forgotten_with_the_next(tab: Tab) -> None:
    page = tab.page
    page.goto(f"{tab.origin}/#/drive/catalogue:reference")  # as people write it
    name = page.locator("input[placeholder='axis.toml']")
    for wrong, said in (("../x.toml", "not a file of this workspace"), ("axis.toml", "axis.toml is there already")):
        name.fill(wrong)
        page.click("text=Save as a new file")
        page.wait_for_selector(f"[role=status] >> text={said}")
    page.wait_for_selector(".problem", state="detached")
    name.fill("mine.toml")
    page.click("text=Save as a new file")
    page.wait_for_selector("h2:text-is('mine.toml')")
    page.wait_for_timeout(200)
    expect(page.locator("[role=status] >> text=Saved mine.toml.")).to_have_count(1)
    assert page.evaluate("() => location.hash") == "#/drive/mine.toml"
