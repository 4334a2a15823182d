"""The axis and sign of a finger's first flexion, from the pose on: where the hand moves meanwhile, the sign is not known."""

import numpy as np
import pytest

from handscope.estimators.alignment.mounting_checks import _flexion_axis, _WornSensor
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics import quaternions as quat

T = np.arange(1000) / 100.0
Z = np.array([0.0, 0.0, 1.0])
SHARES = dict(zip(CHAINS["index"], (0.3, 0.7, 1.0)))  # of a finger's bending, by segment


def pulse(start: float) -> np.ndarray:
    """A rate (n,) rad/s that turns by 1.6 rad within a second."""
    u = T - start
    return 1.6 * (1 - np.cos(2 * np.pi * u)) * ((u > 0) & (u < 1))


def worn(bending: np.ndarray, hand: np.ndarray) -> dict[str, _WornSensor]:
    """Sensors whose axes are those of their segments; rates about z of the bending finger and of the hand."""
    rates = {"hand": hand, **{s: hand + share * bending for s, share in SHARES.items()}}
    return {
        name: _WornSensor(
            quat.IDENTITY, quat.IDENTITY, np.array([1.0, 0.0, 0.0]), T, rate[:, None] * Z
        )
        for name, rate in rates.items()
    }


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_finger_that_bends_first_shows_its_axis_with_the_sign(sign: float) -> None:
    axis = _flexion_axis("index_distal", worn(sign * (pulse(1.0) - pulse(4.0)), np.zeros(1000)))
    np.testing.assert_allclose(axis, sign * Z, atol=1e-9)


def test_a_finger_that_bent_while_the_hand_moved_shows_no_sign() -> None:
    """It straightens when the hand rests again: that must not look as if it bent backward."""
    sensors = worn(pulse(1.0) - pulse(4.0), 0.8 * pulse(1.0))
    assert _flexion_axis("index_distal", sensors) is None


def test_a_little_movement_of_the_hand_leaves_the_sign() -> None:
    sensors = worn(pulse(3.0) - pulse(6.0), 0.15 * pulse(1.0))
    axis = _flexion_axis("index_distal", sensors)
    np.testing.assert_allclose(axis, Z, atol=1e-9)


def test_a_finger_that_is_lifted_first_shows_no_sign() -> None:
    """As one that taps: 26 deg of hyperextension."""
    sensors = worn(0.28 * (pulse(4.0) - pulse(1.0)), np.zeros(1000))
    assert _flexion_axis("index_distal", sensors) is None


def test_a_fist_that_is_made_as_the_hand_rises_shows_no_sign() -> None:
    """The finger keeps its direction in space meanwhile, and straightens when the hand rests."""
    sensors = worn(pulse(1.0) - pulse(4.0), -0.85 * pulse(1.0))
    assert _flexion_axis("index_distal", sensors) is None


def test_a_slow_turn_of_the_hand_is_no_extension() -> None:
    slow = 0.2 * (T > 4)  # rad/s: as slow as a hand that rests
    sensors = worn(0.3 * (pulse(1.0) - pulse(2.5)), -slow)
    assert _flexion_axis("index_distal", sensors) is None
