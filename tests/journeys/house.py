"""What the journeys share: the running server, and small steps that several of them take."""

import itertools
import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Frame, Locator, Page, Route, TimeoutError, expect

from handscope.app.auth.gate import new_token
from handscope.app.cli import main

ROOT = Path(__file__).parents[2]
NUMBERS = itertools.count(1)  # of patients made here
SIZES = {"wide": (1440, 900), "tablet": (1024, 768)}
LONG = 180_000  # ms that anything may take: a pose or a task, a computation, the scene on a machine that gives a tenth of a core
QUESTION = 10_000  # ms until a question that does not stand there has gone
RETRIES = 2  # of a question on a connection that the server has just closed, since nobody asked for some seconds


@dataclass
class Server:
    """A server that runs: its address, its data folder, the printed address that lets in once."""

    base: str
    data: Path
    first_address: str
    poses: socket.socket  # what sessions send by OSC, where one was asked to
    processed: int | None = None

    def address(self) -> str:
        """Another address that lets in once."""
        return f"{self.base}/login?token={self.token()}"

    def token(self) -> str:
        """Another code that lets in once."""
        return new_token(self.data)


def begun(address: str, data: Path, poses: socket.socket) -> Server:
    parts = urlsplit(address)
    return Server(f"{parts.scheme}://{parts.netloc}", data, address, poses)


def api(page: Page, path: str, method: str = "GET", **more: Any) -> Any:
    """Ask the API with the login of the page's browser."""
    answer = page.request.fetch(
        path, method=method, max_retries=RETRIES if method == "GET" else 0, **more
    )
    assert answer.ok, answer.text()
    return answer.json() if answer.status != 204 else None


def new_patient(page: Page) -> int:
    """A patient with a code that nobody has."""
    made: int = api(
        page,
        "/api/patients",
        "POST",
        data={"pseudonym": f"J-{next(NUMBERS):03d}", "affected_hand": "left"},
    )["id"]
    return made


def simulate(path: Path, task: str, *options: str) -> Path:
    """A simulated recording of the left hand as a Motion-BIDS zip."""
    with redirect_stdout(None):
        assert main(["simulate", task, "--hand", "left", *options, "--out", str(path)]) == 0
    return path


def newest_recording(data: Path) -> Path:
    """The file of the recording that was written last."""
    return max(data.rglob("*.mcap"), key=lambda path: path.stat().st_mtime)


def shown(what: Locator, timeout: float = LONG) -> Locator:
    """Wait until it is there."""
    expect(what.first).to_be_visible(timeout=timeout)
    return what.first


def act(page: Page, name: str) -> Locator:
    """The wizard's button for an action."""
    return page.locator(f'[data-act="{name}"]')


def begin_session(page: Page, hand: str, glove: str = "") -> str:
    """From a patient's page to the station; gives its name."""
    page.locator(f'input[name="hand"][value="{hand}"]').check()
    page.get_by_role("radio", name=f"Virtual {glove or hand} glove").check()
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    return page.url.rsplit("/", 1)[1]


def name_port(page: Page, patient_page: str, port: Path) -> None:
    """On the patient's page a session of the left hand with a glove at a port that is not in the list; not begun yet."""
    page.goto(patient_page)
    page.locator('input[name="hand"][value="left"]').check()
    page.get_by_role("radio", name="Another port").check()
    page.get_by_label("Port", exact=True).fill(str(port))


@contextmanager
def held_back(page: Page, address: str) -> Iterator[None]:
    """What the pages within ask of this address is sent only at the end of the block; the page that was open is left."""
    page.goto("about:blank")  # else its own questions would be held in place of the next page's
    with sent_late(page, address):
        yield


@contextmanager
def sent_late(page: Page, address: str) -> Iterator[None]:
    """What the page asks of this address within is sent only at the end of the block."""
    held: list[Route] = []
    page.route(address, lambda route: held.append(route))
    yield
    for route in held:
        route.continue_()
    page.unroute(address)


def skip_task(page: Page, task: str, reason: str) -> None:
    """Not without a reason."""
    page.locator(f'[data-task="{task}"]').click()
    act(page, "skip").click()
    page.get_by_role("button", name="Skip this task").click()
    expect(page.get_by_text("Give a reason")).to_be_visible()
    keep_picture(page, "station-skip")
    page.get_by_role("button", name=reason).click()
    page.get_by_role("button", name="Skip this task").click()
    expect(page.locator(f'[data-task="{task}"]')).to_contain_text("skipped")


def end_trial(page: Page) -> None:
    """End the trial that runs; on a busy machine it may have come to its end meanwhile."""
    with suppress(TimeoutError):
        act(page, "stop").click(timeout=QUESTION)


def end_session(page: Page) -> None:
    """End it early, from any step; where the step changes meanwhile the question goes with it, and is asked for again."""
    opener = page.locator('[data-act="finish"], .ending > button').filter(visible=True)
    sure = page.get_by_role("button", name=re.compile("Yes, (finish|end it)")).filter(visible=True)
    with suppress(TimeoutError):
        opener.click()
        sure.click(timeout=QUESTION)
        page.wait_for_url("**/sessions/*")
        return
    opener.click()
    sure.click()
    page.wait_for_url("**/sessions/*")


def figure(page: Page, name: str) -> str:
    """The value beside a name in a table."""
    row = page.get_by_role("row").filter(has=page.get_by_role("rowheader", name=name, exact=True))
    return row.get_by_role("cell").first.inner_text()


def scene_drawn(page: Page) -> Frame:
    """Wait until the hand stands in the 3-D scene; gives the scene's frame."""
    scene = page.locator("iframe[title]")  # another may still fetch ahead
    shown(scene)
    frame = scene.element_handle().content_frame()
    assert frame is not None
    frame.wait_for_function("() => window.__viserSceneTree?.getState()['/hand/palm'] !== undefined")
    return frame


def leave_scene(page: Page) -> None:
    """An empty page takes the place of a scene that was looked at, where no pictures are kept: it costs half as much as all else of a session."""
    if not shots():
        page.locator("iframe[title]").evaluate(
            "(scene) => { scene.srcdoc = '<!doctype html><title>Hand</title>'; }"
        )


def shots() -> str:
    """The folder for screenshots, where HANDSCOPE_SHOTS names one."""
    return os.environ.get("HANDSCOPE_SHOTS", "")


def keep_picture(page: Page, name: str) -> None:
    """Screenshots at both sizes, where they are wanted."""
    if folder := shots():
        before = page.viewport_size
        for size, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            page.screenshot(
                path=Path(folder) / f"{name}-{size}.png",
                full_page=not page.locator("iframe").count(),
            )
        if before:
            page.set_viewport_size(before)


def keep_screen(page: Page, name: str) -> None:
    """Screenshots of what fills the window: a wide screen, a tablet and a phone, light and dark, where they are wanted."""
    if folder := shots():
        before = page.viewport_size
        for width, height in ((1440, 900), (1024, 768), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
                page.screenshot(path=Path(folder) / f"{name}-{width}-{scheme}.png")
        page.emulate_media(color_scheme="light")
        if before:
            page.set_viewport_size(before)
