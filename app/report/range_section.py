"""The section on ranges of motion: table, bars, curves, and what to know to read them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.language import Language
from app.report import plots
from app.report.change_words import range_changes
from app.report.changes import Changes
from app.report.content import Curve, Task
from app.report.range_rows import RangeRow, asks_full_range, over_tasks, range_rows
from app.report.references import Reference, references, smallest_change
from app.report.words import grade_words, span_words
from estimators.hand_anatomy import FINGERS, JOINTS
from estimators.measures import range_of_motion
from estimators.measures.range_of_motion import Range

CHART_WIDTH, CURVES = 206.0, (516.0, 54.0)  # pt


def range_section(tasks: Sequence[Task], measured: Sequence[str], language: Language, changes: Changes | None = None) -> dict[str, Any]:
    say = language.say
    full = asks_full_range(tasks[0].result.task)
    ranges = over_tasks(tasks)
    rows = range_rows(ranges, full, language)
    head = {"title": say("ranges.title" if full else "ranges.reached"), "task": span_words(tasks, language)}
    if not rows:
        return head | {"absent": say("ranges.absent")}
    ticks = references() if full else ()
    curves = _joined_curves(tasks)
    return head | {
        "absent": "",
        "rows": [[r.group, r.joint, r.flexion, r.extension, r.sideways, [r.grade, grade_words(r.grade, language)]] for r in rows],
        "row": plots.ROW,
        "gap": plots.GROUP_GAP,
        "head": plots.HEAD,
        "chart": plots.range_chart(rows, ticks, CHART_WIDTH, language, labels=False),
        "chart_alt": say("ranges.chart", count=len(rows)),
        "curves": plots.flexion_curves(curves, *CURVES, language) if curves else "",
        "curves_alt": say("ranges.curves"),
        "curves_label": say("ranges.curves.label"),
        "remarks": [*_reasons(rows, language), *_without(ranges, measured, language)],
        "changes": range_changes(changes, tasks, rows, language) if changes else "",
        "caption": _caption(rows, ticks, changes, language),
    }


def _joined_curves(tasks: Sequence[Task]) -> list[Curve]:
    """Of every joint the flexion in the tasks that asked for it, one task behind the other with a break between them."""
    joined = []
    for joint in (j.name for j in JOINTS):
        pieces = [c for t in tasks if t.asks(joint, "flexion") for c in t.curves if c.joint == joint and len(c.t)]
        starts = np.cumsum([0.0, *(c.t[-1] for c in pieces)])
        if pieces:
            t = np.concatenate([np.append(c.t, c.t[-1]) + start for c, start in zip(pieces, starts)])
            joined.append(Curve(joint, t, np.concatenate([np.append(c.angle, np.nan) for c in pieces])))
    return joined


def _caption(rows: Sequence[RangeRow], ticks: Sequence[Reference], changes: Changes | None, language: Language) -> list[str]:
    change, say = smallest_change(), language.say
    return [
        say("ranges.held", seconds=language.number(range_of_motion.Params().hold / 2, 1)),
        say("ranges.ticks", sources=_sources(rows, ticks, language)) if ticks else say("ranges.not_full"),
        say("ranges.bars"),
        say("ranges.terms"),
        say("ranges.trusted", size=f"{change.value:g}", source=change.source.name) if ticks and not changes else "",
    ]


def _sources(rows: Sequence[RangeRow], ticks: Sequence[Reference], language: Language) -> str:
    """Names of the sources of the ticks drawn, with the parts of the hand they are used for."""
    drawn = {(r.joint, r.angle) for row in rows for r in row.ranges}
    parts: dict[str, list[str]] = {}
    for reference in ticks:
        if (reference.joint, reference.angle) in drawn:
            part = reference.joint.partition("_")[0]
            palmar = (reference.joint, reference.angle) == ("thumb_cmc", "flexion")
            word = language.say("source.palmar_abduction" if palmar else f"source.{part if part in ('wrist', 'thumb') else 'fingers'}")
            parts.setdefault(reference.source.name, [])
            if word not in parts[reference.source.name]:
                parts[reference.source.name].append(word)
    return "; ".join(f"{language.all_of(words)}: {name}" for name, words in parts.items())


def _reasons(rows: Sequence[RangeRow], language: Language) -> list[str]:
    """Why a signal is not good, joints with the same reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for reason in row.reasons if row.grade != "good" else ():
            found.setdefault((row.grade, reason), []).append(f"{row.group} {row.joint}".strip())
    said = (
        language.say("ranges.because", grade=grade_words(grade, language), joints=", ".join(joints), reason=_heard(reason, language))
        for (grade, reason), joints in found.items()
    )
    return [s[0].upper() + s[1:] for s in said]


def _heard(reasons: str, language: Language) -> str:
    return "; ".join(language.heard(reason) for reason in reasons.split("; "))


def _without(ranges: Sequence[Range], measured: Sequence[str], language: Language) -> list[str]:
    """Wrist and fingers that the table lacks, and why."""
    lacking = [part for part in ("wrist", *FINGERS) if part not in {r.joint.partition("_")[0] for r in ranges}]
    worn = [part for part in lacking if any(j.parent in measured and j.child in measured for j in JOINTS if j.name.startswith(part))]
    reasons = {"ranges.without_sensors": [p for p in lacking if p not in worn], "ranges.not_asked": worn}
    return [language.say(key, parts=", ".join(language.say(f"part.{part}") for part in parts)) for key, parts in reasons.items() if parts]
