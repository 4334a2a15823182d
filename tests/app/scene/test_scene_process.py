"""The scene in a process of its own: what was wished last is seen, nobody waits for it, and it comes back when its process dies."""

import logging
import os
import signal
import threading
from collections.abc import Iterator
from multiprocessing import active_children

import msgspec
import pytest
from websockets.sync.client import ClientConnection

from handscope.app.scene import postures
from handscope.app.scene.mesh import bones
from handscope.app.scene.scene_process import SceneProcess
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics.typing import Array
from tests.app.scene.small_site import WAIT, eventually
from tests.app.scene.test_bridge import messages_of, turns
from tests.app.scene.test_loopback_server import CAMERA, connected


def bent(angle: float) -> Array:
    angles = postures.relaxed()
    angles[JOINT["index_dip"], 0] = angle
    return angles


def sees(viewer: ClientConnection, angle: float) -> bool:
    """Wait until the viewer is told of the index finger bent so."""
    tip = bones.pose(bent(angle), sized("left"))[0][bones.BONE["index_distal"]]
    while not any(
        turns(m, "/hand/fingers", 9, tip) for m in messages_of(viewer.recv(timeout=WAIT))
    ):
        pass
    return True


def process_of(scene: SceneProcess) -> int:
    """Its process, once it draws."""
    eventually(
        lambda: scene.port, within=120.0
    )  # the first one waits for what all processes are forked from
    (pid,) = [p.pid for p in active_children() if p.name == "handscope scene"]
    assert pid is not None
    return pid


@pytest.fixture(scope="module")
def apart() -> Iterator[SceneProcess]:
    scene = SceneProcess("left", sized("left"))
    scene.show(bent(0.5), None)  # before a process is there
    with scene:
        yield scene
        pid = process_of(scene)
    eventually(lambda: not os.path.exists(f"/proc/{pid}"))
    assert not scene.port


def test_what_was_wished_before_the_process_began_is_drawn(apart: SceneProcess) -> None:
    process_of(apart)
    with connected(apart.port, apart.secret) as viewer:
        assert sees(viewer, 0.5)


def test_how_many_pages_look_is_known_with_the_next_picture(apart: SceneProcess) -> None:
    process_of(apart)

    def is_seen_by(viewers: int) -> bool:
        apart.highlight(None)  # as a station's next tick
        return apart.viewers == viewers

    eventually(lambda: is_seen_by(0))
    with connected(apart.port, apart.secret) as viewer:
        viewer.send(msgspec.msgpack.encode(CAMERA))  # as a page does at once
        eventually(lambda: is_seen_by(1))
    eventually(lambda: is_seen_by(0))


def test_a_process_that_stands_still_holds_nobody_up_and_then_draws_what_was_wished_last(
    apart: SceneProcess,
) -> None:
    pid = process_of(apart)
    with connected(apart.port, apart.secret) as viewer:
        assert sees(viewer, 0.5)
        os.kill(pid, signal.SIGSTOP)
        try:
            wishing = threading.Thread(
                target=lambda: [apart.show(bent(0.2 + 1e-4 * k), None) for k in range(3000)],
                daemon=True,
            )
            wishing.start()
            wishing.join(30.0)
            assert not wishing.is_alive()
        finally:
            os.kill(pid, signal.SIGCONT)
        apart.highlight(None)  # as a station's next tick
        eventually(lambda: not apart._waiting or apart.highlight(None))
        assert sees(viewer, 0.2 + 1e-4 * 2999)


def test_a_process_that_dies_is_replaced_by_one_that_shows_the_same(
    apart: SceneProcess, caplog: pytest.LogCaptureFixture
) -> None:
    pid, port = process_of(apart), apart.port
    apart.show(bent(0.9), None)
    os.kill(pid, signal.SIGKILL)
    eventually(lambda: apart.port not in (0, port), within=60.0)
    assert process_of(apart) != pid
    with connected(apart.port, apart.secret) as viewer:
        assert sees(viewer, 0.9)
    assert [r.getMessage() for r in caplog.records if r.levelno == logging.ERROR] == [
        "the process of a 3-D scene ended (-9); another is started"
    ]
