"""The arc that is drawn at a joint spans the angle that is measured there; its number says it."""

import numpy as np
import pytest

from handscope.app.scene.angle_arc import Measured, _lines
from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.hand.anatomy import ANGLES, HANDS, JOINT, JOINTS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics.typing import Array


def bent(joint: str, angle: str, degrees: float) -> Array:
    angles = np.zeros((len(JOINTS), 3))
    angles[JOINT["index_mcp"], 0] = 0.3
    angles[JOINT[joint], ANGLES.index(angle)] = np.radians(degrees)
    return angles


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize(
    ("what", "degrees"),
    [
        ("index_pip_flexion", 63.0),
        ("thumb_ip_flexion", 40.0),
        ("little_mcp_deviation", 25.0),
        ("wrist_flexion", -50.0),
    ],
)
def test_the_arc_spans_the_angle(hand: Hand, what: str, degrees: float) -> None:
    joint, _, name = what.rpartition("_")
    drawn = _lines(Measured(what), bent(joint, name, degrees), sized(hand))
    assert drawn is not None and drawn.rays is not None
    one, other = (ray[1] - ray[0] for ray in drawn.rays)
    spanned = np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))
    assert spanned == pytest.approx(abs(degrees), abs=0.1)
    assert drawn.text == f"{degrees:.0f}°"
    flat = _lines(Measured(what), bent(joint, name, -0.2), sized(hand))
    assert flat is not None and flat.text == "0°"


def test_a_tapping_task_draws_the_line_between_the_tips_and_a_turn_of_the_forearm_nothing() -> None:
    drawn = _lines(Measured("aperture"), bent("index_pip", "flexion", 20), sized("left"))
    assert drawn is not None and drawn.text.endswith(" mm")
    assert _lines(Measured("palm_turn"), bent("index_pip", "flexion", 20), sized("left")) is None


def test_a_mirrored_picture_has_no_number_in_it(scene: HandScene) -> None:
    scene.show(bent("index_pip", "flexion", 63), None)
    scene.measure(Measured("index_pip_flexion", (1.5, 1.7)))
    assert scene._arc is not None and scene._arc._number.visible and scene._arc._band.visible
    scene.mirror(True)
    assert not scene._arc._number.visible and scene._arc._arc.visible
    scene.mirror(False)
    scene.measure(None)
    assert not scene._arc._arc.visible
