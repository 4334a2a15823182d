"""Append to a recording whose end is missing: what a browser kept while its server was away.

In      a recorder's file that no session has closed yet, finished or cut, plain or sealed
Out     the same file; its closing records are taken off, and written again by `close`
"""

import contextlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from mcap.records import Message

from handscope.estimators.errors import InputError
from handscope.sessions.files.recorder import BUFFER, CHECKPOINT, ORIGINAL, Continuation, Recorder
from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.sealing.stored import continue_stored, open_stored


class ContinuedRecording:
    """An open file. A crash at any moment leaves a recording that is cut behind its last whole message."""

    def __init__(self, path: Path) -> None:
        """InputError where the file is no recording."""
        self.written = 0  # messages of the port, those before included
        first, last, number, originals = None, None, 0, 0
        found = Findings()
        facts: dict[str, Any] = {}
        events: dict[str, Any] = {}
        with open_stored(path) as before:
            for topic, message in read_messages(before, found):
                first, last = first or message, message
                if topic == ORIGINAL:
                    originals = message.sequence + 1
                else:
                    number = message.sequence + (topic != CHECKPOINT)  # these take none
                self.written += topic == "wire"
                _collect(topic, message, facts, events)
        if first is None or last is None:
            raise InputError("recording.nothing_to_continue", name=path.name)
        file = continue_stored(path, found.end, BUFFER)
        self._recorder = Recorder.go_on(
            _continuation(file, first, last, (number, originals), facts, events)
        )
        self.newest = last.publish_time * 1e-9

    def write(self, chunk: bytes, arrival: float) -> None:
        """Keep bytes of the port; OSError where the disk does not take them."""
        self._recorder.write(chunk, arrival)
        self.written, self.newest = self.written + 1, arrival

    def sync(self) -> None:
        """Everything so far is on the disk when this returns."""
        self._recorder.sync()

    def close(self) -> None:
        """Finish the file."""
        self._recorder.close()


def first_metadata(path: Path) -> Mapping[str, Any]:
    """What a recording says of itself at its beginning; empty where it says nothing."""
    with contextlib.suppress(OSError, InputError, ValueError), open_stored(path) as file:
        for topic, message in read_messages(file, Findings()):
            if topic == "metadata":
                value = json.loads(message.data)
                return value if isinstance(value, dict) else {}
    return {}


def _collect(topic: str, message: Message, facts: dict[str, Any], events: dict[str, Any]) -> None:
    """What stands so far, as the recorder repeats it from time to time."""
    if topic == "metadata":
        facts |= json.loads(message.data)
    elif topic == "event":
        value = json.loads(message.data)
        events.pop(value["id"], None)
        if not value.get("retracted"):
            events[value["id"]] = value


def _continuation(
    file: Any,
    first: Message,
    last: Message,
    numbers: tuple[int, int],
    facts: Mapping[str, Any],
    events: Mapping[str, Any],
) -> Continuation:
    utc = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=first.log_time / 1e3)
    began, newest = first.publish_time * 1e-9, last.publish_time * 1e-9
    return Continuation(
        file, numbers[0] % 2**32, numbers[1] % 2**32, began, utc, newest, facts, events
    )
