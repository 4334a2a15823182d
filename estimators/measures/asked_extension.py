"""From when on a task asked for extension: the posture in which a trial begins, often that of the calibration, is no stretch of the patient.

In      the samples of a task, and what the task asked for
Out     index of the first sample that may count as extension
Source  ours. A cued task marks it: from its first mark `extension` on. Fist and stretch: from the first fist on, of all fingers together, so that a finger
        that stays locked has its deficit, too: their mean passes the middle of its range, then falls by TURN of the range
Limits  all samples count where no extension was asked for, and where the hand never opened after its first fist
"""

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    SEGMENT,
)
from handscope.estimators.measures.task_request import TaskRequest, words_of
from handscope.estimators.measures.time_window import running_median, usable_samples
from handscope.estimators.numerics.typing import Array

EXTENSION = "extension"  # the phase of a cued task in which joints are to be stretched
TURN = 0.25  # of the range


def asks_fist_and_stretch(task: str) -> bool:
    """Whether the task's name says that all fingers bend and stretch together."""
    words = words_of(task)
    return bool(words & {"rom", "prom"} and words & {"fist", "composite", "hand"}) or bool(
        words & {"tam", "composite"}
    )


def extension_begin(part: Trajectory, window: int, asked: TaskRequest) -> int:
    """Index into the samples `part` of a task; `window` in samples, of the running median."""
    if asks_fist_and_stretch(asked.task):
        return first_fist_end(part, window)
    marked = [m.onset for m in asked.marks if m.phase == EXTENSION]
    begin = int(np.searchsorted(part.t, min(marked))) if marked else 0
    return begin if begin < len(part) else 0


def first_fist_end(part: Trajectory, window: int) -> int:
    """As `extension_begin` of a task of fists and stretches, whatever its name."""
    return _return_from_far(_mean_flexion(part, window))


def _mean_flexion(part: Trajectory, window: int) -> Array:
    """Mean flexion (n,) of the joints of the long fingers, of the thumb where they were not measured; rad, NaN where unknown."""
    found = [curve for f in FINGERS[1:] for curve in _flexions(part, f, window)]
    curves = np.array(found or _flexions(part, "thumb", window) or [np.full(len(part), np.nan)])
    known = np.isfinite(curves)
    counts = known.sum(axis=0)
    return np.where(
        counts, np.where(known, curves, 0.0).sum(axis=0) / np.maximum(counts, 1), np.nan
    )


def _flexions(part: Trajectory, finger: str, window: int) -> list[Array]:
    usable = usable_samples(part, [SEGMENT[s] for s in CHAINS[finger]])
    joints = [j for j in FINGER_JOINTS[finger] if j != "thumb_cmc"]
    curves = [running_median(part.angles[:, JOINT[j], FLEXION], usable, window) for j in joints]
    return [c for c in curves if c is not None]


def _return_from_far(bent: Array) -> int:
    """Index at which a curve (n,) comes back from where it first went far; 0 where it does not."""
    known = np.flatnonzero(np.isfinite(bent))
    if not len(known):
        return 0
    values = bent[known]
    least, most = float(values.min()), float(values.max())
    far = int(np.argmax(values >= (least + most) / 2))
    fallen = np.maximum.accumulate(values[far:]) - values[far:] > TURN * (most - least)
    return int(known[far + int(np.argmax(fallen))]) if fallen.any() else 0
