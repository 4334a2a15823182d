"""The CodeSystem of what Handscope measures, and units as UCUM writes them (docs/fhir.md)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handscope.estimators.hand.anatomy import FINGERS, HANDS, JOINTS
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.figure import Figure

SYSTEM = "urn:uuid:0d4f3a57-7f0e-5b6e-8f0a-3f5a2f6f1c77"  # belongs to nobody's domain, so nobody can take it away
VERSION = "1"
UNITS = {  # SI unit of a figure: UCUM code, how many of it
    "rad": ("deg", 180 / np.pi),
    "rad/s": ("deg/s", 180 / np.pi),
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "m^3": ("L", 1e3),
    "N/m": ("N/m", 1.0),
    "N s/m": ("N.s/m", 1.0),
    "Nm": ("N.m", 1.0),
    "dB": ("dB", 1.0),
}
_OWN = {
    "grade": "How far a figure can be trusted: good, fair or poor",
    "standard_deviation": "Standard deviation of a figure's error, as the method and the calibration explain it",
    "hand_movement_report": "Report of a session of Handscope",
}


def unit_of(figure: Figure) -> tuple[float, str, float]:
    """The value in its UCUM unit, the unit, and the factor between the SI unit and it."""
    unit, factor = UNITS.get(figure.unit, (figure.unit, 1.0))
    return figure.value * factor, unit, factor


def code_system(used: Mapping[str, str]) -> dict[str, Any]:
    """The CodeSystem resource; `used`: meanings of codes that no measure declares."""
    codes = {**_OWN, **{k: v or k for k, v in used.items()}, **_measures(), **_sites()}
    concepts = [
        {"code": code, "display": code.replace("_", " "), "definition": meaning}
        for code, meaning in sorted(codes.items())
    ]
    return {
        "resourceType": "CodeSystem",
        "url": SYSTEM,
        "version": VERSION,
        "name": "HandscopeMeasures",
        "title": "What Handscope measures of a hand",
        "status": "active",
        "content": "complete",
        "caseSensitive": True,
        "concept": concepts,
    }


def _measures() -> dict[str, str]:
    """Every kind of figure that a measure declares."""
    declared = (measure.KINDS for measure in MEASURES.values())
    return {kind.what: kind.meaning for each in declared for kind in each.values()}


def _sites() -> dict[str, str]:
    parts = ("hand", *FINGERS, *(joint.name for joint in JOINTS))
    return {
        f"{side}_{part}": f"{side} {part.replace('_', ' ')}" for side in HANDS for part in parts
    }
