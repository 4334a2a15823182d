"""A glove of another maker, written in another language, in the network: opened from the page where the administrator allowed it."""

import re
import shutil

import pytest
from playwright.sync_api import Page

import handscope
from handscope.sessions.formats import recordings as formats_recordings
from tests.app.devices.test_foreign_glove import RATE, foreign_glove
from tests.journeys.house import Server, act, api, name_port, new_patient, newest_recording, shown

pytestmark = [
    pytest.mark.browser,
    pytest.mark.process,
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("perl") is None, reason="there is no Perl here"),
]


@pytest.mark.parametrize("seconds", [5.0, 60.0])
def test_an_allowed_glove_in_the_network_is_recorded_whole_and_assessed(
    seconds: float, page_without_scene: Page, server: Server
) -> None:
    page = page_without_scene
    patient = f"/patients/{new_patient(page)}"
    with foreign_glove(600) as url:
        name_port(page, patient, url.replace("127.0.0.1", "localhost"))
        page.get_by_role("button", name="Start session").click()
        shown(page.get_by_role("alert").filter(has_text="--allow-port"))
        page.get_by_label("Port", exact=True).fill(url)
        page.get_by_role("checkbox", name="osc://127.0.0.1").check()
        page.get_by_role("button", name="Start session").click()
        page.wait_for_url("**/stations/*")
        station = f"/api/stations/{page.url.rsplit('/', 1)[1]}"
        shown(page.get_by_text("all 7 strips found"))
        shown(act(page, "continue")).click()
        shown(act(page, "start")).click()
        shown(act(page, "accept")).click()
        shown(page.locator('[data-task="rom_fist"]')).click()
        shown(act(page, "start")).click()
        shown(page.get_by_text("Seconds left"))
        shown(act(page, "stop")).click()
        shown(act(page, "accept")).click()
        page.locator(".streams summary").click()
        page.get_by_role("button", name="New token").click()
        code = shown(page.locator(".streams code")).inner_text()
        poses = handscope.stream(server.base, code.split('"')[3])
        assert "index_pip_flexion" in next(iter(poses)).angles
        page.locator(".streams").get_by_role("button", name="End").click()
        assert len(list(poses)) < 1000  # the loop ends
        heading = re.compile(rb"/handscope/(left|right)/angle/index_pip_flexion\0")
        assert any(heading.search(server.poses.recv(2000)) for _ in range(200))
        while api(page, station)["glove"]["recorded"] < seconds:
            page.wait_for_timeout(500)
        shown(act(page, "finish")).click()
        page.get_by_role("button", name="Yes, finish").click()
        page.wait_for_url("**/sessions/*")
    shown(page.get_by_role("heading", name="Range of motion"))
    newest = newest_recording(server.data)
    recording = formats_recordings.load(newest)
    assert not any(recording.losses.values())
    assert sum(len(stream.sensors) for stream in recording.streams) == 17
    assert all(len(block.t) > seconds * RATE for block in recording.samples.values())
