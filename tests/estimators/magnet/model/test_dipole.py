"""The dipole's field against a current loop (Biot-Savart) and against the simulator's, its slopes against differences."""

import numpy as np

from handscope.estimators.magnet.model import dipole
from handscope.estimators.simulation.magnetic_field import MagneticField

RNG = np.random.default_rng(5)
R, M = RNG.normal(size=(6, 3)) * 0.2, RNG.normal(size=(6, 3))


def test_a_small_current_loop_has_this_field() -> None:
    radius, current = 1e-3, 1e5
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    wire = radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    along = 2 * np.pi * radius / 720 * np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    for place in R:
        d = place - wire
        loop = (
            1e-7
            * current
            * (np.cross(along, d) / np.linalg.norm(d, axis=1, keepdims=True) ** 3).sum(axis=0)
        )
        ours = dipole.field(place, np.array([0, 0, current * np.pi * radius**2]))
        assert np.linalg.norm(ours - loop) < 1e-3 * np.linalg.norm(loop)


def test_it_is_the_field_of_the_simulated_room() -> None:
    room = MagneticField(np.zeros(3), R[:1], M[:1])
    np.testing.assert_allclose(dipole.field(R[1:] - R[0], M[0]), room.at(R[1:]), rtol=1e-12)


def test_slopes_are_differences() -> None:
    h = 1e-7
    for r, m in zip(R, M):
        by_place = np.column_stack(
            [(dipole.field(r + h * e, m) - dipole.field(r - h * e, m)) / (2 * h) for e in np.eye(3)]
        )
        np.testing.assert_allclose(
            dipole.field_gradient(r, m), by_place, rtol=1e-4, atol=1e-7 * np.abs(by_place).max()
        )
        np.testing.assert_allclose(dipole.field_by_moment(r) @ m, dipole.field(r, m), rtol=1e-12)
