"""Reaches whose places are known: straight, round about, with the trunk, and places that cannot be trusted."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.trajectory import PlaceFlag, Trajectory
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.measures import reach, reach_place, trunk_displacement
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import by_name, made

T = np.arange(0, 8, 0.01)
ASKED = TaskRequest("reach", {}, (Mark(1.0, 4.0, "reach", 1), Mark(4.0, 8.0, "reach", 2)))


def _smooth(start: float, duration: float) -> np.ndarray:
    s = np.clip((T - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def _reached(place: np.ndarray, lean: np.ndarray | None = None, flags: int = 0) -> Trajectory:
    q_GS = np.full((len(T), len(SEGMENTS), 4), np.nan)
    q_GS[:, SEGMENT["hand"]] = quat.IDENTITY
    turned = np.tile(quat.IDENTITY, (len(T), 1)) if lean is None else quat.about(1, lean)
    known = {
        "place": place,
        "place_sd": np.full((len(T), 3), 0.005),
        "place_flags": np.full(len(T), flags, np.uint8),
    }
    return replace(
        made(len(T), q_GS=q_GS, tips=np.zeros((len(T), 5, 3))),
        **known,
        q_trunk=turned,
        q_trunk_sd=np.full((len(T), 3), 0.01),
        signal=np.full(len(T), 1.5),
    )


def _figures(moved: Trajectory, asked: TaskRequest = ASKED) -> dict[str, Figure]:
    return by_name(reach.figures(reach.measure(reach.Params(), moved, 0.0, 8.0, None, asked)))


def test_two_straight_reaches_forward_have_their_length_and_the_lean_of_the_trunk() -> None:
    """0.3 m in 1 s, there and on the second word back; 12 deg of lean. A minimum-jerk way above 2 % of its peak speed misses 0.1 % at either end."""
    there = _smooth(2.0, 1.0) - _smooth(5.0, 1.0)
    place = np.stack([0.2 + 0.3 * there, np.zeros_like(T), np.zeros_like(T)], axis=1)
    f = _figures(_reached(place, np.radians(12.0) * there))
    assert f["reach_distance"].value == pytest.approx(0.3, rel=0.01)
    assert f["reach_way"].value == pytest.approx(0.3, rel=0.01)
    assert f["reach_straightness"].value == pytest.approx(1.0, abs=0.002)
    assert f["reach_hand_speed"].value == pytest.approx(15 / 8 * 0.3, rel=0.02)
    assert f["reach_hand_sparc"].value == pytest.approx(-1.4, abs=0.05)
    assert f["reach_hand_units"].value == 1.0
    assert np.degrees(f["reach_trunk_lean"].value) == pytest.approx(12.0, abs=0.2)
    assert np.degrees(f["reach_trunk_turn"].value) < 0.1
    assert f["reach_farthest"].value == pytest.approx(0.5, abs=1e-6)
    assert f["reach_farthest"].sd == pytest.approx(0.005, rel=1e-6)
    assert f["reach_distance"].sd == pytest.approx(0.005 * np.sqrt(2), rel=0.05)
    assert f["reach_signal"].value == 1.5


def test_a_way_round_about_is_longer_than_straight() -> None:
    """Half a circle of 0.1 m: pi / 2 times its diameter."""
    angle = np.pi * _smooth(2.0, 1.0)
    place = np.stack([0.3 - 0.1 * np.cos(angle), 0.1 * np.sin(angle), np.zeros_like(T)], axis=1)
    assert _figures(_reached(place))["reach_straightness"].value == pytest.approx(
        np.pi / 2, rel=0.01
    )


def _leaning(**details: object) -> Figure:
    """One reach of 0.3 m against the trunk, which leans forward by 30 deg meanwhile; its sensor errs by 0.01 rad."""
    there = _smooth(2.0, 1.0)
    place = np.stack([0.2 + 0.3 * there, np.zeros_like(T), np.zeros_like(T)], axis=1)
    asked = TaskRequest("reach", details, (Mark(1.0, 8.0, "reach", 1),))
    return _figures(_reached(place, np.radians(30.0) * there), asked)["reach_trunk_forward"]


def test_a_trunk_that_leans_about_the_hips_carries_its_sensor_forward() -> None:
    """h sin 30 deg; the error of h, of the lean (h cos 30 deg 0.01), and of a line that stood 10 deg off upright (h (1 - cos 30 deg) 0.175)."""
    f = _leaning()
    assert f.value == pytest.approx(0.40 * 0.5, rel=0.01)
    assert f.sd == pytest.approx(
        np.sqrt((0.5 * 0.05) ** 2 + (0.40 * 0.866 * 0.01) ** 2 + (0.40 * 0.134 * 0.1745) ** 2),
        rel=0.02,
    )
    assert (
        f.reason
        == "the height of the trunk's sensor above the hips was not measured: 400 mm were taken"
    )
    measured = _leaning(trunk_height="0.5")
    assert measured.reason == "reckoned with the trunk's sensor 500 mm above the hips, as measured"
    assert measured.value == pytest.approx(0.25, rel=0.01)
    assert measured.sd == pytest.approx(
        np.sqrt((0.5 * 0.02) ** 2 + (0.5 * 0.866 * 0.01) ** 2 + (0.5 * 0.134 * 0.1745) ** 2),
        rel=0.02,
    )


def test_a_height_in_another_unit_gives_no_displacement_and_says_why() -> None:
    f = _leaning(trunk_height="42")
    assert np.isnan(f.value) and f.grade == "poor"
    assert "give it in m" in f.reason


def test_turning_about_the_vertical_carries_nothing_forward_and_drift_of_heading_hardly_matters() -> (
    None
):
    q = quat.multiply(
        quat.about(2, np.linspace(0.0, 0.3, 50)), quat.about(1, np.linspace(0.0, 0.2, 50))
    )
    params = trunk_displacement.TrunkParams()
    turned = trunk_displacement.displacement(
        params, quat.about(2, np.linspace(0.0, 1.0, 50)), np.zeros((50, 3)), None
    )
    assert np.abs(turned.forward).max() < 1e-9
    drifting = trunk_displacement.displacement(params, q, np.zeros((50, 3)), None)
    assert drifting.forward[-1] == pytest.approx(0.40 * np.sin(0.2) * np.cos(0.3), rel=1e-6)


def test_without_a_magnet_nothing_in_metres_is_measured_and_the_reason_is_said() -> None:
    f = _figures(replace(_reached(np.zeros((len(T), 3))), place=None))
    for kind in reach_place.KINDS:
        assert np.isnan(f[kind].value)
        assert "magnetometers on the trunk and a magnet on the hand" in f[kind].reason


@pytest.mark.parametrize("flag", [PlaceFlag.DOUBTFUL, PlaceFlag.OUT_OF_REACH])
def test_places_that_cannot_be_trusted_give_no_figure(flag: PlaceFlag) -> None:
    place = np.stack([0.2 + 0.3 * _smooth(2.0, 1.0), np.zeros_like(T), np.zeros_like(T)], axis=1)
    f = _figures(_reached(place, flags=int(flag)))
    assert all(
        np.isnan(f[kind].value) and f[kind].grade == "poor" and f[kind].reason
        for kind in reach_place.KINDS
    )


def test_the_volume_of_a_box_and_how_far_off_it_is() -> None:
    """One corner out by e in each axis changes a box of edges a, b, c by e (bc + ca + ab) / 6 (its three tetrahedra); eight of them independently."""
    corners = np.array([[x, y, z] for x in (0.0, 0.4) for y in (0.0, 0.3) for z in (0.0, 0.2)])
    value, sd = reach_place.hull_volume(corners, np.full((8, 3), 1e-3))
    assert value == pytest.approx(0.024)
    faces = np.array([0.06, 0.08, 0.12])
    assert sd is not None
    assert 1e-3 * np.sqrt(8 * (faces**2).sum()) / 6 < sd < 1e-3 * np.sqrt(8 * (faces**2).sum()) / 2
    assert np.isnan(reach_place.hull_volume(corners * [1, 1, 0], np.full((8, 3), 1e-3))[0])
