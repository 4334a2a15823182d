"""The steps of the functional calibration as they are simulated."""

import numpy as np
import pytest

from handscope.estimators.alignment.functional_movements import STEPS
from handscope.estimators.hand.anatomy import HANDS, IS_DOF, JOINTS, LIMITS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.motion import COORDINATES
from handscope.estimators.simulation.movements import functional_calibration, task_performance
from handscope.estimators.simulation.movements.functional_calibration import Carelessness
from tests.simulated import DEG

every_step = pytest.mark.parametrize("step", functional_calibration.STEPS)


def _performed(
    step: str, hand: Hand = "left", care: Carelessness | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    done = functional_calibration.STEPS[step](
        sized(hand), np.random.default_rng(1), care or Carelessness()
    )
    t = np.linspace(0.0, done.motion.duration, 3001)
    return t, *done.motion.at(t)


def test_every_step_that_is_measured_can_be_simulated() -> None:
    assert tuple(functional_calibration.STEPS) == tuple(STEPS)


@every_step
@pytest.mark.parametrize("hand", HANDS)
def test_a_step_begins_and_ends_relaxed_and_says_where_it_is(step: str, hand: Hand) -> None:
    done = functional_calibration.STEPS[step](sized(hand), np.random.default_rng(1), Carelessness())
    x, dx, _ = done.motion.at(np.array([0.0, done.motion.duration]))
    np.testing.assert_allclose(x, np.tile(task_performance.relaxed(), (2, 1)), atol=1e-9)
    np.testing.assert_allclose(dx, 0.0, atol=1e-6)
    (event,) = done.events
    assert event.trial_type == step
    assert 0 < event.onset < event.end < done.motion.duration


@every_step
def test_joints_stay_within_what_they_can_and_below_what_the_protocol_permits(step: str) -> None:
    _, x, dx, _ = _performed(step)
    angles = x[:, 6:].reshape(-1, len(JOINTS), 3)
    assert (angles >= LIMITS[..., 0] - 1e-9)[:, IS_DOF].all()
    assert (angles <= LIMITS[..., 1] + 1e-9)[:, IS_DOF].all()
    np.testing.assert_allclose(angles[:, ~IS_DOF], 0.0, atol=1e-9)
    assert np.abs(dx[:, 6:]).max() < 2.0


@pytest.mark.parametrize("step", ["flat_hand", "thumb_flat"])
def test_still_steps_are_still(step: str) -> None:
    done = functional_calibration.STEPS[step](
        sized("left"), np.random.default_rng(1), Carelessness()
    )
    _, dx, _ = done.motion.at(
        np.linspace(done.events[0].onset + 0.01, done.events[0].end - 0.01, 50)
    )
    np.testing.assert_allclose(dx, 0.0, atol=1e-6)


@pytest.mark.parametrize("step", functional_calibration.BENT)
def test_somebody_careful_bends_only_what_was_asked_for_and_three_times(step: str) -> None:
    t, x, _, _ = _performed(step, care=Carelessness(pose=0.0, divergence=0.0, joints=0.0, hand=0.0))
    inside = (t > 1.5) & (t < t[-1] - 1.5)
    moved = np.ptp(x[inside], axis=0) > 0.5 * DEG
    assert {name for name, k in COORDINATES.items() if moved[k]} == set(
        functional_calibration.BENT[step]
    )
    flexion = x[inside][:, COORDINATES[next(iter(functional_calibration.BENT[step]))]]
    high = flexion > 0.5 * flexion.max()
    assert np.sum(np.diff(high.astype(int)) == 1) == 3
