"""From one kind of hand to another the drawn hand passes smoothly: no picture shows a jump."""

from itertools import pairwise

import numpy as np
import pytest

from handscope.app.scene import postures
from handscope.app.scene.hand_scene import HandScene
from handscope.app.scene.postures import PASSAGE, Passage
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
PICTURE = 1 / 60  # s


def test_a_passage_begins_where_the_hand_was_and_ends_where_it_is() -> None:
    start, stop = postures.relaxed(), np.zeros_like(postures.relaxed())
    passage = Passage(2.0, start, quat.about(2, 0.5))
    shown = [passage.at(2.0 + k * PICTURE, stop, quat.IDENTITY) for k in range(60)]
    np.testing.assert_allclose(shown[0][0], start)
    np.testing.assert_array_equal(shown[-1][0], stop)
    steps = [np.abs(b - a).max() for (a, _), (b, _) in pairwise(shown)]
    assert max(steps) < 2.0 * np.abs(stop - start).max() * PICTURE / PASSAGE
    turns = [float(quat.angle(quat.relative(a, b))) for (_, a), (_, b) in pairwise(shown)]
    assert 0.0 < max(turns) < 2.0 * 0.5 * PICTURE / PASSAGE


def test_the_hand_does_not_jump_when_it_begins_to_be_followed(
    scene: HandScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, drawn = [0.0], list[Array]()
    monkeypatch.setattr(scene, "_clock", lambda: now[0])
    flat = np.zeros_like(postures.relaxed())
    scene.show(flat, quat.about(0, 0.1), followed=False)
    now[0] = 10.0
    scene.show(flat, quat.about(0, 0.1), followed=False)
    bent = flat.copy()
    bent[JOINT["index_pip"], 0] = 40 * DEG
    for _ in range(90):
        now[0] += PICTURE
        scene.show(bent, quat.about(2, 1.2))
        drawn.append(scene._shown[0])
    assert max(np.abs(b - a).max() for a, b in pairwise(drawn)) < 2.5 * DEG
    np.testing.assert_array_equal(drawn[-1], bent)
