"""A second factor is made and used in a browser: an app's code, a passkey (Chromium's virtual authenticator), a recovery code."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.journeys.house import SIZES, Server, api, keep_picture
from tests.journeys.test_accessibility import looked_at

pytestmark = pytest.mark.browser
pyotp = pytest.importorskip("pyotp")
pytest.importorskip("webauthn")
GOOD = "seven hands on a table"
VIRTUAL = {
    "protocol": "ctap2",
    "transport": "internal",
    "hasResidentKey": True,
    "hasUserVerification": True,
    "isUserVerified": True,
    "automaticPresenceSimulation": True,
}


@pytest.fixture(params=["en-GB", pytest.param("de-DE", marks=pytest.mark.slow)])
def person(
    request: pytest.FixtureRequest, browser: Browser, server: Server
) -> Iterator[Callable[[], Page]]:
    """Opens the server by its name, without a login; a window of one browser with an authenticator of its own."""
    width, height = SIZES["wide"]
    context = browser.new_context(
        base_url=server.base.replace("127.0.0.1", "localhost"),
        bypass_csp=True,  # for axe
        locale=request.param,
        viewport={"width": width, "height": height},
    )
    page = context.new_page()
    session = context.new_cdp_session(page)
    session.send("WebAuthn.enable")
    session.send("WebAuthn.addVirtualAuthenticator", {"options": VIRTUAL})

    def out() -> Page:
        page.goto("about:blank")  # a page that is refused something goes to the login by itself
        context.clear_cookies()
        page.goto("/login")
        return page

    yield out
    context.close()


def test_a_second_factor_is_made_and_lets_in(
    page: Page, person: Callable[[], Page], request: pytest.FixtureRequest
) -> None:
    german = "de-DE" in request.node.name
    name, words = ("dora", DE) if german else ("emma", EN)
    made = api(page, "/api/accounts", "POST", data={"name": name, "roles": ["clinician"]})
    own = person()
    answer = own.request.post("/api/login", data={"token": made["code"]})
    assert answer.ok
    own.request.put("/api/me/password", data={"password": GOOD})
    own.goto("/account")
    codes = _with_app(own, words, name)
    _with_passkey(own, words, name)
    _log_in_by_passkey(person(), words, name)
    _log_in_by_code(person(), words, name, codes[0])


def _with_app(own: Page, words: dict[str, str], name: str) -> list[str]:
    """An app in use; gives the recovery codes."""
    own.get_by_role("button", name=words["app"]).click()
    own.get_by_label(words["password"], exact=True).last.fill(GOOD)
    own.get_by_role("button", name=words["next"], exact=True).click()
    expect(own.locator("img.qr")).to_be_visible()
    keep_picture(own, f"second-app-{name}")
    looked_at(own, "a new app")
    own.set_viewport_size({"width": SIZES["wide"][0], "height": SIZES["wide"][1]})
    secret = own.locator("form code").inner_text()
    own.get_by_label(words["code"]).fill(pyotp.TOTP(secret).now())
    own.get_by_role("button", name=words["confirm"]).click()
    expect(own.locator(".codes li")).to_have_count(10)
    keep_picture(own, f"second-codes-{name}")
    return own.locator(".codes li").all_inner_texts()


def _with_passkey(own: Page, words: dict[str, str], name: str) -> None:
    own.get_by_role("button", name=words["passkey"]).click()
    own.get_by_label(words["password"], exact=True).last.fill(GOOD)
    own.get_by_role("button", name=words["passkey"]).click()
    expect(own.locator(".factors li")).to_have_count(2)
    keep_picture(own, f"second-account-{name}")
    looked_at(own, "second factors")


def _first_step(own: Page, words: dict[str, str], name: str) -> None:
    own.get_by_label(words["account"]).fill(name)
    own.get_by_label(words["login"], exact=True).fill(GOOD)
    own.get_by_role("button", name=words["send"]).first.click()
    expect(own.get_by_role("heading", name=words["step"])).to_be_visible()


def _log_in_by_passkey(own: Page, words: dict[str, str], name: str) -> None:
    _first_step(own, words, name)
    expect(own.get_by_role("button", name=words["use"])).to_be_visible()
    keep_picture(own, f"second-login-{name}")
    looked_at(own, "second step of the login")
    own.get_by_role("button", name=words["use"]).click()
    expect(own.get_by_role("heading", name=words["patients"])).to_be_visible()


def _log_in_by_code(own: Page, words: dict[str, str], name: str, code: str) -> None:
    _first_step(own, words, name)
    own.locator("#second").fill("000000")
    own.get_by_role("button", name=words["send"]).click()
    expect(own.get_by_role("alert")).to_contain_text(words["wrong"])
    own.locator("#second").fill(code)
    own.get_by_role("button", name=words["send"]).click()
    expect(own.get_by_role("heading", name=words["patients"])).to_be_visible()


EN = {
    "app": "Add an app",
    "passkey": "Add a passkey",
    "password": "Your password",
    "next": "Next",
    "code": "Code that the app shows now",
    "confirm": "Take into use",
    "account": "Name of your account",
    "login": "Password",
    "send": "Log in",
    "step": "Second step",
    "use": "Use a passkey",
    "wrong": "not right",
    "patients": "Patients",
}
DE = {
    "app": "App hinzufügen",
    "passkey": "Passkey hinzufügen",
    "password": "Ihr Passwort",
    "next": "Weiter",
    "code": "Code, den die App jetzt zeigt",
    "confirm": "In Gebrauch nehmen",
    "account": "Name Ihres Kontos",
    "login": "Passwort",
    "send": "Anmelden",
    "step": "Zweiter Schritt",
    "use": "Passkey verwenden",
    "wrong": "nicht richtig",
    "patients": "Patienten",
}
