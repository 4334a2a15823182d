"""Which figures come first where there are many: of each task the two to four that a clinician decides by."""

from collections.abc import Mapping

from handscope.estimators.hand.anatomy import FINGERS
from handscope.sessions.clinic.repeatability import Key

CYCLES = ("rate", "amplitude_mean", "decrement_ratio")
HEADLINES: Mapping[str, tuple[str, ...]] = {  # figures of a measure that come first
    "tapping": tuple(f"tapping_{name}" for name in CYCLES),
    "open_close": tuple(f"open_close_{name}" for name in CYCLES),
    "pronation_supination": tuple(f"pronation_supination_{name}" for name in CYCLES),
    "finger_spread": ("whole_spread",),
    "thumb_abduction": ("palmar_abduction", "radial_abduction"),
    "forearm_rotation": ("pronation", "supination"),
    "kapandji": ("kapandji_score",),
    "reach": ("reach_distance", "reach_trunk_forward"),
    "lift": ("lift_grip_hold", "lift_load_hold"),
    "squeeze": ("squeeze_force", "squeeze_depth"),
}
FIRST: Mapping[str, tuple[str, ...]] = {"total_active_motion": ("tam",), **HEADLINES}
_MEASURES = list(FIRST)
MORE_IS_BETTER = frozenset(
    {
        *(
            f"{movement}_{name}"
            for movement in ("tapping", "open_close", "pronation_supination")
            for name in CYCLES
        ),
        *("tam", "whole_spread", "palmar_abduction", "radial_abduction", "pronation", "supination"),
        *("kapandji_score", "reach_distance", "squeeze_force"),
    }
)
LESS_IS_BETTER = frozenset({"reach_trunk_forward"})  # the arm reaches, not the trunk


def rank(key: Key) -> tuple[int, int, str] | None:
    """Where a figure stands among those that come first: by measure, kind and finger; None where it is none of them."""
    measure, _, name = key
    kinds = FIRST.get(measure, ())
    for k, what in enumerate(kinds):
        if name == what or name.endswith(f"_{what}"):
            finger = finger_of(name)
            place = f"{FINGERS.index(finger)}" if finger else ""
            return _MEASURES.index(measure), k, place
    return None


def finger_of(name: str) -> str:
    """The finger whose a figure is, by its name; "" for one of several fingers or of none."""
    first, _, rest = name.partition("_")
    alone = rest.partition("_")[0] not in FINGERS
    return first if first in FINGERS and alone else ""
