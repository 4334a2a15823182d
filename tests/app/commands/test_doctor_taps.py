"""The doctor on a terminal asks for a tap on each finger, and says which sensor felt it; two strips on each other's finger are named."""

import json
import os
import re
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Message, Samples, Status
from handscope.sessions.wire.sample_values import encode_values
from tests.glove import NS, identity, info, strip
from tests.simulated import STRIPS

pty = pytest.importorskip("pty")
RATE, BURST = 100.0, 5  # Hz, samples
TAP = 30.0  # m/s^2
WAIT = 60.0  # s until the test gives up
ASKED = re.compile(r"Tap the (?:tip of the (\w+)|sensor on the (?:back of the )?(\w+))")
NAMES = ("hand", "index", "ring")


class TappedGlove:
    """A glove at rest over TCP whose strip named in `tapped` is shaken until it is taken away."""

    def __init__(self) -> None:
        self.tapped, self.stopped = "", False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self.listener.getsockname()[1]}"

    def serve(self) -> None:
        host, _ = self.listener.accept()
        with host, suppress(OSError):
            encoder, began = Encoder(), time.monotonic()
            host.sendall(b"".join(encoder.frame(m) for m in self._facts()))
            for n in range(10**6):
                while time.monotonic() - began < (n + 1) * BURST / RATE:
                    select.select([], [], [], 0.005)
                if self.stopped:
                    return
                host.sendall(b"".join(encoder.frame(m) for m in self._bursts(n)))

    def _facts(self) -> list[Message]:
        return [identity(), *(m for name in NAMES for m in (strip(name), info(name, RATE)))]

    def _bursts(self, n: int) -> Iterator[Message]:
        start, length = round(n * BURST / RATE * NS), round(BURST / RATE * NS)
        for name in NAMES:
            sensors = len(STRIPS[name])
            values = np.random.default_rng(n).normal(0, 1e-3, (BURST, sensors, 6))
            values[..., 5] += 9.81
            values[2, -1, 5] += TAP * (name == self.tapped)
            described = info(name, RATE)
            data = encode_values(values.reshape(BURST, sensors, 6), described)
            yield Samples(described.stream, n * BURST, start, start + length, BURST, data)
        yield Status(start + length, 0, 255, 30.0)


@contextmanager
def tapped_glove() -> Iterator[TappedGlove]:
    glove = TappedGlove()
    thread = threading.Thread(target=glove.serve, daemon=True)
    thread.start()
    try:
        yield glove
    finally:
        glove.stopped = True
        glove.listener.close()
        thread.join(5)


def examine(glove: TappedGlove, worn_on: dict[str, str], table: Path) -> tuple[int, str]:
    """The doctor's exit code and words; whoever is asked for a finger taps it, and `worn_on` says which strip is there."""
    terminal, side = pty.openpty()
    words = ["doctor", glove.url, "--seconds", "1.5", "--json", str(table)]
    printed, until = "", time.monotonic() + WAIT
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "handscope.app.cli", *words],
        stdin=side,
        stdout=side,
        stderr=side,
    ) as doctor:
        os.close(side)
        with suppress(OSError):  # the terminal's other side is closed: the doctor has ended
            while chunk := os.read(terminal, 4096):
                printed += chunk.decode()
                if asked := ASKED.findall(printed):
                    place = asked[-1][0] or asked[-1][1]
                    glove.tapped = worn_on.get(place, place)
                assert time.monotonic() < until, printed
        os.close(terminal)
        return doctor.wait(WAIT), printed


def test_a_tap_on_each_finger_tells_its_sensor(tmp_path: Path) -> None:
    with tapped_glove() as glove:
        code, printed = examine(glove, {}, tmp_path / "d.json")
    assert code == 0, printed
    found = json.loads((tmp_path / "d.json").read_text())
    assert found["passed"]
    assert found["taps"] == {"index": "index_distal", "ring": "ring_distal", "hand": "hand"}
    assert "index_distal felt it" in printed


def test_strips_on_each_others_finger_are_found_by_taps(tmp_path: Path) -> None:
    exchanged = {"index": "ring", "ring": "index"}
    with tapped_glove() as glove:
        code, printed = examine(glove, exchanged, tmp_path / "d.json")
    assert code == 1, printed
    to_mend = json.loads((tmp_path / "d.json").read_text())["to_mend"]
    assert len(to_mend) == 2
    assert to_mend[0].startswith("index: ring_distal felt the tap most: plug the strips in as")
