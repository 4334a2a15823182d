"""The decoder: whole, byte by byte, cut anywhere, with everything going wrong, and everything counted."""

import struct
import zlib
from dataclasses import dataclass, field, replace

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from handscope.sessions.wire.framing import LONGEST, Counters, Decoder, Encoder
from handscope.sessions.wire.messages import Identity, Message, Ping, Samples
from handscope.sessions.wire.stuffing import unstuff
from tests.glove import identity
from tests.sessions.wire.test_messages import ANY


@dataclass
class Line:
    """A bad line to a decoder: what goes in, and what must come out."""

    encoder: Encoder = field(default_factory=Encoder)
    sent: bytes = b""
    expected: list[Message] = field(default_factory=list)
    counters: Counters = field(default_factory=Counters)
    sequence: int = 0
    newest: int | None = None
    last: bytes = b""

    def count(self, **more: int) -> None:
        self.counters = replace(
            self.counters, **{name: getattr(self.counters, name) + n for name, n in more.items()}
        )

    def frame(self, message: Message) -> bytes:
        self.sequence = (self.sequence + 1) % 65536
        return self.encoder.frame(message)

    def good(self, message: Message) -> None:
        frame = self.frame(message)
        gap = 0 if self.newest is None else (self.sequence - self.newest) % 65536 - 1
        self.sent, self.last, self.newest = self.sent + frame, frame, self.sequence
        self.expected.append(message)
        self.count(frames=1, lost=gap)

    def lose(self, message: Message) -> None:
        self.frame(message)

    def corrupt(self, message: Message, where: int, how: int) -> None:
        frame = bytearray(self.frame(message))
        k = where % (len(frame) - 1)
        frame[k] = frame[k] ^ how if frame[k] != how else frame[k] ^ (how ^ 255 or 1)
        if 0 in frame[:-1]:
            frame[k] = 255 if frame[k] != 255 else 254
        self.sent += bytes(frame)
        self.count(corrupt=1, garbage_bytes=len(frame))

    def repeat(self) -> None:
        if self.last:
            self.sent += self.last
            self.count(repeated=1)

    def garbage(self, data: bytes) -> None:
        self.sent += data + b"\0"
        if data:
            self.count(corrupt=1, garbage_bytes=len(data) + 1)


NOISE = st.binary(max_size=40).map(lambda data: data.replace(b"\0", b"\1"))
NO_IDENTITY = ANY.filter(
    lambda m: not isinstance(m, Identity)
)  # a device that begins again is a test of its own
EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("good"), NO_IDENTITY),
        st.tuples(st.just("good"), NO_IDENTITY),
        st.tuples(st.just("lose"), NO_IDENTITY),
        st.tuples(st.just("corrupt"), NO_IDENTITY, st.integers(0, 500), st.integers(1, 255)),
        st.tuples(st.just("repeat")),
        st.tuples(st.just("garbage"), NOISE),
        st.tuples(st.just("garbage"), st.integers(LONGEST, 3 * LONGEST).map(lambda n: b"x" * n)),
    ),
    max_size=25,
)


def _decoded(pieces: list[bytes]) -> tuple[list[Message], Counters]:
    decoder = Decoder()
    messages = [m for piece in pieces for m in decoder.feed(piece)]
    return messages, decoder.counters


def _cut(data: bytes, where: list[int]) -> list[bytes]:
    edges = [0, *sorted(k % (len(data) + 1) for k in where), len(data)]
    return [data[a:b] for a, b in zip(edges, edges[1:])]


@given(EVENTS, st.lists(st.integers(0, 2**32), max_size=10))
def test_whole_or_byte_by_byte_or_cut_anywhere_the_same_comes_out_and_all_is_counted(
    events: list[tuple], where: list[int]
) -> None:
    line = Line()
    for name, *arguments in events:
        getattr(line, name)(*arguments)
    whole = _decoded([line.sent])
    assert whole == (line.expected, line.counters)
    assert _decoded([bytes([b]) for b in line.sent]) == whole
    assert _decoded(_cut(line.sent, where)) == whole


@given(st.binary(max_size=3000), st.lists(st.integers(0, 3000), max_size=5))
def test_garbage_never_raises_and_every_byte_of_it_is_counted(
    garbage: bytes, where: list[int]
) -> None:
    decoder = Decoder()
    assert [m for piece in _cut(garbage + b"\0", where) for m in decoder.feed(piece)] == []
    frames = [f for f in (garbage + b"\0").split(b"\0") if f]
    assert decoder.counters == Counters(
        corrupt=len(frames), garbage_bytes=sum(len(f) + 1 for f in frames)
    )


def test_after_garbage_the_next_zero_byte_is_the_next_chance() -> None:
    encoder = Encoder()
    frames = [encoder.frame(Ping(k)) for k in range(3)]
    messages, counters = _decoded([b"noise", frames[0], frames[1], frames[2]])
    assert messages == [Ping(1), Ping(2)]
    assert counters == Counters(frames=2, corrupt=1, garbage_bytes=5 + len(frames[0]))


@pytest.mark.parametrize(
    "length", [LONGEST - 1, LONGEST, LONGEST + 1, 2 * LONGEST, 2 * LONGEST + 2]
)
def test_what_is_too_long_for_a_frame_is_dropped_without_being_kept(length: int) -> None:
    decoder = Decoder()
    for _ in range(length):
        assert list(decoder.feed(b"x")) == []
        assert len(decoder._rest) <= LONGEST
    assert list(decoder.feed(b"\0" + Encoder().frame(Ping(1)))) == [Ping(1)]
    assert decoder.counters == Counters(frames=1, corrupt=1, garbage_bytes=length + 1)


def test_the_longest_burst_of_a_strip_fits_a_frame() -> None:
    burst = Samples(1, 0, 0, 0, 50, bytes(50 * 3 * 6 * 4))  # three sensors, six axes of four bytes
    frame = Encoder().frame(burst)
    assert len(frame) <= LONGEST
    assert _decoded([frame])[0] == [burst]


def test_the_sequence_wraps_without_a_loss() -> None:
    encoder = Encoder()
    encoder._sequence = 65534
    messages, counters = _decoded([encoder.frame(Ping(k)) for k in range(4)])
    assert [m.token for m in messages] == [0, 1, 2, 3]
    assert counters == Counters(frames=4)


def test_a_loss_across_the_wrap_is_counted() -> None:
    encoder = Encoder()
    encoder._sequence = 65534
    frames = [encoder.frame(Ping(k)) for k in range(5)]
    assert _decoded([frames[0], frames[4]])[1] == Counters(frames=2, lost=3)


def test_a_frame_that_comes_late_is_dropped_and_its_loss_stays_counted() -> None:
    encoder = Encoder()
    a, b, c = (encoder.frame(Ping(k)) for k in range(3))
    messages, counters = _decoded([a, c, b])
    assert [m.token for m in messages] == [0, 2]
    assert counters == Counters(frames=2, lost=1, repeated=1)


def test_a_type_of_a_later_version_is_counted_and_its_number_used_up() -> None:
    encoder = Encoder()
    known = encoder.frame(Ping(0))
    body = struct.pack("<BH", 0x7E, 1) + b"later"
    later = cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"
    encoder._sequence = 2
    messages, counters = _decoded([known, later, encoder.frame(Ping(2))])
    assert [m.token for m in messages] == [0, 2]
    assert counters == Counters(frames=2, malformed=1)


def test_a_device_that_begins_again_begins_its_numbers_again() -> None:
    first, second = Encoder(), Encoder()
    first._sequence = 500
    before = [first.frame(identity(1)), first.frame(Ping(1))]
    again = [second.frame(identity(2)), second.frame(Ping(2))]
    messages, counters = _decoded([*before, *again])
    assert [m.token for m in messages if isinstance(m, Ping)] == [1, 2]
    assert counters == Counters(frames=4)


def test_the_same_identity_again_is_no_new_beginning() -> None:
    encoder = Encoder()
    frames = [encoder.frame(m) for m in (identity(1), Ping(1), identity(1), Ping(2))]
    assert _decoded([*frames[:2], frames[0], *frames[2:]])[1] == Counters(frames=4, repeated=1)


@given(
    st.binary(max_size=600)
    | st.lists(st.sampled_from([b"\0", b"\1", b"\2", b"\xff", b"x" * 254]), max_size=8).map(
        b"".join
    )
)
def test_frames_are_unstuffed_as_the_reference_does(data: bytes) -> None:
    assert unstuff(cobs.encode(data)) == data
    try:
        expected = cobs.decode(data)
    except cobs.DecodeError:
        expected = None
    assert unstuff(data) == expected
