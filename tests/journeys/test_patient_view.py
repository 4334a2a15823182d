"""The patient's own screen: opened by a code without a login, in the patient's language, led by what the therapist does, ended by the therapist."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.conftest import drawn_seldom, empty_scene
from tests.journeys.house import (
    Server,
    act,
    api,
    begin_session,
    end_session,
    end_trial,
    keep_screen,
    new_patient,
    shots,
    shown,
)

pytestmark = pytest.mark.browser


def test_the_patient_is_led_on_a_screen_of_their_own_and_shows_both_hands_in_one_visit(
    page_without_scene: Page, newcomer: Page, server: Server
) -> None:
    page, tablet = page_without_scene, _tablet(newcomer)
    patient = new_patient(page)
    page.goto(f"/patients/{patient}")
    first = begin_session(page, "left")
    page.locator("summary").filter(has_text="Patient's screen").click()
    page.get_by_label("Language of the patient").select_option("de")
    code = _invited(page)

    tablet.goto(f"{server.base}/patient-view")
    keep_screen(tablet, "patient-view-code")
    tablet.get_by_label("Code from your therapist").fill(code.lower().replace("-", " "))
    tablet.get_by_role("button", name="Open").click()
    shown(tablet.get_by_role("heading", name="Einen Moment bitte"))
    assert tablet.evaluate("document.documentElement.lang") == "de"
    keep_screen(tablet, "patient-view-wait")
    _lead_through_fist(page, tablet)
    _reveals_nobody(page, tablet, server, patient)

    page.get_by_role("button", name="End", exact=True).click()
    shown(tablet.get_by_text("Die Sitzung ist vorbei, oder dieser Bildschirm wurde beendet"))
    tablet.goto(f"{server.base}/patient-view?language=de#{code}")
    shown(tablet.get_by_text("Dieser Code öffnet nichts"))

    tablet.goto(f"{server.base}/patient-view?language=de#{_invited(page)}")
    shown(tablet.get_by_role("heading", name="Danke, das ist aufgezeichnet"))
    act(page, "accept").click()
    shown(tablet.get_by_role("heading", name="Einen Moment bitte"))
    _go_on_with_the_other_hand(page, first)
    shown(tablet.get_by_role("heading", name="Jetzt die andere Hand"))
    assert "Rechte Hand" in (tablet.locator("iframe").get_attribute("title") or "")
    keep_screen(tablet, "patient-view-other-hand")

    _measure_fist(page)
    expect(page.locator("[data-other-hand]")).to_be_hidden()  # both hands are measured
    end_session(page)
    shown(tablet.get_by_text("Die Sitzung ist vorbei, oder dieser Bildschirm wurde beendet"))
    right, left = api(page, f"/api/patients/{patient}")["sessions"]
    assert (right["hand"], right["continues"]) == ("right", left["id"])
    shown(page.get_by_role("link", name="Left hand, same visit")).click()
    shown(page.get_by_role("link", name="Right hand, same visit"))
    assert page.url.endswith(f"/sessions/{left['id']}")


def _lead_through_fist(page: Page, tablet: Page) -> None:
    """Pose and one trial of fist and straight, as the patient's screen shows them."""
    shown(act(page, "continue")).click()
    shown(tablet.get_by_role("heading", name="Legen Sie die Hand flach hin"))
    keep_screen(tablet, "patient-view-pose")
    shown(act(page, "start")).click()
    shown(tablet.get_by_role("heading", name="Nicht bewegen"))
    shown(act(page, "accept")).click()

    shown(page.locator('[data-task="rom_fist"]')).click()
    shown(tablet.get_by_role("heading", name="Faust und Strecken"))
    shown(tablet.get_by_text("Achten Sie auf die blaue Hand"))
    keep_screen(tablet, "patient-view-watch")
    shown(act(page, "start")).click()
    shown(tablet.get_by_text("Gleich geht es los"))
    expect(tablet.locator(".countdown .digits")).to_have_text(re.compile("[123]"))
    shown(tablet.get_by_text("Jetzt", exact=True))
    shown(tablet.locator(".reached .fill"))
    expect(tablet.locator(".extent .number")).to_have_text(re.compile(r"\d+°"))
    expect(tablet.locator(".extent.there")).to_have_count(
        1
    )  # the band of the demonstration is reached
    if shots():
        tablet.screenshot(path=f"{shots()}/patient-view-run.png")
    shown(act(page, "accept"))
    shown(tablet.get_by_role("heading", name="Danke, das ist aufgezeichnet"))
    shown(tablet.get_by_text(re.compile(r"Sie haben \d Bewegungen gemacht")))
    keep_screen(tablet, "patient-view-rest")


def _reveals_nobody(page: Page, tablet: Page, server: Server, patient: int) -> None:
    """The patient's screen knows neither the patient's code nor the therapist's login, and keeps its own over a reload."""
    text = tablet.content()
    pseudonym = api(page, f"/api/patients/{patient}")["pseudonym"]
    assert pseudonym not in text and "handscope" not in tablet.evaluate("document.cookie")
    assert tablet.request.get(f"{server.base}/api/patients/{patient}").status == 401
    tablet.reload()  # the cookie of the screen leads on
    shown(tablet.get_by_role("heading", name="Danke, das ist aufgezeichnet"))


def _go_on_with_the_other_hand(page: Page, first: str) -> None:
    """A first attempt fails and says why."""
    page.route("**/api/gloves", lambda route: route.abort(), times=1)
    shown(page.locator("[data-other-hand]")).click()
    shown(page.get_by_role("alert").filter(has_text=re.compile(r"\w")))  # why nothing opened
    page.locator("[data-other-hand]").click()
    expect(page.get_by_label("Glove of the other hand").locator("option:checked")).to_have_text(
        "virtual right glove"
    )
    expect(page.locator("[data-back]")).to_be_focused()
    keep_screen(page, "station-other-hand")
    page.get_by_role("button", name="Go on with the right hand").click()
    page.wait_for_url(lambda url: "/stations/" in url and first not in url)
    shown(page.get_by_role("heading", name="Right hand of"))
    shown(page.get_by_text("The second hand of this visit"))
    keep_screen(page, "station-second-hand")


def _tablet(page: Page) -> Page:
    """The patient's screen; its scene is there where its pictures are kept."""
    if shots():
        page.add_init_script(drawn_seldom())
    else:
        empty_scene(page)
    return page


def _measure_fist(page: Page) -> None:
    """Pose and one trial of fist and straight, ended early."""
    for step in ("continue", "start", "accept"):
        shown(act(page, step)).click()
    shown(page.locator('[data-task="rom_fist"]')).click()
    shown(act(page, "start")).click()
    shown(page.get_by_text("Seconds left").or_(act(page, "accept")))
    end_trial(page)
    shown(act(page, "accept")).click()
    shown(page.locator("[data-other-hand], [data-act=finish]"))


def _invited(page: Page) -> str:
    """A new code from the therapist's panel, which is open."""
    page.locator("[data-invite]").click()
    code = shown(page.locator("[data-code]")).inner_text()
    expect(
        page.get_by_text(re.compile("This server answers on this computer only"))
    ).to_be_visible()
    keep_screen(page, "station-screens")
    return code
