"""Which sensor lowers the figures: the messages about a recording that stand beside the answer where it is not yes; and questions that only a person can answer. The others are folded.

Rule      a fault of a sensor first, then what is doubtful of one, of a strip or of which hand it is, then which sensors have the flag that a figure's reason names; at most MOST
"""

from collections.abc import Sequence

from handscope.app.report.trust.judgement import Trust
from handscope.estimators.messages import Message
from handscope.estimators.messages.sentence import codes_of, messages_of
from handscope.estimators.recording_checks.pose_gravity import BENT_IN_POSE, bent_joints_of

MOST = 2
ABOUT_SENSORS = ("sensor.", "sensors.", "file.", "fault.", "joint.")
ABOUT_STRIPS = (
    "fingers.",
    "hand.other",
    "hand.mirrored",
    "hand.other_thumb",
    "geometry.other_hand",
)
ASKED = frozenset({BENT_IN_POSE})  # what every angle of the finger rests on
NAMING = ("sensor", "first", "second", "sensors")  # values of a message that name sensors
FLAGGED = "processing.segments_flagged"
ABSENT = "recording.strip_absent"
GAPS = frozenset({"flag.missing", "flag.lost"})  # what an absent strip leaves


def leading_findings(trust: Trust, warnings: Sequence[str]) -> list[str]:
    """Of the recording's messages, as they are stored, those about sensors that a reader needs first; none where the answer is yes."""
    if trust.answer == "yes":
        return []
    reasons = frozenset().union(*(codes_of(doubt.reason) for doubt in trust.doubts))
    ranked = ((_rank(text, reasons), text) for text in warnings)
    known = [(rank, text) for rank, text in ranked if rank is not None]
    chosen: list[str] = []
    for _, text in sorted(known, key=lambda found: found[0]):
        if not _follows_from(text, chosen):
            chosen.append(text)
    return chosen[:MOST]


def questions(warnings: Sequence[str]) -> list[str]:
    """Of the recording's messages, as they are stored, those that ask about the initial pose."""
    return [text for text in warnings if codes_of(text) & ASKED][:MOST]


def bent_joints(warnings: Sequence[str]) -> list[tuple[str, str]]:
    """Joints that were bent in the initial pose, with the angle: ("ring_pip", "37°"); each once."""
    found = [m for text in questions(warnings) for m in messages_of(text) if m.code in ASKED]
    return list(dict.fromkeys(pair for message in found for pair in bent_joints_of(message)))


def faulty_sensors(warnings: Sequence[str]) -> list[str]:
    """Tracked points whose sensor a message of a fault names, each once."""
    faults = [message for text in warnings for message in messages_of(text) if _is_fault(message)]
    return list(dict.fromkeys(sensor for message in faults for sensor in _sensors(message)))


def _is_fault(message: Message) -> bool:
    return message.severity == "fault" and message.code.startswith(ABOUT_SENSORS)


def _sensors(message: Message) -> list[str]:
    """That a message is about."""
    names = ("segments",) if message.code == FLAGGED else NAMING
    return [
        s for name in names if name in message.values for s in str(message.values[name]).split(", ")
    ]


def _follows_from(text: str, chosen: Sequence[str]) -> bool:
    """Whether a message of flags tells only of sensors that those before it name, or another only of sensors that a fault before it names, of which it is what follows."""
    messages = messages_of(text)
    if any(map(_is_fault, messages)):
        return False
    are_flags = all(message.code == FLAGGED for message in messages)
    explained = {
        sensor
        for other in chosen
        for message in messages_of(other)
        if are_flags or _is_fault(message)
        for sensor in _sensors(message)
    }
    about = [sensor for message in messages for sensor in _sensors(message)]
    return bool(about) and explained >= {*about}


def _rank(text: str, reasons: frozenset[str]) -> int | None:
    """The smaller, the earlier; None for what names no sensor, or nothing that lowers a figure."""
    severities = {message.severity for message in messages_of(text)}
    codes = codes_of(text)
    if severities == {"info"}:
        return None
    if any(code.startswith((*ABOUT_SENSORS, *ABOUT_STRIPS)) for code in codes):
        return 0 if "fault" in severities else 1
    if (FLAGGED in codes and codes & reasons) or (ABSENT in codes and reasons & GAPS):
        return 2
    return None
