"""A result at one glance: of each task two to four figures with what they are compared with, and each joint's deficit for the drawing of the hand.

Deficit   how far a joint's flexion stays behind the other hand's, else behind the reference value; small: at most the published MDC, large: more than twice it
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

from handscope.app.language import Language
from handscope.app.report.change_words import level_words, value_words
from handscope.app.report.changes import Change, Changes
from handscope.app.report.content import Task
from handscope.app.report.norms import norm_of
from handscope.app.report.progress.importance import BESIDE, FIRST, LESS_IS_BETTER, MORE_IS_BETTER
from handscope.app.report.progress.labels import label
from handscope.app.report.references import Edition, Reference, newest
from handscope.app.report.sections.other_measures import share_words
from handscope.app.report.sections.range_comparison import (
    asks_all_of,
    reference_of,
    reference_span,
    reference_words,
)
from handscope.app.report.sections.range_rows import GRADES, over_tasks
from handscope.app.report.units import (
    DEG,
    decimals_of_sd,
    deviation_words,
    directions_of,
    reading,
    significant_places,
    with_unit,
)
from handscope.app.report.words import flexion_words, joint_words, named
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.total_active_motion import TAM_JOINTS
from handscope.sessions.clinic.references import Compared
from handscope.sessions.clinic.repeatability import Key, measured_values

FOLDED = 8  # rows of a measure from which its table is folded below its headline
LARGE = 2.0  # MDCs
Level = Literal["none", "small", "large"]


def headlines(
    figures: Sequence[tuple[str, str, Figure]],  # task, measure
    titles: Mapping[str, str],
    language: Language,
    changes: Changes | None,
    other: Compared | None,
    edition: Edition | None,
    ranges: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Tiles by task, in the order of the tasks; a value is that over the trials, as comparisons take it. `ranges` lead a task that has no other."""
    kept, leading = measured_values(figures), [row for row in figures if _leads(row)]
    others = {task for task, _, _ in leading}
    for task, measure, figure in figures:
        if (
            measure == "range_of_motion"
            and task not in others
            and figure.name in ranges.get(task, ())
        ):
            leading.append((task, measure, figure))
    tiles: dict[str, list[dict[str, Any]]] = {task: [] for task, _, _ in figures}
    for task, measure, figure in leading:
        if found := kept.pop((measure, task, figure.name), None):
            key = (measure, task, figure.name)
            trials = [f for t, m, f in figures if (m, t, f.name) == key]
            tile = _tile(key, figure, found[0], language, changes, other, edition)
            tiles[task].append(tile | _quality(trials, language))
    return [{"title": titles.get(task, task), "tiles": of} for task, of in tiles.items() if of]


def _leads(row: tuple[str, str, Figure]) -> bool:
    """Whether it comes first of its measure; the thumb's total motion has a row below, a range leads by its task alone."""
    _, measure, figure = row
    return (
        measure != "range_of_motion"
        and (figure.what or figure.name) in (*FIRST.get(measure, ()), *BESIDE.get(measure, ()))
        and figure.part != "thumb"
    )


def joint_deficits(
    tasks: Sequence[Task],
    language: Language,
    other: Compared | None,
    edition: Edition | None,
) -> list[dict[str, Any]]:
    """Of every joint how far its flexion stays behind, in words and as a level; for its bar the range in degrees, the other hand's, the reference."""
    chosen, found = edition or newest(), []
    for r in over_tasks(tasks):
        if r.angle != "flexion":
            continue
        reference = reference_of(r, "largest", chosen)
        least, most = _theirs(r, other, "min"), _theirs(r, other, "max")
        if most is not None:
            against, named_against = most, f"{most:.0f}°"
        elif reference and asks_all_of(r.joint, tasks):
            against, named_against = reference.judged.degrees, reference_words(reference, language)
        else:
            continue
        short = max(0.0, against - r.largest * DEG)
        name = " ".join(joint_words(r.joint, language)).strip()
        words = language.say(
            "deficit.behind" if round(short) else "deficit.none",
            joint=name,
            value=flexion_words(r.largest, language),
            against=named_against,
            size=f"{short:.0f}°",
        )
        level = _level(short, chosen.smallest_change.value)
        found.append(
            {
                "joint": r.joint,
                "name": name,
                "words": words,
                "level": level,
                "range": [round(r.smallest * DEG), round(r.largest * DEG)],
                "other": None if least is None or most is None else [round(least), round(most)],
                "reference": round(reference.judged.degrees) if reference else None,
            }
        )
    return found


def _level(short: float, mdc: float) -> Level:
    return "none" if short <= mdc else "small" if short <= LARGE * mdc else "large"


def _theirs(r: Range, other: Compared | None, end: Literal["min", "max"]) -> float | None:
    """The smallest or largest flexion of the other hand's joint over its tasks, degrees; None where it was not measured."""
    name = f"{r.joint}_flexion_{end}"
    found = [v for (_, _, n), (v, _) in other.values.items() if n == name] if other else []
    return (min if end == "min" else max)(found) * DEG if found else None


def _tile(
    key: Key,
    figure: Figure,
    value: float,
    language: Language,
    changes: Changes | None,
    other: Compared | None,
    edition: Edition | None,
) -> dict[str, Any]:
    change, is_range = changes.of(key[1], key[2]) if changes else None, key[0] == "range_of_motion"
    theirs = other.values.get(key) if other else None
    against = []
    if theirs:
        hand = language.say(f"other.{other.hand}") if other else ""
        moment = f"{language.day(other.started)}, {language.hour(other.started)}" if other else ""
        words = _words(figure, theirs[0], language)
        against.append(language.labelled(f"{hand[:1].upper()}{hand[1:]}, {moment}", words))
    if norm := norm_of(figure.what or figure.name, figure.part, key[1], edition):
        places = decimals_of_sd(norm.sd) if norm.sd else significant_places(norm.mean, norm.unit)
        spread = f" ± {language.number(norm.sd, places)}" if norm.sd else ""
        words = with_unit(f"{language.number(norm.mean, places)}{spread}", norm.unit, language)
        against.append(language.labelled(language.say("norm"), words))
    if reference := _range_reference(figure, edition or newest()):
        words = (
            reference_span(reference)
            if reference.also
            else _words(figure, reference.degrees / DEG, language)
        )
        against.append(language.labelled(language.say("norm"), words))
    return {
        "label": label(figure.name, language) if is_range else named(figure, language),
        "value": _words(figure, value, language),
        "against": against,
        "change": level_words(change, language) if change else "",
        "beyond": bool(change and change.beyond),
        "wanted": _wanted(figure),
        "verdict": _verdict(figure, change),
    }


def _quality(trials: Sequence[Figure], language: Language) -> dict[str, str]:
    """The worst signal over the trials, and the standard deviation of the value where it is of one trial; "" where not known."""
    return {
        "sd": deviation_words(trials, language),
        "grade": max((f.grade for f in trials), key=GRADES.index),
    }


def _range_reference(figure: Figure, edition: Edition) -> Reference | None:
    """How far the end of a range that the figure is conventionally reaches; None of other figures and where nobody tells it."""
    ends = {
        f"{r.joint}_{r.angle}_{'max' if r.end == 'largest' else 'min'}": r
        for r in edition.references
    }
    return ends.get(figure.name)


def _better_direction(figure: Figure) -> Literal["more", "less", ""]:
    """Whether more of it is better."""
    names = {figure.what or figure.name, figure.name}
    return "more" if names & MORE_IS_BETTER else "less" if names & LESS_IS_BETTER else ""


def _wanted(figure: Figure) -> Literal["more", "less", "larger", ""]:
    """What is better, in the words of the value: one whose sign is said in words is larger, not more."""
    wanted = _better_direction(figure)
    return "larger" if wanted == "more" and directions_of(figure.name)[1] == "larger" else wanted


def _verdict(figure: Figure, change: Change | None) -> Literal["better", "worse", ""]:
    """What a change beyond the MDC is; of one within nothing is said."""
    wanted = _better_direction(figure)
    if change is None or not change.beyond or not wanted:
        return ""
    grown = change.value < 0 if figure.name.endswith("_min") else change.value > 0
    return "better" if grown == (wanted == "more") else "worse"


def _words(figure: Figure, value: float, language: Language) -> str:
    """A value in the unit a person reads; below zero it is said in words."""
    read = reading(Figure(figure.name, value, figure.unit, ""))
    return value_words(figure.name, read.value, read.unit, language)


def finger_rows(
    section: Mapping[str, Any], tasks: Sequence[Task], language: Language, changes: Changes | None
) -> list[list[str]]:
    """Total active motion a finger: finger, TAM with the deficits that it has subtracted, its share with the grading's word, of what it is one, the change."""
    if section["measure"] != "total_active_motion":
        return []
    at = section["measure"], section["name"]
    found = {
        (f.part, f.what): f
        for t in tasks
        if (t.result.measure, t.result.task) == at
        for f in t.result.figures
    }
    task = next(t for t in tasks if (t.result.measure, t.result.task) == at)
    rows = []
    for (part, what), tam in found.items():
        share = found.get((part, "tam_share"))
        if what != "tam" or share is None:
            continue
        change = changes.of(section["name"], tam.name) if changes else None
        rows.append(
            [
                language.known(f"finger.{part}", part),
                _tam_words(tam, found, language),
                f"{_words(share, share.value, language)} {language.translate(share.category)}".strip(),
                share_words(share, task, language),
                level_words(change, language) if change else "",
            ]
        )
    return rows


def _tam_words(tam: Figure, found: Mapping[tuple[str, str], Figure], language: Language) -> str:
    """Total active motion of a finger with the extension deficits that it has subtracted, by joint; of a whole degree or more."""
    deficits = {
        j: d.value for j in TAM_JOINTS[tam.part] if (d := found.get((j, "extension_deficit")))
    }
    joints = [
        f"{joint_words(j, language)[1]} {flexion_words(value, language)}"
        for j, value in deficits.items()
        if round(value * DEG) > 0
    ]
    words = _words(tam, tam.value, language)
    if not joints:
        return words
    return language.say("tam.after_deficits", tam=words, joints=language.several(joints))
