"""A result beside a camera's landmarks: lag and angles of the hand that both saw; what is no such file is one sentence and nothing stays."""

import json
from pathlib import Path

import numpy as np
import pytest

from handscope.app.results.landmark_comparison import EVENT, LandmarkComparison, compare_landmarks
from handscope.app.results.movement_agreement import Movement
from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from tests.sessions.formats.test_landmarks import as_csv, as_json, seen
from tests.simulated import DEG, pose_and_wiggle

TRUTH = pose_and_wiggle("left").truth
CAMERA = slice(None, None, 3)  # of its samples: 33 pictures a second
TASK = Event(6.0, 3.0, "task", {"task_name": "wiggle", EVENT: 4})
MEASURED = Movement("m2 1", TRUTH, (TASK,))


def write(folder: Path, later: float, sd: float = 0.0, name: str = "l.json") -> Path:
    """What a camera saw whose clock reads `later` s more, its points right to `sd` m."""
    places = seen(TRUTH.angles, "left")[CAMERA]
    places = places + np.random.default_rng(1).normal(0.0, sd, places.shape)
    (folder / name).write_text(as_json(TRUTH.t[CAMERA] + later, places))
    return folder / name


def rows(found: LandmarkComparison, number: int | None) -> dict[str, float]:
    """dRMS of each angle in deg."""
    agreements = dict(found.stretches)[number]
    return {a.name: a.drms / DEG for a in agreements}


@pytest.mark.parametrize("later", [2.4, 1.7e9])
def test_the_lag_and_the_angles_of_the_hand_that_both_saw_come_back(
    later: float, tmp_path: Path
) -> None:
    found = compare_landmarks(write(tmp_path, later), MEASURED, 1000)
    assert found.lag.seconds == pytest.approx(-later, abs=0.002)
    hinges = {f"{finger}_{joint}_flexion" for finger in FINGERS[1:] for joint in ("pip", "dip")}
    for number in (None, 4):
        drms = rows(found, number)
        assert hinges < set(drms)
        assert max(drms[name] for name in hinges) < 0.3
    assert not {"wrist_flexion", "thumb_cmc_flexion", "thumb_index_distance"} & set(drms)


def test_a_cameras_noise_is_in_the_difference_and_not_in_the_lag(tmp_path: Path) -> None:
    quiet, noisy = (
        compare_landmarks(write(tmp_path, 0.7, sd), MEASURED, 1000) for sd in (0.0, 0.002)
    )
    assert noisy.lag.seconds == pytest.approx(-0.7, abs=0.01)
    name = "index_pip_flexion"
    assert rows(noisy, None)[name] > rows(quiet, None)[name] + 5.0
    curve = noisy.curves[name]
    np.testing.assert_allclose(curve.difference, curve.b - curve.a, atol=40 * DEG)
    assert len(curve.t) <= 1000


def test_what_cannot_be_compared_is_one_sentence(tmp_path: Path) -> None:
    places = seen(TRUTH.angles, "left")[CAMERA]
    t = TRUTH.t[CAMERA]
    still = np.repeat(places[:1], len(places), axis=0)
    for name, text, words in (
        ("l.txt", "x", "neither JSON nor CSV"),
        ("l.json", as_json(t, places, hand="right"), "is of the right hand"),
        ("l.json", as_json(1e3 * t, places), "frames come every 30 s"),
        ("l.json", as_json(np.append(t[:-1], 9e9), places), "longer than 4 hours"),
        ("l.json", as_json(t, still), "nothing moves"),
        ("l.json", json.dumps([]), "no list of two or more frames"),
        ("l.csv", as_csv(t, places, lambda k, a: f"{a}{k}").replace("y7", "seventh"), "lacks y of"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=words):
            compare_landmarks(tmp_path / name, MEASURED, 1000)
