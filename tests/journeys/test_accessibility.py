"""Every page keeps WCAG 2.2 A and AA as far as axe can tell, in light and in dark; nothing scrolls sideways, targets are large."""

import itertools
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Page, TimeoutError, expect

from tests.journeys.conftest import empty_scene
from tests.journeys.house import (
    SIZES,
    Server,
    act,
    api,
    begin_session,
    end_session,
    keep_picture,
    new_patient,
    shown,
    simulate,
)

pytestmark = pytest.mark.browser
PHONE = (390, 844)
AXE = Path(__file__).parents[1] / "vendor" / "axe-core" / "axe.min.js"
RULES = {
    "type": "tag",
    "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
}
OF_COLOURS = {
    "type": "rule",
    "values": ["color-contrast", "link-in-text-block"],
}  # colours alone differ in the dark (colors.css)
RUN = """async (rules) => {
    const told = await axe.run({ exclude: ["iframe"] }, { runOnly: rules, iframes: false, resultTypes: ["violations"] });
    return { rules: told.passes.length, found: told.violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.html} ${n.failureSummary}`)) };
}"""
SMALL = """() => [...document.querySelectorAll("button, .button, select, input:not([type=radio]):not([type=checkbox]):not([type=file]), summary, label.choice")]
    .filter((e) => e.checkVisibility() && e.type !== "range" && e.getBoundingClientRect().height < 44)
    .map((e) => `${e.outerHTML.slice(0, 80)} ${e.getBoundingClientRect().height}`)"""


TOUCHING = """() => {
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest(".visually-hidden, svg, .plot, header, .over, .recording");
  const inside = "button, .button, select, input, textarea";
  const controls = [...document.querySelectorAll("button, .button, select, textarea, input:not([type=radio], [type=checkbox])")];
  const texts = [...document.querySelectorAll("p, li, dd, dt, h1, h2, h3, legend, label")];
  const words = texts.filter((e) => seen(e) && e.textContent.trim() && !e.querySelector(inside));
  const apart = (c, e) => {
    const [a, b, style] = [c.getBoundingClientRect(), e.getBoundingClientRect(), getComputedStyle(e)];
    if (Math.min(a.right, b.right) - Math.max(a.left, b.left) < 4) return Infinity;
    return Math.max(b.top + parseFloat(style.paddingTop) - a.bottom, a.top - b.bottom + parseFloat(style.paddingBottom));
  };
  const near = (c) => words.filter((e) => !e.contains(c) && !c.contains(e) && apart(c, e) < 3);
  const above = (c) => getComputedStyle(c).position === "sticky"; // over what is scrolled beneath it
  return controls.filter((c) => seen(c) && !above(c)).flatMap((c) => near(c).map((e) => `${c.textContent}: ${e.textContent}`));
}"""


SPILLED = """() => {
  const wide = (e) => e.scrollWidth > e.clientWidth + 1 && e.checkVisibility({ visibilityProperty: true });
  const boxes = [...document.querySelectorAll("main :is(p, li, dd, dt, th, td, h1, h2, h3, label, button, .button, button > span)")];
  const cut = boxes.filter((e) => wide(e) && getComputedStyle(e).display !== "inline" && !e.closest(".visually-hidden, .plot, .over, .views"));
  return cut.map((e) => `${e.tagName}.${e.className}: ${e.textContent.slice(0, 60)}`);
}"""  # words wider than the box that they stand in
WIDE_PANELS = """() => [...document.querySelectorAll(".panel")].filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.textContent.slice(0, 80))"""
SLIDING = """() => [...document.querySelectorAll(".scroll")].filter((e) => e.scrollWidth > e.clientWidth + 1 && e.checkVisibility()).map((e) => e.ariaLabel)"""


KEEP_LABELS = """() => {
  if (window.labels) return;
  const [draws, kept] = [CanvasRenderingContext2D.prototype.fillText, (window.labels = [])];
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y, ...more) {
    const beside = this.getImageData(Math.max(0, x - 2), Math.max(0, y - 2), 1, 1).data;
    kept.push({ text, ink: this.fillStyle, beside: [...beside], canvas: this.canvas });
    return draws.call(this, text, x, y, ...more);
  };
}"""  # what is drawn on a canvas is no text for axe
FAINT_LABELS = """() => {
  const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const bytes = (ink) => (ink.startsWith("#") ? [1, 3, 5].map((k) => parseInt(ink.slice(k, k + 2), 16)) : numbers(ink).slice(0, 3));
  const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  const luminance = (rgb) => rgb.map(linear).reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (e) => {
    const [r, g, b, alpha = 1] = numbers(getComputedStyle(e).backgroundColor);
    return alpha === 1 ? [r, g, b] : ground(e.parentElement);
  };
  const contrast = ({ ink, beside, canvas }) => {
    const below = ground(canvas).map((c, k) => c + (beside[k] - c) * (beside[3] / 255));
    const [less, more] = [luminance(bytes(ink)), luminance(below)].sort((a, b) => a - b);
    return (more + 0.05) / (less + 0.05);
  };
  const seen = window.labels.filter(({ canvas, text }) => canvas.isConnected && String(text).trim());
  return [seen.length, seen.filter((label) => contrast(label) < 4.5).map(({ text, ink }) => `${text} ${ink}`)];
}"""  # WCAG 2.2, 1.4.3


def looked_at(page: Page, name: str, wider: Sequence[str] = ()) -> None:
    """Check the page as it stands, in both schemes and sizes; `wider`: tables that nothing fits on a phone, as they have any number of columns."""
    page.add_script_tag(path=AXE)
    told = page.evaluate(RUN, RULES)
    assert told["rules"] > 5, "axe looked at nothing"
    assert told["found"] == [], f"{name}, light"
    turned(page, "dark", name)
    told = page.evaluate(RUN, OF_COLOURS)
    assert told["rules"] > 0, "axe looked at no colour"
    assert told["found"] == [], f"{name}, dark"
    turned(page, "light", name)
    assert page.evaluate(SMALL) == [], name
    for width, height in (*SIZES.values(), PHONE):
        page.set_viewport_size({"width": width, "height": height})
        fits(page, name, width)
        assert page.evaluate(TOUCHING) == [], f"{name}, {width} px"
        assert page.evaluate(SPILLED) == [], f"{name}, {width} px"
    assert page.evaluate(SLIDING) == list(wider), f"{name}: tables on a phone"
    page.set_viewport_size(dict(zip(("width", "height"), SIZES["tablet"])))


def turned(page: Page, scheme: Literal["dark", "light"], name: str) -> int:
    """Change the scheme; what plots then write can be read. Gives how many labels that are."""
    page.evaluate(KEEP_LABELS)
    page.evaluate("window.labels.length = 0")
    page.emulate_media(color_scheme=scheme)
    with suppress(TimeoutError):  # where a person chose the scheme it stays
        page.wait_for_function(
            "!document.querySelector('.uplot canvas') || labels.length > 0", timeout=2000
        )
    count, faint = page.evaluate(FAINT_LABELS)
    assert faint == [], f"{name}, {scheme}"
    return int(count)


def fits(page: Page, name: str, width: int) -> None:
    """Nothing scrolls sideways, once the plots have followed the window."""
    with suppress(TimeoutError):
        page.wait_for_function(
            "(width) => document.documentElement.scrollWidth <= width", arg=width
        )
    assert page.evaluate("document.documentElement.scrollWidth") <= width, (
        f"{name} scrolls sideways at {width} px"
    )
    assert page.evaluate(WIDE_PANELS) == [], f"{name} at {width} px"


@pytest.fixture
def page(another_page: Callable[..., Page]) -> Page:
    return another_page(
        scene=False, at=None, bypass_csp=True
    )  # axe is put into the page as a script; the scene draws itself


def test_login_page(newcomer: Page, server: Server, browser: object) -> None:
    context = newcomer.context.browser.new_context(bypass_csp=True)  # type: ignore[union-attr]
    page = context.new_page()
    page.goto(f"{server.base}/login?token=wrong")
    shown(page.get_by_role("alert"))
    looked_at(page, "login")
    context.close()


def test_list_and_help_pages(page: Page, server: Server) -> None:
    page.goto("/")
    shown(page.get_by_role("link", name="DEMO"))
    page.get_by_role("button", name="New patient").click()
    looked_at(page, "patients")
    page.goto(f"{server.base}/help")
    shown(page.get_by_role("heading", name="Step by step"))
    looked_at(page, "help")
    keep_picture(page, "help")
    page.goto(f"{server.base}/protocols")
    shown(page.get_by_role("heading", name="Tasks in their order"))
    page.locator("summary").filter(has_text="Words").first.click()
    looked_at(page, "protocols")
    page.goto(f"{server.base}/account")
    shown(page.get_by_role("button", name="Make the account"))
    looked_at(page, "account")
    page.get_by_role("link", name="Audit trail").click()
    shown(page.get_by_role("columnheader", name="Who"))
    looked_at(page, "audit")
    page.goto(f"{server.base}/devices")
    shown(page.get_by_role("heading", name="Virtual left glove"))
    looked_at(page, "devices")
    page.goto(f"{server.base}/stations/none")
    shown(page.get_by_role("heading", name="This session view is closed"))
    looked_at(page, "missing")


def test_patient_page(page: Page, server: Server, processed: int, recording: Path) -> None:
    again = recording.read_bytes()[:-2] + b"\x01\x00a"  # with a comment: another recording
    sent = {"file": {"name": "a.zip", "mimeType": "application/zip", "buffer": again}}
    patient = api(page, f"/api/sessions/{processed}")["patient"]["id"]
    told = api(page, f"/api/patients/{patient}/recordings", "POST", multipart=sent)
    page.goto(f"{server.base}/sessions/{told['session']}")
    shown(page.get_by_role("heading", name="Finger tapping"))
    page.goto(f"{server.base}/patients/{patient}")
    shown(page.get_by_role("button", name="unchanged since").first)
    shown(page.get_by_role("radio", name="Virtual left glove"))
    shown(page.get_by_role("link", name="2026").first)
    page.get_by_text("Hand measures").click()
    page.get_by_text("Lengths of the fingers", exact=True).click()
    page.get_by_text("Erase this patient for good…").click()
    page.locator("summary").filter(has_text="Note a treatment").click()
    page.get_by_role("button", name="Change").first.click()
    page.get_by_label("Recording file").set_input_files(recording)
    looked_at(page, "patient")
    keep_picture(page, "patient")


def test_session_page(page: Page, server: Server, processed: int) -> None:
    page.goto(f"{server.base}/sessions/{processed}")
    shown(page.get_by_role("heading", name="Finger tapping"))
    for details in ("Tables and data", "Recording", "Process again", "Options of the method"):
        page.locator("summary").filter(has_text=details).click()
    looked_at(page, "session")
    keep_picture(page, "session-uploaded")


def test_ranges_of_a_hand(page: Page, server: Server, tmp_path: Path) -> None:
    patient = new_patient(page)
    fist = simulate(tmp_path / "fist.zip", "rom_fist").read_bytes()
    sent = {"file": {"name": "fist.zip", "mimeType": "application/zip", "buffer": fist}}
    told = api(page, f"/api/patients/{patient}/recordings", "POST", multipart=sent)
    page.goto(f"{server.base}/sessions/{told['session']}")
    shown(page.locator(".bars").get_by_role("button", name="Index PIP")).click()
    shown(page.get_by_role("heading", name="Index PIP: flexion and extension over the recording"))
    shown(page.locator(".card .uplot canvas"))
    looked_at(page, "ranges")
    assert turned(page, "dark", "ranges") > 0, "no label was drawn"


def test_on_a_phone_results_are_what_is_at_one_glance_and_the_rest_is_folded(
    page: Page, server: Server, processed: int
) -> None:
    page.set_viewport_size(dict(zip(("width", "height"), PHONE)))
    page.goto(f"{server.base}/sessions/{processed}")
    for name in ("Can I trust these numbers?", "At a glance"):
        shown(page.get_by_role("heading", name=name))
    folds = page.locator("details.fold")
    assert folds.count() > 4
    assert page.locator("details.fold[open]").count() == 0
    assert page.locator(".trust, .tile").first.is_visible()
    page.add_script_tag(path=AXE)
    assert page.evaluate(RUN, RULES)["found"] == []
    folded = page.evaluate("document.documentElement.scrollHeight")
    page.evaluate("document.querySelectorAll('details.fold').forEach((fold) => (fold.open = true))")
    assert folded < 0.6 * page.evaluate("document.documentElement.scrollHeight")
    assert page.evaluate(SPILLED) == []


def test_station_and_replay(page: Page, server: Server, processed: int) -> None:
    result = api(page, f"/api/sessions/{processed}")["recordings"][0]["results"][0]["id"]
    replay = api(page, f"/api/results/{result}/replay", "POST")["station"]
    page.goto(f"{server.base}/stations/{replay}")
    shown(page.locator(".cursor"))
    looked_at(page, "replay")
    page.set_viewport_size(dict(zip(("width", "height"), PHONE)))
    assert page.evaluate(
        "(strip => strip.scrollHeight <= strip.clientHeight + 1)(document.querySelector('.strip'))"
    ), "the curve is not drawn over what follows"
    glove = api(page, "/api/gloves")[0]["path"]
    station = api(page, "/api/patients/1/sessions", "POST", data={"hand": "left", "port": glove})[
        "station"
    ]
    page.goto(f"{server.base}/stations/{station}")
    shown(act(page, "continue"))
    looked_at(page, "connect")
    for width, height in SIZES.values():
        page.set_viewport_size({"width": width, "height": height})
        assert (
            page.evaluate(
                "document.querySelector('iframe').getBoundingClientRect().width / innerWidth"
            )
            >= 0.55
        )
    page.set_viewport_size(dict(zip(("width", "height"), PHONE)))
    light, views = (page.locator(f".{part}").bounding_box() for part in ("recording", "views"))
    assert light is not None and views is not None and light["y"] + light["height"] <= views["y"]
    page.set_viewport_size(dict(zip(("width", "height"), SIZES["tablet"])))
    act(page, "continue").click()
    shown(act(page, "start"))
    looked_at(page, "pose")
    walk_on_from_the_pose(page)
    end_session(page)


def test_patients_own_screen(page: Page, newcomer: Page, server: Server) -> None:
    context = newcomer.context.browser.new_context(bypass_csp=True)  # type: ignore[union-attr]
    tablet = context.new_page()
    empty_scene(tablet)
    tablet.goto(f"{server.base}/patient-view")
    shown(tablet.get_by_label("Code from your therapist"))
    looked_at(tablet, "screen-code")
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    station = begin_session(page, "right")
    invited = api(page, f"/api/stations/{station}/screens", "POST", data={"language": "en"})
    tablet.goto(server.base + invited["path"])
    shown(tablet.get_by_role("heading", name="One moment, please"))
    looked_at(tablet, "screen-wait")
    shown(act(page, "continue")).click()
    shown(tablet.get_by_role("heading", name="Lay your hand flat"))
    looked_at(tablet, "screen-pose")
    end_session(page)
    context.close()


def walk_on_from_the_pose(page: Page) -> None:
    """Every further state of a session, each in one scheme, the schemes in turn."""
    schemes = itertools.cycle(("dark", "light"))

    def glanced_at(name: str) -> None:
        page.emulate_media(color_scheme=next(schemes))  # type: ignore[arg-type]
        assert page.evaluate(RUN, RULES)["found"] == [], name
        assert page.evaluate(SMALL) == [], name
        for onward in page.locator(".actions .primary").filter(visible=True).all():
            expect(onward).to_be_in_viewport(ratio=1)
        fits(page, name, 1024)

    def asked(name: str) -> None:
        """A question can be answered without scrolling."""
        question = page.locator(".question").filter(visible=True)
        shown(question)
        for button in question.get_by_role("button").all():
            expect(button).to_be_in_viewport(ratio=1)
        glanced_at(name)

    def back() -> None:
        page.get_by_role("button", name="Go back").filter(visible=True).click()

    act(page, "without").click()
    asked("without")
    back()
    act(page, "assist").click()
    shown(page.get_by_role("heading", name="Initial pose, given by you"))
    glanced_at("pose by the therapist")
    act(page, "start").click()
    shown(page.get_by_role("progressbar", name="Progress"))
    glanced_at("hold")
    shown(act(page, "accept"))
    glanced_at("calibration by joint")
    act(page, "calibrate").click()
    shown(act(page, "start"))
    glanced_at("step")
    act(page, "stop").click()
    page.get_by_label("Which tasks?").select_option("tapping")
    page.locator(
        '[data-task="tapping_30"]'
    ).click()  # long enough to be looked at on a busy machine
    shown(act(page, "start")).click()
    shown(page.get_by_text("Starts in"))
    glanced_at("countdown")
    shown(act(page, "pause"))
    glanced_at("run")
    act(page, "pause").click()
    shown(page.get_by_text("This trial cannot go on after a pause"))
    glanced_at("pause")
    act(page, "stop").click()
    shown(page.get_by_text("Your score: MDS-UPDRS 3.4"))
    glanced_at("score")
    act(page, "unable").click()
    asked("could not")
    back()
    act(page, "skip").click()
    page.get_by_role("button", name="Skip this task").click()
    shown(page.get_by_text("Give a reason"))
    glanced_at("skip without a reason")
    page.get_by_role("button", name="Pain").click()
    page.get_by_role("button", name="Skip this task").click()
    shown(page.locator('[data-task="tapping_30"]').filter(has_text="skipped"))
    glanced_at("tasks")
    act(page, "finish").click()
    asked("finish")
    back()
