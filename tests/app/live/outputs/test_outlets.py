"""What LSL and OSC send, and that no outlet holds back a session."""

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from handscope.app.live.outputs import outlets
from handscope.app.live.outputs.choice import open_outlets, require_allowed
from handscope.app.live.outputs.osc_sender import PACKET, OscSender
from handscope.app.live.outputs.outlets import Outlets
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from tests.app.live.outputs.posing import poses, station

WAIT = 10.0  # s until a test gives up
RAW = Stream("hand_strip", ("hand", "index_middle"), (GYR, ACC), 200.0)


class Stuck:
    """An outlet whose network never takes anything."""

    name = "stuck"

    def __init__(self) -> None:
        self.release = threading.Event()

    def send_samples(self, block: Block) -> None:
        self.release.wait(WAIT)

    def send_poses(self, rows: Trajectory) -> None:
        self.release.wait(WAIT)

    def send_marker(self, t: float, text: str) -> None:
        raise OSError("gone")

    def close(self) -> None: ...


def test_an_outlet_that_is_stuck_holds_back_nobody_and_what_it_misses_is_counted() -> None:
    stuck = Stuck()
    with Outlets([stuck]) as sending:
        began = time.monotonic()
        for k in range(2 * outlets.QUEUE + 100):
            sending.send_poses(poses(0.01 * k))
        assert time.monotonic() - began < 1.0
        assert sending.dropped >= 100
        stuck.release.set()


def test_an_outlet_that_fails_is_left_out_and_named() -> None:
    with Outlets([Stuck()]) as sending:
        sending.send_marker(1.0, "task")
        until = time.monotonic() + WAIT
        while not sending.problems:
            assert time.monotonic() < until
        sending.send_marker(2.0, "task")  # nobody to fail
    assert sending.problems == ["stuck"]


def test_a_session_without_outlets_starts_no_thread() -> None:
    with Outlets([]) as sending:
        sending.send_poses(poses(0.0))
        assert sending._thread is None and not sending._queue


def test_a_station_sends_samples_poses_and_what_the_wizard_does(tmp_path: Path) -> None:
    made, sent = station(tmp_path), []

    class Listening(Outlets):
        def send_samples(self, blocks: object) -> None:
            sent.append("samples")

        def send_poses(self, rows: Trajectory) -> None:
            sent.append(float(rows.t[-1]))

        def send_marker(self, t: float, text: str) -> None:
            sent.append(text)

    made.outlets = Listening([])
    made._feed([Block(RAW, np.array([0.0]), np.zeros((1, 2, 6)))])
    made._drawing.draw_hand_if_due = lambda interval: None  # type: ignore[method-assign]
    made._take_pose(poses(0.5))
    made._marked = (made._wizard.state, "tapping")
    made._publish(made._current_status())
    assert sent == ["samples", 0.5, made._wizard.state.value]


@pytest.fixture
def osc() -> Iterator[tuple[OscSender, socket.socket]]:
    pytest.importorskip("pythonosc")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(WAIT)
        sender = OscSender("left", f"osc://127.0.0.1:{receiver.getsockname()[1]}")
        yield sender, receiver
        sender.close()


def received(receiver: socket.socket, packets: int) -> dict[str, list[object]]:
    from pythonosc.osc_packet import OscPacket

    found: dict[str, list[object]] = {}
    for _ in range(packets):
        data = receiver.recv(2 * PACKET)
        assert len(data) <= PACKET
        found |= {m.message.address: m.message.params for m in OscPacket(data).messages}
    return found


def test_osc_has_angles_tips_and_orientations_under_their_names(
    osc: tuple[OscSender, socket.socket],
) -> None:
    osc[0].send_poses(poses(0.5))
    found = received(osc[1], 3)
    assert found.keys() == {
        "/handscope/left/angle/index_pip_flexion",
        "/handscope/left/tip/index",
        "/handscope/left/orientation/hand",
    }
    np.testing.assert_allclose(found["/handscope/left/tip/index"], [0.01, 0.18, -0.02], atol=1e-8)


def test_osc_sends_at_most_sixty_poses_a_second(osc: tuple[OscSender, socket.socket]) -> None:
    osc[0].send_poses(poses(0.5))
    osc[0].send_poses(poses(0.51))
    osc[0].send_marker(0.51, "task_run tapping")
    assert received(osc[1], 4)["/handscope/left/marker"] == [
        pytest.approx(0.51),
        "task_run tapping",
    ]


def test_lsl_streams_name_channels_and_units_and_carry_the_samples_times() -> None:
    pylsl = pytest.importorskip("pylsl")
    (outlet,) = open_outlets(["lsl"], "left", f"test-{time.monotonic_ns()}", "m2", lambda: 2.0)
    block = Block(RAW, np.array([1.0, 1.005]), np.arange(24.0).reshape(2, 2, 6))
    outlet.send_samples(block)
    infos = {
        info.name(): info
        for info in pylsl.resolve_streams(1.0)
        if info.source_id().startswith("handscope-test-")
    }
    if not infos:
        pytest.skip("this machine passes no multicast: LSL streams cannot be found")
    assert set(infos) == {
        f"handscope_left_{what}" for what in ("raw_hand_strip", "angles", "tips", "markers")
    }
    raw = pylsl.StreamInlet(infos["handscope_left_raw_hand_strip"])
    assert raw.info(WAIT).nominal_srate() == 200.0
    assert channels(raw.info(WAIT))[:2] == [("hand_gyr_x", "rad/s"), ("hand_gyr_y", "rad/s")]
    raw.open_stream(WAIT)
    marks = pylsl.StreamInlet(infos["handscope_left_markers"])
    marks.open_stream(WAIT)
    before = pylsl.local_clock()
    outlet.send_samples(block)
    outlet.send_marker(1.5, "task_run tapping")
    values, stamp = raw.pull_sample(WAIT)
    assert values == list(range(12))
    assert before - 1.0 <= stamp <= pylsl.local_clock() - 1.0  # a second before the clock's 2.0 s
    text, at = marks.pull_sample(WAIT)
    assert text == ["task_run tapping"] and at - stamp == pytest.approx(0.5, abs=0.05)
    outlet.close()


def channels(info: object) -> list[tuple[str, str]]:
    one, found = info.desc().child("channels").child("channel"), []  # type: ignore[attr-defined]
    while not one.empty():
        found.append((one.child_value("label"), one.child_value("unit")))
        one = one.next_sibling("channel")
    return found


@pytest.mark.parametrize(
    "address", ["", "lsl://elsewhere", "osc://", "osc://host", "http://127.0.0.1:9000"]
)
def test_what_is_no_outlet_is_refused(address: str) -> None:
    with pytest.raises(InputError, match=r"no outlet|no address for OSC"):
        require_allowed([address], ["*"])


def test_an_outlet_is_open_only_where_the_administrator_allowed_it() -> None:
    require_allowed(["lsl", "osc://10.1.2.3:9000"], ["lsl", "osc://10.1.2.*:9000"])
    for address in ("lsl", "osc://10.1.3.3:9000"):
        with pytest.raises(InputError, match="--allow-outlet"):
            require_allowed([address], ["osc://10.1.2.*:9000"])
