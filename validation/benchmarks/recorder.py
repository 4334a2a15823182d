"""17 sensors at 1 kHz while the estimator is blocked for 5 s: what the recording lost, and what the live view skipped."""

import tempfile
import threading
import time
from pathlib import Path

from handscope.app.devices.glove import Glove
from handscope.estimators.data.samples import Block
from handscope.sessions.files import native
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import glove, wait_for

SECONDS = 10.0
BLOCKED = 5.0  # s


def measure() -> list[Metric]:
    """Samples lost by the sample counters of the streams, read back from the file."""
    with tempfile.TemporaryDirectory() as folder:
        port, file = Path(folder) / "glove", Path(folder) / "recording.mcap"
        blocked = threading.Event()

        def estimator(blocks: list[Block]) -> None:
            if not blocked.is_set():
                blocked.set()
                until = time.monotonic() + BLOCKED
                while (
                    time.monotonic() < until
                ):  # holds the interpreter as a runaway computation would
                    pass

        with (
            glove(port, "--rate", "1000"),
            Glove(str(port), file, {"hand": "left"}, estimator) as worn,
        ):
            wait_for(blocked.is_set)
            time.sleep(SECONDS)
            overruns = worn.assembler.status.overruns if worn.assembler.status else 0
        recording = native.load(file)
        samples = sum(len(b.t) * len(b.stream.sensors) for b in recording.samples.values())
        # the streams' counters count what the glove dropped, too, but for what nothing came after:
        # that is reported in frames, of a sample and more
        lost = max(sum(recording.losses.values()), overruns)
        size = file.stat().st_size
    return [
        Metric("samples lost by the recording", float(lost), "samples", 0.0, "lower"),
        Metric("samples recorded", samples / recording.duration / 1000, "k per s", None, "higher"),
        Metric(
            "size of the recording", size / recording.duration / 1000, "kB per s", None, "lower"
        ),
    ]
