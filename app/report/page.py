"""The report in words: a Content as sentences, tables of words and figures; the layout (report.typ) only places them.

Everything is a string, a list or a dict of them; user's text stays as it was typed.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.content import (
    CalibrationFacts,
    Content,
    GoalReading,
    LeftOut,
    StreamFacts,
    Task,
)
from handscope.app.report.progress.labels import label
from handscope.app.report.sections.both_hands import both_hands_section
from handscope.app.report.sections.key_figures import key_figures
from handscope.app.report.sections.measure_plots import draw_panels
from handscope.app.report.sections.other_measures import other_measures
from handscope.app.report.sections.range_rows import asks_full_range, by_task
from handscope.app.report.sections.range_section import range_section
from handscope.app.report.sections.self_calibration import section as self_calibration_section
from handscope.app.report.sections.tapping_section import TRIALS, tapping_section
from handscope.app.report.sections.trend_section import trend_section
from handscope.app.report.summary import not_done_row, summary
from handscope.app.report.tables import data_checksum
from handscope.app.report.units import DEG, places_of, unit_words, with_unit
from handscope.app.report.words import calibration_words, device_words, moment_words
from handscope.estimators.data.calibration import SensorQuality
from handscope.estimators.data.samples import FORCE
from handscope.estimators.messages.sentence import Sentence

Page = dict[str, Any]

WARNINGS = 8  # of them on the page
HEADINGS = (  # words that the layout places
    "report.title", "summary", "further", "quality", "provenance", "warnings",
    "notes", "conclusion", "goals.title", "examiner", "signature", "date", "joint", "signal", "figure", "unit", "norm", "reason", "quality.over_all",
    "quality.median", "quality.largest", "quality.worst", "not_done", "scores", "left_out", "advice.title", "technical", "notes.none", "checksums",
)  # fmt: skip


def words_of(content: Content, language: Language) -> Page:
    """Everything that the layout places, by its name there."""
    main, further = _chosen(content)
    taps = [t for t in content.tasks if t.result.measure == "tapping"]
    say, checksum = language.say, content.recording.checksum[:12]
    named = content.visit.patient or say("not_named")
    return {
        "language": language.code,
        "words": {key.replace(".", "_"): say(key) for key in HEADINGS},
        "title": say("report.of", patient=named),
        "facts": _facts(content, language),
        "protocol": _protocol(content, language),
        "tag": say("notice.short"),
        "notice": say("notice"),
        "key_figures": key_figures(content, language),
        "summary": summary(content, language),
        "ranges": [range_section(content, trials, language) for trials in ([main] if main else [])],
        "tapping": [
            tapping_section(taps[k : k + TRIALS], k, len(taps), language, content.changes)
            for k in range(0, len(taps), TRIALS)
        ],
        "others": [
            draw_panels(section, language)
            for section in other_measures(content.tasks, language, content.edition)
        ],
        "further": [
            s
            for s in (range_section(content, trials, language, bars=False) for trials in further)
            if not s["absent"]
        ],
        "trends": [section for section in [trend_section(content, language)] if section],
        "self_calibration": self_calibration_section(content.self_calibration, language),
        "not_done": [
            [title, outcome, reason or say("no_reason")]
            for title, outcome, reason in (not_done_row(n, language) for n in content.not_done)
        ],
        "scores": [
            [language.translate(s.title), language.translate(s.scale), f"{s.score:g}"]
            for s in content.scores
        ],
        "left_out": [_left_out(part, language) for part in content.left_out],
        "calibration": _calibration(content.calibrations, language),
        "signal": _signal(content, language),
        "provenance": _provenance(content, language),
        "checksums": [
            [say("checksum.recording"), content.recording.checksum or say("not_known")],
            [say("checksum.figures"), data_checksum(content)],
        ],
        "warnings": _warnings(content, language),
        "notes": content.visit.notes.splitlines(),
        "conclusion": content.visit.conclusion.splitlines(),
        "both_hands": both_hands_section(content, language),
        "goals": [goal_row(goal, language) for goal in content.goals],
        "footer": " · ".join(
            [
                named,
                _day(content, language),
                say("footer.recording", checksum=checksum) if checksum else say("footer.without"),
            ]
        ),
    }


def goal_row(goal: GoalReading, language: Language) -> list[str]:
    """Figure, value, range and whether the value lies within, in words."""
    places = places_of(goal.name, goal.value, goal.unit)
    value, low, high = (language.number(n, places) for n in (goal.value, goal.low, goal.high))
    place = "not_reached" if goal.value < goal.low else "beyond"
    return [
        label(goal.name, language),
        with_unit(value, goal.unit, language),
        language.say("goals.range", low=low, high=with_unit(high, goal.unit, language)),
        language.say("goals.reached" if goal.low <= goal.value <= goal.high else f"goals.{place}"),
    ]


def _chosen(content: Content) -> tuple[list[Task], list[list[Task]]]:
    """The tasks whose ranges make the first page's table, and the trials of each that follows."""
    ranges = [t for t in content.tasks if t.result.measure == "range_of_motion"]
    full = [t for t in ranges if asks_full_range(t.result.task)]
    if full:
        return full, by_task([t for t in ranges if not asks_full_range(t.result.task)])
    first, *further = by_task(ranges) or [[]]
    return first, further


def _facts(content: Content, language: Language) -> list[list[str]]:
    visit, source, say = content.visit, content.recording.source, language.say
    side = (
        {content.hand: "affected", "both": "affected.both"}.get(visit.affected or "", "unaffected")
        if visit.affected
        else ""
    )
    dominance = say(f"dominant.{visit.dominant}") if visit.dominant else ""
    return [
        [say("fact.patient"), visit.patient or say("not_named"), ""],
        [
            say("fact.hand"),
            say(f"hand.{content.hand}"),
            ", ".join(w for w in (say(f"side.{side}") if side else "", dominance) if w),
        ],
        [say("fact.session"), _day(content, language), _hour(content, language)],
        [say("fact.examiner"), visit.examiner or say("not_given"), ""],
        [
            say("fact.glove"),
            _device(content, language) or say("not_recorded"),
            say("firmware", version=source["firmware"]) if source.get("firmware") else "",
        ],
    ]


def _protocol(content: Content, language: Language) -> str:
    """The protocol that led the session, by its title and version; "" where none did."""
    protocol = content.visit.protocol
    if not protocol.get("title"):
        return ""
    title = language.translate(protocol["title"])
    return language.say("fact.protocol", title=title, version=protocol["version"])


def _device(content: Content, language: Language) -> str:
    return device_words(str(content.recording.source.get("device") or ""), language)


def _hour(content: Content, language: Language) -> str:
    """The hour; and what the clock said where the date was corrected."""
    visit, hour = content.visit, language.hour(content.date) if content.date else ""
    if visit.recorded_as is None:
        return hour
    corrected = language.say(
        "fact.session.corrected",
        day=language.short_day(visit.recorded_as),
        hour=language.hour(visit.recorded_as),
    )
    return language.several([hour, f"{corrected} ({visit.date_reason})"])


def _day(content: Content, language: Language) -> str:
    return language.day(content.date) if content.date else language.say("no_date")


def _left_out(part: LeftOut, language: Language) -> list[str]:
    span = language.say(
        "left_out.span", start=language.number(part.onset, 1), end=language.number(part.end, 1)
    )
    return [
        language.translate(part.title),
        language.known(f"correction.{part.kind}", part.kind),
        span,
        language.translate(part.reason) if isinstance(part.reason, Sentence) else part.reason,
    ]


def _warnings(content: Content, language: Language) -> list[str]:
    """The first WARNINGS and how many there are beyond."""
    more = len(content.warnings) - WARNINGS
    sentences = [language.translate(w) for w in content.warnings[:WARNINGS]]
    return [*sentences, *([language.counted("warnings.more", more)] if more > 0 else [])]


def _calibration(calibrations: Sequence[CalibrationFacts], language: Language) -> Page:
    """What each calibration was, and the sensors' quality over all of them."""
    sentences = [
        language.counted(
            "calibration.span",
            len(c.sensors),
            source=language.translate(c.source),
            start=language.number(c.onset, 1),
            end=language.number(c.end, 1),
        )
        for c in calibrations
    ]
    rows = (
        ("deg/s", "rate_wander"),
        ("deg", "tilt_change"),
        ("deg/s", "bias"),
        ("deg", "misalignment"),
    )
    sensors = [(segment, q) for c in calibrations for segment, q in c.sensors.items()]
    return {
        "summaries": [
            *(sentences or [language.say("calibration.none")]),
            *(words for c in calibrations for words in calibration_words(c.joints, language)),
        ],
        "rows": [
            [
                language.say(f"calibration.{name}"),
                *_spread(sensors, name, language),
                unit_words(unit, language),
            ]
            for unit, name in rows
        ]
        if sensors
        else [],
    }


def _spread(
    sensors: Sequence[tuple[str, SensorQuality]], name: str, language: Language
) -> list[str]:
    """Median, largest, and the sensor with the largest."""
    values = [DEG * float(getattr(q, name)) for _, q in sensors]
    worst = int(np.argmax(values))
    return [
        language.number(float(np.median(values)), 2),
        language.number(values[worst], 2),
        language.segment(sensors[worst][0]),
    ]


def _signal(content: Content, language: Language) -> list[list[str]]:
    flagged = [
        language.say(
            "flagged",
            share=language.number(100 * f.share, 1),
            what=language.translate(f.words),
            worst=language.segment(f.worst),
            worst_share=language.number(100 * f.worst_share),
        )
        for f in content.flagged
    ]
    groups: dict[tuple[float, tuple[str, ...]], list[StreamFacts]] = {}
    for s in content.recording.streams:
        groups.setdefault((s.rate, s.quantities), []).append(s)
    losses = {_lost(streams, language) for streams in groups.values()}
    shared = len(losses) == 1 and len(groups) > 1
    rows = [
        [
            language.say("streams" if len(s) > 1 else "stream"),
            _streams(s, language, with_losses=not shared),
        ]
        for s in groups.values()
    ]
    return [
        *rows,
        *([language.say("streams.all"), lost] for lost in losses if shared),
        [
            language.say("task_samples"),
            language.several(flagged) if flagged else language.say("unflagged"),
        ],
    ]


def _streams(streams: Sequence[StreamFacts], language: Language, with_losses: bool) -> str:
    """Streams of the same rate and quantities together, with what was lost of them if `with_losses`."""
    words = language.counted(
        "streams.of",
        sum(len(s.sensors) for s in streams),
        names=", ".join(
            language.say("streams.forces")
            if FORCE in s.quantities
            else language.known(f"part.{s.name}", s.name)
            for s in streams
        ),
        rate=f"{streams[0].rate:g}",
        samples=language.number(sum(s.samples for s in streams)),
    )
    return f"{words}, {_lost(streams, language)}" if with_losses else words


def _lost(streams: Sequence[StreamFacts], language: Language) -> str:
    counts = [s.lost for s in streams if s.lost is not None]
    if len(counts) < len(streams):
        return language.say("losses.unknown")
    return language.counted("losses", sum(counts)) if sum(counts) else language.say("losses.none")


def _provenance(content: Content, language: Language) -> list[list[str]]:
    recording, method, say = content.recording, content.method, language.say
    source = {**recording.source, "device": _device(content, language)}
    known = ("device", "device_id", "firmware", "format")
    device = [say(f"source.{key}", value=source[key]) for key in known if source.get(key)]
    changed = [
        say(
            "option.changed",
            name=c.option.name,
            value=f"{c.value} {c.option.unit}".strip(),
            default=c.option.default,
        )
        for c in method.changed
    ]
    return [
        [
            say("recorded"),
            f"{recording.start_utc or say('no_start')}, {language.number(recording.duration, 1)} s",
        ],
        [say("device"), ", ".join(device) or say("not_recorded")],
        [say("software"), content.software],
        [say("method"), language.labelled(method.name, language.translate(method.title))],
        [say("options"), language.several(changed) if changed else say("options.default")],
        *_comparison_rows(content, language),
    ]


def _comparison_rows(content: Content, language: Language) -> list[list[str]]:
    """With what sessions and reference values the figures are compared, and who chose that when."""
    found, say = content.compared, language.say
    if found is None:
        return []
    other = say(f"other.{'right' if content.hand == 'left' else 'left'}")
    words = [
        say("compared.before", **moment_words(found.before, language))
        if found.before
        else say("compared.no_before"),
        say("compared.other", hand=other, **moment_words(found.other, language))
        if found.other
        else say("compared.no_other"),
        say("compared.edition", number=found.edition.number),
        say("compared.version", number=found.number, **moment_words(found.made, language)),
        *([say("compared.chosen_by", name=found.author)] if found.author else []),
    ]
    return [[say("compared"), language.several(words)]]
