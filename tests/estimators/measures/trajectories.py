"""Trajectories made of given angles, tips or orientations; what is not given is not measured."""

from dataclasses import replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import JOINTS, SEGMENTS, Hand
from handscope.estimators.measures.figure import Figure

RATE = 100.0


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
