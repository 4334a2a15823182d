"""What to do about figures of reaching, lifting and squeezing that cannot be trusted, by the codes of their reasons."""

from collections.abc import Iterable, Mapping

from handscope.app.language import Language
from handscope.estimators.messages.sentence import codes_of

ADVICE: Mapping[str, str] = {  # the code of a reason, and what is to be done, in this order
    "lift.nothing_held": "not_held",
    "lift.nothing_lifted": "not_lifted",
    "squeeze.nothing_squeezed": "not_squeezed",
    "force_flag.missing": "force_missing",
    "force_flag.saturated": "force_limit",
    "squeeze.not_a_spring": "not_a_spring",
    "squeeze.not_linear": "not_linear",
    "force_flag.drift": "force_drift",
    "force_flag.unoriented": "pose_again",
    "force_flag.slip": "slip",
    "force_flag.unbalanced": "fingers_alone",
    "force_flag.shared": "fingers_alone",
    "lift.carried": "fingers_alone",
    "lift.maybe_carried": "fingers_alone",
    "lift.weightless": "fingers_alone",
    "lift.load_changed": "same_load",
    "lift.load_maybe_changed": "same_load",
    "squeeze.joint_at_limit": "joint_bent",
    "squeeze.other_force": "squeeze_alone",
    "squeeze.not_passive": "squeeze_alone",
    "squeeze.force_too_slow": "squeeze_faster",
    "squeeze.rigid": "rigid",
    "place_flag.doubtful": "magnets_away",
    "place_flag.out_of_reach": "nearer",
    "place_flag.saturated": "farther",
    "place_flag.missing": "trunk_plugs",
    "place_flag.lost": "trunk_plugs",
    "measure.place_out_of_reach": "nearer",
    "measure.place_unchanged": "reach_again",
    "measure.hand_hardly_moved": "reach_again",
}


def advice(reasons: Iterable[str], language: Language) -> list[str]:
    """A sentence for each thing to do, once; none where the reasons name nothing that a person could mend.

    A magnet that is out of reach where readings contradict is none.
    """
    codes = frozenset().union(*map(codes_of, reasons))
    found = dict.fromkeys(what for code, what in ADVICE.items() if code in codes)
    return [
        language.say(f"advice.{what}")
        for what in found
        if not (what == "nearer" and "magnets_away" in found)
    ]
