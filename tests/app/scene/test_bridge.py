"""The bridge: the scene's messages on the application's port, for who is logged in, until either side leaves."""

import asyncio
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from handscope.app.scene import bridge, postures
from handscope.app.scene.bridge import PROTOCOL
from handscope.app.scene.camera.operator import CameraOperator
from handscope.app.scene.hand_scene import HandScene
from handscope.app.scene.mesh import bones
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics.typing import Array
from tests.app.scene.small_site import COOKIE, WAIT, Site, eventually, site


def connected(
    served: Site, cookie: str = COOKIE["value"], protocol: str = PROTOCOL
) -> ClientConnection:
    return connect(
        f"ws://{served.host}{served.path.rstrip('/')}",
        subprotocols=[protocol],  # type: ignore[list-item]
        additional_headers={"Cookie": f"{COOKIE['name']}={cookie}"},
        compression=None,
        max_size=None,
        proxy=None,
        close_timeout=0.5,
    )


def viewers(scene: HandScene) -> int:
    return len(scene._server._websock_server._client_state_from_id)


def camera_moves(scene: HandScene) -> list[asyncio.Task[Any]]:
    """Moves of the cameras that have not ended."""
    tasks = asyncio.all_tasks(scene._server.get_event_loop())
    return [task for task in tasks if CameraOperator._ease.__qualname__ in repr(task)]


def test_a_stranger_is_refused_before_the_scene_hears_of_it(scene: HandScene, served: Site) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        connected(served, cookie="unknown")
    assert refusal.value.response.status_code == 403
    assert served.sockets == [] and viewers(scene) == 0


def test_the_scene_comes_through_as_binary_messages(served: Site) -> None:
    with connected(served) as viewer:
        assert viewer.subprotocol == PROTOCOL
        assert isinstance(viewer.recv(timeout=WAIT), bytes)


def test_what_is_shown_reaches_every_viewer(scene: HandScene, served: Site) -> None:
    angles = postures.relaxed()
    angles[JOINT["index_dip"], 0] = 0.777
    tip = bones.pose(angles, sized("left"))[0][bones.BONE["index_distal"]]
    with connected(served) as one, connected(served) as two:
        with scene.picture():
            scene.show(angles, None)
        for viewer in (one, two):
            while not any(
                turns(m, "/hand/fingers", 9, tip) for m in messages_of(viewer.recv(timeout=WAIT))
            ):
                pass


def test_a_viewer_that_leaves_is_forgotten(scene: HandScene, served: Site) -> None:
    with connected(served):
        eventually(lambda: viewers(scene) == 1)
    eventually(lambda: viewers(scene) == 0)


def test_a_scene_that_closes_lets_its_viewers_go_and_ends_a_cameras_move() -> None:
    scene = HandScene("left", sized("left"))
    with site(scene) as served, connected(served) as viewer:
        viewer.recv(timeout=WAIT)
        scene.look("palm")
        eventually(lambda: camera_moves(scene))
        scene.close()
        assert camera_moves(scene) == []
        assert _end_of(viewer) == 1001
        with pytest.raises(InvalidStatus):
            connected(served)


@pytest.mark.parametrize(
    ("sent", "code"), [("text", 1003), (bytes(bridge.LARGEST_FROM_BROWSER + 1), 1009)]
)
def test_a_viewer_that_sends_what_no_page_of_ours_sends_is_disconnected(
    served: Site, sent: str | bytes, code: int
) -> None:
    with connected(served) as viewer:
        viewer.send(sent)
        assert _end_of(viewer) == code


def test_a_page_of_another_version_is_refused(served: Site) -> None:
    with pytest.raises(InvalidStatus):
        connected(served, protocol="viser-v0.0.1")


def test_a_proxy_of_the_environment_is_not_asked_for_our_own_machine(
    served: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("http_proxy", "all_proxy", "HTTP_PROXY", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:1")
    monkeypatch.delenv("no_proxy", raising=False)
    with connected(served) as viewer:
        assert isinstance(viewer.recv(timeout=WAIT), bytes)


def test_a_viewer_that_does_not_read_holds_nobody_up(scene: HandScene, served: Site) -> None:
    with connected(served), connected(served) as reader:
        eventually(lambda: viewers(scene) == 2)
        for k in range(300):
            scene.show(postures.relaxed() + 0.001 * k, None)
        tip = bones.pose(postures.relaxed() + 0.001 * 299, sized("left"))[0][
            bones.BONE["index_distal"]
        ]
        while not any(
            turns(m, "/hand/fingers", 9, tip) for m in messages_of(reader.recv(timeout=WAIT))
        ):
            pass


def messages_of(batch: str | bytes) -> list[dict[str, Any]]:
    """viser's messages in one web socket message: two lengths, then msgpack packed by zstd, then arrays."""
    assert isinstance(batch, bytes)
    packed = int.from_bytes(batch[8:16], "little")
    found: list[dict[str, Any]] = msgspec.msgpack.decode(
        zstandard.decompress(batch[16 : 16 + packed])
    )["messages"]
    return found


def turns(message: dict[str, Any], mesh: str, bone: int, wxyz: Array) -> bool:
    is_it = (message["type"], message.get("name"), message.get("bone_index")) == (
        "SetBoneOrientationMessage",
        mesh,
        bone,
    )
    return is_it and np.allclose(message["wxyz"], wxyz, atol=1e-6)


def _end_of(viewer: ClientConnection) -> int:
    """Read to the end; the code the other side closed with."""
    try:
        while True:
            viewer.recv(timeout=WAIT)
    except ConnectionClosed as end:
        return end.rcvd.code if end.rcvd else 0
