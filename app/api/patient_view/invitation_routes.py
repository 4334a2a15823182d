"""/api/stations/{name}/screens: the patient's screens of a live session, as the therapist invites and ends them"""

from typing import Any

from fastapi import APIRouter
from pydantic import Field

from handscope.app import language as languages
from handscope.app.api.wards.ward_routes import require_member
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, RequesterDep, requires_role
from handscope.app.live.patient_view.invitations import CODE_LIFE, Screen
from handscope.app.live.station import Station
from handscope.app.state import Db, PartsDep, StationDep, session_of
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.store import records

router = APIRouter(tags=["patient's screen"], dependencies=[requires_role(CLINICIAN)])
PAGE = "/patient-view"


class NewScreen(Incoming):
    """A screen to be invited, and the language that its patient reads."""

    language: str = Field("en", max_length=8)


@router.get("/stations/{name}/screens")
def list_screens(parts: PartsDep, station: StationDep) -> list[dict[str, Any]]:
    """The screens of a session; their codes are not shown again."""
    return [
        {"screen": s.name, "language": s.language, "by": s.by, "address": s.shown_at, "open": s.is_open}
        for s in parts.screens.list_of(station.name)
    ]  # fmt: skip


@router.post("/stations/{name}/screens", status_code=201)
def invite_screen(
    db: Db, parts: PartsDep, requester: RequesterDep, station: StationDep, new: NewScreen
) -> dict[str, Any]:
    """Invite a screen to show a live session: the code is shown this once, and opens one screen within ten minutes."""
    if not requester.is_of_house:
        require_member(requester, records.get(db, session_of(station)).patient.ward_id)
    if not isinstance(station, Station):
        raise InputError("api.replay_has_no_screen")
    language = languages.language(new.language).code
    screen, code = parts.screens.invite(station.name, language, requester.name)
    _record(db, "created", screen, session_of(station))
    return {
        "screen": screen.name,
        "code": code,
        "path": f"{PAGE}?language={language}#{code}",
        "minutes": round(CODE_LIFE / 60),
    }


@router.delete("/stations/{name}/screens/{screen}", status_code=204)
def end_screen(db: Db, parts: PartsDep, station: StationDep, screen: str) -> None:
    """End a screen, or take its code back."""
    for one in parts.screens.list_of(station.name):
        if one.name == screen:
            parts.screens.withdraw(station.name, screen)
            _record(db, "changed", one, session_of(station), fields=["withdrawn"])


def _record(db: Db, what: str, screen: Screen, session: int, **more: Any) -> None:
    patient = records.get(db, session).patient_id
    counts = {"session": session, **more}
    audit.record(db, AuditEvent(what, "screen", screen.name, patient, counts))
    db.commit()
