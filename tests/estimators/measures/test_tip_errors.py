"""Tips that are apart by a known way, a wrist that is where it is, and frames that are brought together."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.measures.tip_errors import (
    centre_of_rotation,
    tip_errors,
    transform_places,
)

T = np.arange(0, 20, 0.02)
WRIST = np.array([1.2, -0.4, 0.9])
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7])


def moving(seed: int = 0) -> np.ndarray:
    """Tips (n, fingers, 3) of a hand in the wrist's frame."""
    rng = np.random.default_rng(seed)
    phase, rate = rng.uniform(0, 6, (len(FINGERS), 3)), rng.uniform(1, 4, (len(FINGERS), 3))
    return (
        np.array([0.0, 0.16, 0.0])
        + rng.normal(scale=0.03, size=(len(FINGERS), 3))
        + 0.03 * np.sin(rate * T[:, None, None] + phase)
    )


def swung(sideways: float) -> np.ndarray:
    """The tips of a stiff hand in the optical system's frame while the wrist moves; 0.5 mm noise."""
    turns = Rotation.from_euler(
        "zx", np.stack([0.5 * np.sin(2 * T), sideways * np.sin(1.3 * T)], axis=1)
    )
    tips = np.stack(
        [turns.apply([0.02 * k, 0.16 + 0.01 * k, 0.0]) for k in range(len(FINGERS))], axis=1
    )
    return (
        WRIST
        + TURN.apply(tips.reshape(-1, 3)).reshape(tips.shape)
        + np.random.default_rng(1).normal(scale=5e-4, size=tips.shape)
    )


def test_a_known_way_apart_is_told_along_each_axis() -> None:
    a, off = moving(), np.array([0.003, -0.004, 0.012])
    b = a + off * np.where(T < 10, 1.0, -1.0)[:, None, None]
    b[::7, 2] = np.nan
    found = tip_errors(a, b)
    assert [e.finger for e in found] == list(FINGERS)
    assert found[2].samples == len(T) - len(T[::7])
    for e in found:
        assert (e.mean, e.rmse, e.largest, e.sd) == pytest.approx(
            (0.013, 0.013, 0.013, 0.0), abs=1e-9
        )
        np.testing.assert_allclose(e.parts, np.abs(off))


def test_the_wrist_is_found_by_its_movement_and_then_all_errors_remain() -> None:
    centre = centre_of_rotation(swung(0.4))
    np.testing.assert_allclose(centre, WRIST, atol=1e-3)
    a, off = moving(), np.array([0.0, 0.008, 0.0])  # ours has all fingers 8 mm too short
    b = WRIST + TURN.apply((a + off).reshape(-1, 3)).reshape(a.shape)
    np.testing.assert_allclose(
        [e.rmse for e in tip_errors(a, transform_places(b, a, WRIST))], 0.008, atol=1e-3
    )
    assert (
        max(e.rmse for e in tip_errors(a, transform_places(b, a))) < 1e-9
    )  # a shift is taken away where the wrist is not known


def test_a_wrist_that_only_bends_or_rests_does_not_tell_its_centre() -> None:
    for sideways, rest in ((0.0, 1.0), (0.4, 0.0)):
        places = swung(sideways)
        places = places[:1] + rest * (places - places[:1])
        with pytest.raises(InputError, match="the wrist's centre cannot be told"):
            centre_of_rotation(places)
    with pytest.raises(InputError, match="no fingertip is seen"):
        centre_of_rotation(np.full((100, 5, 3), np.nan))
