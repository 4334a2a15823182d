"""Camera landmarks: every layout gives the same places, the angles are those of the hand that was drawn, mistakes are said."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    JOINTS,
    Hand,
)
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.landmark_trajectory import Landmarks, trajectory_of
from handscope.sessions.formats.landmarks import NAMES, read_landmarks
from tests.estimators.measures.movements import movement
from tests.simulated import DEG

RATE = 30.0
HINGES = [JOINT[f"{finger}_{j}"] for finger in FINGERS[1:] for j in ("pip", "dip")]
MCPS = [JOINT[f"{finger}_mcp"] for finger in FINGERS[1:]]


def drawn(hand: Hand, n: int = 60, seed: int = 1) -> tuple[Array, Array, Array]:
    """Times (n,), true angles (n, joints, 3) and 21 places (n, 21, 3) m as a camera in any orientation sees them."""
    t = np.arange(n) / RATE
    angles = movement(seed, 3 * len(JOINTS))(t).reshape(n, len(JOINTS), 3) * IS_DOF
    angles[:, [k for k in range(len(JOINTS)) if k > 0], FLEXION] += 40 * DEG
    angles[:, JOINT["wrist"]] = 0.0
    return t, angles, seen(angles, hand)


def seen(angles: Array, hand: Hand) -> Array:
    """The 21 places (n, 21, 3) m of a hand with joint angles (n, joints, 3), as a camera that stands anywhere sees them."""
    n, geometry = len(angles), sized(hand)
    q_pc = joint_angles.compose(np.where(IS_DOF, angles, 0.0))
    chains = forward_kinematics.joint_places(q_pc, geometry)
    roots = np.broadcast_to(geometry.roots()[:, None], (n, 5, 1, 3))
    places = np.concatenate(
        [np.zeros((n, 1, 3)), np.concatenate([roots, chains], axis=2).reshape(n, 20, 3)], axis=1
    )
    q_CG = quat.normalize(np.array([0.4, -0.3, 0.8, 0.2]))
    return np.asarray(quat.rotate(q_CG, places) + [0.02, -0.03, 0.01])


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_angles_are_those_of_the_hand_that_was_drawn(hand: Hand) -> None:
    t, truth, places = drawn(hand)
    found = trajectory_of(Landmarks(t, 7.0 * places), hand).angles
    np.testing.assert_allclose(found[:, HINGES, FLEXION], truth[:, HINGES, FLEXION], atol=1e-6)
    for angle in (FLEXION, DEVIATION):  # the line wrist to middle MCP is not quite the hand's y
        difference = (found - truth)[:, MCPS, angle]
        assert np.abs(difference.mean(axis=0)).max() < 8 * DEG
        assert difference.std(axis=0).max() < 2 * DEG
    thumb = [JOINT["thumb_mcp"], JOINT["thumb_ip"]]
    np.testing.assert_allclose(
        found[:, thumb, FLEXION], np.abs(truth[:, thumb, FLEXION]), atol=1e-6
    )
    assert np.isnan(found[:, [JOINT["wrist"], JOINT["thumb_cmc"]]]).all()


def test_the_other_hand_or_a_mirrored_picture_is_refused() -> None:
    t, _, places = drawn("left")
    with pytest.raises(InputError, match="bend backwards"):
        trajectory_of(Landmarks(t, places), "right")
    with pytest.raises(InputError, match="bend backwards"):
        trajectory_of(Landmarks(t, places * [-1, 1, 1]), "left")


def as_json(t: Array, places: Array, **changes: Any) -> str:
    frames = [{"time": t_k, "world_landmarks": p.tolist()} for t_k, p in zip(t.tolist(), places)]
    return json.dumps({"hand": "left", "frames": frames} | changes)


def as_csv(t: Array, places: Array, header: Callable[[int, str], str], delimiter: str = ",") -> str:
    text = io.StringIO()
    table = csv.writer(text, delimiter=delimiter)
    table.writerow(["frame", "timestamp_ms", *(header(k, a) for k in range(21) for a in "xyz")])
    for k, (t_k, p) in enumerate(zip(t, places)):
        numbers = [repr(float(v)) for v in (1e3 * t_k, *p.ravel())]
        table.writerow([k, *(n.replace(".", ",") if delimiter == ";" else n for n in numbers)])
    return text.getvalue()


def mediapipe_words(k: int, axis: str) -> str:
    name = NAMES[k].replace("little", "pinky")
    return f"{name if k < 5 else name.replace('_', '_finger_')}_{axis}".upper()


def layouts() -> dict[str, tuple[str, str]]:
    t, _, places = drawn("left", 5)
    hands = [
        {
            "timestamp_ms": 1e3 * t_k,
            "multi_hand_world_landmarks": [[dict(zip("xyz", q)) for q in p]],
        }
        for t_k, p in zip(t.tolist(), places.tolist())
    ]
    return {
        "frames": (".json", as_json(t, places)),
        "list of hands": (".json", json.dumps(hands)),
        "bare frames": (".json", json.dumps({"fps": RATE, "frames": places.tolist()})),
        "numbers": (".csv", as_csv(t, places, lambda k, a: f"{a}{k}")),
        "names": (".csv", as_csv(t, places, mediapipe_words)),
        "decimal commas": (".csv", as_csv(t, places, lambda k, a: f"landmark_{k}_{a}", ";")),
    }


@pytest.mark.parametrize("layout", layouts())
def test_every_layout_gives_the_same_places(layout: str, tmp_path: Path) -> None:
    t, _, places = drawn("left", 5)
    suffix, text = layouts()[layout]
    (tmp_path / f"l{suffix}").write_text(text)
    found = read_landmarks(tmp_path / f"l{suffix}")
    np.testing.assert_allclose(found.t, t, atol=1e-12)
    np.testing.assert_allclose(found.places, places, atol=1e-12)


def test_shares_of_a_picture_are_stretched_by_its_size(tmp_path: Path) -> None:
    t, _, places = drawn("left", 40)
    shares = places - places[:, :1] * [0, 0, 1]
    shares = shares * [1 / 640, 1 / 480, 1 / 640] * 1000 + [0.5, 0.5, 0.0]
    frames = [{"time": t_k, "landmarks": p.tolist()} for t_k, p in zip(t.tolist(), shares)]
    path = tmp_path / "l.json"
    path.write_text(json.dumps({"frames": frames, "image_width": 640, "image_height": 480}))
    found = trajectory_of(read_landmarks(path), "left").angles
    np.testing.assert_allclose(found, trajectory_of(Landmarks(t, places), "left").angles, atol=1e-6)
    path.write_text(json.dumps({"frames": frames}))
    with pytest.raises(InputError, match="image_width"):
        read_landmarks(path)


def test_frames_without_a_hand_are_unknown(tmp_path: Path) -> None:
    t, _, places = drawn("left", 4)
    frames = json.loads(as_json(t, places))["frames"]
    frames[1]["world_landmarks"], frames[2]["world_landmarks"] = [], None
    (tmp_path / "l.json").write_text(as_json(t, places, frames=frames))
    known = np.isfinite(read_landmarks(tmp_path / "l.json").places).all(axis=(1, 2))
    assert known.tolist() == [True, False, False, True]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "no JSON"),
        ("{}", "no list of two or more frames"),
        ('{"frames": [[[0, 0, 0]], [[0, 0, 0]]]}', "frame 0"),
        ('{"fps": 30, "frames": [[], []]}', "no hand"),
        (as_json(np.array([1.0, 1.0]), np.ones((2, 21, 3))), "do not increase"),
        (as_json(np.arange(2.0), np.ones((2, 21, 3)), hand="both"), "left or right"),
        (
            as_json(np.arange(2.0), np.ones((2, 20, 3))),
            "frame 0 does not hold the points of a hand, which are 21",
        ),
        (as_json(np.arange(2.0), np.ones((2, 21, 3)), fps=0.0), "cannot be"),
    ],
)
def test_mistakes_are_said(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text(text)
    with pytest.raises(InputError, match=words):
        read_landmarks(tmp_path / "l.json")


def test_a_table_without_all_columns_is_refused(tmp_path: Path) -> None:
    t, _, places = drawn("left", 4)
    text = as_csv(t, places, lambda k, a: f"{a}{k}").replace("y7", "seventh")
    (tmp_path / "l.csv").write_text(text)
    with pytest.raises(InputError, match="lacks y of index_dip"):
        read_landmarks(tmp_path / "l.csv")
