"""Reading a session again: a trial is left out with a reason and taken back; methods and sessions side by side."""

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import Server, api, keep_picture, shown

pytestmark = pytest.mark.browser


def test_a_trial_is_left_out_with_a_reason_and_taken_back(page_without_scene: Page, server: Server, processed: int) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/sessions/{processed}")
    shown(page.get_by_role("button", name="Change…")).click()
    shown(page.locator(".correcting .uplot"))
    expect(page.get_by_role("radio", name="Leave out a stretch")).to_have_count(0)  # taps follow each other
    page.get_by_role("button", name="Change and compute anew").click()
    expect(page.get_by_role("alert").filter(has_text="Give a reason")).to_be_visible()
    page.get_by_role("button", name="Interrupted").click()
    keep_picture(page, "session-correcting")
    page.get_by_role("button", name="Change and compute anew").click()
    shown(page.get_by_text("This recording has no figures"))
    page.reload()  # who comes later reads it too
    shown(page.get_by_text("Left out: Interrupted"))
    shown(page.locator(".warning").filter(has_text="tapping: left out of the figures (Interrupted)"))
    keep_picture(page, "session-corrected")
    page.get_by_role("button", name="Undo").click()
    shown(page.get_by_role("heading", name="Finger tapping"))
    page.get_by_text("Taken back", exact=True).click()
    shown(page.get_by_text("Left out: Interrupted. Taken back"))
    file = api(page, f"/api/sessions/{processed}")["recordings"][0]
    assert [r["current"] for r in file["results"]] == [False, True]
