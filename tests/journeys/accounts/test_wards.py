"""Wards in a browser: an administrator makes them, an account sees its own patients, and opens another one in an emergency."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, Response, expect

from tests.journeys.house import LONG, SIZES, Server, api, keep_picture
from tests.journeys.test_accessibility import looked_at

pytestmark = pytest.mark.browser
WHY = "unconscious on the night ward, burn of the hand"


@pytest.fixture
def page(another_page: Callable[..., Page]) -> Page:
    return another_page(bypass_csp=True)  # for axe


@pytest.fixture
def house(page: Page) -> dict[str, str]:
    """Two wards, a clinician and a patient in each: codes that log in, by name."""
    codes = {}
    for name, ward in (("wanda", "Hand surgery"), ("walter", "Neurology")):
        number = api(page, "/api/wards", "POST", data={"name": ward})["id"]
        account = {"name": name, "roles": ["clinician"], "wards": [number]}
        made = api(page, "/api/accounts", "POST", data=account)
        codes[name] = made["code"]
        api(
            page,
            f"/api/accounts/{made['id']}",
            "PATCH",
            data={"version": made["version"], "heads": [number]},
        )
        patient = {"pseudonym": f"W-{ward[0]}1", "ward": number}
        codes[ward] = str(api(page, "/api/patients", "POST", data=patient)["id"])
    return codes


def logged_in(another_page: Callable[..., Page], code: str, locale: str) -> Page:
    page = another_page(at=None, locale=locale)
    page.request.delete("/api/login")
    page.context.clear_cookies()
    assert page.request.post("/api/login", data={"token": code}).ok
    page.goto("/")
    return page


def test_a_patient_of_another_ward_is_opened_in_an_emergency_alone(
    page: Page, house: dict[str, str], another_page: Callable[..., Page], server: Server
) -> None:
    _managed(page)
    wanda = logged_in(another_page, house["wanda"], "de-DE")
    expect(wanda.get_by_role("link", name="W-H1")).to_be_visible()
    expect(wanda.get_by_role("link", name="W-N1")).to_have_count(0)
    wanda.goto(f"/patients/{house['Neurology']}")
    expect(wanda.get_by_role("alert")).to_contain_text("anderen Abteilung")
    wanda.goto("/")
    wanda.get_by_text("Notfallzugriff", exact=True).click()
    wanda.get_by_label("Patientencode").fill("W-N1")
    wanda.get_by_label("Begründung").fill(WHY)
    keep_picture(wanda, "wards-emergency")
    wanda.get_by_role("button", name="Diesen Patienten öffnen").click()
    wanda.wait_for_url(f"**/patients/{house['Neurology']}")
    expect(wanda.locator(".warning").first).to_contain_text("Neurology")
    expect(wanda.get_by_text(WHY)).to_be_visible()
    keep_picture(wanda, "wards-patient")
    _shown_to_the_head(logged_in(another_page, house["walter"], "en-GB"))
    wanda.get_by_role("button", name="Zugriff beenden").click()
    wanda.wait_for_url(f"{server.base}/")
    expect(wanda.get_by_role("link", name="W-N1")).to_have_count(0, timeout=LONG)


def test_two_administrators_who_change_one_account_are_told_and_lose_nothing(
    page: Page,
) -> None:
    ward = api(page, "/api/wards", "POST", data={"name": "Plastic surgery"})["id"]
    new = {"name": "vera", "roles": ["clinician"], "wards": [ward]}
    account = api(page, "/api/accounts", "POST", data=new)
    address = f"/api/accounts/{account['id']}"
    api(page, "/api/wards", "POST", data={"name": "Dialysis"})
    page.goto("/account")
    row = page.get_by_role("row", name="vera")
    row.locator("summary").click()
    api(page, address, "PATCH", data={"version": account["version"], "disabled": True})
    row.get_by_role("checkbox", name="Dialysis").first.check()
    with page.expect_response(_stores):
        row.get_by_role("button", name="Save").click()
    expect(row.locator("summary")).to_have_text("Plastic surgery, Dialysis")
    stored = next(a for a in api(page, "/api/accounts") if a["name"] == "vera")
    assert stored["disabled"] and len(stored["wards"]) == 2, "what both of them did is kept"
    row.locator("summary").click()
    of_house = {"version": stored["version"], "wards": [1], "heads": []}
    api(page, address, "PATCH", data=of_house)
    row.get_by_role("button", name="Save").click()
    refused = row.get_by_role("alert")
    expect(refused).to_contain_text("changed in another window meanwhile")
    expect(refused).to_contain_text("Stored now: Whole house")
    expect(row.get_by_role("checkbox", name="Dialysis").first).to_be_checked()
    keep_picture(page, "wards-two-administrators")
    with page.expect_response(_stores):
        row.get_by_role("button", name="Save").click()
    expect(row.locator("summary")).to_have_text("Plastic surgery, Dialysis")
    newest = next(a for a in api(page, "/api/accounts") if a["name"] == "vera")["version"]
    api(page, address, "PATCH", data={"version": newest, "disabled": False})
    row.get_by_role("button", name="Take into use").click()
    expect(page.get_by_text("account 'vera' was changed in another window")).to_be_visible()
    expect(row.get_by_role("button", name="Take out of use")).to_be_visible()


def _stores(response: Response) -> bool:
    """It changed an account."""
    return response.request.method == "PATCH" and response.ok


def _shown_to_the_head(walter: Page) -> None:
    """Sees who opened the patient; a new patient is offered no other ward."""
    expect(walter.get_by_text(WHY)).to_be_visible()
    expect(walter.get_by_text("wanda opened W-N1")).to_be_visible()
    keep_picture(walter, "wards-head")
    walter.get_by_role("link", name="W-N1").click()
    expect(walter.get_by_role("definition").filter(has_text="Neurology")).to_be_visible()


def _managed(page: Page) -> None:
    """The administrator's page, as it looks and as it works."""
    page.goto("/account")
    page.get_by_label("Name of a new ward").fill("Burns")
    page.get_by_role("button", name="Make the ward").click()
    expect(page.get_by_label("Name of the ward").last).to_have_value("Neurology")
    expect(page.get_by_label("Name of the ward")).to_have_count(3)
    offered = page.get_by_role("row", name="wanda").locator("label", has_text="Burns")
    expect(offered.first).to_be_attached()  # the accounts are drawn anew after the wards
    page.get_by_role("row", name="wanda").locator("summary").click()
    row = page.get_by_role("row", name="wanda")
    row.get_by_role("checkbox", name="Burns").first.check()
    row.get_by_role("button", name="Save").click()
    expect(page.get_by_role("row", name="wanda")).to_contain_text("Burns")
    keep_picture(page, "wards-account")
    looked_at(page, "wards")
    page.set_viewport_size(dict(zip(("width", "height"), SIZES["wide"])))
    page.get_by_label("Name of the ward").first.fill("Burn unit")
    page.get_by_role("button", name="Rename").first.click()
    expect(page.get_by_role("row", name="wanda")).to_contain_text("Burn unit")
