"""The field of a room with steel in it."""

import numpy as np
import pytest

from handscope.estimators.simulation.magnetic_field import DIP, EARTH, homogeneous, office
from tests.simulated import DEG


def _heading_sd(place: tuple[float, float, float]) -> float:
    B = np.array([office(np.random.default_rng(seed)).at(np.array(place)) for seed in range(200)])
    return float(np.std(np.arctan2(B[:, 0], B[:, 1])) / DEG)


@pytest.mark.parametrize(
    ("height", "least", "most"), [(0.0, 50, 75), (0.15, 25, 40), (1.0, 0.3, 3)]
)
def test_steel_under_the_desk_turns_a_compass_the_less_the_higher_it_is(
    height: float, least: float, most: float
) -> None:
    assert least < _heading_sd((0.0, 0.15 if height == 0.15 else 0.0, height)) < most


def test_the_homogeneous_field_is_the_same_everywhere_and_points_where_it_was_told() -> None:
    B = homogeneous(0.3).at(np.random.default_rng(0).normal(size=(5, 3)))
    np.testing.assert_allclose(np.linalg.norm(B, axis=1), EARTH)
    np.testing.assert_allclose(np.arctan2(B[:, 0], B[:, 1]), 0.3)
    np.testing.assert_allclose(-B[:, 2] / EARTH, np.sin(DIP))
