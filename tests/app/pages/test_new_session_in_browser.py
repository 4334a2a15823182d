"""The glove that is proposed for a new session, in every language: that of the hand, never one of the other."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from handscope.app.language import languages
from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
PROPOSED = """async ([hand, gloves]) => {
  const { mount } = await import("/static/patient/new_session.js");
  const record = { now: { id: 1, affected_hand: hand, sessions: [], clock: { now: new Date().toISOString(), doubts: [] } } };
  const kept = { now: [], loaded: Promise.resolve(), watch: () => () => {} };
  const api = { get: async (path) => (path === "/api/gloves" ? gloves : []) };
  mount(document.body, api, { record, kept, go: () => {} });
}"""


def glove(path: str, hand: str | None, description: str, in_use: bool = False) -> dict[str, Any]:
    return {
        "path": path,
        "hand": hand,
        "description": description,
        "in_use": in_use,
        "virtual": hand is not None,
    }


def proposed(browser: Browser, language: str, hand: str, gloves: list[dict[str, Any]]) -> Any:
    context = browser.new_context(locale=language)
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.evaluate(PROPOSED, [hand, gloves])
    found = page.locator("input[name=glove]:checked").input_value()
    context.close()
    return found


@pytest.mark.parametrize("language", languages())
def test_the_glove_of_the_hand_is_proposed(browser: Browser, language: str) -> None:
    told = languages()[language].translate
    gloves = [glove(side, side, told(f"virtual {side} glove")) for side in ("left", "right")]
    for hand in ("left", "right"):
        assert proposed(browser, language, hand, gloves) == hand
    assert (
        proposed(browser, language, "right", [gloves[0], glove("/dev/tty", None, "port")])
        == "/dev/tty"
    )


ENTERED = """async ([module, about, field, typed]) => {
  const { mount } = await import(module);
  const [sent, unanswered] = [[], new Promise(() => {})];
  const api = { get: async (path) => (path === "/api/gloves" ? [{ path: "left", hand: "left", description: "left" }] : []), post: (...body) => (sent.push(body), unanswered) };
  const record = { now: { id: 1, affected_hand: "left", sessions: [], clock: { now: new Date().toISOString(), doubts: [] } } };
  const kept = { now: [], loaded: Promise.resolve(), watch: () => () => {} };
  mount(document.body, api, { record, kept, go: () => {}, send: (reason) => (sent.push(reason), unanswered), cancel: () => sent.push("cancelled"), ...about });
  await new Promise((drawn) => setTimeout(drawn, 50));
  if (field === "port") document.querySelector("input[name=glove][value='?']").click();
  const input = document.querySelector(`input[name=${field}]`);
  input.focus();
  input.value = typed;
  window.sent = sent;
}"""


@pytest.mark.parametrize(
    ("module", "about", "field", "sent"),
    [
        ("/static/patient/new_session.js", {}, "examiner", {"port": "left", "examiner": "A"}),
        ("/static/patient/new_session.js", {}, "port", {"port": "A", "examiner": ""}),
        ("/static/station/confirming.js", {"act": "skip"}, "reason", "A"),
        ("/static/station/confirming.js", {"act": "unable"}, "reason", "A"),
    ],
)
def test_enter_in_a_text_field_does_once_what_the_steps_main_button_does(
    browser: Browser, module: str, about: dict[str, Any], field: str, sent: Any
) -> None:
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.evaluate(ENTERED, [module, about, field, "A"])
    for _ in range(2):  # once too often
        page.keyboard.press("Enter")
        page.wait_for_function("sent.length > 0")
    (found,) = page.evaluate("sent")
    page.close()
    if isinstance(sent, str):
        assert found == sent
    else:
        assert {key: found[1][key] for key in sent} == sent
