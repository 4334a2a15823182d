"""Where several servers share a database: the list of patients says who records where, and leads there."""

import pytest
from playwright.sync_api import Browser, Route, expect

from tests.journeys.house import Server, keep_screen, shown
from tests.schedule import swept

pytestmark = pytest.mark.browser
ROW = {
    "id": 7,
    "patient": {"id": 3, "pseudonym": "P-3"},
    "started": "2026-11-24T10:12:00+00:00",
    "station": None,
    "overnight": True,
    "repairing": None,
    "reading": None,
}
THERE = {"name": "room-2", "address": "https://room-2.example.org", "answers": True}
WORDS = {
    "en": ("at the server room-2", "Go to room-2", "does not answer"),
    "de": ("am Server room-2", "Zu room-2", "nicht antwortet"),
    "fr": ("sur le serveur room-2", "Aller à room-2", "ne répond pas"),
}


@pytest.mark.parametrize("language", swept(WORDS, kept=["en"]))
def test_a_session_at_another_server_is_named_with_the_way_there(
    browser: Browser, server: Server, language: str
) -> None:
    where, go, silent = WORDS[language]
    context = browser.new_context(locale=language)
    page = context.new_page()
    rows = [{**ROW, "elsewhere": THERE}, {**ROW, "id": 8, "elsewhere": {**THERE, "answers": False}}]
    page.route("**/api/sessions/unfinished", lambda route: route.fulfill(json=rows))
    page.goto(server.address())
    shown(page.locator(".note", has_text=where))
    expect(page.get_by_role("link", name=go)).to_have_attribute(
        "href", "https://room-2.example.org/"
    )
    expect(page.locator(".warning", has_text=silent)).to_have_count(1)
    expect(page.get_by_role("link", name=go)).to_have_count(1)
    keep_screen(page, f"other-server-{language}")
    context.close()


def test_the_list_comes_when_it_is_known_what_stands_above_it(
    browser: Browser, server: Server
) -> None:
    context = browser.new_context(locale="en")
    page, held = context.new_page(), list[Route]()
    page.route("**/api/sessions/unfinished", lambda route: held.append(route))
    with page.expect_response("**/api/patients?*"):
        page.goto(server.address())
    expect(page.get_by_role("heading", name="Patients")).to_be_visible()
    expect(page.get_by_role("searchbox")).to_be_hidden()
    held[0].fulfill(json=[{**ROW, "elsewhere": THERE}])
    expect(page.get_by_role("searchbox")).to_be_visible()
    expect(page.get_by_role("link", name="Go to room-2")).to_be_visible()
    context.close()
