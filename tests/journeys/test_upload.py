"""A recording made elsewhere: numbers, another way of processing, the replay; and what bad files get."""

import io
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import api, figure, held_back, keep_picture, scene_drawn, shown

pytestmark = pytest.mark.browser
HERE = "parseFloat(document.querySelector('.cursor')?.dataset.t)"


def upload(page: Page, name: str, content: bytes) -> None:
    page.get_by_label("Recording file").set_input_files({"name": name, "mimeType": "application/zip", "buffer": content})
    page.get_by_role("button", name="Upload and process").click()


def test_an_uploaded_recording_gives_numbers_and_a_replay(page: Page, patient: int, recording: Path) -> None:
    upload(page, "tapping.zip", recording.read_bytes())
    page.wait_for_url("**/sessions/*")
    page.reload()  # the computation does not belong to the page
    shown(page.get_by_role("heading", name="Finger tapping"))
    assert int(figure(page, "Taps")) > 20

    page.get_by_text("Process again").click()
    page.get_by_text("Options of the method").click()
    page.get_by_label("Time constant of the accelerometer's correction", exact=False).fill("5")
    page.get_by_role("button", name="Process", exact=True).click()
    expect(shown(page.get_by_label("Result shown"))).to_contain_text("tau_acc = 5")

    shown(page.get_by_role("button", name="Replay in 3-D")).click()
    scene_drawn(page)
    shown(page.locator(".cursor"))
    page.get_by_role("button", name="Play").click()
    page.wait_for_function(f"() => {HERE} > 1")
    keep_picture(page, "replay")
    page.get_by_role("button", name="Pause").click()
    shown(page.get_by_role("button", name="Play"))
    page.get_by_role("slider", name="Time in the recording").fill("12")
    page.wait_for_function(f"() => Math.abs({HERE} - 12) < 0.05")
    expect(page.get_by_role("row", name="Index").first).to_contain_text("flexed")
    page.get_by_role("button", name="Initial pose 0:").click()
    page.wait_for_function(f"() => {HERE} < 6")
    page.get_by_role("link", name="Back to the results").click()
    page.wait_for_url("**/sessions/*")


def _with_unit(recording: bytes, unit: str) -> bytes:
    """The same recording with rad/s replaced in its channel tables."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(recording)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b"rad/s", unit.encode()) if name.endswith("channels.tsv") else content)
    return out.getvalue()


def test_a_file_is_sent_no_sooner_than_its_method_can_be_chosen(page: Page, patient: int) -> None:
    address = page.url
    with held_back(page, "**/api/methods"):
        page.goto(address)
        page.get_by_label("Recording file").set_input_files({"name": "letter.zip", "mimeType": "application/zip", "buffer": b"x"})
        send = page.get_by_role("button", name="Upload and process")
        expect(send).to_be_disabled()
    expect(send).to_be_enabled()


def test_bad_files_get_a_sentence_and_leave_no_session(page: Page, patient: int, recording: Path) -> None:
    whole = recording.read_bytes()
    bad = {
        "letter.zip": (b"Dear colleague", "letter.zip"),
        "cut.zip": (whole[: len(whole) // 2], "cut.zip"),
        "units.zip": (_with_unit(whole, "furlong/s"), "furlong/s"),
    }
    for name, (content, word) in bad.items():
        upload(page, name, content)
        alert = shown(page.locator(".error").filter(has_text=word))
        assert len(alert.inner_text()) < 400
        keep_picture(page, f"upload-{name.removesuffix('.zip')}")
    page.get_by_label("Recording file").set_input_files({"name": "letter.pdf", "mimeType": "application/pdf", "buffer": b"x"})
    expect(page.get_by_text("letter.pdf is neither a .zip nor a .mcap file")).to_be_visible()
    expect(page.get_by_role("button", name="Upload and process")).to_be_disabled()
    assert api(page, f"/api/patients/{patient}")["sessions"] == []
    page.reload()
    expect(page.get_by_text("No sessions yet")).to_be_visible()
