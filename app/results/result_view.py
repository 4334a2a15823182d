"""A result for pages: ranges in the report's words, figures in readable units, quality of the calibration."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.protocols import Protocol
from handscope.app.report.change_words import row_words, tapping_words
from handscope.app.report.changes import Changes
from handscope.app.report.content import OtherHand, Task, asked, list_not_done
from handscope.app.report.gradings import DEFAULT, grade_tasks
from handscope.app.report.norms import norm_of
from handscope.app.report.progress.importance import leading_ranges
from handscope.app.report.references import Edition
from handscope.app.report.sections.other_measures import other_measures
from handscope.app.report.sections.range_comparison import flexion_with_sd
from handscope.app.report.sections.range_rows import (
    asks_full_range,
    by_task,
    over_tasks,
    range_rows,
)
from handscope.app.report.sections.shown_panels import shown_of
from handscope.app.report.summary import not_done_row
from handscope.app.report.trust.judgement import judge_trust, trust_payload
from handscope.app.report.trust.leading_findings import (
    bent_joints,
    faulty_sensors,
    leading_findings,
    questions,
)
from handscope.app.report.units import DEG, TAPPING_ROWS, places_of, reading
from handscope.app.report.words import calibration_words, figure_words
from handscope.app.results.hand_history import resembles_other_hand
from handscope.app.results.headlines import FOLDED, finger_rows, headlines, joint_deficits
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.resting_drift import Drift
from handscope.estimators.measures.total_active_motion import GRADINGS
from handscope.estimators.messages.sentence import codes_of
from handscope.sessions.clinic.references import Compared

# measures that have a headline or a table of their own
FOLDING = "total_active_motion", "open_close", "pronation_supination", "independence"
NORM_TEXTS = frozenset({"name", "reference", "note"})
CALIBRATION = {"rate_wander": "deg/s", "tilt_change": "deg", "bias": "deg/s", "misalignment": "deg"}


def readings(  # noqa: PLR0913
    content: Mapping[str, Any],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
    changes: Changes | None = None,
    lean: bool = False,
    grading: str = DEFAULT,
    other_hand: OtherHand | None = None,
    edition: Edition | None = None,
    compared: Compared | None = None,
    warnings: Sequence[str] = (),
) -> dict[str, Any]:
    """Tables for pages from a stored result's content, figures and warnings, `lean` without the list of figures; empty before it is done."""
    tasks = content.get("tasks", [])
    missed = list_not_done(content.get("events", ()), protocols)
    return {
        "not_done": [not_done_row(n, language) for n in missed],
        "ranges": _ranges(
            [t for t in tasks if t["measure"] == "range_of_motion"],
            figures,
            protocols,
            language,
            changes,
        ),
        "tapping": _tapping(
            [t for t in tasks if t["measure"] == "tapping"], figures, protocols, language
        ),
        "calibration": calibration_payload(content.get("calibration"), language),
        "headlines": _headlines(figures, protocols, language, changes, compared, edition),
        "joints": joint_deficits(
            [
                t
                for t in _range_tasks(tasks, figures, protocols, language)
                if asks_full_range(t.result.task)
            ],
            language,
            compared,
            edition,
        ),
        "trust": _trust(
            content, figures, protocols, language, changes, compared, edition, warnings
        ),
        "changes": _changes(changes, protocols, language) if changes else None,
        "others": _others(
            tasks, figures, protocols, language, grading, other_hand, edition, changes
        ),
    } | ({} if lean else {"figures": [_figure_payload(f, language, edition) for f in figures]})


def _headlines(
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
    changes: Changes | None,
    compared: Compared | None,
    edition: Edition | None,
) -> list[dict[str, Any]]:
    """Two to four figures a task, with the other hand, the norm and the change."""
    rows = [(f["task"], f["measure"], _stored_figure(f)) for f in figures]
    titles = {task: _title({"task": task}, protocols.get(task), language) for task, _, _ in rows}
    ranges = {task: leading_ranges(protocols.get(task)) for task in titles}
    return headlines(rows, titles, language, changes, compared, edition, ranges)


def _trust(
    content: Mapping[str, Any],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
    changes: Changes | None,
    compared: Compared | None,
    edition: Edition | None,
    warnings: Sequence[str],
) -> dict[str, Any]:
    """Whether the figures can be trusted, by the rules of app/report/trust/judgement.py, and which sensors lower them."""
    rows = [(f["task"], _stored_figure(f)) for f in figures if not f.get("detail")]
    titles = {task: _title({"task": task}, protocols.get(task), language) for task, _ in rows}
    posed = bool((content.get("calibration") or {}).get("quality"))
    calibrated = posed or bool(content.get("self_calibration"))
    drifts = [Drift(**d) for d in content.get("drift", ())]
    measured = [(f["task"], f["measure"], _stored_figure(f)) for f in figures]
    asks_hand = resembles_other_hand(measured, changes, compared)
    faulty, bent = faulty_sensors(warnings), bent_joints(warnings)
    found = judge_trust(rows, calibrated, edition, drifts, asks_hand, faulty, bent)
    untested = content.get("untested") or {}
    return trust_payload(found, titles, language, edition, untested) | {
        "questions": [language.translate(text) for text in questions(warnings)],
        "findings": [language.translate(text) for text in leading_findings(found, warnings)],
    }


def _figure_payload(
    row: Mapping[str, Any], language: Language, edition: Edition | None
) -> dict[str, Any]:
    """A figure in a readable unit, with its uncertainty, grade, source and norm."""
    value, sd = _read(row, row["value"]), _read(row, row.get("sd"))
    what, part = row.get("what") or row["name"], row.get("part", "")
    norm = norm_of(what, part, row["task"], edition)
    return {
        **{
            key: row.get(key, "")
            for key in ("task", "measure", "onset", "name", "grade", "category", "detail")
        },
        "part": part,
        "what": what,
        "value": value[0],
        "sd": sd[0],
        "unit": value[1],
        "reason": language.translate(row["reason"]),
        "codes": sorted(codes_of(row["reason"])),
        "meaning": language.translate(row.get("meaning", "")),
        "meaning_codes": sorted(codes_of(row.get("meaning", ""))),
        "source": language.translate(row["source"]),
        "source_codes": sorted(codes_of(row["source"])),
        "sd_basis": language.translate(row.get("sd_basis", "")),
        "norm": language.translate_keys(asdict(norm), NORM_TEXTS) if norm else None,
    }


def _read(row: Mapping[str, Any], value: float | None) -> tuple[float | None, str]:
    read = reading(
        Figure(row["name"], np.nan if value is None else value, row["unit"], row["source"])
    )
    return (read.value if np.isfinite(read.value) else None), read.unit


def _changes(
    changes: Changes, protocols: Mapping[str, Protocol], language: Language
) -> dict[str, Any]:
    """Since when, the sources, and the words for the tapping tasks; those for ranges are in their rows."""
    tapping = [
        {
            "title": _title({"task": task}, protocols.get(task), language),
            "figures": [
                {
                    "name": c.name,
                    "label": figure_words(c.name, language),
                    "words": words,
                    "beyond": c.beyond,
                    "judged": c.mdc95 is not None,
                }
                for c, words in figures
            ],
        }
        for task, figures in tapping_words(changes, language).items()
    ]
    sources = {
        measure: [language.translate(s) for s in changes.sources(measure)]
        for measure in ("range_of_motion", "tapping")
    }
    return {"since": changes.since, "sources": sources, "tapping": tapping}


def _ranges(
    trials: list[dict[str, Any]],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
    changes: Changes | None,
) -> list[dict[str, Any]]:
    """One table over the tasks that asked for the full range, then one for the trials of each of the others."""
    tasks = _range_tasks(trials, figures, protocols, language)
    full = [t for t in tasks if asks_full_range(t.result.task)]
    groups = ([full] if full else []) + by_task([t for t in tasks if t not in full])
    return [
        {
            "full": group[0] in full,
            "tasks": list(dict.fromkeys(t.title for t in group)),
            "rows": rows,
        }
        for k, (group, rows) in enumerate(
            (group, _rows(group, group[0] in full, language, changes)) for group in groups
        )
        if rows or not k
    ]


def _range_tasks(
    tasks: list[dict[str, Any]],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
) -> list[Task]:
    """The trials whose ranges were measured."""
    figures_of = _by_task(figures)
    return [
        _task(t, figures_of.get(_key(t), ()), protocols.get(t["task"]), language)
        for t in tasks
        if t["measure"] == "range_of_motion"
    ]


def _task(
    trial: Mapping[str, Any],
    figures: Sequence[Figure],
    protocol: Protocol | None,
    language: Language,
) -> Task:
    ranges = [Range(**r) for r in trial["ranges"]]
    return Task(
        TaskResult(
            trial["task"], trial["measure"], trial["onset"], trial["end"], ranges, tuple(figures)
        ),
        _title(trial, protocol, language),
        "",
        asked(protocol),
    )


def _rows(
    tasks: list[Task], full: bool, language: Language, changes: Changes | None
) -> list[dict[str, Any]]:
    return [
        {
            "group": r.group,
            "joint": r.joint,
            "flexion": flexion_with_sd(tasks, r, language),
            "extension": r.extension,
            "sideways": r.sideways,
            "grade": r.grade,
            "reasons": [language.translate(reason) for reason in r.reasons],
            "changes": row_words(changes, tasks, r, language) if changes else {},
        }
        for r in range_rows(over_tasks(tasks), full, language)
    ]


def _others(
    tasks: list[dict[str, Any]],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
    grading: str,
    other_hand: OtherHand | None,
    edition: Edition | None,
    changes: Changes | None,
) -> list[dict[str, Any]]:
    """Measures that have no card of their own, as the report has them, with the norms of their figures."""
    figures_of = _by_task(figures)
    trials = [
        Task(
            TaskResult(
                t["task"],
                t["measure"],
                t["onset"],
                t["end"],
                None,
                tuple(figures_of.get(_key(t), ())),
                shown_of(t.get("shown")),
            ),
            _title(t, protocols.get(t["task"]), language),
            getattr(MEASURES.get(t["measure"]), "TITLE", t["measure"]),
            None,
        )
        for t in tasks
    ]
    graded = grade_tasks(trials, grading, other_hand)
    sections = other_measures(graded, language, edition)
    choices = [[scheme, language.say(f"grading.{scheme}")] for scheme in GRADINGS]
    return [
        {
            **s,
            "gradings": choices if s["grading"] else [],
            "fingers": finger_rows(s, graded, language, changes),
            "folded": s["measure"] in FOLDING and len(s["rows"]) > FOLDED,
            "curves": [[trial, [asdict(p) for p in panels]] for trial, panels in s["curves"]],
        }
        for s in sections
        if s["rows"]
    ]


def _by_task(figures: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, float], list[Figure]]:
    """Stored figures by their trial."""
    by_trial: dict[tuple[str, str, float], list[Figure]] = {}
    for row in figures:
        by_trial.setdefault(_key(row), []).append(_stored_figure(row))
    return by_trial


def _key(of: Mapping[str, Any]) -> tuple[str, str, float]:
    """The key that a trial shares with its figures."""
    return of["task"], of["measure"], of.get("onset", 0.0)


def _stored_figure(row: Mapping[str, Any]) -> Figure:
    """A figure from its stored row; fields that older rows lack are empty."""
    stored = {f.name: row[f.name] for f in fields(Figure) if row.get(f.name) is not None}
    return Figure(**{**stored, "value": np.nan if row["value"] is None else row["value"]})


def _tapping(
    trials: list[dict[str, Any]],
    figures: list[dict[str, Any]],
    protocols: Mapping[str, Protocol],
    language: Language,
) -> list[dict[str, Any]]:
    """Trials in order of time with the figures that have a row; stored figures are in the same order, equally many a trial."""
    rows = [f for f in figures if f["measure"] == "tapping" and f["name"] in TAPPING_ROWS]
    each = len(rows) // len(trials) if trials else 0
    rows_of_trials = []
    for k, t in enumerate(trials):
        rows_of_trials.append(
            {
                "title": _title(t, protocols.get(t["task"]), language),
                "onset": t["onset"],
                "end": t["end"],
                "closings": t["closings"],
                "amplitudes_mm": [round(1e3 * a, 2) for a in t["amplitudes"]],
                "grade": t["grade"],
                "reason": language.translate(t["reason"]),
                "figures": [_figure(f, language) for f in rows[k * each : (k + 1) * each]],
            }
        )
    return rows_of_trials


def _figure(row: Mapping[str, Any], language: Language) -> dict[str, Any]:
    value = np.nan if row["value"] is None else row["value"]
    read = reading(
        Figure(
            row["name"], value, row["unit"], row["source"], row["sd"], row["grade"], row["reason"]
        )
    )
    number = read.value if np.isfinite(read.value) else None
    sd = _read(row, row["sd"])[0] or None
    return {
        "name": row["name"],
        "label": figure_words(row["name"], language),
        "value": number,
        "sd": sd,
        "unit": read.unit,
        "decimals": 0 if number is None else places_of(row["name"], number, read.unit),
    }


def calibration_payload(
    calibration: Mapping[str, Any] | None, language: Language
) -> dict[str, Any] | None:
    """The sensor with the largest value of each quality, in deg and deg/s."""
    if not calibration or not calibration["quality"]:
        return None
    quality = calibration["quality"]
    worst = {name: max(quality, key=lambda s: quality[s][name]) for name in CALIBRATION}
    rows = [
        {"name": n, "segment": s, "value": round(DEG * quality[s][n], 2), "unit": CALIBRATION[n]}
        for n, s in worst.items()
    ]
    return {
        "source": language.translate(calibration["source"]),
        "onset": calibration["onset"],
        "end": calibration["end"],
        "sensors": len(quality),
        "largest": rows,
        "joints": calibration_words(calibration.get("joints", ()), language),
    }


def _title(trial: Mapping[str, Any], protocol: Protocol | None, language: Language) -> str:
    return (
        language.translate(protocol.title)
        if protocol
        else str(trial["task"]).replace("_", " ").capitalize()
    )
