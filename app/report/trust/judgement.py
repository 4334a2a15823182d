"""Whether the figures of a result can be trusted: yes, mostly or no, by rules that docs/checks.md states, with reasons and what to do; for page and report.

Rules     no: nothing was measured, there is no calibration, or more than MOST_POOR of the figures are graded poor
          mostly: some figure is not graded good, an angle is larger than healthy people reach (norm mean + BEYOND standard deviations),
          a sensor is faulty, also where joints beside it have no figures for that, thumb and fingertip drift apart or together while the hand rests,
          or it is open whether joints that were bent in the initial pose can be straightened
          yes: else. Lost samples, warnings and the sizes of a calibration count only as far as they lower the grade of a figure
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from handscope.app.language import Language
from handscope.app.report.advice import advice
from handscope.app.report.norms import norm_of
from handscope.app.report.references import Edition
from handscope.app.report.units import directions_of, reading, with_unit
from handscope.app.report.words import joint_words, named
from handscope.estimators.data.trajectory import FLAG_WORDS, Flag
from handscope.estimators.hand.anatomy import CHAINS, JOINT
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.resting_drift import Drift
from handscope.estimators.messages.sentence import Sentence, codes_of, messages_of, phrase

MOST_POOR = 0.5  # share of the figures
BEYOND = 3.0  # standard deviations over healthy people
NAMED = 4  # reasons at most, and joints of one
WIDE_SD = "measure.wide_sd"
TODO: Mapping[str, str] = {  # the code of a figure's reason, and what to do about it
    "flag.uncalibrated": "calibrate",
    "flag.heading_lost": "calibrate",
    "flag.missing": "plugs",
    "flag.lost": "plugs",
    "flag.saturated": "slower",
    "flag.magnetic": "iron",
    "flag.faulty": "strip",
    "flag.doubtful": "strip",
    "measure.too_few_taps": "more",
    "measure.fewer_than": "more",
}
Answer = Literal["yes", "mostly", "no"]


@dataclass(frozen=True)
class Doubt:
    """Why some figures of a task cannot be trusted."""

    task: str  # its name, "" for the whole recording
    reason: str  # in English, as the measure gave it, with its codes
    count: int  # figures concerned
    figure: Figure | None = None  # the one that is larger than healthy people reach
    joints: tuple[str, ...] = ()  # that all of them are about; none where one is about another part


@dataclass(frozen=True)
class Trust:
    """The answer with its reasons, the most figures first."""

    answer: Answer
    good: int  # figures graded good
    count: int
    doubts: tuple[Doubt, ...]
    drifts: tuple[Drift, ...] = ()
    asks_hand: bool = (
        False  # whether the other hand was measured: a question, which changes no answer
    )
    faulty: tuple[str, ...] = ()  # segments whose sensor is
    # joints that were bent in the initial pose, with the angle: ("ring_pip", "37°")
    bent: tuple[tuple[str, str], ...] = ()


def judge_trust(
    rows: Sequence[tuple[str, Figure]],
    calibrated: bool,
    edition: Edition | None = None,
    drifts: Sequence[Drift] = (),
    asks_hand: bool = False,
    faulty: Sequence[str] = (),
    bent: Sequence[tuple[str, str]] = (),
) -> Trust:
    """By the figures of a result, each with its task's name, and by what drifts at rest; `asks_hand` where it looks like the other hand's (hand_history.py), `faulty` segments whose sensor is, `bent` joints that were bent in the initial pose."""
    by_cause: dict[tuple[str, str], list[Figure]] = {}
    for task, figure in rows:
        if figure.grade != "good":
            by_cause.setdefault((task, _cause(figure.reason)), []).append(figure)
    poor = sum(figure.grade == "poor" for _, figure in rows)
    good = sum(figure.grade == "good" for _, figure in rows)
    beyond = [Doubt(task, "", 1, f) for task, f in rows if _is_beyond(task, f, edition)]
    doubts = [
        *(_doubt(task, cause, figures) for (task, cause), figures in by_cause.items()),
        *beyond,
    ]
    refused = not rows or not calibrated or poor > MOST_POOR * len(rows)
    is_doubted = doubts or drifts or faulty or bent
    answer: Answer = "no" if refused else "mostly" if is_doubted else "yes"
    doubts.sort(key=lambda doubt: -doubt.count)
    if not calibrated:
        doubts.insert(0, Doubt("", FLAG_WORDS[Flag.UNCALIBRATED], len(rows)))
    return Trust(
        answer,
        good,
        len(rows),
        tuple(doubts),
        tuple(drifts),
        asks_hand,
        tuple(faulty),
        tuple(bent),
    )


def _cause(reason: str) -> str:
    """What figures with the same doubt have in common: a standard deviation is a number of each."""
    if WIDE_SD not in codes_of(reason):
        return reason
    others = [message for message in messages_of(reason) if message.code != WIDE_SD]
    return Sentence(*others) if others else WIDE_SD


def _doubt(task: str, cause: str, figures: Sequence[Figure]) -> Doubt:
    parts = list(dict.fromkeys(f.part for f in figures))
    joints = tuple(parts) if JOINT.keys() >= {*parts} else ()
    if cause != WIDE_SD:
        return Doubt(task, cause, len(figures), joints=joints)
    largest = max(float(np.degrees(f.sd or 0.0)) for f in figures)
    wide = phrase("measure.wide_sds", sd_deg=largest) if len(figures) > 1 else figures[0].reason
    return Doubt(task, wide, len(figures), joints=joints)


def trust_payload(
    trust: Trust,
    titles: Mapping[str, str],
    language: Language,
    edition: Edition | None = None,
    untested: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> dict[str, Any]:
    """For pages: the answer in words, the reasons, and what to do, each once; `untested`: what the movement did not test (derivative.untested_table)."""
    reasons = [d.reason for d in trust.doubts]
    todo = [language.say(f"trust.do.{what}") for what in _todo(trust.doubts)]
    todo += advice(reasons, language)
    if trust.faulty and (strip := language.say("trust.do.strip")) not in todo:
        todo.append(strip)
    if trust.drifts:
        todo.append(language.say("trust.do.recalibrate"))
    if trust.doubts and not todo:
        todo = [language.say("trust.do.repeat")]
    todo = ([language.say("trust.do.other_hand")] if trust.asks_hand else []) + todo
    return {
        "answer": trust.answer,
        "words": _answer_words(trust, language),
        "reasons": _reasons(trust, titles, language, edition),
        "todo": todo,
        "untested": list(_untested_words(untested, language)),
    }


def trust_sentences(
    trust: Trust, titles: Mapping[str, str], language: Language, edition: Edition | None = None
) -> list[str]:
    """For a report: the answer and its reasons; of joints that were bent in the pose that they were."""
    bent = [_bent_words(trust.bent, language)] if trust.bent else []
    reasons = _reasons(trust, titles, language, edition)
    return [language.say("trust.question"), _answer_words(trust, language), *bent, *reasons]


def _reasons(
    trust: Trust, titles: Mapping[str, str], language: Language, edition: Edition | None
) -> list[str]:
    listed = [language.say("trust.other_hand")] if trust.asks_hand else []
    if trust.faulty:
        parts = language.several(map(language.segment, trust.faulty))
        listed.append(language.say("trust.faulty", parts=parts))
    listed += [_drift_words(d, language) for d in trust.drifts]
    listed += [_doubt_words(d, titles, language, edition) for d in trust.doubts[:NAMED]]
    more = len(trust.doubts) - NAMED
    return [*listed, *([language.counted("trust.more", more)] if more > 0 else [])]


def _bent_words(bent: Sequence[tuple[str, str]], language: Language) -> str:
    joints = [f"{' '.join(joint_words(joint, language))} {angle}" for joint, angle in bent]
    return language.say("trust.bent", joints=language.several(joints))


def _answer_words(trust: Trust, language: Language) -> str:
    if not trust.count:
        return language.say("trust.nothing")
    is_only_asked = trust.bent and trust.answer == "mostly" and trust.good == trust.count
    key = "trust.asked" if is_only_asked else f"trust.{trust.answer}"
    return language.counted(key, trust.count, good=language.number(trust.good))


def _untested_words(untested: Mapping[str, Sequence[str]], language: Language) -> Iterator[str]:
    """What the checks could not have found; a finger of which no sensor was tested by its name."""
    for what in ("gyroscopes", "strips", "fingers", "turns"):
        parts = list(untested.get(what, ()))
        for finger, chain in CHAINS.items():
            if set(chain) <= set(parts):
                parts[parts.index(chain[0])] = finger
                parts = [p for p in parts if p not in chain]
        if parts:
            named_parts = language.several(map(language.segment, parts))
            yield language.say(f"trust.untested_{what}", parts=named_parts)


def _todo(doubts: Sequence[Doubt]) -> list[str]:
    codes = [codes_of(d.reason) for d in doubts]
    found = [what for each in codes for code, what in TODO.items() if code in each]
    found += ["look"] if any(d.figure for d in doubts) else []
    return list(dict.fromkeys(found))


def _doubt_words(
    doubt: Doubt, titles: Mapping[str, str], language: Language, edition: Edition | None
) -> str:
    task = titles.get(doubt.task, "") or language.say("trust.whole")
    if doubt.figure is None:
        figures = language.counted("trust.figures", doubt.count)
        if doubt.joints and len(doubt.joints) <= NAMED:
            joints = language.several(" ".join(joint_words(j, language)) for j in doubt.joints)
            figures = language.say("trust.figures_of", figures=figures, joints=joints)
        reason = language.translate(doubt.reason) or language.say("trust.signal")
        return language.say("trust.doubt", task=task, figures=figures, reason=reason)
    f = doubt.figure
    norm, read = norm_of(f.what, f.part, doubt.task, edition), reading(f)
    assert norm is not None and norm.sd is not None
    return language.say(
        "trust.beyond",
        task=task,
        figure=named(f, language),
        value=with_unit(language.number(read.value), read.unit, language),
        mean=with_unit(language.number(norm.mean), norm.unit, language),
        sd=with_unit(language.number(norm.sd, 1), norm.unit, language),
    )


def _drift_words(drift: Drift, language: Language) -> str:
    return language.say(
        "trust.drift",
        minutes=language.number((drift.end - drift.start) / 60, 1),
        finger=language.say(f"part.{drift.finger}"),
        before=with_unit(language.number(1e3 * drift.before, 0), "mm", language),
        after=with_unit(language.number(1e3 * drift.after, 0), "mm", language),
    )


def _is_beyond(task: str, figure: Figure, edition: Edition | None) -> bool:
    """Whether an angle is larger than healthy people reach; other figures, and changes of an angle from tap to tap, vary with how a task is done."""
    is_change = directions_of(figure.name)[1] != ""
    if figure.unit != "rad" or is_change:
        return False
    norm = norm_of(figure.what, figure.part, task, edition)
    return (
        norm is not None
        and norm.sd is not None
        and reading(figure).value > norm.mean + BEYOND * norm.sd
    )
