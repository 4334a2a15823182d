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


WIDTHS = """async (texts) => {
  const { widening } = await import("/static/plots/axis_width.js");
  const ctx = document.createElement("canvas").getContext("2d");
  const [size, u] = [widening(76), { ctx, axes: [{ font: ["14px Inter"] }] }];
  const widths = texts.map((text) => size(u, [text], 0));
  ctx.font = "14px Inter";
  return [widths, texts.map((text) => ctx.measureText(text).width)];
}"""


def test_an_axis_is_as_wide_as_its_longest_text_and_never_narrower_again(browser: Browser) -> None:
    page = browser.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    widths, texts = page.evaluate(WIDTHS, ["0°", "10° hinter Handebene", "0°"])
    page.close()
    assert widths[0] == 76 and widths[2] == widths[1] > texts[1] + 5
