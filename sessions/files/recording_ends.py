"""What a long recording holds, from its beginning and its end: in a time that does not grow with its length.

A recorder repeats events and metadata in checkpoints. The newest is looked for from the end of the file backwards, and what follows it is read; who the
glove is and which streams it sends stand at the beginning.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from handscope.estimators.data.samples import Event, Stream
from handscope.sessions.files.native import Contents, store_message
from handscope.sessions.files.recorder import CHECKPOINT, FORMAT_VERSION, ORIGINAL
from handscope.sessions.files.recording_file import Findings, find_last_chunk, read_messages
from handscope.sessions.sealing.stored import open_stored
from handscope.sessions.wire.assembly import Assembler

WINDOW = 2**20  # bytes at the end that are looked through first
HEAD = 2**18  # bytes of messages at the beginning that are decoded: a second of 17 sensors at 1 kHz


@dataclass(frozen=True)
class RecordingEnds:
    """What the two ends tell; samples are not counted, nor the losses in the middle."""

    metadata: dict[str, Any]
    events: tuple[Event, ...]
    streams: tuple[Stream, ...]  # streams with a sample in the head of the recording
    device_id: int
    duration: float  # s between the first and the last arrival
    finished: bool


def read_ends(path: Path) -> RecordingEnds | None:
    """None where the ends do not tell enough, and the recording must be read whole."""
    with open_stored(path) as file:
        at = _find_checkpoint(file)
        return None if at is None else _read_from(file, at)


def _read_from(file: IO[bytes], at: int) -> RecordingEnds | None:
    """The ends of a file whose newest good checkpoint is the first chunk at `at`."""
    head = _decode_head(file)
    if head is None:
        return None
    assembler, first = head
    contents = Contents()
    newest = first
    for topic, message in read_messages(file, contents.file, at):
        newest = message.publish_time * 1e-9
        if topic == CHECKPOINT:
            _take_checkpoint(contents, json.loads(message.data))
        elif topic != "wire":
            store_message(contents, topic, message)
    streams = tuple(s for s in assembler.streams.values() if assembler.counts[s.name].samples)
    if not streams or assembler.identity is None or _lacks_readable_format(contents):
        return None
    return RecordingEnds(
        contents.metadata,
        tuple(sorted(contents.events.values(), key=lambda e: e.onset)),
        streams,
        assembler.identity.device_id,
        max(0.0, newest - first),
        contents.file.finished,
    )


def _lacks_readable_format(contents: Contents) -> bool:
    version = contents.metadata.get("format_version")
    return not isinstance(version, int) or version > FORMAT_VERSION


def _take_checkpoint(contents: Contents, value: dict[str, Any]) -> None:
    contents.metadata = dict(value["metadata"])
    contents.events = {
        e["id"]: Event(**{k: v for k, v in e.items() if k != "id"}) for e in value["events"]
    }


def _decode_head(file: IO[bytes]) -> tuple[Assembler, float] | None:
    """The glove as it describes itself at the beginning, and when its first byte arrived, s."""
    assembler, found, first, taken = Assembler(), Findings(), None, 0
    for topic, message in read_messages(file, found):
        taken += len(message.data) if topic != ORIGINAL else 0
        if topic == "wire":
            arrival = message.publish_time * 1e-9
            first = arrival if first is None else first
            assembler.feed(message.data, arrival)
        if taken > HEAD:
            break
    return None if first is None else (assembler, first)


def _find_checkpoint(file: IO[bytes]) -> int | None:
    """Where the chunk of the newest good checkpoint begins, looked for in windows from the end backwards."""
    end = file.seek(0, os.SEEK_END)
    width = WINDOW
    while end > 0:
        start = max(0, end - width)
        if (at := find_last_chunk(file, CHECKPOINT, start, end)) is not None:
            return at
        end, width = start, 2 * width
    return None
