"""The viser server lets nobody in but who knows its word, serves no page and opens no tunnel."""

import logging
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest
from viser import ViserServer
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from handscope.app.scene import postures
from handscope.app.scene.bridge import PROTOCOL
from handscope.app.scene.hand_scene import HandScene
from handscope.app.scene.loopback_server import make_server, quiet
from handscope.estimators.hand.geometry import sized
from tests.app.scene.small_site import WAIT, eventually


@contextmanager
def started(guarded: bool) -> Iterator[tuple[ViserServer, str]]:
    """Ours, or viser's as it comes."""
    if guarded:
        server, secret = make_server()
    else:
        with quiet():
            server, secret = ViserServer(host="127.0.0.1", port=0, verbose=False), ""
    try:
        yield server, secret
    finally:
        with quiet():
            server.stop()


def connected(port: int, origin: str | None) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{port}",
        subprotocols=[PROTOCOL],
        origin=origin,
        compression=None,
        max_size=None,
        proxy=None,
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "origin", [None, "http://evil.example", "http://127.0.0.1", "null", "scene-"]
)
def test_a_connection_without_the_word_is_refused(origin: str | None) -> None:
    with started(guarded=True) as (server, _), pytest.raises(InvalidStatus) as refusal:
        connected(server.get_port(), origin)
    assert refusal.value.response.status_code == 403


def test_as_it_comes_viser_lets_any_page_in() -> None:
    with (
        started(guarded=False) as (server, _),
        connected(server.get_port(), "http://evil.example") as stranger,
    ):
        assert isinstance(stranger.recv(timeout=WAIT), bytes)


def test_a_connection_with_the_word_gets_the_scene() -> None:
    with started(guarded=True) as (server, secret), connected(server.get_port(), secret) as viewer:
        assert isinstance(viewer.recv(timeout=WAIT), bytes)


def test_two_servers_have_different_words_and_ports() -> None:
    with started(guarded=True) as (one, first), started(guarded=True) as (two, second):
        assert first != second and one.get_port() != two.get_port()
        with pytest.raises(InvalidStatus):
            connected(two.get_port(), first)


def test_it_listens_on_the_loopback_address_only() -> None:
    with started(guarded=True) as (server, secret):
        assert server.get_host() == "127.0.0.1"
        with pytest.raises(ConnectionRefusedError):
            connect(
                f"ws://127.0.0.2:{server.get_port()}",
                subprotocols=[PROTOCOL],
                origin=secret,
                proxy=None,
            )  # type: ignore[arg-type]


@pytest.mark.parametrize("guarded", [True, False])
def test_it_serves_no_page(guarded: bool) -> None:
    """viser's own page carries no policy, and cookies know no ports: from there a stranger's script could use the clinician's login."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with started(guarded) as (server, _):
        address = f"http://127.0.0.1:{server.get_port()}/"
        if not guarded:
            with opener.open(address, timeout=WAIT) as page:
                assert page.status == 200
            return
        with pytest.raises(urllib.error.HTTPError) as refusal:
            opener.open(address, timeout=WAIT)
        assert refusal.value.code == 404
        refusal.value.close()


@pytest.mark.parametrize("guarded", [True, False])
def test_a_viewer_cannot_open_a_public_tunnel(
    guarded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, seen = threading.Event(), threading.Event()
    monkeypatch.setattr(ViserServer, "request_share_url", lambda *_: asked.set())
    with (
        started(guarded) as (server, secret),
        connected(server.get_port(), secret or None) as viewer,
    ):
        server.on_client_connect(lambda _: seen.set())
        viewer.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
        viewer.send(
            msgspec.msgpack.encode(CAMERA)
        )  # answered after the request, which viser handles in its order
        assert seen.wait(10)
        if guarded:
            assert not asked.is_set()
        else:
            assert asked.wait(10)


def test_starting_and_stopping_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    with started(guarded=True):
        pass
    assert capfd.readouterr() == ("", "")


def test_a_refused_connection_leaves_one_short_line_for_who_debugs_and_nothing_else(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.DEBUG, "handscope.app.scene.loopback_server")
    with started(guarded=True) as (server, _):
        with pytest.raises(InvalidStatus):
            connected(server.get_port(), "http://evil.example")
        with socket.create_connection(("127.0.0.1", server.get_port())) as stranger:
            stranger.sendall(b"\x16\x03\x01 no request\r\n\r\n")
            stranger.recv(1000)
        eventually(lambda: len(caplog.records) >= 2)
    assert [(r.levelname, r.exc_info) for r in caplog.records] == [("DEBUG", None)] * 2
    assert "http://evil.example" in caplog.records[0].getMessage()
    assert not any("\n" in r.getMessage() for r in caplog.records)
    assert capfd.readouterr() == ("", "")


def test_what_was_drawn_is_kept_under_low_numbers_when_the_last_viewer_leaves() -> None:
    with HandScene("left", sized("left")) as scene:
        buffer = scene._server._websock_server._broadcast_buffer
        for k in range(100):
            scene.show(postures.relaxed() + 0.001 * k, None)
        kept = {m.redundancy_key(): m for m in buffer.message_from_id.values()}
        assert buffer.message_counter > 20 * len(kept)
        with connected(scene.port, scene.secret) as viewer:
            viewer.send(msgspec.msgpack.encode(CAMERA))
            eventually(lambda: scene._server.get_clients())
        eventually(lambda: buffer.message_counter == len(kept))
        again = {m.redundancy_key(): m for m in buffer.message_from_id.values()}
        assert again == kept
        scene.show(postures.relaxed(), None)  # newer messages replace the kept ones as before
        assert {m.redundancy_key() for m in buffer.message_from_id.values()} == set(kept)
        assert buffer.message_counter > len(kept) == len(buffer.message_from_id)
        with connected(scene.port, scene.secret) as late:
            assert isinstance(late.recv(timeout=WAIT), bytes)


CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, -1.0, 1.0),
    "image_height": 700,
    "image_width": 900,
    "fov": 0.5,
    "near": 0.1,
    "far": 10.0,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
