"""Drift of a hand that comes back to one posture at rest: found where headings drift, not where only the posture varies."""

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.measures.resting_drift import resting_drift
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import CYCLE, made, resting_now_and_then
from tests.simulated import DEG


@pytest.mark.parametrize("drift", [1e-3, -1e-3])
def test_a_tip_that_drifts_is_found_with_its_size(drift: float) -> None:
    found = resting_drift(resting_now_and_then(8, drift))
    assert found is not None and found.finger == "index" and found.rests == 12
    assert found.after - found.before == pytest.approx(
        drift * (found.end - found.start) / 60, abs=2e-3
    )
    assert found.start < CYCLE and found.end > 7 * 60


@pytest.mark.parametrize("seed", range(5))
def test_rests_that_only_vary_are_no_drift(seed: int) -> None:
    assert resting_drift(resting_now_and_then(8, 0.0, seed, scatter=5e-3)) is None


def test_a_drift_below_the_accuracy_of_a_tip_is_not_told() -> None:
    assert resting_drift(resting_now_and_then(8, 0.4e-3, scatter=1e-4)) is None


def test_too_few_rests_tell_nothing() -> None:
    assert resting_drift(resting_now_and_then(3, 3e-3)) is None


def test_a_hand_that_rests_ever_more_inclined_does_not_drift() -> None:
    """A posture that changes is seen in its inclinations; no two rests share one."""
    moved = resting_now_and_then(8, 1e-3)
    tilt = quat.about(0, 2.0 * DEG * (moved.t // CYCLE) ** 2)
    moved.q_GS[:, SEGMENTS.index("index_distal")] = tilt
    assert resting_drift(moved) is None


def test_a_hand_that_never_rests_tells_nothing() -> None:
    moved = resting_now_and_then(8, 1e-3)
    turning = quat.about(1, 20 * DEG * moved.t)
    assert (
        resting_drift(
            made(
                len(moved),
                q_GS=np.repeat(turning[:, None], len(SEGMENTS), 1),
                tips=moved.tips,
                rate=10.0,
            )
        )
        is None
    )


def test_nothing_recorded_tells_nothing() -> None:
    assert resting_drift(made(0)) is None and resting_drift(made(1)) is None
