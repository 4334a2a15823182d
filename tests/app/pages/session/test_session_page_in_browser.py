"""Parts of the page of a session: notes that are not saved, and where a session stands."""

import pytest
from playwright.sync_api import Browser, Page

from handscope.app.api.methods import list_methods
from handscope.app.language import languages
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


PRINTED = """() => {
  document.body.innerHTML = `<header class="top"></header><main><div class="beside results"><div class="stack">
    <section class="card"><button>Change</button><div class="plot"><div class="uplot"><div class="u-wrap" style="width: 1400px; height: 300px">
    <canvas width="1400" height="300"></canvas></div></div></div><span class="key key-band"></span></section></div></div></main>`;
  const [main, canvas] = ["main", "canvas"].map((part) => document.querySelector(part).getBoundingClientRect());
  const shown = (part) => getComputedStyle(document.querySelector(part)).display !== "none";
  return [shown(".top"), shown("button"), canvas.right <= main.right && canvas.width > 500, getComputedStyle(document.querySelector(".key")).printColorAdjust];
}"""


def styled_page(browser: Browser, width: int, height: int) -> Page:
    """An empty page of this size that looks as a session's."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    for style in ("style.css", "styles/frame.css", "styles/session.css"):
        page.add_style_tag(url=f"{SITE}/static/{style}")
    return page


def test_the_printed_page_has_no_controls_whole_plots_and_the_marks_of_its_legend(
    browser: Browser,
) -> None:
    page = styled_page(browser, 760, 1000)
    page.add_style_tag(content=".uplot canvas { display: block; width: 100%; height: 100%; }")
    page.emulate_media(media="print")
    assert page.evaluate(PRINTED) == [False, False, True, "exact"]
    page.close()


def test_a_long_code_without_spaces_stays_within_a_telephone(browser: Browser) -> None:
    page = styled_page(browser, 390, 844)
    code = "Ä" * 64
    page.evaluate(
        f"""document.body.innerHTML = `<main><div class="head"><div><p class="trail"><a href="/">{code}</a></p><h1>{code}</h1></div></div>
        <section class="card"><p>{code}</p><table class="rows"><tr><td><a href="/">{code}</a></td></tr></table></section></main>`"""
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.close()


AGAIN = """async ([methods, method]) => {
  const { mount } = await import("/static/session/reprocess.js");
  const sent = [];
  const api = { get: async () => methods, post: async (path, body) => (sent.push(body), { result: 2 }) };
  mount(document.body, api, { session: { id: 1 }, result: { method, parameters: {}, state: "done" }, go: () => {} });
  await new Promise((drawn) => setTimeout(drawn));
  const choice = document.querySelector("select[name=alignment]");
  const offered = [...choice.options].map((option) => [option.value, option.text]);
  const hint = choice.closest(".field").textContent;
  choice.value = "common";
  document.querySelector("form").requestSubmit();
  await new Promise((sent) => setTimeout(sent));
  return { offered, hint, sent };
}"""


@pytest.mark.parametrize("language", languages())
def test_offered_values_of_an_option_have_words_and_are_sent_by_their_names(
    browser: Browser, language: str
) -> None:
    words = languages()[language].words
    context = browser.new_context(locale=language)
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    found = page.evaluate(AGAIN, [list_methods(languages()[language]), "ekf"])
    context.close()
    offered = ["full", "common", "heading"]
    assert found["offered"] == [[value, words[f"choice.{value}"]] for value in offered]
    assert words["choice.full"] in found["hint"]
    assert found["sent"] == [{"method": "ekf", "options": {"alignment": "common"}}]


BY_FINGER = """(rows) => {
  document.body.innerHTML = `<main><section class="stack"><div class="card"><div class="scroll"><table class="ranges by-finger"><tbody>${rows}</tbody></table></div></div></section></main>`;
  return [...document.querySelectorAll("td, th")].flatMap((cell) =>
    [...cell.textContent.matchAll(/[^ ]+/g)].filter(({ 0: word, index }) => {
      const range = document.createRange();
      range.setStart(cell.firstChild, index);
      range.setEnd(cell.firstChild, index + word.length);
      return range.getClientRects().length > 1;
    }).map(({ 0: word }) => word));
}"""


def test_on_a_telephone_no_word_of_total_active_motion_is_broken(browser: Browser) -> None:
    page = styled_page(browser, 390, 844)
    cells = "<th>{}</th><td>{}</td><td>{}</td><td>gegenüber 260° (Norm)</td>"
    rows = [
        ("Zeigefinger", "237°, abzüglich Streckdefizit: PIP 1°", "100 % ausgezeichnet"),
        ("Ring", "237°, less extension deficit: PIP 1°", "91 % good"),
    ]
    table = "".join(f"<tr>{cells.format(*row)}</tr>" for row in rows)
    assert page.evaluate(BY_FINGER, table) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.close()
