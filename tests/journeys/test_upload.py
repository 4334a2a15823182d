"""A recording made elsewhere: numbers, another way of processing, the replay; and what bad files get."""

import csv
import io
import json
import math
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import (
    Server,
    api,
    figure,
    held_back,
    keep_picture,
    keep_screen,
    leave_scene,
    new_patient,
    scene_drawn,
    sent_late,
    shown,
    simulate,
)

pytestmark = pytest.mark.browser
HERE = "parseFloat(document.querySelector('.cursor')?.dataset.t)"


def upload(page: Page, name: str, content: bytes) -> None:
    page.get_by_label("Recording file").set_input_files(
        {"name": name, "mimeType": "application/zip", "buffer": content}
    )
    page.get_by_role("button", name="Upload and process").click()


def test_an_uploaded_recording_gives_numbers_and_a_replay(
    page: Page, patient: int, recording: Path
) -> None:
    address = page.url
    with sent_late(page, "**/recordings"):
        upload(page, "tapping.zip", recording.read_bytes())
        keep_screen(page, "sending-a-file")
        page.get_by_role("button", name="Stop sending").click()
        shown(page.get_by_text("Stopped; nothing of the file was kept."))
    page.goto(address)
    upload(page, "tapping.zip", recording.read_bytes())
    page.wait_for_url("**/sessions/*")
    page.reload()  # the computation does not belong to the page
    shown(page.get_by_role("heading", name="Finger tapping"))
    assert int(figure(page, "Taps")) > 20

    page.get_by_text("Tables and data").click()
    with sent_late(page, "**/derivative.zip"):
        page.get_by_role("button", name="Movement (Motion-BIDS zip)").click()
        shown(page.get_by_role("progressbar", name="Preparing"))
        keep_screen(page, "preparing-a-file")
        page.get_by_role("button", name="Stop", exact=True).click()
        shown(page.get_by_text("Stopped: handscope-session-"))

    page.get_by_text("Process again").click()
    page.get_by_text("Options of the method").click()
    page.get_by_label("Time constant of the accelerometer's correction", exact=False).fill("5")
    page.get_by_role("button", name="Process", exact=True).click()
    expect(shown(page.get_by_label("Result shown"))).to_contain_text("tau_acc = 5")

    shown(page.get_by_role("button", name="Replay in 3-D")).click()
    scene_drawn(page)
    leave_scene(page)
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


def test_a_recording_that_is_there_already_is_kept_again_and_said(
    page_without_scene: Page, server: Server, recording: Path
) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/patients/{new_patient(page)}")
    address, sessions = page.url, list[str]()
    for _ in range(2):
        page.goto(address)
        upload(page, "tapping.zip", recording.read_bytes())
        page.wait_for_url("**/sessions/*")
        sessions.append(page.url)
    warning = shown(page.get_by_text("The same recording was kept before"))
    keep_picture(page, "session-same-recording")
    warning.get_by_role("link").click()
    page.wait_for_url(sessions[0])
    shown(page.get_by_role("heading", level=1))
    expect(page.get_by_text("The same recording was kept before")).to_have_count(0)


def _with_unit(recording: bytes, unit: str) -> bytes:
    """The same recording with rad/s replaced in its channel tables."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(recording)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(
                name,
                content.replace(b"rad/s", unit.encode())
                if name.endswith("channels.tsv")
                else content,
            )
    return out.getvalue()


def test_a_file_is_sent_no_sooner_than_its_method_can_be_chosen(page: Page, patient: int) -> None:
    address = page.url
    with held_back(page, "**/api/methods"):
        page.goto(address)
        page.get_by_label("Recording file").set_input_files(
            {"name": "letter.zip", "mimeType": "application/zip", "buffer": b"x"}
        )
        send = page.get_by_role("button", name="Upload and process")
        expect(send).to_be_disabled()
    expect(send).to_be_enabled()


def test_bad_files_get_a_sentence_and_leave_no_session(
    page: Page, patient: int, recording: Path
) -> None:
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
    page.get_by_label("Recording file").set_input_files(
        {"name": "letter.pdf", "mimeType": "application/pdf", "buffer": b"x"}
    )
    expect(page.get_by_text("letter.pdf is no recording and no table")).to_be_visible()
    expect(page.get_by_role("button", name="Upload and process")).to_be_disabled()
    assert api(page, f"/api/patients/{patient}")["sessions"] == []
    page.reload()
    expect(page.get_by_text("No sessions yet")).to_be_visible()


def _changed(recording: bytes, ending: str, change: Callable[[str], str]) -> bytes:
    """The same recording with the text of the files that end so changed, and without the truth."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(recording)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if not name.startswith("derivatives/"):
                content = old.read(name)
                new.writestr(name, change(content.decode()) if name.endswith(ending) else content)
    return out.getvalue()


def _pushed_by_another(forces: str) -> str:
    """Both fingertips, while they grip, feel what no movement of theirs answers to."""
    rows = [[float(v) for v in row] for row in csv.reader(io.StringIO(forces), delimiter="\t")]
    for row in rows:
        push = 2.5 * math.sin(2 * math.pi * 0.37 * row[0]) + 2.0 * math.sin(
            2 * math.pi * 1.43 * row[0] + 1
        )
        for first in (1, 4):
            size = math.hypot(*row[first : first + 3])
            row[first : first + 3] = [
                v * (1 + push / size) if size > 0.5 else v for v in row[first : first + 3]
            ]
    return "".join("\t".join(map(repr, row)) + "\n" for row in rows)


def _in_millimetres(sidecar: str) -> str:
    told = json.loads(sidecar)
    for place in told["MagnetSetup"]["places"].values():
        place[:] = [1e3 * x for x in place]
    return json.dumps(told)


DOUBTED = {  # task with its options, the file that is changed, how, what the page says beside the figures and what in its card on trust
    "squeeze": ((), "force_motion.tsv", _pushed_by_another, "have nothing else touch or move the object", "No: 0 of 13 figures can be relied on"),
    "reach": (("--trunk",), "trunkmag_motion.json", _in_millimetres, "the warnings say what is wrong", "were these millimetres or centimetres?"),
}  # fmt: skip


@pytest.mark.parametrize("task", [pytest.param("squeeze", marks=pytest.mark.slow), "reach"])
def test_figures_that_cannot_be_trusted_say_why_and_what_to_do(
    page: Page, patient: int, tmp_path: Path, task: str
) -> None:
    options, file, change, beside, trust = DOUBTED[task]
    path = simulate(tmp_path / f"{task}.zip", task, *options)
    upload(page, path.name, _changed(path.read_bytes(), file, change))
    page.wait_for_url("**/sessions/*")
    card = page.locator(".card").filter(
        has=page.get_by_role("heading", name=task.capitalize(), exact=True)
    )
    shown(card)
    keep_picture(page, f"doubted-{task}")
    page.locator(".results").evaluate("element => element.scrollIntoView()")
    keep_screen(page, f"trust-{task}")
    expect(card).to_contain_text(beside)
    trusted = page.locator(".card").filter(
        has=page.get_by_role("heading", name="Can I trust these numbers?")
    )
    expect(page.locator(".results h2").first).to_have_text("Can I trust these numbers?")
    expect(trusted).to_contain_text(trust)
    expect(trusted).not_to_contain_text("Yes.")


def _exchanged(channels: str) -> str:
    """Two sensors of the index under each other's names."""
    return (
        channels.replace("index_middle", "index_between")
        .replace("index_distal", "index_middle")
        .replace("index_between", "index_distal")
    )


@pytest.mark.slow
def test_exchanged_sensors_are_named_with_what_to_do_and_lower_their_figures(
    page: Page, patient: int, tmp_path: Path
) -> None:
    path = simulate(tmp_path / "tapping.zip", "tapping")
    upload(page, path.name, _changed(path.read_bytes(), "imu_channels.tsv", _exchanged))
    page.wait_for_url("**/sessions/*")
    trusted = page.locator(".card").filter(
        has=page.get_by_role("heading", name="Can I trust these numbers?")
    )
    shown(trusted)
    keep_screen(page, "trust-exchanged")
    expect(trusted.locator(".trust")).not_to_contain_text("Yes.")
    expect(trusted).to_contain_text("doubtful sensor")
    expect(trusted).to_contain_text("index distal")
    expect(trusted).to_contain_text("exchanged")
    expect(trusted).to_contain_text("record again")


def test_what_the_movement_is_too_little_to_test_is_said_below_the_answer(
    page: Page, patient: int, tmp_path: Path
) -> None:
    """Thumb and index tap each in their own rhythm: nothing shows whether their strips are late."""
    path = simulate(tmp_path / "tapping.zip", "tapping")
    upload(page, path.name, path.read_bytes())
    page.wait_for_url("**/sessions/*")
    trusted = page.locator(".card").filter(
        has=page.get_by_role("heading", name="Can I trust these numbers?")
    )
    shown(trusted)
    untested = trusted.locator("details").filter(has_text="Not tested")
    untested.locator("summary").click()
    page.locator(".results").evaluate("element => element.scrollIntoView()")
    keep_screen(page, "untested")
    expect(untested).to_contain_text("A strip delay of 0.2 s would go unnoticed at")
    expect(untested).to_contain_text("index")
