"""A glove with a fault: the first step names the sensor and offers what puts it right; the recording keeps that, and its samples as they came."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from handscope.estimators.data.samples import GYR, Block
from handscope.sessions.files import native
from handscope.sessions.files.sensor_corrections import correct_recording
from handscope.sessions.formats import recordings as formats_recordings
from tests.app.devices.virtual import virtual_glove
from tests.journeys.house import (
    LONG,
    Server,
    act,
    end_session,
    keep_screen,
    name_port,
    new_patient,
    newest_recording,
    shown,
)

pytestmark = [pytest.mark.browser, pytest.mark.process, pytest.mark.slow]
FAULTS = {  # what is wrong with the glove, what the page says of it, what it offers, and its event
    "sign": (
        ("--task", "rom", "--negate", "index_middle:z"),
        "Index finger, middle segment: the z axis of its gyroscope has the wrong sign",
        "Correct the rates",
        "gyroscope index_middle 1 0 0 0 1 0 0 0 -1",
    ),
    "exchange": (
        ("--task", "powerglove_11_tapping", "--exchange", "index_proximal", "index_middle"),
        "index finger, first segment and index finger, middle segment are probably exchanged",
        "Exchange",
        "exchange index_proximal index_middle",
    ),
}


def begin(page: Page, server: Server, port: Path) -> None:
    name_port(page, f"{server.base}/patients/{new_patient(page)}", port)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue"))


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_and_put_right_in_the_first_step_and_samples_stay_raw(
    page_without_scene: Page, server: Server, tmp_path: Path, fault: str
) -> None:
    page, (words, said, offered, kept) = page_without_scene, FAULTS[fault]
    worn = ("--hand", "left", "--strips", "index,ring", "--rate", "50")
    with virtual_glove(tmp_path / "glove", *worn, *words) as port:
        begin(page, server, port)
        noticed = page.get_by_role("status").filter(has_text="Noticed at the sensors")
        found = shown(noticed, 2 * LONG)  # an exchange may need the third check
        expect(found).to_contain_text(said)
        expect(act(page, "correct")).to_contain_text(offered)
        expect(act(page, "correct")).to_contain_text("middle segment")
        keep_screen(page, f"correction-{fault}")
        act(page, "correct").click()
        expect(found).to_be_hidden()  # read anew, nothing is wrong any more
        page.wait_for_timeout(2000)
        end_session(page)
    newest = newest_recording(server.data)
    read = formats_recordings.load(newest)
    (event,) = [e for e in read.events if e.trial_type == "correction"]
    assert event.details["correction"] == kept
    assert any("as a correction in the recording says" in w for w in read.warnings)
    raw = native.load(newest, None, True)  # calibrated as in the factory, not corrected
    expected = correct_recording(raw)
    for name, block in raw.samples.items():
        np.testing.assert_array_equal(read.samples[name].values, expected.samples[name].values)
        if {"index_proximal", "index_middle"} <= {*block.stream.sensors}:
            assert _differs(block, read.samples[name])


def _differs(raw: Block, read: Block) -> bool:
    """Whether either the rates or the names are others than in the file."""
    return raw.stream.sensors != read.stream.sensors or not np.array_equal(
        raw.of(GYR), read.of(GYR), equal_nan=True
    )
