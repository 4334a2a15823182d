"""What one magnet without length in an even field leaves of readings: slopes of the field are told from noise and counted, so is a magnet's length."""

import numpy as np
import pytest

from handscope.estimators.magnet.array import dipole_fit, field_gradient_test, systematic_errors
from handscope.estimators.magnet.array.recording_localisation import (
    LocalisationResult,
    locate_recording,
)
from handscope.estimators.magnet.array.search import Search
from handscope.estimators.magnet.model import setup as setup
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.magnetic_field import MagneticField

NOISE, FIELD = 0.2e-6, np.array([0.0, 18.6e-6, -46.2e-6])
NINE = np.array([[x, y, 0.0] for x in (-0.05, 0.0, 0.05) for y in (-0.05, 0.0, 0.05)])
FIVE = np.array(
    [
        [-0.08, -0.08, 0.0],
        [0.08, -0.08, 0.0],
        [-0.08, 0.08, 0.0],
        [0.08, 0.08, 0.0],
        [0.0, 0.0, 0.0],
    ]
)
GRADIENT = 20e-6 * np.array([[0.9, 0.4, 0.6], [0.4, 0.2, -0.5], [0.6, -0.5, -1.1]])  # T/m


def _searched(
    places: Array,
    nearest: float,
    gradient: Array,
    length: float,
    elsewhere: float = 0.0,
    gain: float = 0.0,
    turn: float = 0.0,
) -> tuple[LocalisationResult, Array]:
    """What is found of a magnet of that length that goes round before the array, and where it was; magnetometers sit `elsewhere` m from where they are told, and
    the axes of all are turned by `turn` rad against the board."""
    rng, t = np.random.default_rng(len(places)), np.arange(40) / 10
    p = np.column_stack(
        [0.04 * np.cos(3 * t), 0.04 * np.sin(2 * t), nearest * (1.4 + 0.4 * np.sin(1.3 * t))]
    )
    along = np.column_stack([np.cos(t), np.sin(t), np.ones(len(t))]) / np.sqrt(2.0)
    parts = length * np.linspace(-0.5, 0.5, 9)
    made = np.random.default_rng(3)
    off, gains = (
        elsewhere * made.normal(size=places.shape),
        1 + gain * made.normal(size=places.shape),
    )
    B = np.array(
        [
            [MagneticField(FIELD, (a + s * u)[None], 0.4 * u[None]).at(places + off) for s in parts]
            for a, u in zip(p, along)
        ]
    ).mean(axis=1)
    B = quat.rotate(quat.exp(turn * np.array([0.6, 0.0, 0.8])), B)
    mag = gains * B + places @ gradient + NOISE * rng.normal(size=B.shape)
    search = Search(t, mag, setup.make_constellation(places), 1.5 * NOISE, 5e-4)
    return locate_recording(search, None, 0.03, NOISE), p


@pytest.mark.parametrize(
    ("places", "nearest", "gradient", "length"),
    [(NINE, 0.08, GRADIENT, 0.0), (FIVE, 0.04, 0 * GRADIENT, 0.03)],
)
def test_places_stay_honest_where_the_field_changes_or_the_magnet_is_long(
    places: Array, nearest: float, gradient: Array, length: float
) -> None:
    found, p = _searched(places, nearest, gradient, length)
    ok = found.localisation.is_located
    assert ok.mean() > 0.3
    assert (((found.localisation.place - p) / found.localisation.place_sd)[ok] ** 2).mean() < 1.5
    if length == 0.0:
        np.testing.assert_allclose(
            field_gradient_test.rms_change_of(found.search.gradient_sd),
            np.sqrt((gradient**2).sum() / 3),
            rtol=0.5,
        )


def test_nothing_is_counted_where_field_and_magnet_are_as_assumed() -> None:
    found, _ = _searched(NINE, 0.08, 0 * GRADIENT, 0.0)
    assert (
        found.search.gradient_sd == 0.0
        and found.systematic is None
        and found.localisation.is_located.mean() > 0.7
    )


@pytest.mark.parametrize(
    ("kind", "length", "elsewhere", "gain", "turn", "size"),
    [
        ("place", 0.0, 1e-3, 0.0, 0.0, 1e-3),
        ("length", 0.04, 0.0, 0.0, 0.0, 0.02**2 / 6),
        ("gain", 0.0, 0.0, 0.02, 0.0, 0.02 / np.sqrt(3)),
        ("turn", 0.0, 0.0, 0.0, 0.03, 0.03 / np.sqrt(3)),
    ],
)
def test_what_errs_alike_in_all_readings_is_told_by_them_and_taken_off(
    kind: str, length: float, elsewhere: float, gain: float, turn: float, size: float
) -> None:
    found, p = _searched(NINE, 0.08, 0 * GRADIENT, length, elsewhere, gain, turn)
    assert found.systematic is not None and found.systematic.dominant.name == kind
    assert dict(zip((k.name for k in systematic_errors.KINDS), found.systematic.sizes))[
        kind
    ] == pytest.approx(size, rel=0.5)
    ok, off = found.localisation.is_located, found.localisation.place - p
    assert ok.mean() > 0.5
    assert ((off / found.localisation.place_sd)[ok] ** 2).mean() < 1.5
    assert np.median(np.linalg.norm(off[ok], axis=1)) < 2.5e-3
    assert np.median(np.linalg.norm(found.localisation.moment[ok], axis=1)) == pytest.approx(
        0.4, rel=0.05
    ), "no gain of everything explains what noise leaves"


def test_slopes_have_neither_curl_nor_divergence_and_are_alike() -> None:
    slopes = np.moveaxis(
        dipole_fit.gradient_fields(np.vstack([np.eye(3), -np.eye(3)]))[:3], -1, 0
    )  # (5, along, of)
    np.testing.assert_allclose(slopes, np.swapaxes(slopes, 1, 2), atol=1e-12)
    np.testing.assert_allclose(np.trace(slopes, axis1=1, axis2=2), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("kij,lij->kl", slopes, slopes), np.eye(5), atol=1e-12)
