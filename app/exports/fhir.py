"""FHIR R4: one transaction Bundle of device, figures, report and where they are from; pseudonymous.

Source  HL7 FHIR R4 (4.0.1): Bundle, Device, Observation, DiagnosticReport, Provenance; units by UCUM; codes: docs/fhir.md
"""

import base64
import json
import math
import uuid
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from handscope.app.language import ENGLISH
from handscope.app.protocols import load_all
from handscope.app.report import FORMS, Style
from handscope.app.report.content import Visit
from handscope.app.report.content import content as report_content
from handscope.app.results.export_content import Content
from handscope.app.version import software_version
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.figure import Figure

BASE = "https://handscope.example/fhir"  # names, not addresses: RFC 2606 keeps the domain free
FIGURES, METHODS, GRADES = (f"{BASE}/CodeSystem/{n}" for n in ("figure", "method", "grade"))
SNOMED, UCUM = "http://snomed.info/sct", "http://unitsofmeasure.org"
CATEGORY = "http://terminology.hl7.org/CodeSystem/observation-category"
SITES = {  # SNOMED CT, as five public value sets have them
    "thumb": ("76505004", "Thumb structure"),
    "index": ("83738005", "Index finger structure"),
    "middle": ("65531009", "Middle finger structure"),
    "ring": ("82002001", "Ring finger structure"),
    "little": ("12406000", "Little finger structure"),
}
UNITS = {  # SI unit of a figure: UCUM code, and how many of them in one
    "rad": ("deg", 180 / math.pi),
    "rad/s": ("deg/s", 180 / math.pi),
    "rad/s^2": ("deg/s2", 180 / math.pi),
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "m/s^2": ("m/s2", 1.0),
    "N/m": ("N/m", 1.0),
    "N": ("N", 1.0),
    "kg": ("g", 1e3),
    "s": ("s", 1.0),
    "Hz": ("Hz", 1.0),
    "1": ("1", 1.0),
}


def write(content: Content, subject: str = "") -> bytes:
    """The Bundle as JSON; `subject` is a pseudonym, never a name."""
    about = (
        {"subject": {"identifier": {"system": f"{BASE}/pseudonym", "value": subject}}}
        if subject
        else {}
    )
    device = _entry(content, "Device", "device", _device(content))
    observations = [
        _entry(
            content,
            "Observation",
            f"{k} {figure.name}",
            _observation(content, task, figure, device) | about,
        )
        for k, (task, figure) in enumerate(_figures(content))
    ]
    report = _entry(content, "DiagnosticReport", "report", _report(content, observations) | about)
    entries = [device, *observations, report]
    entries.append(_entry(content, "Provenance", "provenance", _provenance(content, entries)))
    bundle = {"resourceType": "Bundle", "type": "transaction", "entry": entries}
    return json.dumps(bundle, indent=1, ensure_ascii=False).encode() + b"\n"


def _entry(content: Content, kind: str, name: str, resource: dict[str, Any]) -> dict[str, Any]:
    key = f"{content.recording.checksum} {content.method} {kind} {name}"
    address = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, key)}"
    return {
        "fullUrl": address,
        "resource": {"resourceType": kind, **resource},
        "request": {"method": "POST", "url": kind},
    }


def _figures(content: Content) -> Iterator[tuple[TaskResult, Figure]]:
    for task in content.tasks:
        yield from ((task, figure) for figure in task.figures if not figure.detail)


def _text(words: str) -> dict[str, str]:
    return {"text": words}


def _coded(system: str, code: str, words: str) -> dict[str, Any]:
    return {"coding": [{"system": system, "code": code, "display": words}], "text": words}


def _device(content: Content) -> dict[str, Any]:
    source = content.recording.source
    return {
        "status": "active",
        "deviceName": [
            {
                "name": f"Handscope and {source.get('device') or 'a glove'}",
                "type": "user-friendly-name",
            }
        ],
        "version": [{"value": software_version()}],
        "type": _text("inertial-sensor glove with software"),
        "note": [_text(f"simulated: {content.provenance['simulated']}")],
    }


def _when(content: Content) -> dict[str, str]:
    return {"effectiveDateTime": content.recording.start_utc} if content.recording.start_utc else {}


def _observation(
    content: Content, task: TaskResult, figure: Figure, device: Mapping[str, Any]
) -> dict[str, Any]:
    unit, factor = UNITS.get(figure.unit, (figure.unit, 1.0))
    words = figure.meaning or figure.name.replace("_", " ")
    found: dict[str, Any] = {
        "status": "final",
        "category": [_coded(CATEGORY, "procedure", "Procedure")],
        "code": _coded(FIGURES, figure.what or figure.name, words),
        **_when(content),
        "bodySite": _site(content, figure),
        "method": _coded(METHODS, content.method, f"Handscope method {content.method}"),
        "device": {"reference": device["fullUrl"]},
        "note": [_text(f"task {task.task}; {figure.source}")],
    }
    if math.isfinite(figure.value):
        found["valueQuantity"] = _quantity(figure.value * factor, unit)
    else:
        found["dataAbsentReason"] = _text(figure.reason or "not measured")
    if figure.sd is not None and math.isfinite(figure.sd):
        deviation = {
            "code": _text("standard deviation"),
            "valueQuantity": _quantity(figure.sd * factor, unit),
        }
        found["component"] = [deviation]
    grade = {
        "code": _text("grade"),
        "valueCodeableConcept": _coded(GRADES, figure.grade, figure.grade),
    }
    found.setdefault("component", []).append(grade)
    return found


def _quantity(value: float, unit: str) -> dict[str, Any]:
    return {"value": float(f"{value:.6g}"), "unit": unit, "system": UCUM, "code": unit}


def _site(content: Content, figure: Figure) -> dict[str, Any]:
    """The finger where the figure is about one, and the side; joints in words: there are no codes for them that could be verified."""
    finger = next((f for f in FINGERS if figure.part.startswith(f)), None)
    words = f"{content.hand} {figure.part.replace('_', ' ') or 'hand'}"
    if finger is None:
        return _text(words)
    code, display = SITES[finger]
    return {"coding": [{"system": SNOMED, "code": code, "display": display}], "text": words}


def _report(content: Content, observations: list[dict[str, Any]]) -> dict[str, Any]:
    visit = Visit(patient="", date=None if content.recording.start_utc else datetime.now(UTC))
    made = report_content(
        visit,
        content.recording,
        content.processed,
        content.method,
        content.params,
        content.tasks,
        software_version(),
        load_all(),
    )
    pdf = FORMS["pdf"](made, Style(ENGLISH, "a4"))
    return {
        "status": "final",
        "code": _text("Assessment of hand movement"),
        **_when(content),
        "result": [{"reference": o["fullUrl"]} for o in observations],
        "conclusion": "Research use; not a medical device.",
        "presentedForm": [
            {
                "contentType": "application/pdf",
                "data": base64.b64encode(pdf).decode(),
                "title": "Report",
            }
        ],
    }


def _provenance(content: Content, entries: list[dict[str, Any]]) -> dict[str, Any]:
    words = "; ".join(f"{name} {value}" for name, value in content.provenance.items() if value)
    return {
        "target": [{"reference": entry["fullUrl"]} for entry in entries],
        "recorded": datetime.now(UTC).isoformat(timespec="seconds"),
        "agent": [{"type": _text("assembler"), "who": {"reference": entries[0]["fullUrl"]}}],
        "entity": [
            {
                "role": "source",
                "what": {
                    "identifier": {
                        "system": "urn:ietf:rfc:3986",
                        "value": f"urn:sha256:{content.recording.checksum}",
                    },
                    "display": words,
                },
            }
        ],
    }
