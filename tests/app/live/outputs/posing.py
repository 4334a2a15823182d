"""A station whose glove was never opened, and poses as its tracker gives them."""

from pathlib import Path

import numpy as np

from handscope.app.live.station import Station
from handscope.app.workers.turns import Turns
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import FINGERS, JOINT, JOINTS, SEGMENT, SEGMENTS
from tests.app.live.test_live_numbers import setup_of


def station(folder: Path) -> Station:
    return Station("test", setup_of(folder), lambda _: None, Turns())


def poses(t: float, flexion: float = 0.5) -> Trajectory:
    """One row: the index finger alone is measured, its middle segment doubtful."""
    angles = np.full((1, len(JOINTS), 3), np.nan)
    angles[0, JOINT["index_pip"], 0] = flexion
    q_GS = np.full((1, len(SEGMENTS), 4), np.nan)
    q_GS[0, SEGMENT["hand"]] = (1.0, 0.0, 0.0, 0.0)
    tips = np.full((1, len(FINGERS), 3), np.nan)
    tips[0, FINGERS.index("index")] = (0.01, 0.18, -0.02)
    flags = np.zeros((1, len(SEGMENTS)), np.uint8)
    flags[0, SEGMENT["index_middle"]] = Flag.DOUBTFUL
    return Trajectory("left", np.array([t]), angles, q_GS, tips, flags)
