"""Two movements there and back in the terms of finger tapping: fists, and turns of the palm.

In      a trajectory and the stretch of time of the trial; or plain arrays: `of_flexion`, `of_turn`
Out     cycles: count, rate, intervals, amplitude, speeds, decrement, fatigue, interruptions, freezes
Source  movements: MDS-UPDRS items 3.5 and 3.6 (never their scores). The angles are ours: the summed
        flexion of MCP, PIP and DIP of a finger, mean over index to little finger, with the sign
        turned; the direction of the palm against gravity. The rest: cycles.py, cycle_figures.py
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

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
from handscope.estimators.measures import cycle_measure, cycles
from handscope.estimators.measures.cycle_figures import CycleWords
from handscope.estimators.measures.cycle_measure import CycleResult, Words
from handscope.estimators.measures.figure import Figure, Kind, grade_of
from handscope.estimators.measures.plot_data import PlotData
from handscope.estimators.measures.sustained_angle_measures import INCLINATION, palm_turn
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

MARGIN = 0.5  # s looked at before and after the trial


@dataclass(frozen=True)
class MovementAngle:
    """An angle that is smallest where a cycle begins and ends."""

    values: Array  # (n,) rad
    sd: float | None  # rad, of its error at one instant
    segments: list[int]  # whose samples it rests on


@dataclass(frozen=True)
class Movement:
    """One measure; `read_angle` returns the angle, or the reason why there is none."""

    TITLE: str
    words: Words
    task_words: frozenset[str]  # all of them name a task with this movement
    read_angle: Callable[[Trajectory], MovementAngle | str]
    Params: ClassVar[type[cycles.Params]] = cycles.Params

    @property
    def KINDS(self) -> Mapping[str, Kind]:
        return self.words.kinds()

    def applies(self, task_name: str) -> bool:
        return self.task_words <= words_of(task_name)

    def measure(
        self,
        params: cycles.Params,
        trajectory: Trajectory,
        onset: float,
        end: float,
        geometry: HandGeometry | None = None,
        asked: TaskRequest = UNKNOWN,
    ) -> CycleResult:
        """Cycles within [onset, end]."""
        part = task_samples(trajectory, onset - MARGIN, end + MARGIN)
        angle = self.read_angle(part)
        if isinstance(angle, str):
            return CycleResult(params, None, (), None, "poor", angle)
        inside = (part.t >= onset) & (part.t <= end)
        graded = grade_of(part.flags[inside][:, angle.segments])
        return cycle_measure.measure_cycles(
            params, part.t, angle.values, (onset, end), graded, angle.sd
        )

    def figures(self, trial: CycleResult) -> list[Figure]:
        """The flat list of figures."""
        return cycle_measure.list_figures(self.words, trial)

    def shown(self, trial: CycleResult) -> PlotData:
        """The angle over time, and the amplitude of every cycle."""
        return cycle_measure.plot_cycles(self.words, trial)


def of_flexion(
    t: Array, flexion: Array, params: cycles.Params | None = None, sd: float | None = None
) -> CycleResult:
    """Fists in a flexion (n,) in rad at times t (n,) s."""
    return of_turn(t, -np.asarray(flexion, float), params, sd)


def of_turn(
    t: Array, turn: Array, params: cycles.Params | None = None, sd: float | None = None
) -> CycleResult:
    """Turns in an angle (n,) in rad at times t (n,) s, smallest with the palm down."""
    return cycle_measure.measure_array(params or cycles.Params(), t, turn, sd)


def _hand_opening(part: Trajectory) -> MovementAngle | str:
    """Negative summed flexion, the mean of the fingers all of whose joints are measured."""
    joints = {f: [JOINT[j] for j in FINGER_JOINTS[f]] for f in FINGERS[1:]}
    flexions = {f: part.angles[:, rows, FLEXION] for f, rows in joints.items()}
    measured = [
        f for f, v in flexions.items() if len(part) and np.isfinite(v).all(axis=1).mean() > 0.5
    ]
    if not measured:
        return phrase("measure.no_finger")
    flexion = np.mean([flexions[f].sum(axis=1) for f in measured], axis=0)
    sd = None
    if part.angles_sd is not None:
        squares = sum(
            (part.angles_sd[:, joints[f], FLEXION] ** 2).sum(axis=1).mean() for f in measured
        )
        sd = float(np.sqrt(squares)) / len(measured)
    segments = [SEGMENT["hand"], *(SEGMENT[s] for f in measured for s in CHAINS[f])]
    return MovementAngle(-flexion, sd, segments)


def _palm_direction(part: Trajectory) -> MovementAngle | str:
    if not len(part):
        return phrase("measure.no_samples")
    return MovementAngle(palm_turn(part), INCLINATION, [SEGMENT["hand"]])


OPEN_CLOSE = Movement(
    phrase("measure_title.open_close"),
    Words(
        "open_close",
        CycleWords(phrase("cycle_word.opening"), phrase("cycle_word.openings")),
        phrase("cycle_opening.finger_flexion"),
        phrase("cycle_angle.finger_flexion"),
    ),
    frozenset({"open", "close"}),
    _hand_opening,
)
PRONATION_SUPINATION = Movement(
    phrase("measure_title.pronation_supination"),
    Words(
        "pronation_supination",
        CycleWords(phrase("cycle_word.turn"), phrase("cycle_word.turns")),
        phrase("cycle_opening.palm"),
        phrase("cycle_angle.palm"),
    ),
    frozenset({"pronation", "supination"}),
    _palm_direction,
)
