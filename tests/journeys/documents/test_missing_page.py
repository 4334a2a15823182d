"""A mistyped address: a person reads what is wrong and gets back, a program reads JSON."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.journeys.house import Server, keep_screen, shown
from tests.journeys.test_accessibility import looked_at
from tests.schedule import swept

pytestmark = pytest.mark.browser
WORDS = {
    "en": ("There is no such page", "To the list of patients"),
    "de": ("Diese Seite gibt es nicht", "Zur Liste der Patienten"),
    "fr": ("Cette page n’existe pas", "Vers la liste des patients"),
}


@pytest.mark.parametrize("language", swept(WORDS, kept=["en"]))
def test_a_mistyped_address_is_a_page_with_a_way_back(
    browser: Browser, server: Server, language: str
) -> None:
    title, back = WORDS[language]
    context = browser.new_context(locale=language, bypass_csp=True)  # for axe
    page = context.new_page()  # another one's console may not say that an address was not found
    page.goto(server.address())
    answer = page.goto(f"{server.base}/pateints")
    assert answer is not None and answer.status == 404
    shown(page.get_by_role("heading", name=title))
    looked_at(page, f"missing-{language}")
    keep_screen(page, f"missing-{language}")
    page.get_by_role("link", name=back).click()
    shown(page.get_by_role("link", name="DEMO"))
    context.close()


def test_a_program_keeps_its_json(another_page: Callable[..., Page], server: Server) -> None:
    page = another_page(at=None)
    for address, wanted in (("/pateints", "application/json"), ("/api/pateints", "text/html")):
        answer = page.request.get(address, headers={"accept": wanted})
        assert answer.status == 404
        assert answer.json()["code"] == "server.not_found"


def test_without_a_login_it_leads_to_the_login(newcomer: Page, server: Server) -> None:
    newcomer.goto(f"{server.base}/pateints")
    expect(newcomer).to_have_url(f"{server.base}/login")
