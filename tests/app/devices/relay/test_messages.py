"""Limits and times of what a browser sends of its port."""

import math

import pytest

from handscope.app.devices.relay.messages import (
    BYTES_PER_S,
    HEAD,
    LARGEST,
    MESSAGES_PER_S,
    MOST_BYTES,
    MOST_MESSAGES,
    BrowserClock,
    MalformedError,
    Pace,
    TooLargeError,
    parse_chunk,
)


def test_a_message_is_taken_apart() -> None:
    chunk = parse_chunk(HEAD.pack(7, 1500.0) + b"abc")
    assert (chunk.number, chunk.time, chunk.data) == (7, 1.5, b"abc")


@pytest.mark.parametrize("size", [0, 5, HEAD.size])
def test_a_message_without_bytes_is_none(size: int) -> None:
    with pytest.raises(MalformedError):
        parse_chunk(bytes(size))


def test_the_largest_message_is_taken_and_one_byte_more_is_not() -> None:
    assert len(parse_chunk(bytes(HEAD.size + LARGEST)).data) == LARGEST
    with pytest.raises(TooLargeError):
        parse_chunk(bytes(HEAD.size + LARGEST + 1))


def test_what_waited_keeps_the_time_at_which_it_was_read() -> None:
    clock = BrowserClock(sent=1000.0, now=50.0)
    assert clock.arrival(980.0, 50.1) == pytest.approx(30.0)  # read 20 s before the connection
    assert clock.arrival(1000.2, 50.2) == pytest.approx(50.2)
    assert clock.arrival(1000.3, 50.29) == pytest.approx(50.29)  # less delayed than any before


def test_times_neither_run_back_nor_ahead() -> None:
    clock = BrowserClock(sent=1000.0, now=50.0, newest=49.0)
    assert clock.arrival(900.0, 50.1) == 49.0
    assert clock.arrival(2000.0, 50.2) == pytest.approx(50.2)
    assert clock.arrival(1000.0, 50.3) == pytest.approx(50.2)


@pytest.mark.parametrize(
    ("size", "most", "rate"),
    [(LARGEST, MOST_BYTES / LARGEST, BYTES_PER_S / LARGEST), (1, MOST_MESSAGES, MESSAGES_PER_S)],
)
def test_bytes_and_messages_a_second_are_bounded(size: int, most: float, rate: float) -> None:
    now = [0.0]
    pace = Pace(lambda: now[0])
    read = 0
    while now[0] < 20.0:
        now[0] += pace.wait(size) + 1e-4  # a sender that never pauses
        read += 1
    assert read <= most + 20.0 * rate + 2
    assert read >= 20.0 * rate
    assert math.isfinite(pace.wait(size))
