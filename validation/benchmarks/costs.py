"""What work costs: processor time, which other work on the machine hardly changes, and the peak memory of a process that does nothing else."""

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from handscope.estimators.data.samples import Block, Event, Stream
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.sessions.files.recording import LoadedRecording

REPEATS = 5
TICKS = os.sysconf("SC_CLK_TCK")


def time_of_work(work: Callable[[], object]) -> float:
    """Seconds, the median of several runs after one that warms up."""
    work()
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return statistics.median(spent)


def time_of_python(words: Sequence[str]) -> float:
    """Seconds of a Python of its own and all that it starts, the median of several runs after one that warms up."""
    command = [sys.executable, "-P", *words]
    subprocess.run(command, check=True, capture_output=True)
    return statistics.median(_of_command(command) for _ in range(REPEATS))


def _of_command(command: Sequence[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def memory_of_processing(
    folder: str, stream: Stream, events: tuple[Event, ...], name: str
) -> tuple[float, float]:
    """MB of this process, by a method over the left hand's samples in t.npy and values.npy: high water, and what it holds with the result but for pages of files, which processes share."""
    block = Block(stream, np.load(f"{folder}/t.npy"), np.load(f"{folder}/values.npy"))
    recording = LoadedRecording("left", sized("left"), {}, {stream.name: block}, events)
    held = process(METHODS[name], METHODS[name].Params(), recording)
    own = _memory("RssAnon")
    del held
    return high_water(), own


def high_water() -> float:
    """Peak resident memory of this process in MB; getrusage's would be that of the process which started it."""
    return _memory("VmHWM")


def _memory(field: str) -> float:
    """MB of this process, by a field of its status."""
    status = Path("/proc/self/status").read_text()
    return (
        float(next(line.split()[1] for line in status.splitlines() if line.startswith(field)))
        / 1024
    )


def time_of_processes(pid: int) -> float:
    """Processor time (s) of a process and its descendants so far."""
    return sum(_stat(one)[1] for one in family(pid))


def time_of_process(pid: int, thread: int | None = None) -> float:
    """Processor time (s) of one process so far, or of one of its threads."""
    return _stat(pid if thread is None else f"{pid}/task/{thread}")[1]


def memory_of_processes(pid: int) -> float:
    """MB of a process and its descendants; what several share counts once."""
    return sum(_proportional_set_size(one) for one in family(pid))


def family(pid: int) -> set[int]:
    """A process and its descendants."""
    parents = {
        one: _stat(one)[0] for one in (int(path.name) for path in Path("/proc").glob("[0-9]*"))
    }
    found = {pid}
    while more := {one for one, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def _stat(process: int | str) -> tuple[int, float]:
    """Parent and processor time (s) so far; 0 of a process that has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0, 0.0
    return int(fields[1]), (int(fields[11]) + int(fields[12])) / TICKS


def _proportional_set_size(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return next(float(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024
