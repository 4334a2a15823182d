"""Read a native recording, whole or cut anywhere, and say what it holds and what was cut."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Message

from handscope.estimators.data.magnet_declaration import plate_from
from handscope.estimators.data.samples import Block, Event, join
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS, HANDS, Hand
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.messages.finger_words import FINGER_WORDS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.sessions.files.recorder import FORMAT_VERSION
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.sealing.stored import open_stored
from handscope.sessions.tables_io import force_calibrations
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.messages import Identity
from handscope.sessions.wire.protocol_warnings import protocol_warnings

SUFFIX = ".mcap"
CHUNK = 1000  # messages of the wire that are decoded at a time


@dataclass
class Contents:
    """The messages of a file in order, as far as it can be read."""

    wire: list[tuple[float, bytes]] = field(default_factory=list)  # (arrival s, bytes)
    events: dict[str, Event] = field(default_factory=dict)
    metadata: dict[str, Any] = field(default_factory=dict)
    file: Findings = field(default_factory=Findings)


def read(path: Path) -> Contents:
    """Everything in the file up to its end, its cut or its damage; InputError where it is no recording of ours."""
    contents = Contents()
    try:
        with open_stored(path) as file:
            for topic, message in read_messages(file, contents.file):
                store_message(contents, topic, message)
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from None
    except (ValueError, TypeError, KeyError):
        raise InputError("recording.foreign_metadata", name=path.name) from None
    version = contents.metadata.get("format_version", FORMAT_VERSION if contents.wire else None)
    if version is None:
        if contents.file.ours:
            raise InputError("recording.cut_at_start", name=path.name)
        if not path.stat().st_size:
            raise InputError("recording.empty", name=path.name)
        raise InputError("recording.not_ours", name=path.name)
    if not isinstance(version, int) or version > FORMAT_VERSION:
        raise InputError(
            "recording.newer_format",
            name=path.name,
            version=version,
            newest=FORMAT_VERSION,
        )
    return contents


def load(path: Path, hand: Hand | None = None, correct: bool = True) -> LoadedRecording:
    """Open a recording: decode its wire bytes as the live view did; `hand` where neither recording nor glove says it.

    With `correct` false the samples are what the sensors read, not corrected by their strips' calibrations.
    """
    contents = read(path)
    stored = force_calibrations.of_recording(contents.metadata)
    assembler, parts = (
        Assembler(
            correct=correct, exchanged=_exchanged_strips(contents.metadata), stored_forces=stored
        ),
        _Parts(),
    )
    for k in range(0, len(contents.wire), CHUNK):
        parts.add(assembler.feed_all(contents.wire[k : k + CHUNK]))
    side = _hand(contents.metadata, assembler.identity, hand)
    geometry = sized(side, measures_from(contents.metadata.get("geometry") or {}))
    mounting = assembler.mounting | {
        name: np.asarray(q, dtype=float)
        for name, q in dict(contents.metadata.get("mounting") or {}).items()
    }
    return LoadedRecording(
        side,
        geometry,
        mounting,
        parts.joined(),
        tuple(sorted([*contents.events.values(), *assembler.marks], key=lambda e: e.onset)),
        warnings=tuple(_warnings(contents, assembler)),
        start_utc=contents.metadata.get("start_utc"),
        checksum=file_checksum(path),
        source=_source(contents.metadata, assembler.identity),
        losses={name: count.lost for name, count in assembler.counts.items()},
        strip_ids={
            point: f"{strip.strip_id:x}"
            for strip in assembler.strips.values()
            for point in strip.points
        },
        plate=plate_from(contents.metadata.get("magnet_setup") or {}) or assembler.plate,
    )


def file_checksum(path: Path) -> str:
    """sha256 of a file's content; of a sealed file, of what was sealed."""
    total = hashlib.sha256()
    with open_stored(path) as file:
        while piece := file.read(2**20):
            total.update(piece)
    return total.hexdigest()


class _Parts:
    """Blocks by stream; a stream whose description changes goes on under a name of its own."""

    def __init__(self) -> None:
        self._blocks: dict[str, list[Block]] = {}

    def add(self, blocks: list[Block]) -> None:
        for block in blocks:
            name, k = block.stream.name, 2
            while name in self._blocks and self._blocks[name][0].stream != block.stream:
                name, k = f"{block.stream.name}-{k}", k + 1
            self._blocks.setdefault(name, []).append(block)

    def joined(self) -> dict[str, Block]:
        return {name: _with_name(join(blocks), name) for name, blocks in self._blocks.items()}


def _with_name(block: Block, name: str) -> Block:
    if block.stream.name == name:
        return block
    return replace(block, stream=replace(block.stream, name=name))


def store_message(contents: Contents, topic: str, message: Message) -> None:
    """Take a message into the contents; those of other topics are passed over."""
    if topic == "wire":
        contents.wire.append((message.publish_time * 1e-9, message.data))
    elif topic == "metadata":
        contents.metadata |= json.loads(message.data)
    elif topic == "event":
        value = json.loads(message.data)
        name = value.pop("id")
        if value.pop("retracted", False):
            contents.events.pop(name, None)
        else:
            contents.events[name] = Event(**value)


def _hand(metadata: Mapping[str, Any], identity: Identity | None, wanted: Hand | None) -> Hand:
    hands = {
        source: hand
        for source, hand in (
            ("the recording", metadata.get("hand")),
            ("the glove", identity.hand if identity else None),
        )
        if hand in HANDS
    }
    if len(set(hands.values())) > 1:
        raise InputError(
            "recording.hand_differs_from_glove",
            one=hands["the recording"],
            other=hands["the glove"],
        )
    for hand in HANDS:
        if hand in hands.values():
            if wanted not in (None, hand):
                raise InputError("recording.other_hand", one=hand, other=wanted)
            return hand
    if wanted is None:
        raise InputError("recording.hand_not_given")
    return wanted


def _exchanged_strips(metadata: Mapping[str, Any]) -> dict[str, str]:
    """The finger that a strip was found to be worn on, by the finger that it declares."""
    pairs = dict(metadata.get("exchanged_strips") or {})
    return {
        str(f): str(on) for f, on in pairs.items() if f in FINGERS and on in FINGERS and f != on
    }


def _warnings(contents: Contents, assembler: Assembler) -> Iterator[str]:
    if not contents.file.finished:
        yield phrase("recording.not_closed", bytes=contents.file.unread)
    if ended := contents.metadata.get("ended"):
        yield str(ended)
    if contents.file.damaged:
        yield phrase("recording.damaged_pieces", count=contents.file.damaged)
    yield from protocol_warnings(assembler)
    counts = contents.metadata.get("source_counts") or {}
    if strangers := counts.get("packets_of_strangers"):
        yield phrase("recording.strange_packets", count=strangers)
    if unplaced := counts.get("samples_of_sensors_without_a_place"):
        yield phrase("recording.strange_trackers", count=unplaced)
    if assembler.replaced:
        yield phrase("recording.another_glove")
    for finger, on in assembler.exchanged.items():
        yield phrase("recording.strip_exchanged", one=FINGER_WORDS[finger], other=FINGER_WORDS[on])


def _source(metadata: Mapping[str, Any], identity: Identity | None) -> dict[str, Any]:
    device = (
        {
            "device": identity.name,
            "device_id": f"{identity.device_id:016x}",
            "firmware": identity.firmware,
        }
        if identity
        else {}
    )
    return {
        "format": "native",
        "software": metadata.get("software", ""),
        "port": metadata.get("port", ""),
        **device,
    }
