"""The arc that is drawn at a joint spans the angle that is measured there; its number says it."""

from collections.abc import Callable

import numpy as np
import pytest

from handscope.app.report.words import SIDES
from handscope.app.scene.angle_arc import AGAIN, Measured, _lines
from handscope.app.scene.drawn_line import directions
from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.hand.anatomy import ANGLES, HANDS, JOINT, JOINTS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.app.scene.small_site import eventually


def bent(joint: str, angle: str, degrees: float) -> Array:
    angles = np.zeros((len(JOINTS), 3))
    angles[JOINT["index_mcp"], 0] = 0.3
    angles[JOINT[joint], ANGLES.index(angle)] = np.radians(degrees)
    return angles


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize(
    ("what", "degrees", "words"),
    [
        ("index_pip_flexion", 63.0, "63°"),
        ("thumb_ip_flexion", 40.0, "40°"),
        ("little_mcp_deviation", 25.0, "abd. 25°"),
        ("wrist_flexion", -50.0, "ext. 50°"),
    ],
)
def test_the_arc_spans_the_angle(hand: Hand, what: str, degrees: float, words: str) -> None:
    joint, _, name = what.rpartition("_")
    drawn = _lines(Measured(what), bent(joint, name, degrees), sized(hand))
    assert drawn is not None and drawn.rays is not None
    one, other = (ray[1] - ray[0] for ray in drawn.rays)
    spanned = np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))
    assert spanned == pytest.approx(abs(degrees), abs=0.1)
    assert drawn.text == words
    flat = _lines(Measured(what), bent(joint, name, -0.2), sized(hand))
    assert flat is not None and flat.text == "0°"


@pytest.mark.parametrize("joint", SIDES)
def test_the_sides_at_the_arc_are_those_of_the_report(joint: str) -> None:
    for sign, side in zip((-1.0, 1.0), SIDES[joint]):
        drawn = _lines(
            Measured(f"{joint}_deviation"), bent(joint, "deviation", 8.0 * sign), sized("right")
        )
        assert drawn is not None
        short, degrees = drawn.text.split()
        assert degrees == "8°"
        assert short[:-1] in {part[:3] for part in side.split("_")}


def test_a_tapping_task_draws_the_line_between_the_tips_and_a_turn_of_the_forearm_nothing() -> None:
    drawn = _lines(Measured("aperture"), bent("index_pip", "flexion", 20), sized("left"))
    assert drawn is not None and drawn.text.endswith(" mm")
    assert _lines(Measured("palm_turn"), bent("index_pip", "flexion", 20), sized("left")) is None


def test_the_line_between_the_tips_has_no_bones_but_at_its_ends(scene: HandScene) -> None:
    scene.measure(Measured("aperture"))
    scene.show(bent("index_pip", "flexion", 20), None)
    assert scene._arc is not None and scene._arc._span.visible and not scene._arc._arc.visible
    assert scene._arc._span.points == 2
    scene.measure(None)
    assert not scene._arc._span.visible


def test_the_number_is_written_seldom_and_its_last_value_always(
    scene: HandScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.measure(Measured("index_pip_flexion"))
    arc, waiting = scene._arc, list[tuple[float, Callable[[], None]]]()
    assert arc is not None
    scene.measure(None)
    eventually(lambda: arc._has_waited)  # since what was written until now
    arc._number.text = ""
    with monkeypatch.context() as held:
        held.setattr(arc, "_later", lambda s, write: waiting.append((s, write)))
        scene.show(bent("index_pip", "flexion", 20), None)
        scene.measure(Measured("index_pip_flexion"))
        for degrees in range(21, 64):
            scene.show(bent("index_pip", "flexion", degrees), None)
        assert arc._number.text == "20°"
        [(pause, write_again)] = waiting
        assert pause == AGAIN
        write_again()
        assert arc._number.text == "63°" and len(waiting) == 2
        waiting[1][1]()
        assert arc._number.text == "63°" and len(waiting) == 2  # nothing new, so none waits
    for degrees in (30, 31):  # at once, and by the scene's own clock
        scene.show(bent("index_pip", "flexion", degrees), None)
    eventually(lambda: arc._number.text == "31°")
    scene.measure(None)


@pytest.mark.parametrize(
    "points",
    [
        np.linspace([0.1, 0.2, 0.3], [0.5, -0.2, 0.1], 13),
        np.column_stack(
            [np.cos(np.linspace(0, 1.9, 13)), np.sin(np.linspace(0, 1.9, 13)), np.ones(13)]
        ),
        np.zeros((13, 3)),
    ],
    ids=["straight", "an arc", "a point"],
)
def test_sections_of_a_line_are_square_to_it_and_not_twisted(points: Array) -> None:
    wxyz = directions(points)
    across, _, along = (quat.rotate(wxyz, axis) for axis in np.eye(3))
    chords = np.diff(points, axis=0)
    assert (np.sum(along[:-1] * chords, axis=1) >= 0.9 * np.linalg.norm(chords, axis=1)).all()
    np.testing.assert_allclose(np.linalg.norm(wxyz, axis=1), 1.0, atol=1e-9)
    assert (np.sum(across[:-1] * across[1:], axis=1) > 0.95).all()


def test_a_mirrored_picture_has_no_number_in_it(scene: HandScene) -> None:
    scene.show(bent("index_pip", "flexion", 63), None)
    scene.measure(Measured("index_pip_flexion", (1.5, 1.7)))
    assert scene._arc is not None and scene._arc._number.visible and scene._arc._band.visible
    scene.mirror(True)
    assert not scene._arc._number.visible and scene._arc._arc.visible
    scene.mirror(False)
    scene.measure(None)
    assert not scene._arc._arc.visible
