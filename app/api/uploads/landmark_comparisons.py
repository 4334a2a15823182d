"""/api/results/{id}/landmark-comparisons: a result beside a camera's hand landmarks, which are compared and not kept"""

import tempfile
from pathlib import Path
from typing import Any

from anyio import to_thread
from fastapi import APIRouter, UploadFile

from handscope.app.api.answers import LandmarkAnswer, StretchAgreement, answers
from handscope.app.api.results import agreement_payload, rounded_numbers
from handscope.app.api.sessions import receive
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, requires_role
from handscope.app.report.units import DEG
from handscope.app.results.landmark_comparison import (
    LandmarkComparison,
    compare_landmarks,
    movement_of,
)
from handscope.app.state import Db, PartsDep
from handscope.app.workers.pending_tables import safe_name
from handscope.estimators.measures.comparison import Agreement
from handscope.sessions.clinic import results
from handscope.sessions.db.plain_text import require_plain

router = APIRouter(
    prefix="/results/{result_id}/landmark-comparisons",
    tags=["results"],
    dependencies=[requires_role(CLINICIAN, SCIENTIST)],
)
POINTS = 1000  # of a curve


@router.post("", responses=answers(LandmarkAnswer))
async def compare_with_landmarks(
    db: Db, parts: PartsDep, result_id: int, file: UploadFile
) -> LandmarkAnswer:
    """The 21 landmarks that a camera's hand tracker saw during this recording: lag, angles, agreement. Nothing of the file is kept."""
    result = await to_thread.run_sync(lambda: results.require_done(results.get(db, result_id)))
    name = file.filename or "landmarks"
    require_plain(name, "the form", one_line=True)
    measured = await to_thread.run_sync(
        movement_of, parts.store, result, f"{result.method} {result.id}"
    )
    with tempfile.TemporaryDirectory(dir=parts.store.incoming) as folder:
        path = Path(folder, safe_name(name))
        with path.open("wb") as target:
            await receive(file, parts, target)
        found = await parts.upload_reader.call(compare_landmarks, path, measured, POINTS)
    return _answer(path.name, found)


def _answer(name: str, found: LandmarkComparison) -> LandmarkAnswer:
    lag = found.lag
    return {
        "name": name,
        "frames": found.frames,
        "seen": round(found.seen, 4),
        "lag": {
            "seconds": round(lag.seconds, 4),
            "correlation": round(lag.correlation, 4),
            "overlap": round(lag.overlap, 2),
            "rival": None if lag.rival is None else round(lag.rival, 2),
            "ppm": round(1e6 * lag.rate, 1) if lag.rate else None,
        },
        "stretches": [_stretch(event, agreements) for event, agreements in found.stretches],
        "curves": [
            {
                "what": what,
                "t": rounded_numbers(curve.t),
                "a": rounded_numbers(DEG * curve.a),
                "b": rounded_numbers(DEG * curve.b),
                "difference": rounded_numbers(DEG * curve.difference),
            }
            for what, curve in found.curves.items()
        ],
    }


def _stretch(event: int | None, agreements: tuple[Agreement, ...]) -> StretchAgreement:
    angles: list[Any] = [{"what": a.name, **(agreement_payload(a) or {})} for a in agreements]
    return {
        "event": event,
        "onset": agreements[0].onset,
        "end": agreements[0].end,
        "angles": angles,
    }
