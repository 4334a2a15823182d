"""A real hand's motion from markers: found again where it is known, plausible where it was captured."""

from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import IS_DOF, JOINTS, LIMITS, SEGMENT, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation import kinematics
from handscope.estimators.simulation.motion import COORDINATES, make_posture, move_through
from handscope.estimators.simulation.movements import optical_capture, task_performance
from handscope.estimators.simulation.movements.optical_capture import CapturedMotion, Markers
from handscope.sessions.formats.qualisys import read_markers
from tests.simulated import DEG

PILLOW = Path(__file__).parents[1] / "pillow_grasp.tsv.gz"


@pytest.fixture(scope="module")
def pillow() -> CapturedMotion:
    return optical_capture.fit_markers(read_markers(PILLOW), "right")


def _markers(hand: Hand) -> tuple[Markers, np.ndarray]:
    """A simulated hand with markers where the fit believes them, bending and spreading; and all its joint angles."""
    geometry, sign = sized(hand), 1.0 if hand == "left" else -1.0
    bent = make_posture(
        task_performance.relaxed(),
        **{
            f"{f}_{j}_flexion": a
            for f in ("index", "middle", "ring", "little")
            for j, a in (("mcp", 55), ("pip", 60), ("dip", 36))
        },
    )
    lifted = make_posture(
        bent,
        wrist_x=0.1,
        wrist_z=0.1,
        wrist_flexion=-20.0,
        forearm_flexion=15.0,
        forearm_deviation=10.0,
    )
    k = kinematics.compute_kinematics(
        move_through([(0.0, task_performance.relaxed()), (2.0, bent), (4.0, lifted)]),
        geometry,
        np.linspace(0.0, 4.0, 81),
    )

    def carried(segment: str, dorsal: float, along: float, ulnar: float = 0.0) -> np.ndarray:
        s = SEGMENT[segment]
        return k.p[:, s] + quat.rotate(k.q_GB[:, s], sign * np.array([dorsal, along, ulnar]))

    back = np.stack(
        [
            carried("hand", 0.02, -0.02),
            carried("hand", 0.02, -0.05, 0.02),
            carried("hand", 0.02, -0.05, -0.02),
        ],
        axis=1,
    )
    fingers = [
        [
            carried(
                f"{f}_proximal", optical_capture.DORSAL[0], -0.2 * geometry.lengths[f"{f}_proximal"]
            ),
            carried(
                f"{f}_distal", optical_capture.DORSAL[1], -0.2 * geometry.lengths[f"{f}_distal"]
            ),
        ]
        for f in ("thumb", "index", "middle", "ring", "little")
    ]
    elbow = carried("forearm", 0.0, -0.25)
    return Markers(k.t, back, elbow, np.moveaxis(np.array(fingers), 2, 0)), k.angles


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_known_motion_is_followed(hand: Hand) -> None:
    markers, angles = _markers(hand)
    found = optical_capture.fit_markers(markers, hand)
    assert np.sqrt(np.mean(found.misfit**2)) < 3e-3
    for joint in ("index_mcp", "middle_pip", "wrist"):
        flexion = found.x[:, COORDINATES[f"{joint}_flexion"]]
        true = angles[:, [j.name for j in JOINTS].index(joint), 0]
        assert np.corrcoef(flexion, true)[0, 1] > 0.98
        assert np.ptp(flexion) == pytest.approx(np.ptp(true), rel=0.25)


def test_the_captured_markers_are_followed_within_what_a_glove_moves(
    pillow: CapturedMotion,
) -> None:
    assert np.sqrt(np.nanmean(pillow.misfit**2)) < 8e-3


def test_a_finger_with_a_hidden_marker_is_not_known(pillow: CapturedMotion) -> None:
    hidden = np.isnan(pillow.misfit).any(axis=2)
    assert hidden.any()
    flexion = pillow.x[
        :,
        [
            COORDINATES[f"{j}_flexion"]
            for j in ("thumb_mcp", "index_mcp", "middle_mcp", "ring_mcp", "little_mcp")
        ],
    ]
    np.testing.assert_array_equal(np.isnan(flexion), hidden)


def test_captured_motion_is_a_performance_within_the_permitted_ranges(
    pillow: CapturedMotion,
) -> None:
    done = optical_capture.performance(pillow, "pillow", 2.5, 19.0)
    (event,) = done.events
    assert event.duration == pytest.approx(17.5)
    t = np.arange(0.0, done.motion.duration, 0.01)
    x, dx, _ = done.motion.at(t)
    angles = x[:, 6:].reshape(-1, len(JOINTS), 3)
    assert (angles >= LIMITS[..., 0] - 0.5 * DEG)[:, IS_DOF].all()
    assert (angles <= LIMITS[..., 1] + 0.5 * DEG)[:, IS_DOF].all()
    np.testing.assert_allclose(angles[:, ~IS_DOF], 0.0, atol=1e-9)
    assert 0.5 < np.abs(dx[:, 6:]).max() < 6.0  # a reach and a grasp at everyday speed
    assert np.ptp(x[:, :3], axis=0).max() > 0.1
