"""Clinical words for measured angles: never a bare plus or minus, which therapists read either way (Mulder & Wittmeier 2009).

Finger abduction is away from the middle finger; the thumb's CMC joint is read as palmar abduction (out of the palm's plane), radial
abduction (within it) and rotation; the wrist as flexion, extension, radial and ulnar deviation.
"""

from collections.abc import Sequence

from app.report.content import Task
from app.report.units import DEG

TAG = "Research use; not a medical device."
NOTICE = (
    "Handscope records hand motion from inertial sensors and computes joint angles and movement measures for review by a trained "
    "professional. It has not been evaluated by any regulator and must not be the sole basis for diagnosis, treatment, surgical or "
    "impairment-rating decisions. Results depend on sensor placement, calibration and magnetic environment: see the quality figures."
)
SIDES = {  # words of the negative and the positive deviation
    "wrist": ("radial", "ulnar"),
    "thumb_cmc": ("radial abd.", "add."),
    "index_mcp": ("abd.", "add."),
    "middle_mcp": ("radial", "ulnar"),
    "ring_mcp": ("add.", "abd."),
    "little_mcp": ("add.", "abd."),
}
ROTATION = ("supination", "pronation")


def joint_words(joint: str) -> tuple[str, str]:
    """Group and joint as printed: ("Index", "MCP")."""
    group, _, name = joint.partition("_")
    return group.capitalize(), name.upper()


def flexion_words(largest: float) -> str:
    """The largest flexion (rad); how far a joint stays behind straight is said with its extension."""
    degrees = round(largest * DEG)
    return f"{degrees}°" if degrees >= 0 else "none"


def extension_words(joint: str, smallest: float, largest: float, full: bool = True) -> str:
    """How far the joint extends, from its smallest and largest flexion (rad)."""
    beyond, least = -round(smallest * DEG), -round(largest * DEG)
    if beyond < 0 and not full:
        return f"not below {-beyond}°"
    if joint == "thumb_cmc":
        return "to palm plane" if beyond == 0 else f"{beyond}° behind palm" if beyond > 0 else f"{-beyond}° short of palm"
    if beyond < 0:
        return f"{-beyond}° extension deficit"
    word = "extension" if joint == "wrist" else "hyperextension"
    if least > 0:
        return f"{least}° to {beyond}° {word}"
    return f"{beyond}° {word}" if beyond or joint == "wrist" else "full"


def both_ways(smallest: float, largest: float, words: tuple[str, str]) -> str:
    """A range (rad) that may lie on either side of zero: "17° abd., 12° add.", or "5° to 30° ulnar" where zero is not reached."""
    low, high = round(smallest * DEG), round(largest * DEG)
    if low > 0 or high < 0:
        least, most, word = (low, high, words[1]) if low > 0 else (-high, -low, words[0])
        return f"{least}° to {most}° {word}" if least < most else f"{most}° {word}"
    ends = [f"{-low}° {words[0]}", f"{high}° {words[1]}"]
    return ", ".join(sorted(ends, key=lambda end: not end.endswith("abd.")))


def segment_words(segment: str) -> str:
    """A segment or tracked point as printed: "ring distal"."""
    return segment.replace("_", " ")


def span_words(tasks: Sequence[Task]) -> str:
    """The tasks' names and when they were: "Finger tapping, 75 to 90 and 92 to 107 s of the recording"."""
    names = list(dict.fromkeys(t.title for t in tasks))
    times = [f"{t.result.onset:.0f} to {t.result.end:.0f}" for t in tasks]
    if len(tasks) > 3:
        times = [f"{tasks[0].result.onset:.0f} to {tasks[-1].result.end:.0f}"]
    return f"{'; '.join(names)}, {' and '.join([', '.join(times[:-1]), times[-1]] if len(times) > 1 else times)} s of the recording"
