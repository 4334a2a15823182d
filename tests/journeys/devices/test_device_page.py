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
