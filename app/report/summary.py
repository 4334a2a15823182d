"""The session in plain words: what was done and not done, what stands out, what changed, and how far the figures can be trusted.

Nothing is called a deficit or a change that is not more than measurement error (the MDC that changes.py judges by, else the published one).
"""

from collections.abc import Sequence

import numpy as np

from handscope.app.language import Language
from handscope.app.report.change_words import named_change
from handscope.app.report.changes import Changes
from handscope.app.report.content import Content, NotDone, Task
from handscope.app.report.references import Edition
from handscope.app.report.sections.range_comparison import (
    Lacking,
    behind_other,
    behind_reference,
    other_hand,
)
from handscope.app.report.sections.range_rows import asks_full_range
from handscope.app.report.trust.judgement import judge_trust, trust_sentences
from handscope.app.report.trust.leading_findings import bent_joints, faulty_sensors
from handscope.app.report.units import DECIMALS, DEG
from handscope.app.report.words import joint_words

WHOLE = "whole recording"  # the task's name where a recording names none (estimators/measures/assessment.py)
NAMED = 5  # joints or tasks at most that a sentence names
CHANGED = 3  # changed figures at most that it names
LEAST_VOLUME = 1e-4  # m^3 of the places reached, below which a sentence says nothing: a reach to and fro on one line spans none
LEAST_FORWARD = 0.005  # m; a smaller one backwards is reported as none forwards


def summary(content: Content, language: Language) -> list[str]:
    """Sentences, the most general first."""
    full = [
        t
        for t in content.tasks
        if t.result.measure == "range_of_motion" and asks_full_range(t.result.task)
    ]
    sentences = [
        _tasks(content, language),
        *_not_done(content, language),
        *_absent(content, language),
        *(
            [_reference(full, content.edition, language), *_other(content, full, language)]
            if full
            else []
        ),
        *_tapping(content, language),
        *_reach(content, language),
        *_held(content, language),
        *([_changes(content.changes, language)] if content.changes else []),
        _trust(content, language),
        *_pain(content, language),
    ]
    return [sentence for sentence in sentences if sentence]


def _pain(content: Content, language: Language) -> list[str]:
    scores = [language.say(f"pain.{when}", score=n) for when, n in content.visit.pain.items()]
    return [language.say("summary.pain", scores=language.all_of(scores))] if scores else []


def _tasks(content: Content, language: Language) -> str:
    """Tasks with their trials: "6 tasks accepted: Fist and stretch, Finger tapping (3 trials)"."""
    trials: dict[str, set[float]] = {}
    for t in content.tasks:
        trials.setdefault(t.title, set()).add(t.result.onset)
    if not trials:
        return language.say("summary.nothing")
    if all(t.result.task == WHOLE for t in content.tasks):
        return language.say("summary.whole")
    names = [
        language.translate(title)
        + (f" ({language.counted('summary.trials', len(onsets))})" if len(onsets) > 1 else "")
        for title, onsets in trials.items()
    ]
    return language.say(
        "summary.tasks",
        count=language.counted("summary.accepted", len(names)),
        tasks=", ".join(names),
    )


def _not_done(content: Content, language: Language) -> list[str]:
    rows = [not_done_row(n, language) for n in content.not_done]
    named = [f"{title} ({', '.join(filter(None, why))})" for title, *why in rows]
    return [language.say("summary.not_done", tasks=language.several(named))] if named else []


def _absent(content: Content, language: Language) -> list[str]:
    """Which of the two usual parts a session lacks."""
    measures = {t.result.measure for t in content.tasks}
    usual = {"range_of_motion": "ranges.none", "tapping": "tapping.none"}
    return [
        language.say(key) for measure, key in usual.items() if measures and measure not in measures
    ]


def not_done_row(missed: NotDone, language: Language) -> list[str]:
    """A task that was not done, how it ended, and why, in the reader's language."""
    outcome = language.known(f"outcome.{missed.outcome.replace(' ', '_')}", missed.outcome)
    reason = language.known(f"not_done.{missed.reason}", missed.reason)
    return [language.translate(missed.title), outcome, reason]


def _reference(tasks: Sequence[Task], edition: Edition, language: Language) -> str:
    limit = edition.smallest_change.value
    short = [gap for gap in behind_reference(tasks, edition) if gap.short * DEG > limit]
    if not short:
        return language.say("summary.reference.none", size=f"{limit:g}")
    return language.say("summary.reference", size=f"{limit:g}", joints=_gaps(short, language))


def _other(content: Content, tasks: Sequence[Task], language: Language) -> list[str]:
    other = content.course.other if content.course else None
    gaps = behind_other(tasks, other_hand(content, tasks))
    if other is None or not gaps:
        return []
    limit = content.edition.smallest_change.value
    facts = {
        "hand": language.say(f"other.{'right' if content.hand == 'left' else 'left'}"),
        "day": language.day(other.started),
        "hour": language.hour(other.started),
        "size": f"{limit:g}",
    }
    short = [gap for gap in gaps if gap.short * DEG > limit]
    if not short:
        return [language.say("summary.other.none", **facts)]
    return [language.say("summary.other", joints=_gaps(short, language), **facts)]


def _gaps(gaps: Sequence[Lacking], language: Language) -> str:
    """The largest first: "Ring PIP flexion by 30°, Index DIP extension by 15°"."""
    ordered = sorted(gaps, key=lambda gap: -gap.short)
    named = [
        language.say(
            "summary.gap",
            joint=" ".join(joint_words(gap.joint, language)).strip(),
            way=language.say("cell.flexion" if gap.end == "largest" else "cell.extension"),
            size=f"{gap.short * DEG:.0f}",
        )
        for gap in ordered[:NAMED]
    ]
    return ", ".join([*named, *_more(len(gaps), language)])


def _more(count: int, language: Language) -> list[str]:
    return [language.counted("summary.more", count - NAMED)] if count > NAMED else []


def _tapping(content: Content, language: Language) -> list[str]:
    """Means over the trials of each tapping task."""
    sentences = []
    for title in dict.fromkeys(t.title for t in content.tasks if t.result.measure == "tapping"):
        trials = [t for t in content.tasks if t.title == title and t.result.measure == "tapping"]
        rate, amplitude, ratio = (
            _mean(trials, name)
            for name in ("tapping_rate", "tapping_amplitude_mean", "tapping_decrement_ratio")
        )
        if not np.isfinite(rate):
            sentences.append(language.say("summary.tapping.none", task=language.translate(title)))
            continue
        facts = {
            "task": language.translate(title),
            "rate": language.number(rate, DECIMALS["per s"]),
            "amplitude": language.number(1e3 * amplitude, DECIMALS["mm"]),
        }
        words = language.say("summary.tapping", **facts)
        if np.isfinite(ratio) and abs(ratio) >= 0.005:
            which = "summary.tapping.smaller" if ratio < 0 else "summary.tapping.larger"
            words += " " + language.say(
                which, share=language.number(abs(100 * ratio), DECIMALS["%"])
            )
        sentences.append(words)
    return sentences


def _reach(content: Content, language: Language) -> list[str]:
    """Means over the trials of each reaching task: how far, on what way, within what volume, and what the trunk did."""
    sentences = []
    for title in dict.fromkeys(t.title for t in content.tasks if t.result.measure == "reach"):
        trials = [t for t in content.tasks if t.title == title and t.result.measure == "reach"]
        task = language.translate(title)
        distance, straightness, farthest = (
            _mean(trials, f"reach_{name}") for name in ("distance", "straightness", "farthest")
        )
        if np.isfinite([distance, straightness, farthest]).all():
            longer = language.number(max(0.0, 100 * (straightness - 1)))
            far = {
                "distance": language.number(1e2 * distance),
                "farthest": language.number(1e2 * farthest),
            }
            sentences.append(
                " ".join(
                    [
                        language.say("summary.reach", task=task, longer=longer, **far),
                        *_of_trunk(trials, language),
                    ]
                )
            )
        elif reason := next(
            (
                f.reason
                for t in trials
                for f in t.result.figures
                if f.name == "reach_distance" and f.reason
            ),
            "",
        ):
            sentences.append(
                language.say("summary.reach.none", task=task, reason=language.translate(reason))
            )
    return sentences


def _of_trunk(trials: Sequence[Task], language: Language) -> list[str]:
    """The volume of the places that were reached, the trunk's lean and how far that carried it; what is not known is left out."""
    volume, lean, forward = (
        _mean(trials, f"reach_{name}") for name in ("volume", "trunk_lean", "trunk_forward")
    )
    sentences = (
        [language.say("summary.reach.volume", volume=language.number(1e3 * volume, 1))]
        if volume >= LEAST_VOLUME
        else []
    )
    if np.isfinite(lean):
        key = (
            "summary.reach.lean"
            if np.isnan(forward)
            else "summary.reach.trunk"
            if forward > -LEAST_FORWARD
            else "summary.reach.back"
        )
        facts = {} if np.isnan(forward) else {"forward": language.number(1e2 * abs(forward))}
        sentences.append(language.say(key, lean=language.number(lean * DEG), **facts))
    return sentences


HELD = {  # by measure: of its sentence each gap's figure, what it is multiplied by, and its decimals; the first says whether there is anything to tell
    "lift": {"count": ("lift_count", 1.0, 0), "grip": ("lift_grip_hold", 1.0, 1), "load": ("lift_load_hold", 1.0, 1), "time": ("lift_time_to_lift", 1.0, 1)},
    "squeeze": {"count": ("squeeze_count", 1.0, 0), "force": ("squeeze_force", 1.0, 1), "depth": ("squeeze_depth", 1e3, 0)},
}  # fmt: skip


def _held(content: Content, language: Language) -> list[str]:
    """Means over the trials of each task of lifting or squeezing, or why there are none."""
    sentences = []
    for measure, gaps in HELD.items():
        for title in dict.fromkeys(t.title for t in content.tasks if t.result.measure == measure):
            trials = [t for t in content.tasks if t.title == title and t.result.measure == measure]
            values = {
                gap: (factor * _mean(trials, name), decimals)
                for gap, (name, factor, decimals) in gaps.items()
            }
            facts = {
                gap: language.number(value, decimals)
                for gap, (value, decimals) in values.items()
                if np.isfinite(value)
            }
            reasons = [f.reason for t in trials for f in t.result.figures if f.reason]
            if len(facts) == len(gaps):
                sentences.append(
                    language.say(f"summary.{measure}", task=language.translate(title), **facts)
                )
            elif reasons:
                sentences.append(
                    language.say(
                        "summary.held.none",
                        task=language.translate(title),
                        reason=language.translate(reasons[0]),
                    )
                )
    return sentences


def _mean(trials: Sequence[Task], name: str) -> float:
    """Over the trials that have it and whose signal is not poor; NaN where none has."""
    found = [
        f.value
        for t in trials
        for f in t.result.figures
        if f.name == name and f.grade != "poor" and np.isfinite(f.value)
    ]
    return float(np.mean(found)) if found else float("nan")


def _changes(found: Changes, language: Language) -> str:
    """How many figures changed by more than measurement error, and which most."""
    judged = [c for c in found.each if c.mdc95 is not None]
    beyond = [c for c in judged if c.beyond]
    day = language.day(found.since)
    if not beyond:
        return language.counted("summary.unchanged", len(judged), day=day)
    beyond.sort(key=lambda c: -abs(c.value) / (c.mdc95 or np.inf))
    most = [named_change(c, language) for c in beyond[:CHANGED]]
    more = [language.counted("summary.more", len(beyond) - CHANGED)]
    named = language.several([*most, *(more if len(beyond) > CHANGED else [])])
    return language.counted(
        "summary.changed", len(beyond), day=day, all=f"{len(judged)}", figures=named
    )


def _trust(content: Content, language: Language) -> str:
    """How far the figures can be relied on, by the rules of the results page."""
    rows = [(t.result.task, f) for t in content.tasks for f in t.result.figures if not f.detail]
    if not rows:
        return ""
    calibrated = bool(content.self_calibration) or any(c.sensors for c in content.calibrations)
    trust = judge_trust(
        rows,
        calibrated,
        content.edition,
        content.drifts,
        content.asks_hand,
        faulty_sensors(content.warnings),
        bent_joints(content.warnings),
    )
    asked = (t for t in content.tasks if t.result.task != WHOLE)
    titles = {t.result.task: language.translate(t.title) for t in asked}
    return " ".join(trust_sentences(trust, titles, language, content.edition))
