"""A camera above the sheet and the hand on it: exact marks give the truth, what errs has its standard deviation."""

from collections.abc import Sequence

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.estimators.hand.geometry import MCP_DISTAL, measures_from, sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph import camera as cameras
from handscope.estimators.photograph.camera import Camera
from handscope.estimators.photograph.hand_figures import (
    MARK_SD,
    Figures,
    View,
    landmark_heights,
    measure,
)
from handscope.estimators.photograph.sheet import LANDMARKS, PAPERS, Sheet, sheet_of
from handscope.estimators.photograph.use import geometry_entries, pose_details
from tests.schedule import swept

SIZE = (2000, 1500)
DEG = np.pi / 180


def camera_above(tilt: float = 20 * DEG, radial: tuple[float, float] = (0.03, -0.02)) -> Camera:
    down = quat.about(0, np.pi)  # x to the right, y down in the picture
    q_cs = quat.multiply(quat.about(1, tilt), quat.multiply(quat.about(2, 1.5), down))
    p_c = np.array([0.01, -0.02, 0.45])
    return Camera(
        SIZE, 0.75, np.array([0.004, -0.003]), np.array(radial), q_cs, p_c, np.zeros((11, 11)), 0.0
    )


def corners(sheet: Sheet) -> Array:
    return np.concatenate(list(sheet.markers().values()))


def seen_hand(hand: Hand, camera: Camera) -> dict[str, Array]:
    geometry = sized(hand)
    places = Sheet("a4", hand).landmarks(geometry)
    height = landmark_heights(geometry.palm_length / MCP_DISTAL["middle"])
    points = np.column_stack([np.array([places[name] for name in LANDMARKS]), height])
    return dict(zip(LANDMARKS, camera.project(points)))


def test_a_camera_is_found_from_the_markers_and_looks_back_to_where_points_are() -> None:
    true, sheet = camera_above(), Sheet("a4", "left")
    found = cameras.locate(corners(sheet), true.project(corners(sheet)), SIZE, 0.75)
    # height and focal length are known only together, to the prior's 4 %
    np.testing.assert_allclose(found.place, true.place, atol=3e-3)
    assert found.tilt == pytest.approx(20 * DEG, abs=0.2 * DEG)
    points = np.array([[0.02, 0.05, 0.0], [-0.04, -0.08, 0.02]])
    back = found.place_at(true.project(points), points[:, 2])
    np.testing.assert_allclose(back, points[:, :2], atol=0.2e-3)


@pytest.mark.parametrize("hand", HANDS)
def test_exact_marks_give_the_hand_that_was_drawn(hand: Hand) -> None:
    camera, geometry = camera_above(), sized(hand)
    figures = measure([View(camera, seen_hand(hand, camera))], hand)
    for name, length in figures.lengths.items():
        assert length == pytest.approx(geometry.lengths[name], abs=0.3e-3), name
    for joint, place in figures.joint_positions.items():
        np.testing.assert_allclose(place, geometry.joint_positions[joint], atol=0.3e-3)
    expected = dict.fromkeys(figures.deviation, 0.0) | {"thumb_cmc": -45 * DEG}
    for joint, angle in figures.deviation.items():
        assert angle == pytest.approx(expected[joint], abs=0.2 * DEG), joint


def test_deviation_is_positive_towards_the_little_finger_on_both_hands() -> None:
    for hand in HANDS:
        camera = camera_above(0.0, (0.0, 0.0))
        marks = seen_hand(hand, camera)
        before = measure([View(camera, marks)], hand).deviation["index_mcp"]
        towards_little = marks["little_tip"] - marks["index_tip"]
        marks["index_tip"] = marks["index_tip"] + 0.1 * towards_little
        assert measure([View(camera, marks)], hand).deviation["index_mcp"] > before + 1 * DEG


def scattered(
    rng: np.random.Generator, cameras_used: Sequence[Camera], hand: Hand, mark_sd: float = MARK_SD
) -> tuple[list[View], Figures]:
    """What pictures of a hand of other thickness show, marked with scatter, and the truth."""
    sheet = Sheet("a4", hand)
    geometry, places = sized(hand), sheet.landmarks(sized(hand))
    height = landmark_heights(geometry.palm_length / MCP_DISTAL["middle"])
    share = 1 + 0.1 / np.sqrt(2) * (rng.normal() + rng.normal(size=len(height)))
    points = np.column_stack([np.array([places[n] for n in LANDMARKS]), height * share])
    views = []
    for true in cameras_used:
        seen = true.project(corners(sheet))
        found = cameras.locate(
            corners(sheet), seen + cameras.CORNER_SD * rng.normal(size=seen.shape), SIZE, None
        )
        off = (
            mark_sd
            * rng.normal(size=(len(points), 2))
            * np.where(np.array(LANDMARKS) == "thumb_cmc", 3.0, 1.0).reshape(-1, 1)
        )
        marks = true.project(points + np.column_stack([off, np.zeros(len(off))]))
        views.append(View(found, dict(zip(LANDMARKS, marks))))
    true = cameras_used[0]
    return views, measure([View(true, seen_hand(hand, true))], hand)


def deviations(found: Figures, true: Figures) -> dict[str, tuple[float, float]]:
    """Errors with standard deviations; the tissue at the tips is the same here."""
    angles = {k: (v - true.deviation[k], found.deviation_sd[k]) for k, v in found.deviation.items()}
    lengths = {
        k: (v - true.lengths[k], found.lengths_sd[k])
        for k, v in found.lengths.items()
        if not k.endswith("distal")
    }
    return angles | lengths


@pytest.mark.parametrize("tilts", swept([(20,), (20, -15), (25, 0)], [(20,), (20, -15)]))
def test_standard_deviations_are_as_large_as_the_errors(tilts: tuple[float, ...]) -> None:
    rng, squares = np.random.default_rng(3), []
    for _ in range(12):
        views, true = scattered(rng, [camera_above(tilt * DEG) for tilt in tilts], "left")
        errors = deviations(measure(views, "left"), true)
        squares += [(error / sd) ** 2 for error, sd in errors.values()]
    assert 0.6 < np.mean(squares) < 1.5


@pytest.mark.parametrize("people", swept([4, 12], kept=[4]))
def test_a_second_picture_from_the_other_side_tells_how_high_the_joints_are(people: int) -> None:
    rng, exact = np.random.default_rng(5), 0.1e-3  # m, so that heights err most
    errors: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(people):
        sides = [camera_above(25 * DEG), camera_above(-25 * DEG)]
        views, true = scattered(rng, sides, "left", exact)
        for many in errors:
            found = deviations(measure(views[:many], "left", exact), true)
            errors[many] += [found[j][0] for j in true.deviation]
    assert np.std(errors[2]) < 0.4 * np.std(errors[1])


def test_pictures_between_which_a_finger_moved_are_refused() -> None:
    cameras_used = [camera_above(20 * DEG), camera_above(-20 * DEG)]
    views, _ = scattered(np.random.default_rng(6), cameras_used, "left")
    measure(views, "left")
    moved = {**views[1].marks, "ring_pip": views[1].marks["ring_pip"] + 25.0}
    # pixels, both ways: 10.6 mm where the sheet has 1500 / 0.45 pixels a metre
    with pytest.raises(InputError, match=r"ring pip lies (9|10|11)\.\d mm"):
        measure([views[0], View(views[1].camera, moved)], "left")


def test_no_two_sheets_share_a_marker() -> None:
    numbers = [(k, Sheet(p, h)) for p in PAPERS for h in HANDS for k in Sheet(p, h).markers()]
    assert len({k for k, _ in numbers}) == len(numbers)
    assert all(sheet_of(k) == sheet for k, sheet in numbers)
    assert sheet_of(15) is None and sheet_of(500) is None


def test_what_is_found_goes_to_the_geometry_and_the_pose() -> None:
    camera = camera_above()
    figures = measure([View(camera, seen_hand("right", camera))], "right")
    entries = geometry_entries(figures)
    geometry = sized("right", measures_from(entries))
    assert geometry.lengths["index_middle"] == entries["index_middle"]
    assert "index_mcp" in geometry.measured and "thumb_metacarpal" not in geometry.measured
    details = pose_details(figures)
    assert details["thumb_cmc_deviation_deg"] == pytest.approx(-45, abs=0.3)
    assert 0.2 < details["wrist_deviation_sd_deg"] < 3


def test_marks_that_are_no_hand_are_refused() -> None:
    camera = camera_above()
    marks = seen_hand("left", camera)
    with pytest.raises(InputError, match="index_tip"):
        measure([View(camera, {k: v for k, v in marks.items() if k != "index_tip"})], "left")
    with pytest.raises(InputError, match="mm long"):
        measure([View(camera, dict.fromkeys(marks, marks["index_tip"]))], "left")
    with pytest.raises(InputError, match="no place"):
        measure([View(camera, {**marks, "index_tip": np.array([np.nan, 1.0])})], "left")
