"""Language and brightness are chosen in the header and kept in the browser; reports follow the page's language."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import Server, act, api, keep_picture, shown
from tests.journeys.test_accessibility import looked_at

pytestmark = pytest.mark.browser
GROUND = "getComputedStyle(document.body).backgroundColor"


def open_menu(page: Page) -> None:
    page.locator(".menu > summary").click()


def test_german_is_chosen_once_and_kept_and_reports_follow_it(
    another_page: Callable[..., Page], server: Server, processed: int
) -> None:
    page = another_page(scene=False, bypass_csp=True)
    open_menu(page)
    looked_at(page, "menu")
    page.get_by_label("Language").select_option("de")
    shown(page.get_by_role("heading", name="Patienten"))
    assert page.locator("html").get_attribute("lang") == "de"
    page.goto(f"{server.base}/patients/1")
    shown(page.get_by_role("radio", name="Linke Hand"))
    looked_at(page, "patient in German")
    keep_picture(page, "patient-de")
    page.goto(f"{server.base}/sessions/{processed}")
    shown(page.get_by_role("heading", name="Fingertippen"))
    looked_at(page, "session in German")
    keep_picture(page, "session-de")
    address = page.get_by_role("link", name="Befund (PDF)").get_attribute("href") or ""
    assert page.request.get(server.base + address).body().startswith(b"%PDF")
    made = page.request.get(server.base + address.replace(".pdf", ".html")).text()
    assert '<html lang="de">' in made
    assert "Fingertippen" in made
    open_menu(page)
    page.get_by_label("Sprache").select_option("en")
    shown(page.get_by_role("heading", name="Finger tapping"))


@pytest.mark.slow
def test_a_german_browser_sees_german_and_the_station_speaks_it(
    another_page: Callable[..., Page], server: Server
) -> None:
    page = another_page(scene=False, locale="de-AT")
    shown(page.get_by_role("heading", name="Patienten"))
    glove = api(page, "/api/gloves")[0]["path"]
    station = api(page, "/api/patients/1/sessions", "POST", data={"hand": "left", "port": glove})[
        "station"
    ]
    page.goto(f"{server.base}/stations/{station}")
    shown(page.get_by_text("Ziehen Sie den Handschuh an"))
    keep_picture(page, "station-de")
    act(page, "continue").click()
    shown(page.locator('.fit [data-grade="good"]'))
    expect(act(page, "start")).to_be_in_viewport(ratio=1)  # on a tablet, without scrolling
    api(page, f"/api/stations/{station}", "DELETE")


def test_dark_and_light_can_be_chosen_against_the_device(
    another_page: Callable[..., Page], server: Server
) -> None:
    page = another_page(scene=False, color_scheme="light")
    light = page.evaluate(GROUND)
    open_menu(page)
    page.get_by_label("Brightness").select_option("dark")
    dark = page.evaluate(GROUND)
    assert dark != light
    page.goto(f"{server.base}/help")
    shown(page.get_by_role("heading", name="Step by step"))
    assert page.evaluate(GROUND) == dark
    open_menu(page)
    page.get_by_label("Brightness").select_option("auto")
    assert page.evaluate(GROUND) == light
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(GROUND) == dark
    page.get_by_label("Brightness").select_option("light")
    assert page.evaluate(GROUND) == light
    expect(page.get_by_label("Brightness")).to_have_value("light")
