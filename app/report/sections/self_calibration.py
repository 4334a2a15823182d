"""What self-calibration found, in words and in the units a person reads: for the wizard, the session's page and the report alike."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.units import DEG, decimals, decimals_of_sd
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.clinic.self_calibrations import ALL, FoundCalibration
from handscope.sessions.db.tables import SelfCalibration
from handscope.sessions.formats.derivative import calibration_table

PARTS = {  # columns of the tables
    "lengths": ("segment", "length", "source"),
    "seats": ("segment", "along", "above", "across", "turned"),
    "biases": ("segment", "gyr", "acc"),
}
ACROSS, ALONG, ABOVE = 2, 1, 0  # axes of a segment: sideways, along the bone, out of its back


def stored_form(processed: Processed) -> dict[str, Any] | None:
    """What a result keeps of a self-calibration; None where the method found none."""
    found = found_calibration(processed.calibrations[0], processed.method_messages)
    return (
        None
        if found is None
        else {
            "table": found.table,
            "told": list(found.messages),
            "onset": found.onset,
            "end": found.end,
            "parts": ALL,
        }
    )


def length_changes(stored: Mapping[str, Any], language: Language) -> list[list[str]]:
    """Segment, given length and estimated length, mm, of the lengths that were observable."""
    given, found = stored.get("given", {}), stored["table"]["segment_lengths"]
    return [
        [language.segment(s), language.number(1e3 * given[s], 1), _length(s, found[s], language)[1]]
        for s in SEGMENTS
        if s in given and "sd" in found.get(s, {})
    ]


def reused_form(c: SelfCalibration, parts: str) -> dict[str, Any]:
    """The same of an earlier self-calibration of which these parts were taken over."""
    return {"table": c.found, "told": c.messages, "onset": c.onset, "end": c.end, "parts": parts}


def found_calibration(c: Calibration, messages: tuple[str, ...]) -> FoundCalibration | None:
    """A self-calibration in its stored form; None for a calibration by a pose alone."""
    return (
        FoundCalibration(calibration_table(c), messages, *c.span) if c.stretch is not None else None
    )


def describe(found: Mapping[str, Any], messages: list[str], language: Language) -> dict[str, Any]:
    """Lengths, distances and orientations of sensors, biases, with their standard deviations; sentences about what was observable."""
    mountings = {
        s: found["sensor_to_segment"][s] for s in SEGMENTS if s in found["sensor_to_segment"]
    }
    lengths = {
        s: found["segment_lengths"][s]
        for s in SEGMENTS
        if s in found["segment_lengths"] and s in mountings
    }
    return {
        "summary": _summary(lengths, language),
        "words": [language.translate(sentence) for sentence in messages],
        "lengths": [_length(s, entry, language) for s, entry in lengths.items()],
        "seats": [
            _mounting_row(s, mounting, language)
            for s, mounting in mountings.items()
            if mounting.get("p_BS") or mounting.get("sd")
        ],
        "biases": [
            _bias(s, found, language)
            for s in mountings
            if s in found.get("acc_bias", {}) or s in found.get("gyr_bias_sd", {})
        ],
    }


def section(stored: Mapping[str, Any] | None, language: Language) -> dict[str, Any] | None:
    """The same as a section of a report: tables with titles and columns; None where nothing was found."""
    if stored is None:
        return None
    described = describe(stored["table"], stored["told"], language)
    shown = PARTS if stored["parts"] == ALL else ("lengths",)
    parts = [
        {
            "title": language.say(f"self_calibration.{part}"),
            "columns": [language.say(f"self_calibration.{column}") for column in columns],
            "rows": described[part],
        }
        for part, columns in PARTS.items()
        if described[part] and part in shown
    ]
    return {
        "title": language.say("self_calibration.title"),
        "summary": described["summary"],
        "words": described["words"],
        "parts": parts,
    }


def _summary(lengths: Mapping[str, Any], language: Language) -> str:
    """How accurately the estimated lengths are known."""
    # two joints: a last phalanx has but one
    between = [entry for segment, entry in lengths.items() if not segment.endswith("distal")]
    known = [1e3 * float(entry["sd"]) for entry in between if "sd" in entry]
    if not known:
        return language.say("self_calibration.no_length")
    worst = language.number(max(known), decimals_of_sd(max(known)))
    return language.say(
        "self_calibration.lengths_to", found=len(known), of=len(between), worst=worst
    )


def _length(segment: str, entry: Mapping[str, Any], language: Language) -> list[str]:
    """Segment, length in mm, where it comes from."""
    sd = 1e3 * float(entry["sd"]) if "sd" in entry else None
    source = language.say(
        "self_calibration.found" if sd is not None else "self_calibration.by_ratio"
    )
    return [
        language.segment(segment),
        with_deviation(1e3 * float(entry["value"]), sd, language),
        source,
    ]


def _mounting_row(segment: str, mounting: Mapping[str, Any], language: Language) -> list[str]:
    """Segment, the sensor's place along, above and across it in mm, and how far it is turned from lying straight, deg."""
    place, place_sd = mounting.get("p_BS"), mounting.get("p_BS_sd")
    places = [
        language.say("self_calibration.not_found")
        if place is None
        else with_deviation(
            1e3 * place[axis], None if place_sd is None else 1e3 * place_sd[axis], language
        )
        for axis in (ALONG, ABOVE, ACROSS)
    ]
    turned = float(quat.angle(quat.normalize(np.array(mounting["q_BS"]))))
    return [
        language.segment(segment),
        *places,
        with_deviation(
            DEG * turned, DEG * max(mounting["sd"]) if "sd" in mounting else None, language
        ),
    ]


def _bias(segment: str, found: Mapping[str, Any], language: Language) -> list[str]:
    """Segment, size of the gyroscope's bias (deg/s) and of the accelerometer's (m/s^2)."""
    return [
        language.segment(segment),
        _size_words(segment, found, "gyr", DEG, language),
        _size_words(segment, found, "acc", 1.0, language),
    ]


def _size_words(
    segment: str, found: Mapping[str, Any], which: str, factor: float, language: Language
) -> str:
    bias, sd = (
        found.get(f"{which}_bias", {}).get(segment),
        found.get(f"{which}_bias_sd", {}).get(segment),
    )
    if bias is None:
        return language.say("self_calibration.not_found")
    return with_deviation(
        factor * float(np.linalg.norm(bias)),
        None if sd is None else factor * float(max(sd)),
        language,
    )


def with_deviation(value: float, sd: float | None, language: Language) -> str:
    """ "44.21 ± 0.13": the deviation in two digits, never as nothing."""
    if sd is None or not np.isfinite(sd) or not sd:
        return language.number(value, decimals(value))
    places = decimals_of_sd(sd)
    return f"{language.number(value, places)} ± {language.number(max(sd, 10.0**-places), places)}"
