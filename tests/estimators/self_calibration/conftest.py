"""What takes seconds to solve is solved once for all tests."""

import pytest

from handscope.estimators.self_calibration import solver
from handscope.estimators.self_calibration.solver import Solution
from tests.estimators.self_calibration.fingers import DURATION, cold, recorded


@pytest.fixture(scope="session")
def solved() -> Solution:
    return solver.solve_with_noise(*cold(recorded(1, DURATION)))


@pytest.fixture(scope="session")
def with_skin() -> Solution:
    return solver.solve_with_noise(*cold(recorded(2, DURATION, skin=True)))
