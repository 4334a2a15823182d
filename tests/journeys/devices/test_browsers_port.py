"""A glove at the port of the clinician's own browser: not a byte is lost where the line is cut, the page reloaded, the server killed."""

import random
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page

from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.formats import recordings as formats_recordings
from tests.journeys.conftest import SIZE, drawn_seldom, empty_scene
from tests.journeys.devices.serial_bridge import PIECE, Bridge, Line, bridged
from tests.journeys.house import (
    LONG,
    ROOT,
    Server,
    api,
    begun,
    end_session,
    keep_picture,
    new_patient,
    newest_recording,
    shown,
)

pytestmark = [pytest.mark.browser, pytest.mark.process]
HANDSCOPE = [sys.executable, "-P", "-m", "handscope.app.cli"]
CUT, SECONDS = 20, 60  # s, of the slow journey
SENT = "() => localStorage.getItem('handscope-relay') === null"
# Fills a page's store whose files count their bytes and keep none; gives the bound, the bytes when it was full, and those after all was sent
FILLED = """async () => {
  const sizes = [];
  const file = (k) => ({
    getSize: () => sizes[k] ?? 0,
    write: (bytes, { at }) => (sizes[k] = Math.max(sizes[k] ?? 0, at + bytes.byteLength)),
    read: () => 0,
    truncate: (size) => (sizes[k] = size),
    flush: () => {},
    close: () => {},
  });
  let opened = 0;
  const handle = { createSyncAccessHandle: async () => file(opened++) };
  navigator.storage.getDirectory = async () => ({ getFileHandle: async () => handle });
  const { openStore } = await import("/static/relay/store.js");
  const store = await openStore(1);
  const piece = new Uint8Array(1 << 15);
  const kept = () => sizes.reduce((sum, size) => sum + size, 0);
  while (!store.full && kept() < 2 ** 31) store.put(piece, 0);
  const full = kept();
  store.forget(store.next);
  store.put(piece, 0);
  store.put(piece, 0);
  store.forget(store.next);
  store.put(piece, 0);
  return [2 ** 30, full, store.full ? kept() : 0];
}"""


@pytest.fixture
def line(server: Server) -> Iterator[Line]:
    parts = urlsplit(server.base)
    assert parts.hostname and parts.port
    with closing(Line(parts.hostname, parts.port)) as line:
        yield line


def opened(browser: Browser, server: Server, base: str, bridge: Bridge | None) -> Page:
    """A page that is logged in, with the glove at its browser's port."""
    context = browser.new_context(viewport=SIZE, base_url=base, ignore_https_errors=True)  # type: ignore[arg-type]
    context.set_default_timeout(LONG)
    assert context.request.post("/api/login", data={"token": server.token()}).ok
    page = context.new_page()
    context.add_init_script(drawn_seldom())
    empty_scene(page)
    if bridge is not None:
        bridge.into(context)
    return page


def begin_with_own_port(page: Page) -> str:
    """To the station of a session of the left hand; gives its address in the API."""
    page.goto(f"/patients/{new_patient(page)}")
    page.locator('input[name="hand"][value="left"]').check()
    page.get_by_role("radio", name="This browser's port").check()
    keep_picture(page, "own-port")
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    return f"/api/stations/{page.url.rsplit('/', 1)[1]}"


def wait_for_recorded(page: Page, station: str, seconds: float) -> None:
    while api(page, station)["glove"]["recorded"] < seconds:
        page.wait_for_timeout(200)


def require_every_byte(bridge: Bridge, data: Path) -> None:
    """The newest recording has what the glove sent, byte for byte, and no sample is missing."""
    newest = newest_recording(data)
    with newest.open("rb") as file:
        wire = b"".join(m.data for topic, m in read_messages(file, Findings()) if topic == "wire")
    end = bridge.require_all_of(wire)
    assert end >= bridge.taken
    recording = formats_recordings.load(newest)
    assert not any(recording.losses.values())
    assert (
        sum(len(stream.sensors) for stream in recording.streams if "mag" not in stream.name) == 17
    )


def test_no_byte_is_lost_where_the_line_is_cut_twice_and_the_page_reloaded(
    browser: Browser, server: Server, line: Line
) -> None:
    with bridged(server.data / "gloves" / "virtual-left-glove") as bridge:
        page = opened(browser, server, line.base, bridge)
        station = begin_with_own_port(page)
        shown(page.get_by_text("all 7 strips found"))
        shown(page.get_by_text("This browser reads the glove."))
        for _ in range(2):
            line.cut()
            shown(page.get_by_text(re.compile("No connection to the server. This browser goes on")))
            before = bridge.taken
            page.wait_for_timeout(1000)
            assert bridge.taken > before  # it is read meanwhile
            keep_picture(page, "own-port-away")
            line.mend()
            shown(page.get_by_text("This browser reads the glove."))
        page.reload()
        shown(page.get_by_text("This browser reads the glove."))
        wait_for_recorded(page, station, 6.0)
        end_session(page)
        page.wait_for_function(SENT)  # a browser that is closed sooner sends the rest later
        page.context.close()
        assert len(bridge.openings) == 2
        require_every_byte(bridge, server.data)


def test_bytes_that_come_a_second_time_are_not_taken_for_all() -> None:
    sent = random.Random(5).randbytes(8 * PIECE)
    bridge = Bridge(None, sent=bytearray(sent), openings=[0, 4 * PIECE])
    assert bridge.require_all_of(sent[: 5 * PIECE] + sent[4 * PIECE :]) == len(sent)
    for wire in (
        sent[: 7 * PIECE] + sent[4 * PIECE :],  # three pieces again
        sent[:PIECE] + sent[:PIECE] + sent[PIECE:],  # where no page was opened
        sent[: 3 * PIECE] + sent[4 * PIECE :],
    ):
        with pytest.raises(AssertionError, match=r"second time|missing"):
            bridge.require_all_of(wire)


def test_what_a_page_keeps_is_bounded_and_the_port_is_read_again_once_it_is_sent(
    page: Page, server: Server
) -> None:
    page.goto(f"{server.base}/login")
    most, when_full, after = page.evaluate(FILLED)
    assert most <= when_full < most + 2**20 and after == 0


def test_a_browser_that_cannot_read_a_port_says_which_one_can(
    browser: Browser, server: Server
) -> None:
    page = opened(browser, server, server.base, None)
    page.add_init_script("delete Navigator.prototype.serial")
    page.goto(f"/patients/{new_patient(page)}")
    shown(page.get_by_text(re.compile("use Chrome, Edge or Opera")))
    assert page.get_by_role("radio", name="This browser's port").is_disabled()
    page.context.close()


@pytest.mark.slow
def test_a_minute_behind_the_proxy_with_cuts_a_reload_and_a_killed_server_is_whole(
    browser: Browser, tmp_path: Path
) -> None:
    """17 sensors at 200 Hz; the proxy is Caddy with deploy/Caddyfile and TLS, where Caddy is installed, else there is none."""
    data = tmp_path / "data"
    with (
        printing(
            [*HANDSCOPE, "glove", "--tcp", "127.0.0.1:0", "--rate", "200"], "socket://"
        ) as glove,
        proxied(tmp_path) as (number, scheme, proxy),
        closing(Line("127.0.0.1", proxy, scheme)) as line,
        bridged(glove) as bridge,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as poses,
    ):
        serve = [*HANDSCOPE, "serve", "--data", str(data), "--port", str(number), "--print-login"]
        serve += ["--proxy", "127.0.0.1"]
        with printing(serve, "/login?token=", kill=True) as address:
            server = begun(address, data, poses)
            page = opened(browser, server, line.base, bridge)
            station = begin_with_own_port(page)
            shown(page.get_by_text("all 7 strips found"))
            for _ in range(2):
                line.cut()
                page.wait_for_timeout(1000 * CUT)
                line.mend()
                shown(page.get_by_text("This browser reads the glove."))
            page.reload()
            shown(page.get_by_text("This browser reads the glove."))
            wait_for_recorded(page, station, SECONDS)
            session = api(page, station)["session"]
        taken = bridge.taken
        with printing(serve, "/login?token="):
            page.wait_for_url(f"**/sessions/{session}*")
            page.wait_for_function(SENT)
            while api(page, f"/api/sessions/{session}")["state"] == "open":
                page.wait_for_timeout(500)
        page.context.close()
    assert bridge.taken > taken  # the browser read on while the server was away
    assert len(bridge.openings) == 2
    require_every_byte(bridge, data)
    newest = next(data.rglob("*.mcap"))
    seconds = {len(b.t) / 200 for b in formats_recordings.load(newest).samples.values()}
    assert max(seconds) > SECONDS


@contextmanager
def printing(words: list[str], wanted: str, kill: bool = False) -> Iterator[str]:
    """A program that runs; gives the word with `wanted` that it prints."""
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = (w for line in process.stdout for w in line.split() if wanted in w)
        try:
            yield next(found)
        finally:
            process.kill() if kill else process.terminate()


@contextmanager
def proxied(folder: Path) -> Iterator[tuple[int, str, int]]:
    """The port at which the server is to listen, the scheme of browsers, and the port that they call."""
    number, outside = free_port(), free_port()
    if shutil.which("caddy") is None:
        yield number, "http", number
        return
    site = (ROOT / "deploy" / "Caddyfile").read_text("utf-8")
    site = site.replace("{$HOST_NAME}", f"localhost:{outside}").replace("{$TLS}", "internal")
    site = site.replace("handscope:8420", f"127.0.0.1:{number}")
    options = "{\n admin off\n auto_https disable_redirects\n skip_install_trust\n}\n"
    (folder / "Caddyfile").write_text(options + site)
    words = ["caddy", "run", "--adapter", "caddyfile", "--config", str(folder / "Caddyfile")]
    home = {"HOME": str(folder), "XDG_DATA_HOME": str(folder), "PATH": "/usr/bin:/bin"}
    with (
        (folder / "caddy.log").open("w") as log,
        subprocess.Popen(words, env=home, stdout=log, stderr=log) as process,
    ):
        try:
            yield number, "https", outside
        finally:
            process.terminate()


def free_port() -> int:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        return int(free.getsockname()[1])
