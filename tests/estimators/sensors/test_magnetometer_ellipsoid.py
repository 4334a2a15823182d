"""Hard and soft iron found again, honestly; what cannot be calibrated is refused; a real
magnetometer."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from handscope.estimators.data.samples import MAG
from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors import magnetometer_board as plate
from handscope.estimators.sensors import magnetometer_ellipsoid as sphere
from handscope.estimators.sensors.imu_calibration import apply
from handscope.estimators.simulation import magnet
from handscope.estimators.simulation.magnetic_field import homogeneous

STRENGTH, NOISE = 49.8e-6, 0.2e-6
BROAD = Path(os.environ.get("HANDSCOPE_BROAD") or "data/broad")


def _turned(n: int, rng: np.random.Generator) -> Array:
    """A field seen from all directions (n, 3), T."""
    return quat.rotate(quat.normalize(rng.normal(size=(n, 4))), np.array([0.0, 18.6e-6, -46.2e-6]))


def _iron(rng: np.random.Generator) -> tuple[Array, Array]:
    soft = np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    return (soft + soft.T) / 2, 30e-6 * rng.normal(size=3)


def test_hard_and_soft_iron_are_found_with_honest_standard_deviations() -> None:
    squares = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        soft, hard = _iron(rng)
        readings = _turned(400, rng) @ soft + hard + NOISE * rng.normal(size=(400, 3))
        found = sphere.fit_ellipsoid(readings, strength=STRENGTH)
        true = np.linalg.inv(soft)
        entries = np.triu_indices(3)
        squares += [
            *((found.matrix - true)[entries] / found.matrix_sd[entries]) ** 2,
            *((found.bias - hard) / found.bias_sd) ** 2,
        ]
        assert found.after < 0.006 and found.before > 0.02
        assert np.linalg.norm(found.corrected(readings), axis=1).mean() == pytest.approx(
            STRENGTH, rel=2e-3
        )
    assert 0.8 < np.mean(squares) < 1.2  # 360 of them


def test_slopes_of_the_sphere_are_differences() -> None:
    rng = np.random.default_rng(5)
    x, z, h = np.array([1.0, 0.9, 1.1, *0.1 * rng.normal(size=6)]), rng.normal(size=(8, 3)), 1e-6
    numeric = np.stack(
        [
            (sphere._residuals(x + d, z) - sphere._residuals(x - d, z)) / (2 * h)
            for d in h * np.eye(9)
        ],
        axis=1,
    )
    np.testing.assert_allclose(sphere._residual_jacobian(x, z), numeric, atol=1e-8)


def test_a_field_of_unknown_strength_keeps_the_readings_own() -> None:
    rng = np.random.default_rng(1)
    found = sphere.fit_ellipsoid(_turned(300, rng) * 1.02 + 5e-6)
    assert found.strength == pytest.approx(1.02 * STRENGTH, rel=1e-4)
    np.testing.assert_allclose(found.matrix, np.eye(3), atol=1e-4)
    np.testing.assert_allclose(found.bias, 5e-6, atol=1e-9)


def test_a_plate_shares_its_axes() -> None:
    rng = np.random.default_rng(2)
    field, q_1l = _turned(500, rng), quat.exp(np.array([[0, 0, 0], [0.1, -0.2, 0.4], [0, 1.5, 0]]))
    mag = quat.rotate(quat.conjugate(q_1l), field[:, None]) + NOISE * rng.normal(size=(500, 3, 3))
    mag[:, 2] = mag[:, 2, [1, 0, 2]]  # as a chip does whose x and y are exchanged
    found = sphere.find_common_axes(mag)
    np.testing.assert_array_equal(found.mirrored, [False, False, True])
    seen = quat.rotate(found.q_1l, found.signs[:, None] * mag)
    assert np.degrees(quat.angle(quat.relative(q_1l[:2], found.q_1l[:2]))).max() < 0.05
    assert np.abs(seen - seen[:, :1]).max() < 8 * NOISE and found.left.max() < 0.02
    assert not sphere.find_outsiders("abc", found)
    mag[:, 1] = np.roll(mag[:, 1], 40, axis=0)
    assert list(sphere.find_outsiders("abc", sphere.find_common_axes(mag))) == ["b"]


def test_magnetometers_of_a_plate_agree_once_it_was_turned_and_one_that_is_silent_is_named() -> (
    None
):
    """Iron of 20 uT and 5 %, turned by a degree, the second left-handed, the third mounted the
    other way round; the fifth reads nothing."""
    rng = np.random.default_rng(8)
    worn, room = magnet.draw_worn(rng), homogeneous()
    nominal = np.tile(quat.IDENTITY, (5, 1))
    nominal[2] = quat.about(2, np.pi)
    turning = magnet.rotate_plate(rng)
    mag = magnet.simulate_magnetic(
        replace(worn, q_bl=quat.multiply(worn.q_bl, nominal[:4])), turning, room, rng, magnet=False
    )
    mag[:, 1] = mag[:, 1, [1, 0, 2]]
    names = ("a", "b", "c", "d", "e")
    silent = np.full_like(mag[:, :1], np.nan)
    given = plate.calibrate_board(names, np.concatenate([mag, silent], axis=1), nominal)
    found = given.solved
    assert tuple(found) == names[:4]
    assert [message.split(":")[0] for message in given.refused] == ["e"]
    assert given.strength == pytest.approx(STRENGTH, rel=0.05)
    corrected = np.stack(
        [apply([found[n].calibration], (MAG,), mag[:, [k]])[:, 0] for k, n in enumerate(names[:4])],
        axis=1,
    )
    level = quat.rotate(nominal[:4], corrected)
    raw = quat.rotate(nominal[:4], mag)
    before, after = (np.linalg.norm(v[:, 1:] - v[:, :1], axis=-1).mean() for v in (raw, level))
    assert after < 0.8e-6 < 10e-6 < before  # of which 0.5 uT is noise
    np.testing.assert_allclose(
        np.linalg.norm(level, axis=-1).mean(axis=0), given.strength, rtol=2e-3
    )


def test_the_dip_is_told_by_an_accelerometer_beside() -> None:
    rng = np.random.default_rng(6)
    q = quat.normalize(rng.normal(size=(300, 4)))
    mag, acc = (
        quat.rotate(q, np.array([0.0, 18.6e-6, -46.2e-6])),
        quat.rotate(q, np.array([0.0, 0.0, 9.81])),
    )
    noisy = mag + NOISE * rng.normal(size=mag.shape), acc + 0.3 * rng.normal(size=acc.shape)
    assert sphere.dip(*noisy) == pytest.approx(np.arctan2(46.2, 18.6), abs=np.radians(0.5))


@pytest.mark.parametrize(
    ("readings", "says"),
    [
        (lambda rng: _turned(20, rng), "too few"),
        (lambda rng: np.tile([1e-5, 2e-5, 3e-5], (100, 1)), "all readings are the same"),
        (
            lambda rng: (
                _turned(300, rng) * [1, 1, 0] + [0, 0, 4e-5] + NOISE * rng.normal(size=(300, 3))
            ),
            "through all directions",
        ),
        (
            lambda rng: _turned(300, rng) * (1 + 0.3 * rng.random((300, 1))),
            "not the same everywhere",
        ),
    ],
)
def test_what_cannot_be_calibrated_is_refused(readings, says) -> None:
    with pytest.raises(InputError, match=says):
        sphere.fit_ellipsoid(readings(np.random.default_rng(3)))


@pytest.mark.skipif(not BROAD.is_dir(), reason="the BROAD trials are not here (HANDSCOPE_BROAD)")
def test_a_real_magnetometer_with_iron_added_is_brought_back() -> None:
    """A real board turned by hand (Laidig et al. 2021); iron put on its readings must not change
    what is left."""
    trial = loadmat(BROAD / "06_undisturbed_fast_rotation_A.mat")
    mag = 1e-6 * trial["imu_mag"][::10]
    found = sphere.fit_ellipsoid(mag)
    assert found.after <= found.before and found.after < 0.04
    soft, hard = _iron(np.random.default_rng(4))
    again = sphere.fit_ellipsoid(mag @ soft + hard)
    assert again.after == pytest.approx(found.after, rel=0.02)
    assert again.before > 3 * again.after
