"""The metronome in a real browser, led by the wizard itself with time passed in: the page's clock is held, messages come late, sound is listened to."""

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from handscope import static
from handscope.app.api import languages
from handscope.app.live.wizard import machine as wizard
from handscope.app.live.wizard.machine import Action, State, StationStatus, Wizard
from handscope.app.live.wizard.snapshot import wizard_snapshot
from tests.app.live.wizard.test_machine import READY, at, later
from tests.app.scene.small_site import eventually

pytestmark = pytest.mark.browser
ROOT = Path(static.__file__).parent
SITE = "http://handscope.test"
KINDS = {
    ".js": "text/javascript",
    ".css": "text/css",
    ".woff2": "font/woff2",
    ".svg": "image/svg+xml",
}
DOCUMENT = """<!doctype html><link rel="stylesheet" href="/static/colors.css"><link rel="stylesheet" href="/static/style.css">
<link rel="stylesheet" href="/static/styles/station.css"><div class="scene"><div class="metronome"></div></div>"""
STEP = 0.1  # s between two messages
PICTURE = 17  # ms
MOUNT = """async () => {
  const { mount } = await import("/static/station/metronome.js");
  const listeners = new Set();
  const on = (what, listener) => (listeners.add(listener), () => listeners.delete(listener));
  window.leave = mount(document.querySelector(".metronome"), {}, { station: { on } });
  window.tell = (full) => listeners.forEach((listener) => listener(full));
}"""
LISTEN = """() => {
  window.contexts = [];
  window.AudioContext = class extends AudioContext {
    constructor(options) {
      super(options);
      window.contexts.push(this);
    }
  };
  window.clicks = [];
  window.takenBack = 0;
  const { start, stop } = OscillatorNode.prototype;
  OscillatorNode.prototype.start = function (at) {
    const heard = at + (this.context.outputLatency || 0);
    window.clicks.push([performance.now() / 1000 + heard - this.context.currentTime, this.frequency.value]);
    return start.call(this, at);
  };
  OscillatorNode.prototype.stop = function (...at) {
    if (!at.length) window.takenBack += 1;
    return stop.call(this, ...at);
  };
}"""

BLOCK = """() => {
  let pressed = false;
  addEventListener("pointerdown", () => (pressed = true), true);
  const state = Object.getOwnPropertyDescriptor(BaseAudioContext.prototype, "state");
  Object.defineProperty(BaseAudioContext.prototype, "state", { get() { return pressed ? state.get.call(this) : "suspended"; } });
}"""  # as a browser does with a page on which nothing was pressed; what a test evaluates there counts as a press


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """The metronome alone on a page whose clock stands still."""
    context = browser.new_context(viewport={"width": 1024, "height": 768})
    one = context.new_page()
    complaints: list[str] = []
    one.on("pageerror", lambda error: complaints.append(str(error)))
    one.route(f"{SITE}/**", serve)
    opened(one)
    yield one
    one.evaluate("leave()")
    context.close()
    assert complaints == []


def serve(route: Route) -> None:
    path = route.request.url.removeprefix(SITE)
    if path.startswith("/languages/"):
        is_names = path.endswith("/names.js")
        text = languages.names_module() if is_names else languages.words_module(Path(path).stem)
        route.fulfill(body=text, content_type=KINDS[".js"])
    elif path.startswith("/static/"):
        file = ROOT / path.removeprefix("/static/")
        route.fulfill(body=file.read_bytes(), content_type=KINDS[file.suffix])
    else:
        route.fulfill(body=DOCUMENT, content_type="text/html")


def opened(page: Page) -> None:
    page.clock.install(time=0)
    page.goto(SITE)
    page.clock.pause_at(1000)
    page.evaluate(LISTEN)
    page.evaluate(MOUNT)


@dataclass
class Session:
    """The wizard and its page, going through time together; what is told travels for a while."""

    page: Page
    wizard: Wizard
    status: StationStatus = READY
    flowing: bool = True
    late: float = 0.0  # s that messages travel at most
    counted: float | None = None

    def __post_init__(self) -> None:
        self._dice = random.Random(5)
        self._offset: float = self.page.evaluate("performance.now() / 1000") - self.status.now
        self._ahead = (
            0  # ms that the page's clock is ahead of the wizard's: a message was on its way
        )
        self._tell()
        self._draw()

    def act(self, what: Action, **more: str) -> None:
        self.wizard, _ = wizard.act(self.wizard, what, self.status, **more)
        self._tell()
        self._draw()

    def passes(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            way = round(1000 * self._dice.uniform(0.0, self.late))
            self.page.clock.run_for(round(1000 * STEP) - self._ahead + way)
            self._ahead = way
            self.status = later(self.status, STEP, flowing=self.flowing)
            self.wizard, _ = wizard.tick(self.wizard, self.status)
            self._tell()
        self._draw()

    def clicks(self) -> list[tuple[float, float]]:
        """When each is heard by the wizard's clock, s, and its pitch, Hz."""
        return [(due - self._offset, pitch) for due, pitch in self.page.evaluate("clicks")]

    def _tell(self) -> None:
        """A message arrives."""
        numbers = (
            []
            if self.counted is None
            else [{"name": "repetitions", "value": self.counted, "unit": ""}]
        )
        message = {
            "wizard": wizard_snapshot(self.wizard, self.status),
            "glove": {"flowing": self.flowing},
            "numbers": numbers,
        }
        self.page.evaluate("(full) => tell(full)", message)

    def _draw(self) -> None:
        """A picture of the screen."""
        self.page.clock.run_for(PICTURE)
        self._ahead += PICTURE


def ready(page: Page, task: str, late: float = 0.0) -> Session:
    """The task is about to start, and the browser gives sound."""
    session = Session(page, at(State.TASK_READY, task=task), late=late)
    eventually(
        lambda: page.evaluate("contexts.every((audio) => audio.state === 'running')")
    )  # in real time, which the page has not
    return session


def lamp(page: Page) -> str:
    return page.locator(".beat").inner_text().replace("\n", " ")


def test_it_clicks_on_every_beat_of_the_servers_time_and_counts_the_movements(page: Page) -> None:
    session = ready(page, "powerglove_01_index_mcp", late=0.08)
    expect(page.locator(".metronome .count")).to_have_text("0 of 10")
    session.act(Action.START)
    session.passes(3.1)
    onset = session.wizard.onset - session.status.t + session.status.now
    assert session.wizard.state is State.TASK_RUN
    session.passes(8.3)
    assert (lamp(page), page.locator(".metronome .count").inner_text()) == ("Bend", "5 of 10")
    session.passes(1.0)
    assert lamp(page) == "Straighten"
    session.passes(11.0)
    assert session.wizard.state is State.TASK_REVIEW
    expect(page.locator(".metronome")).to_be_hidden()
    due, pitch = zip(*session.clicks())
    assert due == pytest.approx([onset + k for k in range(20)], abs=0.03)  # s
    assert [p == max(pitch) for p in pitch] == [True, False] * 10


def test_the_lamp_is_bright_when_a_beat_is_due_and_dark_between(page: Page) -> None:
    session = ready(page, "powerglove_01_index_mcp")
    session.act(Action.START)
    session.passes(3.1)
    bright = []
    for _ in range(20):
        session.passes(STEP)
        bright.append("bright" in (page.locator(".beat").get_attribute("class") or ""))
    assert [k for k in range(20) if bright[k]] == [
        8,
        9,
        18,
        19,
    ]  # looked at 0.2 s after the onset first


def test_long_phases_have_a_countdown_of_their_own(page: Page) -> None:
    session = ready(page, "repeatability_mould")
    session.act(Action.START)
    session.passes(3.1 + 2.4)
    assert lamp(page) == "Clench 4"
    session.passes(6.0)
    assert (lamp(page), page.locator(".metronome .count").inner_text()) == ("Open 4", "1 of 10")
    session.passes(6.0)
    assert (lamp(page), page.locator(".metronome .count").inner_text()) == ("Clench 4", "2 of 10")


def test_stopping_early_takes_back_the_clicks_that_were_made_ready(page: Page) -> None:
    session = ready(page, "powerglove_01_index_mcp")
    session.act(Action.START)
    session.passes(5.5)
    session.act(Action.STOP)
    before = len(session.clicks())
    session.passes(3.1)
    assert len(session.clicks()) == before
    assert page.evaluate("takenBack") >= 1  # those of the second to come


def test_it_is_silent_while_the_glove_is(page: Page) -> None:
    session = ready(page, "powerglove_01_index_mcp")
    session.act(Action.START)
    session.passes(5.5)
    session.flowing = False
    session.passes(0.2)
    before = len(session.clicks())
    session.passes(2.0)
    assert len(session.clicks()) == before


def test_sound_can_be_switched_off_and_stays_off(page: Page) -> None:
    session = ready(page, "powerglove_01_index_mcp")
    switch = page.get_by_role("button", name="Sound is on")
    switch.click()
    expect(page.get_by_role("button", name="Sound is off")).to_have_attribute(
        "aria-pressed", "false"
    )
    session.act(Action.START)
    session.passes(6.0)
    assert session.clicks() == []
    assert lamp(page) in ("Bend", "Straighten")  # the light goes on
    opened(page)
    ready(page, "powerglove_01_index_mcp")
    page.get_by_role("button", name="Sound is off").click()
    expect(page.get_by_role("button", name="Sound is on")).to_be_visible()


def test_blocked_sound_is_said_and_the_light_goes_on_until_a_press_brings_it(page: Page) -> None:
    page.evaluate(BLOCK)
    session = Session(page, at(State.TASK_READY, task="powerglove_01_index_mcp"))
    session.passes(1.0)
    expect(page.get_by_role("status")).to_have_text(
        "The browser blocks the sound until you press somewhere on this page."
    )
    session.act(Action.START)
    session.passes(4.5)
    assert (session.clicks(), lamp(page)) == ([], "Straighten")
    page.locator(".beat").click()
    session.passes(3.1)
    assert len(session.clicks()) >= 2
    expect(page.get_by_role("status")).to_be_hidden()


def test_after_a_pause_it_goes_on_with_the_phase_that_the_pause_broke_off(page: Page) -> None:
    session = ready(page, "kapandji")
    session.act(Action.START)
    session.passes(3.0 + 7.0)  # in the third position
    session.act(Action.PAUSE)
    session.passes(5.0)
    session.act(Action.RESUME)
    before = len(session.clicks())
    session.passes(1.5)
    assert (lamp(page), page.locator(".metronome .count").inner_text()) == (
        "3 index tip",
        "2 of 10",
    )
    session.passes(1.7)
    goes_on = session.wizard.pauses[0][1] - session.status.t + session.status.now
    assert (lamp(page).split()[0], page.locator(".metronome .count").inner_text()) == (
        "3",
        "3 of 10",
    )
    session.passes(4.5)
    due = [t for t, _ in session.clicks()[before:]]
    assert due == pytest.approx(
        [goes_on + 3 * k for k in range(2)], abs=0.03
    )  # positions 3 and 4; the next is not due within a second


def test_a_task_at_free_speed_counts_what_is_seen_and_needs_no_metronome(page: Page) -> None:
    session = Session(
        page, at(State.TASK_RUN, task="powerglove_15_index_circles", onset=READY.t), counted=0
    )
    session.counted = 7
    session.passes(0.2)
    expect(page.locator(".metronome .count")).to_have_text("7 of 10")
    expect(page.locator(".beat")).to_be_hidden()
    expect(page.locator(".sound")).to_be_hidden()


@pytest.mark.parametrize("task", ["rom_wrist", "tapping", "powerglove_13_open_close"])
def test_other_tasks_have_none(page: Page, task: str) -> None:
    session = Session(page, at(State.TASK_READY, task=task))
    session.passes(0.2)
    expect(page.locator(".metronome")).to_be_hidden()


def test_the_place_in_a_cycle_is_where_the_seconds_say(page: Page) -> None:
    pace = {
        "cycle": [
            {"say": "a", "seconds": 1.5},
            {"say": "b", "seconds": 0.5},
            {"say": "c", "seconds": 2.0},
        ],
        "repetitions": 3,
    }
    asked = [-0.1, 0.0, 1.4, 1.5, 2.0, 3.9, 4.0, 9.75, 11.9, 12.0]
    places = page.evaluate(
        "async ([pace, asked]) => { const { placeAt } = await import('/static/station/metronome_time.js'); return asked.map((t) => placeAt(pace, t)); }",
        [pace, asked],
    )
    assert [p and (p["repetition"], p["phase"], round(p["left"], 3)) for p in places] == [
        None, (1, 0, 1.5), (1, 0, 0.1), (1, 1, 0.5), (1, 2, 2.0), (1, 2, 0.1), (2, 0, 1.5), (3, 1, 0.25), (3, 2, 0.1), None,
    ]  # fmt: skip
    beats = page.evaluate(
        "async (pace) => { const { beatAt } = await import('/static/station/metronome_time.js'); return [...Array(10).keys()].map((k) => beatAt(pace, k)); }",
        pace,
    )
    assert [b and (b["at"], b["first"]) for b in beats] == [
        (0, True), (1.5, False), (2, False), (4, True), (5.5, False), (6, False), (8, True), (9.5, False), (10, False), None,
    ]  # fmt: skip


def test_the_onset_is_that_of_the_message_that_came_soonest(page: Page) -> None:
    estimates = page.evaluate(
        """async () => {
          const { makeOnset } = await import("/static/station/metronome_time.js");
          const onset = makeOnset(3);
          const late = [0.3, 0.02, 0.4, 0.1];
          const guesses = late.map((delay, k) => onset.addMessage(10 + k + delay, k)); // began at 10 s
          const jumped = onset.addMessage(30, 17); // the server stood still: earlier messages do not count
          return [...guesses, jumped];
        }"""
    )
    assert estimates == pytest.approx([10.3, 10.02, 10.02, 10.02, 13.0])
