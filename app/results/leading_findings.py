"""Which sensor lowers the figures: the messages about a recording that stand beside the answer where it is not yes, and questions that only a person can answer; the others are folded.

Rule      a fault of a sensor first, then what is doubtful of one, of a strip or of which hand it is, then which sensors have the flag that a figure's reason names; at most MOST
"""

from collections.abc import Sequence

from handscope.app.results.trust import Trust
from handscope.estimators.messages.sentence import codes_of, messages_of

MOST = 2
ABOUT_SENSORS = ("sensor.", "sensors.", "file.", "fault.", "joint.")
ABOUT_STRIPS = (
    "fingers.",
    "hand.other",
    "hand.mirrored",
    "hand.other_thumb",
    "geometry.other_hand",
)
ASKED = frozenset({"person.bent_in_pose"})  # what every angle of the finger rests on
NAMING = ("sensor", "first", "second", "sensors")  # values of a message that name sensors
FLAGGED = "processing.segments_flagged"
ABSENT = "recording.strip_absent"
GAPS = frozenset({"flag.missing", "flag.lost"})  # what an absent strip leaves


def leading_findings(trust: Trust, warnings: Sequence[str]) -> list[str]:
    """Of the recording's messages, as they are stored, those that a reader needs first; questions alone where the answer is yes."""
    if trust.answer == "yes":
        return [text for text in warnings if codes_of(text) & ASKED][:MOST]
    reasons = frozenset().union(*(codes_of(doubt.reason) for doubt in trust.doubts))
    ranked = ((_rank(text, reasons), text) for text in warnings)
    known = [(rank, text) for rank, text in ranked if rank is not None]
    chosen: list[str] = []
    for _, text in sorted(known, key=lambda found: found[0]):
        if not _is_named(text, chosen):
            chosen.append(text)
    return chosen[:MOST]


def faulty_sensors(warnings: Sequence[str]) -> list[str]:
    """Tracked points whose sensor a message of a fault names, each once."""
    found = [
        str(message.values[name])
        for text in warnings
        for message in messages_of(text)
        if message.severity == "fault" and message.code.startswith(ABOUT_SENSORS)
        for name in NAMING
        if name in message.values
    ]
    return list(dict.fromkeys(sensor for names in found for sensor in names.split(", ")))


def _is_named(text: str, chosen: Sequence[str]) -> bool:
    """Whether a message of flags tells only of sensors that those before it name."""
    flagged = [message for message in messages_of(text) if message.code == FLAGGED]
    segments = [s for m in flagged for s in str(m.values["segments"]).split(", ")]
    return bool(segments) and all(any(s in other for other in chosen) for s in segments)


def _rank(text: str, reasons: frozenset[str]) -> int | None:
    """The smaller, the earlier; None for what names no sensor, or nothing that lowers a figure."""
    severities = {message.severity for message in messages_of(text)}
    codes = codes_of(text)
    if severities == {"info"}:
        return 1 if codes & ASKED else None
    if any(code.startswith((*ABOUT_SENSORS, *ABOUT_STRIPS)) for code in codes):
        return 0 if "fault" in severities else 1
    if (FLAGGED in codes and codes & reasons) or (ABSENT in codes and reasons & GAPS):
        return 2
    return None
