"""A session that runs is said on its patient's page, above everything else."""

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
LINKS = """async (patient) => {
  const { mount } = await import("/static/patient/unfinished.js");
  const of = (id) => ({ id, station: `s${id}`, started: "2026-05-12T09:00:00Z", patient: { id, pseudonym: `P-${id}` } });
  const { leave, said } = mount(document.body, { get: async () => [of(1), of(2)] }, ...patient);
  await said;
  leave();
  return [...document.querySelectorAll("a")].map((a) => a.getAttribute("href"));
}"""


def test_a_patients_page_names_their_own_sessions_and_the_list_names_all(browser: Browser) -> None:
    page = browser.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    assert page.evaluate(LINKS, [2]) == ["/stations/s2"]
    assert page.evaluate(LINKS, []) == ["/stations/s1", "/stations/s2"]
    page.close()
