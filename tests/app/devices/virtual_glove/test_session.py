"""A virtual glove at a line: how it waits for its host."""

import time
from contextlib import nullcontext

import numpy as np

from handscope.app.devices.virtual_glove.faults import FaultParams, Faults
from handscope.app.devices.virtual_glove.session import Script, serve
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.framing import Encoder
from tests.app.devices.virtual_glove.test_firmware import glove, person


class Full:
    """A line whose host has asked for samples and takes none."""

    def __init__(self) -> None:
        self.waits: list[float] = []

    def read(self, wait: float) -> bytes | None:
        self.waits.append(wait)
        time.sleep(wait)
        return Encoder().frame(wire.Start()) if len(self.waits) == 1 else b""

    def write(self, data: bytes) -> bytes:
        return data


def test_a_glove_whose_host_takes_nothing_waits_between_its_tries() -> None:
    line = Full()
    serve(
        lambda: nullcontext(line),
        lambda: glove(person(("index",))),
        Faults(FaultParams(), np.random.default_rng(2)),
        Script(),
        stop=lambda: len(line.waits) > 40,
    )
    assert min(line.waits) > 0.0
