"""What to do about figures of reaching, lifting and squeezing that cannot be trusted, by what their reasons say."""

from collections.abc import Iterable

from handscope.app.language import Language
from handscope.estimators.data.trajectory import FORCE_WORDS, PLACE_WORDS, ForceFlag, PlaceFlag

ADVICE = (  # a piece of a reason as the measure says it, and what is to be done; a magnet that is out of reach where readings contradict is none
    ("nothing was held", "not_held"),
    ("nothing was lifted", "not_lifted"),
    ("nothing was squeezed", "not_squeezed"),
    (FORCE_WORDS[ForceFlag.MISSING], "force_missing"),
    (FORCE_WORDS[ForceFlag.SATURATED], "force_limit"),
    ("force and distance do not go together", "not_a_spring"),
    ("is not linear", "not_linear"),
    (FORCE_WORDS[ForceFlag.DRIFT], "force_drift"),
    (FORCE_WORDS[ForceFlag.UNORIENTED], "pose_again"),
    (FORCE_WORDS[ForceFlag.SLIP], "slip"),
    (FORCE_WORDS[ForceFlag.UNBALANCED], "fingers_alone"),
    (FORCE_WORDS[ForceFlag.SHARED], "fingers_alone"),
    ("something not measured carries", "fingers_alone"),
    ("something not measured may carry", "fingers_alone"),
    ("while the object was held up: something", "same_load"),
    ("bends further than it may in the model", "joint_bent"),
    ("not explained by the measured force alone", "squeeze_alone"),
    ("energy came out of what should be passive", "squeeze_alone"),
    ("the force did not change fast enough", "squeeze_faster"),
    ("what is held is rigid", "rigid"),
    (PLACE_WORDS[PlaceFlag.DOUBTFUL], "magnets_away"),
    (PLACE_WORDS[PlaceFlag.OUT_OF_REACH], "nearer"),
    (PLACE_WORDS[PlaceFlag.SATURATED], "farther"),
    (PLACE_WORDS[PlaceFlag.MISSING], "trunk_plugs"),
    (PLACE_WORDS[PlaceFlag.LOST], "trunk_plugs"),
    ("no place of the hand in reach of the magnetometers", "nearer"),
    ("the hand's place hardly changed", "reach_again"),
    ("no reach found", "reach_again"),
)


def advice(reasons: Iterable[str], language: Language) -> list[str]:
    """A sentence for each thing to do, once; none where the reasons name nothing that a person could mend."""
    joined = "; ".join(reasons)
    found = dict.fromkeys(what for piece, what in ADVICE if piece in joined)
    return [
        language.say(f"advice.{what}")
        for what in found
        if not (what == "nearer" and "magnets_away" in found)
    ]
