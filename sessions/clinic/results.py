"""Results in the database: found by their key, made once, never edited."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import corrections, self_calibrations
from handscope.sessions.db.tables import RecordingFile, Result

UNFINISHED = ("queued", "running")
# how often a computation is begun before a server that died again and again gives it up
ATTEMPTS = 2
STOPPED = phrase("result.stopped")
ENDED = phrase("result.ended")


def key_of(file: RecordingFile, method: str, parameters: Mapping[str, Any], version: str) -> str:
    """sha256 of everything that the result depends on."""
    standing, reused = corrections.active(file), self_calibrations.active(file.session, method)
    worn = {"trunk_height": height} if (height := file.session.trunk_corrected) is not None else {}
    parts = [
        file.sha256,
        method,
        dict(parameters),
        file.session.geometry,
        file.session.hand,
        version,
        *(p for p in (standing, reused, worn) if p),
    ]
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def find_matching(
    db: Session,
    file: RecordingFile,
    method: str,
    parameters: Mapping[str, Any],
    version: str,
    server: str = "",
) -> Result:
    """The result with this key, queued when there is none or when it failed before; by the corrections, the trunk's height and the reuse that count now.

    `server` is which of several computes it, where it is to be computed.
    """
    key = key_of(file, method, parameters, version)
    result = db.scalar(select(Result).where(Result.recording_id == file.id, Result.key == key))
    if result is None:
        facts: dict[str, Any] = {
            "method": method,
            "parameters": dict(parameters),
            "version": version,
        }
        facts |= {
            "corrections": corrections.active(file),
            "trunk_height": file.session.trunk_corrected,
        }
        result = Result(
            recording=file,
            key=key,
            reused=self_calibrations.active(file.session, method),
            server=server,
            **facts,
        )
        db.add(result)
    elif result.state == "failed":
        result.state, result.error, result.progress, result.attempts = "queued", "", 0.0, 0
        result.server = server
    db.commit()
    return result


def get(db: Session, result_id: int) -> Result:
    """The result; InputError where there is none."""
    result = db.get(Result, result_id)
    if result is None:
        raise InputError("clinic.result_unknown", number=result_id)
    return result


def require_done(result: Result) -> Result:
    """The result; InputError where it is not finished."""
    if result.state != "done":
        if result.error:
            raise InputError(
                "clinic.result_failed", number=result.id, state=result.state, problem=result.error
            )
        raise InputError("clinic.result_not_done", number=result.id, state=result.state)
    return result


def current(file: RecordingFile) -> list[Result]:
    """Of every method with its options the newest result by the corrections, the trunk's height and the reuse that count now, the newest first."""
    standing = corrections.active(file), file.session.trunk_corrected
    newest: dict[str, Result] = {}
    for result in sorted(file.results, key=lambda r: -r.id):
        if (
            result.corrections,
            result.trunk_height,
        ) == standing and result.reused == self_calibrations.active(file.session, result.method):
            newest.setdefault(
                json.dumps([result.method, result.parameters], sort_keys=True, default=str), result
            )
    return list(newest.values())


def begin(db: Session, result_id: int) -> Result | None:
    """Its computation begins; None where it is erased or settled, perhaps this moment by a worker that outlived its server."""
    begun = (
        update(Result)
        .where(Result.id == result_id, Result.state.in_(UNFINISHED))
        .values(state="running", progress=0.0, error="", attempts=Result.attempts + 1)
    )
    found = db.scalars(begun.returning(Result), execution_options={"populate_existing": True})
    result = found.one_or_none()
    db.commit()
    return result


def fail(db: Session, result_id: int, why: str = ENDED) -> None:
    """Its computation came to nothing, by default without saying how: failed, unless it was erased or settled meanwhile."""
    result = db.get(Result, result_id)
    if result is not None and result.state in UNFINISHED:
        result.state, result.error = "failed", why
        db.commit()


def stop(db: Session, result_id: int) -> None:
    """Nobody waits for it any more: what computes it ends with its next step."""
    get(db, result_id)
    fail(db, result_id, STOPPED)


def requeue(db: Session, result_id: int) -> bool:
    """Its computation was ended by others: queued again, the attempt does not count; False where there is nothing to put back."""
    result = db.get(Result, result_id)
    if result is None or result.state != "running":
        return result is not None and result.state == "queued"
    result.state, result.progress, result.attempts = "queued", 0.0, result.attempts - 1
    db.commit()
    return True


def unfinished(db: Session, server: str = "") -> list[int]:
    """Results that were queued or running when the server (which of several) stopped; one that was begun ATTEMPTS times is given up."""
    query = select(Result).where(Result.state.in_(UNFINISHED)).order_by(Result.id)
    left = list(db.scalars(query.where(Result.server == server) if server else query))
    for result in left:
        if result.state == "running" and result.attempts >= ATTEMPTS:
            fail(db, result.id)
    return [result.id for result in left if result.state in UNFINISHED]
