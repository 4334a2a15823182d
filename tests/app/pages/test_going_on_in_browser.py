"""The button that goes on is in sight without scrolling, however long the panel is above it: on a wide screen, a tablet and a phone."""

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
STYLES = ("styles/frame.css", "styles/scene.css")
MOUNT = """async () => {
  const [score, actions] = await Promise.all(["score", "actions"].map((part) => import(`/static/station/${part}.js`)));
  const asked = { title: "MDS-UPDRS 3.4", least: 0, most: 4, hint: "After the patient's worse hand." };
  const wizard = { state: "task_review", actions: ["accept", "again", "skip", "unable"], tasks: [], calibration_steps: [], pace: { trial: 1 }, remaining: null, score: asked };
  const latest = { wizard, glove: { problem: null }, self_calibration: null };
  const station = { latest, on: (what, draw) => (draw(latest), () => {}), act: () => null };
  document.body.className = "station";
  document.body.innerHTML = `<header class="top"></header><main><div class="workplace">
    <div class="view"><div class="scene"></div><div class="strip reviewing"><div class="frozen"></div></div></div>
    <div class="panel"><div class="guidance"><h2>Keep this one?</h2>${"<p>What was measured.</p>".repeat(30)}</div>
    <div class="score"></div><div class="actions"></div><section>${"<p>Joints</p>".repeat(20)}</section></div></div></main><footer class="bottom">Research use</footer>`;
  const about = { station, given: { score: null } };
  score.mount(document.querySelector(".score"), {}, about);
  actions.mount(document.querySelector(".actions"), {}, about);
  document.querySelector(".panel").scrollTop = 0; // as a page does with each step
  scrollTo(0, 0);
}"""
PLACES = """() => [...document.querySelectorAll(".actions button")].map((b) => [b.classList.contains("primary"), b.getBoundingClientRect().top, b.getBoundingClientRect().bottom])"""
TO_THE_END = (
    """() => { document.querySelector(".panel section").scrollIntoView({ block: "end" }); }"""
)


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1024, 768), (390, 844)])
def test_the_button_that_goes_on_is_in_sight(browser: Browser, width: int, height: int) -> None:
    context = browser.new_context(viewport={"width": width, "height": height})
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    for style in STYLES:
        page.add_style_tag(url=f"{SITE}/static/{style}")
    page.evaluate(MOUNT)
    before = page.evaluate(PLACES)
    page.evaluate(TO_THE_END)
    after = page.evaluate(PLACES)
    context.close()
    primary = [(top, bottom) for is_primary, top, bottom in before if is_primary]
    assert len(before) == 4 and len(primary) == 1
    assert primary[0][0] >= 0 and primary[0][1] <= height
    rows = sorted((top, bottom) for _, top, bottom in after)  # with the list's end in sight
    assert all(upper[1] <= lower[0] for upper, lower in zip(rows, rows[1:])), rows
