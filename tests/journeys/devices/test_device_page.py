"""The page of gloves: a glove in use with its strips and firmware, and the same among those that measured here before."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import (
    Server,
    act,
    begin_session,
    end_session,
    keep_screen,
    new_patient,
    shown,
)

pytestmark = pytest.mark.browser
KNOWN = {
    "name": "Glove with forces",
    "device_id": "7",
    "firmware": "1.0",
    "sessions": 1,
    "session": 1,
    "started": "2026-11-05T09:00:00Z",
    "hand": "left",
    "streams": [
        {"name": "fingertips_force", "sensors": 5, "rate": 100.0, "samples": 9_000_000, "lost": 90}
    ],
    "calibrated": None,
    "calibrated_sensors": 0,
}


def test_gloves_in_use_and_of_earlier_sessions_say_how_they_are(
    page_without_scene: Page, server: Server
) -> None:
    page = page_without_scene
    page.goto(f"/patients/{new_patient(page)}")
    begin_session(page, "left")
    shown(act(page, "continue"))
    station = page.url
    page.get_by_text("Menu", exact=True).click()
    page.get_by_role("link", name="Gloves").click()
    page.wait_for_url("**/devices")
    card = page.locator("section").filter(has_text="Virtual left glove", has=page.locator("table"))
    shown(card.get_by_text("sends samples"))
    index = card.get_by_role("row").filter(has_text="index finger")
    expect(index.get_by_role("cell").nth(1)).to_have_text(re.compile(r"^\d+ per s$"))
    expect(card.locator("dd").nth(1)).to_have_text(re.compile(r"\d"))  # firmware
    keep_screen(page, "devices")
    idle = page.locator("section").filter(has_text="Virtual right glove").first
    shown(idle.get_by_text("not used now"))

    page.goto(station)
    end_session(page)
    page.goto("/devices")
    known = page.locator("[data-glove]").first
    shown(known.get_by_role("link", name=re.compile("Left hand")))
    expect(known.get_by_role("row").filter(has_text="index finger")).to_have_count(1)


def test_a_strip_of_force_sensors_has_its_name_and_its_table_fits_a_phone(
    page_without_scene: Page, server: Server
) -> None:
    page = page_without_scene
    page.set_viewport_size({"width": 340, "height": 640})
    page.route(
        "**/api/devices", lambda route: route.fulfill(json={"reachable": [], "known": [KNOWN]})
    )
    page.goto("/devices")
    strips = page.get_by_role("group", name="Strips of sensors")
    shown(strips.get_by_role("rowheader", name="force sensors of the fingertips"))
    page.wait_for_function(
        "(box) => box.scrollWidth <= box.clientWidth", arg=strips.element_handle()
    )  # its font comes with the page
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
