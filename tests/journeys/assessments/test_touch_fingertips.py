"""Thumb on each fingertip after the pose: which contacts were used stands on the page at once, and among the results' notes."""

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


def test_touched_fingertips_are_told_as_used(page_without_scene: Page, server: Server) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    begin_session(page, "left")
    shown(act(page, "continue")).click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    shown(page.get_by_label("Which tasks?")).select_option("opposition")
    page.locator('[data-task="touch_fingertips"]').click()
    expect(page.get_by_text("Lay the pad of the thumb on the pad of the finger")).to_be_visible()
    keep_picture(page, "touch-fingertips-ready")
    act(page, "start").click()
    shown(page.get_by_text("Index finger", exact=True))
    keep_picture(page, "touch-fingertips-running")
    shown(act(page, "accept")).click()
    told = page.get_by_text("Contacts of fingertips were used to calibrate: thumb-index")
    shown(told)
    expect(told).not_to_have_class("warning")
    keep_picture(page, "touch-fingertips-used")
    end_session(page)
    shown(page.get_by_text("Contacts of fingertips were used to calibrate").first)
