"""A recording as a killed program leaves it: as long as wanted, with a task at its end."""

import random
from functools import cache
from pathlib import Path

from handscope.estimators.data.samples import Event
from handscope.sessions.files.recorder import Recorder
from tests.glove import frames, whole_session
from tests.simulated import in_strips

STEP = 0.5  # s between two commands
FILLER = random.Random(25).randbytes(2**14)  # that each of them holds; nothing makes it smaller


@cache
def _movement() -> list[tuple[bytes, float]]:
    """What two strips send, and when it arrives."""
    samples = in_strips("left").samples
    sent = whole_session({name: samples[name] for name in ("hand", "index")})
    return list(zip(frames(m.message for m in sent), (m.arrival for m in sent)))


def write_left_open(path: Path, minutes: float, close: bool = False, stored: bool = False) -> None:
    """A movement, then minutes of what the glove was told, and a task at the end; not closed: the program was killed."""
    recorder = Recorder(path, {"hand": "left"}, 99.0, stored=stored)
    with recorder.together():
        for chunk, arrival in _movement():
            recorder.write(chunk, arrival)
    for k in range(round(minutes * 60 / STEP)):
        recorder.command(FILLER, arrival + STEP * k)
    task = Event(1.0, 3.0, "task", {"task_name": "tapping"})
    recorder.event("t", task, arrival + 60.0 * minutes)
    if close:
        recorder.close()
    else:
        recorder.sync()
        recorder._file.close()
