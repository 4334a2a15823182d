"""Contacts after the pose - thumb on fingertips, fingertips on table and palm: which were used stands on the page at once, and among the results' notes."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import (
    Server,
    act,
    begin_session,
    end_trial,
    keep_picture,
    new_patient,
    shown,
)

pytestmark = [pytest.mark.browser, pytest.mark.slow]


TASKS = {  # words of the instruction, of the first phase, of the one at which it is ended, and of what was used
    "touch_fingertips": (
        "Lay the pad of the thumb on the pad of the finger",
        "Index finger",
        "Middle finger",
        "thumb on index finger",
    ),
    "touch_table": (
        "Put all fingertips on a level table",
        "Hold still",
        "",
        "fingertips on the table",
    ),
    "touch_palm": (
        "Bend the finger that is called until its tip touches",
        "Index finger",
        "Middle finger",
        "index finger on the palm's mark",
    ),
}


def test_contacts_of_one_session_are_told_as_used(page_without_scene: Page, server: Server) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    begin_session(page, "left")
    shown(act(page, "continue")).click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    for task, (instruction, first, enough, used) in TASKS.items():
        shown(page.get_by_label("Which tasks?")).select_option("contacts")
        page.locator(f'[data-task="{task}"]').click()
        expect(page.get_by_text(instruction)).to_be_visible()
        picture = task.replace("_", "-")
        keep_picture(page, f"{picture}-ready")
        act(page, "start").click()
        shown(page.get_by_text(first, exact=True))
        keep_picture(page, f"{picture}-running")
        if enough:  # what was held until then is used
            shown(page.get_by_text(enough, exact=True).or_(act(page, "accept")))
            end_trial(page)
        shown(act(page, "accept")).click()
        told = page.get_by_text(
            re.compile(f"Contacts of fingertips were used to calibrate: .*{used}")
        )
        shown(told)
        expect(told).not_to_have_class("warning")
        keep_picture(page, f"{picture}-used")
    act(page, "finish").click()  # nothing is left to do: it is not asked again
    page.wait_for_url("**/sessions/*")
    page.locator("summary").filter(has_text="about the recording").click()
    shown(page.get_by_text("Contacts of fingertips were used to calibrate").first)
