"""/api/results: results, their reports and exports"""

import asyncio
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query
from starlette.responses import Response

from handscope.app.api.pseudonymisation import events_for
from handscope.app.api.references import ReferencesDep, references_payload
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, RequesterDep, requires_role
from handscope.app.documents import make_derivative, make_export, make_replay_file, make_report
from handscope.app.protocols import offered
from handscope.app.report import Paper
from handscope.app.report.gradings import DEFAULT, uninjured
from handscope.app.report.page import goal_row
from handscope.app.report.sections import self_calibration
from handscope.app.report.units import READABLE
from handscope.app.results.curves import APERTURE, compare_results, load_curves
from handscope.app.results.report import comparisons_of, goal_readings
from handscope.app.results.result_view import readings
from handscope.app.state import Db, DocumentsDep, LanguageDep, PartsDep
from handscope.estimators.errors import InputError
from handscope.estimators.measures.comparison import Agreement
from handscope.estimators.measures.total_active_motion import GRADINGS
from handscope.sessions.clinic import results
from handscope.sessions.clinic.corrections import without_reasons
from handscope.sessions.db.tables import Result
from handscope.sessions.exports import FORMATS, download_ending

FIGURE_TEXTS = frozenset({"reason", "meaning", "source", "sd_basis"})
router = APIRouter(
    prefix="/results", tags=["results"], dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)
FORMS = {
    "pdf": "application/pdf",
    "html": "text/html; charset=utf-8",
    "csv": "text/csv; charset=utf-8",
    "json": "application/json",
}
GradingDep = Annotated[
    str, Query(description=f"who names total active motion: {', '.join(GRADINGS)}")
]
ALONE = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"  # a report brings its own style and loads nothing


@router.get("/{result_id}")
def read_result(
    db: Db,
    parts: PartsDep,
    requester: RequesterDep,
    language: LanguageDep,
    result_id: int,
    lean: Annotated[
        bool,
        Query(
            description="without the SI figures and what each measure drew: megabytes of a long session"
        ),
    ] = False,
    grading: GradingDep = DEFAULT,
    references: ReferencesDep = None,
) -> dict[str, Any]:
    """State and progress; figures and what the page draws when it is done."""
    r = results.get(db, result_id)
    found = comparisons_of(r, references) if r.state == "done" else None
    hand = r.recording.session.hand
    content = events_for(requester, r.content)
    read = readings(
        content,
        r.figures,
        offered(parts.store.folder)[0],
        language,
        found.changes if found else None,
        lean,
        grading,
        uninjured(hand, found.compared.affected, found.course) if found else None,
        found.compared.edition if found else None,
        found.stored.other if found else None,
        r.warnings,
    )
    texts = language.translate_keys([] if lean else r.figures, FIGURE_TEXTS)
    head = {"id": r.id} if lean else {"id": r.id, "figures": texts}
    return {
        **head,
        "session": r.recording.session_id,
        "recording": r.recording_id,
        "method": r.method,
        "parameters": r.parameters,
        "version": r.version,
        "state": r.state,
        "progress": r.progress,
        "error": language.translate(r.error),
        "created": r.created,
        "content": {
            name: value for name, value in content.items() if not (lean and name == "tasks")
        },
        "warnings": [
            language.translate(w if requester.sees_all else without_reasons(w, r.corrections))
            for w in r.warnings
        ],
        "readings": read,
        "references": references_payload(db, r, found.stored) if found else None,
        "reused": r.reused,
        "goals": [goal_row(goal, language) for goal in goal_readings(r)] if found else [],
        "self_calibration": {
            **self_calibration.describe(stored["table"], stored["told"], language),
            "changes": self_calibration.length_changes(stored, language),
        }
        if (stored := r.content.get("self_calibration"))
        else None,
        "self_calibration_gains": [
            language.say(f"finger.{f}") for f in r.content.get("self_calibration_gains", [])
        ],
        "grading": grading,
        "checksum": r.recording.sha256,
    }


@router.delete("/{result_id}/computation", status_code=204)
def stop(db: Db, result_id: int) -> None:
    """Stop the computation; the result fails and can be requested again."""
    results.stop(db, result_id)


@router.get("/{result_id}/curves")
def read_curves(
    db: Db,
    parts: PartsDep,
    result_id: int,
    what: Annotated[
        list[str], Query(description="aperture or joint angles such as index_pip_flexion")
    ],
    start: float = -np.inf,
    stop: float = np.inf,
    points: Annotated[int, Query(ge=2, le=5000)] = 1500,
) -> dict[str, Any]:
    """Time series in degrees (aperture: mm), thinned."""
    t, by_quantity = load_curves(
        parts.store, results.require_done(results.get(db, result_id)), what, start, stop, points
    )
    return {
        "t": rounded_numbers(t),
        "curves": {w: rounded_numbers(values) for w, values in by_quantity.items()},
    }


@router.get("/{result_id}/comparison")
def compare(
    db: Db,
    parts: PartsDep,
    result_id: int,
    other: int,
    what: str = APERTURE,
    event: Annotated[
        int | None,
        Query(description="a task of the recording; without it all of it, within one recording"),
    ] = None,
    points: Annotated[int, Query(ge=2, le=5000)] = 1500,
) -> dict[str, Any]:
    """One quantity of this result and of another (by another method, of the other hand, of another session), in degrees or mm.

    Of one recording with the difference, other less this, and how far they agree; of two, from the onset of the same task on.
    """
    a = results.require_done(results.get(db, result_id))
    comparison = compare_results(
        parts.store,
        a,
        _of_one_patient(a, results.require_done(results.get(db, other))),
        what,
        event,
        points,
    )
    return {
        "t": rounded_numbers(comparison.t),
        "a": rounded_numbers(comparison.a),
        "b": rounded_numbers(comparison.b),
        "difference": rounded_numbers(comparison.difference) if comparison.agreement else None,
        "offsets": comparison.offsets,
        "agreement": agreement_payload(comparison.agreement),
    }


@router.get("/{result_id}/report.{form}", dependencies=[requires_role(CLINICIAN, does="exported")])
async def read_report(
    db: Db,
    documents: DocumentsDep,
    language: LanguageDep,
    result_id: int,
    form: str,
    paper: Paper = "a4",
    grading: GradingDep = DEFAULT,
    references: ReferencesDep = None,
) -> Response:
    """The report as pdf, html, csv or json; the tables for programs are always in English."""
    if form not in FORMS:
        raise InputError("api.unknown_report_form", form=form, forms=", ".join(FORMS))
    result = await asyncio.to_thread(lambda: results.require_done(results.get(db, result_id)))
    data = await documents.run(
        make_report,
        result_id,
        form,
        language.code,
        paper,
        grading,
        references,
    )
    return _download(
        data,
        FORMS[form],
        f"handscope-session-{result.recording.session_id}-{result.method}.{form}",
        inline=form in ("pdf", "html"),
    )


@router.get(
    "/{result_id}/derivative.zip",
    dependencies=[requires_role(CLINICIAN, SCIENTIST, does="exported")],
)
async def read_derivative(
    db: Db, documents: DocumentsDep, requester: RequesterDep, result_id: int
) -> Response:
    """The derivative as Motion-BIDS: joint angles, fingertips, orientations."""
    result = await asyncio.to_thread(lambda: results.require_done(results.get(db, result_id)))
    data = await documents.run(make_derivative, result_id, requester.sees_all)
    return _download(
        data,
        "application/zip",
        f"handscope-session-{result.recording.session_id}-{result.method}.zip",
    )


@router.get("/{result_id}/exports")
def list_exports(db: Db, language: LanguageDep, result_id: int) -> list[dict[str, str]]:
    """The formats in which the movement can be taken away."""
    results.get(db, result_id)
    return [
        {"name": name, "title": language.translate(f.title), "suffix": download_ending(f)}
        for name, f in FORMATS.items()
    ]


@router.get(
    "/{result_id}/exports/{form}",
    dependencies=[requires_role(CLINICIAN, SCIENTIST, does="exported")],
)
async def read_export(
    db: Db, documents: DocumentsDep, requester: RequesterDep, result_id: int, form: str
) -> Response:
    """The movement in another program's format; a folder comes as a zip. No name and no date of birth is in any of them."""
    if form not in FORMATS:
        raise InputError("export.unknown_format", name=form, names=", ".join(FORMATS))
    result = await asyncio.to_thread(lambda: results.require_done(results.get(db, result_id)))
    data = await documents.run(make_export, result_id, form, requester.sees_all)
    stem = f"handscope-session-{result.recording.session_id}-{result.method}-{form}"
    wanted = FORMATS[form]
    ending = download_ending(wanted)
    kind = "application/zip" if ending == ".zip" else wanted.media_type
    return _download(data, kind, stem + ending)


@router.get(
    "/{result_id}/replay.html", dependencies=[requires_role(CLINICIAN, SCIENTIST, does="exported")]
)
async def read_replay_file(
    db: Db,
    documents: DocumentsDep,
    language: LanguageDep,
    result_id: int,
    named: Annotated[
        bool,
        Query(description="with the patient's code in its title; else nothing tells who moved"),
    ] = False,
) -> Response:
    """The movement in 3-D as one file that opens in a browser without a network."""
    result = await asyncio.to_thread(lambda: results.require_done(results.get(db, result_id)))
    data = await documents.run(make_replay_file, result_id, named, language.code)
    return _download(data, "text/html", f"handscope-replay-{result.id}.html")


@router.post("/{result_id}/replay", status_code=201)
def open_replay(
    db: Db,
    parts: PartsDep,
    result_id: int,
    other: Annotated[
        int | None,
        Query(
            description="a result of the same patient that is played beside it, task by task in step"
        ),
    ] = None,
    at: Annotated[float | None, Query(description="where to begin, s")] = None,
) -> dict[str, Any]:
    """A station that plays the movement in the 3-D scene."""
    result = results.require_done(results.get(db, result_id))
    beside = (
        None
        if other is None
        else _of_one_patient(result, results.require_done(results.get(db, other)))
    )
    station = parts.stations.open_replay(parts.store, result, beside)
    if at is not None:
        station.act("seek", at)
    return {"station": station.name}


def _of_one_patient(result: Result, other: Result) -> Result:
    """The other; InputError where it is of another patient."""
    if result.recording.session.patient_id != other.recording.session.patient_id:
        raise InputError("api.results_of_two_patients")
    return other


def agreement_payload(agreement: Agreement | None) -> dict[str, Any] | None:
    """In the unit a person reads."""
    if agreement is None:
        return None
    unit, factor = READABLE[agreement.unit]
    values = {
        name: round(factor * getattr(agreement, name), 3)
        for name in ("drms", "offset", "drms_minus_offset", "rom_a", "rom_b", "drom")
    }
    return {
        "unit": unit,
        **values,
        "correlation": round(agreement.correlation, 4)
        if np.isfinite(agreement.correlation)
        else None,
    }


def rounded_numbers(values: Any) -> list[float | None]:
    """Rounded, null for NaN."""
    rounded = np.round(np.asarray(values, float), 2).tolist()
    return [v if v == v else None for v in rounded]


def _download(data: bytes, kind: str, name: str, inline: bool = False) -> Response:
    headers = {"Content-Disposition": f'{"inline" if inline else "attachment"}; filename="{name}"'}
    return Response(
        data,
        media_type=kind,
        headers=headers | ({"Content-Security-Policy": ALONE} if kind == FORMS["html"] else {}),
    )
