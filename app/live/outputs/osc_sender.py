"""Open Sound Control over UDP: the newest pose as one bundle each of angles, fingertips and orientations.

Addresses are `/handscope/left/angle/index_pip_flexion` (rad), `/handscope/left/tip/index` (x, y, z in m) and
`/handscope/left/orientation/hand` (w, x, y, z); markers are `/handscope/left/marker` (s, text). A bundle fits into one
packet of an Ethernet. UDP waits for nobody: a receiver that does not read loses packets.
"""

import socket
import time
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import urlsplit

from handscope.app.live.outputs.pose_message import newest_pose
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import phrase

INTERVAL = 1 / 60  # s, least time between two poses
PACKET = 1400  # bytes of a bundle at most, below the 1500 of an Ethernet frame
MISSING = phrase("live.osc_missing")


class OscSender:
    """Sends to one host and port; nothing is answered."""

    def __init__(self, hand: Hand, url: str) -> None:
        try:
            from pythonosc import osc_bundle_builder, osc_message_builder
        except ImportError:
            raise InputError(MISSING) from None
        self._bundle, self._message = osc_bundle_builder, osc_message_builder
        self.name, self._place = url, address_of(url)
        self._prefix = f"/handscope/{hand}"
        self._sent_at = -1e9
        try:
            family, *_, to = socket.getaddrinfo(*self._place, type=socket.SOCK_DGRAM)[0]
        except OSError as problem:
            raise InputError("live.host_unknown", url=url, problem=str(problem)) from None
        self._socket, self._to = socket.socket(family, socket.SOCK_DGRAM), to
        self._socket.setblocking(False)

    def send_samples(self, block: Block) -> None:
        """Raw samples are not sent: OSC has no place for their rate and units."""

    def send_poses(self, rows: Trajectory) -> None:
        now = time.monotonic()
        if now - self._sent_at < INTERVAL:
            return
        self._sent_at, pose = now, newest_pose(rows)
        self._send({f"angle/{name}": [value] for name, value in pose.angles.items()})
        self._send({f"tip/{finger}": tip for finger, tip in pose.tips.items()})
        self._send({f"orientation/{s}": q for s, q in pose.orientations.items()})

    def send_marker(self, t: float, text: str) -> None:
        self._send({"marker": [t, text]})

    def close(self) -> None:
        self._socket.close()

    def _send(self, values: Mapping[str, Sequence[Any]]) -> None:
        """Messages in as few bundles as keep each within a packet."""
        bundle, size = self._new_bundle(), 16
        for address, arguments in values.items():
            message = self._built(address, arguments)
            if size + message.size + 4 > PACKET:
                self._send_bundle(bundle)
                bundle, size = self._new_bundle(), 16
            bundle.add_content(message)
            size += message.size + 4
        if values:
            self._send_bundle(bundle)

    def _built(self, address: str, arguments: Sequence[Any]) -> Any:
        builder = self._message.OscMessageBuilder(address=f"{self._prefix}/{address}")
        for argument in arguments:
            builder.add_arg(argument)
        return builder.build()

    def _new_bundle(self) -> Any:
        return self._bundle.OscBundleBuilder(self._bundle.IMMEDIATELY)

    def _send_bundle(self, bundle: Any) -> None:
        try:
            self._socket.sendto(bundle.build().dgram, self._to)
        except OSError:  # nobody listens there now, or the network is busy: the next pose follows
            pass


def address_of(url: str) -> tuple[str, int]:
    """Host and port of osc://HOST:PORT; InputError where it is none."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        parts, host, port = urlsplit(""), None, None
    if parts.scheme != "osc" or not host or not port:
        raise InputError("live.osc_address_form", url=url)
    return host, port
