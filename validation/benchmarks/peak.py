"""Peak memory of a process that loads and processes a recording and does nothing else: what makes recordings stays outside."""

from pathlib import Path

import numpy as np

from handscope.estimators.data.samples import Block, Event, Stream
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.sessions.files.recording import LoadedRecording


def of_processing(folder: str, stream: Stream, events: tuple[Event, ...]) -> float:
    """High water (MB) of this process after `m2` over the left hand's samples in t.npy and values.npy."""
    block = Block(stream, np.load(f"{folder}/t.npy"), np.load(f"{folder}/values.npy"))
    recording = LoadedRecording("left", sized("left"), {}, {stream.name: block}, events)
    process(m2, m2.Params(), recording)
    return high_water()


def high_water() -> float:
    """Peak resident memory of this process in MB; getrusage's would be that of the process which started it."""
    status = Path("/proc/self/status").read_text()
    return (
        float(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")))
        / 1024
    )
