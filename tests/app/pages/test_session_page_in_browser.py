"""What is typed and not saved is there again when the person comes back; leaving the document with it is asked about."""

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
