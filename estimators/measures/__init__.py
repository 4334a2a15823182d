"""What a clinician reads. A new measure is a file beside this and a line in the table: name -> module (docs/measures.md has what it gives)."""

from types import ModuleType

from handscope.estimators.measures import (
    circles,
    finger_spread,
    forearm_rotation,
    independence,
    kapandji,
    lift,
    open_close,
    pinch,
    pronation_supination,
    range_of_motion,
    reach,
    self_check,
    squeeze,
    tapping,
    thumb_abduction,
    total_active_motion,
    tremor,
)

MEASURES: dict[str, ModuleType] = {
    "range_of_motion": range_of_motion,
    "total_active_motion": total_active_motion,
    "thumb_abduction": thumb_abduction,
    "finger_spread": finger_spread,
    "forearm_rotation": forearm_rotation,
    "kapandji": kapandji,
    "tapping": tapping,
    "open_close": open_close,
    "pronation_supination": pronation_supination,
    "circles": circles,
    "independence": independence,
    "pinch": pinch,
    "self_check": self_check,
    "tremor": tremor,
    "reach": reach,
    "lift": lift,
    "squeeze": squeeze,
}
