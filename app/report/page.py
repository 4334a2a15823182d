"""What the page says: a Content put into words, tables of words and figures; the layout (report.typ) only places them.

Everything is a string, a list or a dict of them; user's text stays as it was typed.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from app.report.content import CalibrationFacts, Content, StreamFacts, Task
from app.report.range_rows import asks_full_range, by_task
from app.report.range_section import range_section
from app.report.tapping_section import TRIALS, tapping_section
from app.report.units import DEG, reading
from app.report.words import NOTICE, TAG, segment_words, span_words
from estimators.calibration import SensorQuality

Page = dict[str, Any]

WARNINGS = 4  # of them on the page


def words_of(content: Content) -> Page:
    """The whole report."""
    main, further = _chosen(content)
    taps = [t for t in content.tasks if t.result.measure == "tapping"]
    others = [t for t in content.tasks if t.result.measure not in ("tapping", "range_of_motion")]
    return {
        "title": f"Hand assessment, {content.visit.patient}",
        "facts": _facts(content),
        "tag": TAG,
        "notice": NOTICE,
        "ranges": [range_section(main, content.measured, content.changes)] if main else [],
        "tapping": [tapping_section(taps[k : k + TRIALS], k, len(taps), content.changes) for k in range(0, len(taps), TRIALS)],
        "further": [range_section(trials, content.measured, content.changes) for trials in further],
        "others": [_other(task) for task in others],
        "calibration": _calibration(content.calibrations),
        "signal": _signal(content),
        "provenance": _provenance(content),
        "checksum": [content.recording.checksum[:32] or "not known", content.recording.checksum[32:]],
        "warnings": _warnings(content),
        "notes": content.visit.notes.splitlines(),
        "footer": f"{content.visit.patient} · {_day(content.date)} · recording {content.recording.checksum[:12] or 'without checksum'}",
    }


def _chosen(content: Content) -> tuple[list[Task], list[list[Task]]]:
    """The tasks whose ranges make the first page's table, and the trials of each that follows."""
    ranges = [t for t in content.tasks if t.result.measure == "range_of_motion"]
    full = [t for t in ranges if asks_full_range(t.result.task)]
    if full:
        return full, by_task([t for t in ranges if not asks_full_range(t.result.task)])
    first, *further = by_task(ranges) or [[]]
    return first, further


def _facts(content: Content) -> list[list[str]]:
    visit, source = content.visit, content.recording.source
    side = {content.hand: "affected side", "both": "both sides affected", None: ""}.get(visit.affected, "unaffected side")
    dominance = f"{visit.dominant}-handed" if visit.dominant else ""
    firmware = f"firmware {source['firmware']}" if source.get("firmware") else ""
    return [
        ["Patient", visit.patient, ""],
        ["Hand", content.hand.capitalize(), ", ".join(w for w in (side, dominance) if w)],
        ["Session", _day(content.date), _hour(content.date)],
        ["Examiner", visit.examiner or "not given", ""],
        ["Glove", str(source.get("device") or "not recorded"), firmware],
    ]


def _day(date: datetime | None) -> str:
    return f"{date.day} {date:%B %Y}" if date else "date not recorded"


def _hour(date: datetime | None) -> str:
    return f"{date:%H:%M} {date.tzname() or ''}".strip() if date else ""


def _other(task: Task) -> Page:
    """A measure without a page of its own: its figures by name."""
    rows = []
    for f in task.result.figures:
        r = reading(f)
        rows.append([f.name.replace("_", " "), f"{r.value:.4g}" if np.isfinite(r.value) else "not measured", r.unit, f.grade, f.reason])
    return {"title": task.measure_title, "task": span_words([task]), "rows": rows}


def _warnings(content: Content) -> str:
    """The first WARNINGS and how many there are beyond, in one paragraph."""
    more = len(content.warnings) - WARNINGS
    return "; ".join([*content.warnings[:WARNINGS], *([f"{more} more in the session's JSON file"] if more > 0 else [])])


def _calibration(calibrations: Sequence[CalibrationFacts]) -> Page:
    """What each calibration was, and the sensors' quality over all of them."""
    said = [f"{c.source}, {c.onset:.1f} to {c.end:.1f} s, {len(c.sensors)} sensors" for c in calibrations]
    rows = (
        ("Turning while still", "deg/s", "rate_wander"),
        ("Tilting while still", "deg", "tilt_change"),
        ("Gyroscope bias removed", "deg/s", "bias"),
        ("Mounting corrected", "deg", "misalignment"),
    )
    sensors = [(segment, q) for c in calibrations for segment, q in c.sensors.items()]
    return {
        "summaries": said or ["None: the angles carry the mounting's error and have no common zero."],
        "rows": [[label, *_spread(sensors, name), unit] for label, unit, name in rows] if sensors else [],
    }


def _spread(sensors: Sequence[tuple[str, SensorQuality]], name: str) -> list[str]:
    """Median, largest, and the sensor with the largest."""
    values = [DEG * float(getattr(q, name)) for _, q in sensors]
    worst = int(np.argmax(values))
    return [f"{np.median(values):.2f}", f"{values[worst]:.2f}", segment_words(sensors[worst][0])]


def _signal(content: Content) -> list[list[str]]:
    flagged = [f"{100 * f.share:.1f} % {f.words} (worst: {segment_words(f.worst)}, {100 * f.worst_share:.0f} %)" for f in content.flagged]
    alike: dict[tuple[float, tuple[str, ...]], list[StreamFacts]] = {}
    for s in content.recording.streams:
        alike.setdefault((s.rate, s.quantities), []).append(s)
    return [
        *(["Streams" if len(streams) > 1 else "Stream", _streams(streams)] for streams in alike.values()),
        ["Task samples", "; ".join(flagged) if flagged else "all usable, no flags"],
    ]


def _streams(streams: Sequence[StreamFacts]) -> str:
    """Streams of the same rate and quantities together."""
    counts = [s.lost for s in streams if s.lost is not None]
    lost = "losses not recorded" if len(counts) < len(streams) else f"{sum(counts):,} lost" if sum(counts) else "none lost"
    names, sensors = ", ".join(s.name for s in streams), sum(len(s.sensors) for s in streams)
    return f"{names}: {sensors} sensors at {streams[0].rate:g} Hz, {sum(s.samples for s in streams):,} samples, {lost}"


def _provenance(content: Content) -> list[list[str]]:
    recording, method = content.recording, content.method
    known = {"device": "", "device_id": "number ", "firmware": "firmware ", "format": "format "}
    device = [f"{word}{recording.source[key]}" for key, word in known.items() if recording.source.get(key)]
    changed = [
        f"{c.option.name} = {c.value}{' ' + c.option.unit if c.option.unit else ''} (default {c.option.default})" for c in method.changed
    ]
    return [
        ["Recorded", f"{recording.start_utc or 'start not recorded'}, {recording.duration:.1f} s"],
        ["Device", ", ".join(device) or "not recorded"],
        ["Software", content.software],
        ["Method", f"{method.name}: {method.title}"],
        ["Options", "; ".join(changed) if changed else "all at their defaults"],
    ]
