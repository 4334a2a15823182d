"""The poses of a live session in a program of yours: `for pose in handscope.stream(url, token)` (docs/live-stream.md)."""

import json
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

from handscope.app.live.outputs.pose_message import Pose, from_json
from handscope.estimators.errors import InputError

PATH = "/api/stream"
REFUSED = 4401  # web socket close code, as app/api/live/streams.py has it
OPEN_WAIT = 10.0  # s


def stream(
    url: str, token: str, every: bool = False, timeout: float | None = None
) -> Iterator[Pose]:
    """Poses of a live session until it ends.

    Parameters
    ----------
    url
        The server's address, such as `http://127.0.0.1:8420`.
    token
        Of a stream of the session.
    every
        All poses that were sent, later; without it a loop that is slower than the poses gets the newest.
    timeout
        How long a pose is waited for, s; without it for ever. Before the session's calibration none comes.

    Yields
    ------
    Pose
        Time in s, orientations as quaternions (w, x, y, z), joint angles in rad, fingertips in m.

    Raises
    ------
    InputError
        Where nothing answers, where the token is refused, where the connection breaks off, and where no pose comes within `timeout`.

    Notes
    -----
    What is sent: docs/live-stream.md.
    """
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    base, origin = _address(url)
    try:
        opened: Any = connect(
            base + PATH,
            additional_headers={"Authorization": f"Bearer {token}"},
            origin=origin,
            compression=None,
            proxy=None,
            open_timeout=OPEN_WAIT,
        )
    except Exception as problem:  # of the network, of TLS, or an answer that is no web socket
        raise InputError("live.no_stream", url=url, problem=str(problem)) from None
    with opened as socket:
        try:
            socket.recv()  # what the poses are
            while True:
                yield from_json(json.loads(_next(socket, every, timeout)))
        except TimeoutError:
            raise InputError("live.no_pose_within", url=url, wait=timeout or 0.0) from None
        except ConnectionClosed as closed:
            _raise_unless_ended(closed, url)


def _next(socket: Any, every: bool, timeout: float | None) -> str:
    """The next message, or the newest of those that wait."""
    message: str = socket.recv(timeout)
    while not every:
        try:
            message = socket.recv(timeout=0)
        except TimeoutError:
            break
    return message


def _raise_unless_ended(closed: Any, url: str) -> None:
    code = closed.rcvd.code if closed.rcvd else None
    if code == REFUSED:
        raise InputError("live.token_refused", url=url)
    if code not in (1000, 1001):
        reason = closed.rcvd.reason if closed.rcvd else "without a word"
        raise InputError("live.stream_broke_off", url=url, reason=reason)


def _address(url: str) -> tuple[str, Any]:
    """Where to connect, and the origin that the server expects of its own clients."""
    parts = urlsplit(url)
    secure = {"http": False, "ws": False, "https": True, "wss": True}
    if parts.scheme not in secure or not parts.netloc:
        raise InputError("live.server_address_form", url=url)
    tls = "s" * secure[parts.scheme]
    return f"ws{tls}://{parts.netloc}", f"http{tls}://{parts.netloc}"
