"""The tones of a task: when each is due, by a clock that is passed in; sound itself is listened to in the metronome's test."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
PLAY = """async (messages) => {
  const { makeCueTones } = await import("/static/station/cue_tones.js");
  const tones = [];
  let time = 0;
  let silenced = 0;
  const clicks = { tone: (wait, hertz) => tones.push([time + wait, hertz]), silence: () => (silenced += 1) };
  const cues = makeCueTones(clicks, () => time);
  for (const [at, stage, remaining] of messages) {
    time = at;
    cues.take(stage, remaining);
  }
  return { tones: tones.map(([at, hertz]) => [Math.round(10 * at) / 10, hertz]), silenced };
}"""
COUNT, START, STOP = 660, 990, [784, 523]


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context()
    one = context.new_page()
    one.route(f"{SITE}/**", serve)
    one.goto(SITE)
    yield one
    context.close()


def counting(begin: float, stop: float, stage: str, end: float) -> list[tuple[float, str, float]]:
    """Messages ten times a second from begin to stop (s) of a stage that ends at `end`."""
    ticks = range(round(10 * begin), round(10 * stop))
    return [(k / 10, stage, round(end - k / 10, 1)) for k in ticks]


def test_a_countdown_a_start_and_an_end_are_sounded_when_they_are_due(page: Page) -> None:
    whole = [*counting(0, 3, "count", 3), *counting(3, 8, "run", 8), (8.0, "", None)]
    played = page.evaluate(PLAY, whole)["tones"]
    assert played == [
        *([float(at), COUNT] for at in (0, 1, 2)),
        [3.0, START],
        [8.0, STOP[0]],
        [8.2, STOP[1]],
    ]


def test_a_task_that_is_stopped_early_sounds_its_end_at_once_and_a_cancelled_countdown_is_silent(
    page: Page,
) -> None:
    early = [*counting(0, 3, "count", 3), *counting(3, 5, "run", 8), (5.0, "", None)]
    assert page.evaluate(PLAY, early)["tones"][-2:] == [[5.0, STOP[0]], [5.2, STOP[1]]]
    untimed = [(0.0, "run", None), (4.0, "run", None), (4.5, "", None)]
    assert page.evaluate(PLAY, untimed)["tones"] == [[4.5, STOP[0]], [4.7, STOP[1]]]
    cancelled = page.evaluate(PLAY, [*counting(0, 1.5, "count", 3), (1.5, "", None)])
    assert (cancelled["tones"], cancelled["silenced"]) == ([[0.0, COUNT], [1.0, COUNT]], 1)
