"""Serve a virtual glove over a line: power it up while the cable is plugged in, follow the script, send and receive."""

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from handscope.app.devices.virtual_glove.faults import Faults
from handscope.app.devices.virtual_glove.firmware import Firmware

TICK = 0.004  # s between two looks at the clock
FIFO = 64 * 1024  # bytes that the glove keeps for a slow host before it drops samples


class Line(Protocol):
    """Bytes to and from one host."""

    def read(self, wait: float) -> bytes | None:
        """What the host sent, at most `wait` s from now; None while no host is there."""

    def write(self, data: bytes) -> bytes:
        """Send what fits now; gives back the rest."""


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


def serve(
    plug: Callable[[], AbstractContextManager[Line]],
    power_up: Callable[[], Firmware],
    faults: Faults,
    script: Script,
    speed: float = 1.0,
    stop: Callable[[], bool] = lambda: False,
) -> None:
    """Run until stopped: `plug` plugs the cable in, `power_up` makes the glove anew."""
    began = time.monotonic()
    while not stop():
        with plug() as line:
            resume = _session(line, power_up(), faults, script, began, speed, stop)
        while not stop() and time.monotonic() - began < resume:
            time.sleep(TICK)
        if resume == float("inf"):
            return


def _session(
    line: Line,
    glove: Firmware,
    faults: Faults,
    script: Script,
    began: float,
    speed: float,
    stop: Callable[[], bool],
) -> float:
    """Serve one plugged-in stretch; returns the time at which the cable is plugged in again, infinity for never."""
    waiting, before = b"", time.monotonic()
    while not stop():
        now = time.monotonic()
        for action in script.due(now - began):
            if action.verb == "unplug":
                return float(action.name) + now - began if action.name else float("inf")
            waiting += _act(glove, action)
        received = line.read(TICK)
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
        waiting = line.write(waiting)
    return float("inf")


def _act(glove: Firmware, action: Action) -> bytes:
    if action.verb == "pull":
        return glove.pull(action.name)
    if action.verb == "plug":
        return glove.plug(action.name)
    if action.verb == "task" and not glove.wearer.cue(action.name, {}, glove._made):
        print(f"the wearer does not know the task {action.name!r}", file=sys.stderr)  # noqa: T201  a typed command's answer
    return b""


def typed(lines: Sequence[str], t: float) -> list[Action]:
    """Actions of typed lines: `pull index`, `plug index`, `unplug 3`, `task tapping`."""
    return [
        Action(t, words[0], words[1] if len(words) > 1 else "")
        for line in lines
        if (words := line.split()) and words[0] in VERBS
    ]


VERBS = ("pull", "plug", "unplug", "task")
