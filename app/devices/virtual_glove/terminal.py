"""Put a virtual glove behind a pseudo-terminal: any serial program can open it as it opens a real glove."""

import contextlib
import os
import select
import sys
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from handscope.app.devices.virtual_glove.faults import Faults
from handscope.app.devices.virtual_glove.firmware import Firmware
from handscope.estimators.errors import InputError

TICK = 0.004  # s between two looks at the clock
FIFO = 64 * 1024  # bytes that the glove keeps for a slow host before it drops samples


@dataclass(frozen=True)
class Action:
    """Something to do at a moment: pull or plug a strip, pull or plug the cable, tell the wearer a task."""

    at: float  # s since the glove was put up
    verb: str  # pull, plug, unplug, replug, task
    name: str = ""


@dataclass
class Script:
    """Actions still to come, in order of time; more may be typed."""

    actions: list[Action] = field(default_factory=list)

    def due(self, t: float) -> list[Action]:
        ready = [a for a in self.actions if a.at <= t]
        self.actions = [a for a in self.actions if a.at > t]
        return sorted(ready, key=lambda a: a.at)


def require_free(path: Path) -> None:
    """InputError where something else than an old link is there already."""
    if path.exists() and not path.is_symlink():
        raise InputError(f"{path} exists already; choose another --pty")


def serve(
    path: Path,
    power_up: Callable[[], Firmware],
    faults: Faults,
    script: Script,
    speed: float = 1.0,
    stop: Callable[[], bool] = lambda: False,
) -> None:
    """Run until stopped: `path` becomes a link to the pseudo-terminal while the cable is plugged in; `power_up` makes the glove anew."""
    require_free(path)
    began = time.monotonic()
    while not stop():
        with _plugged(path) as master:
            resume = _session(master, power_up(), faults, script, began, speed, stop)
        while not stop() and time.monotonic() - began < resume:
            time.sleep(TICK)
        if resume == float("inf"):
            return


def _session(
    master: int,
    glove: Firmware,
    faults: Faults,
    script: Script,
    began: float,
    speed: float,
    stop: Callable[[], bool],
) -> float:
    """Serve one plugged-in stretch; returns the time at which the cable is plugged in again, infinity for never."""
    waiting, before, watch = b"", time.monotonic(), _Watch(master)
    while not stop():
        now = time.monotonic()
        for action in script.due(now - began):
            if action.verb == "unplug":
                return float(action.name) + now - began if action.name else float("inf")
            waiting += _act(glove, action)
        received = watch.read(TICK if not waiting else 0.0)
        if received is None:
            glove.power_off()  # the host closed the port
            waiting, before = b"", time.monotonic()
            continue
        waiting += glove.handle(received)
        frames = glove.advance((now - before) * speed)
        before = now
        if len(waiting) > FIFO:
            glove.overruns += len(frames)
        else:
            waiting += faults.pass_on(frames, now - began)
        waiting = _write(master, waiting)
    return float("inf")


def _act(glove: Firmware, action: Action) -> bytes:
    if action.verb == "pull":
        return glove.pull(action.name)
    if action.verb == "plug":
        return glove.plug(action.name)
    if action.verb == "task" and not glove.wearer.cue(action.name, {}, glove._made):
        print(f"the wearer does not know the task {action.name!r}", file=sys.stderr)  # noqa: T201  a typed command's answer
    return b""


class _Watch:
    """Reads what the host sends; None while no host has the port open."""

    def __init__(self, master: int) -> None:
        self._master = master
        self._poll = select.poll()
        self._poll.register(master, select.POLLIN)

    def read(self, wait: float) -> bytes | None:
        events = self._poll.poll(wait * 1000)
        if any(kind & select.POLLIN for _, kind in events):
            with contextlib.suppress(OSError):
                return os.read(self._master, 65536)
        if any(kind & select.POLLHUP for _, kind in events):
            time.sleep(TICK)
            return None
        return b""


def _write(master: int, data: bytes) -> bytes:
    """Send what fits; gives back the rest."""
    try:
        return data[os.write(master, data) :] if data else data
    except BlockingIOError:
        return data
    except OSError:
        return b""


@contextlib.contextmanager
def _plugged(path: Path) -> Iterator[int]:
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    if path.is_symlink():
        path.unlink()
    path.symlink_to(os.ttyname(slave))
    os.close(slave)
    try:
        yield master
    finally:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        os.close(master)


def typed(lines: Sequence[str], t: float) -> list[Action]:
    """Actions of typed lines: `pull index`, `plug index`, `unplug 3`, `task tapping`."""
    return [
        Action(t, words[0], words[1] if len(words) > 1 else "")
        for line in lines
        if (words := line.split()) and words[0] in VERBS
    ]


VERBS = ("pull", "plug", "unplug", "task")
