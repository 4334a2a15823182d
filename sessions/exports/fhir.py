"""Figures for a hospital's record system: one FHIR R4 Bundle of type transaction (docs/fhir.md).

Device, DiagnosticReport with the PDF, an Observation a figure with its standard deviation and grade, Provenance with the recording's sha256, and the
CodeSystem that all codes are of. Nothing names the patient: the subject is a pseudonym where one was given, and nobody else. The status is
`preliminary`: nobody has signed the figures.
"""

import base64
import json
import uuid
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from handscope.estimators.hand.anatomy import JOINTS
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.figure import Figure
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.exports.fhir_codes import SYSTEM, code_system, unit_of
from handscope.sessions.exports.measured import Exported, Measured, Origin

UCUM = "http://unitsofmeasure.org"
SNOMED = "http://snomed.info/sct"
SIDES = {"left": ("7771000", "Left"), "right": ("24028007", "Right")}
TEST_DATA = {"system": "http://terminology.hl7.org/CodeSystem/v3-ActReason", "code": "HTEST"}
# of the names that entries are made from
_SPACE = uuid.UUID("6b1f6a54-4d0f-5c1b-9c39-6b1f3a0f5d10")
Resource = dict[str, Any]


def write(measured: Measured) -> Exported:
    """The Bundle; a recording without tasks gives a report without figures."""
    origin, side = measured.origin, measured.recording.hand
    found = [(task, f) for task in measured.tasks for f in task.figures if np.isfinite(f.value)]
    device = _entry(_device(origin), origin, "device")
    observations = [
        _entry(_observation(task, f, measured, device["fullUrl"]), origin, f"{k}")
        for k, (task, f) in enumerate(found)
    ]
    report = _entry(_report(measured, observations), origin, "report")
    made = [device, *observations, report]
    provenance = _entry(_provenance(origin, made), origin, "provenance")
    codes = _entry(code_system({f.what: f.meaning for _, f in found}), origin, "codes")
    codes["request"]["ifNoneExist"] = f"url={SYSTEM}"
    bundle: Resource = {
        "resourceType": "Bundle",
        "type": "transaction",
        "timestamp": origin.made_utc,
        "entry": [codes, *made, provenance],
    }
    if origin.simulated:
        for entry in bundle["entry"]:
            entry["resource"]["meta"] = {"security": [TEST_DATA]}
    absent = sum(len(t.figures) for t in measured.tasks) - len(found)
    notices = [_absent(side, absent)] if absent else []
    if not measured.tasks:
        notices.append(phrase("export.no_task"))
    return Exported({"": json.dumps(bundle, indent=1).encode()}, tuple(notices))


def _absent(side: str, count: int) -> str:
    if side == "left":
        return phrase("export.figures_absent_left", count=count)
    return phrase("export.figures_absent_right", count=count)


def _entry(resource: Resource, origin: Origin, name: str) -> Resource:
    """An entry of the transaction; the same export gives the same identifiers."""
    identity = uuid.uuid5(_SPACE, f"{origin.checksum} {origin.method} {origin.made_utc} {name}")
    kind = resource["resourceType"]
    return {
        "fullUrl": f"urn:uuid:{identity}",
        "resource": resource,
        "request": {"method": "POST", "url": kind},
    }


def _device(origin: Origin) -> Resource:
    measured = "simulated recording: nobody was measured" if origin.simulated else "recorded"
    return {
        "resourceType": "Device",
        "status": "active",
        "deviceName": [{"name": "Handscope", "type": "user-friendly-name"}],
        "version": [{"value": origin.software}],
        "type": {"text": "inertial-sensor glove and software; research use, not a medical device"},
        "note": [{"text": measured}],
    }


def _observation(task: TaskResult, f: Figure, measured: Measured, device: str) -> Resource:
    origin, side = measured.origin, measured.recording.hand
    value, unit, factor = unit_of(f)
    parts = [_component("grade", "how far the figure can be trusted", {"valueString": f.grade})]
    if f.sd is not None:
        parts.append(
            _component("standard_deviation", "standard deviation", _quantity(f.sd * factor, unit))
        )
    resource: Resource = {
        "resourceType": "Observation",
        "status": "preliminary",
        "code": {
            "coding": [_coding(f.what, f.what.replace("_", " "))],
            "text": f.meaning or f.name,
        },
        "method": {"text": f"{f.source}; movement by {origin.method} {_plain(origin.options)}"},
        "bodySite": _body_site(f.part, side),
        "device": {"reference": device},
        "component": parts,
        **_quantity(value, unit),
        **_subject(origin),
        **_period(origin, task.onset, task.end),
    }
    notes = [f"task: {task.task}", f.reason, f"sd: {task.sd_basis}" if f.sd is not None else ""]
    return resource | {"note": [{"text": note} for note in notes if note]}


def _body_site(part: str, side: str) -> Resource:
    joints = {joint.name for joint in JOINTS}
    named = part.replace("_", " ") or "hand"
    ours = _coding(f"{side}_{part or 'hand'}", f"{side} {named}")
    code, word = SIDES[side]
    laterality = {"system": SNOMED, "code": code, "display": word}
    kind = " joint" if part in joints else ""
    return {"coding": [ours, laterality], "text": f"{side} {named}{kind}"}


def _component(code: str, words: str, value: Resource) -> Resource:
    return {"code": {"coding": [_coding(code, words)], "text": words}, **value}


def _coding(code: str, words: str) -> Resource:
    return {"system": SYSTEM, "code": code, "display": words}


def _quantity(value: float, unit: str) -> Resource:
    number = float(f"{value:.6g}")
    return {"valueQuantity": {"value": number, "unit": unit, "system": UCUM, "code": unit}}


def _report(measured: Measured, observations: list[Resource]) -> Resource:
    origin = measured.origin
    report: Resource = {
        "resourceType": "DiagnosticReport",
        "status": "preliminary",
        "code": {
            "coding": [_coding("hand_movement_report", "hand movement report")],
            "text": "movement of the hand, measured by inertial sensors",
        },
        **_subject(origin),
        **_period(origin, 0.0, measured.recording.duration),
    }
    if observations:
        report["result"] = [{"reference": o["fullUrl"]} for o in observations]
    if measured.report:
        data = base64.b64encode(measured.report).decode()
        report["presentedForm"] = [
            {"contentType": "application/pdf", "data": data, "title": "Handscope report"}
        ]
    return report


def _provenance(origin: Origin, made: list[Resource]) -> Resource:
    what = {
        "identifier": {
            "system": "urn:ietf:rfc:6234",
            "value": f"sha256:{origin.checksum or 'unknown'}",
        },
        "display": "recording of the glove's raw samples"
        + (", simulated" if origin.simulated else ""),
    }
    return {
        "resourceType": "Provenance",
        "target": [{"reference": entry["fullUrl"]} for entry in made],
        "recorded": origin.made_utc,
        "agent": [
            {
                "type": {"text": "software"},
                "who": {
                    "reference": made[0]["fullUrl"],
                    "display": f"Handscope {origin.software}, method {origin.method} {_plain(origin.options)}",
                },
            }
        ],
        "entity": [{"role": "source", "what": what}],
    }


def _subject(origin: Origin) -> Resource:
    if not origin.pseudonym:
        return {}
    return {"subject": {"identifier": {"value": origin.pseudonym}, "display": "pseudonym"}}


def _period(origin: Origin, onset: float, end: float) -> Resource:
    """When it was measured, where the recording says when it began."""
    if not origin.start_utc:
        return {}
    began = datetime.fromisoformat(origin.start_utc)
    began = began if began.tzinfo else began.replace(tzinfo=UTC)
    start, stop = (began + timedelta(seconds=s) for s in (onset, end))
    return {
        "effectivePeriod": {
            "start": start.isoformat(timespec="milliseconds"),
            "end": stop.isoformat(timespec="milliseconds"),
        }
    }


def _plain(options: Mapping[str, Any]) -> str:
    return json.dumps(dict(options), default=str)
