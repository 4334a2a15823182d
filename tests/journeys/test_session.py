"""The whole journey with a virtual glove: patient, session, calibration, tasks, numbers, report."""

import itertools
import re
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.journeys.house import (
    Server,
    act,
    api,
    begin_session,
    end_session,
    end_trial,
    figure,
    keep_picture,
    leave_scene,
    name_port,
    new_patient,
    scene_drawn,
    shown,
    skip_task,
)

pytestmark = pytest.mark.browser
KEY = re.compile(r"(?<![\w./-])[a-z]+\d*(?:_[a-z0-9]+)+(?![\w./-])|\d deg\b")
COUNT_AND_SWITCH = """() => {
  const [count, sound] = [".metronome .count", ".cues .sound"].map((part) => document.querySelector(part).getBoundingClientRect());
  return { count: count.toJSON(), switch: sound.toJSON() };
}"""
COUNTDOWN_BELOW_BANNER = """() => {
    const [banner, countdown] = [".banner", ".countdown"].map((one) => document.querySelector(one));
    banner.hidden = false;
    banner.textContent = "No data from the glove";
    const below = countdown.getBoundingClientRect().top >= banner.getBoundingClientRect().bottom;
    banner.hidden = true;
    return below;
}"""


def test_from_a_new_patient_to_a_report(page: Page, server: Server, tmp_path: Path) -> None:
    page.get_by_role("button", name="New patient").click()
    keep_picture(page, "patients-new")
    page.get_by_label("Patient code").fill("H-017")
    page.get_by_label("Affected hand").select_option("left")
    page.get_by_role("button", name="Create patient").click()
    expect(page.get_by_text("No sessions yet")).to_be_visible()
    keep_picture(page, "patient-new")

    begin_session(page, "left")
    scene_drawn(page)
    leave_scene(page)
    shown(act(page, "continue"))
    shown(
        page.get_by_text(re.compile("all 7 strips found|7 of 7 strips, see below"))
    )  # below stands what a busy machine may have lost, and
    expect(
        page.get_by_text(
            re.compile("Not found:|Damaged data|could not be read|at its limit|started again")
        )
    ).to_have_count(0)
    shown(page.get_by_text("Moving: index finger"))
    expect(page.get_by_text("Not followed yet")).to_be_visible()
    keep_picture(page, "station-connect")
    _shows_no_key(page)
    act(page, "continue").click()

    shown(act(page, "start"))
    keep_picture(page, "station-pose")
    act(page, "start").focus()
    page.keyboard.press("Enter")  # the keyboard alone leads on: the next button has the focus
    shown(page.get_by_role("progressbar", name="Progress"))
    shown(page.get_by_text("Still, and inclined as the blue hand"))
    expect(page.locator('.fit [data-grade="good"]')).to_have_count(6)  # palm and fingers
    shown(act(page, "accept"))
    expect(page.get_by_text("Not followed yet")).to_be_hidden()
    keep_picture(page, "station-review")
    _shows_no_key(page)
    expect(act(page, "onward")).to_be_focused()
    act(page, "accept").click()

    shown(page.get_by_role("button", name="Next: Fist and stretch"))
    expect(page.locator("[data-task]").first).to_be_in_viewport(ratio=1)  # on a tablet, too
    keep_picture(page, "station-tasks")
    _shows_no_key(page)
    _perform(page, "rom_fist", "now")
    skip_task(page, "rom_spread", "Pain")
    taps = _perform(page, "tapping", "taps")

    act(page, "finish").click()
    expect(page.get_by_text("Not done yet: Thumb across and away")).to_be_visible()
    page.get_by_role("button", name="Yes, finish").click()
    page.wait_for_url("**/sessions/*")
    _read_results(page, tmp_path, taps)


def _perform(page: Page, task: str, name: str) -> str:
    """Choose, start, wait, accept; gives how many movements were counted."""
    page.locator(f'[data-task="{task}"]').click()
    act(page, "start").click()
    shown(page.locator(".countdown .digits"))
    assert page.evaluate(COUNTDOWN_BELOW_BANNER)
    shown(page.get_by_text("Seconds left"))
    if task == "rom_fist":  # with a count and no beat
        _count_and_switch_are_apart(page)
    _turn_the_view(page)
    shown(page.locator(".numbers dd"))
    keep_picture(page, f"station-{task}")
    if task == "rom_fist":  # one whole fist is enough; tapping goes on to its end
        second_begun = page.locator(".metronome .count", has_text=re.compile("^[23]"))
        shown(second_begun.or_(act(page, "accept")))
        end_trial(page)
    shown(act(page, "accept"))
    _review(page)
    counted = page.locator(".numbers dd").first.inner_text()
    act(page, "accept").click()
    expect(page.locator(f'[data-task="{task}"]')).to_contain_text(re.compile("done|1 of 3"))
    return counted


def _count_and_switch_are_apart(page: Page) -> None:
    """Both are drawn over the scene while the task runs, the count beside the switch of the sound."""
    count, switch = page.locator(".metronome .count"), page.locator(".cues .sound")
    expect(count).to_have_text(re.compile(r"\d"))
    shown(switch)
    drawn = page.evaluate(COUNT_AND_SWITCH)
    assert drawn["count"]["height"] > 0 and drawn["count"]["right"] <= drawn["switch"]["left"]


def _review(page: Page) -> None:
    """Before a trial is kept: its frozen curve, three figures, what was wrong or that nothing was, and the movement once more."""
    expect(page.locator(".trial-review tbody tr")).to_have_count(3)
    shown(page.locator(".frozen canvas"))
    shown(page.locator(".trial-review [role=status] p"))
    keep_picture(page, "station-keep")
    _shows_no_key(page)
    expect(page.locator(".actions .primary")).to_be_in_viewport(ratio=1)  # without scrolling
    again = page.locator("[data-again]")
    again.click()
    expect(again).to_be_disabled()


def _shows_no_key(page: Page) -> None:
    """Whatever is folded is opened for it, and closed again."""
    opened = "(is) => document.querySelectorAll('.panel details').forEach((one) => (one.open = is))"
    page.evaluate(opened, True)
    assert KEY.findall(page.evaluate("document.body.innerText")) == []
    page.evaluate(opened, False)


def _turn_the_view(page: Page) -> None:
    """The picture is mirrored, and the number stands beside it while its own digits would be reversed."""
    mirror = page.locator('[data-view="mirror"]')
    mirror.click()
    expect(mirror).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".scene.mirrored .quantity strong")).to_have_text(re.compile(r"\d"))
    mirror.click()
    expect(page.locator(".quantity")).to_be_hidden()
    with page.expect_response("**/view") as answer:
        page.locator('[data-view="palm"]').click()
    assert answer.value.status == 204


def _read_results(page: Page, folder: Path, taps: str) -> None:
    shown(page.get_by_role("heading", name="Range of motion"))
    bent, _, sure = figure(page, "Index PIP").partition("° ± ")
    assert (
        abs(int(bent) - 95) <= 5 and 0 < float(sure.removesuffix("°")) < 5
    )  # what the virtual patient bends it to
    assert abs(int(taps) - 37) <= 4  # 2.5 a second in 15 s
    assert figure(page, "Taps") == taps  # as the clinician saw them before keeping them
    page.locator(".hand-map .level-none, .hand-map .level-small, .hand-map .level-large").filter(
        has_text="Ring DIP"
    ).click()
    shown(page.get_by_role("heading", name="Ring DIP: flexion and extension over the recording"))
    page.locator(".bars").get_by_role("button", name="Index PIP").click()
    shown(page.get_by_role("heading", name="Index PIP: flexion and extension over the recording"))
    keep_picture(page, "session")
    with (
        page.expect_popup() as opened,
        page.context.expect_event("response", lambda r: "/report.pdf?" in r.url) as answer,
    ):
        page.get_by_role("link", name="Report (PDF)").click()
    assert answer.value.status == 200 and opened.value
    pdf = page.request.get(answer.value.url).body()
    assert pdf.startswith(b"%PDF") and len(pdf) > 10_000
    _finds_one_of_all_figures(page)
    page.get_by_text("Tables and data").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Figures (CSV)").click()
    download.value.save_as(folder / "figures.csv")
    assert "index_pip_flexion_max" in (folder / "figures.csv").read_text()
    page.get_by_label("Notes on this session").fill("calm")
    page.get_by_role("button", name="Save notes").click()
    expect(page.get_by_text("Saved.")).to_be_visible()


def _finds_one_of_all_figures(page: Page) -> None:
    """They are folded until somebody looks for one."""
    motion = page.locator(".card").filter(has=page.get_by_role("heading", name="Total active motion", exact=True))  # fmt: skip
    rows = motion.locator("details tbody tr").filter(visible=True)
    expect(motion.locator(".by-finger tr")).to_have_count(5)
    expect(rows).to_have_count(0)
    motion.locator("summary").filter(has_text="All figures").click()
    every = rows.count()
    motion.get_by_role("searchbox", name="Search figures").fill("ring")
    found = rows.all_inner_texts()
    assert 0 < len(found) < every
    assert all("ring" in words.lower() for words in found)


ONWARD = {"continue", "start", "accept", "choose", "resume", "use", "again", "onward", "enough"} | {
    "finish"
}


def _reach(one: Locator) -> None:
    """By the Tab key alone."""
    shown(one)
    for _ in range(40):
        if one.evaluate("(it) => it === document.activeElement"):
            return
        one.page.keyboard.press("Tab")
    raise AssertionError(f"no Tab leads to {one}")


@pytest.mark.slow
def test_a_whole_usual_assessment_by_enter_and_space_alone(
    page_without_scene: Page, server: Server
) -> None:
    page, pressed = page_without_scene, list[str]()
    code = api(page, f"/api/patients/{new_patient(page)}")["pseudonym"]
    page.goto(server.base)
    _reach(page.get_by_role("link", name=code))
    page.keyboard.press("Enter")
    page.wait_for_url("**/patients/*")
    _reach(page.locator('input[name="hand"]:checked'))  # the affected hand, and with it its glove
    expect(page.get_by_role("radio", name="Virtual left glove")).to_be_checked()
    _reach(page.get_by_role("button", name="Start session"))
    page.keyboard.press("Enter")
    page.wait_for_url("**/stations/*")
    for key in itertools.cycle(("Enter", "Space")):
        page.wait_for_function(
            "() => document.activeElement?.dataset.act || location.pathname.startsWith('/sessions/')"
        )
        if "/sessions/" in page.url:
            break
        pressed.append(page.evaluate("document.activeElement.dataset.act"))
        page.keyboard.press(key)
        page.keyboard.press("Enter")  # once too often
        page.wait_for_timeout(300)
    assert set(pressed) <= ONWARD
    _reach(page.get_by_role("link", name="Report (PDF)"))
    with page.context.expect_event("response", lambda r: "/report.pdf?" in r.url) as answer:
        page.keyboard.press("Enter")
    assert answer.value.status == 200
    events = api(page, f"/api/sessions/{page.url.rsplit('/', 1)[1]}")["recordings"][0]["summary"]
    done = [e["task"] for e in events["events"] if e["trial_type"] == "task"]
    assert {"rom_fist", "tapping"} <= set(done) and len(done) >= 5


def test_a_second_enter_ends_nothing(page_without_scene: Page, server: Server) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    station = begin_session(page, "left")
    expect(act(page, "continue")).to_be_focused()  # from the beginning, without a click
    page.locator(".ending > button").click()
    expect(page.get_by_role("button", name="Go back").filter(visible=True)).to_be_focused()
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    act(page, "continue").focus()
    page.keyboard.press("Enter")
    shown(act(page, "without")).click()
    expect(page.get_by_role("button", name="Go back").filter(visible=True)).to_be_focused()
    page.keyboard.press("Enter")
    expect(act(page, "start")).to_be_focused()
    page.keyboard.press("Enter")
    shown(page.get_by_role("progressbar", name="Progress"))
    assert page.evaluate("document.activeElement.dataset.act ?? ''") == ""
    assert station in [s["station"] for s in api(page, "/api/stations")]


def test_the_wrong_glove_is_refused_or_said_in_red_and_the_empty_session_is_deleted(
    page_without_scene: Page, server: Server, tmp_path: Path
) -> None:
    page = page_without_scene
    patient = f"{server.base}/patients/{new_patient(page)}"
    page.goto(patient)
    page.locator('input[name="hand"][value="left"]').check()
    page.get_by_role("radio", name="Virtual right glove").check()
    page.get_by_role("button", name="Start session").click()
    shown(page.get_by_text("This glove is for the right hand"))
    assert api(page, patient.replace(server.base, "/api"))["sessions"] == []
    unnamed = tmp_path / "glove"  # whose hand nobody knows before it is connected
    unnamed.symlink_to(server.data / "gloves" / "virtual-right-glove")
    name_port(page, patient, unnamed)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    alert = shown(page.get_by_role("alert").filter(has_text="Wrong glove"))
    expect(alert).to_contain_text("This is a right glove, the session is of the left hand")
    expect(act(page, "continue")).to_have_count(0)
    keep_picture(page, "station-wrong-glove")
    end_session(page)
    shown(page.get_by_role("button", name="Delete this session")).click()
    page.get_by_role("button", name="Delete for good").click()
    page.wait_for_url("**/patients/*")
    assert api(page, patient.replace(server.base, "/api"))["sessions"] == []


def test_a_port_without_a_glove_says_so(page_without_scene: Page, server: Server) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    page.get_by_role("radio", name="Another port").check()
    page.get_by_label("Port", exact=True).fill("/dev/ttyABSENT")
    page.get_by_role("button", name="Start session").click()
    expect(shown(page.get_by_role("alert").filter(has_text="cannot be reached"))).to_contain_text(
        "is the glove plugged in?"
    )
    end_session(page)
    expect(
        shown(page.get_by_role("heading", name="This session has no usable recording"))
    ).to_be_visible()
    keep_picture(page, "session-failed")


def done_well(page: Page, picture: str = "") -> None:
    """A step of the calibration, repeated as the page asks where a busy machine measured it while the hand still moved into it."""
    good, bad = (
        page.get_by_role("heading", name="This step is good"),
        page.get_by_role("heading", name="This step cannot be used"),
    )
    for _ in range(3):
        shown(act(page, "start")).click()
        shown(page.get_by_text("Seconds left"))
        if picture:
            keep_picture(page, picture)
        shown(good.or_(bad))
        if good.count():
            return
        act(page, "redo").click()
    expect(good).to_be_visible()


@pytest.mark.slow
def test_a_calibration_by_movements_is_led_through_and_used(
    page_without_scene: Page, server: Server
) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    begin_session(page, "left")
    shown(act(page, "continue")).click()
    shown(act(page, "assist")).click()
    shown(page.get_by_role("heading", name="Initial pose, given by you"))
    keep_picture(page, "pose-passive")
    act(page, "start").click()
    shown(page.get_by_text("Calibration by joint"))
    keep_picture(page, "pose-by-joint")
    shown(act(page, "calibrate")).click()
    shown(page.get_by_role("heading", name="Step 1 of 6: Flat hand"))
    keep_picture(page, "calibration-flat")
    expect(act(page, "use")).to_have_count(0)
    done_well(page)
    keep_picture(page, "calibration-flat-good")
    act(page, "next").click()
    shown(page.get_by_role("heading", name="Step 2 of 6: Flat thumb"))
    act(page, "next").click()  # it is left out
    page.locator('[data-task="flexion_all"]').click()
    done_well(page, "calibration-all")
    shown(page.get_by_text("Bent 3 times"))
    keep_picture(page, "calibration-all-good")
    act(page, "use").click()
    shown(page.get_by_text("Initial pose again"))
    keep_picture(page, "calibration-pose")
    act(page, "start").click()
    shown(page.get_by_text("The mounting of the sensors was found from movements (2 steps)"))
    keep_picture(page, "calibration-review")
    act(page, "accept").click()
    shown(page.locator("summary", has_text="Calibrate again")).click()
    shown(act(page, "calibrate")).click()
    expect(page.locator('[data-task="flexion_all"]')).to_contain_text("in use")
    keep_picture(page, "calibration-again")
    act(page, "stop").click()
    shown(page.locator("summary", has_text="Calibrate again"))
    end_session(page)
    shown(page.get_by_role("link", name="Report (PDF)"))
    told = api(page, f"/api/sessions/{page.url.rsplit('/', 1)[1]}")
    assert "'flat_hand'" in str(told) and "'flexion_all'" in str(told)
