"""Angles of the hand in the pose that were measured: on a photograph for the next pose, with a goniometer for every pose of the session."""

from collections.abc import Mapping
from typing import Any

from handscope.estimators.alignment.initial_pose import BEYOND_LIMITS, DEG
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FLEXION, HINGES, JOINT, LIMITS
from handscope.estimators.messages.sentence import messages_of, phrase
from handscope.estimators.recording_checks.pose_gravity import bent_joint_questions, bent_joints_of

# of a joint's flexion, deg. Standard errors of measurement: 2.4 to 4.9 deg by novices (Macionis 2013,
# BMC Musculoskelet Disord 14:17), 4 to 11 deg at retest (Reissner 2019, J Orthop Surg Res 14:173)
GONIOMETER_SD = 5.0


class MeasuredPose:
    """What the events of a session's poses hold of measurements; requests and the station's threads replace it as a whole."""

    def __init__(self) -> None:
        self._photograph: Mapping[str, float] = {}  # columns of the next pose's event
        self._stiff: Mapping[str, float] = {}  # flexion by joint that cannot be straightened, deg
        self._counted: Mapping[str, float] = {}  # the same as the newest pose has it

    def use_photograph(self, columns: Mapping[str, float]) -> None:
        """The next pose has these angles (columns of its event); empty: the nominal ones."""
        self._photograph = dict(columns)

    def use_goniometer(self, flexions: Mapping[str, float]) -> None:
        """Every pose from now on has these joints flexed so, deg; joints that are not named count as straight. InputError for what no joint can be."""
        for joint, flexion in flexions.items():
            _require_possible(joint, flexion)
        self._stiff = dict(flexions)

    def columns(self) -> dict[str, float]:
        """Columns of the event of the pose that is being taken, deg."""
        found = dict(self._photograph)
        for joint, flexion in self._stiff.items():
            found[_column(joint)] = flexion
            found[f"{joint}_flexion_sd_deg"] = GONIOMETER_SD
        return found

    def count(self, details: Mapping[str, Any]) -> None:
        """A pose was stored with these details; angles of a photograph that arrived meanwhile are kept for the next."""
        if self._photograph.items() <= details.items():
            self._photograph = {}
        self._counted = {j: details[_column(j)] for j in HINGES if _column(j) in details}

    def to_json(self, calibration: Calibration | None) -> dict[str, Any]:
        """The joints that were entered, deg, whether the newest pose still lacks them, and the joints of which its calibration asks whether they were bent."""
        asked = [] if calibration is None else bent_joints_asked(calibration)
        pending = dict(self._stiff) != dict(self._counted)
        return {"angles": dict(self._stiff), "pending": pending, "asked": asked}


def questions(calibration: Calibration) -> list[str]:
    """The question about joints that a pose had bent, if any, as it is asked where their angles can be entered."""
    found = (question.message for question in bent_joint_questions(calibration))
    return [phrase("live.bent_in_pose", joints=message.values["joints"]) for message in found]


def bent_joints_asked(calibration: Calibration) -> list[str]:
    """Joints that the question, if it is among the calibration's warnings, is about."""
    messages = [message for warning in calibration.warnings for message in messages_of(warning)]
    asked = [m for m in messages if m.code == "live.bent_in_pose"]
    return [joint for message in asked for joint, _ in bent_joints_of(message)]


def _column(joint: str) -> str:
    return f"{joint}_flexion_deg"


def _require_possible(joint: str, flexion: float) -> None:
    if joint not in HINGES:
        raise InputError("live.stiff_joint_unknown", joint=joint, joints=", ".join(HINGES))
    low, high = LIMITS[JOINT[joint], FLEXION] + (-BEYOND_LIMITS, BEYOND_LIMITS)
    if not low <= flexion * DEG <= high:
        least, most = round(low / DEG), round(high / DEG)
        raise InputError("live.stiff_joint_angle", joint=joint, value=flexion, low=least, high=most)
