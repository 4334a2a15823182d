"""SlimeVR trackers: handshakes are answered, orientations come out as they went in, strangers and broken packets are counted."""

import json
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.app.devices import ports
from handscope.app.devices.sources.addresses import parse_source
from handscope.app.devices.sources.slimevr import opening, packets
from handscope.app.devices.sources.slimevr.listener import Listener
from handscope.app.devices.sources.source import Arrived, Battery, Measured, Occurred
from handscope.app.devices.sources.translated import TranslatedPort
from handscope.estimators.data.samples import ACC, GYR, ORIENTATION
from handscope.estimators.errors import InputError
from handscope.sessions.table_import.column_map import parse_map
from handscope.sessions.wire.assembly import Assembler
from tests.app.devices.sources import slime_trackers as slime

Q = (0.5, -0.5, 0.5, 0.5)
TRACKER = "A4:CF:12:00:00:07"


@pytest.fixture
def listener() -> Iterator[Listener]:
    with closing(Listener("127.0.0.1", 0, None)) as open_listener:
        yield open_listener


def received(listener: Listener, *datagrams: bytes) -> tuple[list[Arrived], list[bytes]]:
    """What the listener gives of datagrams of one tracker, and what it answers."""
    with closing(slime.tracker_socket()) as tracker:
        found: list[Arrived] = []
        answers = []
        for datagram in datagrams:
            tracker.sendto(datagram, ("127.0.0.1", listener.port))
            found += listener.receive(1.0)
            tracker.setblocking(False)
            try:
                while True:
                    answers.append(tracker.recv(1500))
            except BlockingIOError:
                pass
        return found, answers


def test_a_handshake_is_answered_and_a_placed_sensor_gives_its_orientation(
    listener: Listener,
) -> None:
    found, answers = received(
        listener,
        slime.handshake(),
        slime.sensor_info(1, 0, 24),
        slime.packet(17, 2, slime.rotation(0, Q)),
    )
    assert answers[0] == packets.HELLO
    assert struct.pack(">IBB", 15, 0, 1) in answers
    (measured,) = found
    assert isinstance(measured, Measured)
    assert (measured.points, measured.quantities) == (("index_proximal",), (ORIENTATION,))
    np.testing.assert_allclose(measured.values, [[Q]])
    assert listener.about.hand == "left"


@pytest.mark.parametrize("bundled", [slime.bundle, slime.compact_bundle])
def test_bundles_hold_several_packets(listener: Listener, bundled: object) -> None:
    small = struct.pack(">B7h", 1, *(round(32767 * c) for c in (Q[1], Q[2], Q[3], Q[0])), 0, 0, 0)
    parts = [(17, slime.rotation(0, Q)), (23, small), (13, bytes([0, 1])), (99, b"?")]
    found, _ = received(
        listener,
        slime.handshake(),
        slime.sensor_info(1, 0, 24),
        slime.sensor_info(2, 1, 25),
        bundled(3, parts),  # type: ignore[operator]
    )
    first, second = (m for m in found if isinstance(m, Measured))
    np.testing.assert_allclose(second.values, first.values, atol=1e-4)
    (tap,) = (o for o in found if isinstance(o, Occurred))
    assert tap.details == {"note": "tap", "tracker": f"{TRACKER}/0"}


def test_datagrams_that_wait_for_a_busy_program_are_kept_with_the_times_at_which_they_came(
    listener: Listener,
) -> None:
    """Three seconds of a glove's bundles at 100 Hz; half of them come 0.3 s before the others."""
    parts = [(17, slime.rotation(k, Q)) for k in range(16)]
    received(listener, slime.handshake(), slime.sensor_info(1, 0, 24))
    with closing(slime.tracker_socket()) as tracker:
        address = ("127.0.0.1", listener.port)
        tracker.sendto(slime.handshake(), address)
        first = _first_stamped(listener, tracker, parts)
        for number in range(first, first + 300):
            tracker.sendto(slime.bundle(number, parts), address)
            if number == first + 149:
                threading.Event().wait(0.3)
    found = [m for m in listener.receive(1.0) if isinstance(m, Measured) and m.points]
    t = np.concatenate([m.t for m in found])
    assert len(t) == 300
    if sys.platform == "linux":
        assert t[150] - t[149] >= 0.29e9


def _first_stamped(
    listener: Listener, tracker: socket.socket, parts: list[tuple[int, bytes]]
) -> int:
    """Number of the first datagram since the kernel stamps them: it begins to somewhat after it is asked to (Linux, net_enable_timestamp)."""
    for number in range(1, 100):
        tracker.sendto(slime.bundle(number, parts), ("127.0.0.1", listener.port))
        threading.Event().wait(0.05)
        times = [m.t[-1] for m in listener.receive(1.0) if isinstance(m, Measured) and m.points]
        if sys.platform != "linux" or time.monotonic_ns() - times[-1] >= 0.04e9:
            return number + 1
    raise AssertionError("the kernel stamped no datagram")


def test_battery_is_that_of_the_weakest_tracker(listener: Listener) -> None:
    found, _ = received(
        listener, slime.handshake(), slime.packet(12, 1, struct.pack(">2f", 3.9, 0.42))
    )
    assert [b.percent for b in found if isinstance(b, Battery)] == [42]


def test_strangers_repetitions_and_broken_packets_are_dropped_and_counted(
    listener: Listener,
) -> None:
    late = slime.packet(17, 2, slime.rotation(0, Q))
    found, answers = received(listener, late)
    assert (found, answers) == ([], [])
    found, _ = received(
        listener,
        slime.handshake(),
        slime.sensor_info(1, 0, 24),
        late,
        late,
        slime.packet(17, 3, b"\0\1"),
        b"\0\0",
    )
    assert len(found) == 1
    assert listener.counts() == {
        "packets_of_strangers": 1,
        "packets_out_of_order": 1,
        "packets_cut_short": 2,
    }


def test_a_map_says_which_tracker_sits_where_and_takes_raw_samples(tmp_path: Path) -> None:
    column_map = {
        "hand": "right",
        "sensors": {
            "hand": {
                "orientation": {"columns": [f"{TRACKER}/1/q{c}" for c in "wxyz"], "unit": "1"},
                "gyr": {"columns": [f"{TRACKER}/1/g{c}" for c in "xyz"], "unit": "deg/s"},
                "acc": {"columns": [f"{TRACKER}/1/a{c}" for c in "xyz"], "unit": "g"},
            }
        },
    }
    raw = struct.pack(">3B", 1, 1, 2)
    for numbers in ((90, 0, 0), (0, 0, 1), (0, 0, 0)):
        raw += struct.pack(">3fB", *numbers, 255)
    with closing(Listener("127.0.0.1", 0, parse_map(column_map, "map", True))) as mapped:
        found, _ = received(
            mapped,
            slime.handshake(),
            slime.packet(105, 1, raw),
            slime.packet(17, 2, slime.rotation(1, Q)),
            slime.packet(17, 3, slime.rotation(0, Q)),
        )
        assert mapped.counts() == {"samples_of_sensors_without_a_place": 1}
    inertial, given_q = (m for m in found if isinstance(m, Measured) and m.points)
    assert (inertial.quantities, given_q.quantities) == ((GYR, ACC), (ORIENTATION,))
    np.testing.assert_allclose(inertial.values[0, 0], [np.pi / 2, 0, 0, 0, 0, 9.80665])


def test_the_port_gives_wire_protocol_whose_rate_is_measured() -> None:
    with closing(Listener("127.0.0.1", 0, None)) as listener:
        received(listener, slime.handshake(), slime.sensor_info(1, 0, 24))
        port, assembler = TranslatedPort(_Scripted(listener)), Assembler()
        blocks = [b for k in range(150) for b in assembler.feed(port.read(1), 0.01 * k)]
    assert assembler.identity is not None and assembler.identity.name == "SlimeVR trackers"
    (name,) = {b.stream.name for b in blocks}
    t = np.concatenate([b.t for b in blocks])
    assert (name, blocks[0].stream.rate) == ("index_orientation", 100.0)
    np.testing.assert_allclose(np.diff(t), 0.01, atol=1e-7)
    assert len(t) == 150
    assert assembler.counters.malformed == 0


class _Scripted:
    """A source that gives a sample each 10 ms of its own time."""

    def __init__(self, listener: Listener) -> None:
        self.about, self._k = listener.about, 0

    def receive(self, wait: float) -> list[Arrived]:
        self._k += 1
        t = np.array([10_000_000 * self._k], np.int64)
        return [Measured(("index_proximal",), (ORIENTATION,), t, np.array([[Q]]))]

    def take_originals(self) -> tuple[()]:
        return ()

    def counts(self) -> dict[str, int | float]:
        return {}

    def close(self) -> None:
        pass


@given(st.binary(max_size=200), st.sampled_from([0, 3, 12, 13, 15, 17, 19, 22, 23, 100, 101, 105]))
def test_any_bytes_are_packets_or_cut_short(body: bytes, kind: int) -> None:
    for datagram in (body, slime.packet(kind, 1, body)):
        try:
            list(packets.packets_of(datagram))
        except packets.CutShortError:
            pass


@pytest.mark.parametrize("url", ["slimevr://x", "slimevr://0", "slimevr://127.0.0.1:99999"])
def test_what_is_no_udp_port_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="no UDP port"):
        opening.open_source(parse_source(url))


def test_an_address_needs_permission_and_takes_no_other_option(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--allow-port"):
        ports.require_allowed("slimevr://6969", [])
    ports.require_allowed("slimevr://6969", ["slimevr://*"])
    with pytest.raises(InputError, match="no address of a source"):
        ports.require_allowed("slimevr://6969?shell=1", ["slimevr://*"])
    (tmp_path / "map.json").write_text(json.dumps({"hand": "left", "sensors": {}}))
    with pytest.raises(InputError, match="names no sensor"):
        opening.open_source(parse_source(f"slimevr://6969?map={quote(str(tmp_path / 'map.json'))}"))


def test_a_port_that_is_taken_is_named(listener: Listener) -> None:
    with pytest.raises(InputError, match=f"UDP port {listener.port} cannot be opened"):
        Listener("127.0.0.1", listener.port, None)
