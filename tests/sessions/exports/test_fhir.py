"""The package fhir.resources validates the Bundle (R4B), and it names nobody."""

import base64
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handscope.sessions.exports import export
from handscope.sessions.exports.fhir_codes import SYSTEM
from handscope.sessions.exports.measured import Exported, Measured


@pytest.fixture(scope="module")
def bundle(measured: Measured) -> dict[str, object]:
    made = export(replace(measured, report=b"%PDF-1.7 ..."), "fhir")
    return dict(json.loads(made.files[""]))


def _of(bundle: dict[str, object], kind: str) -> list[dict[str, object]]:
    entries = [e["resource"] for e in bundle["entry"]]  # type: ignore[attr-defined]
    return [r for r in entries if r["resourceType"] == kind]


def test_every_resource_is_valid_r4(bundle: dict[str, object]) -> None:
    bundles = pytest.importorskip("fhir.resources.R4B.bundle")
    read = bundles.Bundle.model_validate_json(json.dumps(bundle))
    kinds = [entry.resource.get_resource_type() for entry in read.entry]
    assert {"Device", "DiagnosticReport", "Observation", "Provenance", "CodeSystem"} == set(kinds)
    assert read.type == "transaction"


def test_references_lead_to_entries_of_the_bundle(bundle: dict[str, object]) -> None:
    names = [e["fullUrl"] for e in bundle["entry"]]  # type: ignore[attr-defined]
    assert len(set(names)) == len(names)
    text = json.dumps(bundle)
    references = text.split('"reference": "')[1:]
    assert {r.split('"')[0] for r in references} <= set(names)
    (provenance,) = _of(bundle, "Provenance")
    assert "sha256:" + "ab" * 32 in json.dumps(provenance["entity"])


def test_an_observation_carries_value_unit_sd_grade_method_and_place(
    bundle: dict[str, object], measured: Measured
) -> None:
    figures = {f.name: f for t in measured.tasks if t.task == "rom_mcp" for f in t.figures}
    ours, side = figures["index_mcp_flexion_max"], measured.recording.hand
    found = [
        o
        for o in _of(bundle, "Observation")
        if o["code"]["coding"][0]["code"] == "flexion_max"  # type: ignore[index]
        and {"text": "task: rom_mcp"} in o["note"]  # type: ignore[operator]
        and o["bodySite"]["coding"][0]["code"] == f"{side}_index_mcp"  # type: ignore[index]
    ]
    (one,) = found
    quantity = one["valueQuantity"]
    assert quantity["code"] == "deg"  # type: ignore[index]
    assert quantity["value"] == pytest.approx(np.degrees(ours.value), rel=1e-5)  # type: ignore[index]
    parts = {c["code"]["coding"][0]["code"]: c for c in one["component"]}  # type: ignore[attr-defined]
    assert parts["grade"]["valueString"] == ours.grade
    assert ours.sd is not None
    assert parts["standard_deviation"]["valueQuantity"]["value"] == pytest.approx(
        np.degrees(ours.sd), rel=1e-5
    )
    assert "m2" in one["method"]["text"]  # type: ignore[index]
    assert one["effectivePeriod"]["start"].startswith("2026-03-04T05:06:11")  # type: ignore[index]


def test_every_code_is_declared_by_the_code_system(bundle: dict[str, object]) -> None:
    (system,) = _of(bundle, "CodeSystem")
    known = {c["code"] for c in system["concept"]}  # type: ignore[attr-defined]
    used = [
        c["code"]
        for o in _of(bundle, "Observation")
        for c in [*o["code"]["coding"], *o["bodySite"]["coding"]]  # type: ignore[index]
        if c["system"] == SYSTEM
    ]
    assert used
    assert set(used) <= known


def test_the_report_travels_with_it_and_a_simulation_is_marked_as_test_data(
    bundle: dict[str, object],
) -> None:
    (report,) = _of(bundle, "DiagnosticReport")
    form = report["presentedForm"][0]  # type: ignore[index]
    assert base64.b64decode(form["data"]).startswith(b"%PDF")
    assert all(e["resource"]["meta"]["security"][0]["code"] == "HTEST" for e in bundle["entry"])  # type: ignore[attr-defined]


def test_nobody_is_named_but_by_a_pseudonym_that_was_asked_for(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    assert b'"subject"' not in exported("fhir").files[""]
    assert b"Patient" not in exported("fhir").files[""]
    named = replace(measured, origin=replace(measured.origin, pseudonym="K-17"))
    assert (
        json.loads(export(named, "fhir").files[""])["entry"][1]["resource"]["resourceType"]
        == "Device"
    )
    assert b"K-17" in export(named, "fhir").files[""]


def test_without_tasks_there_is_a_report_without_figures(measured: Measured) -> None:
    bundles = pytest.importorskip("fhir.resources.R4B.bundle")
    made = export(replace(measured, tasks=()), "fhir")
    bundles.Bundle.model_validate_json(made.files[""])
    assert made.notices
