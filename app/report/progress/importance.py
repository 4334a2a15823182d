"""Which figures come first where there are many: of each task the two to four that a clinician decides by."""

from collections.abc import Mapping

from handscope.app.protocols import Protocol
from handscope.app.report.content import asked
from handscope.estimators.hand.anatomy import DOF_NAMES, FINGERS
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
WRIST = tuple(
    f"wrist_{end}" for end in ("flexion_max", "flexion_min", "deviation_max", "deviation_min")
)
FIRST: Mapping[str, tuple[str, ...]] = {
    "total_active_motion": ("tam",),
    "range_of_motion": WRIST,
    **HEADLINES,
}
# at one glance, not in a course
BESIDE: Mapping[str, tuple[str, ...]] = {"finger_spread": ("spread",)}
_MEASURES = list(FIRST)
MORE_IS_BETTER = frozenset(
    {
        *(
            f"{movement}_{name}"
            for movement in ("tapping", "open_close", "pronation_supination")
            for name in CYCLES
        ),
        *(
            "tam",
            "whole_spread",
            "spread",
            "palmar_abduction",
            "radial_abduction",
            "pronation",
            "supination",
        ),
        *("kapandji_score", "reach_distance", "squeeze_force", "flexion_max", *WRIST),
    }
)
LESS_IS_BETTER = frozenset({"reach_trunk_forward"})  # the arm reaches, not the trunk


def rank(key: Key) -> tuple[int, int, str] | None:
    """Where a figure stands among those that come first: by measure, kind and finger; None where it is none of them."""
    measure, task, name = key
    if measure == "range_of_motion" and "wrist" not in task:
        return None  # which leaves the wrist alone
    kinds = FIRST.get(measure, ())
    for k, what in enumerate(kinds):
        if name == what or name.endswith(f"_{what}"):
            finger = finger_of(name)
            place = f"{FINGERS.index(finger)}" if finger else ""
            return _MEASURES.index(measure), k, place
    return None


def leading_ranges(protocol: Protocol | None) -> tuple[str, ...]:
    """Of a task of ranges the two to four figures that come first: both ends of each angle asked for at the joint of its curve, of a finger's joint the flexion of all fingers."""
    joint, _, _ = protocol.curve.rpartition("_") if protocol else ("", "", "")
    finger, _, name = joint.partition("_")
    if finger in FINGERS[1:]:
        wanted = [f"{one}_{name}_flexion" for one in FINGERS[1:]]
        return tuple(f"{angle}_max" for angle in wanted if angle in (asked(protocol) or ()))
    angles = [angle for angle in DOF_NAMES if angle in (asked(protocol) or ())]
    return tuple(
        f"{a}_{end}" for a in angles if a.startswith(f"{joint}_") for end in ("max", "min")
    )


def finger_of(name: str) -> str:
    """The finger whose a figure is, by its name; "" for one of several fingers or of none."""
    first, _, rest = name.partition("_")
    alone = rest.partition("_")[0] not in FINGERS
    return first if first in FINGERS and alone else ""
