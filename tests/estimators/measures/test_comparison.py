"""Known differences come out as they were put in; the gyroscope agrees with the orientations that were made of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import FINGERS, SEGMENT, SEGMENTS
from handscope.estimators.measures.comparison import (
    TIPS,
    WHOLE,
    Agreement,
    agreements,
    gyroscope_consistency,
    list_stretches,
    pair_quantities,
    shared_names,
)
from tests.estimators.measures.movements import movement, moving
from tests.simulated import DEG, pose_and_wiggle, tracked

T = np.arange(0, 20, 0.01)


def by_name(found: list[Agreement], task: str = WHOLE) -> dict[str, Agreement]:
    return {g.name: g for g in found if g.task == task}


def compared(
    a: Trajectory, b: Trajectory, lag: float = 0.0, events: tuple[Event, ...] = ()
) -> list[Agreement]:
    return agreements(
        pair_quantities(a, b, lag), list_stretches(events, (), lag, (float(a.t[0]), float(a.t[-1])))
    )


def test_an_offset_is_b_minus_a_and_all_of_the_difference() -> None:
    angles, offset = movement(1)(T), np.array([5.0, -3.0, 0.0]) * DEG
    found = by_name(compared(moving(T, angles), moving(T, angles + offset)))
    for name, o in zip(("index_mcp_flexion", "index_mcp_deviation", "index_pip_flexion"), offset):
        g = found[name]
        assert (g.offset, g.drms, g.drms_minus_offset, g.drom) == pytest.approx(
            (o, abs(o), 0.0, 0.0), abs=1e-12
        )
        assert g.limits == pytest.approx((o, o), abs=1e-12)
        assert g.share == 1.0


def test_a_larger_movement_is_a_range_of_motion_difference() -> None:
    swing = np.zeros((len(T), 3))
    swing[:, 0] = 40 * DEG * np.sin(2 * np.pi * 0.5 * T)
    g = by_name(compared(moving(T, swing), moving(T, 1.1 * swing)))["index_mcp_flexion"]
    assert g.rom_a == pytest.approx(80 * DEG, abs=1e-9)
    assert g.drom == pytest.approx(8 * DEG, abs=1e-9)
    assert g.drms == pytest.approx(4 * DEG / np.sqrt(2), rel=1e-6)  # RMS of a sine of 4 deg
    assert g.offset == pytest.approx(0.0, abs=1e-9)
    assert g.limits[1] == pytest.approx(1.96 * 4 * DEG / np.sqrt(2), rel=1e-3)
    assert g.correlation == pytest.approx(1.0)
    assert np.isnan(
        by_name(compared(moving(T, swing), moving(T, swing)))["index_pip_flexion"].correlation
    )  # stands still


def test_another_clock_and_rate_change_nothing_once_the_lag_is_known() -> None:
    move, t_b = movement(2), np.arange(0, 25, 1 / 70)
    a, b = moving(T, move(T)), moving(t_b, move(t_b + 4.321) + 2 * DEG)
    for g in compared(a, b, 4.321):
        assert g.offset == pytest.approx(2 * DEG, abs=1e-6)
        assert g.drms_minus_offset < 0.005 * DEG
        assert g.share == pytest.approx((20 - 4.321) / 20, abs=0.001)


def test_tasks_are_compared_one_by_one_wherever_they_are_told() -> None:
    angles = movement(3)(T)
    later = angles + 6 * DEG * (T > 10)[:, None]
    tasks = (
        Event(2.0, 5.0, "task", {"task_name": "slow"}),
        Event(12.0, 5.0, "task", {"task_name": "fast"}),
        Event(0.0, 1.0, "rest"),
    )
    found = compared(
        moving(T, angles),
        moving(T, later),
        events=(*tasks, Event(8.0, 1.0, "task", {"task_name": "no", "excluded": "yes"})),
    )
    assert {g.task for g in found} == {WHOLE, "slow", "fast"}
    assert by_name(found, "slow")["index_pip_flexion"].offset == pytest.approx(0.0, abs=1e-12)
    assert by_name(found, "fast")["index_pip_flexion"].offset == pytest.approx(6 * DEG)
    assert list_stretches((), tasks, 1.5, (0.0, 20.0))[1:] == [
        ("slow", 3.5, 8.5),
        ("fast", 13.5, 18.5),
    ]  # B's events on A's clock


def test_what_either_does_not_know_is_left_out() -> None:
    angles = movement(4)(T)
    holes = angles.copy()
    holes[500:1000] = np.nan
    a, b = moving(T, angles), moving(T, holes + 1 * DEG)
    b.flags[1000:1500, SEGMENT["index_middle"]] = Flag.HEADING_LOST
    b.angles[1000:1500] += 40 * DEG
    found = by_name(compared(a, b))
    assert found["index_mcp_flexion"].offset > 10 * DEG  # its segments are not flagged
    assert found["index_pip_flexion"].offset == pytest.approx(1 * DEG)
    assert found["index_pip_flexion"].share == pytest.approx(0.5, abs=0.01)


def test_tips_are_compared_by_their_distance_and_are_enough_by_themselves() -> None:
    tips = np.full((len(T), len(FINGERS), 3), np.nan)
    tips[:, 0], tips[:, 1] = 0.0, np.stack([0.05 + 0.03 * np.sin(T), 0 * T, 0 * T], axis=-1)
    nothing = np.full((len(T), 3), np.nan)
    longer = tips.copy()
    longer[:, 1, 0] += 0.004
    a, b = moving(T, nothing, tips=tips), moving(T, nothing, tips=longer)
    assert shared_names(a, b)[0] == [TIPS]
    (g,) = compared(a, b)
    assert (g.unit, g.offset) == ("m", pytest.approx(0.004))
    assert compared(moving(T, nothing), b) == []


def test_the_gyroscope_agrees_with_the_orientations_of_a_turning_body() -> None:
    t = np.arange(0, 10, 0.005)
    w = np.stack([3 * np.sin(t), 2 * np.cos(1.3 * t), 1 + 0 * t], axis=-1)
    middle = np.stack(
        [3 * np.sin(t[1:] - 0.0025), 2 * np.cos(1.3 * (t[1:] - 0.0025)), 1 + 0 * t[1:]], axis=-1
    )
    turned = [Rotation.identity()]
    for step in middle:
        turned.append(turned[-1] * Rotation.from_rotvec(step * 0.005))
    q = np.array([r.as_quat(scalar_first=True) for r in turned])
    moved = moving(t, np.zeros((len(t), 3)))
    moved.q_GS[:, SEGMENT["index_distal"]] = q
    sensor = Rotation.from_rotvec([0.3, -1.0, 0.5])  # the sensor sits askew: norms do not care
    bias = np.array([0.02, -0.01, 0.03])

    def block(extra: float, means: bool = False) -> Block:
        rates = np.concatenate([w[:1], middle]) if means else w
        values = np.concatenate(
            [sensor.apply(rates) * (1 + extra) + bias, np.zeros_like(w)], axis=-1
        )[:, None]
        return Block(Stream("imu", ("index_distal",), (GYR, ACC), 200.0), t, values)

    (exact,) = gyroscope_consistency(moved, [block(0.0)], {"index_distal": bias})
    assert exact.share < 1e-4
    (mean,) = gyroscope_consistency(moved, [block(0.0, True)], {"index_distal": bias}, means=True)
    assert mean.share < 1e-10
    (scaled,) = gyroscope_consistency(moved, [block(0.1)], {"index_distal": bias})
    norm = np.linalg.norm(w, axis=-1)
    assert scaled.drms == pytest.approx(0.1 * np.sqrt((norm**2).mean()), rel=1e-2)
    assert scaled.share == pytest.approx(
        0.1 * np.sqrt((norm**2).mean()) / (1.1 * norm.max()), rel=2e-2
    )
    assert np.isnan(gyroscope_consistency(moved, [block(-0.999)], {})[0].share)  # hardly turned


def test_a_tracked_recording_is_consistent_with_its_own_gyroscopes() -> None:
    recording = pose_and_wiggle("left")
    found = gyroscope_consistency(tracked(recording), recording.samples.values(), {})
    shares = [c.share for c in found if np.isfinite(c.share)]
    assert {c.segment for c in found} == set(SEGMENTS)
    assert len(shares) >= 14
    assert np.median(shares) < 0.07  # the thesis' median
