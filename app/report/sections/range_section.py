"""The section on ranges of motion: table, bars, curves, and what to know to read them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.change_words import range_changes, row_ends
from handscope.app.report.content import Content, Curve, Task
from handscope.app.report.references import Reference
from handscope.app.report.sections import plots
from handscope.app.report.sections.range_comparison import (
    flexion_with_sd,
    other_hand,
    reference_of,
    reference_span,
)
from handscope.app.report.sections.range_rows import (
    RangeRow,
    asks_full_range,
    over_tasks,
    range_rows,
)
from handscope.app.report.units import DEG
from handscope.app.report.words import extension_words, flexion_words, grade_words, span_words
from handscope.estimators.hand.anatomy import FINGERS, JOINTS
from handscope.estimators.measures import range_of_motion
from handscope.estimators.measures.range_of_motion import Range

CHART_WIDTH, CURVES = 510.0, (510.0, 64.0)  # pt
COLUMNS = {
    "flexion": ("value", "other", "reference", "change"),
    "extension": ("value", "other", "change"),
    "sideways": ("value",),
}
NOTHING = ["", ""]


def range_section(
    content: Content, tasks: Sequence[Task], language: Language, bars: bool = True
) -> dict[str, Any]:
    """The ranges of trials; without bars where the table says enough."""
    say = language.say
    full = asks_full_range(tasks[0].result.task)
    ranges = over_tasks(tasks)
    rows = range_rows(ranges, full, language)
    head = {
        "title": say("ranges.title" if full else "ranges.reached"),
        "task": span_words(tasks, language),
    }
    if not rows:
        return head | {"absent": say("ranges.absent")}
    ticks = content.edition.references if full else ()
    curves = _joined_curves(tasks)
    return head | {
        "absent": "",
        "table": _table(content, tasks, rows, full, language),
        "chart": plots.range_chart(rows, ticks, CHART_WIDTH, language) if bars else "",
        "chart_alt": language.counted("ranges.chart", len(rows)),
        "chart_label": " ".join([say("ranges.bars"), *([say("ranges.ticks")] if ticks else [])]),
        "curves": plots.flexion_curves(curves, *CURVES, language) if curves else "",
        "curves_alt": say("ranges.curves"),
        "curves_label": say("ranges.curves.label"),
        "remarks": [*_reasons(rows, language), *_without(ranges, content.measured, language)],
        "changes": range_changes(content.changes, tasks, rows, language) if content.changes else "",
        "caption": " ".join(
            sentences for sentences in _caption(content, tasks, rows, ticks, language) if sentences
        ),
    }


def _table(
    content: Content,
    tasks: Sequence[Task],
    rows: Sequence[RangeRow],
    full: bool,
    language: Language,
) -> dict[str, Any]:
    """Columns that hold nothing in any row are left out; a cell is [words, weight], weight "", "strong" or "quiet"."""
    others = {(o.joint, o.angle): o for o in other_hand(content, tasks)} if full else {}
    cells = [_cells(content, tasks, row, others, full, language) for row in rows]
    used = {
        group: [c for c in columns if any(row[group].get(c, NOTHING)[0] for row in cells)]
        for group, columns in COLUMNS.items()
    }
    other = language.say(f"column.{'right' if content.hand == 'left' else 'left'}")
    return {
        "groups": [[language.say(g), len(columns)] for g, columns in used.items() if columns],
        "columns": [
            {"group": g, "kind": c, "words": other if c == "other" else language.say(f"column.{c}")}
            for g, columns in used.items()
            for c in columns
        ],
        "signal": any(row.grade != "good" for row in rows),
        "rows": [
            {
                "finger": row.group if k == 0 or row.group != rows[k - 1].group else "",
                "joint": row.joint,
                "cells": [words[g].get(c, NOTHING) for g, columns in used.items() for c in columns],
                "grade": [row.grade, grade_words(row.grade, language)],
            }
            for k, (row, words) in enumerate(zip(rows, cells))
        ],
    }


def _cells(
    content: Content,
    tasks: Sequence[Task],
    row: RangeRow,
    others: Mapping[tuple[str, str], Range],
    full: bool,
    language: Language,
) -> dict[str, dict[str, list[str]]]:
    """Of one row by group and column."""
    bend = row.bend
    found: dict[str, dict[str, list[str]]] = {
        "flexion": {},
        "extension": {},
        "sideways": {"value": [row.sideways, ""]},
    }
    if bend is None or bend.angle != "flexion":
        return found
    changed = row_ends(content.changes, tasks, row, language) if content.changes else {}
    other = others.get((bend.joint, bend.angle))
    deficit = full and round(bend.smallest * DEG) > 0 and bend.joint != "thumb_cmc"
    found["flexion"]["value"] = [flexion_with_sd(tasks, row, language), "strong"]
    found["extension"]["value"] = [row.extension, "strong" if deficit else ""]
    if other:
        found["flexion"]["other"] = [flexion_words(other.largest, language), "quiet"]
        found["extension"]["other"] = [
            extension_words(bend.joint, other.smallest, other.largest, language, short=True),
            "quiet",
        ]
    if full and (reference := reference_of(bend, "largest", content.edition)):
        found["flexion"]["reference"] = [reference_span(reference), "quiet"]
    for group, words in changed.items():
        found[group]["change"] = [words, "strong"]
    return found


def _joined_curves(tasks: Sequence[Task]) -> list[Curve]:
    """Of every joint the flexion in the tasks that asked for it, one task behind the other with a break between them."""
    joined = []
    for joint in (j.name for j in JOINTS):
        pieces = [
            c
            for t in tasks
            if t.asks(joint, "flexion")
            for c in t.curves
            if c.joint == joint and len(c.t)
        ]
        starts = np.cumsum([0.0, *(c.t[-1] for c in pieces)])
        if pieces:
            t = np.concatenate(
                [np.append(c.t, c.t[-1]) + start for c, start in zip(pieces, starts)]
            )
            joined.append(
                Curve(joint, t, np.concatenate([np.append(c.angle, np.nan) for c in pieces]))
            )
    return joined


def _caption(
    content: Content,
    tasks: Sequence[Task],
    rows: Sequence[RangeRow],
    ticks: Sequence[Reference],
    language: Language,
) -> list[str]:
    change, say = content.edition.smallest_change, language.say
    other = content.course.other if content.course else None
    return [
        say("ranges.held", seconds=language.number(range_of_motion.Params().hold / 2, 1)),
        *(
            say("sd.basis", basis=language.translate(basis))
            for basis in dict.fromkeys(t.result.sd_basis for t in tasks)
            if basis
        ),
        say("ranges.sources", sources=_sources(rows, ticks, language))
        if ticks
        else say("ranges.not_full"),
        say("ranges.extension", joints=_extension(rows, ticks, language)) if ticks else "",
        say("ranges.change") if content.changes else "",
        say("ranges.other", day=language.day(other.started), hour=language.hour(other.started))
        if other and ticks
        else "",
        say("ranges.joints"),
        say("ranges.terms"),
        say("ranges.trusted", size=f"{change.value:g}", source=change.source.name)
        if ticks and not content.changes
        else "",
    ]


def _extension(rows: Sequence[RangeRow], ticks: Sequence[Reference], language: Language) -> str:
    """The joints of the table whose extension is not to be just full: "Thumb IP 12° hyperextension"."""
    drawn = {r.joint: row for row in rows for r in row.ranges if r.angle == "flexion"}
    beyond = [
        f
        for f in ticks
        if f.joint in drawn and (f.angle, f.end) == ("flexion", "smallest") and f.degrees
    ]
    named = [
        f"{drawn[f.joint].group} {drawn[f.joint].joint}".strip()
        + f" {extension_words(f.joint, f.degrees / DEG, 1.0, language)}"
        for f in beyond
    ]
    return ", ".join(["", *named])


def _sources(rows: Sequence[RangeRow], ticks: Sequence[Reference], language: Language) -> str:
    """Names of the sources of the ticks drawn, with the parts of the hand they are used for."""
    drawn = {(r.joint, r.angle) for row in rows for r in row.ranges}
    parts: dict[str, list[str]] = {}
    for reference in ticks:
        if (reference.joint, reference.angle) in drawn:
            part = reference.joint.partition("_")[0]
            palmar = (reference.joint, reference.angle) == ("thumb_cmc", "flexion")
            word = language.say(
                "source.palmar_abduction"
                if palmar
                else f"source.{part if part in ('wrist', 'thumb') else 'fingers'}"
            )
            for source in (r.source.name for r in (reference, reference.also) if r):
                parts.setdefault(source, [])
                if word not in parts[source]:
                    parts[source].append(word)
    return language.several(
        language.labelled(language.all_of(words), name) for name, words in parts.items()
    )


def _reasons(rows: Sequence[RangeRow], language: Language) -> list[str]:
    """Why a signal is not good, joints with the same reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for reason in row.reasons if row.grade != "good" else ():
            found.setdefault((row.grade, reason), []).append(f"{row.group} {row.joint}".strip())
    sentences = (
        language.say(
            "ranges.because",
            grade=grade_words(grade, language),
            joints=", ".join(joints),
            reason=language.translate(reason),
        )
        for (grade, reason), joints in found.items()
    )
    return [s[0].upper() + s[1:] for s in sentences]


def _without(ranges: Sequence[Range], measured: Sequence[str], language: Language) -> list[str]:
    """Wrist and fingers that the table lacks, and why."""
    lacking = [
        part
        for part in ("wrist", *FINGERS)
        if part not in {r.joint.partition("_")[0] for r in ranges}
    ]
    worn = [
        part
        for part in lacking
        if any(
            j.parent in measured and j.child in measured for j in JOINTS if j.name.startswith(part)
        )
    ]
    reasons = {
        "ranges.without_sensors": [p for p in lacking if p not in worn],
        "ranges.not_asked": worn,
    }
    return [
        language.say(key, parts=", ".join(language.say(f"part.{part}") for part in parts))
        for key, parts in reasons.items()
        if parts
    ]
