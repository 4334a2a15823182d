"""A hand calibrates itself in the wizard, is kept with the patient, and the next session is asked what it takes over; a recording's page proposes it."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from handscope.estimators.hand.anatomy import CHAINS
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.validation.benchmarks.server_under_test import glove, wait_for
from handscope.validation.reproduce.experiments import Trial, performed
from tests.estimators.methods.test_map_gain import only
from tests.journeys.house import (
    LONG,
    Server,
    act,
    api,
    end_session,
    held_back,
    keep_picture,
    name_port,
    new_patient,
    shown,
)
from tests.journeys.test_accessibility import looked_at
from tests.journeys.test_upload import upload

pytestmark = pytest.mark.browser
FREE = 40.0  # s that free movement lasts where nobody says enough


@pytest.fixture
def one_finger(tmp_path: Path) -> Iterator[Path]:
    """A virtual glove with the index finger's strip alone: it is solved in seconds."""
    port = tmp_path / "glove"
    with glove(port, "--hand", "left", "--strips", "index"):
        yield port


def start(page: Page) -> None:
    page.get_by_role("button", name="Start session").click()


def posed(page: Page) -> None:
    shown(act(page, "start")).click()
    shown(act(page, "accept"))


@pytest.mark.slow
def test_a_hand_calibrates_itself_and_the_next_session_is_asked(
    another_page: Callable[..., Page], server: Server, one_finger: Path
) -> None:
    page = another_page(scene=False, at=None, bypass_csp=True)
    patient = new_patient(page)
    name_port(page, f"{server.base}/patients/{patient}", one_finger)
    start(page)
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue")).click()
    posed(page)
    act(page, "free").click()
    shown(page.get_by_role("heading", name="Move hand and fingers freely"))
    looked_at(page, "free movement")
    act(page, "start").click()
    shown(page.get_by_role("meter", name="Index PIP"))
    keep_picture(page, "free-movement")
    act(page, "enough").click()  # the meter has only begun
    shown(page.get_by_text("Not every joint was moved enough yet. Stop all the same?"))
    looked_at(page, "free movement, moving and asked back")
    keep_picture(page, "free-movement-early")
    station = f"/api/stations/{page.url.rsplit('/', 1)[1]}"
    wait_for(
        lambda: api(page, station)["wizard"]["remaining"] < FREE / 2
    )  # what was asked stands while the hand moves on
    page.get_by_role("button", name="Stop now").click()
    shown(page.get_by_role("heading", name="Use what was found?"), 3 * LONG)
    expect(page.get_by_text("of 2 lengths found")).to_be_visible()
    looked_at(page, "self-calibration found")
    keep_picture(page, "self-calibration-found")
    act(page, "use").click()
    shown(page.get_by_text("Initial pose again"))
    posed(page)
    assert (
        api(page, station)["calibration"]["source"]
        == "initial pose, seats and lengths from self-calibration"
    )
    end_session(page)
    shown(page.get_by_text("This session takes over lengths and how the sensors sit"))
    looked_at(page, "session with self-calibration")
    (kept,) = api(page, f"/api/patients/{patient}/self-calibrations")
    assert (kept["hand"], kept["withdrawn"]) == ("left", None)
    session = page.url.split("/sessions/")[1].partition("?")[0]
    for method in ("m2", "ekf"):
        made = api(page, f"/api/sessions/{session}/results", "POST", data={"method": method})[
            "result"
        ]
        result = wait_for(
            lambda made=made: (
                (r := api(page, f"/api/results/{made}"))["state"] in ("done", "failed") and r
            )
        )
        assert (
            result["content"]["calibration"]["source"]
            == "initial pose, seats and lengths from self-calibration"
        )

    with held_back(page, "**/self-calibrations"):
        name_port(page, f"{server.base}/patients/{patient}", one_finger)
        start(page)  # before the page knows what it has to ask
    shown(page.get_by_text("Choose what is taken over, or nothing."))
    page.locator('input[name="reuse"][value="nothing"]').check()
    looked_at(page, "new session")
    start(page)
    page.wait_for_url("**/stations/*")
    session = api(page, f"/api/stations/{page.url.rsplit('/', 1)[1]}")["session"]
    assert api(page, f"/api/sessions/{session}/reuse")["decided"]["parts"] == "nothing"

    name_port(page, f"{server.base}/patients/{patient}", one_finger)
    asked = page.get_by_role("group", name="Earlier self-calibration")
    shown(asked)
    page.get_by_role("button", name="Do not offer it any more").click()
    expect(asked).to_have_count(0)
    looked_at(page, "patient with self-calibration")
    keep_picture(page, "self-calibration-kept")
    page.get_by_role("button", name="Offer it again").click()
    shown(asked)


@pytest.fixture(scope="module")
def free_movement() -> bytes:
    """Index finger alone: it is solved in seconds."""
    made = only(performed(Trial("free", 3)), ("hand", *CHAINS["index"]))
    recording = LoadedRecording(made.hand, made.geometry, {}, made.samples, made.events)
    return writer.pack(writer.tree(recording, "01", "free"))


@pytest.mark.slow
def test_the_page_proposes_self_calibration_and_shows_before_and_after(
    another_page: Callable[..., Page], server: Server, free_movement: bytes
) -> None:
    page = another_page(scene=False, at=None, bypass_csp=True)
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    upload(page, "free.zip", free_movement)
    page.wait_for_url("**/sessions/*")
    shown(page.get_by_role("heading", name="Self-calibration would tell more"), 2 * LONG)
    shown(page.get_by_text("to find lengths and how the sensors sit: Index."))
    looked_at(page, "self-calibration proposed")
    keep_picture(page, "self-calibration-proposed")
    page.get_by_role("button", name="Calibrate from this movement").click()
    shown(page.get_by_role("heading", name="Before and after self-calibration"), 6 * LONG)
    length = shown(page.get_by_role("row", name="index proximal").first)
    expect(length).to_contain_text("±")
    reached = page.get_by_role("table").filter(has=page.get_by_role("columnheader", name="After"))
    expect(reached.filter(has_text="Index PIP")).to_contain_text("Before (ekf)")
    expect(reached.get_by_role("row", name="Index PIP").get_by_text("°")).to_have_count(2)
    expect(page.get_by_role("heading", name="Self-calibration would tell more")).to_have_count(0)
    looked_at(page, "before and after self-calibration")
    keep_picture(page, "self-calibration-before-after")
    session = page.url.split("/sessions/")[1].partition("?")[0]
    results = api(page, f"/api/sessions/{session}")["recordings"][0]["results"]
    assert {result["method"] for result in results} >= {"map"}, "what was there before stays, too"
    assert len(results) == 2
