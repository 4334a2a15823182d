"""What a source of another protocol gave, as it came: kept beside the wire bytes that were made of it, and ignored when the recording is opened.

In      messages of channel `original` of a native recording (docs/recording.md)
Out     a head of JSON in one line, which says what the bytes behind it are
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handscope.sessions.files.recorder import ORIGINAL
from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.sealing.stored import open_stored


@dataclass(frozen=True)
class Original:
    """One message."""

    head: Mapping[str, Any]  # `kind` at least
    body: bytes = b""


def pack(original: Original) -> bytes:
    """The message's bytes."""
    return json.dumps(dict(original.head), separators=(",", ":")).encode() + b"\n" + original.body


def unpack(data: bytes) -> Original:
    """The message of these bytes; ValueError if they are not a message."""
    head, _, body = data.partition(b"\n")
    return Original(json.loads(head), body)


def read_originals(path: Path, found: Findings | None = None) -> Iterator[Original]:
    """Those of a recording in order, plain or sealed, as far as it can be read."""
    with open_stored(path) as file:
        for topic, message in read_messages(file, found or Findings()):
            if topic == ORIGINAL:
                yield unpack(message.data)
