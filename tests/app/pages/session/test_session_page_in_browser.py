"""Parts of the page of a session: notes that are not saved, and where a session stands."""

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
SESSION = '{ record: { now: { id: 7, notes: "", examiner: "", conclusion: "", pain_rest: null, pain_movement: null } } }'
PATIENT = "{ record: { now: { id: 7, notes: [] } } }"
TYPED = """async ([part, about]) => {
  const { mount } = await import(`/static/${part}/notes.js`);
  const asks = () => !dispatchEvent(new Event("beforeunload", { cancelable: true }));
  const open = () => {
    const place = document.createElement("section");
    document.body.replaceChildren(place);
    const leave = mount(place, {}, eval(`(${about})`));
    return [place.querySelector("textarea"), leave];
  };
  const [text, leave] = open();
  const before = asks();
  text.value = "no pain";
  text.dispatchEvent(new Event("input"));
  leave();
  return [before, open()[0].value, asks()];
}"""


@pytest.mark.parametrize(("part", "about"), [("session", SESSION), ("patient", PATIENT)])
def test_unsaved_notes_stay_and_leaving_with_them_is_asked_about(
    browser: Browser, part: str, about: str
) -> None:
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    assert page.evaluate(TYPED, [part, about]) == [False, "no pain", True]
    page.close()


STANDS = """async (saving) => {
  const { mount } = await import("/static/session/progress.js");
  const leave = mount(document.body, {}, { session: { state: "open", station: null, saving, recordings: [] }, reload: () => {} });
  leave();
  return document.querySelector("h2").textContent;
}"""


@pytest.mark.parametrize(
    ("saving", "words"),
    [(True, "Saving the recording…"), (False, "This session is still being recorded")],
)
def test_a_session_that_was_finished_is_being_saved(
    browser: Browser, saving: bool, words: str
) -> None:
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    assert page.evaluate(STANDS, saving) == words
    page.close()
