"""A recording in memory, gone through in slices."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Event, Stream, join
from handscope.estimators.errors import InputError
from handscope.sessions.files.recording import SLICE, LoadedRecording, require_samples
from tests.simulated import in_strips, loaded


def _stream(name: str, start: float, n: int, rate: float) -> Block:
    return Block(
        Stream(name, ("hand",), (GYR, ACC), rate),
        start + np.arange(n) / rate,
        np.arange(6.0 * n).reshape(n, 1, 6),
    )


@given(
    st.floats(-5, 5), st.integers(1, 5000), st.sampled_from([10.0, 33.3, 100.0]), st.floats(-20, 20)
)
def test_every_sample_comes_once_and_in_order(
    start: float, n: int, rate: float, later: float
) -> None:
    blocks = {
        "a": _stream("a", start, n, rate),
        "b": _stream("b", start + later, n // 2, rate / 2),
        "c": _stream("c", 0, 0, 50.0),
    }
    recording = replace(loaded(in_strips("left")), samples=blocks)
    pieces = list(recording.blocks())
    for name in ("a", "b") if n > 1 else ("a",):
        whole = join([p for p in pieces if p.stream.name == name])
        np.testing.assert_array_equal(whole.t, blocks[name].t)
        np.testing.assert_array_equal(whole.values, blocks[name].values)
    assert all(0 < len(p.t) <= SLICE * p.stream.rate + 1 for p in pieces)


def test_a_sample_on_the_edge_of_a_slice_is_neither_lost_nor_doubled() -> None:
    """0.1 + 3 * 10 and (0.1 + 2 * 10) + 10 are different numbers."""
    for start in np.random.default_rng(1).uniform(0, 1, 50):
        edges = start + SLICE * np.arange(8)
        for t in (edges, np.nextafter(edges, -np.inf), np.nextafter(edges, np.inf)):
            t = np.concatenate([[start], t[1:]])
            block = Block(Stream("a", ("hand",), (GYR, ACC), 0.1), t, np.zeros((8, 1, 6)))
            recording = replace(loaded(in_strips("left")), samples={"a": block})
            np.testing.assert_array_equal(join(list(recording.blocks())).t, t)


def test_its_duration_is_from_the_first_to_the_last_sample_of_any_stream() -> None:
    recording = replace(
        loaded(in_strips("left")),
        samples={"a": _stream("a", 1.0, 101, 100.0), "b": _stream("b", 1.5, 201, 100.0)},
    )
    assert recording.duration == pytest.approx(2.5)
    assert replace(recording, samples={}).duration == 0.0
    assert list(replace(recording, samples={}).blocks()) == []


def test_events_of_a_type_come_in_order_of_time() -> None:
    events = (Event(5.0, 1.0, "task"), Event(1.0, 1.0, "task"), Event(0.0, 1.0, "rest"))
    recording = loaded(in_strips("left")).with_events(events)
    assert [e.onset for e in recording.of_type("task")] == [1.0, 5.0]
    assert [len(b.t) for b in recording.during(1.0, 2.0)] == [100, 100, 100, 100, 100, 100, 60]


def test_a_recording_without_inertial_samples_is_refused() -> None:
    mag = Block(Stream("mag", ("hand",), (MAG,), 50.0), np.arange(5) / 50, np.zeros((5, 1, 3)))
    for samples in ({}, {"mag": mag}, {"a": _stream("a", 0, 0, 50.0)}):
        empty: LoadedRecording = replace(loaded(in_strips("left")), samples=samples)
        with pytest.raises(InputError, match=r"empty\.zip has no inertial samples"):
            require_samples(empty, "empty.zip")
