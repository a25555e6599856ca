"""What happens in a day of work with the page: left, reloaded, refused and done by keyboard, and nothing misleads."""

from __future__ import annotations

import json
from contextlib import closing

from playwright.sync_api import expect

from page.conftest import Server, Tab
from page.test_journeys import Open
from page.test_nothing_lost import EDITOR, go, held_answers
from pneudrive.sizing.result import SizingFolder
from pneudrive.sizing.task import SizingTask
from web.test_lineage import PROTOCOL
from web.test_sizing import TASK


def test_the_sliders_are_those_of_the_law_that_is_chosen(tab: Tab) -> None:
    page = tab.page
    held = held_answers(page)

    def answer(number: int) -> None:
        for _ in range(300):
            if len(held) > number:
                own, message = held[number]
                return own.send(message)
            page.wait_for_timeout(50)
        raise AssertionError(len(held))

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


def test_tasks_and_searches_lead_to_a_new_task(server: Server, open_tab: Open) -> None:
    (server.folder / "PUSH.TOML").write_text(TASK)
    folder = server.folder / "results" / "push"
    with closing(SizingFolder(folder, SizingTask.load(server.folder / "PUSH.TOML"), (16, 64))):
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
            ".problem >> text=does not know this extension" if not answer else f"[role=status] >> text={answer}"
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
