"""Gaps, saturation and cuts: what the filter of a stream must survive."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.orientation import fusion as orientation_fusion
from handscope.estimators.orientation.fusion import FusionParams, Oriented
from tests.simulated import DEG, cut

RATE, N = 100.0, 300
PARAMS = FusionParams(gyr_reading="instant")
STREAM = Stream(
    "imu",
    ("hand", "index_proximal", "index_middle"),
    (GYR, ACC),
    RATE,
    "imu",
    {GYR: 5.0, ACC: 100.0},
)
LEVEL = dict.fromkeys(STREAM.sensors, quat.IDENTITY)
GAPS = st.lists(st.tuples(st.integers(0, 2), st.integers(0, N - 1), st.integers(1, 40)), max_size=6)
LOST_ROWS = st.lists(st.tuples(st.integers(1, N - 1), st.integers(1, 35)), max_size=3)


def _turning(rate: float = 1.0) -> Block:
    """Three level sensors that turn about the vertical, each at its own rate."""
    t = np.arange(N) / RATE
    values = np.zeros((N, 3, 6))
    values[:, :, 2] = rate * np.array([1.0, -0.5, 0.25]) * np.sin(2 * np.pi * 0.7 * t)[:, None]
    values[:, :, 5] = 9.81
    return Block(STREAM, t, values)


def _headings(rate: float = 1.0) -> np.ndarray:
    """The angles (n, 3) that the sensors of `_turning` have turned by."""
    w = 2 * np.pi * 0.7
    return rate * np.array([1.0, -0.5, 0.25]) * ((1 - np.cos(w * np.arange(N) / RATE)) / w)[:, None]


def _with_gaps(
    block: Block, gaps: list[tuple[int, int, int]], rows: list[tuple[int, int]] = ()
) -> Block:
    values, keep = block.values.copy(), np.ones(len(block.t), bool)
    for sensor, first, count in gaps:
        values[first : first + count, sensor, first % 6] = np.nan
    for first, count in rows:
        keep[first : first + count] = False
    return Block(block.stream, block.t[keep], values[keep])


def _oriented(blocks: list[Block], params: FusionParams = PARAMS) -> Oriented:
    state = orientation_fusion.start(STREAM, LEVEL, {})
    pieces = []
    for block in blocks:
        state, piece = orientation_fusion.step(params, state, block)
        pieces.append(piece)
    state, piece = orientation_fusion.finish(params, state)
    assert state.held is None
    pieces.append(piece)
    return Oriented(
        *(
            np.concatenate([getattr(p, name) for p in pieces])
            for name in ("t", "q_GS", "flags", "rotation_variance", "sampled")
        )
    )


@given(GAPS, LOST_ROWS, st.lists(st.integers(0, N), max_size=12))
def test_blocks_may_be_cut_anywhere_whatever_is_missing(
    gaps: list[tuple[int, int, int]], rows: list[tuple[int, int]], where: list[int]
) -> None:
    block = _with_gaps(_turning(), gaps, rows)
    whole, pieces = _oriented([block]), _oriented(cut(block, where))
    for name in ("t", "q_GS", "flags", "rotation_variance", "sampled"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name), err_msg=name)
    np.testing.assert_array_equal(whole.t[whole.sampled], block.t)


@given(GAPS, LOST_ROWS)
def test_nan_never_reaches_a_filter(
    gaps: list[tuple[int, int, int]], rows: list[tuple[int, int]]
) -> None:
    state = orientation_fusion.start(STREAM, LEVEL, {})
    state, _ = orientation_fusion.step(PARAMS, state, _with_gaps(_turning(), gaps, rows))
    state, _ = orientation_fusion.finish(PARAMS, state)
    for sensor in state.sensors:
        for name in (
            ("gyrQuat", "accQuat", "bias", "biasP", "lastAccLp", "restLastGyrLp")
            if sensor.filter_state
            else ()
        ):
            assert np.isfinite(sensor.filter_state[name]).all(), name
        assert sensor.q_GS is None or np.isfinite(sensor.q_GS).all()


@given(st.integers(20, 260), st.integers(1, 20))
def test_a_short_gap_is_bridged(first: int, count: int) -> None:
    found = _oriented([_with_gaps(_turning(), [(1, first, count)])])
    error = np.abs(quat.twist(found.q_GS, 2) - _headings())
    assert error[:, 1].max() < 1.5 * DEG  # a straight line over 0.2 s of 0.5 rad/s at 0.7 Hz
    assert not (found.flags & Flag.HEADING_LOST).any()
    np.testing.assert_array_equal(
        (found.flags[:, 1] & Flag.MISSING) != 0,
        (np.arange(N) >= first) & (np.arange(N) < first + count),
    )
    assert not found.flags[:, [0, 2]].any()


def test_whole_samples_lost_are_put_in_again_and_bridged() -> None:
    found = _oriented([_with_gaps(_turning(), [], [(150, 10)])])
    np.testing.assert_allclose(found.t, np.arange(N) / RATE, atol=1e-12)
    np.testing.assert_array_equal(np.flatnonzero(~found.sampled), np.arange(150, 160))
    assert np.abs(quat.twist(found.q_GS, 2) - _headings()).max() < 2.5 * DEG


def test_many_whole_samples_lost_are_a_loss_of_all_headings_with_one_instant_in_between() -> None:
    found = _oriented([_with_gaps(_turning(), [], [(150, 30)])])
    (missing,) = np.flatnonzero(~found.sampled)
    assert found.t[missing] == pytest.approx(1.645)
    np.testing.assert_array_equal(
        (found.flags & Flag.HEADING_LOST) != 0, (found.t > 1.495)[:, None].repeat(3, axis=1)
    )


def test_jitter_of_the_time_stamps_neither_makes_nor_hides_a_loss(rng: np.random.Generator) -> None:
    lossy = _with_gaps(_turning(), [], [(100, 1), (150, 3), (200, 10)])
    jittered = Block(STREAM, lossy.t + rng.uniform(-0.2, 0.2, len(lossy.t)) / RATE, lossy.values)
    assert (~_oriented([jittered]).sampled).sum() == 14


def test_after_a_long_gap_what_was_learnt_of_the_bias_is_kept() -> None:
    bias, n = 1.0 * DEG, 1200
    values = np.zeros((n, 3, 6))
    values[..., 2], values[..., 5] = bias, 9.81
    values[700:800] = np.nan
    found = _oriented([Block(STREAM, np.arange(n) / RATE, values)], replace(PARAMS, rest_turn=0.03))
    drifted = quat.twist(found.q_GS[:, 0], 2)
    assert drifted[690] > 1.0 * DEG  # before rest was detected
    assert abs(drifted[-1] - drifted[690]) < 0.2 * DEG


def test_a_long_gap_loses_the_heading_until_the_end_and_holds_the_orientation() -> None:
    found = _oriented([_with_gaps(_turning(), [(0, 100, 40)])])
    lost = (found.flags[:, 0] & Flag.HEADING_LOST) != 0
    np.testing.assert_array_equal(lost, np.arange(N) >= 100)
    np.testing.assert_array_equal(
        found.q_GS[100:140, 0], np.broadcast_to(found.q_GS[99, 0], (40, 4))
    )
    assert np.isfinite(found.q_GS).all()


def test_gaps_of_two_sensors_that_overlap_are_both_bridged_wherever_the_block_ends() -> None:
    block = _with_gaps(_turning(), [(0, 90, 20), (1, 85, 10)])
    for end in range(86, 112):
        assert not (_oriented(cut(block, [end])).flags & Flag.HEADING_LOST).any(), f"cut at {end}"


# samples a block: a filter's state is read less often than it goes on
@pytest.mark.parametrize("length", [1, 2, 5])
def test_any_state_may_be_gone_on_from_more_than_once_and_saved(length: int) -> None:
    parts = list(_turning().parts(length))
    states, given = [orientation_fusion.start(STREAM, LEVEL, {})], []
    for part in parts:
        state, oriented = orientation_fusion.step(PARAMS, states[-1], part)
        states.append(state)
        given.append(oriented.q_GS)
    for from_where in range(0, len(parts) - 1, 7):
        for state in (states[from_where], pickle.loads(pickle.dumps(states[from_where]))):
            for k in (from_where, from_where + 1):
                state, again = orientation_fusion.step(PARAMS, state, parts[k])
                np.testing.assert_array_equal(
                    again.q_GS, given[k], err_msg=f"block {k}, gone on from block {from_where}"
                )


def test_options_may_change_from_block_to_block() -> None:
    leaning = _turning()
    # the accelerometers say so, the pose does not: how fast they are believed is an option
    leaning.values[..., 3] = 2.0
    first, second = cut(leaning, [N // 2])
    state, _ = orientation_fusion.step(PARAMS, orientation_fusion.start(STREAM, LEVEL, {}), first)
    for part in second.parts(1):
        state, one_by_one = orientation_fusion.step(replace(PARAMS, tau_acc=0.5), state, part)
    state, _ = orientation_fusion.step(PARAMS, orientation_fusion.start(STREAM, LEVEL, {}), first)
    _, at_once = orientation_fusion.step(replace(PARAMS, tau_acc=0.5), state, second)
    np.testing.assert_array_equal(one_by_one.q_GS[-1], at_once.q_GS[-1])


def test_a_gap_still_open_at_the_end_is_no_loss_for_the_others() -> None:
    found = _oriented([_with_gaps(_turning(), [(0, N - 10, 10), (1, N - 8, 3)])])
    assert (found.flags[-10:, 0] & Flag.HEADING_LOST).all()
    assert not (found.flags[:, 1] & Flag.HEADING_LOST).any()


def test_a_sensor_that_reads_nothing_but_zeros_is_missing() -> None:
    block = _turning()
    block.values[:, 2] = 0.0
    found = _oriented([block])
    assert np.isnan(found.q_GS[:, 2]).all()
    assert (found.flags[:, 2] & Flag.MISSING).all()
    assert not found.flags[:, :2].any()


def test_samples_at_the_limit_are_flagged() -> None:
    block = _turning()
    block.values[40, 0, 1], block.values[41, 1, 3] = -4.95, 99.0
    flags = _oriented([block]).flags
    assert [tuple(k) for k in np.argwhere(flags & Flag.SATURATED)] == [(40, 0), (41, 1)]


def test_a_turn_faster_than_the_gyroscope_reads_is_bridged_over_its_peak() -> None:
    fast, truth = _turning(5.5), _headings(5.5)[:, 0]  # the limit is 5 rad/s
    clipped = Block(
        fast.stream,
        fast.t,
        np.clip(fast.values, [*[-5.0] * 3, *[-100.0] * 3], [*[5.0] * 3, *[100.0] * 3]),
    )
    found = _oriented([clipped])
    turned = 2 * np.arctan2(found.q_GS[:, 0, 3], found.q_GS[:, 0, 0])
    error = np.abs(np.angle(np.exp(1j * (turned - truth))))
    lost_by_clipping = np.abs(np.cumsum(fast.values - clipped.values, axis=0)[:, 0, 2] / RATE).max()
    assert error.max() < 0.1 * lost_by_clipping
    assert (found.flags[np.abs(fast.values[:, 0, 2]) > 5.0, 0] == Flag.SATURATED).all()


def test_a_sensor_that_was_not_in_the_pose_starts_from_gravity_and_says_so() -> None:
    state = orientation_fusion.start(STREAM, {"hand": quat.IDENTITY}, {})
    _, found = orientation_fusion.step(PARAMS, state, _turning())
    assert not found.flags[:, 0].any()
    assert (found.flags[:, 1:] == Flag.UNCALIBRATED).all()
    np.testing.assert_allclose(
        quat.rotate(found.q_GS, np.broadcast_to([0, 0, 1.0], (N, 3, 3)))[..., 2], 1.0, atol=1e-6
    )


def test_a_sensor_that_begins_long_after_its_pose_has_lost_its_heading() -> None:
    block = _turning()
    for known_until, lost in ((-1.0, True), (-0.1, False)):
        _, found = orientation_fusion.step(
            PARAMS, orientation_fusion.start(STREAM, LEVEL, {}, known_until), block
        )
        assert ((found.flags & Flag.HEADING_LOST) != 0).all() == lost


def test_a_known_bias_is_taken_away() -> None:
    block, bias = _turning(0.0), np.array([0.02, -0.01, 0.03])
    block.values[..., :3] += bias
    plain = replace(PARAMS, rest_bias=False, motion_bias=False)
    state = orientation_fusion.start(STREAM, LEVEL, dict.fromkeys(STREAM.sensors, bias))
    _, found = orientation_fusion.step(plain, state, block)
    np.testing.assert_allclose(quat.angle(found.q_GS), 0.0, atol=1e-6)


@pytest.mark.parametrize(
    "acc", [[0, 0, 9.81], [1.0, 2.0, -3.0], [0, 0, -9.81], [1e-9, 0, -9.81], [0.1, 0, 0]]
)
def test_upright_turns_the_specific_force_upwards_and_keeps_the_heading_where_it_can(
    acc: list[float],
) -> None:
    q_GS = quat.multiply(quat.about(2, 0.7), quat.about(0, 0.2))
    up = quat.rotate(
        orientation_fusion.make_upright(q_GS, np.array(acc)), np.array(acc) / np.linalg.norm(acc)
    )
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-7)


def test_a_sensor_upside_down_is_turned_over() -> None:
    q = orientation_fusion.make_upright(quat.IDENTITY, np.array([0, 0, -9.81]))
    np.testing.assert_allclose(quat.rotate(q, np.array([0, 0, -1.0])), [0, 0, 1], atol=1e-15)


def test_upright_leaves_an_orientation_that_is_right_already() -> None:
    q_GS = quat.multiply(quat.about(2, 0.7), quat.about(0, 0.2))
    acc = quat.rotate(quat.conjugate(q_GS), np.array([0, 0, 9.81]))
    np.testing.assert_allclose(orientation_fusion.make_upright(q_GS, acc), q_GS, atol=1e-15)
