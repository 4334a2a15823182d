"""Trajectories made of given angles, tips or orientations; what is not given is not measured."""

from dataclasses import replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import JOINTS, SEGMENTS, Hand
from handscope.estimators.measures.figure import Figure
from handscope.estimators.numerics import quaternions as quat
from tests.simulated import DEG

RATE = 100.0
CYCLE, REST = 40.0, 8.0  # s from rest to rest; s of a rest


def made(
    n: int,
    angles: np.ndarray | None = None,
    q_GS: np.ndarray | None = None,
    tips: np.ndarray | None = None,
    hand: Hand = "left",
    rate: float = RATE,
) -> Trajectory:
    """n samples from 0 s on, without flags."""
    return replace(
        trajectory.empty(hand),
        t=np.arange(n) / rate,
        angles=np.full((n, len(JOINTS), 3), np.nan) if angles is None else angles,
        q_GS=np.full((n, len(SEGMENTS), 4), np.nan) if q_GS is None else q_GS,
        tips=np.full((n, 5, 3), np.nan) if tips is None else tips,
        flags=np.zeros((n, len(SEGMENTS)), np.uint8),
    )


def by_name(figures: list[Figure]) -> dict[str, Figure]:
    return {f.name: f for f in figures}


def resting_now_and_then(
    minutes: float,
    drift: float = 0.0,
    seed: int = 1,
    dips: float = 40.0,
    scatter: float = 2e-3,
    rate: float = 10.0,
) -> Trajectory:
    """A hand that rests 8 s of every 40 s, dips its fingers by `dips` deg between, and whose index tip drifts by `drift` m a minute.

    Where it rests differs by `scatter` m from rest to rest.
    """
    n = round(60 * minutes * rate)
    t = np.arange(n) / rate
    cycle, phase = np.divmod(t, CYCLE)
    tilt = dips * DEG * np.where(phase < REST, 0.0, np.sin(np.pi * (phase - REST) / 4))
    where = np.random.default_rng(seed).normal(0, scatter, int(cycle[-1]) + 1)[cycle.astype(int)]
    tips = np.zeros((n, 5, 3))
    tips[:, 1:, 0] = 0.08
    tips[:, 1, 0] = 0.06 + drift * t / 60 + where + 0.02 * np.abs(tilt)
    q = np.repeat(quat.about(1, tilt)[:, None], len(SEGMENTS), axis=1)
    return made(n, q_GS=q, tips=tips, rate=rate)
