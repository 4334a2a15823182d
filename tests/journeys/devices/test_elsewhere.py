"""A movement that another program simulated comes through a browser's serial port and gives the angles of its native recording."""

import socket
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from handscope.app.devices.sources.source import About, Arrived, Measured
from handscope.app.devices.sources.translated import TranslatedPort
from handscope.estimators.data.samples import ACC, GYR
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings
from tests.journeys.devices.serial_bridge import bridged
from tests.journeys.devices.test_browsers_port import (
    SENT,
    begin_with_own_port,
    opened,
    wait_for_recorded,
)
from tests.journeys.house import Server, end_session, newest_recording, shown
from tests.sessions.table_import.elsewhere import lift
from tests.simulated import DEG

pytestmark = [pytest.mark.browser, pytest.mark.process, pytest.mark.slow]


class Played:
    """A source that gives a recording's samples in their time, from the first question of its host on."""

    def __init__(self, recording: LoadedRecording) -> None:
        self._block = recording.samples["imu"]
        self.about = About("Elsewhere", 20, recording.hand)
        self._start, self._row = time.monotonic_ns(), 0

    def receive(self, wait: float) -> Sequence[Arrived]:
        time.sleep(0.02)
        t = self._start + np.rint(1e9 * self._block.t).astype(np.int64)
        first, self._row = self._row, int(np.searchsorted(t, time.monotonic_ns()))
        rows = slice(first, self._row)
        values = np.concatenate([self._block.of(GYR)[rows], self._block.of(ACC)[rows]], axis=-1)
        return [
            Measured((point,), (GYR, ACC), t[rows], values[:, k : k + 1], 100.0, point)
            for k, point in enumerate(self._block.stream.sensors)
            if self._row > first
        ]

    def take_originals(self) -> tuple[()]:
        return ()

    def counts(self) -> Mapping[str, int | float]:
        return {}

    def close(self) -> None:
        pass


@contextmanager
def playing(recording: LoadedRecording) -> Iterator[str]:
    """The address of a glove that moves so."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        stop = threading.Event()

        def serve() -> None:
            caller, _ = listener.accept()
            with closing(caller), closing(TranslatedPort(Played(recording))) as port:
                caller.setblocking(False)
                while not stop.is_set():
                    try:
                        port.write(caller.recv(4096))
                    except BlockingIOError:
                        pass
                    caller.setblocking(True)
                    caller.sendall(port.read(65536))
                    caller.setblocking(False)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}"
        stop.set()
        thread.join(5)


def test_angles_are_those_of_the_native_recording(
    browser: Browser, server: Server, tmp_path: Path
) -> None:
    native = recordings.load(lift(tmp_path / "recording"))
    with playing(native) as glove, bridged(glove) as bridge:
        page = opened(browser, server, server.base, bridge)
        station = begin_with_own_port(page)
        shown(page.get_by_text("This browser reads the glove."))
        wait_for_recorded(page, station, native.duration - 0.1)
        end_session(page)
        page.wait_for_function(SENT)
        page.context.close()
    newest = newest_recording(server.data)
    read = recordings.load(newest)
    block = native.samples["imu"]
    assert {len(b.t) for b in read.samples.values()} == {len(block.t)}
    later = next(iter(read.samples.values())).t[0] - block.t[0]
    events = tuple(replace(e, onset=e.onset + later) for e in native.events)
    ours = process(m2, m2.Params(), read.with_events(events)).trajectory
    theirs = process(m2, m2.Params(), native).trajectory
    rows = theirs.t >= native.events[0].end  # which 3 s of the pose are stillest may differ
    difference = np.abs(ours.angles - theirs.angles)[rows]
    assert np.isfinite(difference).any()
    assert np.nanmax(difference) < 0.2 * DEG
    expected, found = (
        {f.name: f.value for r in assess(moved, marked, native.geometry) for f in r.figures}
        for moved, marked in ((theirs, native.events), (ours, events))
    )
    ranges = [name for name in expected if name.endswith("_range")]
    assert len(ranges) >= 9
    assert max(abs(found[name] - expected[name]) for name in ranges) < 0.2 * DEG
