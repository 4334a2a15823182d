"""The sessions of a simulated patient that a demonstration makes still: how many are there is said, and they appear by themselves."""

import pytest
from playwright.sync_api import Browser, expect

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
MOUNT = """async () => {
  const { mount } = await import("/static/patient/visits.js");
  const session = (id) => ({ id, hand: "left", state: "processed", started: "2026-05-12T09:00:00Z", source: "upload", tasks: [], doubts: [], warnings: 0 });
  const answers = [[1, 2], new Error("the server is away"), [2, 0]].map((a) => () => {
    if (a instanceof Error) return Promise.reject(a);
    return Promise.resolve({ sessions: Array.from({ length: a[0] }, (_, k) => session(k + 1)), planned: a[1] });
  });
  const record = { now: { sessions: [], planned: 2 }, stored: () => answers.shift()() };
  document.body.innerHTML = "<section></section>";
  const api = { titles: () => Promise.resolve(new Map()) };
  mount(document.querySelector("section"), api, { record, go: (address) => (window.gone = address) });
}"""


def test_sessions_to_come_are_counted_and_appear_by_themselves(browser: Browser) -> None:
    page = browser.new_page(locale="en")
    page.clock.install(time=0)
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.evaluate(MOUNT)
    bar, sessions = page.get_by_role("progressbar"), page.locator(".visits > li")
    expect(page.get_by_text("are being made: 0 of 2")).to_be_visible()
    expect(page.get_by_text("No sessions yet")).to_have_count(0)
    page.clock.run_for(4_000)
    expect(page.get_by_text("are being made: 1 of 2")).to_be_visible()
    expect(bar).to_have_attribute("aria-valuenow", "50")
    expect(sessions).to_have_count(1)
    page.clock.run_for(4_000)  # what could not be asked
    expect(sessions).to_have_count(1)
    page.clock.run_for(4_000)
    expect(sessions).to_have_count(2)
    expect(bar).to_be_hidden()
    page.get_by_role("button", name="Show how they went").click()
    assert page.evaluate("window.gone") == "/"
    page.close()
