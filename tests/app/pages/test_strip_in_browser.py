"""The strip below the scene on a telephone: the curve has the whole width, whatever numbers stand beside it on a wide screen."""

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
STRIP = """([first, second]) => {
  document.body.innerHTML = `<div class="strip"><div class="${first}"><h3>Index IPP</h3></div><div class="${second}"><dl></dl></div></div>`;
  document.querySelector("dl").innerHTML = "<div><dt>Minimum</dt><dd>1° hyperext.</dd></div>".repeat(3);
}"""


@pytest.mark.parametrize("curve", ["curve", "frozen"])
@pytest.mark.parametrize(("width", "least"), [(390, 340), (1024, 600)])
def test_the_curve_has_room_beside_or_above_the_numbers(
    browser: Browser, curve: str, width: int, least: int
) -> None:
    context = browser.new_context(viewport={"width": width, "height": 844})
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.add_style_tag(url=f"{SITE}/static/styles/scene.css")
    page.evaluate(STRIP, [curve, "numbers"])
    boxes = [page.locator(f".{name}").bounding_box() for name in (curve, "numbers")]
    context.close()
    assert boxes[0] and boxes[1]
    assert boxes[0]["width"] >= least and boxes[0]["height"] >= 120
    assert boxes[1]["x"] + boxes[1]["width"] <= width
