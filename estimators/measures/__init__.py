"""Clinical measures: the figures that a clinician reads, computed from a trajectory, by task.

A new measure is a file beside this and a line in the table (docs/measures.md has what it gives).
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, cast

from handscope.estimators.measures import (
    circles,
    independence,
    kapandji,
    lift,
    pinch,
    range_of_motion,
    reach,
    self_check,
    squeeze,
    tapping,
    total_active_motion,
    tremor,
)
from handscope.estimators.measures.figure import Figure, Kind
from handscope.estimators.measures.plot_data import PlotData
from handscope.estimators.measures.repetitive_movement import OPEN_CLOSE, PRONATION_SUPINATION
from handscope.estimators.measures.sustained_angle_measures import (
    FINGER_SPREAD,
    FOREARM_ROTATION,
    THUMB_ABDUCTION,
)


class Measure(Protocol):
    """A module, or one entry of a table of measures that differ in an angle only."""

    @property
    def TITLE(self) -> str: ...
    @property
    def KINDS(self) -> Mapping[str, Kind]: ...
    @property
    def Params(self) -> Callable[[], Any]: ...
    @property
    def applies(self) -> Callable[[str], bool]: ...
    @property
    def measure(self) -> Callable[..., Any]: ...
    @property
    def figures(self) -> Callable[[Any], list[Figure]]: ...
    @property
    def shown(self) -> Callable[[Any], PlotData]: ...


MEASURES: dict[str, Measure] = {
    "range_of_motion": range_of_motion,
    "total_active_motion": total_active_motion,
    "thumb_abduction": THUMB_ABDUCTION,
    "finger_spread": FINGER_SPREAD,
    "forearm_rotation": FOREARM_ROTATION,
    "kapandji": kapandji,
    "tapping": cast(Measure, tapping),  # mypy does not see that it imports Params
    "open_close": OPEN_CLOSE,
    "pronation_supination": PRONATION_SUPINATION,
    "circles": circles,
    "independence": independence,
    "pinch": pinch,
    "self_check": self_check,
    "tremor": tremor,
    "reach": reach,
    "lift": lift,
    "squeeze": squeeze,
}
