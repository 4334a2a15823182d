"""Shared by all tests: one thread for linear algebra, how hypothesis draws its examples, recordings that several tests read."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings

from estimators.simulation.scenario import Simulated
from tests.simulated import pose_and_wiggle

settings.register_profile(
    "handscope",
    max_examples=25,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.explicit, Phase.generate, Phase.shrink],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile("thorough", parent=settings.get_profile("handscope"), max_examples=1000, derandomize=False)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "handscope"))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20250726)


@pytest.fixture(scope="session", params=["left", "right"])
def simulated(request: pytest.FixtureRequest) -> Simulated:
    """A hand in the initial pose, then one finger after the other bends; ideal sensors, the forearm's in a stream of its own."""
    return pose_and_wiggle(request.param)
