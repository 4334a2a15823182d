"""Joints that were bent in the initial pose, by gravity in all sensors."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.finger_ekf.pose_error import bent_joints, pose_inference
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand.anatomy import FINGERS, FLEXION, IS_DOF, JOINT, SEGMENT, SEGMENTS
from handscope.estimators.recording_checks.pose_gravity import LEAST
from tests.estimators.finger_ekf.test_pose_inference import angles_of, taken
from tests.schedule import swept
from tests.simulated import DEG

PARAMS = SensorToSegmentParams()
CURLED = [f"{f}_{level}" for f in FINGERS[1:] for level in ("mcp", "pip", "dip")]


@pytest.mark.parametrize("people", swept([20, 60], kept=[20]))
@pytest.mark.parametrize(("misaligned", "missed"), [(4.5, 3.0), (4.5, 5.0), (10.0, 3.0)])
def test_poses_that_are_merely_missed_have_no_bent_joints(
    misaligned: float, missed: float, people: int, rng: np.random.Generator
) -> None:
    """How seldom they have, by size: docs/decisions/0014-bent-joints.py."""
    poses = [taken(rng, misaligned * DEG, missed * DEG * IS_DOF)[0] for _ in range(people)]
    assert [bent_joints.find(PARAMS, c) for c in poses] == [()] * people


@pytest.mark.parametrize("joint", ["index_pip", "ring_mcp"])
def test_a_finger_that_cannot_be_straightened_is_mostly_named(
    joint: str, rng: np.random.Generator
) -> None:
    off, named = [], []
    for _ in range(40):
        calibration, truth, _ = taken(rng, bent={joint: 35 * DEG})
        found = {b.joint: b for b in bent_joints.find(PARAMS, calibration)}
        named += [j for j, b in found.items() if abs(b.angle) > LEAST]
        if joint in found:
            taken_as = angles_of(bent_joints.with_bent(calibration, tuple(found.values())))
            off.append((taken_as - truth)[JOINT[joint], FLEXION])
    assert len(off) > 25
    assert named.count(joint) > 0.9 * len(named)
    assert np.sqrt(np.mean(np.square(off))) < 8 * DEG


def test_a_hand_that_was_curled_is_inferred_with_honest_standard_deviations(
    rng: np.random.Generator,
) -> None:
    told, normalised, off = 0, [], []
    for _ in range(30):
        calibration, truth, _ = taken(rng, bent=dict.fromkeys(CURLED, 20 * DEG))
        bent = bent_joints.find(PARAMS, calibration)
        told += bool(bent)
        if bent:
            pose_sd, known = bent_joints.pose_angles_sd(PARAMS, calibration, bent)
            inferred, P = pose_inference.infer(
                bent_joints.with_bent(calibration, bent), 4.5 * DEG, pose_sd, 0.3 * DEG, known
            )
            sd = np.sqrt(np.diag(P)[pose_inference.MOUNTINGS :]).reshape(-1, 3)
            at = [JOINT[b.joint] for b in bent]
            off.append((angles_of(inferred) - truth)[at, FLEXION])
            normalised.append((off[-1] / sd[at, FLEXION]) ** 2)
    assert told > 20
    assert np.sqrt(np.mean(np.concatenate(off) ** 2)) < 9 * DEG
    assert 0.5 < np.mean(np.concatenate(normalised)) < 2.0


def test_a_sensor_that_sits_turned_is_no_bent_joint(rng: np.random.Generator) -> None:
    """It alone sees another gravity, beyond a bent joint all sensors do."""
    misaligned = np.full((len(SEGMENTS), 1), 4.5 * DEG)
    misaligned[SEGMENT["index_middle"]] = 40.0 * DEG
    poses = [taken(rng, misaligned)[0] for _ in range(30)]
    told = [b for c in poses for b in bent_joints.find(PARAMS, c) if abs(b.angle) > LEAST]
    assert len(told) <= 1


def test_a_joint_that_was_measured_is_not_asked(rng: np.random.Generator) -> None:
    for _ in range(20):
        calibration, _, _ = taken(rng, bent={"index_pip": 40 * DEG})
        known = replace(calibration, pose_sd={"index_pip": (1.0 * DEG, np.nan, np.nan)})
        assert "index_pip" not in {b.joint for b in bent_joints.find(PARAMS, known)}
