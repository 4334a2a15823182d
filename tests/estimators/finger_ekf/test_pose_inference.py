"""What gravity in all sensors tells of a pose that was missed."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment.initial_pose import palm_down
from handscope.estimators.data.calibration import Calibration, CalibrationSource
from handscope.estimators.finger_ekf.pose_error import pose_inference
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import FLEXION, IS_DOF, JOINT, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import make_upright
from tests.schedule import swept
from tests.simulated import DEG

MOUNTING_SD, GRAVITY_SD = 4.5 * DEG, 0.3 * DEG
POSE_SD = 2.5 * DEG * IS_DOF
STRAIGHT: Mapping[str, float] = {}
FLEXIONS = [j for j in range(len(JOINTS)) if not JOINTS[j].name.startswith("thumb")]


def taken(
    rng: np.random.Generator,
    mounting_sd: float | Array = MOUNTING_SD,
    pose_sd: Array = POSE_SD,
    bent: Mapping[str, float] = STRAIGHT,
) -> tuple[Calibration, Array, Array]:
    """A calibration that takes a missed pose for a straight hand, and the truth: angles (joints, 3), sensor-to-segment rotations (segments, 4). `bent`: flexion (rad) by joint, beside."""
    angles = pose_sd * rng.normal(size=(len(JOINTS), 3))
    for joint, flexion in bent.items():
        angles[JOINT[joint], FLEXION] += flexion
    tilt = quat.exp(10 * DEG * rng.normal(size=3))
    q_GH = quat.multiply(palm_down("left"), tilt)
    q_GB = forward_kinematics.segments_on(q_GH, joint_angles.compose(angles))
    nominal = quat.normalize(rng.normal(size=(len(SEGMENTS), 4)))  # any way a glove declares
    q_BS = quat.multiply(quat.exp(mounting_sd * rng.normal(size=(len(SEGMENTS), 3))), nominal)
    up = quat.rotate(quat.conjugate(quat.multiply(q_GB, q_BS)), pose_inference.VERTICAL)
    up += GRAVITY_SD * rng.normal(size=up.shape)
    hand = SEGMENT["hand"]
    assumed = make_upright(palm_down("left"), quat.rotate(nominal[hand], up[hand]))
    q_GS = [make_upright(quat.multiply(assumed, n), u) for n, u in zip(nominal, up)]
    found = [quat.relative(assumed, q) for q in q_GS]
    calibration = Calibration(
        "left",
        sized("left"),
        0.0,
        3.0,
        dict(zip(SEGMENTS, q_GS)),
        dict(zip(SEGMENTS, found)),
        {},
        CalibrationSource.POSE,
        nominal=dict(zip(SEGMENTS, nominal)),
    )
    return calibration, angles, q_BS


def angles_of(calibration: Calibration) -> Array:
    """Joint angles (joints, 3) that a calibration takes the hand to have in the pose."""
    q_GB = np.array(
        [quat.multiply(calibration.q_GS[s], quat.conjugate(calibration.q_BS[s])) for s in SEGMENTS]
    )
    return joint_angles.of_segments(q_GB)


@pytest.mark.parametrize("people", swept([20, 60], kept=[20]))
def test_flexion_is_closer_to_the_truth_and_its_standard_deviation_is_honest(
    people: int, rng: np.random.Generator
) -> None:
    before, after, normalised = [], [], []
    for _ in range(people):
        calibration, truth, _ = taken(rng)
        inferred, P = pose_inference.infer(calibration, MOUNTING_SD, POSE_SD, GRAVITY_SD)
        sd = np.sqrt(np.diag(P)[pose_inference.MOUNTINGS :]).reshape(-1, 3)
        off = (angles_of(inferred) - truth)[FLEXIONS, FLEXION]
        before.append(truth[FLEXIONS, FLEXION])
        after.append(off)
        normalised.append((off / sd[FLEXIONS, FLEXION]) ** 2)
    assert np.sqrt(np.mean(np.square(after))) < 0.92 * np.sqrt(np.mean(np.square(before)))
    assert 0.85 < np.mean(normalised) < 1.15


@pytest.mark.parametrize("people", swept([10, 30], kept=[10]))
@pytest.mark.parametrize(("missed", "fixed", "learnt"), [(2.5, 1.0, 1.4), (5.0, 4.0, 2.5)])
def test_a_pose_that_is_missed_by_more_than_the_option_widens_the_standard_deviations(
    missed: float, fixed: float, learnt: float, people: int, rng: np.random.Generator
) -> None:
    """The option is 2 deg; `measured` says that its size is known."""
    pose_sd, normalised = 2.0 * DEG * IS_DOF, ([], [])
    for _ in range(people):
        calibration, truth, _ = taken(rng, pose_sd=missed * DEG * IS_DOF)
        for is_known, found in zip((True, False), normalised):
            inferred, P = pose_inference.infer(
                calibration, MOUNTING_SD, pose_sd, GRAVITY_SD, np.full(pose_sd.shape, is_known)
            )
            sd = np.sqrt(np.diag(P)[pose_inference.MOUNTINGS :]).reshape(-1, 3)
            off = angles_of(inferred) - truth
            found.append(np.mean((off[IS_DOF] / sd[IS_DOF]) ** 2))
    assert np.mean(normalised[0]) > fixed
    assert np.mean(normalised[1]) < learnt


def test_of_sensors_that_sit_as_declared_the_missed_pose_is_found(
    rng: np.random.Generator,
) -> None:
    before, after = [], []
    for _ in range(20):
        calibration, truth, _ = taken(rng, 0.0)
        inferred, _ = pose_inference.infer(calibration, MOUNTING_SD, POSE_SD, 0.01 * DEG)
        before.append(truth[FLEXIONS, FLEXION])
        after.append((angles_of(inferred) - truth)[FLEXIONS, FLEXION])
    assert np.sqrt(np.mean(np.square(after))) < 0.5 * np.sqrt(np.mean(np.square(before)))


def test_a_pose_that_was_measured_is_left_as_it_is(rng: np.random.Generator) -> None:
    calibration, _, _ = taken(rng)
    known = POSE_SD.copy()
    known[JOINT["index_pip"], FLEXION] = 0.01 * DEG
    inferred, _ = pose_inference.infer(calibration, MOUNTING_SD, known, GRAVITY_SD)
    change = np.abs(angles_of(inferred) - angles_of(calibration))[:, FLEXION] / DEG
    assert change[JOINT["index_pip"]] < 0.001 < 0.1 < change[JOINT["index_dip"]]


def test_sensors_still_see_gravity_and_sit_closer_to_how_they_do(rng: np.random.Generator) -> None:
    errors = []
    for _ in range(20):
        calibration, _, q_BS = taken(rng)
        inferred, _ = pose_inference.infer(calibration, MOUNTING_SD, POSE_SD, GRAVITY_SD)
        for s in SEGMENTS:
            up = [
                quat.rotate(quat.conjugate(c.q_GS[s]), pose_inference.VERTICAL)
                for c in (calibration, inferred)
            ]
            np.testing.assert_allclose(up[1], up[0], atol=1e-12)
        errors.append(
            [
                quat.angle(quat.relative(c.q_BS["hand"], q_BS[SEGMENT["hand"]]))
                for c in (calibration, inferred)
            ]
        )
    before, after = np.sqrt(np.mean(np.square(errors), axis=0))
    assert after < 0.9 * before


@pytest.mark.parametrize(
    "change",
    [{"nominal": {}}, {"is_functional": True}, {"q_BS_sd": {"hand": np.ones(3)}}],
    ids=["no nominal mounting", "movements told it", "known from before"],
)
def test_a_mounting_that_was_found_otherwise_is_left_alone(
    change: dict[str, object], rng: np.random.Generator
) -> None:
    calibration, _, _ = taken(rng)
    assert pose_inference.can_infer(calibration)
    assert not pose_inference.can_infer(replace(calibration, **change))
