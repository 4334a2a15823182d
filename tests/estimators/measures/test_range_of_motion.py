"""Range of motion: known extremes found, spikes and unusable samples left out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import DOF_NAMES, JOINT, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import range_of_motion
from handscope.estimators.measures.range_of_motion import Params, Range
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import DEG

RATE = 100.0


def _bending(angle: np.ndarray, joint: str = "index_pip", rate: float = RATE) -> Trajectory:
    """A trajectory of one joint's flexion; all others are not measured."""
    n = len(angle)
    angles = np.full((n, len(JOINT), 3), np.nan)
    angles[:, JOINT[joint], 0] = angle
    return replace(
        trajectory.empty("left"),
        t=np.arange(n) / rate,
        angles=angles,
        q_GS=np.full((n, len(SEGMENTS), 4), np.nan),
        tips=np.full((n, 5, 3), np.nan),
        flags=np.zeros((n, len(SEGMENTS)), np.uint8),
    )


def _range(moved: Trajectory, onset: float = 0.0, end: float = np.inf) -> Range:
    (found,) = range_of_motion.measure(Params(), moved, onset, end)
    return found


def _plateaus() -> np.ndarray:
    """-10 deg, 80 deg, -10 deg, each held a second, joined by half a second."""
    return (
        np.interp(np.arange(0, 4, 1 / RATE), [0, 1, 1.5, 2.5, 3, 4], [-10, -10, 80, 80, -10, -10])
        * DEG
    )


def test_held_extremes_are_found_exactly_with_their_times() -> None:
    found = _range(_bending(_plateaus()))
    assert found.largest == pytest.approx(80 * DEG, abs=1e-12)
    assert found.smallest == pytest.approx(-10 * DEG, abs=1e-12)
    assert found.extent == pytest.approx(90 * DEG, abs=1e-12)
    assert 1.5 <= found.t_largest <= 2.5
    assert found.grade == "good"


@given(st.integers(0, 399), st.integers(1, 9), st.floats(-200, 200))
@example(0, 9, 150.0)
@example(391, 9, 150.0)
def test_a_spike_shorter_than_half_the_hold_changes_nothing(
    first: int, length: int, height: float
) -> None:
    """Anywhere, at the very ends of the task too."""
    angle = _plateaus()
    angle[first : first + length] += height * DEG
    found = _range(_bending(angle))
    plain = _range(_bending(_plateaus()))
    assert found.largest <= plain.largest + 1e-12
    assert found.smallest >= plain.smallest - 1e-12


@given(st.integers(12, 380))
def test_an_angle_that_is_held_long_enough_counts(first: int) -> None:
    angle = np.zeros(400)
    angle[first : first + 12] = 50 * DEG
    assert _range(_bending(angle)).largest == 50 * DEG


@pytest.mark.parametrize("rate", [50.0, 100.0, 333.0, 1000.0])
def test_a_slow_turning_point_loses_as_little_as_the_page_says(rate: float) -> None:
    t = np.arange(0, 10, 1 / rate)
    found = _range(_bending(40 * DEG * np.sin(2 * np.pi * 0.5 * t), rate=rate))
    assert 0.982 < found.largest / (40 * DEG) < 1.0  # 1.2 %, and at 50 Hz a window of 0.22 s


@pytest.mark.parametrize("flag", [Flag.HEADING_LOST, Flag.MISSING, Flag.SATURATED])
def test_unusable_samples_do_not_count_but_lower_the_grade(flag: Flag) -> None:
    angle = _plateaus()
    angle[300:350] = 170 * DEG
    moved = _bending(angle)
    moved.flags[300:350, SEGMENT["index_middle"]] = flag
    found = _range(moved)
    assert found.largest == pytest.approx(80 * DEG, abs=1e-12)
    assert found.grade == "fair"
    assert "in 12 % of the samples" in found.reason


def test_only_the_task_counts() -> None:
    found = _range(_bending(_plateaus()), 3.0, 4.0)
    assert found.largest == pytest.approx(-10 * DEG)


def test_what_is_not_measured_or_too_short_has_no_range() -> None:
    moved = _bending(_plateaus())
    assert [r.joint for r in range_of_motion.measure(Params(), moved, 0, 4)] == ["index_pip"]
    assert range_of_motion.measure(Params(), moved, 0, 0.1) == []
    assert range_of_motion.measure(Params(), moved, 100, 200) == []
    moved.flags[:] = Flag.HEADING_LOST
    assert range_of_motion.measure(Params(), moved, 0, 4) == []


def test_the_simulated_tasks_extremes_are_those_of_its_postures() -> None:
    recording = simulate(["rom"], "left", sized("left"), np.random.default_rng(1), IDEAL)
    (task,) = recording.events
    found = {
        (r.joint, r.angle): r
        for r in range_of_motion.measure(Params(), recording.truth, task.onset, task.end)
    }
    assert {f"{joint}_{angle}" for joint, angle in found} == set(DOF_NAMES)
    for joint, largest, smallest in (
        ("ring_pip", 95, 0),
        ("middle_mcp", 80, -12),
        ("thumb_ip", 65, -10),
        ("wrist", 50, -45),
    ):
        r = found[joint, "flexion"]
        assert r.largest / DEG == pytest.approx(largest, abs=0.01)
        assert r.smallest / DEG == pytest.approx(smallest, abs=0.01)
    assert found["little_mcp", "deviation"].largest / DEG == pytest.approx(40, abs=0.01)


def test_figures_name_joint_angle_and_extreme() -> None:
    figures = range_of_motion.figures(
        range_of_motion.measure(Params(), _bending(_plateaus()), 0, 4)
    )
    assert [f.name for f in figures] == [
        "index_pip_flexion_max",
        "index_pip_flexion_min",
        "index_pip_flexion_range",
    ]
    assert {f.unit for f in figures} == {"rad"}
    assert figures[2].value == pytest.approx(90 * DEG)
