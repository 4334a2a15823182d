"""The recording process with real pseudo-terminals and files: nothing that was flushed is lost, whatever ends."""

import errno
import io
import os
import resource
import signal
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handscope.app.devices.glove import Glove
from handscope.app.devices.pipes import Kind, frames_that_wait, write_frame
from handscope.app.devices.ports import open_port
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.errors import InputError
from handscope.sessions.files import native
from handscope.sessions.wire import stream_reading
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.messages import Samples
from tests.app.devices.virtual import virtual_glove, wait_for
from tests.glove import SLOTS, frames, whole_session
from tests.simulated import cut, in_strips


@pytest.fixture
def port(tmp_path: Path) -> Iterator[Path]:
    with virtual_glove(tmp_path / "glove", "--strips", "index") as path:
        yield path


def recorded(worn: Glove) -> Callable[[], bool]:
    return lambda: (
        (worn.assembler.counts["hand"].samples if "hand" in worn.assembler.counts else 0) > 150
    )


def children(pid: int) -> list[int]:
    return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_what_the_glove_sends_is_recorded_and_seen_live(port: Path, tmp_path: Path) -> None:
    seen: list[Block] = []
    with Glove(str(port), tmp_path / "r.mcap", {"hand": "left"}, seen.extend) as worn:
        wait_for(recorded(worn))
        worn.keep_event("e1", Event(0.5, 1.0, "task", {"task_name": "tapping"}))
        worn.keep_event("e2", Event(0.7, 1.0, "task", {"task_name": "rom"}))
        worn.keep_event("e2", None)
    recording = native.load(tmp_path / "r.mcap")
    assert recording.warnings == ()
    assert {s.name for s in recording.streams} == {"hand", "index"}
    assert [e.details["task_name"] for e in recording.events] == ["tapping"]
    live = sum(len(b.t) for b in seen if b.stream.name == "hand")
    assert len(recording.samples["hand"].t) >= live > 100


def test_a_killed_recording_process_leaves_all_but_the_last_second(
    port: Path, tmp_path: Path
) -> None:
    with Glove(str(port), tmp_path / "r.mcap", {"hand": "left"}, lambda blocks: None) as worn:
        wait_for(recorded(worn))
        newest = worn.now()
        os.kill(worn.pid, signal.SIGKILL)
        wait_for(lambda: worn.state.state == "recording_failed")
    assert newest is not None
    recording = native.load(tmp_path / "r.mcap")
    assert recording.samples["hand"].t[-1] > newest - 1.0
    assert any("was not closed" in w for w in recording.warnings)


@pytest.mark.slow
def test_when_the_server_is_killed_the_recording_is_finished(port: Path, tmp_path: Path) -> None:
    code = (
        "import sys, time, pathlib; from handscope.app.devices.glove import Glove\n"
        "with Glove(sys.argv[1], pathlib.Path(sys.argv[2]), {'hand': 'left'}, lambda b: None) as g:\n"
        "    g.wait_for(lambda g: 'hand' in g.assembler.counts and g.assembler.counts['hand'].samples > 150, 20)\n"
        "    print(g.pid, flush=True); time.sleep(60)\n"
    )
    file = tmp_path / "r.mcap"
    server = subprocess.Popen(
        [sys.executable, "-c", code, str(port), str(file)], stdout=subprocess.PIPE, text=True
    )
    assert server.stdout is not None
    recorder = int(server.stdout.readline())
    server.kill()
    server.wait()
    server.stdout.close()
    wait_for(lambda: not Path(f"/proc/{recorder}").exists())
    recording = native.load(file)
    assert not any("was not closed" in w for w in recording.warnings)
    assert len(recording.samples["hand"].t) > 150


def test_a_port_that_vanishes_is_said_and_taken_up_again(tmp_path: Path) -> None:
    with (
        virtual_glove(tmp_path / "glove", "--strips", "index", "--unplug", "8:1.5") as path,
        Glove(str(path), tmp_path / "r.mcap", {"hand": "left"}, lambda b: None) as worn,
    ):
        said: set[str] = (
            set()
        )  # from the beginning: a slow machine records its first samples when the cable is out already

        def heard(condition: Callable[[], Any]) -> Callable[[], Any]:
            return lambda: said.add(worn.state.state) or condition()

        wait_for(heard(recorded(worn)))
        wait_for(heard(lambda: said & {"port_lost", "port_closed"}))
        before = worn.assembler.counts["hand"].samples
        wait_for(lambda: worn.state.state == "opened")
        wait_for(lambda: worn.assembler.counts["hand"].samples > before + 200)
    t = native.load(tmp_path / "r.mcap").samples["hand"].t
    gap = (t[1:] - t[:-1]).max()
    assert 0.3 < gap < 5.0  # time went on while the cable was out, although the glove began again


def test_a_full_disk_is_said_and_what_was_written_stays_readable(
    port: Path, tmp_path: Path
) -> None:
    """The kernel refuses to let the file grow, as a full disk does."""
    with Glove(str(port), tmp_path / "r.mcap", {"hand": "left"}, lambda b: None) as worn:
        wait_for(recorded(worn))
        size = (tmp_path / "r.mcap").stat().st_size
        resource.prlimit(worn.pid, resource.RLIMIT_FSIZE, (size + 2000, size + 2000))
        wait_for(lambda: worn.state.state == "recording_failed")
        assert worn.state.reason == os.strerror(errno.EFBIG)
        seen = worn.assembler.counts["hand"].samples
        wait_for(lambda: worn.assembler.counts["hand"].samples > seen + 50)  # the live view goes on
    recording = native.load(tmp_path / "r.mcap")
    assert len(recording.samples["hand"].t) > 150


def test_a_port_in_use_and_a_port_that_is_not_there_are_refused_in_words(
    port: Path, tmp_path: Path
) -> None:
    first = open_port(str(port))
    with pytest.raises(InputError, match="in use by another program"):
        open_port(str(port))
    first.close()
    with pytest.raises(InputError, match="is the glove plugged in"):
        open_port(str(tmp_path / "nothing"))
    with pytest.raises(InputError, match="cannot be opened as a serial port"):
        open_port(str(tmp_path))


def test_the_recording_process_begins_without_the_numerics_that_others_need() -> None:
    code = "import sys; import handscope.app.devices.acquisition; print({'numpy', 'numba', 'scipy'} & {*sys.modules})"
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        == "set()\n"
    )


def test_a_port_where_no_glove_speaks_gives_no_samples_and_no_harm(tmp_path: Path) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        with Glove(
            os.ttyname(slave), tmp_path / "r.mcap", {"hand": "left"}, lambda b: None
        ) as worn:
            wait_for(lambda: worn.state.state == "opened")
            os.write(master, b"AT+GMM\r\nhello, I am a modem\r\n\0" * 50)
            wait_for(lambda: worn.assembler.counters.corrupt >= 50)
            assert not worn.assembler.streams
    finally:
        os.close(master)
        os.close(slave)
    assert len(native.read(tmp_path / "r.mcap").wire) > 0


def test_frames_come_whole_and_in_order_however_the_pipe_cuts_them() -> None:
    frames = [
        (Kind.CHUNK, 0.5 * k, bytes([k]) * size) for k, size in enumerate((0, 1, 300, 70000, 5))
    ] + [(Kind.STATE, 9.0, b"{}")]
    sent = io.BytesIO()
    for frame in frames:
        write_frame(sent, *frame)
    for most in (1, 7, 1000, 1 << 20):
        assert [
            f
            for some in frames_that_wait(io.BufferedReader(Cut(sent.getvalue(), most)))
            for f in some
        ] == frames


class Cut(io.RawIOBase):
    """A pipe that gives some bytes at a time."""

    def __init__(self, data: bytes, most: int) -> None:
        self._data, self._most = io.BytesIO(data), most

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        data = self._data.read(min(self._most, len(buffer)))
        buffer[: len(data)] = data
        return len(data)


@pytest.mark.parametrize("fails", ["_sampled", "decode_values"])
def test_what_cannot_be_read_by_a_fault_of_ours_takes_nothing_with_it_that_was_read_together(
    fails: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Block] = []
    worn = Glove("nowhere", tmp_path / "r.mcap", {"hand": "left"}, seen.extend)
    samples = {name: cut(in_strips("left").samples[name], [100])[0] for name in ("hand", "index")}
    sent = whole_session(samples)
    bad = next(
        s.message
        for s in sent
        if isinstance(s.message, Samples)
        and s.message.index == 50
        and s.message.stream == 10 + SLOTS["index"]
    )
    where = Assembler if fails == "_sampled" else stream_reading
    working = getattr(where, fails)

    def failing(*given: Any) -> Any:
        if bad in given or bad in (given[0] if isinstance(given[0], list) else ()):
            raise ZeroDivisionError
        return working(*given)

    monkeypatch.setattr(where, fails, failing)
    worn._take_chunks([(s.arrival, data) for s, data in zip(sent, frames(s.message for s in sent))])
    shown = {name: np.concatenate([b.t for b in seen if b.stream.name == name]) for name in samples}
    assert worn.decoding_failures == 1
    np.testing.assert_allclose(shown["hand"], samples["hand"].t, atol=2e-9)
    np.testing.assert_allclose(
        shown["index"], np.delete(samples["index"].t, slice(50, 50 + bad.count)), atol=2e-9
    )
