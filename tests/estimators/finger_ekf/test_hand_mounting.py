"""What the fingers learn of the hand sensor's mounting helps thumb and wrist, and is not counted twice."""

import numpy as np

from handscope.estimators.finger_ekf.between_chains import hand_mounting
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
PRIOR, SEEN, AXIS = 4.5 * DEG, 1.0 * DEG, 2.0 * DEG
THUMB, WRIST = 0, 1  # of RECEIVERS
OF_THUMB = slice(ERROR.q_SB, ERROR.q_SB + 3)
KNOWN = np.ones((6, 3), bool)


def test_fingers_that_learnt_nothing_tell_nothing() -> None:
    q_SB, P = _chains(np.zeros((6, 3)), np.full(6, PRIOR))
    shared = hand_mounting.begin(0.0, q_SB, P)
    information, vector = hand_mounting.gained_since(shared, q_SB, P, KNOWN, AXIS)
    assert not information.any()
    shared, thumb = hand_mounting.report(shared, 5.0, THUMB, _chain(), information, vector)
    np.testing.assert_array_equal(thumb.P, _chain().P)
    assert not shared.reported.any()


def test_thumb_and_wrist_know_the_mounting_better_and_as_well_as_they_say() -> None:
    """Half of the variance of what a finger sees is the hand sensor's own and in all of them; each has an axis of its own."""
    rng, errors, squares = np.random.default_rng(5), [], []
    for _ in range(400):
        truth = PRIOR * rng.normal(size=3)
        common, own, axes = rng.normal(size=3), rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
        seen = truth + SEEN * np.sqrt(0.5) * (common + own) + AXIS * axes
        gain = PRIOR**2 / (PRIOR**2 + SEEN**2)
        before = hand_mounting.begin(0.0, *_chains(np.zeros((6, 3)), np.full(6, PRIOR)))
        mountings = np.vstack([np.zeros(3), gain * seen, np.zeros(3)])
        now = _chains(mountings, np.array([PRIOR, *[PRIOR * np.sqrt(1 - gain)] * 4, PRIOR]))
        found = hand_mounting.gained_since(before, *now, KNOWN, AXIS)
        _, thumb = hand_mounting.report(before, 5.0, THUMB, _chain(), *found)
        off = quat.log(thumb.q_SB[0]) - truth
        errors.append(off @ off / 3)
        squares.append(off @ np.linalg.solve(thumb.P[OF_THUMB, OF_THUMB], off) / 3)
    assert np.sqrt(np.mean(errors)) < 1.6 * DEG
    assert 0.7 < np.mean(squares) < 1.3


def test_what_is_told_piece_by_piece_is_told_once() -> None:
    mountings = np.vstack([np.zeros(3), DEG * np.array([[3.0, 1.0, 0.0]] * 4), np.zeros(3)])
    first = _chains(np.zeros((6, 3)), np.full(6, PRIOR))
    middle = _chains(0.6 * mountings, np.full(6, 0.7 * PRIOR))
    last = _chains(mountings, np.full(6, 0.3 * PRIOR))
    begun = hand_mounting.begin(0.0, *first)
    once = hand_mounting.gained_since(begun, *last, KNOWN, AXIS)
    _, expected = hand_mounting.report(begun, 10.0, WRIST, _chain(sensor=1), *once)
    shared, wrist = begun, _chain(sensor=1)
    for t, now in ((5.0, middle), (10.0, last), (15.0, last)):
        found = hand_mounting.gained_since(shared, *now, KNOWN, AXIS)
        shared, wrist = hand_mounting.report(shared, t, WRIST, wrist, *found)
    np.testing.assert_allclose(wrist.P, expected.P, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(wrist.q_SB, expected.q_SB, atol=1e-4 * DEG)


def test_fingers_of_which_only_the_mounting_has_walked_tell_nothing() -> None:
    """Beside it a chain that has received something keeps of that what the walk leaves."""
    walk, walked = 0.1 * DEG, (0.1 * DEG) ** 2 * 30.0 * np.diag([1.0, 1.0, 0.0])
    q_SB, P = _chains(np.zeros((6, 3)), np.full(6, SEEN))
    received, mean = np.diag([4.0, 2.0, 1.0]) / SEEN**2, DEG * np.array([1.0, 2.0, 3.0])
    shared = hand_mounting.begin(0.0, q_SB, P)._replace(
        reported=np.stack([received, np.zeros((3, 3))]),
        reported_vector=np.stack([received @ mean, np.zeros(3)]),
    )
    shared = hand_mounting.aged(shared, 30.0, walk)
    P[:, OF_THUMB, OF_THUMB] += walked
    information, _ = hand_mounting.gained_since(shared, q_SB, P, KNOWN, AXIS)
    np.testing.assert_allclose(information * SEEN**2, 0.0, atol=1e-7)
    expected = np.linalg.inv(np.linalg.inv(received) + walked)
    np.testing.assert_allclose(shared.reported[THUMB], expected)
    np.testing.assert_allclose(shared.reported_vector[THUMB], expected @ mean)
    assert not shared.reported[WRIST].any()


def test_fingers_that_differ_tell_less() -> None:
    begun = hand_mounting.begin(0.0, *_chains(np.zeros((6, 3)), np.full(6, PRIOR)))
    alike, apart = (
        hand_mounting.gained_since(begun, *_chains(mountings, np.full(6, SEEN)), KNOWN, AXIS)[0]
        for mountings in (
            np.zeros((6, 3)),
            DEG
            * np.array(
                [[0.0] * 3, [6.0, 0, 0], [-6.0, 0, 0], [6.0, 0, 0], [-6.0, 0, 0], [0.0] * 3]
            ),
        )
    )
    assert apart[0, 0] < 0.3 * alike[0, 0]


def test_a_finger_without_sensors_is_not_heard() -> None:
    q_SB, P = _chains(np.zeros((6, 3)), np.full(6, PRIOR))
    begun = hand_mounting.begin(0.0, q_SB, P)
    known = KNOWN.copy()
    known[1:5] = False
    moved = _chains(np.full((6, 3), DEG), np.full(6, SEEN))
    assert not hand_mounting.gained_since(begun, *moved, known, AXIS)[0].any()


def _chains(mountings: Array, sd: Array) -> tuple[Array, Array]:
    """q_SB (6, 4, 4) with the hand's sensor so in the fingers, P (6, 43, 43)."""
    q_SB, P = np.tile(quat.IDENTITY, (6, 4, 1)), np.zeros((6, SIZE, SIZE))
    q_SB[:, 0] = quat.exp(mountings)
    P[:, OF_THUMB, OF_THUMB] = sd[:, None, None] ** 2 * np.eye(3)
    return q_SB, P


def _chain(sensor: int = 0) -> Estimates:
    """One that knows nothing but the prior."""
    P, own = np.zeros((SIZE, SIZE)), ERROR.q_SB + 3 * sensor + np.arange(3)
    P[own, own] = PRIOR**2
    return Estimates(
        np.tile(quat.IDENTITY, (3, 1)),
        np.zeros((4, 3)),
        np.tile(quat.IDENTITY, (4, 1)),
        np.zeros((3, 3)),
        np.zeros(2),
        P,
    )
