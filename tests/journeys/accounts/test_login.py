"""Nobody sees anything without a login; the printed address lets in once."""

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from tests.journeys.house import Server, api, held_back, keep_picture, sent_late, shown

pytestmark = pytest.mark.browser
CLINICIANS = (
    "New patient",
    "Start session",
    "Change",
    "Add note",
    "Upload and process",
    "Save measures",
    "Export everything (zip)",
    "Erase for good",
    "Report (PDF)",
)  # words of what a scientist is not offered
OPENED = """(address) => new Promise((tell) => {
    const socket = new WebSocket(address, address.includes("/scene/") ? [PROTOCOL] : []);
    socket.onopen = () => { socket.close(); tell("opened"); };
    socket.onerror = () => tell("refused");
})""".replace("PROTOCOL", '"viser-v1.1.1"')


def test_the_printed_address_lets_in_once(newcomer: Page, server: Server) -> None:
    address = server.address()
    newcomer.goto(address)
    expect(newcomer.get_by_role("heading", name="Patients")).to_be_visible()
    newcomer.goto("about:blank")  # a page that is refused something goes to the login by itself
    newcomer.context.clear_cookies()
    newcomer.goto(address)
    expect(newcomer.get_by_role("alert")).to_contain_text("used before")
    keep_picture(newcomer, "login")


def code_form(page: Page) -> Locator:
    """Where a one-time code is entered: folded below the password where an account has one, as other journeys may have left it."""
    page.wait_for_load_state("networkidle")
    form = page.locator("form").filter(has=page.locator("#code"))
    if form.is_hidden():
        page.locator("summary", has_text="I have a one-time code").click()
    return form


def test_a_code_can_be_pasted_as_it_was_printed(newcomer: Page, server: Server) -> None:
    newcomer.goto(server.base)
    form = code_form(newcomer)
    form.get_by_label("One-time code").fill("wrong")
    form.get_by_role("button", name="Log in").click()
    expect(newcomer.get_by_role("alert").filter(has_text="handscope login")).to_be_visible()
    form.get_by_label("One-time code").fill(server.address())
    form.get_by_role("button", name="Log in").click()
    expect(newcomer.get_by_role("heading", name="Patients")).to_be_visible()


def test_a_second_browser_without_the_cookie_sees_nothing(
    page: Page, newcomer: Page, server: Server
) -> None:
    gloves = api(page, "/api/gloves")
    station = api(
        page, "/api/patients/1/sessions", "POST", data={"hand": "right", "port": gloves[1]["path"]}
    )["station"]
    sockets = [
        f"{server.base.replace('http', 'ws')}/{path}"
        for path in (f"scene/{station}", f"api/stations/{station}/live")
    ]
    assert [page.evaluate(OPENED, address) for address in sockets] == ["opened", "opened"]

    newcomer.goto(f"{server.base}/patients/1")
    newcomer.wait_for_url(f"{server.base}/login")
    expect(newcomer.get_by_label("One-time code")).to_be_visible()
    assert "DEMO" not in newcomer.content()
    for path in (
        "/api/patients",
        f"/api/stations/{station}",
        f"/scene/{station}/",
        "/static/app.js",
    ):
        assert newcomer.request.get(server.base + path).status == 401, path
    assert [newcomer.evaluate(OPENED, address) for address in sockets] == ["refused", "refused"]
    api(page, f"/api/stations/{station}", "DELETE")


def test_who_logs_out_is_out(page: Page, server: Server) -> None:
    page.locator(".menu > summary").click()
    page.get_by_role("button", name="Log out").click()
    page.wait_for_url("**/login")
    page.goto(server.base)
    page.wait_for_url("**/login")


def test_a_question_answered_while_its_page_is_left_does_not_lead_away_again(
    page: Page, server: Server
) -> None:
    asked: list[Route] = []
    page.route(f"{server.base}/login", lambda route: asked.append(route))
    with sent_late(page, "**/api/patients*"):
        with page.expect_request("**/api/patients*") as question:
            page.reload(wait_until="commit")
        with page.expect_request(f"{server.base}/login"):
            page.locator(".menu > summary").click()
            page.get_by_role("button", name="Log out").click(no_wait_after=True)
    answer = question.value.response()
    assert answer is not None and answer.status == 401
    asked[0].continue_()
    page.wait_for_url("**/login")
    shown(code_form(page))
    assert len(asked) == 1


@pytest.mark.parametrize(
    "seen", [True, False], ids=["its page was seen before", "its page was not yet loaded"]
)
def test_a_login_that_ended_leads_back_to_the_login_page(page: Page, seen: bool) -> None:
    link = page.get_by_role("link", name="DEMO")
    if seen:
        link.click()
        shown(page.get_by_role("heading", name="New session"))
        page.get_by_role("link", name="Patients").first.click()
    shown(link).focus()
    page.context.clear_cookies()
    # a click would wait for the link, which the page may leave by itself
    page.keyboard.press("Enter")
    page.wait_for_url("**/login")


def code_typed_before_the_ways_in_are_known(page: Page, address: str) -> None:
    with held_back(page, "**/api/login"):
        page.goto(address)
        typed = page.get_by_label("One-time code")
        typed.fill("half a code")
    shown(page.get_by_label("Name of your account"))
    expect(typed).to_have_value("half a code")
    expect(typed).to_be_focused()
    page.reload()


def test_an_account_is_handed_over_by_a_code_and_then_logs_in_by_its_password(
    page: Page, newcomer: Page, server: Server, processed: int
) -> None:
    page.goto(f"{server.base}/account")
    page.get_by_label("Name", exact=True).fill("anna")
    page.get_by_role("checkbox", name="Scientist").check()
    page.get_by_role("button", name="Make the account").click()
    code = shown(page.locator(".handed code")).inner_text()
    keep_picture(page, "accounts")
    newcomer.goto(f"{server.base}/login?token={code}")
    shown(newcomer.get_by_role("link", name="DEMO"))
    newcomer.get_by_role("link", name="Account").click()
    for label in ("New password", "New password once more"):
        newcomer.get_by_label(label, exact=True).fill("seven hands on a table")
    newcomer.get_by_role("button", name="Set password").click()
    shown(newcomer.get_by_text("The password is set"))
    newcomer.locator(".menu > summary").click()
    newcomer.get_by_role("button", name="Log out").click()
    newcomer.wait_for_url("**/login")
    code_typed_before_the_ways_in_are_known(newcomer, f"{server.base}/login")
    newcomer.get_by_label("Name of your account").fill("anna")
    newcomer.get_by_label("Password").fill("seven hands on a table")
    newcomer.get_by_role("button", name="Log in").click()
    shown(newcomer.get_by_role("link", name="DEMO"))
    refused: list[str] = []
    newcomer.on(
        "response", lambda answer: refused.append(answer.url) if answer.status == 403 else None
    )
    for address, heading in (
        ("/", "Patients"),
        ("/patients/1", "Sessions"),
        (f"/sessions/{processed}", "Finger tapping"),
    ):
        newcomer.goto(server.base + address)
        shown(newcomer.get_by_text(heading, exact=True))
        newcomer.wait_for_load_state("networkidle")
        keep_picture(newcomer, f"scientist{address.replace('/', '-')}")
        for words in CLINICIANS:
            offered = newcomer.get_by_role("button", name=words, exact=True).or_(
                newcomer.get_by_role("link", name=words, exact=True)
            )
            expect(offered.filter(visible=True)).to_have_count(0)
    assert refused == [], "nothing is asked for that the account may not see"
    assert newcomer.request.get(f"{server.base}/api/patients/1").json()["year_of_birth"] is None
    page.get_by_role("link", name="Audit trail").click()
    page.get_by_role("button", name="Verify").click()
    shown(page.get_by_text("lines hold"))
    anna = next(a for a in api(page, "/api/accounts") if a["name"] == "anna")
    change = {"version": anna["version"], "disabled": True}
    api(page, f"/api/accounts/{anna['id']}", "PATCH", data=change)
