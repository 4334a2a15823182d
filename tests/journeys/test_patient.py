"""A patient's page: facts, measures, a photograph of the hand, two windows at once, search."""

import re
import sqlite3
import zipfile
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import Server, api, keep_picture, sent_late, shown
from tests.schedule import swept

pytestmark = pytest.mark.browser


def test_hand_measures_are_millimetres_on_the_page_and_metres_in_the_api(
    page: Page, patient: int
) -> None:
    page.get_by_text("Hand measures").click()
    length, palm = (
        page.get_by_role("group", name=f"{what} (mm)").get_by_label("Left hand")
        for what in ("Hand length", "Palm length")
    )
    length.fill("181,5")
    palm.fill("ten")
    page.get_by_text("Lengths of the fingers", exact=True).click()
    page.get_by_role("group", name="Index (mm)").get_by_label("Right hand").fill("92")
    page.get_by_role("group", name="Trunk sensor above the hips (mm)").get_by_label("Height").fill(
        "415"
    )
    page.get_by_role("button", name="Save measures").click()
    expect(page.get_by_text("Palm length (mm), left is “ten”")).to_be_visible()
    palm.fill("")
    page.get_by_role("button", name="Save measures").click()
    expect(page.get_by_text("Saved.")).to_be_visible()
    stored = api(page, f"/api/patients/{patient}")
    assert stored["hand_measures"] == {
        "left": {"hand_length": 0.1815},
        "right": {"finger_length": {"index": 0.092}},
    }
    assert stored["trunk_height"] == 0.415
    keep_picture(page, "patient-measures")
    length.fill("1815")
    page.get_by_role("button", name="Save measures").click()
    expect(page.locator(".error")).to_contain_text("hand length")


def test_two_windows_that_change_a_patient_are_told(
    another_page: Callable[..., Page], page: Page, patient: int
) -> None:
    other = another_page(at=page.url)
    for window in (page, other):
        window.get_by_role("button", name="Change").click()
    page.get_by_label("Year of birth").fill("1961")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("Born 1961")).to_be_visible()

    other.get_by_label("Year of birth").fill("1962")
    other.get_by_role("button", name="Save", exact=True).click()
    conflict = other.locator(".error")
    expect(conflict).to_contain_text("changed in another window")
    expect(conflict).to_contain_text("Year of birth: stored now “1961”, yours “1962”")
    keep_picture(other, "patient-conflict")
    other.get_by_role("button", name="Save mine instead").click()
    expect(other.get_by_text("Born 1962")).to_be_visible()
    assert api(page, f"/api/patients/{patient}")["year_of_birth"] == 1962


def test_what_two_windows_change_apart_is_kept_of_both(
    another_page: Callable[..., Page], page: Page, patient: int
) -> None:
    other = another_page(at=page.url)
    for window, measure in ((page, "Hand length"), (other, "Palm length")):
        window.get_by_role("button", name="Change").click()
        window.get_by_text("Hand measures").click()
        window.get_by_role("group", name=f"{measure} (mm)").get_by_label("Left hand").fill(
            "100" if window is other else "180"
        )
    page.get_by_label("Dominant hand").select_option("right")
    other.get_by_label("Year of birth").fill("1961")
    for window in (page, other):
        window.get_by_role("button", name="Save", exact=True).click()
        expect(window.get_by_role("button", name="Change")).to_be_visible()
        with sent_late(window, "**/api/patients/*"):
            window.get_by_role("button", name="Save measures").click()
            window.get_by_role("button", name="Change").hover()
            window.mouse.down()
        expect(window.get_by_text("Saved.")).to_be_visible()
        window.mouse.up()  # what is told while a button is held down does not take it away
        expect(window.get_by_label("Year of birth")).to_be_visible()
    kept = api(page, f"/api/patients/{patient}")
    assert (kept["dominant_hand"], kept["year_of_birth"]) == ("right", 1961)
    assert kept["hand_measures"]["left"] == {"hand_length": 0.18, "palm_length": 0.1}


def test_patients_are_found_by_their_code_and_archived(page: Page, patient: int) -> None:
    code = api(page, f"/api/patients/{patient}")["pseudonym"]
    page.get_by_role("button", name="Move to the archive").click()
    expect(page.get_by_text("in the archive")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("in the archive")).to_be_hidden()
    expect(page.get_by_text("Taken out of the archive.")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("in the archive")).to_be_visible()
    page.get_by_role("link", name="Patients").first.click()
    shown(page.get_by_role("link", name="DEMO"))
    page.get_by_role("searchbox").fill("dem")
    expect(page.get_by_role("row")).to_have_count(2)
    page.get_by_role("searchbox").fill(code)
    expect(page.get_by_text(f"No patient code contains “{code}”")).to_be_visible()
    keep_picture(page, "patients-unmatched")
    page.get_by_label("Show the archive instead").check()
    expect(page.get_by_role("link", name=code)).to_be_visible()


def test_a_note_is_removed_and_brought_back_and_a_patient_erased_for_good(
    page: Page, patient: int
) -> None:
    code = api(page, f"/api/patients/{patient}")["pseudonym"]
    page.get_by_label("New note").fill("Prefers mornings.")
    page.get_by_role("button", name="Add note").click()
    page.get_by_role("button", name="Remove").click()
    expect(page.get_by_text("Note removed.")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("Prefers mornings.")).to_be_visible()
    with page.expect_download() as download:
        page.get_by_role("link", name="Export everything (zip)").click()
    assert download.value.suggested_filename.startswith(f"handscope-{code}-")
    assert zipfile.is_zipfile(download.value.path())

    page.get_by_text("Erase this patient for good…").click()
    typed = page.get_by_label(f"To erase, type the patient code: {code}")
    typed.fill("another")
    page.get_by_role("button", name="Erase for good").click()
    expect(page.locator(".error")).to_contain_text("nothing was erased")
    keep_picture(page, "patient-erase")
    typed.fill(code)
    page.get_by_role("button", name="Erase for good").click()
    expect(page.get_by_text("The patient was erased")).to_be_visible()
    keep_picture(page, "patient-erased")
    page.reload()
    expect(page.locator(".error")).to_contain_text("it may have been erased")
    page.get_by_role("link", name="Patients").first.click()
    page.get_by_label("Show the archive instead").check()
    expect(page.get_by_role("heading", name="Erased for good")).to_be_visible()
    keep_picture(page, "patients-archive")


def test_a_name_is_asked_about_and_kept_when_it_is_a_code(page: Page) -> None:
    page.get_by_role("button", name="New patient").click()
    page.get_by_label("Patient code").fill("Anna Berg, 12.3.1961")
    page.get_by_role("button", name="Create patient").click()
    expect(page.get_by_text("Is this a name, or a date of birth?")).to_be_visible()
    expect(page.get_by_text("It holds a date.")).to_be_visible()
    keep_picture(page, "patient-name")
    page.get_by_label("Patient code").fill("Cohort Alpha")
    page.get_by_role("button", name="Create patient").click()
    expect(page.get_by_text("It holds a date.")).to_be_hidden()
    page.get_by_role("button", name="It is a code: keep it").click()
    expect(page.get_by_role("heading", name="Cohort Alpha")).to_be_visible()


def test_a_session_left_open_overnight_is_finished_from_the_list(
    page: Page, patient: int, server: Server
) -> None:
    api(
        page,
        f"/api/patients/{patient}/sessions",
        "POST",
        data={"hand": "left", "port": "/dev/ttyABSENT"},
    )
    with (
        closing(sqlite3.connect(server.data / "handscope.sqlite", timeout=60)) as database,
        database,
    ):
        database.execute(
            "update session set started = datetime(started, '-20 hours') where patient_id = ?",
            (patient,),
        )
    page.reload()
    expect(page.get_by_text("not finished")).to_be_visible()
    keep_picture(page, "patient-unfinished")
    page.get_by_role("link", name="Patients").first.click()
    expect(page.get_by_text("was left open since")).to_be_visible()
    keep_picture(page, "patients-unfinished")
    page.get_by_role("button", name="Finish it now").click()
    expect(page.get_by_text("was left open since")).to_be_hidden()
    assert [s["state"] for s in api(page, f"/api/patients/{patient}")["sessions"]] == [
        "failed"
    ]  # nothing was plugged in


def test_a_code_that_is_taken_is_refused_beside_the_form(page: Page) -> None:
    page.get_by_role("button", name="New patient").click()
    page.get_by_label("Patient code").fill("DEMO")
    page.get_by_role("button", name="Create patient").click()
    expect(page.locator("form .error")).to_have_text(
        "there is already a patient 'DEMO'; choose another code"
    )


def test_an_address_that_leads_nowhere_says_what_to_do(page: Page, server: object) -> None:
    page.goto(page.url + "stations/nothing")
    expect(page.get_by_role("heading", name="This session view is closed")).to_be_visible()
    page.get_by_role("link", name="To the list of patients").click()
    expect(page.get_by_role("heading", name="Patients")).to_be_visible()


def put_landmarks(page: Page, marks: Mapping[str, Any]) -> None:
    """Each to its place, by arrow keys."""
    for name, (x, y) in marks.items():
        page.locator(f'[data-landmark="{name}"]').evaluate(
            "(dot, at) => { const key = (k) => dot.dispatchEvent(new KeyboardEvent('keydown', { key: k, bubbles: true }));"
            " const go = (now, to, less, more) => { for (let k = Math.round(to - now); k; k += k < 0 ? 1 : -1) key(k < 0 ? less : more); };"
            " go(+dot.getAttribute('cx'), at[0], 'ArrowLeft', 'ArrowRight');"
            " go(+dot.getAttribute('cy'), at[1], 'ArrowUp', 'ArrowDown'); }",
            [x, y],
        )


def test_a_photograph_gives_lengths_and_angles(page: Page, patient: int, tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    from handscope.validation.studies.rendered_photographs import render

    made = render(np.random.default_rng(8), "left", "a4", np.radians(12))
    picture = tmp_path / "hand.jpg"
    picture.write_bytes(made.jpeg)
    page.get_by_text("Pose sheet and photograph").click()
    sheet = page.get_by_role("link", name="Sheet, A4")
    assert page.request.get(str(sheet.get_attribute("href"))).body().startswith(b"%PDF")
    begin = page.get_by_role("button", name="Find the landmarks")
    begin.click()
    expect(page.get_by_text("Choose a photograph first.")).to_be_visible()
    page.locator('input[name="photograph"]').set_input_files(picture)
    begin.click()
    drawing = shown(page.locator("svg.landmarks"))
    put_landmarks(page, made.marks)
    keep_picture(page, "photograph-landmarks")
    tip = page.locator('[data-landmark="index_tip"]')
    before = tip.get_attribute("cx")
    box = tip.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] + 10, box["y"] + box["height"] / 2)  # a finger's width
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] + 12, box["y"] + box["height"] / 2)
    page.mouse.up()
    assert tip.get_attribute("cx") != before
    page.get_by_role("button", name="Measure", exact=True).click()
    expect(drawing).to_be_hidden()
    expect(page.locator("summary", has_text="Left hand,")).to_be_focused()  # what it gave is open
    expect(page.get_by_role("cell", name="°").first).to_be_visible()
    row = page.get_by_role("row", name="Thumb CMC, sideways")
    expect(row).to_have_text(re.compile(r"\d°\s±\s\d+\.\d° radial abd\.$"))  # not "-45.0°"
    keep_picture(page, "photograph-figures")
    page.get_by_role("button", name="Take the lengths over").click()
    expect(page.get_by_text("The lengths are in the hand measures.")).to_be_visible()
    stored = api(page, f"/api/patients/{patient}")["hand_measures"]["left"]
    assert abs(stored["palm_length"] - made.geometry.palm_length) < 3e-3
    page.get_by_role("button", name="Erase it").click()
    expect(page.locator("summary", has_text="Left hand,")).to_be_hidden()


def test_two_photographs_of_the_hand_as_it_lies_are_marked_one_after_the_other(
    page: Page, patient: int, tmp_path: Path
) -> None:
    pytest.importorskip("cv2")
    from handscope.validation.studies.rendered_photographs import render_sides

    tilts = [np.radians(18), np.radians(18)]
    sides = render_sides(np.random.default_rng(9), "left", "a4", tilts)
    page.get_by_text("Pose sheet and photograph").click()
    for name, side in zip(("photograph", "second_photograph"), sides):
        picture = tmp_path / f"{name}.jpg"
        picture.write_bytes(side.jpeg)
        page.locator(f'input[name="{name}"]').set_input_files(picture)
    keep_picture(page, "photographs-two")
    page.get_by_role("button", name="Find the landmarks").click()
    expect(page.get_by_role("heading", name="picture 1 of 2")).to_be_visible()
    put_landmarks(page, sides[0].marks)
    page.get_by_role("button", name="Next picture").click()
    expect(page.get_by_role("heading", name="picture 2 of 2")).to_be_visible()
    page.get_by_role("button", name="Measure", exact=True).click()  # proposed places: no hand's
    expect(page.get_by_text("the pictures do not agree")).to_be_visible()
    page.get_by_role("button", name="Find the landmarks").click()
    page.get_by_role("button", name="Next picture").click()  # the first is still marked
    put_landmarks(page, sides[1].marks)
    page.get_by_role("button", name="Measure", exact=True).click()
    shown(page.locator("summary", has_text="Left hand,"))
    expect(page.get_by_role("cell", name="°").first).to_be_visible()


@pytest.mark.parametrize("language", swept(["en", "de", "fr"], kept=["de"]))  # the longest words
def test_on_a_phone_a_row_of_the_patients_list_is_read_without_scrolling_sideways(
    page_without_scene: Page, server: Server, patient: int, language: str
) -> None:
    page = page_without_scene
    page.set_viewport_size({"width": 390, "height": 844})
    page.add_init_script(f"localStorage.setItem('handscope-language', '{language}')")
    page.goto(server.base)
    row = page.locator(".patients tbody tr").first
    shown(row)
    assert (
        page.evaluate(
            "() => { const box = document.querySelector('.patients').closest('.scroll'); return box.scrollWidth - box.clientWidth; }"
        )
        <= 0
    )
    box = row.bounding_box()
    assert box is not None and box["height"] < 80  # two lines
