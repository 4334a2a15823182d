"""Opening and closing the hand again and again, in the same terms as finger tapping.

In      a trajectory and the stretch of time of the trial; or a mean flexion (n,) in rad: `of_flexion`
Out     cycles from fist to fist: count, rate, intervals, amplitude, speeds, decrement, fatigue, interruptions, freezes
Source  movement: MDS-UPDRS item 3.5 (never its score); the angle is how far the fingers are open: the flexions of MCP, PIP and DIP of a finger added up, the mean over
        index to little finger, with the sign turned: ours; the rest cycles.py and cycle_figures.py
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
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import cycle_measure
from handscope.estimators.measures.cycle_measure import CycleResult, Words
from handscope.estimators.measures.cycles import Params
from handscope.estimators.measures.figure import Figure, grade_of
from handscope.estimators.measures.plot_data import PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.numerics.typing import Array

TITLE = "Opening and closing the hand"
WORDS = Words("open_close", "opening", "summed flexion of the fingers, mean of those measured,")
KINDS = WORDS.kinds()
MARGIN = 0.5  # s looked at before and after the trial

__all__ = ["Params", "applies", "figures", "measure", "of_flexion", "shown"]


def applies(task_name: str) -> bool:
    return {"open", "close"} <= words_of(task_name)


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> CycleResult:
    """Fists within [onset, end], of the fingers all of whose joints are measured."""
    part = task_samples(trajectory, onset - MARGIN, end + MARGIN)
    joints = {f: [JOINT[j] for j in FINGER_JOINTS[f]] for f in FINGERS[1:]}
    measured = (
        [
            f
            for f in joints
            if np.isfinite(part.angles[:, joints[f], FLEXION]).all(axis=1).mean() > 0.5
        ]
        if len(part)
        else []
    )
    if not measured:
        return CycleResult(params, None, (), None, "poor", "no finger measured")
    segments = [SEGMENT["hand"], *(SEGMENT[s] for f in measured for s in CHAINS[f])]
    inside = (part.t >= onset) & (part.t <= end)
    flexion = np.mean([part.angles[:, joints[f], FLEXION].sum(axis=1) for f in measured], axis=0)
    sd = None
    if part.angles_sd is not None:
        squares = sum(
            (part.angles_sd[:, joints[f], FLEXION] ** 2).sum(axis=1).mean() for f in measured
        )
        sd = float(np.sqrt(squares)) / len(measured)
    return cycle_measure.measure_cycles(
        params, part.t, -flexion, (onset, end), grade_of(part.flags[inside][:, segments]), sd
    )


def of_flexion(
    t: Array, flexion: Array, params: Params | None = None, sd: float | None = None
) -> CycleResult:
    """Fists in a flexion (n,) in rad at times t (n,) s."""
    return cycle_measure.measure_array(params or Params(), t, -np.asarray(flexion, float), sd)


def figures(trial: CycleResult) -> list[Figure]:
    """The flat list of figures."""
    return cycle_measure.list_figures(WORDS, trial)


def shown(trial: CycleResult) -> PlotData:
    """How far the hand is open, and the amplitude of every opening."""
    return cycle_measure.plot_cycles(WORDS, trial)
