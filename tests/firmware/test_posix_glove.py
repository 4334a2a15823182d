"""The firmware's core as a program on this machine, recorded as any glove is."""

import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from handscope.app.devices import strip_flash
from handscope.estimators.data.samples import GYR
from handscope.estimators.errors import InputError
from handscope.estimators.sensors.imu_calibration import ImuCalibration
from handscope.sessions.formats import recordings as formats
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder
from tests.firmware.conftest import HANDSCOPE, Make
from tests.firmware.recorded import (
    SAMPLES,
    assert_fists_are_measured,
    assert_nothing_is_lost,
    record,
    skew,
)

BEGUN = 50_000  # bytes of a recording in which samples have come


@contextmanager
def serving(program: Path, *words: str) -> Iterator[tuple[str, list[str]]]:
    """A glove that serves; its port, and a list that holds its report once it has ended."""
    report: list[str] = []
    with subprocess.Popen(
        [program, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as glove:
        assert glove.stdout is not None and glove.stderr is not None
        try:
            yield glove.stdout.readline().strip(), report
        finally:
            glove.terminate()
            report.append(glove.stderr.read())


class Host:
    """A host over TCP that waits for what it wants to see, on the glove's clock."""

    def __init__(self, url: str) -> None:
        self.assembler, self._encoder = Assembler(), Encoder()
        self._socket = socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2])))
        self._socket.settimeout(10.0)

    def send(self, *commands: wire.Message) -> None:
        self._socket.sendall(b"".join(self._encoder.frame(c) for c in commands))

    def send_bytes(self, raw: bytes) -> None:
        self._socket.sendall(raw)

    def reply(self, command: wire.Message) -> wire.Reply:
        """Send, and read until the answer to it is there."""
        code = wire.encode(command)[0]
        self.assembler.replies.clear()
        self.send(command)
        while not any(r.command == code for r in self.assembler.replies):
            self.read()
        return next(r for r in self.assembler.replies if r.command == code)

    def read(self) -> None:
        chunk = self._socket.recv(65536)
        assert chunk, "the glove hung up"
        self.assembler.feed(chunk, time.monotonic())

    def read_samples(self, stream: str, count: int) -> None:
        """Read until a stream has so many more samples."""
        wanted = count + (
            self.assembler.counts[stream].samples if stream in self.assembler.counts else 0
        )
        while stream not in self.assembler.counts or self.assembler.counts[stream].samples < wanted:
            self.read()

    def lost(self) -> int:
        return sum(count.lost for count in self.assembler.counts.values())


@contextmanager
def connected(program: Path, *words: str) -> Iterator[Host]:
    with serving(program, "--tcp", "0", *words) as (url, _):
        host = Host(url)
        try:
            yield host
        finally:
            host._socket.close()


@pytest.fixture(scope="module")
def program(make: Make) -> Path:
    return make("posix") / "glove"


@pytest.fixture(
    scope="module",
    params=[
        ("icm42688p", "left"),
        pytest.param(("lsm6dsv16x", "right"), marks=pytest.mark.slow),
    ],
)
def recorded(
    request: pytest.FixtureRequest, program: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, str]:
    """Ten seconds of 17 sensors at 200 Hz by the real program, and what the glove reports at its end."""
    folder = tmp_path_factory.mktemp("posix")
    chip, hand = request.param
    words = ("--chip", chip, "--hand", hand, "--samples", f"{SAMPLES:g}", "--clock", "pausing")
    with serving(program, "--pty", str(folder / "port"), *words) as (port, report):
        path = record(port, folder)
    return path, report[0]


def test_ten_seconds_at_200_hz_are_recorded_without_loss(recorded: tuple[Path, str]) -> None:
    assert_nothing_is_lost(recorded[0])


def test_a_clock_that_pauses_waits_for_a_host_that_stands_still(
    program: Path, tmp_path: Path
) -> None:
    path, words = tmp_path / "glove.mcap", ("--samples", "5", "--clock", "pausing")
    with serving(program, "--pty", str(tmp_path / "port"), *words) as (port, _):
        command = [str(HANDSCOPE), "record", port, "--out", str(path)]
        with subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL) as host:
            until = time.monotonic() + 60
            while not path.exists() or path.stat().st_size < BEGUN:
                assert time.monotonic() < until
                time.sleep(0.05)
            os.killpg(host.pid, signal.SIGSTOP)
            time.sleep(2.0)
            os.killpg(host.pid, signal.SIGCONT)
            assert host.wait(60) == 0
    assert not any(formats.load(path, None).losses.values())


def test_the_recording_is_assessed(recorded: tuple[Path, str], tmp_path: Path) -> None:
    assert_fists_are_measured(recorded[0], tmp_path / "assessed")


def test_sensors_of_a_strip_see_a_movement_at_one_time(recorded: tuple[Path, str]) -> None:
    assert skew(recorded[0]) < 0.3e-3  # s: noise of the phase alone makes 0.1 ms


def test_sampling_times_are_known_to_the_tick_of_the_sensor(recorded: tuple[Path, str]) -> None:
    found = re.search(r"mean (\S+) us, sd (\S+) us", recorded[1])
    assert found is not None, recorded[1]
    mean, sd = (float(x) for x in found.groups())
    assert abs(mean) < 30
    assert sd < 20


def test_no_fifo_overflows_while_samples_are_sent(recorded: tuple[Path, str]) -> None:
    assert re.findall(r"lost in FIFO (\d+)", recorded[1]) == ["0"] * 17


def test_true_rates_are_measured_against_the_base_clock(recorded: tuple[Path, str]) -> None:
    rates = re.findall(r"measured (\S+) ppm, true (\S+) ppm", recorded[1])
    assert len(rates) == 17
    for measured, true in rates:
        assert abs(float(measured) - float(true)) < 30


def test_a_strip_that_is_pulled_and_plugged_loses_nothing_of_the_others(program: Path) -> None:
    with connected(program, "--pull", "2@1.5-2.5") as host:
        host.send(wire.Start())
        host.read_samples("index", 10)
        while "index" in {s.name for s in host.assembler.streams.values()}:
            host.read()
        host.read_samples("thumb", 100)
        while "index" not in {s.name for s in host.assembler.streams.values()}:
            host.read()
        host.read_samples("index", 100)
        assert host.lost() == 0
        assert host.assembler.counters.lost == 0


def test_a_host_that_comes_back_meets_the_same_glove(program: Path) -> None:
    with serving(program, "--tcp", "0") as (url, _):
        boots = []
        for _ in range(2):
            host = Host(url)
            host.send(wire.Start())
            host.read_samples("index", 50)
            assert host.assembler.identity is not None
            boots.append(host.assembler.identity.boot_id)
            assert host.lost() == 0
            host._socket.close()
        assert boots[0] == boots[1]


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (wire.Configure(rate=1e9), wire.ReplyCode.BAD_ARGUMENT),
        (wire.Configure(rate=float("nan")), wire.ReplyCode.BAD_ARGUMENT),
        (wire.Configure(slot=63, rate=100.0), wire.ReplyCode.BAD_ARGUMENT),
        (wire.Configure(rate=0.0), wire.ReplyCode.OK),
        (wire.ReadCalibration(64), wire.ReplyCode.BAD_ARGUMENT),
        (wire.WriteCalibration(wire.StripCalibration(2, 3)), wire.ReplyCode.BAD_ARGUMENT),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_sentence(
    program: Path, command: wire.Message, code: wire.ReplyCode
) -> None:
    with connected(program) as host:
        host.send(wire.Start())
        host.read_samples("index", 2)
        host.reply(wire.Stop())
        reply = host.reply(command)
        assert reply.code is code
        assert bool(reply.text) == (code is not wire.ReplyCode.OK)


def test_garbage_half_frames_and_wrong_checksums_do_not_disturb_the_samples(program: Path) -> None:
    ping = Encoder().frame(wire.Ping(7))
    broken = ping[:5] + bytes([ping[5] ^ 4]) + ping[6:]
    with connected(program) as host:
        host.send(wire.Start())
        host.read_samples("index", 50)
        for raw in (ping[:7], b"\0", broken, bytes(range(1, 256)) * 40, b"\0\0\0", ping):
            host.send_bytes(raw)
        host.read_samples("index", 100)
        assert host.reply(wire.Cue("tapping")).code is wire.ReplyCode.OK
        assert host.lost() == 0
        assert host.assembler.counters.malformed == host.assembler.counters.corrupt == 0


def test_a_calibration_is_kept_and_corrects_the_samples_from_then_on(program: Path) -> None:
    kept = wire.StripCalibration(2, 1, (0.25, *[0.0] * 8))
    with connected(program) as host:
        host.send(wire.Start())
        host.read_samples("index", 2)
        assert host.reply(wire.WriteCalibration(kept)).code is wire.ReplyCode.BUSY
        host.reply(wire.Stop())
        assert host.reply(wire.WriteCalibration(kept)).code is wire.ReplyCode.OK
        host.reply(wire.ReadCalibration(2))
        assert host.assembler.calibrations[2, 1] == kept


def test_a_full_memory_refuses_a_calibration_with_a_sentence_and_samples_go_on(
    program: Path,
) -> None:
    written = {"index_middle": ImuCalibration({}, {GYR: np.array([0.01, 0.0, 0.0])})}
    with serving(program, "--tcp", "0", "--memory", "full") as (url, _):
        for attempt in (1, 2):
            host = Host(url)
            host.send(wire.Start())
            host.read_samples("index", 50)
            assert host.lost() == 0
            host._socket.close()
            if attempt == 1:
                with pytest.raises(InputError, match=r"refused WriteCalibration: .* did not keep"):
                    strip_flash.write(url, written, {})


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--tcp", "99999"),
        ("--tcp", "0", "--rate", "0"),
        ("--tcp", "0", "--strips", "toe"),
        ("--nothing", "1"),
    ],
)
def test_a_wrong_option_is_a_sentence(program: Path, words: Sequence[str]) -> None:
    done = subprocess.run([program, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("glove: ")
