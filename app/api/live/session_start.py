"""Live sessions begin: of a patient's hand, and of the other hand in the same visit, where the first is at its end"""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from fastapi import APIRouter
from pydantic import Field
from sqlalchemy.orm import Session

from handscope.app.api.assessment_plans.routes import find as find_plan
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, Requester, RequesterDep, requires_role
from handscope.app.devices import ports
from handscope.app.devices.named_hand import named_hand, require_hand
from handscope.app.live.outputs import choice
from handscope.app.live.readouts.trial_review import EarlierFigures
from handscope.app.live.relays import relay_port
from handscope.app.live.station import Station
from handscope.app.live.stations import live_setup
from handscope.app.protocols.plans import Plan, named
from handscope.app.state import Db, Parts, PartsDep, StationDep
from handscope.app.version import software_version
from handscope.estimators.data.options import changed_options
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import DEFAULT
from handscope.sessions.clinic import audit, patients, repeatability, self_calibrations
from handscope.sessions.clinic.self_calibrations import FoundCalibration
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile
from handscope.sessions.store import records

router = APIRouter(tags=["sessions"], dependencies=[requires_role(CLINICIAN)])
UNDECIDED = phrase("live.reuse_needed")


class Decision(Incoming):
    """What a session takes over of a stored self-calibration."""

    parts: str = Field(
        description=f"one of {', '.join(self_calibrations.PARTS)}; seats only where the glove was not taken off since"
    )
    self_calibration: int | None = None


class NewSession(Incoming):
    """A session to be started: hand, port, method with options, examiner."""

    hand: str
    port: str = Field(
        max_length=400,
        description="serial port of the glove, or an address that the administrator allowed",
    )
    method: str = DEFAULT
    options: dict[str, Any] = Field(default_factory=dict)
    examiner: str = Field("", max_length=200)
    outlets: list[str] = Field(
        default_factory=list,
        max_length=4,
        description="other programs that the session sends to: lsl, osc://HOST:PORT; only what the administrator allowed",
    )
    plan: str = Field(
        default="",
        max_length=60,
        description="name of the assessment plan; without it the usual tasks",
    )
    reuse: Decision | None = Field(
        None,
        description="what is taken over of an earlier self-calibration; needed where one of the hand is kept",
    )


class OtherHand(Incoming):
    """How the other hand is measured; all else is as in the session that it follows."""

    port: str = Field(
        "",
        max_length=400,
        description="of the other hand's glove; empty: the virtual glove of that hand, else the same port",
    )
    reuse: Decision | None = Field(None, description="as for a new session")


@dataclass(frozen=True)
class _Start:
    """What a live session begins with, checked."""

    patient: Patient
    hand: Hand
    new: NewSession
    plan: Plan | None
    continues: int | None = None  # session of the other hand that it follows


@router.post("/patients/{patient_id}/sessions", status_code=201)
def begin_session(
    db: Db, parts: PartsDep, requester: RequesterDep, patient_id: int, new: NewSession
) -> dict[str, Any]:
    """Begin a live session: the glove's recording starts, the station's wizard waits."""
    plan = find_plan(db, new.plan)[0] if new.plan else None
    start = _Start(patients.get(db, patient_id), records.hand_of(new.hand), new, plan)
    _require_possible(parts, start)
    parts.stations.require_free(new.port)
    return _open(db, parts, requester, start, secrets.token_hex(4))


@router.post("/stations/{name}/other-hand", status_code=201)
def continue_with_other_hand(
    db: Db, parts: PartsDep, requester: RequesterDep, station: StationDep, other: OtherHand
) -> dict[str, Any]:
    """End a live session and begin the other hand's of the same visit; the patient's screens follow."""
    if not isinstance(station, Station):
        raise InputError("api.replay_has_no_other_hand")
    if ports.is_relay(station.setup.port) or ports.is_relay(other.port):
        raise InputError("api.other_hand_of_relay")  # the browser may still hold what it has read
    start = _of_other_hand(db, parts, station, other)
    _require_possible(parts, start)
    if start.new.port != station.setup.port:
        parts.stations.require_free(start.new.port)
    following = secrets.token_hex(4)
    parts.screens.hand_over(station.name, following)
    try:
        parts.stations.close(station.name)
        return _open(db, parts, requester, start, following)
    except BaseException:
        parts.screens.withdraw(following)
        raise


def _of_other_hand(db: Db, parts: Parts, station: Station, other: OtherHand) -> _Start:
    """The session that follows the station's."""
    setup, before = station.setup, records.get(db, station.setup.session)
    hand: Hand = "left" if setup.hand == "right" else "right"
    new = NewSession(
        hand=hand,
        port=other.port or _port_of_other_hand(parts, setup.port, hand),
        method=setup.method_name,
        options=changed_options(setup.params),
        examiner=before.examiner,
        outlets=list(setup.outlets),
        reuse=other.reuse,
    )
    had = before.plan
    plan = find_plan(db, had["name"], had["version"])[0] if had else None
    return _Start(before.patient, hand, new, plan, before.id)


def _port_of_other_hand(parts: Parts, port: str, hand: Hand) -> str:
    """A virtual glove of that hand where the port has one of a hand; else the port itself, where the other glove will be plugged in."""
    gloves = parts.settings.demo_ports
    if named_hand(gloves.get(port, "")) is None:
        return port
    fitting = [p for p, description in gloves.items() if named_hand(description) == hand]
    return fitting[0] if fitting else port


def _require_possible(parts: Parts, start: _Start) -> None:
    """InputError where the session cannot begin; nothing is begun yet."""
    new, settings = start.new, parts.settings
    if new.reuse is None and self_calibrations.of_hand(start.patient, start.hand):
        raise InputError(UNDECIDED)
    ports.require_allowed(new.port, (*settings.allowed_ports, *settings.demo_ports))
    require_hand(settings.demo_ports.get(new.port, ""), start.hand)
    choice.require_allowed(new.outlets, settings.allowed_outlets)


def _open(db: Db, parts: Parts, requester: Requester, start: _Start, name: str) -> dict[str, Any]:
    """Begin the recording and open the station."""
    new, patient, hand, plan = start.new, start.patient, start.hand, start.plan
    make_setup = live_setup(new.method, new.options, parts.store.folder, plan)
    session, file = records.begin(
        *(db, parts.store, patient, hand, patient.hand_measures.get(hand, {}), new.examiner),
        start.continues,
        named(plan) if plan else None,
    )
    try:
        port = relay_port(session.id) if new.port == ports.RELAY else new.port
        setup = make_setup(session, parts.store.path_of(file.file), port, patient.pseudonym)
        about = (
            {**setup.about, "relay_account": requester.account}
            if ports.is_relay(port)
            else setup.about
        )
        station = parts.stations.open_live(
            replace(
                setup,
                about=about,
                outlets=tuple(new.outlets),
                continues=start.continues,
                earlier=_earlier_figures(db, patient.id, hand, new.method),
                store_solution=_solution_store(db, parts, file.id),
                scheduler=parts.settings.scheduler,
                **_prior_options(db, session, new.reuse),
            ),
            name,
        )
    except BaseException:
        db.delete(session)
        db.commit()
        raise
    return {"session": session.id, "station": station.name}


def _earlier_figures(db: Session, patient: int, hand: str, method: str) -> EarlierFigures:
    """What the newest sessions of this hand and of the other one gave with this method."""
    every = [p for p in repeatability.history(db, patient) if p.occasion.method == method]
    last = next((p for p in reversed(every) if p.occasion.hand == hand), None)
    other = next((p for p in reversed(every) if p.occasion.hand != hand), None)
    return EarlierFigures(last.values if last else {}, other.values if other else {})


def _prior_options(db: Db, session: PatientSession, decision: Decision | None) -> dict[str, Any]:
    """Options of a live session from its decision about an earlier self-calibration."""
    if decision is None:
        return {}
    made = self_calibrations.decide(db, session, decision.parts, decision.self_calibration)
    chosen = made.self_calibration
    return (
        {
            "prior": self_calibrations.select_parts(chosen.found, made.parts),
            "prior_glove": chosen.glove,
        }
        if chosen
        else {}
    )


def _solution_store(
    begun: Db, parts: Parts, recording_id: int
) -> Callable[[FoundCalibration, str], None]:
    """A function that stores an accepted solution with the patient, decided for this session, in the name of its examiner."""
    on_behalf = dict(begun.info)

    def store(solution: FoundCalibration, glove: str) -> None:
        with parts.store.database() as db:
            audit.set_actor(db, on_behalf["who"], on_behalf["address"])
            file = db.get_one(RecordingFile, recording_id)
            made = self_calibrations.store(db, file, solution, software_version(), glove)
            self_calibrations.decide(db, file.session, self_calibrations.ALL, made.id)

    return store
