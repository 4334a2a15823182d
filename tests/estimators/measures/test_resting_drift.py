"""Drift of a hand that comes back to one posture at rest: found where headings drift, not where only the posture varies."""

import numpy as np
import pytest

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.measures.resting_drift import resting_drift
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import made
from tests.simulated import DEG

RATE, CYCLE, REST = 10.0, 40.0, 8.0  # Hz; s from rest to rest; s of a rest


def session(
    minutes: float, drift: float = 0.0, seed: int = 1, dips: float = 40.0, scatter: float = 2e-3
) -> Trajectory:
    """A hand that rests 8 s of every 40 s, dips its fingers by `dips` deg between, and whose index tip drifts by `drift` m a minute.

    Where it rests differs by `scatter` m from rest to rest.
    """
    n = round(60 * minutes * RATE)
    t = np.arange(n) / RATE
    cycle, phase = np.divmod(t, CYCLE)
    tilt = dips * DEG * np.where(phase < REST, 0.0, np.sin(np.pi * (phase - REST) / 4))
    where = np.random.default_rng(seed).normal(0, scatter, int(cycle[-1]) + 1)[cycle.astype(int)]
    tips = np.zeros((n, 5, 3))
    tips[:, 1:, 0] = 0.08
    tips[:, 1, 0] = 0.06 + drift * t / 60 + where + 0.02 * np.abs(tilt)
    q = np.repeat(quat.about(1, tilt)[:, None], len(SEGMENTS), axis=1)
    return made(n, q_GS=q, tips=tips, rate=RATE)


@pytest.mark.parametrize("drift", [1e-3, -1e-3])
def test_a_tip_that_drifts_is_found_with_its_size(drift: float) -> None:
    found = resting_drift(session(8, drift))
    assert found is not None and found.finger == "index" and found.rests == 12
    assert found.after - found.before == pytest.approx(
        drift * (found.end - found.start) / 60, abs=2e-3
    )
    assert found.start < CYCLE and found.end > 7 * 60


@pytest.mark.parametrize("seed", range(5))
def test_rests_that_only_vary_are_no_drift(seed: int) -> None:
    assert resting_drift(session(8, 0.0, seed, scatter=5e-3)) is None


def test_a_drift_below_the_accuracy_of_a_tip_is_not_told() -> None:
    assert resting_drift(session(8, 0.4e-3, scatter=1e-4)) is None


def test_too_few_rests_tell_nothing() -> None:
    assert resting_drift(session(3, 3e-3)) is None


def test_a_hand_that_rests_ever_more_inclined_does_not_drift() -> None:
    """A posture that changes is seen in its inclinations; no two rests share one."""
    moved = session(8, 1e-3)
    tilt = quat.about(0, 2.0 * DEG * (moved.t // CYCLE) ** 2)
    moved.q_GS[:, SEGMENTS.index("index_distal")] = tilt
    assert resting_drift(moved) is None


def test_a_hand_that_never_rests_tells_nothing() -> None:
    moved = session(8, 1e-3)
    turning = quat.about(1, 20 * DEG * moved.t)
    assert (
        resting_drift(
            made(
                len(moved),
                q_GS=np.repeat(turning[:, None], len(SEGMENTS), 1),
                tips=moved.tips,
                rate=RATE,
            )
        )
        is None
    )


def test_nothing_recorded_tells_nothing() -> None:
    assert resting_drift(made(0)) is None and resting_drift(made(1)) is None
