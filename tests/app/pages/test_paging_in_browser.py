"""The audit trail in pages, while new lines come in."""

import pytest
from playwright.sync_api import Browser, expect

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
MOUNT = """async () => {
  const { mount } = await import("/static/pages/audit.js");
  let newest = 230;
  const line = (id) => ({ id, at: "2026-05-12T09:00:00Z", who: `who ${id}`, what: "read", kind: "", ref: "", patient: null, address: "", counts: {} });
  const some = (path) => {
    const asked = new URL(path, location.href).searchParams;
    newest += 1; // asking is a line of its own
    const first = Number(asked.get("before") ?? newest + 1) - 1;
    const rows = Array.from({ length: Math.min(first, Number(asked.get("limit"))) }, (_, k) => line(first - k));
    return Promise.resolve({ rows, total: newest });
  };
  document.body.innerHTML = "<main></main>";
  mount(document.querySelector("main"), { some, get: () => Promise.resolve([]) }, { title: () => {} });
}"""


def test_pages_of_the_trail_follow_each_other_without_a_gap(browser: Browser) -> None:
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.evaluate(MOUNT)
    lines = page.locator("tbody tr")
    older, newer = (page.get_by_role("button", name=n) for n in ("Further down", "Earlier in"))

    def shows(first: int, last: int, where: str) -> None:
        expect(page.get_by_text(where)).to_be_visible()
        expect(lines.first).to_contain_text(f"who {first}")
        expect(lines.last).to_contain_text(f"who {last}")

    shows(231, 132, "1 to 100 of 231")
    expect(newer).to_be_disabled()
    older.click()
    shows(131, 32, "101 to 200 of 232")
    older.click()
    shows(31, 1, "201 to 231 of 233")
    newer.click()
    shows(131, 32, "101 to 200 of 234")
    page.close()
