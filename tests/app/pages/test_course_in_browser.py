"""A figure's small plot over the sessions: its axis spans the measurement error round the value compared with, and no two ticks read the same."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
DRAW = """async ([series, mdc95]) => {
  const written = [];
  const draws = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y, ...more) {
    written.push({ text, y, height: this.canvas.height, align: this.textAlign });
    return draws.call(this, text, x, y, ...more);
  };
  const { drawSmall } = await import("/static/progress/small.js");
  document.body.style.width = "20rem";
  document.body.innerHTML = "<div></div>";
  const days = ["2026-05-12T09:00:00Z", "2026-06-12T09:00:00Z"];
  const sessions = { left: days.map((started, session) => ({ session, started })) };
  const payload = { sessions, judges: [{ mdc95 }], treatment_events: [] };
  drawSmall(document.querySelector("div"), payload, series, { hand: "left", against: "first" }, {});
  for (let k = 0; k < 40 && !written.length; k += 1) await new Promise((done) => setTimeout(done, 50));
  return written.filter(({ align }) => align === "right");
}"""  # the words beside the y axis end at it
RATE = {"name": "tapping_rate", "label": "Rate", "unit": "per s", "decimals": 2, "joint": ""}
TAPS = {"name": "taps", "label": "Taps", "unit": "", "decimals": 0, "joint": ""}
BENT = {"name": "index_pip_flexion_max", "label": "", "unit": "deg", "decimals": 0, "joint": "index_pip", "angle": "flexion", "end": "largest"}  # fmt: skip


@pytest.mark.parametrize(
    ("figure", "first", "now", "mdc95"),
    [
        (RATE, 2.5, 2.504, 1.26),  # that hardly changed
        (RATE, 2.5, 2.504, None),
        (TAPS, 36, 37, 0.4),  # the error less than one
        (BENT, 82.0, 82.3, 12.0),
        (BENT, 40.0, 96.0, 12.0),
    ],
)
def test_an_axis_spans_the_measurement_error_and_no_tick_is_written_twice(
    browser: Browser, figure: dict[str, Any], first: float, now: float, mdc95: float | None
) -> None:
    points = [[0, first, None, None], [1, now, False, False]]
    hands = {"left": {"judge": 0, "points": points}}
    series = {"goals": {}, "reference": None, "finger": "", **figure, "hands": hands}
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.add_style_tag(url=f"{SITE}/static/styles/session.css")
    page.set_default_timeout(10_000)
    ticks = page.evaluate(DRAW, [series, mdc95])
    page.close()
    by_words = {tick["text"]: tick["y"] for tick in ticks}
    assert len(by_words) >= 2
    assert len({tick["y"] for tick in ticks}) == len(by_words)
    (a, at_a), *_, (b, at_b) = sorted(by_words.items(), key=lambda one: one[1])
    high, low = (float(words.rstrip("°")) for words in (a, b))
    per_px = (high - low) / (at_b - at_a)
    top, bottom = 10, ticks[0]["height"] - 30  # px of the canvas in which the lines are drawn
    spanned = [low - (bottom - at_b) * per_px, high + (at_a - top) * per_px]
    margin = mdc95 if mdc95 is not None else 0.1 * first
    assert spanned[0] <= first - margin and spanned[1] >= first + margin
    assert spanned[0] <= now <= spanned[1]


BACK = {"name": "wrist_flexion_min", "label": "", "unit": "deg", "decimals": 0, "joint": "wrist", "angle": "flexion", "end": "smallest"}  # fmt: skip


def test_more_extension_is_further_up(browser: Browser) -> None:
    """Extension is negative in the angle, but its sizes are what is read."""
    points = [[0, -29.0, None, None], [1, -42.0, True, True]]
    hands = {"left": {"judge": 0, "points": points}}
    series = {"goals": {}, "reference": None, "finger": "", **BACK, "hands": hands}
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.add_style_tag(url=f"{SITE}/static/styles/session.css")
    ticks = page.evaluate(DRAW, [series, 12.0])
    page.close()
    sizes = [float(t["text"].rstrip("°")) for t in sorted(ticks, key=lambda one: one["y"])]
    assert len(sizes) >= 2 and sizes == sorted(sizes, reverse=True)


FILLED = """() => {
  window.filled = [];
  const fills = CanvasRenderingContext2D.prototype.fillRect;
  CanvasRenderingContext2D.prototype.fillRect = function (x, y, w, h) {
    if (Math.abs(h) > 3) window.filled.push({ style: this.fillStyle, alpha: this.globalAlpha });
    return fills.call(this, x, y, w, h);
  };
}"""


def test_a_goal_is_seen_within_the_band_of_measurement_error(browser: Browser) -> None:
    points = [[0, 40.0, None, None], [1, 60.0, True, True]]
    hands = {"left": {"judge": 0, "points": points}}
    goals = {"left": {"low": 42.0, "high": 48.0}}
    series = {"reference": None, "finger": "", **BENT, "hands": hands, "goals": goals}
    page = browser.new_page(locale="en")
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    page.add_style_tag(url=f"{SITE}/static/styles/session.css")
    page.add_style_tag(content=":root { --good-soft: #e1f3e8; --surface-sunk: #eaeef2; }")
    page.evaluate(FILLED)
    page.evaluate(DRAW, [series, 12.0])
    filled = page.evaluate("window.filled")
    page.close()
    band, goal = filled[:2]
    assert (band["style"], goal["style"]) == ("#eaeef2", "#e1f3e8")
    assert goal["alpha"] < 1  # so that the band is seen, too
