"""The review of a trial on the page: what its rows, headings and curves say, and that it is drawn once."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
MOUNT = """async () => {
  const { mount } = await import("/static/station/trial.js");
  document.body.innerHTML = `<div class="strip"></div><div class="panel"><div class="trial-review"></div><button>Yes</button></div>`;
  const listeners = new Set();
  window.answers = [];
  const api = { get: () => new Promise((done) => window.answers.push(done)) };
  const station = { name: "s", latest: {}, on: (_, listener) => (listeners.add(listener), () => listeners.delete(listener)) };
  mount(document.querySelector(".trial-review"), api, { station, strip: document.querySelector(".strip") });
  window.tell = (full) => {
    station.latest = { replaying: false, ...full };
    listeners.forEach((listener) => listener(station.latest));
  };
}"""
FINGERS = ("index", "middle", "ring", "little")
REVIEW: dict[str, Any] = {
    "onset": 10.0,
    "end": 12.0,
    "curve": "index_pip_flexion",
    "t": [10.0, 11.0, 12.0],
    "curves": [{"what": f"{f}_pip_flexion", "values": [0, 90, 22]} for f in FINGERS],
    "marks": [11.0],
    "figures": [
        {"label": "Index PIP, flexion", "grade": "good", "end": "max", "value": "90°"}
        | {"sd": "2°", "last": None, "other": None}
    ],
    "fingers": [{"finger": f, "what": f"{f}_pip_flexion", "value": 90.0} for f in FINGERS],
    "problem": None,
    "taps": None,
}


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.route(f"{SITE}/**/*.svg", lambda route: route.fulfill(body="<svg/>"))
    page.goto(SITE)
    for style in ("style.css", "styles/station.css", "styles/scene.css"):
        page.add_style_tag(url=f"{SITE}/static/{style}")
    page.evaluate(MOUNT)
    yield page
    context.close()


def _tell(page: Page, trial: int, state: str = "task_review") -> None:
    page.evaluate("(full) => window.tell(full)", {"trial": trial, "wizard": {"state": state}})


def _answer(page: Page, number: int) -> None:
    page.wait_for_function("(n) => window.answers.length > n", arg=number)
    page.evaluate("([n, review]) => window.answers[n](review)", [number, REVIEW])


def test_a_row_has_its_own_words_and_the_joint_stands_above_all_fingers(page: Page) -> None:
    _tell(page, 1)
    _answer(page, 0)
    expect(page.get_by_role("rowheader")).to_have_text(["Index PIP, flexion"])
    expect(page.locator(".frozen h3")).to_have_text("PIP: flexion and extension")
    expect(page.locator(".trial-review h3")).to_have_text("How far each finger went (PIP)")


def test_a_review_that_is_asked_for_twice_is_drawn_once(page: Page) -> None:
    """The review goes and comes while its first answer is still on its way."""
    for trial in (1, 0, 1):
        _tell(page, trial)
    for number in (0, 1):
        _answer(page, number)
    expect(page.locator(".frozen .uplot")).to_have_count(1)
    expect(page.locator(".frozen h3")).to_have_count(1)


def test_buttons_keep_their_place_while_a_trial_is_checked(page: Page) -> None:
    button = page.get_by_role("button", name="Yes")
    _tell(page, 0)
    expect(page.get_by_text("Checking the trial…")).to_be_visible()
    before = button.bounding_box()
    _tell(page, 1)
    _answer(page, 0)
    expect(page.get_by_text("Nothing speaks against it")).to_be_visible()
    assert button.bounding_box() == before


def test_a_trial_that_could_not_be_checked_is_not_waited_for(page: Page) -> None:
    _tell(page, 1)
    page.wait_for_function("window.answers.length")
    page.evaluate("window.answers[0](null)")
    expect(page.get_by_text("This trial could not be checked")).to_be_visible()


def test_nothing_is_checked_before_a_trial_ends(page: Page) -> None:
    _tell(page, 0, "task_running")
    expect(page.locator(".trial-review")).to_be_hidden()
