"""Contacts after the pose - thumb on fingertips, fingertips on table and palm: which were used stands on the page at once, and among the results' notes."""

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import (
    Server,
    act,
    begin_session,
    end_session,
    keep_picture,
    new_patient,
    shown,
)

pytestmark = pytest.mark.browser


TASKS = {  # words of the instruction, of the first phase, and of what was used
    "touch_fingertips": (
        "Lay the pad of the thumb on the pad of the finger",
        "Index finger",
        "thumb on index finger",
    ),
    "touch_table": ("Put all fingertips on a level table", "Hold still", "fingertips on the table"),
    "touch_palm": (
        "Bend the finger that is called until its tip touches",
        "Index finger",
        "index finger on the palm's mark",
    ),
}


@pytest.mark.parametrize("task", TASKS)
def test_contacts_are_told_as_used(task: str, page_without_scene: Page, server: Server) -> None:
    page, (instruction, first, used) = page_without_scene, TASKS[task]
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    begin_session(page, "left")
    shown(act(page, "continue")).click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    shown(page.get_by_label("Which tasks?")).select_option("contacts")
    page.locator(f'[data-task="{task}"]').click()
    expect(page.get_by_text(instruction)).to_be_visible()
    picture = task.replace("_", "-")
    keep_picture(page, f"{picture}-ready")
    act(page, "start").click()
    shown(page.get_by_text(first, exact=True))
    keep_picture(page, f"{picture}-running")
    shown(act(page, "accept")).click()
    told = page.get_by_text(f"Contacts of fingertips were used to calibrate: {used}")
    shown(told)
    expect(told).not_to_have_class("warning")
    keep_picture(page, f"{picture}-used")
    end_session(page)
    page.locator("summary").filter(has_text="about the recording").click()
    shown(page.get_by_text("Contacts of fingertips were used to calibrate").first)
