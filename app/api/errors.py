"""Answers to errors, all in the form `{"error": sentence}`; a person's browser at an address that is none of ours gets the page that says so."""

import logging

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, Response

from handscope.app.api.pages import page
from handscope.app.auth.gate import asks_for_page
from handscope.app.auth.security_headers import headers_of
from handscope.app.database_answers import NO_ROOM, answer_to_database, route_of
from handscope.app.documents import LeftError
from handscope.app.error_body import error_body
from handscope.app.input_mistakes import describe_mistake
from handscope.app.state import preferred
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.pseudonyms import UnconfirmedError
from handscope.sessions.db.conflicts import ConflictError
from handscope.sessions.db.full_disk import FULL, is_full
from handscope.sessions.login.throttle import ThrottledError

TOO_LARGE = phrase("server.number_too_large")
BY_STATUS = {  # what Starlette answers by itself
    400: phrase("server.body_unreadable"),
    404: phrase("server.not_found"),
    405: phrase("server.method_not_allowed"),
}
FORBIDDEN = {"wards.members_only", "wards.house_administrators"}
NOT_FOUND = frozenset(  # what was asked for is not there: 404
    {
        "analysis.folder_missing",
        "analysis.unknown_language",
        "analysis.unknown_length_unit",
        "analysis.unknown_method",
        "analysis.unknown_output_unit",
        "analysis.unknown_sample",
        "analysis.unknown_segment",
        "api.no_closed_recording",
        "api.no_single_sign_on",
        "api.unknown_paper",
        "api.unknown_report_form",
        "clinic.account_unknown",
        "clinic.account_unknown_list",
        "clinic.correction_unknown",
        "clinic.goal_unknown",
        "clinic.note_unknown",
        "clinic.patient_unknown",
        "clinic.photograph_unknown",
        "clinic.references_version_unknown",
        "clinic.result_unknown",
        "clinic.second_factor_unknown",
        "clinic.self_calibration_part_unknown",
        "clinic.self_calibration_unknown",
        "clinic.task_unknown",
        "clinic.treatment_unknown",
        "clinic.unknown_correction",
        "clinic.unknown_role",
        "device.port_missing",
        "export.unknown_format",
        "import.no_pending_table",
        "live.action_value",
        "live.no_relay",
        "live.no_such_step",
        "live.no_such_task",
        "live.station_closed",
        "live.unknown_action",
        "live.unknown_group",
        "measure.unknown_grading",
        "measure.unknown_movement",
        "option.unknown_option",
        "photograph.no_marker",
        "plan.unknown",
        "result.folder_or_list_missing",
        "result.recording_unknown",
        "result.task_unknown",
        "result.unknown_curve",
        "server.number_too_large",
        "store.session_unknown",
        "wards.no_such_access",
        "wards.no_such_code",
        "wards.unknown",
        "wards.unknown_name",
    }
)
LEFT = 499  # a proxy's code for who closed the connection; nobody reads it
log = logging.getLogger(__name__)


def install(app: FastAPI) -> None:
    """Give every error its answer."""

    @app.exception_handler(ConflictError)
    async def conflict(request: Request, error: ConflictError) -> JSONResponse:
        return JSONResponse(error_body(error, preferred(request)), 409)

    @app.exception_handler(UnconfirmedError)
    async def unconfirmed(request: Request, error: UnconfirmedError) -> JSONResponse:
        return JSONResponse({**error_body(error, preferred(request)), "confirm": error.doubts}, 422)

    @app.exception_handler(ThrottledError)
    async def throttled(request: Request, error: ThrottledError) -> JSONResponse:
        return JSONResponse(
            error_body(error, preferred(request)),
            429,
            headers={"Retry-After": str(round(error.wait))},
        )

    @app.exception_handler(LeftError)
    async def left(request: Request, error: LeftError) -> Response:
        return Response(status_code=LEFT)

    @app.exception_handler(InputError)
    async def mistake(request: Request, error: InputError) -> JSONResponse:
        message = error.message
        return JSONResponse(
            error_body(error, preferred(request)),
            403
            if message and message.code in FORBIDDEN
            else 404
            if message and message.code in NOT_FOUND
            else 422,
        )

    @app.exception_handler(RequestValidationError)
    async def malformed(request: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        if first["type"] == "json_invalid" and isinstance(first["loc"][-1], int):  # of the body
            problem, position = first["ctx"]["error"], first["loc"][-1]
            broken = phrase("server.not_json", problem=problem, position=position)
            return JSONResponse(error_body(broken, preferred(request)), 422)
        where = ".".join(
            str(part) for part in first["loc"] if part not in ("body", "query", "path")
        )
        sentence = phrase(
            "server.not_understood", where=where or "request", what=describe_mistake(first)
        )
        return JSONResponse(error_body(sentence, preferred(request)), 422)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        if error.status_code == 404 and asks_for_page(request) and not _is_of_api(request):
            # a mistyped address: a way back, not a program's answer
            return page(request, status=404)
        if is_full(error.__cause__):  # during an upload
            return JSONResponse(error_body(FULL, preferred(request)), NO_ROOM)
        return JSONResponse(
            error_body(BY_STATUS.get(error.status_code, error.detail), preferred(request)),
            error.status_code,
            headers=error.headers,
        )

    @app.exception_handler(OverflowError)
    async def out_of_range(request: Request, error: OverflowError) -> JSONResponse:
        return JSONResponse(error_body(TOO_LARGE, preferred(request)), 404)

    @app.exception_handler(OSError)
    @app.exception_handler(PoolTimeout)
    @app.exception_handler(DBAPIError)
    async def unwritten(request: Request, error: Exception) -> JSONResponse:
        if (
            getattr(getattr(error, "orig", None), "sqlstate", None) == "22003"
        ):  # PostgreSQL: numeric value out of range
            return JSONResponse(error_body(TOO_LARGE, preferred(request)), 404)
        answer = answer_to_database(request, error)
        if answer is None:
            raise error
        return answer

    @app.exception_handler(Exception)
    async def bug(request: Request, error: Exception) -> JSONResponse:
        log.exception("%s %s", request.method, route_of(request), exc_info=error)
        sentence = phrase("server.bug")
        headers = headers_of(request.scope)  # this answer passes no middleware
        return JSONResponse(error_body(sentence, preferred(request)), 500, headers)


def _is_of_api(request: Request) -> bool:
    return request.url.path.startswith("/api/")
