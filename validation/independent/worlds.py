"""The same grid of worlds in a simulator that shares no line with the program (simulator/free_movement.py)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handscope.estimators.data.samples import Recording
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT, JOINTS
from handscope.estimators.numerics.typing import Array
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator.free_movement import (
    BEGUN,
    DEG,
    LAWS,
    Setup,
)
from handscope.validation.studies.worlds import is_claimed

# s, Hz, rad
USUAL = Setup(0, fingers=FINGERS, forearm=True, duration=45.0, pace=0.6, missed=2.0 * DEG)


@dataclass(frozen=True)
class World:
    """A setup but for its seed, and whether the model of `ekf` claims to cover it."""

    setup: Setup = USUAL
    covered: bool = True


@dataclass(frozen=True)
class Judged:
    """A recording with what is true at the instants t (n,) s that are judged: angles (n, joints, 3) rad, NaN where there is no freedom, tips (n, 5, 3) m."""

    recording: Recording
    t: Array
    angles: Array
    tips: Array


def _world(covered: bool = True, **changed: Any) -> World:
    return World(replace(USUAL, **changed), covered)


WORLDS: Mapping[str, World] = {
    "as believed": World(),
    **{
        f"pose missed by {pose:g} deg": _world(is_claimed(pose), missed=pose * DEG)
        for pose in (0.0, 1.0, 1.5, 2.5, 4.0, 5.0)
    },
    **{f"skin x {times:g}": _world(skin=times) for times in (0.5, 2.0)},
    **{f"misalignment x {times:g}": _world(misaligned=times) for times in (0.5, 2.0)},
    **{f"skin {law}": _world(False, law=law) for law in LAWS if law != USUAL.law},
}


def recorded(world: str, seed: int) -> Judged:
    """Somebody in that world, read from the files that they wrote."""
    setup = replace(WORLDS[world].setup, seed=seed)
    recording, true = write_and_load(setup)
    rows = np.flatnonzero((true.t > BEGUN) & (true.t < setup.duration - 0.1))
    angles = np.full((len(rows), len(JOINTS), 3), np.nan)
    for joint, of_joint in true.angles.items():
        angles[:, JOINT[joint]] = np.where(IS_DOF[JOINT[joint]], of_joint[rows], np.nan)
    tips = np.stack([true.tips[f][rows] for f in FINGERS], axis=1)
    return Judged(recording, true.t[rows], angles, tips)
