"""Kapandji's places: where they lie on a hand, and which count as reached."""

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import JOINT, JOINTS, Hand, side_sign
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import kapandji
from handscope.estimators.measures.kapandji import Params, distances, landmarks, score_of
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL
from tests.estimators.measures.trajectories import by_name, made


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_places_of_a_flat_hand_lie_where_anatomy_has_them(hand: Hand) -> None:
    """Dorsal, distal, ulnar from the wrist: tips in one line of fingers, creases below and proximal of the little finger's tip."""
    geometry = sized(hand)
    places = landmarks(np.zeros((1, len(JOINTS), 3)), geometry)[0] * side_sign(hand)
    dorsal, distal, ulnar = places.T
    assert (np.diff(ulnar[2:6]) > 0).all()  # index, middle, ring, little
    assert distal[3] == distal[2:6].max()  # the middle finger is the longest
    assert (
        np.diff(distal[[5, 6, 7, 8, 9]]) < 0
    ).all()  # from the little finger's tip towards the palm
    assert (dorsal[6:] < -0.004).all()
    assert (ulnar[:2] < ulnar[2]).all()  # the index's radial side
    assert distal[0] < distal[1] < distal[2]


@pytest.mark.parametrize(
    ("reached", "score"),
    [
        ({1, 2, 3}, (3, False)),
        ({3, 6, 8}, (8, False)),
        (set(), (0, False)),
        ({7, 8, 9}, (0, True)),
        ({1, 10}, (10, False)),
    ],
)
def test_the_score_is_the_highest_place_if_the_first_ones_are_possible(
    reached: set[int], score: tuple[int, bool]
) -> None:
    assert score_of({k: 0.005 if k in reached else 0.05 for k in range(1, 11)}, 0.02) == score


def test_the_simulated_patient_reaches_the_tips_that_it_goes_to() -> None:
    recording = simulate(["kapandji"], "left", sized("left"), np.random.default_rng(1), IDEAL)
    task = next(e for e in recording.events if e.trial_type == "task")
    marks = tuple(
        Mark(e.onset, e.end, e.details["phase"], 1)
        for e in recording.events
        if e.trial_type == "annotation"
    )
    found = kapandji.measure(
        Params(),
        recording.truth,
        task.onset,
        task.end,
        recording.geometry,
        TaskRequest("kapandji", {}, marks),
    )
    assert all(found.distances[k] < 0.025 for k in (3, 4, 5, 6))
    f = by_name(kapandji.figures(found))
    assert f["kapandji_score"].grade == "fair"
    assert "confirm by eye" in f["kapandji_score"].reason
    assert f["opposition_pronation"].value > np.radians(80)


def test_a_finger_that_is_not_measured_has_no_place() -> None:
    angles = np.zeros((5, len(JOINTS), 3))
    angles[:, JOINT["little_dip"], 0] = np.nan
    gaps = distances(angles, sized("left"))
    assert np.isnan(gaps[:, [5, 8]]).tolist() == [[True, False]] * 5
    assert np.isfinite(gaps[:, [2, 9]]).all()


def test_without_a_geometry_or_a_thumb_it_says_why() -> None:
    moved = made(100)
    assert kapandji.measure(Params(), moved, 0, 1).reason == "the hand's geometry is not known"
    found = kapandji.measure(Params(), moved, 0, 1, sized("left"))
    assert "not measured" in found.reason
    assert np.isnan(kapandji.figures(found)[0].value)
