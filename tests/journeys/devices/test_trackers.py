"""SlimeVR trackers on the connect step: which one sits where is found by shaking, set by a person, and offered again."""

import json
import math
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from handscope.sessions.files.continued_recording import first_metadata
from handscope.sessions.formats import recordings as formats_recordings
from tests.app.devices.sources import slime_trackers as slime
from tests.journeys.house import (
    Server,
    end_session,
    keep_picture,
    name_port,
    new_patient,
    shown,
)

pytestmark = [pytest.mark.browser, pytest.mark.process]
MACS = [bytes.fromhex(f"a4cf120000{k:02x}") for k in (7, 8)]
NAMES = [":".join(f"{b:02X}" for b in mac) + "/0" for mac in MACS]
STEP = 0.02  # s between two orientations


class Trackers:
    """Two trackers whose firmware says no place; `shaken` is the one that turns."""

    def __init__(self, port: int) -> None:
        self.shaken = -1
        self.tapped = -1
        self._address = "127.0.0.1", port
        self._stop = threading.Event()

    def run(self) -> None:
        sockets = [slime.tracker_socket() for _ in MACS]
        numbers, angle = [0] * len(MACS), 0.0
        next_handshake = 0.0
        while not self._stop.wait(STEP):
            if time.monotonic() > next_handshake:  # until there is a server, and after it restarts
                next_handshake = time.monotonic() + 1.0
                numbers = [0] * len(MACS)
                for k, mac in enumerate(MACS):
                    sockets[k].sendto(slime.handshake(mac), self._address)
                    self._send(
                        sockets[k], numbers, k, 12, slime.struct.pack(">2f", 3.9, 0.4 + 0.5 * k)
                    )
                    self._send(
                        sockets[k], numbers, k, 19, slime.struct.pack(">Bb", 0, -50 - 30 * k)
                    )
            angle += STEP * 4.0  # rad/s
            for k in range(len(MACS)):
                half = 0.5 * angle if k == self.shaken else 0.0
                q = (math.cos(half), 0.0, 0.0, math.sin(half))
                self._send(sockets[k], numbers, k, 17, slime.rotation(0, q))
            if self.tapped >= 0:
                k, self.tapped = self.tapped, -1
                self._send(sockets[k], numbers, k, 13, bytes([0, 1]))
        for one in sockets:
            one.close()

    def _send(
        self, socket: slime.socket.socket, numbers: list[int], k: int, kind: int, body: bytes
    ) -> None:
        numbers[k] += 1
        socket.sendto(slime.packet(kind, numbers[k], body), self._address)

    def stop(self) -> None:
        self._stop.set()


@pytest.fixture
def trackers() -> Iterator[tuple[Trackers, str]]:
    """Trackers that run, and the address at which Handscope is to listen for them."""
    with closing(slime.tracker_socket()) as free:
        port = free.getsockname()[1]
    some = Trackers(port)
    thread = threading.Thread(target=some.run, daemon=True)
    thread.start()
    yield some, f"slimevr://127.0.0.1:{port}"
    some.stop()
    thread.join(10)


@contextmanager
def session(page: Page, patient: str, address: str) -> Iterator[list[Locator]]:
    """A session on its connect step; the rows of both trackers."""
    name_port(page, patient, Path("x"))
    page.get_by_label("Port", exact=True).fill(address)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(page.get_by_text("Which tracker is where?"))
    yield [shown(page.get_by_role("row").filter(has_text=name)) for name in NAMES]
    end_session(page)


def test_a_tracker_is_found_by_shaking_placed_and_offered_again(
    page_without_scene: Page, server: Server, trackers: tuple[Trackers, str]
) -> None:
    (some, address), page = trackers, page_without_scene
    patient = f"/patients/{new_patient(page)}"
    with session(page, patient, address) as rows:
        shown(rows[0].get_by_text("battery 40 %, signal -50 dBm"))
        shown(rows[1].get_by_text("weak signal (-80 dBm)"))
        some.shaken = 1
        shown(rows[1].get_by_text("is shaken"))
        expect(rows[1]).to_have_class("lit")
        keep_picture(page, "trackers")
        some.shaken = -1
        some.tapped = 0
        shown(rows[0].get_by_text("was tapped"))
        rows[1].get_by_role("combobox").select_option("hand")
        rows[0].get_by_role("combobox").select_option("index_middle")
        shown(page.get_by_text("all 2 strips found"))
    with session(page, patient, address) as rows:
        expect(rows[0].get_by_role("combobox")).to_have_value("index_middle")
        expect(rows[1].get_by_role("combobox")).to_have_value("hand")
        shown(page.get_by_text("all 2 strips found"))
        rows[0].get_by_role("combobox").select_option("hand")  # from the other one
        expect(rows[1].get_by_role("combobox")).to_have_value("")
        keep_picture(page, "trackers-again")
    newest = sorted(server.data.rglob("*.mcap"), key=lambda path: path.stat().st_mtime)[-2:]
    measured = [{p for s in formats_recordings.load(f).streams for p in s.sensors} for f in newest]
    assert measured == [{"hand", "index_middle"}, {"hand", "index_middle"}]
    assert first_metadata(newest[1])["tracker_places"] == {
        NAMES[0]: "index_middle",
        NAMES[1]: "hand",
    }
    stored = json.loads((server.data / "tracker_places.json").read_text("utf-8"))["left"]
    assert (stored[NAMES[0]], stored[NAMES[1]]) == ("hand", "")
