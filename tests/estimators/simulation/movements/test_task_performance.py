"""What the simulated person does: where tasks begin and end, how fast, and within which ranges."""

from typing import Any

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import IS_DOF, JOINTS, LIMITS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.motion import COORDINATES, make_posture
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.grasp_postures import (
    pinch_posture,
    reach_posture,
    tips_of,
)
from tests.simulated import DEG

every_task = pytest.mark.parametrize("name", task_performance.TASKS)
IN_TIME = [
    name
    for name in task_performance.TASKS
    if name.startswith(("powerglove", "repeatability", "circular"))
]  # their pace is given
GUIDED = [
    name for name in task_performance.TASKS if name not in ("tapping", "open_close", *IN_TIME)
]


def _sampled(name: str, hand: Any = "left") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    motion = task_performance.TASKS[name](sized(hand)).motion
    return motion.at(np.linspace(0.0, motion.duration, 4001))


@every_task
@pytest.mark.parametrize("hand", ["left", "right"])
def test_every_task_begins_and_ends_at_rest_in_the_relaxed_posture(name: str, hand: Any) -> None:
    x, dx, ddx = _sampled(name, hand)
    for k in (0, -1):
        np.testing.assert_allclose(x[k], task_performance.relaxed(), atol=1e-9)
        np.testing.assert_allclose(dx[k], 0.0, atol=1e-6)
        np.testing.assert_allclose(ddx[k], 0.0, atol=1e-4)


@pytest.mark.parametrize("name", GUIDED)
def test_guided_movements_stay_below_two_radians_a_second(name: str) -> None:
    _, dx, _ = _sampled(name)
    assert np.abs(dx[:, 6:]).max() < 2.0


def test_tapping_is_fast_but_below_what_a_gyroscope_measures() -> None:
    _, dx, _ = _sampled("tapping")
    assert 5.0 < np.abs(dx[:, 6:]).max() < 1000 * DEG


@pytest.mark.parametrize("name", IN_TIME)
def test_what_is_done_in_time_is_within_what_a_gyroscope_measures(name: str) -> None:
    _, dx, _ = _sampled(name)
    flexing = [
        [COORDINATES[f"{f}_{j}_flexion"] for j in ("mcp", "pip", "dip")]
        for f in ("index", "middle", "little")
    ]
    fastest = max(np.abs(dx[:, columns].sum(axis=1)).max() for columns in flexing)
    assert fastest < 2000 * DEG
    assert (np.abs(dx[:, 6:]).max() > 3.0) == any(
        f"_{n}_" in name for n in (10, 11, 12, 13, 15)
    )  # rad/s: the fast ones


def test_only_the_named_fingers_and_joints_move_in_the_flexion_tasks() -> None:
    start = task_performance.TASKS["powerglove_01_index_mcp"](sized("left")).motion.at(
        np.array([1.0])
    )[0]
    for name in [n for n in IN_TIME if n.startswith("powerglove_0")]:
        x = _sampled(name)[0]
        inside = np.abs(x[1000:3000] - start).max(axis=0) > 1e-6
        moved = {coordinate for coordinate, k in COORDINATES.items() if inside[k]}
        _, _, who, joints = name.split("_", 3)
        fingers = ("index", "middle") if who == "both" else (who,)
        asked = {"mcp": ("mcp",), "pip_dip": ("pip", "dip"), "all": ("mcp", "pip", "dip")}[joints]
        assert moved == {f"{f}_{j}_flexion" for f in fingers for j in asked}


def test_the_index_finger_goes_round_ten_times() -> None:
    performance = task_performance.TASKS["powerglove_15_index_circles"](sized("left"))
    (event,) = performance.events
    x = performance.motion.at(np.linspace(event.onset, event.end, 3000))[0]
    around = [x[:, COORDINATES[f"index_mcp_{angle}"]] for angle in ("flexion", "deviation")]
    first, second = ((a - (a.max() + a.min()) / 2) / np.ptp(a) for a in around)
    assert abs(np.ptp(np.unwrap(np.arctan2(second, first)))) / (2 * np.pi) == pytest.approx(
        10.0, abs=0.02
    )


@every_task
def test_every_joint_stays_within_the_models_permitted_range(name: str) -> None:
    angles = _sampled(name)[0][:, 6:].reshape(-1, len(JOINTS), 3)
    assert (angles >= LIMITS[..., 0] - 1e-9)[:, IS_DOF].all()
    assert (angles <= LIMITS[..., 1] + 1e-9)[:, IS_DOF].all()
    np.testing.assert_allclose(angles[:, ~IS_DOF], 0.0, atol=1e-12)


@every_task
def test_events_lie_within_the_motion(name: str) -> None:
    performance = task_performance.TASKS[name](sized("left"))
    assert performance.events
    for event in performance.events:
        assert event.onset >= 0
        assert event.end <= performance.motion.duration + 1e-9


def test_the_initial_pose_is_held_still_for_three_seconds_as_its_event_says() -> None:
    performance = task_performance.initial_pose(sized("left"))
    (event,) = performance.events
    t = np.linspace(event.onset, event.end, 50)
    x, dx, _ = performance.motion.at(t)
    assert event.duration >= 3.0
    np.testing.assert_allclose(x, np.tile(task_performance.flat(), (50, 1)), atol=1e-12)
    np.testing.assert_allclose(dx, 0.0, atol=1e-12)
    told = [event.details[f"thumb_cmc_{a}_deg"] for a in ("flexion", "deviation", "pronation")]
    first = COORDINATES["thumb_cmc_flexion"]
    np.testing.assert_allclose(x[0, first : first + 3] / DEG, told)


@pytest.mark.parametrize("rate", [1.0, 2.5, 4.0])
def test_tapping_closes_as_often_as_asked(rate: float) -> None:
    geometry = sized("right")
    performance = task_performance.tapping(geometry, duration=10.0, rate=rate)
    (event,) = performance.events
    closed = event.onset + np.arange(round(10 * rate) + 1) / rate
    tips = np.array([tips_of(x, geometry) for x in performance.motion.at(closed)[0]])
    touching = geometry.tip_tissue["thumb"] + geometry.tip_tissue["index"]
    np.testing.assert_allclose(
        np.linalg.norm(tips[:, 0] - tips[:, 1], axis=-1), touching, atol=0.1e-3
    )


@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little"])
@pytest.mark.parametrize("hand", ["left", "right"])
def test_every_finger_can_pinch(finger: str, hand: Any) -> None:
    geometry = sized(hand)
    tips = tips_of(
        pinch_posture(geometry, finger, distance=0.012, base=task_performance.relaxed()), geometry
    )
    between = np.linalg.norm(
        tips[0] - tips[1 + ["index", "middle", "ring", "little"].index(finger)]
    )
    assert between == pytest.approx(0.012, abs=0.1e-3)


def test_reaching_moves_only_the_fingers_named() -> None:
    geometry, guess = sized("left"), task_performance.relaxed()
    x = reach_posture({("index", "middle"): 0.025}, geometry, ("index", "middle"), guess)
    moved = {name for name, k in COORDINATES.items() if x[k] != guess[k]}
    assert moved
    assert all(name.startswith(("index", "middle")) for name in moved)


def test_a_posture_takes_degrees_and_metres() -> None:
    x = make_posture(None, wrist_x=0.3, index_pip_flexion=90.0)
    assert x[COORDINATES["wrist_x"]] == 0.3
    assert x[COORDINATES["index_pip_flexion"]] == pytest.approx(np.pi / 2)
    with pytest.raises(KeyError):
        make_posture(None, pinky_pip_flexion=3.0)
