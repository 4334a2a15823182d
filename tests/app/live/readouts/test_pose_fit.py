"""Before the pose the drawn hand shows inclinations alone; in it, the page reads how well each finger fits."""

import numpy as np
import pytest

from handscope.app.live.readouts import pose_fit
from handscope.app.live.station_scene import is_followed
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.machine import State, Wizard
from handscope.app.protocols import load_all
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.hand.anatomy import FINGERS, FLEXION, JOINT
from handscope.estimators.methods import m2
from tests.simulated import DEG, INSTANT, in_strips


@pytest.fixture(scope="module")
def followed_until() -> dict[str, Tracking]:
    """Trackers that were fed until the pose, and until the index finger bent; nothing is calibrated."""
    recording, found = in_strips("left"), {}
    rates = recording.truth.angles[:, JOINT["index_pip"], FLEXION]
    bent = float(recording.truth.t[int(np.argmax(rates))])
    for name, until in (("pose", recording.events[0].end), ("bent", bent)):
        tracking = Tracking(m2, INSTANT, "left", recording.geometry, lambda rows: None)
        tracking._process([b.between(-np.inf, until) for b in recording.samples.values()])
        found[name] = tracking
    return found


def test_in_the_pose_every_finger_fits_and_the_drawn_hand_lies_flat(
    followed_until: dict[str, Tracking],
) -> None:
    rows = pose_fit.fit_rows(followed_until["pose"], in_strips("left").mounting)
    assert [r["part"] for r in rows] == ["hand", *FINGERS]
    assert {r["grade"] for r in rows} == {"good"}
    drawn = pose_fit.inclined_pose(followed_until["pose"], in_strips("left").mounting)
    assert drawn is not None
    np.testing.assert_allclose(drawn[0], inclined_hand.pose_angles(pose_fit.NOMINAL), atol=3 * DEG)


def test_a_bent_finger_is_drawn_bent_before_anything_is_calibrated_and_fits_no_more(
    followed_until: dict[str, Tracking],
) -> None:
    drawn = pose_fit.inclined_pose(followed_until["bent"], in_strips("left").mounting)
    assert drawn is not None and drawn[0][JOINT["index_pip"], FLEXION] > 20 * DEG
    rows = pose_fit.fit_rows(followed_until["bent"], in_strips("left").mounting)
    (index,) = [r for r in rows if r["part"] == "index"]
    assert index["grade"] == "poor" and index["direction"] == "bent"


def test_without_samples_nothing_is_claimed() -> None:
    tracking = Tracking(m2, INSTANT, "left", in_strips("left").geometry, lambda rows: None)
    assert pose_fit.inclined_pose(tracking, {}) is None
    assert pose_fit.fit_rows(tracking, {}) == []


def test_the_hand_is_followed_from_the_review_of_the_first_pose_on_and_in_no_pose() -> None:
    followed = {
        state: is_followed(Wizard(tuple(load_all().values()), 3.0, state=state), True)
        for state in State
    }
    assert followed[State.POSE_REVIEW] and followed[State.TASKS] and followed[State.TASK_RUN]
    assert not (followed[State.CONNECT] or followed[State.POSE_READY] or followed[State.POSE_HOLD])
    assert not is_followed(Wizard((), 3.0, state=State.TASKS), False)
