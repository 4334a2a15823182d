"""The live curve: the band that a task's demonstration reaches lies in it, in sight from the start, and is gone with the task."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
DRAW = """async (targets) => {
  let filled = [];
  const fill = CanvasRenderingContext2D.prototype.fillRect;
  CanvasRenderingContext2D.prototype.fillRect = function (x, y, width, height) {
    filled.push({ y, height, colour: this.fillStyle });
    return fill.call(this, x, y, width, height);
  };
  const { mount } = await import("/static/station/live_curve.js");
  const { colour } = await import("/static/plots/plot.js");
  document.body.innerHTML = "<style>.plot { width: 30rem; height: 20rem }</style><section></section>";
  const listeners = { full: [], pulse: [] };
  const on = (what, listener) => listeners[what].push(listener);
  mount(document.querySelector("section"), {}, { station: { on } });
  const what = "index_pip_flexion";
  const found = [];
  for (const target of targets) {
    filled = [];
    listeners.full.forEach((listener) => listener({ curve: { what }, target }));
    listeners.pulse.forEach((listener) => listener({ what, points: [[found.length + 1, 4], [found.length + 1.5, 6]] }));
    for (let k = 0; k < 20; k += 1) await new Promise(requestAnimationFrame);
    const probe = document.createElement("canvas").getContext("2d");
    probe.fillStyle = colour("--good-soft");
    const canvas = document.querySelector("canvas");
    found.push({ band: filled.findLast((one) => one.colour === probe.fillStyle) ?? null, height: canvas.height });
  }
  return found;
}"""


def test_the_band_of_the_task_is_in_sight_and_goes_with_it(browser: Browser) -> None:
    page = browser.new_page()
    page.route("**/*", serve)
    page.goto(SITE)
    found: list[dict[str, Any]] = page.evaluate(DRAW, [None, [75.0, 85.0], [-35.0, -25.0], None])
    page.close()
    none, bent, stretched, gone = (one["band"] for one in found)
    assert none is None and gone is None
    height = found[0]["height"]
    for band in (bent, stretched):
        assert band["y"] >= 0 and band["height"] > 10 and band["y"] + band["height"] < height
    assert bent["y"] < 0.3 * height < stretched["y"]
