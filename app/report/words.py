"""Clinical words for measured angles: never a bare plus or minus, which therapists read either way (Mulder & Wittmeier 2009).

Finger abduction is away from the middle finger; the thumb's CMC joint is read as palmar abduction (out of the palm's plane), radial
abduction (within it) and rotation; the wrist as flexion, extension, radial and ulnar deviation.
"""

from collections.abc import Sequence
from datetime import datetime

from handscope.app.language import Language
from handscope.app.report.content import Task
from handscope.app.report.units import DEG
from handscope.estimators.hand.anatomy import JOINT, JOINTS
from handscope.estimators.measures.figure import Figure

SIDES = {  # keys of the words of the negative and the positive deviation
    "wrist": ("radial", "ulnar"),
    "thumb_cmc": ("radial_abd", "add"),
    "index_mcp": ("abd", "add"),
    "middle_mcp": ("radial", "ulnar"),
    "ring_mcp": ("add", "abd"),
    "little_mcp": ("add", "abd"),
}
ROTATION = ("supination", "pronation")
REPEATED = ("tapping", "open_close", "pronation_supination")  # whose figures share their words
ENDINGS = {"max": "largest", "min": "smallest", "range": "extent"}  # of the names of ranges


def moment_words(moment: datetime, language: Language) -> dict[str, str]:
    """Day and hour, for a text that names both."""
    return {"day": language.day(moment), "hour": language.hour(moment)}


def joint_words(joint: str, language: Language) -> tuple[str, str]:
    """Group and joint as printed: ("Index", "MCP")."""
    group, _, name = joint.partition("_")
    return language.known(f"finger.{group}", group.capitalize()), language.joint(name)


def calibration_words(joints: Sequence[Sequence[str]], language: Language) -> list[str]:
    """How good a calibration is for joints of which it is not good; rows of joint and grade."""
    return [
        language.say(f"calibration.joints.{grade}", joints=language.several(named_joints))
        for grade in ("fair", "poor")
        if (
            named_joints := [
                " ".join(joint_words(joint, language)) for joint, of in joints if of == grade
            ]
        )
    ]


def flexion_words(largest: float, language: Language) -> str:
    """The largest flexion (rad); how far a joint stays behind straight is said with its extension."""
    degrees = round(largest * DEG)
    return f"{degrees}°" if degrees >= 0 else language.say("angle.no_flexion")


def extension_words(
    joint: str,
    smallest: float,
    largest: float,
    language: Language,
    full: bool = True,
    short: bool = False,
) -> str:
    """How far the joint extends, from its smallest and largest flexion (rad); `short` for a narrow column."""
    beyond, least = -round(smallest * DEG), -round(largest * DEG)
    if beyond < 0 and not full:
        return language.say("angle.not_below", size=-beyond)
    if joint == "thumb_cmc":
        which = "palm.plane" if beyond == 0 else "palm.behind" if beyond > 0 else "palm.short"
        return language.say(f"angle.{which}", size=abs(beyond))
    if beyond < 0:
        return language.say("angle.deficit.short" if short else "angle.deficit", size=-beyond)
    if short and joint != "wrist" and beyond:
        return language.say("angle.hyperextension.short", size=beyond)
    word = "extension" if joint == "wrist" else "hyperextension"
    if least > 0:
        return language.say(f"angle.{word}.between", least=least, size=beyond)
    if joint == "wrist":  # what it is called says the direction
        return f"{beyond}°"
    return (
        language.say("angle.hyperextension", size=beyond) if beyond else language.say("angle.full")
    )


def both_ways(smallest: float, largest: float, ways: tuple[str, str], language: Language) -> str:
    """A range (rad) that may lie on either side of zero: "17° abd., 12° add.", or "5° to 30° ulnar" where zero is not reached."""
    low, high = round(smallest * DEG), round(largest * DEG)
    if low > 0 or high < 0:
        least, most, side = (low, high, ways[1]) if low > 0 else (-high, -low, ways[0])
        size = language.say("angle.span", least=least, most=most) if least < most else f"{most}°"
        return f"{size} {side_words(side, language)}"
    ends = sorted(((-low, ways[0]), (high, ways[1])), key=lambda end: not end[1].endswith("abd"))
    return ", ".join(f"{size}° {side_words(side, language)}" for size, side in ends)


def side_words(side: str, language: Language) -> str:
    """Left or right, in the reader's language."""
    return language.say(f"side.{side}") if side else ""


def device_words(name: str, language: Language) -> str:
    """What recorded: a product's name as it is, what only plays a glove in words."""
    return language.known(f"device.{name.replace(' ', '_')}", name)


def span_words(tasks: Sequence[Task], language: Language) -> str:
    """The tasks' names and when they were: "Finger tapping, 75 to 90 and 92 to 107 s of the recording"."""
    names = list(dict.fromkeys(language.translate(t.title) for t in tasks))
    spans = (
        [(tasks[0].result.onset, tasks[-1].result.end)]
        if len(tasks) > 3
        else [(t.result.onset, t.result.end) for t in tasks]
    )
    times = language.all_of(
        [language.say("span", start=f"{start:.0f}", end=f"{end:.0f}") for start, end in spans]
    )
    return language.say("span.of", tasks=language.several(names), times=times)


def grade_words(grade: str, language: Language) -> str:
    """A grade, in the reader's language."""
    return language.say(f"grade.{grade}")


def figure_words(name: str, language: Language) -> str:
    """A figure's name as printed: "Index PIP, flexion", "Taps"."""
    if (known := language.known(f"figure.{name}", "")) != "":
        return known
    end = ENDINGS.get(name.rpartition("_")[2])
    for joint in (j.name for j in JOINTS) if end else ():
        if name.startswith(f"{joint}_"):
            angle = name.removeprefix(f"{joint}_").rpartition("_")[0]
            words = _direction_words(joint, angle, end or "largest", language)
            return f"{' '.join(joint_words(joint, language)).strip()}, {words}"
    for movement in REPEATED:
        if name.startswith(f"{movement}_") and (
            words := language.known(f"cycle.{name.removeprefix(f'{movement}_')}", "")
        ):
            return words
    plain = name.replace("_", " ")
    return plain[:1].upper() + plain[1:]


def _direction_words(joint: str, angle: str, end: str, language: Language) -> str:
    """The direction of one end of an angle; of its extent, the angle."""
    positive = end != "smallest"
    if angle == "flexion":
        return (
            language.say("cell.flexion" if positive else "cell.extension")
            if end != "extent"
            else language.say("angle.extent")
        )
    ways = ROTATION if angle == "pronation" else SIDES.get(joint, ("radial", "ulnar"))
    return side_words(ways[positive], language)


def named(figure: Figure, language: Language) -> str:
    """A figure with the part that it is about: "Ring: independence"."""
    if not figure.part:
        words = figure_words(figure.name, language)
        return words[:1].upper() + words[1:]
    joint = " ".join(joint_words(figure.part, language)).strip() if figure.part in JOINT else ""
    place, _, number = figure.part.rpartition("_")
    if number.isdigit():
        part = language.say(f"part.{place}", number=number)
        return language.labelled(part, figure_words(figure.what or figure.name, language))
    part = joint or language.all_of(
        [language.known(f"finger.{p}", p) for p in figure.part.split("_")]
    )
    return language.labelled(part, figure_words(figure.what or figure.name, language))
