"""A real server with virtual gloves, and real browsers on it; every page's console is listened to."""

import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path

import pytest
from playwright.sync_api import (
    Browser,
    BrowserContext,
    ConsoleMessage,
    Page,
    expect,
    sync_playwright,
)

from handscope.app.workers.process import CONTEXT
from tests import fork_server
from tests.browser import KEPT_APART, UNDRAWN, chromium
from tests.journeys.house import (
    LONG,
    RETRIES,
    Server,
    api,
    begun,
    new_patient,
    shots,
    shown,
    simulate,
)

SIZE = {"width": 1024, "height": 768}
NOISE = (
    "WebGL",
    "GPU stall",
    "THREE.Clock",
    "GL Driver",
    "Blocked script execution",
)  # what a browser without a graphics card says of the scene, and any of its page in a frame without scripts (static/patient/prefetch.js)
SELDOM = """
  const draws = window.requestAnimationFrame, drops = window.cancelAnimationFrame;
  const PAGE = 200, SCENE = 1000;  // ms between two pictures of a page, and of the scene once the hand stands in it
  const pause = () => {
    if (!location.pathname.startsWith("/scene/")) return PAGE;
    return window.__viserSceneTree?.getState()["/hand/palm"] === undefined ? 0 : SCENE;
  };
  window.requestAnimationFrame = (draw) => (pause() ? -setTimeout(() => draws(draw), pause()) : draws(draw));
  window.cancelAnimationFrame = (drawing) => (drawing < 0 ? clearTimeout(-drawing) : drops(drawing));
"""  # journeys ask what pages and scene hold; how the scene looks is tests/app/scene's
NO_SCENE = """
  HTMLIFrameElement.prototype.setAttribute = function (name, value) {
    const isScene = name === "src" && value.includes("/scene/");
    Element.prototype.setAttribute.call(this, isScene ? "srcdoc" : name, isScene ? "<!doctype html><title>Hand</title>" : value);
  };
"""  # not by a route: where there is one a browser keeps no file, and asks for all eighty of a page again


def drawn_seldom() -> str:
    """The script of a browser that draws seldom, and the scene not at all where nobody keeps pictures."""
    return SELDOM if shots() else SELDOM + UNDRAWN


def empty_scene(page: Page) -> None:
    """An empty page in the scene's place: without a graphics card the scene takes a good part of a core, also where it draws nothing."""
    page.add_init_script(NO_SCENE)


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("journeys")
    poses = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    poses.bind(("127.0.0.1", 0))
    poses.settimeout(LONG / 1000)
    words = [
        *("demo", "--no-browser", "--no-examples", "--port", "0", "--data", str(data)),
        *("--rate", "50"),  # half of a real glove's: every sample costs the two cores of the suite
        *("--allow-port", "socket://127.0.0.1:*", "--allow-port", "slimevr://127.0.0.1:*"),
        *("--allow-outlet", f"osc://127.0.0.1:{poses.getsockname()[1]}"),
    ]
    with poses, _running(words, data / "errors.log") as first:
        yield begun(first.split()[-1], data, poses)
    log = (data / "errors.log").read_text()
    assert "Traceback" not in log, log


@contextmanager
def _running(words: list[str], log: Path) -> Iterator[str]:
    """The program, until Ctrl-C ends it and its virtual gloves; gives the line that names its address."""
    out, its_out = CONTEXT.Pipe(duplex=False)
    with log.open("w") as errors:
        its_errors = Connection(os.dup(errors.fileno()), readable=False)
    process = CONTEXT.Process(target=fork_server.run, args=(words, its_out, its_errors))
    process.start()
    its_out.close(), its_errors.close()
    try:
        with out, open(out.fileno(), closefd=False) as said:
            first = next((line for line in said if "/login?token=" in line), None)
            assert first is not None, log.read_text()
            yield first
            assert process.pid is not None
            os.kill(process.pid, signal.SIGINT)
            process.join(LONG / 1000)
            assert process.exitcode == 130, log.read_text()
    finally:
        process.terminate()
        process.join()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """One Chromium for all journeys: no test here has an event loop of its own."""
    expect.set_options(timeout=LONG)  # a busy machine answers late
    with sync_playwright() as tool:
        one = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox", KEPT_APART])
        yield one
        one.close()


@pytest.fixture
def newcomer(browser: Browser) -> Iterator[Page]:
    """A browser that nobody has logged in."""
    context = browser.new_context(viewport=SIZE)  # type: ignore[arg-type]
    context.set_default_timeout(LONG)
    yield context.new_page()
    context.close()


@pytest.fixture(scope="package")
def with_files() -> list[BrowserContext]:
    """Browsers that nobody uses now and that keep the server's eighty files: a new one asks for each of them."""
    return []


@pytest.fixture
def another_page(
    browser: Browser, server: Server, with_files: list[BrowserContext]
) -> Iterator[Callable[..., Page]]:
    """Makes logged-in pages, opened at an address or not yet, with the 3-D scene or an empty one in its place, in a browser that keeps nothing of
    others but the server's files, if it is not to be a new one; at the end none of them may have met an error."""
    made: list[Page] = []
    usual: list[BrowserContext] = []
    complaints: list[str] = []

    def opened(**options: object) -> BrowserContext:
        always = {"viewport": SIZE, "accept_downloads": True, "base_url": server.base}
        context = browser.new_context(**{**always, **options})  # type: ignore[arg-type]
        context.set_default_timeout(LONG)
        context.add_init_script(drawn_seldom())
        return context

    def make(
        scene: bool = True, at: str | None = "/", new: bool = False, **options: object
    ) -> Page:
        context = opened(**options) if new or options or not with_files else with_files.pop()
        if not new and not options:
            usual.append(context)
        answer = context.request.post("/api/login", data={"token": server.token()})
        assert answer.ok, answer.text()
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(f"{page.url}: {error}"))
        page.on(
            "console",
            lambda said: (
                complaints.append(said.text)
                if said.type == "error" and not _expected(said)
                else None
            ),
        )
        if not scene:
            empty_scene(page)
        if at is not None:
            page.goto(at)
        made.append(page)
        return page

    yield make
    for page in made:
        _leave_gloves(page)
        if page.context in usual and not page.is_closed():
            _forget(page, server)
            with_files.append(page.context)
        else:
            page.context.close()
    assert complaints == []


def _forget(page: Page, server: Server) -> None:
    """Leave nothing in the browser but the server's files; no page stays open."""
    context = page.context
    stored = {"origin": server.base, "storageTypes": "cookies,local_storage,indexeddb"}
    context.new_cdp_session(page).send("Storage.clearDataForOrigin", stored)
    for one in context.pages:
        one.close()
    context.clear_cookies()
    context.clear_permissions()


def _leave_gloves(page: Page) -> None:
    """A test that failed in a session must not keep the glove from the next one."""
    answer = page.request.get("/api/stations", max_retries=RETRIES)
    for station in answer.json() if answer.ok else ():
        if station["kind"] == "live":
            page.request.delete(f"/api/stations/{station['station']}")


def _expected(said: ConsoleMessage) -> bool:
    """Noise of the machine, and a request that the API refused: the page says that itself."""
    return any(word in said.text for word in (*NOISE, "status of 401")) or (
        "Failed to load resource" in said.text and "/api/" in said.location["url"]
    )


@pytest.fixture
def page(another_page: Callable[..., Page], request: pytest.FixtureRequest) -> Page:
    """At the list of patients, or with `patient` at that one's."""
    return another_page(at=None if "patient" in request.fixturenames else "/")


@pytest.fixture
def page_without_scene(another_page: Callable[..., Page]) -> Page:
    """Not yet at any address."""
    return another_page(scene=False, at=None)


@pytest.fixture
def patient(page: Page) -> int:
    """A patient of this test's own, with its page open."""
    found = new_patient(page)
    page.goto(f"/patients/{found}")
    return found


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated tapping recording as a Motion-BIDS zip."""
    return simulate(tmp_path_factory.mktemp("recordings") / "tapping.zip", "tapping")


@pytest.fixture
def processed(page: Page, server: Server, recording: Path) -> int:
    """A session with results, made once and found again."""
    if server.processed is None:
        sent = {
            "file": {
                "name": recording.name,
                "mimeType": "application/zip",
                "buffer": recording.read_bytes(),
            }
        }
        told = api(page, "/api/patients/1/recordings", "POST", multipart=sent)
        page.goto(f"/sessions/{told['session']}")
        shown(page.get_by_text("Finger tapping"))
        server.processed = told["session"]
    assert api(page, f"/api/sessions/{server.processed}")["state"] == "processed"
    return server.processed
