"""The first view asks for each thing once and early, later views for no file again."""

from collections import Counter
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, Route, expect

from tests.app.pages.first_view_time import HAND_STANDS
from tests.journeys.house import api, begin_session, held_back, new_patient, shown

pytestmark = pytest.mark.browser
LIST = "/api/patients?search=&archived=false&offset=0&limit=50"
NAVIGATION = 'performance.getEntriesByType("navigation")[0].transferSize'
SENT = """() => performance.getEntriesByType("resource")
  .filter((one) => one.transferSize > 0).map((one) => new URL(one.name).pathname)"""


def asked_by(page: Page, base: str) -> list[str]:
    """What a page asks for from now on."""
    found: list[str] = []
    page.on("request", lambda request: found.append(request.url.removeprefix(base)))
    return found


@pytest.mark.parametrize("place", ["list", "patient"])
def test_the_first_view_asks_for_each_thing_once(
    another_page: Callable[..., Page], place: str
) -> None:
    page = another_page(at=None, new=True)
    number = new_patient(page)
    base = page.request.get("/").url.removesuffix("/")
    asked = asked_by(page, base)
    page.goto("/" if place == "list" else f"/patients/{number}", wait_until="networkidle")
    data = [address for address in asked if address.startswith("/api/")]
    wanted = {LIST, "/api/sessions/unfinished"} if place == "list" else {f"/api/patients/{number}"}
    assert wanted <= set(data)
    assert [address for address, times in Counter(asked).items() if times > 1] == []
    written = [asked.index(address) for address in wanted]
    drawn = [k for k, address in enumerate(asked) if address.endswith("/lucide/menu.svg")]
    assert max(written) < min(drawn), "before the page is drawn"


def test_a_later_view_asks_for_no_file(page: Page) -> None:
    page.wait_for_load_state("networkidle")
    page.goto("/help", wait_until="networkidle")
    page.goto("/", wait_until="networkidle")
    shown(page.get_by_role("link", name="DEMO"))
    files = [path for path in page.evaluate(SENT) if not path.startswith("/api/")]
    assert files == []


def test_an_early_answer_that_nobody_took_is_not_shown_later(
    another_page: Callable[..., Page],
) -> None:
    page = another_page(at=None, new=True)
    held: list[Route] = []
    page.route("**/static/pages/patients.js", lambda route: held.append(route))
    with page.expect_response(lambda answer: answer.url.endswith(LIST)):
        page.goto("/", wait_until="commit")
    page.get_by_role("link", name="Help").click()
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    held[0].continue_()
    with page.expect_response(lambda answer: answer.url.endswith(LIST)):
        page.get_by_role("link", name="Patients").click()
    shown(page.get_by_role("link", name="DEMO"))


def test_a_second_station_has_its_hand_without_the_page_of_the_scene_sent_again(
    another_page: Callable[..., Page],
) -> None:
    page = another_page(at=None, new=True)
    wanted = {"hand": "right", "port": api(page, "/api/gloves")[1]["path"]}
    sent = []
    for _ in range(2):
        number = new_patient(page)
        station = api(page, f"/api/patients/{number}/sessions", "POST", data=wanted)["station"]
        page.goto(f"/stations/{station}")
        frame = page.wait_for_selector("iframe").content_frame()  # type: ignore[union-attr]
        assert frame is not None
        frame.wait_for_function(HAND_STANDS)
        assert frame.evaluate("location.pathname") == f"/scene/{station}/"
        sent.append(frame.evaluate(NAVIGATION))
        api(page, f"/api/stations/{station}", "DELETE")
    assert sent[0] > 500_000 and sent[1] < 2_000


def test_the_form_for_a_session_has_the_page_of_the_scene_kept_before_its_station_shows_it(
    another_page: Callable[..., Page],
) -> None:
    page = another_page(at=None, new=True)
    number = new_patient(page)
    with page.expect_response("**/scene/") as sent:
        page.goto(f"/patients/{number}")
    assert int(sent.value.header_value("content-length") or 0) > 500_000
    expect(page.locator("iframe")).to_have_count(0)  # it is there, and its frame gone
    asked = asked_by(page, "")
    begin_session(page, "left")
    frame = page.wait_for_selector("iframe").content_frame()  # type: ignore[union-attr]
    assert frame is not None
    frame.wait_for_function(HAND_STANDS)
    assert frame.evaluate(NAVIGATION) < 2_000
    assert [address for address in asked if "/static/station/" in address] == []


def test_a_browser_that_saves_data_fetches_nothing_of_a_station_from_the_form(
    another_page: Callable[..., Page],
) -> None:
    page = another_page(at=None, new=True)
    page.add_init_script("Object.defineProperty(navigator.connection, 'saveData', { value: true })")
    number = new_patient(page)
    asked = asked_by(page, "")
    page.goto(f"/patients/{number}", wait_until="networkidle")
    shown(page.get_by_role("button", name="Start session"))
    assert [a for a in asked if "/scene/" in a or "/static/station/live.js" in a] == []


def test_a_station_asks_for_its_scene_before_it_knows_anything_else(
    another_page: Callable[..., Page],
) -> None:
    page = another_page(at=None, new=True)
    with held_back(page, "**/api/stations/*"), page.expect_response("**/scene/"):
        page.goto("/stations/none", wait_until="commit")
    shown(page.get_by_role("heading", name="This session view is closed"))
    expect(page.locator("iframe")).to_have_count(0)
