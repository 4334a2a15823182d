"""What the fingers learn of the hand's gyroscope helps the thumb, and is not counted twice."""

import numpy as np
import pytest

from handscope.estimators.finger_ekf.between_chains import hand_bias
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.between_chains.hand_bias import HAND, Reported
from handscope.estimators.finger_ekf.sensor_to_segment import SIZE
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.schedule import swept

DEG = np.pi / 180
WALK, SPAN = 0.001 * DEG, 5.0
START, NOISE = 0.01 * DEG, 0.03 * DEG  # of a bias, and of what a chain sees of it in a span
NO_REST = np.full((4, 3), np.nan)


def test_fingers_that_saw_nothing_have_nothing_to_tell() -> None:
    """Their bias walked as the thumb's chain itself counts it."""
    bias, P = np.full((4, 3), 0.02 * DEG), np.tile(START**2 * np.eye(3), (4, 1, 1))
    before = Reported(0.0, bias, P, NO_REST)
    walked = Reported(SPAN, bias, P + WALK**2 * SPAN * np.eye(3), NO_REST)
    information, information_vector = hand_bias.gained(before, walked, WALK)
    thumb = _thumb(np.zeros(3))
    assert np.abs(information).max() < 1e-9 / START**2
    np.testing.assert_array_equal(
        hand_bias.corrected(thumb, information, information_vector).P, thumb.P
    )


def test_a_rest_of_the_hand_that_every_chain_saw_is_not_told() -> None:
    P = np.tile(START**2 * np.eye(3), (4, 1, 1))
    before = Reported(0.0, np.zeros((4, 3)), P, NO_REST)
    rested = Reported(SPAN, np.full((4, 3), 0.02 * DEG), 0.1 * P, np.zeros((4, 3)))
    information, information_vector = hand_bias.gained(before, rested, WALK)
    assert not information.any()
    assert not information_vector.any()


@pytest.mark.parametrize("people", swept([100, 300], kept=[100]))
def test_the_thumb_knows_the_bias_better_and_as_well_as_it_says(people: int) -> None:
    """Five minutes. Half of the variance of what a chain sees is the hand sensor's own and in all five chains."""
    rng = np.random.default_rng(3)
    squares: dict[bool, list[float]] = {True: [], False: []}
    errors: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(people):
        truth = START * rng.normal(size=3)
        bias, P = np.zeros((5, 3)), np.tile(START**2 * np.eye(3), (5, 1, 1))
        thumbs = {shared: _thumb(np.zeros(3)) for shared in (True, False)}
        reported = Reported(0.0, bias[1:], P[1:], NO_REST)
        for k in range(1, 61):
            truth = truth + WALK * np.sqrt(SPAN) * rng.normal(size=3)
            common, own = rng.normal(size=3), rng.normal(size=(5, 3))
            seen = truth + NOISE * np.sqrt(0.5) * (common + own)
            P = P + WALK**2 * SPAN * np.eye(3)
            K = P @ np.linalg.inv(P + NOISE**2 * np.eye(3))
            bias = bias + (K @ (seen - bias)[..., None])[..., 0]
            P = P - K @ P
            now = Reported(SPAN * k, bias[1:], P[1:], NO_REST)
            thumbs = {shared: _seen(thumb, seen[0]) for shared, thumb in thumbs.items()}
            thumbs[True] = hand_bias.corrected(thumbs[True], *hand_bias.gained(reported, now, WALK))
            reported = now
        for shared, thumb in thumbs.items():
            off = thumb.bias[0] - truth
            errors[shared].append(off @ off)
            squares[shared].append(off @ np.linalg.solve(thumb.P[HAND, HAND], off) / 3)
    assert np.mean(errors[True]) < 0.8 * np.mean(errors[False])
    assert 0.8 < np.mean(squares[True]) < 1.4


def test_what_was_told_corrects_all_that_goes_with_the_bias() -> None:
    """A joint whose error is the bias's, over a minute, turns back with it."""
    thumb = _thumb(np.zeros(3))
    thumb.P[:3, HAND] = -60.0 * thumb.P[HAND, HAND]
    thumb.P[HAND, :3] = thumb.P[:3, HAND].T
    thumb.P[:3, :3] = 60.0**2 * thumb.P[HAND, HAND] + 1e-8 * np.eye(3)
    bias = np.array([0.0, 0.01, -0.005]) * DEG
    sure = 1e6 / START**2 * np.eye(3)
    after = hand_bias.corrected(thumb, sure, sure @ bias)
    np.testing.assert_allclose(after.bias[0], bias, rtol=1e-4)
    np.testing.assert_allclose(quat.log(after.q_pc[0]), -60.0 * bias, rtol=1e-3, atol=1e-9)
    assert np.linalg.eigvalsh(after.P).min() > -1e-12


@pytest.mark.parametrize("wrong", [0.1 * DEG, 2.0 * DEG])
def test_a_finger_whose_strip_is_faulty_does_not_mislead_the_thumb(wrong: float) -> None:
    """Its own gyroscope jumps after a minute and comes back after another; all fingers are as sure as ever."""
    rng = np.random.default_rng(4)
    bias, P = np.zeros((4, 3)), np.tile(START**2 * np.eye(3), (4, 1, 1))
    thumbs = {faulty: _thumb(np.zeros(3)) for faulty in (True, False)}
    reported = {faulty: Reported(0.0, bias, P, NO_REST) for faulty in (True, False)}
    for k in range(1, 37):
        P = P + WALK**2 * SPAN * np.eye(3)
        K = P @ np.linalg.inv(P + NOISE**2 * np.eye(3))
        bias = bias + (K @ (0.3 * NOISE * rng.normal(size=(4, 3)) - bias)[..., None])[..., 0]
        P = P - K @ P
        for faulty, thumb in thumbs.items():
            shown = bias + faulty * (12 < k <= 24) * np.array([[wrong] * 3, *np.zeros((3, 3))])
            now = Reported(SPAN * k, shown, P, NO_REST)
            gained = hand_bias.gained(reported[faulty], now, WALK)
            thumbs[faulty], reported[faulty] = hand_bias.corrected(thumb, *gained), now
    sd = np.sqrt(np.diag(thumbs[False].P[HAND, HAND]))
    assert (sd < 0.7 * START).all()  # the thumb was told something
    assert (np.abs(thumbs[True].bias[0] - thumbs[False].bias[0]) < 0.3 * sd).all()


def test_fingers_that_disagree_two_by_two_tell_nothing() -> None:
    P = np.tile(START**2 * np.eye(3), (4, 1, 1))
    bias = DEG * np.array([[0.0] * 3, [0.0] * 3, [1.0] * 3, [1.0] * 3])
    assert not hand_bias.find_agreeing(Reported(0.0, bias, P, NO_REST)).any()
    one = DEG * np.array([[0.0] * 3, [0.001] * 3, [1.0] * 3, [0.0] * 3])
    np.testing.assert_array_equal(
        hand_bias.find_agreeing(Reported(0.0, one, P, NO_REST)), [True, True, False, True]
    )


def _thumb(bias: Array) -> Estimates:
    P = np.zeros((SIZE, SIZE))
    P[HAND, HAND] = START**2 * np.eye(3)
    biases = np.zeros((4, 3))
    biases[0] = bias
    return Estimates(
        np.tile(quat.IDENTITY, (3, 1)),
        biases,
        np.tile(quat.IDENTITY, (4, 1)),
        np.zeros((3, 3)),
        np.zeros(2),
        P,
    )


def _seen(thumb: Estimates, bias: Array) -> Estimates:
    """The chain after a span of walking and its own look at the bias."""
    P = thumb.P.copy()
    P[HAND, HAND] += WALK**2 * SPAN * np.eye(3)
    K = P[HAND, HAND] @ np.linalg.inv(P[HAND, HAND] + NOISE**2 * np.eye(3))
    biases = thumb.bias.copy()
    biases[0] += K @ (bias - biases[0])
    P[HAND, HAND] -= K @ P[HAND, HAND]
    return thumb._replace(bias=biases, P=P)
