"""Stretches in which a strip gave nothing are found in its time stamps."""

from collections.abc import Sequence

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.geometry import sized
from handscope.sessions.files.absences import SHORTEST, absences
from handscope.sessions.files.recording import LoadedRecording

RATE = 100.0  # Hz


def recording(**times: Sequence[np.ndarray]) -> LoadedRecording:
    """Streams by name, each with samples in these stretches."""
    samples = {}
    for name, stretches in times.items():
        t = np.concatenate(stretches)
        samples[name] = Block(Stream(name, (name,), (GYR, ACC), RATE), t, np.zeros((len(t), 1, 6)))
    return LoadedRecording("left", sized("left"), {}, samples, ())


def during(start: float, stop: float) -> np.ndarray:
    return np.arange(start, stop, 1 / RATE)


def test_a_strip_that_was_pulled_and_came_back_was_absent_between() -> None:
    found = absences(recording(hand=[during(0, 14)], index=[during(0, 7.1), during(9.2, 14)]))
    assert list(found) == ["index"]
    assert found["index"] == [(pytest.approx(7.09), pytest.approx(9.2))]


def test_a_strip_that_came_late_or_went_for_good_was_absent_at_the_ends() -> None:
    found = absences(recording(hand=[during(0, 10)], index=[during(2, 10)], ring=[during(0, 6)]))
    assert found["index"] == [(0.0, pytest.approx(2.0))]
    assert found["ring"] == [(pytest.approx(5.99), pytest.approx(9.99))]


def test_a_cable_that_was_pulled_takes_every_strip_with_it() -> None:
    parts = [during(0, 3), during(4, 8)]
    found = absences(recording(hand=parts, index=parts))
    assert found["hand"] == found["index"] != []


def test_lost_bursts_and_slow_streams_are_no_absence() -> None:
    slow = np.arange(0, 10, 2 * SHORTEST)
    samples = dict(recording(hand=[during(0, 4), during(4 + 0.9 * SHORTEST, 10)]).samples)
    samples["force"] = Block(
        Stream("force", ("index_tip_force",), ("force",), 0.5 / SHORTEST),
        slow,
        np.zeros((len(slow), 1, 3)),
    )
    assert absences(LoadedRecording("left", sized("left"), {}, samples, ())) == {}


def test_a_recording_without_samples_has_none() -> None:
    assert absences(recording(hand=[during(0, 0)])) == {}
