"""/api/results: what a method gave, its report and its exports"""

import asyncio
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query
from starlette.responses import Response

from app.api.readings import readings
from app.api.state import Db, LanguageDep, PartsDep
from app.jobs import make_derivative, make_report
from app.live.curve import value_of
from app.protocols import load_all
from app.report import Paper
from app.reporting import changes_of
from app.results import load_replay
from estimators.errors import InputError
from estimators.hand_anatomy import DOF_NAMES
from estimators.trajectory import Trajectory
from sessions import results
from sessions.tables import Result

router = APIRouter(prefix="/results", tags=["results"])
FORMS = {"pdf": "application/pdf", "html": "text/html; charset=utf-8", "csv": "text/csv; charset=utf-8", "json": "application/json"}
ALONE = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"  # a report brings its own style and loads nothing


@router.get("/{result_id}")
def read_result(db: Db, language: LanguageDep, result_id: int) -> dict[str, Any]:
    """State and progress; figures and what the page draws when it is done."""
    r = results.get(db, result_id)
    return {
        "id": r.id,
        "session": r.recording.session_id,
        "recording": r.recording_id,
        "method": r.method,
        "parameters": r.parameters,
        "version": r.version,
        "state": r.state,
        "progress": r.progress,
        "error": language.heard(r.error),
        "created": r.created,
        "figures": r.figures,
        "content": r.content,
        "warnings": [language.heard(w) for w in r.warnings],
        "readings": readings(r.content, r.figures, load_all(), language, changes_of(r) if r.state == "done" else None),
        "checksum": r.recording.sha256,
    }


@router.get("/{result_id}/curves")
def read_curves(
    db: Db,
    parts: PartsDep,
    result_id: int,
    what: Annotated[list[str], Query(description="aperture or joint angles such as index_pip_flexion")],
    start: float = -np.inf,
    stop: float = np.inf,
    points: Annotated[int, Query(ge=2, le=5000)] = 1500,
) -> dict[str, Any]:
    """Time series in degrees (aperture: mm), thinned."""
    unknown = [w for w in what if w != "aperture" and w not in DOF_NAMES]
    if unknown:
        raise InputError(f"there is no curve {unknown[0]!r}; curves are aperture and joint angles such as index_pip_flexion")
    kept = load_replay(parts.store, _done(results.get(db, result_id)))
    inside = (kept["t"] >= start) & (kept["t"] <= stop)
    every = slice(None, None, max(1, -(-int(inside.sum()) // points)))
    rows = Trajectory(
        "left", kept["t"][inside][every], kept["angles"][inside][every], np.empty(0), kept["tips"][inside][every], np.empty(0, np.uint8)
    )
    return {"t": _numbers(rows.t), "curves": {w: _numbers(value_of(rows, w)) for w in what}}


@router.get("/{result_id}/report.{form}")
async def read_report(db: Db, parts: PartsDep, language: LanguageDep, result_id: int, form: str, paper: Paper = "a4") -> Response:
    """The report as pdf, html, csv or json; the tables for programs are always in English."""
    if form not in FORMS:
        raise InputError(f"there is no report as {form!r}; forms are {', '.join(FORMS)}")
    result = await asyncio.to_thread(lambda: _done(results.get(db, result_id)))
    data = await parts.jobs.run(make_report, result_id, form, language.code, paper)
    return _download(
        data, FORMS[form], f"handscope-session-{result.recording.session_id}-{result.method}.{form}", inline=form in ("pdf", "html")
    )


@router.get("/{result_id}/derivative.zip")
async def read_derivative(db: Db, parts: PartsDep, result_id: int) -> Response:
    """The derivative as Motion-BIDS: joint angles, fingertips, orientations."""
    result = await asyncio.to_thread(lambda: _done(results.get(db, result_id)))
    data = await parts.jobs.run(make_derivative, result_id)
    return _download(data, "application/zip", f"handscope-session-{result.recording.session_id}-{result.method}.zip")


@router.post("/{result_id}/replay", status_code=201)
def open_replay(db: Db, parts: PartsDep, result_id: int) -> dict[str, Any]:
    """A station that plays the movement in the 3-D scene."""
    result = _done(results.get(db, result_id))
    station = parts.stations.open_replay(parts.store, result)
    return {"station": station.name}


def _done(result: Result) -> Result:
    if result.state != "done":
        raise InputError(f"result {result.id} is {result.state}{': ' + result.error if result.error else ''}")
    return result


def _numbers(values: Any) -> list[float | None]:
    return [round(float(v), 3) if np.isfinite(v) else None for v in values]


def _download(data: bytes, kind: str, name: str, inline: bool = False) -> Response:
    headers = {"Content-Disposition": f'{"inline" if inline else "attachment"}; filename="{name}"'}
    return Response(data, media_type=kind, headers=headers | ({"Content-Security-Policy": ALONE} if kind == FORMS["html"] else {}))
