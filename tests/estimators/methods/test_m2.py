"""M2 from end to end: the truth recovered, whatever is missing, however the blocks are cut."""

import pickle
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import MAG, Block, Stream
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    CHILDREN,
    FINGERS,
    IS_DOF,
    JOINT,
    JOINTS,
    PARENTS,
    SEGMENT,
    SEGMENTS,
)
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.simulation.motion import make_posture, move_through
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated, simulate, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import (
    DEG,
    INSTANT,
    STRIPS,
    assert_same,
    calibrated,
    cut,
    in_strips,
    interleaved,
    pose_and_wiggle,
    tracked,
    with_samples,
)

PARAMS = INSTANT
EXACT = (
    0.1 * DEG
)  # without noise; what is left comes from the accelerometers' correction while the hand moves


def _stepped(recording: Simulated, pieces: list[Block], calibration: Any = None) -> Trajectory:
    """Live: forwards from the calibration, block by block."""
    calibration = calibration or calibrated(recording)
    state, given = m2.start(PARAMS, calibration, recording.streams), []
    for piece in pieces:
        state, moved = m2.step(PARAMS, state, piece.between(calibration.t, np.inf))
        given.append(moved)
    _, moved = m2.finish(PARAMS, state)
    return trajectory.join([*given, moved], recording.hand)


def test_the_truth_is_recovered_without_noise(simulated: Simulated) -> None:
    moved = tracked(simulated)
    np.testing.assert_array_equal(moved.t, simulated.truth.t)
    assert np.nanmax(np.abs(moved.angles - simulated.truth.angles)) < EXACT
    np.testing.assert_array_equal(np.isnan(moved.angles[5]), ~IS_DOF)
    assert np.abs(moved.tips - simulated.truth.tips).max() < 0.15e-3
    assert not moved.flags.any()


@pytest.mark.parametrize("rate", [50.0, 100.0, 1000.0])
def test_the_truth_of_fast_tapping_is_recovered_at_every_rate(rate: float) -> None:
    """5 rad/s at a joint: half a sample late would be 3 deg at 50 Hz."""
    recording = simulate(
        ["initial_pose", "tapping"],
        "left",
        sized("left"),
        np.random.default_rng(5),
        IDEAL,
        rate=rate,
    )
    assert (
        np.nanmax(np.abs(tracked(recording).angles - recording.truth.angles))
        < (0.3 if rate == 50 else 0.1) * DEG
    )


def test_the_whole_range_of_motion_is_recovered_with_real_errors() -> None:
    """Data-sheet noise, biases, skin and 5 to 10 deg of misalignment: within the fingertip errors of Salchow's Table 6 (0.6 to 2.1 cm)."""
    recording = simulate(
        ["initial_pose", "rom"], "right", sized("right"), np.random.default_rng(3), SensorErrors()
    )
    moved = tracked(recording)
    rmse = np.sqrt(((moved.tips - recording.truth.tips) ** 2).sum(axis=-1).mean(axis=0))
    assert (rmse < 8e-3).all()
    assert np.sqrt(np.nanmean((moved.angles - recording.truth.angles) ** 2)) < 1.5 * DEG


@cache
def _whole(hand: str) -> Trajectory:
    return tracked(in_strips(hand))


@given(
    st.sets(st.sampled_from([s for s in STRIPS if s != "hand"])), st.sampled_from(["left", "right"])
)
def test_removing_strips_changes_no_bit_of_the_other_joints(removed: set[str], hand: str) -> None:
    whole = in_strips(hand)
    part = with_samples(
        whole, {name: b for name, b in whole.samples.items() if name not in removed}
    )
    expected, moved = _whole(hand), tracked(part)
    gone = [SEGMENT[s] for strip in removed for s in STRIPS[strip]]
    known = ~(np.isin(PARENTS, gone) | np.isin(CHILDREN, gone))
    np.testing.assert_array_equal(moved.t, expected.t)
    np.testing.assert_array_equal(moved.angles[:, known], expected.angles[:, known])
    assert np.isnan(moved.angles[:, ~known]).all()
    present = [f for f, finger in enumerate(FINGERS) if finger not in removed]
    if "forearm" not in removed:
        np.testing.assert_array_equal(moved.tips[:, present], expected.tips[:, present])
    assert np.isfinite(moved.tips[:, present]).all()
    assert np.isnan(np.delete(moved.tips, present, axis=1)).all()
    rest = [k for k in range(len(SEGMENTS)) if k not in gone]
    np.testing.assert_array_equal(moved.q_GS[:, rest], expected.q_GS[:, rest])


def test_a_strip_with_one_sensor_gone_keeps_what_can_be_known() -> None:
    whole = in_strips("left")
    index = whole.samples["index"]
    short = Block(
        replace(index.stream, sensors=("index_proximal", "index_distal")),
        index.t,
        index.values[:, [0, 2]],
    )
    moved, expected = (
        tracked(with_samples(whole, {**whole.samples, "index": short})),
        tracked(whole),
    )
    np.testing.assert_array_equal(
        moved.angles[:, JOINT["index_mcp"]], expected.angles[:, JOINT["index_mcp"]]
    )
    assert np.isnan(moved.angles[:, [JOINT["index_pip"], JOINT["index_dip"]]]).all()
    assert np.isnan(moved.tips[:, FINGERS.index("index")]).all()
    np.testing.assert_allclose(
        moved.q_GS[:, SEGMENT["index_distal"]], expected.q_GS[:, SEGMENT["index_distal"]], atol=0.01
    )


@cache
def _stepped_whole() -> Trajectory:
    """What the left hand's recording gives in one piece a strip."""
    recording = in_strips("left")
    return _stepped(recording, list(recording.samples.values()))


@given(
    st.dictionaries(st.sampled_from(sorted(STRIPS)), st.lists(st.integers(0, 1500), max_size=8)),
    st.integers(0, 2**32 - 1),
)
def test_streams_may_be_cut_anywhere_and_arrive_in_any_order(
    where: dict[str, list[int]], seed: int
) -> None:
    recording = in_strips("left")
    pieces = {name: cut(b, where.get(name, [])) for name, b in recording.samples.items()}
    pieces_in_turn = list(interleaved(pieces, np.random.default_rng(seed)))
    assert_same(_stepped(recording, pieces_in_turn), _stepped_whole())


@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(STRIPS)), st.integers(400, 1400), st.integers(1, 60)),
        min_size=1,
        max_size=4,
    ),
    st.lists(st.integers(0, 1500), max_size=8),
    st.integers(0, 2**32 - 1),
)
def test_with_gaps_too_streams_may_be_cut_anywhere(
    gaps: list[tuple[str, int, int]], where: list[int], seed: int
) -> None:
    samples = dict(in_strips("left").samples)
    for name, first, count in gaps:
        block = samples[name]
        keep = np.ones(len(block.t), bool)
        keep[first : first + count] = False
        samples[name] = Block(block.stream, block.t[keep], block.values[keep])
    recording = with_samples(in_strips("left"), samples)
    found = calibrated(in_strips("left"))
    pieces = {name: cut(b, where) for name, b in samples.items()}
    expected = _stepped(recording, list(samples.values()), found)
    assert_same(
        _stepped(recording, list(interleaved(pieces, np.random.default_rng(seed))), found), expected
    )


def test_a_saved_state_goes_on_as_if_nothing_had_happened() -> None:
    recording = in_strips("right")
    pieces = list(
        interleaved(
            {n: cut(b, [300, 700, 1000]) for n, b in recording.samples.items()},
            np.random.default_rng(1),
        )
    )
    found = calibrated(recording)
    state, given = m2.start(PARAMS, found, recording.streams), []
    for piece in pieces:
        state, moved = m2.step(
            PARAMS, pickle.loads(pickle.dumps(state)), piece.between(found.t, np.inf)
        )
        given.append(moved)
    _, moved = m2.finish(PARAMS, state)
    assert_same(trajectory.join([*given, moved], "right"), _stepped(recording, pieces))


def test_a_step_leaves_the_state_before_it_alone() -> None:
    recording = pose_and_wiggle("left")
    before = m2.start(PARAMS, calibrated(recording), recording.streams)
    block = recording.samples["imu"].between(1.5, 6.0)
    m2.step(PARAMS, before, recording.samples["forearm"])
    state, _ = m2.step(PARAMS, before, recording.samples["forearm"].between(1.5, 9))
    results = [m2.step(PARAMS, state, block)[1] for _ in range(2)]
    assert len(results[0]) > 0
    assert_same(*results)


def _without(recording: Simulated, start: float, seconds: float, sensor: str) -> Simulated:
    imu = recording.samples["imu"]
    values = imu.values.copy()
    values[(imu.t >= start) & (imu.t < start + seconds), imu.stream.sensors.index(sensor)] = np.nan
    return with_samples(recording, {**recording.samples, "imu": Block(imu.stream, imu.t, values)})


def test_a_short_gap_is_bridged_and_marked() -> None:
    recording = pose_and_wiggle("left")
    moved = tracked(_without(recording, 8.4, 0.15, "index_middle"))  # while the index bends
    middle = SEGMENT["index_middle"]
    assert (
        np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 0.5 * DEG
    )  # the cubic; a straight line misses 1.6 deg
    assert (
        ((moved.flags[:, middle] & Flag.MISSING) != 0)
        == ((moved.t >= 8.4) & (moved.t < 8.55 - 1e-9))
    ).all()
    assert not (moved.flags & Flag.HEADING_LOST).any()
    assert not np.delete(moved.flags, middle, axis=1).any()


@pytest.mark.parametrize("from_t", [8.4, 8.45])
def test_after_a_long_gap_the_heading_is_said_to_be_lost_until_the_joints_tell_it(
    from_t: float,
) -> None:
    recording = pose_and_wiggle("left")
    whole, moved = tracked(recording), tracked(_without(recording, from_t, 0.4, "index_middle"))
    lost = (moved.flags[:, SEGMENT["index_middle"]] & Flag.HEADING_LOST) != 0
    assert not lost[moved.t < from_t - 0.001].any()
    assert lost[(moved.t >= from_t - 0.001) & (moved.t <= from_t + 0.4)].all()
    assert not lost[moved.t > from_t + 1.5].any()
    uncorrected = tracked(
        _without(recording, from_t, 0.4, "index_middle"), m2.Params(heading_correction=False)
    )
    assert (
        (uncorrected.flags[moved.t >= from_t, SEGMENT["index_middle"]] & Flag.HEADING_LOST) != 0
    ).all()
    others = [
        j for j, joint in enumerate(JOINTS) if "index_middle" not in (joint.parent, joint.child)
    ]
    np.testing.assert_array_equal(moved.angles[:, others], whole.angles[:, others])
    assert np.isfinite(moved.q_GS).all()


def test_a_forearm_that_lags_holds_the_rows_back_and_loses_none() -> None:
    recording = in_strips("left")
    found = calibrated(recording)
    state = m2.start(PARAMS, found, recording.streams)
    for name, block in recording.samples.items():
        if name != "forearm":
            state, moved = m2.step(PARAMS, state, block.between(found.t, np.inf))
            assert len(moved) == 0
    state, moved = m2.step(PARAMS, state, recording.samples["forearm"].between(found.t, 10.0))
    assert moved.t[-1] == pytest.approx(9.98)
    _, rest = m2.release(PARAMS, state, 0.5)
    assert rest.t[-1] == pytest.approx(recording.samples["hand"].t[-1] - 0.5, abs=0.011)


def test_blocks_without_gyroscope_change_nothing() -> None:
    recording = pose_and_wiggle("left")
    mag = Block(
        Stream("mag", ("hand",), (MAG,), 100.0), np.arange(1400) / 100, np.zeros((1400, 1, 3))
    )
    assert_same(
        tracked(with_samples(recording, {"mag": mag, **recording.samples})), tracked(recording)
    )


def test_a_strip_plugged_in_later_is_tracked_and_said_to_be_uncalibrated() -> None:
    recording = in_strips("left")
    without = with_samples(recording, {n: b for n, b in recording.samples.items() if n != "ring"})
    found = calibrated(without)
    late = recording.samples["ring"].between(6.0, np.inf)
    moved = _stepped(
        without,
        [
            *(b.between(-np.inf, 6.0) for b in without.samples.values()),
            late,
            *(b.between(6.0, 99) for b in without.samples.values()),
        ],
        found,
    )
    ring = [SEGMENT[s] for s in STRIPS["ring"]]
    later = moved.t > 6.0
    assert (moved.flags[later][:, ring] & Flag.UNCALIBRATED).all()
    assert np.isfinite(moved.angles[later][:, JOINT["ring_pip"], 0]).all()


@pytest.mark.parametrize("factor", [1, 2])
def test_a_strip_described_anew_while_running_goes_on(factor: int) -> None:
    """The same strip from 6 s on, at another rate or as another stream object: its angles go on, its heading is said to be lost at first."""
    recording = in_strips("left")
    index = recording.samples["index"]
    anew = replace(index.stream, rate=100.0 / factor, full_scale={})
    later = Block(anew, index.t[600::factor], index.values[600::factor])
    pieces = [
        *(b for n, b in recording.samples.items() if n != "index"),
        index.between(-np.inf, 6.0),
        later,
    ]
    moved = _stepped(recording, pieces)
    columns = [SEGMENT[s] for s in STRIPS["index"]]
    after = moved.t >= 6.0
    assert (moved.flags[after][0, columns] & Flag.HEADING_LOST).all()
    truth = recording.truth.angles[np.searchsorted(recording.truth.t, moved.t)]
    assert np.nanmax(np.abs(moved.angles - truth)[after][:, JOINT["index_pip"]]) < 5 * DEG


def test_the_forearm_and_the_hand_point_as_their_sensors_say() -> None:
    recording = pose_and_wiggle("left", SensorErrors())
    free, kept = tracked(recording, replace(INSTANT, constraints=False)), tracked(recording)
    for segment in ("forearm", "hand"):
        np.testing.assert_array_equal(
            kept.q_GS[:, SEGMENT[segment]], free.q_GS[:, SEGMENT[segment]]
        )
    assert not np.array_equal(
        kept.q_GS[:, SEGMENT["index_middle"]], free.q_GS[:, SEGMENT["index_middle"]]
    )


def test_without_constraints_all_angles_come_from_the_sensors(simulated: Simulated) -> None:
    free, kept = tracked(simulated, replace(INSTANT, constraints=False)), tracked(simulated)
    np.testing.assert_allclose(free.angles, kept.angles, atol=0.5 * DEG)
    np.testing.assert_allclose(
        joint_angles.of_segments(kept.q_GS)[..., 0][:, 1:], kept.angles[..., 0][:, 1:], atol=1e-9
    )
    off = joint_angles.of_segments(free.q_GS)[:, JOINT["index_pip"], 1]
    assert 0 < np.abs(off).max() < 1 * DEG
    assert np.abs(joint_angles.of_segments(kept.q_GS)[:, JOINT["index_pip"], 1]).max() < 1e-9


def _mechanical_finger(hand: Any) -> Simulated:
    """Valtin 2017, Fig. 4: DIP, then PIP, then MCP to 90 deg, and back in the other order."""
    straight, relaxed = task_performance.flat(), task_performance.relaxed()
    dip = make_posture(straight, index_dip_flexion=90.0)
    pip = make_posture(dip, index_pip_flexion=90.0)
    mcp = make_posture(pip, index_mcp_flexion=90.0)
    points = [(0.0, relaxed), (1.0, straight)]
    for target in (dip, pip, mcp, pip, dip, straight):
        points += [(points[-1][0] + 1.5, target), (points[-1][0] + 2.5, target)]
    motion = move_through([*points, (points[-1][0] + 1.0, relaxed)])
    geometry = sized(hand)
    return simulate_performances(
        [task_performance.initial_pose(geometry), Performance(motion, ())],
        hand,
        geometry,
        np.random.default_rng(2),
        SensorErrors(misalignment=0.0, misalignment_width=0.0, skin_angle=0.0, skin_shift=0.0),
    )


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_mechanical_fingers_joints_move_one_at_a_time(hand: Any) -> None:
    recording = _mechanical_finger(hand)
    moved = tracked(recording)
    joints = [JOINT[name] for name in ("index_dip", "index_pip", "index_mcp")]
    found, true = moved.angles[:, joints, 0] / DEG, recording.truth.angles[:, joints, 0] / DEG
    start = 6.0  # s, the pose is over
    for k, (begin, end) in enumerate(((2.5, 13.5), (5.0, 11.0), (7.5, 8.5))):
        bent = (moved.t >= start + begin) & (moved.t <= start + end)
        assert abs(true[bent, k].min() - 90) < 0.01
        assert np.abs(found[bent, k] - 90).max() < 1.5  # stays at 90 deg while the others move
        before = (moved.t >= start + 1.0) & (moved.t <= start + begin - 1.5)
        assert np.abs(found[before, k]).max() < 1.5
    others = [j for j in range(1, len(JOINTS)) if j not in joints]
    assert (
        np.nanmax(np.abs(moved.angles[:, others] - recording.truth.angles[:, others])) < 1.0 * DEG
    )
