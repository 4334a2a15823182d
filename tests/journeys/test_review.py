"""Reading a session again: a trial is left out with a reason and taken back; progress over sessions."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from handscope.app.version import software_version
from handscope.sessions.clinic import results
from handscope.sessions.db.tables import PatientSession, Result
from handscope.sessions.store.store import store_at
from tests.journeys.house import Server, api, keep_picture, new_patient, shown

pytestmark = pytest.mark.browser
RESULT = re.compile(r"/api/results/\d+\?lean")


def test_a_trial_is_left_out_with_a_reason_and_taken_back(
    page_without_scene: Page, another_page: Callable[..., Page], server: Server, processed: int
) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/sessions/{processed}")
    shown(page.get_by_role("button", name="Change…")).click()
    shown(page.locator(".correcting .uplot"))
    expect(page.get_by_role("radio", name="Leave out a stretch")).to_have_count(
        0
    )  # taps follow each other
    page.get_by_role("button", name="Change and compute anew").click()
    expect(page.get_by_role("alert").filter(has_text="Give a reason")).to_be_visible()
    page.get_by_role("button", name="Interrupted").click()
    keep_picture(page, "session-correcting")
    page.get_by_role("button", name="Change and compute anew").click()
    shown(page.get_by_text("This recording has no figures"))
    page.reload()  # who comes later reads it too
    shown(page.get_by_text("Left out: Interrupted"))
    page.locator("summary").filter(has_text="about the recording").click()
    shown(page.get_by_text("tapping: left out of the figures (Interrupted)"))
    keep_picture(page, "session-corrected")
    reader = another_page(scene=False, at=f"/sessions/{processed}", locale="de")
    shown(reader.get_by_text("Ausgenommen: Unterbrochen"))
    page.get_by_role("button", name="Undo").click()
    shown(page.get_by_role("heading", name="Finger tapping"))
    page.get_by_text("Taken back", exact=True).click()
    shown(page.get_by_text("Left out: Interrupted. Taken back"))
    file = api(page, f"/api/sessions/{processed}")["recordings"][0]
    assert [r["current"] for r in file["results"]] == [False, True]


def test_progress_appears_with_the_second_session_and_says_that_nothing_changed(
    page_without_scene: Page, server: Server, recording: Path
) -> None:
    page = page_without_scene
    patient = new_patient(page)
    page.goto(f"{server.base}/patients/{patient}")
    shown(page.get_by_text("Progress appears when a task was measured twice"))
    for k in range(2):
        another = (
            recording.read_bytes()[:-2] + b"\x01\x00" + bytes([k])
        )  # a comment of the zip: a recording of its own with the same movement
        sent = {"file": {"name": f"{k}.zip", "mimeType": "application/zip", "buffer": another}}
        told = api(page, f"/api/patients/{patient}/recordings", "POST", multipart=sent)
        page.goto(f"{server.base}/sessions/{told['session']}")
        shown(page.get_by_role("heading", name="Finger tapping"))
    page.goto(f"{server.base}/patients/{patient}")
    shown(page.get_by_text(re.compile(r"No change beyond measurement error in any of \d+ figures")))
    shown(page.get_by_text(re.compile(r"Of the \d+ figures shown, \d+ cannot be judged")))
    rate = page.locator(".multiple").filter(
        has=page.get_by_role("heading", name="Rate", exact=True)
    )
    expect(rate).to_contain_text("No change beyond measurement error (unchanged)")
    expect(
        page.locator(".multiple").filter(has_text="measurement error not known").first
    ).to_be_visible()
    first = page.locator(".multiple h3").first
    assert (first.inner_text(), page.get_by_label("Figures").input_value()) == ("Rate", "important")
    key_figures_lead_without_pushing_the_new_session_away(page)
    page.get_by_label("Compared with").select_option("before")
    shown(page.get_by_text("measurement error round the session before"))
    keep_picture(page, "patient-progress")
    page.get_by_text("Note a treatment").click()
    page.get_by_label("What", exact=True).select_option("botulinum_toxin")
    page.get_by_label("Day", exact=True).fill("2026-05-20")
    page.get_by_label("Comment", exact=True).fill("40 units")
    page.get_by_role("button", name="Note it").click()
    shown(page.get_by_text("Botulinum toxin (left hand), 20 May 2026."))
    shown(page.get_by_text("treatment, numbered as in the list"))
    rate.get_by_text("Set a goal").click()
    rate.get_by_label("From", exact=True).fill("3")
    rate.get_by_label("To", exact=True).fill("4.5")
    shown(rate.get_by_text("Goal: 3.00 per s to 4.50 per s"))
    rate.get_by_role("button", name="Save the goal").click()
    shown(rate.get_by_text("Change the goal"))
    page.reload()
    shown(rate.get_by_text("Goal: 3.00 per s to 4.50 per s").first)
    keep_picture(page, "patient-progress-goal")
    page.goto(f"{server.base}/sessions/{told['session']}")
    the_other_session_is_offered_before_methods_and_named_in_full(page)


def the_other_session_is_offered_before_methods_and_named_in_full(page: Page) -> None:
    page.locator("summary").filter(has=page.get_by_role("heading", name="Compare")).click()
    other = page.get_by_label("Compare with", exact=True)
    expect(other.locator("optgroup")).to_have_count(2)
    session = other.locator("option").nth(1).inner_text()
    assert "Left hand" in session
    other.select_option(session)
    expect(page.locator(".legend li", has_text=session)).to_be_visible()


def key_figures_lead_without_pushing_the_new_session_away(page: Page) -> None:
    before = page.viewport_size
    page.set_viewport_size({"width": 1440, "height": 900})
    tiles = page.get_by_role("button", name=re.compile("unchanged since"))
    expect(tiles).to_have_count(3)
    expect(tiles.first).to_contain_text("Finger tapping")
    below = page.get_by_role("heading", name="New session").bounding_box()
    assert below is not None and below["y"] < 300
    tiles.first.click()
    expect(page.get_by_role("heading", name="Progress", exact=True)).to_be_focused()
    expect(page.get_by_role("heading", name="Progress", exact=True)).to_be_in_viewport()
    order = page.locator(".beside > :first-child h2").all_inner_texts()
    assert order == ["New session", "Progress", "Sessions"]
    if before:
        page.set_viewport_size(before)


def test_of_many_sessions_the_newest_five_are_listed_until_all_are_wanted(
    page_without_scene: Page, server: Server, processed: int
) -> None:
    page = page_without_scene
    patient = api(page, f"/api/sessions/{processed}")["patient"]["id"]
    whole = api(page, f"/api/patients/{patient}")
    (one,) = whole["sessions"][:1]
    many = {**whole, "sessions": [{**one, "id": 1000 + k} for k in range(7)]}
    page.route(f"**/api/patients/{patient}", lambda route: route.fulfill(json=many))
    page.goto(f"{server.base}/patients/{patient}")
    rows = page.locator(".visits > li")
    expect(rows).to_have_count(5)
    page.get_by_role("button", name="Show all 7 sessions").click()
    expect(rows).to_have_count(7)
    expect(rows.nth(5).get_by_role("link")).to_be_focused()


def test_a_replay_is_led_by_the_keyboard_and_repeats_a_task(
    page_without_scene: Page, server: Server, processed: int
) -> None:
    page = page_without_scene
    result = api(page, f"/api/sessions/{processed}")["recordings"][0]["results"][-1]["id"]
    station = api(page, f"/api/results/{result}/replay", "POST")["station"]
    page.goto(f"{server.base}/stations/{station}")
    cursor = shown(page.locator(".cursor"))
    page.keyboard.press("Home")
    expect(cursor).to_have_attribute("data-t", "0.00")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    shown(page.get_by_text("6.0 of"))
    page.keyboard.press("Space")
    shown(page.get_by_role("button", name="Pause"))
    page.keyboard.press("Space")
    shown(page.get_by_role("button", name="Play"))
    tapping = api(page, f"/api/results/{result}")["content"]["tasks"][0]
    page.get_by_label("Speed").select_option("4")
    page.get_by_role("button", name="Repeat Finger tapping").click()
    page.get_by_role("slider", name="Time in the recording").fill(
        str(round(tapping["end"] - 0.3, 2))
    )
    page.wait_for_function(
        "([onset, end]) => { const t = Number(document.querySelector('.cursor')?.dataset.t); return t > onset && t < onset + 8; }",
        arg=[tapping["onset"], tapping["end"]],
    )
    page.get_by_role(
        "button", name="Pause"
    ).click()  # before the repeating ends, and with it the recording
    page.get_by_role("button", name="Repeat Finger tapping").click()
    shown(page.get_by_role("button", name="Play"))


THUMB_AND_CURSOR = """() => {
  const [slider, cursor] = [".timeline input", ".cursor"].map((one) => document.querySelector(one));
  const [box, thumb] = [slider.getBoundingClientRect(), 16];  // px, as browsers draw it
  const share = (slider.value - slider.min) / (slider.max - slider.min);
  return [box.left + thumb / 2 + share * (box.width - thumb), cursor.getBoundingClientRect().left];
}"""


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_a_replays_slider_is_above_its_curve_and_jump_to_brings_both_near(
    page_without_scene: Page, server: Server, processed: int, width: int, height: int
) -> None:
    page = page_without_scene
    page.set_viewport_size({"width": width, "height": height})
    result = api(page, f"/api/sessions/{processed}")["recordings"][0]["results"][-1]["id"]
    station = api(page, f"/api/results/{result}/replay", "POST")["station"]
    page.goto(f"{server.base}/stations/{station}")
    slider = shown(page.get_by_role("slider", name="Time in the recording"))
    shown(page.locator(".cursor"))

    def stands_at(moment: float) -> None:
        slider.fill(f"{moment:.2f}")
        expect(page.locator(".cursor")).to_have_attribute("data-t", f"{moment:.2f}")
        thumb, cursor = page.evaluate(THUMB_AND_CURSOR)
        assert abs(thumb - cursor) < 3, moment

    def seen() -> list[float]:
        return [float(slider.get_attribute(end) or "") for end in ("min", "max")]

    whole = seen()
    for share in (0.02, 0.5, 0.96):
        stands_at(round(whole[0] + share * (whole[1] - whole[0]), 1))
    for chapter in page.locator(".chapters .jump").all():
        with page.expect_response("**/curves*"):
            chapter.click()
        near = seen()
        assert near[1] - near[0] < 0.95 * (whole[1] - whole[0])
        for share in (0.02, 0.5, 0.96):
            stands_at(round(near[0] + share * (near[1] - near[0]), 1))
    with page.expect_response("**/curves*"):
        page.get_by_role("button", name="Whole recording").click()
    assert seen() == whole


def test_two_people_write_on_a_session_and_a_wrong_clock_is_corrected(
    another_page: Callable[..., Page], server: Server, processed: int
) -> None:
    mine, other = (another_page(scene=False, at=None) for _ in range(2))
    mine.route(
        RESULT, lambda route: route.fulfill(json={**route.fetch().json(), "state": "running"})
    )
    for window in (mine, other):
        window.goto(f"/sessions/{processed}")
    shown(mine.get_by_text("Computing the results"))
    mine.get_by_text("Correct the date…").click()
    mine.get_by_label("When the session was measured").fill("2025-05-12T09:30")
    mine.get_by_label("Why the date was wrong").fill("the clock")
    mine.get_by_label("Why the date was wrong").focus()
    mine.unroute_all(behavior="wait")  # it is processed: the page is drawn anew
    shown(mine.get_by_role("link", name="Report (PDF)"))
    expect(mine.get_by_label("Why the date was wrong")).to_have_value("the clock")
    expect(mine.get_by_label("Why the date was wrong")).to_be_focused()
    mine.get_by_label("Why the date was wrong").fill("")
    for window in (mine, other):
        shown(window.get_by_label("Notes on this session"))
    mine.get_by_label("Notes on this session").fill("calm")
    mine.get_by_label("Conclusion").fill("Stiffer than in May.")
    mine.get_by_label("Pain on movement").select_option("7")
    mine.get_by_role("button", name="Save notes").click()
    shown(mine.get_by_text("Saved."))
    other.get_by_label("Examiner").fill("A. B.")  # apart from the notes: kept of both
    other.get_by_role("button", name="Save notes").click()
    shown(other.get_by_text("Saved."))
    expect(other.get_by_label("Notes on this session")).to_have_value("calm")
    mine.get_by_label("Notes on this session").fill("tired")
    other.get_by_label("Notes on this session").fill("in pain")
    mine.get_by_role("button", name="Save notes").click()
    shown(mine.get_by_text("Saved."))
    other.get_by_role("button", name="Save notes").click()
    shown(other.locator(".error").filter(has_text="Notes: stored now “tired”, yours “in pain”"))
    keep_picture(other, "session-conflict")
    other.get_by_role("button", name="Take what is stored").click()
    mine.get_by_role(
        "button", name="Undo"
    ).click()  # what is saved of the notes leaves the date as it was typed, too
    expect(mine.get_by_label("When the session was measured")).to_have_value("2025-05-12T09:30")
    expect(mine.get_by_label("Notes on this session")).to_have_value("calm")
    session = api(mine, f"/api/sessions/{processed}")
    assert (session["notes"], session["examiner"]) == ("calm", "A. B.")
    assert (session["conclusion"], session["pain_movement"]) == ("Stiffer than in May.", 7)
    assert session["pain_rest"] is None

    mine.get_by_role("button", name="Correct the date").click()
    expect(mine.locator(".error")).to_have_text(
        "Give a reason: it stands beside the date for everybody who reads it."
    )
    mine.get_by_label("Why the date was wrong").fill("the clock's battery")
    mine.get_by_role("button", name="Correct the date").click()
    expect(mine.get_by_role("heading", name="Session of 12 May 2025")).to_be_visible()
    keep_picture(mine, "session-dated")
    mine.get_by_role("link", name="DEMO").click()
    expect(shown(mine.get_by_text("Date corrected. The computer's clock said"))).to_contain_text(
        "the clock's battery"
    )
    mine.go_back()
    mine.get_by_role("button", name="Put the clock's date back").click()
    expect(mine.get_by_role("heading", name="Session of 12 May 2025")).to_be_hidden()
    assert api(mine, f"/api/sessions/{processed}")["started"] == session["started"]


@pytest.fixture
def under_way(server: Server, processed: int) -> Iterator[int]:
    """A result of that session that is being computed, by nobody: it stays until it is stopped."""
    with store_at(server.data).database() as db:
        result = results.find_matching(
            db, db.get_one(PatientSession, processed).recordings[0], "map", {}, software_version()
        )
        results.begin(db, result.id)
        db.commit()
        made = result.id
    yield made
    with store_at(server.data).database() as db:
        db.delete(db.get_one(Result, made))
        db.commit()


def test_a_computation_that_nobody_waits_for_is_stopped(
    page_without_scene: Page, server: Server, processed: int, under_way: int
) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/sessions/{processed}?result={under_way}")
    stop = shown(page.get_by_role("button", name="Stop computing"))
    shown(page.get_by_text("self-calibration (map) some minutes"))
    keep_picture(page, "session-computing")
    stop.click()
    shown(page.get_by_role("alert").filter(has_text="the computation was stopped"))
    assert api(page, f"/api/results/{under_way}")["state"] == "failed"
    keep_picture(page, "session-stopped")


KEY = re.compile(r"\b[a-z]+(?:_[a-z0-9]+)+\b")


@pytest.mark.parametrize("language", ["en", pytest.param("de", marks=pytest.mark.slow)])
def test_no_page_and_no_report_shows_a_name_of_the_program(
    another_page: Callable[..., Page], server: Server, processed: int, language: str
) -> None:
    page = another_page(scene=False, at=None, locale=language)
    session = api(page, f"/api/sessions/{processed}")
    result = session["recordings"][0]["results"][-1]["id"]
    for path in (
        "/",
        f"/patients/{session['patient']['id']}",
        f"/sessions/{processed}",
        "/help",
        "/account",
        f"/api/results/{result}/report.html?language={language}",
    ):
        page.goto(path)
        shown(page.get_by_role("heading", level=1))
        page.wait_for_load_state("networkidle")
        page.evaluate("document.querySelectorAll('details').forEach((d) => (d.open = true))")
        page.evaluate(
            "document.querySelectorAll('.options, code').forEach((e) => e.remove())"
        )  # a method's options go by their names
        words = page.evaluate("document.body.innerText")
        assert KEY.findall(words) == [], path
