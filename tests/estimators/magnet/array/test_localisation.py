"""A magnet among magnetometers without inertial sensors: the truth found from the simulator's field, honest, flagged where it cannot be."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array import localisation as localisation
from handscope.estimators.magnet.model import setup as setup
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.magnetic_field import MagneticField

NOISE, SIZE, FIELD = 0.2e-6, 0.32, np.array([0.0, 18.6e-6, -46.2e-6])
PLACES = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.12, 0], [0.1, 0.12, 0.03]])
ARRAY = setup.make_constellation(
    PLACES, quat.exp(np.array([[0, 0, 0], [0.3, 0, 0], [0, 0, -1.0], [0, 2.0, 0]]))
)


def _seen(
    n: int, seed: int, nearest: float = 0.1, farthest: float = 0.25
) -> tuple[Array, Array, Array]:
    """Readings (n, 4, 3) of a magnet in front of the array, its places and moments."""
    rng = np.random.default_rng(seed)
    toward = rng.normal(size=(n, 3)) * [1, 1, 0.5] + [0, 0, 2.0]
    p = PLACES.mean(axis=0) + toward / np.linalg.norm(toward, axis=1, keepdims=True) * rng.uniform(
        nearest, farthest, (n, 1)
    )
    m = rng.normal(size=(n, 3))
    m *= SIZE / np.linalg.norm(m, axis=1, keepdims=True)
    B = np.array(
        [MagneticField(FIELD, a[None], b[None]).at(PLACES) for a, b in zip(p, m)]
    ) + NOISE * rng.normal(size=(n, 4, 3))
    return quat.rotate(quat.conjugate(ARRAY.q_bl), B), p, m


@pytest.mark.parametrize("field", [None, FIELD])
def test_place_and_moment_are_found_with_honest_standard_deviations(field: Array | None) -> None:
    mag, p, m = _seen(300, 1)
    found = localisation.locate(mag, ARRAY, field, SIZE, noise=NOISE)
    assert found.is_located.mean() > (0.6 if field is None else 0.8)
    ok = found.is_located
    off = np.linalg.norm(found.place - p, axis=1)[ok]
    assert np.median(off) < 0.004 and np.quantile(off, 0.95) < 0.03
    square = (((found.place - p) / found.place_sd) ** 2)[ok]
    assert 0.7 < np.median(square) / 0.455 < 1.4  # of a chi square with one degree of freedom
    assert np.median(np.linalg.norm(found.moment - m, axis=1)[ok]) < 0.05 * SIZE


def test_two_magnets_are_not_taken_for_one() -> None:
    one, _, _ = _seen(100, 2, 0.1, 0.15)
    other, _, _ = _seen(100, 3, 0.1, 0.15)
    both = (
        one + other - quat.rotate(quat.conjugate(ARRAY.q_bl), np.broadcast_to(FIELD, (100, 4, 3)))
    )
    assert localisation.locate(both, ARRAY, None, SIZE, noise=NOISE).is_located.mean() < 0.1


def test_errors_of_the_magnetometers_places_and_of_the_moment_told_are_counted() -> None:
    """Places a millimetre off, the moment told 4 % too large."""
    mag, p, _ = _seen(150, 7, 0.08, 0.15)
    amiss = setup.make_constellation(
        PLACES + 1e-3 * np.random.default_rng(8).normal(size=PLACES.shape), ARRAY.q_bl
    )
    found = localisation.locate(
        mag, amiss, None, 1.04 * SIZE, noise=NOISE, size_sd=0.03, regions=3, place_sd=1e-3
    )
    square = (((found.place - p) / found.place_sd) ** 2)[found.is_located]
    assert found.is_located.mean() > 0.7 and 0.5 < square.mean() < 1.5


def test_three_magnetometers_and_no_moment_find_nothing() -> None:
    """Nine readings and nine unknowns: other places explain them as exactly."""
    mag, p, _ = _seen(60, 9, 0.08, 0.15)
    three = setup.make_constellation(PLACES[:3], ARRAY.q_bl[:3])
    assert not localisation.locate(mag[:, :3], three, noise=NOISE).is_located.any()
    told = localisation.locate(mag[:, :3], three, None, SIZE, noise=NOISE, size_sd=0.015, regions=3)
    off = np.linalg.norm(told.place - p, axis=1) / np.linalg.norm(told.place_sd, axis=1)
    assert told.is_located.any() and (off[told.is_located] < 4).all()


def test_a_magnet_out_of_reach_is_not_found() -> None:
    mag, _, _ = _seen(50, 4, 1.5, 2.0)
    assert not localisation.locate(mag, ARRAY, None, SIZE, noise=NOISE).is_located.any()


def test_a_missing_reading_is_not_found_and_disturbs_no_other() -> None:
    mag, _, _ = _seen(20, 5)
    whole = localisation.locate(mag, ARRAY, FIELD, SIZE, noise=NOISE)
    mag[3, 1] = np.nan
    holed = localisation.locate(mag, ARRAY, FIELD, SIZE, noise=NOISE)
    assert not holed.is_located[3] and np.isnan(holed.place[3]).all()
    np.testing.assert_allclose(
        np.delete(holed.place, 3, axis=0), np.delete(whole.place, 3, axis=0), atol=1e-9
    )


def test_wrong_units_and_impossible_setups_are_refused() -> None:
    mag, _, _ = _seen(5, 6)
    with pytest.raises(InputError, match="millimetres"):
        setup.make_constellation(PLACES * 1e3)
    with pytest.raises(InputError, match="apart"):
        setup.make_constellation(PLACES * 1e-3)
    with pytest.raises(InputError, match="uT"):
        localisation.locate(mag * 1e6, ARRAY)
    with pytest.raises(InputError, match="normalised"):
        localisation.locate(mag / 50e-6, ARRAY)
    with pytest.raises(InputError, match="cannot tell"):
        localisation.locate(mag[:, :2], setup.make_constellation(PLACES[:2]))
    with pytest.raises(InputError, match="no magnet"):
        setup.make_magnet(np.array([0, 0, 320.0]))
