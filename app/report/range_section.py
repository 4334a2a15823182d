"""The section on ranges of motion: table, bars, curves, and what to know to read them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.report import plots
from app.report.change_words import range_changes
from app.report.changes import Changes
from app.report.content import Curve, Task
from app.report.range_rows import RangeRow, asks_full_range, over_tasks, range_rows
from app.report.references import Reference, references, smallest_change
from app.report.words import span_words
from estimators.hand_anatomy import FINGERS, JOINTS
from estimators.measures import range_of_motion
from estimators.measures.range_of_motion import Range

CHART_WIDTH, CURVES = 206.0, (516.0, 54.0)  # pt


def range_section(tasks: Sequence[Task], measured: Sequence[str], changes: Changes | None = None) -> dict[str, Any]:
    full = asks_full_range(tasks[0].result.task)
    ranges = over_tasks(tasks)
    rows = range_rows(ranges, full)
    head = {"title": "Range of motion" if full else "Angles reached", "task": span_words(tasks)}
    if not rows:
        return head | {"absent": "No joint could be measured here: samples are missing or unusable."}
    ticks = references() if full else ()
    curves = _joined_curves(tasks)
    return head | {
        "absent": "",
        "rows": [[r.group, r.joint, r.flexion, r.extension, r.sideways, r.grade] for r in rows],
        "row": plots.ROW,
        "gap": plots.GROUP_GAP,
        "head": plots.HEAD,
        "chart": plots.range_chart(rows, ticks, CHART_WIDTH, labels=False),
        "chart_alt": f"Bars from the smallest to the largest angle of the {len(rows)} rows of the table beside it.",
        "curves": plots.flexion_curves(curves, *CURVES) if curves else "",
        "curves_alt": "Flexion over time, one panel for the wrist and each finger, in degrees.",
        "curves_label": "Flexion in degrees over seconds of the tasks. Solid: MCP (thumb: CMC); dashed: PIP (MCP); dotted: DIP (IP).",
        "remarks": [*_reasons(rows), *_without(ranges, measured)],
        "changes": range_changes(changes, tasks, rows) if changes else "",
        "caption": _caption(rows, ticks, changes),
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


def _caption(rows: Sequence[RangeRow], ticks: Sequence[Reference], changes: Changes | None) -> list[str]:
    change = smallest_change()
    trusted = (
        f"A change of a joint by less than {change.value:g}° between sessions can be measurement error ({change.source.name}, optical)."
    )
    return [
        f"Largest and smallest angles held for at least {range_of_motion.Params().hold / 2:g} s.",
        f"Ticks, and zero for extension: reference values ({_sources(rows, ticks)})."
        if ticks
        else "The task did not ask for the full range.",
        "Bars: solid for a good signal, light for fair, hatched for poor.",
        "CMC flexion is palmar abduction, CMC turn pronation; abd. of a finger is away from the middle finger.",
        trusted if ticks and not changes else "",
    ]


def _sources(rows: Sequence[RangeRow], ticks: Sequence[Reference]) -> str:
    """Names of the sources of the ticks drawn, with the parts of the hand they are used for."""
    drawn = {(r.joint, r.angle) for row in rows for r in row.ranges}
    parts: dict[str, list[str]] = {}
    for reference in ticks:
        if (reference.joint, reference.angle) in drawn:
            part = reference.joint.partition("_")[0]
            palmar = (reference.joint, reference.angle) == ("thumb_cmc", "flexion")
            word = "palmar abduction" if palmar else part if part in ("wrist", "thumb") else "fingers"
            parts.setdefault(reference.source.name, [])
            if word not in parts[reference.source.name]:
                parts[reference.source.name].append(word)
    return "; ".join(f"{' and '.join(words)}: {name}" for name, words in parts.items())


def _reasons(rows: Sequence[RangeRow]) -> list[str]:
    """Why a signal is not good, joints with the same reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for reason in row.reasons if row.grade != "good" else ():
            found.setdefault((row.grade, reason), []).append(f"{row.group} {row.joint}".strip())
    return [f"{grade.capitalize()} signal of {', '.join(joints)}: {reason}." for (grade, reason), joints in found.items()]


def _without(ranges: Sequence[Range], measured: Sequence[str]) -> list[str]:
    """Wrist and fingers that the table lacks, and why."""
    lacking = [part for part in ("wrist", *FINGERS) if part not in {r.joint.partition("_")[0] for r in ranges}]
    worn = [part for part in lacking if any(j.parent in measured and j.child in measured for j in JOINTS if j.name.startswith(part))]
    reasons = {"Without sensors": [p for p in lacking if p not in worn], "Not asked for, or without usable samples": worn}
    return [f"{reason}: {', '.join(parts)}." for reason, parts in reasons.items() if parts]
