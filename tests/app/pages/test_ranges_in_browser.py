"""The table of joint ranges on a telephone: every word of it in sight, none beyond the edge; on a wide screen it stays a table."""

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
STYLES = ("colors.css", "style.css", "styles/frame.css", "styles/session.css")
MOUNT = """async (cells) => {
  const { mount } = await import("/static/session/ranges.js");
  const row = { group: "Pouce", joint: "CMC", grade: "good", reasons: [], changes: {}, ...cells };
  const readings = { ranges: [{ full: true, tasks: ["Poing"], rows: [row, { ...row, sideways: "" }] }], tapping: [], others: [], changes: { since: "2026-07-24T08:32:00Z", sources: { range_of_motion: [] } } };
  const main = document.createElement("main");
  document.body.replaceChildren(main);
  mount(main, null, { result: { readings } });
}"""
CELLS = {
    "flexion": "42° ± 1,6°",
    "extension": "jusqu’au plan palmaire",
    "sideways": "10° à 45° abd. radiale",
    "changes": {"sideways": "abd. radiale inchangé ; add. 1° de moins, en deçà de la MDC"},
}
SEEN = """() => [...document.querySelectorAll("td, th")].filter((cell) => getComputedStyle(cell).clipPath === "none").map((cell) => {
  const [inner, outer] = [document.createRange(), cell.closest(".scroll").getBoundingClientRect()];
  inner.selectNodeContents(cell);
  return inner.getBoundingClientRect().right <= outer.right + 1 && cell.scrollWidth <= cell.clientWidth + 1;
})"""


@pytest.mark.parametrize(("width", "cells"), [(390, 7), (1024, 15)])
def test_no_word_of_the_joint_ranges_is_beyond_the_edge(
    browser: Browser, width: int, cells: int
) -> None:
    context = browser.new_context(locale="fr", viewport={"width": width, "height": 844})
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    for style in STYLES:
        page.add_style_tag(url=f"{SITE}/static/{style}")
    page.evaluate(MOUNT, CELLS)
    seen = page.evaluate(SEEN)
    context.close()
    assert all(seen) and len(seen) >= cells, seen
