"""Reaches and circles of known size."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.measures import circles, reach
from handscope.estimators.measures.reach import Params
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import by_name, made

DEG = np.pi / 180
T = np.arange(0, 10, 0.01)


def _minimum_jerk(start: float, duration: float) -> np.ndarray:
    s = np.clip((T - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def test_a_reach_by_a_minimum_jerk_turn_has_its_time_its_path_and_the_smoothness_of_the_closed_form() -> (
    None
):
    """60 deg in 1.2 s; the speed is above 2 % of its peak for 89 % of that: 30 s^2 (1 - s)^2 = 0.02 * 15/8 at s = 0.0366... and its mirror."""
    q_GS = np.full((len(T), len(SEGMENTS), 4), np.nan)
    q_GS[:, SEGMENT["hand"]] = quat.exp(
        (60 * DEG * _minimum_jerk(2.0, 1.2))[:, None] * np.array([0.0, 0, 1])
    )
    tips = np.zeros((len(T), 5, 3))
    tips[:, 1, 1] = 0.02 + 0.06 * np.exp(-(((T - 2.8) / 0.3) ** 2))
    asked = TaskRequest(
        "reach",
        {},
        (Mark(1.0, 4.0, "reach", 1), Mark(4.0, 7.0, "return", 1), Mark(7.0, 10.0, "reach", 2)),
    )
    found = reach.measure(Params(), made(len(T), q_GS=q_GS, tips=tips), 0.0, 10.0, None, asked)
    f = by_name(reach.figures(found))
    share = 0.5 - np.min(
        np.abs(np.roots([1, -2, 1, 0, -0.02 / 16]).real[:, None] - 0.0)
    )  # s^2 (1 - s)^2 = 0.02 / 16
    assert f["reach_count"].value == 1  # nothing moved in the second
    assert f["reach_time"].value == pytest.approx(2 * share * 1.2, abs=0.04)
    assert f["reach_peak_speed"].value == pytest.approx(15 / 8 * 60 * DEG / 1.2, rel=0.02)
    assert f["reach_peak_share"].value == pytest.approx(0.5, abs=0.02)
    assert f["reach_path"].value == pytest.approx(60 * DEG, rel=0.02)
    assert f["reach_sparc"].value == pytest.approx(-1.4, abs=0.05)
    assert f["reach_aperture_max"].value == pytest.approx(0.08, rel=0.01)
    assert f["reach_aperture_share"].value == pytest.approx(
        (2.8 - (2.6 - share * 1.2)) / (2 * share * 1.2), abs=0.03
    )


def test_a_hand_that_does_not_turn_is_judged_by_its_fingertips_and_says_so() -> None:
    q_GS = np.full((len(T), len(SEGMENTS), 4), np.nan)
    q_GS[:, SEGMENT["hand"]] = quat.IDENTITY
    tips = np.zeros((len(T), 5, 3))
    tips[:, 1, 1] = 0.12 * _minimum_jerk(2.0, 1.0)
    found = reach.measure(Params(), made(len(T), q_GS=q_GS, tips=tips), 0.0, 10.0)
    f = by_name(reach.figures(found))
    assert f["reach_time"].value == pytest.approx(0.92, abs=0.06)
    assert "fingertips" in f["reach_time"].reason
    assert np.isnan(f["reach_peak_speed"].value)
    still = reach.measure(Params(), made(len(T), q_GS=q_GS, tips=0 * tips), 0.0, 10.0)
    assert (still.grade, still.reason) == ("poor", "no reach found: the hand hardly moved")


@given(st.floats(8, 40), st.floats(0.3, 1.0), st.floats(0.4, 2.0), st.floats(0, np.pi))
def test_an_ellipse_gives_back_its_axes_its_roundness_and_its_rate(
    long: float, ratio: float, rate: float, tilt: float
) -> None:
    a, b = (
        long * DEG * np.cos(2 * np.pi * rate * T),
        long * ratio * DEG * np.sin(2 * np.pi * rate * T),
    )
    found = circles.of_angles(
        T, 30 * DEG + np.cos(tilt) * a - np.sin(tilt) * b, np.sin(tilt) * a + np.cos(tilt) * b
    )
    assert found.long == pytest.approx(long * DEG, rel=0.05)
    assert found.short == pytest.approx(long * ratio * DEG, rel=0.05)
    assert found.rate == pytest.approx(rate, rel=0.02)
    assert found.scatter < 0.06


def test_a_line_is_no_circle() -> None:
    found = circles.of_angles(T, 20 * DEG * np.sin(T), 10 * DEG * np.sin(T))
    assert found.reason.startswith("no circle")
    assert by_name(circles.figures(found))["index_mcp_circles_count"].value == 0
