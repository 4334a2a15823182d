"""A link to our own page that names a stranger's server: with our policy the page does not talk to it, without the policy it would."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Browser, Page
from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from handscope.app.scene.bridge import PROTOCOL
from handscope.app.scene.hand_scene import HandScene
from tests.app.scene.small_site import COOKIE, SELDOM, Site, eventually, site
from tests.browser import UNDRAWN

pytestmark = pytest.mark.browser


@dataclass
class Stranger:
    """A server that notes who comes."""

    port: int
    visits: list[str] = field(default_factory=list)


@contextmanager
def stranger() -> Iterator[Stranger]:
    listener = socket.create_server(("127.0.0.1", 0))
    here, loop, stop = (
        Stranger(listener.getsockname()[1]),
        asyncio.new_event_loop(),
        asyncio.Event(),
    )

    def note(connection: ServerConnection, request: Request) -> Response | None:
        here.visits.append(request.path)
        return None if request.headers.get("Upgrade") else connection.respond(200, "")  # type: ignore[arg-type]

    async def stay(connection: ServerConnection) -> None:
        await connection.wait_closed()

    async def run() -> None:
        async with serve(stay, sock=listener, subprotocols=[PROTOCOL], process_request=note):
            await stop.wait()

    thread = threading.Thread(target=lambda: loop.run_until_complete(run()))
    thread.start()
    try:
        yield here
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(20)
        loop.close()


@pytest.fixture(scope="module")
def without_policy(scene: HandScene) -> Iterator[Site]:
    with site(scene, with_policy=False) as here:
        yield here


@contextmanager
def following(browser: Browser, where: Site, query: str) -> Iterator[tuple[Page, list[str]]]:
    """Somebody logged in follows a link; what the page then writes on its console."""
    context, said = browser.new_context(viewport={"width": 320, "height": 240}), []
    context.add_cookies([{**COOKIE, "url": f"http://{where.host}"}])  # type: ignore[list-item, typeddict-item]
    context.add_init_script(SELDOM + UNDRAWN)
    page = context.new_page()
    page.on("console", lambda line: said.append(line.text))
    page.goto(where.address + query)
    try:
        yield page, said
    finally:
        context.close()


LINKS = {
    "websocket": "?websocket=ws://127.0.0.1:{port}/evil",
    "playback": "?playbackPath=http://127.0.0.1:{port}/evil.viser",
}


@pytest.mark.parametrize("kind", LINKS)
def test_without_the_policy_a_link_takes_the_page_to_a_stranger(
    browser: Browser, without_policy: Site, kind: str
) -> None:
    with (
        stranger() as evil,
        following(browser, without_policy, LINKS[kind].format(port=evil.port)) as (page, _),
    ):
        eventually(lambda: page.title() and evil.visits)
        assert evil.visits[0].startswith("/evil")


def test_with_the_policy_a_link_does_not_take_the_page_to_a_strangers_recording(
    browser: Browser, served: Site
) -> None:
    with (
        stranger() as evil,
        following(browser, served, LINKS["playback"].format(port=evil.port)) as (page, said),
    ):
        eventually(lambda: any(str(evil.port) in line for line in violations(page, said)))
        assert evil.visits == []


def test_with_the_policy_a_link_does_not_take_the_page_to_a_strangers_scene(
    browser: Browser, served: Site
) -> None:
    with (
        stranger() as evil,
        following(browser, served, LINKS["websocket"].format(port=evil.port)) as (page, said),
    ):
        eventually(
            lambda: (
                page.title()
                and any("Connecting to" in line and str(evil.port) in line for line in said)
            )
        )
        again = "url => new Promise(done => { addEventListener('securitypolicyviolation', e => done(e.blockedURI)); new WebSocket(url); })"
        blocked = page.workers[0].evaluate(
            again, f"ws://127.0.0.1:{evil.port}/evil"
        )  # the page's own attempt was before this one
        assert str(evil.port) in blocked
        assert evil.visits == []


INLINE = """() => {
  const written = document.createElement("script");
  written.textContent = "document.title = 'ran'";
  document.head.append(written);
  document.body.insertAdjacentHTML("beforeend", "<img src='data:,' onerror='document.title = `ran`'>");
}"""


def test_with_the_policy_only_visers_own_scripts_run(browser: Browser, served: Site) -> None:
    with following(browser, served, "") as (page, said):
        page.wait_for_selector("canvas")  # viser's do
        assert violations(page, said) == []
        page.evaluate(INLINE)
        eventually(lambda: len([line for line in violations(page, said) if "inline" in line]) >= 2)
        assert page.title() == "Hand"


def violations(page: Page, said: list[str]) -> list[str]:
    """What the policy refused so far, as the browser says it."""
    page.title()  # lets the browser's messages in
    return [line for line in said if "Content Security Policy" in line]


def test_a_strangers_page_cannot_reach_the_scene(browser: Browser, scene: HandScene) -> None:
    """What plain viser allows: any page the clinician has open connects to the loopback port and reads along."""
    context = browser.new_context()
    page = context.new_page()
    page.route(
        "http://evil.example/",
        lambda route: route.fulfill(body="<p>evil</p>", content_type="text/html"),
    )
    page.goto("http://evil.example/")
    tried = "([port, protocol]) => new Promise(done => { const s = new WebSocket(`ws://127.0.0.1:${port}`, [protocol]); s.onopen = () => done('open'); s.onclose = () => done('closed'); })"
    assert page.evaluate(tried, [scene.port, PROTOCOL]) == "closed"
    context.close()
