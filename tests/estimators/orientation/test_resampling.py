"""Streams of different rates on one time base."""

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Stream
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.orientation import resampling
from handscope.estimators.orientation.fusion import Oriented
from tests.simulated import DEG

HAND = Stream("hand", ("hand",), (GYR, ACC), 100.0)
FOREARM = Stream("forearm", ("forearm",), (GYR, ACC), 40.0)
INDEX = Stream("index", ("index_proximal", "index_middle"), (GYR, ACC), 100.0)


def _turning(
    stream: Stream, start: float, stop: float, rate: float = 1.0, flag: int = 0
) -> Oriented:
    """Sensors that turn about z at `rate` rad/s from heading 0 at t = 0."""
    t = np.arange(round(start * stream.rate), round(stop * stream.rate)) / stream.rate
    q = np.repeat(quat.about(2, rate * t)[:, None], len(stream.sensors), axis=1)
    return Oriented(
        t,
        q,
        np.full((len(t), len(stream.sensors)), flag, np.uint8),
        np.zeros((len(t), len(stream.sensors))),
        np.ones(len(t), bool),
    )


def _rows(
    streams: tuple[Stream, ...], fed: list[tuple[Stream, Oriented]]
) -> tuple[list[resampling.Rows], resampling.Rows]:
    """What each step gives, and everything together."""
    state, given = resampling.start(streams), []
    for stream, oriented in fed:
        state, rows = resampling.step(state, (stream, oriented))
        given.append(rows)
    _, last = resampling.finish(state)
    return given, resampling.join([*given, last])


def test_the_fastest_stream_makes_the_rows_and_the_hands_where_rates_are_equal() -> None:
    assert resampling.start((FOREARM, INDEX, HAND)).reference == "hand"
    assert (
        resampling.start((HAND, Stream("index", ("index_distal",), (GYR, ACC), 200.0))).reference
        == "index"
    )
    mag = Stream("mag", ("hand",), (MAG,), 500.0)
    assert resampling.start((HAND, mag)).reference == "hand"


def test_a_slower_stream_is_interpolated_along_the_great_circle() -> None:
    _, rows = _rows(
        (HAND, FOREARM), [(FOREARM, _turning(FOREARM, 0, 1, -2.0)), (HAND, _turning(HAND, 0, 1))]
    )
    inside = rows.t <= 39 / 40
    np.testing.assert_array_equal(rows.t, np.arange(100) / 100)
    np.testing.assert_allclose(
        quat.twist(rows.q_GS[inside, SEGMENT["forearm"]], 2), -2 * rows.t[inside], atol=1e-12
    )
    assert np.isnan(rows.q_GS[:, SEGMENT["ring_distal"]]).all()
    assert not rows.flags[inside].any()


def test_rows_wait_for_the_slowest_stream() -> None:
    given, rows = _rows(
        (HAND, FOREARM),
        [
            (HAND, _turning(HAND, 0, 1)),
            (FOREARM, _turning(FOREARM, 0, 0.5)),
            (FOREARM, _turning(FOREARM, 0.5, 1)),
        ],
    )
    # up to the forearm's samples at 0.475 and 0.975 s
    assert [len(g.t) for g in given] == [
        0,
        48,
        50,
    ]
    assert len(rows.t) == 100


def test_at_the_end_a_stream_that_fell_silent_is_held_and_marked() -> None:
    _, rows = _rows(
        (HAND, FOREARM), [(FOREARM, _turning(FOREARM, 0, 0.5)), (HAND, _turning(HAND, 0, 1))]
    )
    late = rows.t > 0.475 + 1.5 / 40
    forearm = rows.q_GS[:, SEGMENT["forearm"]]
    np.testing.assert_allclose(quat.twist(forearm[late], 2), 0.475, atol=1e-12)  # held
    np.testing.assert_array_equal((rows.flags[:, SEGMENT["forearm"]] & Flag.MISSING) != 0, late)
    assert not rows.flags[:, SEGMENT["hand"]].any()


def test_a_live_view_leaves_a_silent_stream_behind_after_its_patience() -> None:
    state = resampling.start((HAND, FOREARM))
    state, _ = resampling.step(state, (FOREARM, _turning(FOREARM, 0, 0.5)))
    state, given = resampling.step(state, (HAND, _turning(HAND, 0, 1)))
    assert given.t[-1] == pytest.approx(0.47)
    state, released = resampling.release(state, 0.1)
    assert released.t[0] == pytest.approx(0.48)
    assert released.t[-1] == pytest.approx(0.99 - 0.1)
    # it was only late: what was shown is not shown again
    _, later = resampling.step(state, (FOREARM, _turning(FOREARM, 0.5, 1)))
    assert later.t[0] == pytest.approx(0.90)


def test_while_the_reference_is_silent_another_stream_makes_the_rows() -> None:
    state = resampling.start((HAND, FOREARM))
    state, _ = resampling.step(state, (HAND, _turning(HAND, 0, 0.5)))
    state, first = resampling.step(state, (FOREARM, _turning(FOREARM, 0, 1)))
    state, released = resampling.release(state, 0.1)
    np.testing.assert_allclose(np.diff(released.t), 1 / 40)
    assert (released.flags[1:, SEGMENT["hand"]] & Flag.MISSING).all()
    state, back = resampling.step(state, (HAND, _turning(HAND, 0.5, 1.2)))
    state, back = resampling.release(state, 0.1)
    assert state.reference == "hand"
    assert (np.diff(np.concatenate([first.t, released.t, back.t])) > 0).all()


def test_before_a_stream_begins_its_segments_are_unknown() -> None:
    _, rows = _rows(
        (HAND, FOREARM), [(FOREARM, _turning(FOREARM, 0.5, 1)), (HAND, _turning(HAND, 0, 1))]
    )
    early = rows.t < 0.5 - 1.5 / 40 - 1e-9
    np.testing.assert_array_equal(np.isnan(rows.q_GS[:, SEGMENT["forearm"], 0]), early)
    np.testing.assert_array_equal((rows.flags[:, SEGMENT["forearm"]] & Flag.MISSING) != 0, early)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_segment_that_goes_on_in_another_stream_is_known_throughout(swapped: bool) -> None:
    """A strip that was described anew (another rate) is two streams one after the other."""
    anew = Stream("index-2", INDEX.sensors, (GYR, ACC), 50.0)
    fed = [(INDEX, _turning(INDEX, 0, 0.5)), (anew, _turning(anew, 0.5, 1))]
    streams = (HAND, anew, INDEX) if swapped else (HAND, INDEX, anew)
    _, rows = _rows(streams, [*fed, (HAND, _turning(HAND, 0, 1))])
    inside = rows.t <= 0.98
    np.testing.assert_allclose(
        quat.twist(rows.q_GS[inside, SEGMENT["index_middle"]], 2), rows.t[inside], atol=0.02
    )
    assert not rows.flags[inside, SEGMENT["index_middle"]].any()


def test_flags_of_both_neighbours_reach_an_interpolated_row() -> None:
    flagged = _turning(FOREARM, 0, 1)
    flagged.flags[8] = Flag.SATURATED  # at 0.2 s
    _, rows = _rows((HAND, FOREARM), [(FOREARM, flagged), (HAND, _turning(HAND, 0, 1))])
    hit = rows.t[(rows.flags[:, SEGMENT["forearm"]] & Flag.SATURATED) != 0]
    assert hit[0] == pytest.approx(0.18)
    assert hit[-1] == pytest.approx(0.22)


def test_instants_without_a_sample_make_no_row() -> None:
    data = _turning(HAND, 0, 1)
    data.sampled[30:35] = False
    _, rows = _rows((HAND,), [(HAND, data)])
    assert len(rows.t) == 95
    assert not ((rows.t > 0.295) & (rows.t < 0.345)).any()


def test_nothing_is_kept_but_what_later_rows_need() -> None:
    state = resampling.start((HAND, FOREARM))
    for k in range(50):
        state, _ = resampling.step(state, (HAND, _turning(HAND, k, k + 1)))
        state, _ = resampling.step(state, (FOREARM, _turning(FOREARM, k, k + 1)))
    assert sum(len(w.data.t) for w in state.waiting.values()) < 10
    assert abs(quat.twist(state.waiting["hand"].data.q_GS[-1, 0], 2)) <= 180 * DEG


@pytest.mark.parametrize("share", [0.98, 0.9985, 1.01, 1.6])
def test_the_rate_at_which_samples_come_is_measured_in_spite_of_jitter_and_loss(
    share: float,
) -> None:
    rng = np.random.default_rng(3)
    t = np.arange(1000) / (100.0 * share)
    kept = rng.random(1000) > 0.05 if share < 1.25 else np.ones(1000, bool)
    t = np.sort(t[kept] + rng.uniform(-5e-4, 5e-4, kept.sum()))
    stream = Stream("imu", ("hand",), (GYR, ACC), 100.0)
    found = resampling.measure_rates([Block(stream, t, np.zeros((len(t), 1, 6)))])
    assert found["imu"] == pytest.approx(100.0 * share, rel=2e-4)


def test_stamps_that_scatter_by_a_fifth_of_a_period_hide_no_rate() -> None:
    """Scatter as of a host's stamps was counted as samples left out: 97 Hz came out as 99."""
    t = np.sort(np.arange(4000) / 97.0 + 2e-3 * np.random.default_rng(3).normal(size=4000))
    stream = Stream("imu", ("hand",), (GYR, ACC), 100.0)
    assert resampling.measure_rates([Block(stream, t, np.zeros((4000, 1, 6)))])[
        "imu"
    ] == pytest.approx(97.0, rel=1e-3)


def test_a_rate_that_is_what_it_says_is_left_alone() -> None:
    t = 7.0 + np.arange(300) / 100.0 + np.random.default_rng(3).uniform(-5e-4, 5e-4, 300)
    stream = Stream("imu", ("hand",), (GYR, ACC), 100.0)
    assert resampling.measure_rates([Block(stream, t, np.zeros((300, 1, 6)))]) == {}
