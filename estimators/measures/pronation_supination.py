"""Turning the palm up and down again and again, in the same terms as finger tapping.

In      a trajectory and the stretch of time of the trial; or a turn (n,) in rad: `of_turn`
Out     cycles from palm down to palm down: count, rate, intervals, amplitude, speeds, decrement, fatigue, interruptions, freezes
Source  movement: MDS-UPDRS item 3.6 (never its score); the angle is which way the palm faces against gravity (forearm_rotation.py): ours; the rest cycles.py
"""

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import cycle_measure
from handscope.estimators.measures.cycle_measure import CycleResult, Words
from handscope.estimators.measures.cycles import Params
from handscope.estimators.measures.figure import Figure, grade_of
from handscope.estimators.measures.forearm_rotation import INCLINATION, palm_turn
from handscope.estimators.measures.plot_data import PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.numerics.typing import Array

TITLE = "Turning the palm up and down"
WORDS = Words("pronation_supination", "turn", "angle by which the palm faces up")
KINDS = WORDS.kinds()
MARGIN = 0.5  # s looked at before and after the trial

__all__ = ["Params", "applies", "figures", "measure", "of_turn", "shown"]


def applies(task_name: str) -> bool:
    return {"pronation", "supination"} <= words_of(task_name)


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> CycleResult:
    """Turns within [onset, end]."""
    part = task_samples(trajectory, onset - MARGIN, end + MARGIN)
    if not len(part):
        return CycleResult(params, None, (), None, "poor", "no samples")
    inside = (part.t >= onset) & (part.t <= end)
    graded = grade_of(part.flags[inside][:, [SEGMENT["hand"]]])
    return cycle_measure.measure_cycles(
        params, part.t, palm_turn(part), (onset, end), graded, INCLINATION
    )


def of_turn(
    t: Array, turn: Array, params: Params | None = None, sd: float | None = None
) -> CycleResult:
    """Turns in an angle (n,) in rad at times t (n,) s, smallest with the palm down."""
    return cycle_measure.measure_array(params or Params(), t, turn, sd)


def figures(trial: CycleResult) -> list[Figure]:
    """The flat list of figures."""
    return cycle_measure.list_figures(WORDS, trial)


def shown(trial: CycleResult) -> PlotData:
    """Which way the palm faces, and the amplitude of every turn."""
    return cycle_measure.plot_cycles(WORDS, trial)
