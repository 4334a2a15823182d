"""What self-calibration found of a patient's hand, kept with the patient; and what a session takes over of it, as a person decided.

Lengths are the hand's: they hold for every later session of this hand. How sensors sit, and their biases, hold only as long as the glove is not
taken off, which nobody but a person can know. So nothing is taken over that nobody decided: a session without a decision takes over nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.tables import (
    Patient,
    PatientSession,
    RecordingFile,
    Result,
    Reuse,
    SelfCalibration,
    now,
)
from handscope.sessions.tables_io import calibration_result

NOTHING, LENGTHS, ALL = "nothing", "lengths", "lengths_and_seats"
PARTS = (NOTHING, LENGTHS, ALL)
# offered methods that begin with a pose; others find everything themselves or take the nominal
# mounting
USED_BY = "m1", "m2", "ekf"


@dataclass(frozen=True)
class FoundCalibration:
    """What is to be kept of a self-calibration."""

    table: Mapping[str, Any]  # as derivative.calibration_table makes it, SI
    messages: Sequence[str]  # sentences
    onset: float  # s of the recording
    end: float


@dataclass(frozen=True)
class Offer:
    """A self-calibration that a session may take over."""

    self_calibration: SelfCalibration
    parts: tuple[str, ...]  # of PARTS that can be taken over of it
    barred: str  # why not all of it, in a sentence; empty where all can be


def store(
    db: Session,
    file: RecordingFile,
    found: FoundCalibration,
    version: str,
    glove: str | None = None,
) -> SelfCalibration:
    """Keep it with the recording's patient; what was kept of the same stretch by the same program is that row again."""
    number = glove_of(file.summary) if glove is None else glove
    try:
        calibration_result.parse(dict(found.table))
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError("clinic.result_not_self_calibration") from None
    for before in file.session.patient.self_calibrations:
        if (before.recording_id, before.onset, before.end, before.version) == (
            file.id,
            found.onset,
            found.end,
            version,
        ):
            return before
    made = SelfCalibration(
        patient_id=file.session.patient_id,
        recording=file,
        hand=file.session.hand,
        glove=number,
        onset=found.onset,
        end=found.end,
        version=version,
        found=dict(found.table),
        messages=list(found.messages),
    )
    file.session.patient.self_calibrations.insert(0, made)
    db.commit()
    return made


def of_result(result: Result) -> FoundCalibration:
    """What a result of self-calibration holds to be kept; InputError where there is nothing."""
    stored = result.content.get("self_calibration") if result.state == "done" else None
    if not stored:
        raise InputError("clinic.result_not_self_calibration")
    return FoundCalibration(stored["table"], stored["told"], stored["onset"], stored["end"])


def get(db: Session, self_calibration_id: int) -> SelfCalibration:
    """The self-calibration; InputError where there is none."""
    found = db.get(SelfCalibration, self_calibration_id)
    if found is None:
        raise InputError("clinic.self_calibration_unknown", number=self_calibration_id)
    return found


def withdraw(db: Session, self_calibration_id: int, withdrawn: bool) -> SelfCalibration:
    """It is not offered any more, or again; sessions that took it over keep it."""
    found = get(db, self_calibration_id)
    found.withdrawn = (found.withdrawn or now()) if withdrawn else None
    db.commit()
    return found


def offers(session: PatientSession) -> list[Offer]:
    """What the session may take over, the newest movement first."""
    worn = _worn_glove(session)
    ordered = sorted(
        of_hand(session.patient, session.hand),
        key=lambda c: (c.recording.session.started, c.onset, c.id),
        reverse=True,
    )
    return [_offer(c, worn) for c in ordered]


def of_hand(patient: Patient, hand: str) -> list[SelfCalibration]:
    """What is offered to sessions of the hand, in any order."""
    return [c for c in patient.self_calibrations if c.hand == hand and c.withdrawn is None]


def decide(
    db: Session, session: PatientSession, parts: str, self_calibration_id: int | None = None
) -> Reuse:
    """A person's decision for a session; InputError where this cannot be taken over."""
    if parts not in PARTS:
        raise InputError("clinic.self_calibration_part_unknown", part=parts, parts=", ".join(PARTS))
    if (self_calibration_id is None) != (parts == NOTHING):
        raise InputError("clinic.self_calibration_not_named")
    chosen = None if self_calibration_id is None else get(db, self_calibration_id)
    if chosen is not None:
        if (chosen.patient_id, chosen.hand) != (session.patient_id, session.hand):
            raise InputError("clinic.self_calibration_of_other_hand")
        if parts not in (offer := _offer(chosen, _worn_glove(session))).parts:
            raise InputError(offer.barred)
    made = Reuse(self_calibration=chosen, parts=parts)
    session.reuses.append(made)
    db.commit()
    return made


def settle(db: Session, session: PatientSession) -> None:
    """Review the decision when the recording is closed, as it then names the glove: of another glove only lengths are taken over."""
    decided = decision(session)
    if decided is None or decided.self_calibration is None:
        return
    if decided.parts not in _offer(decided.self_calibration, _worn_glove(session)).parts:
        decide(db, session, LENGTHS, decided.self_calibration_id)


def decision(session: PatientSession) -> Reuse | None:
    """The decision that counts; None where nobody decided."""
    return session.reuses[-1] if session.reuses else None


def active(session: PatientSession, method: str) -> dict[str, Any]:
    """What a result by this method takes over, as plain data; empty: nothing."""
    return as_data(decision(session), method)


def as_data(reuse: Reuse | None, method: str) -> dict[str, Any]:
    """A decision as a result keeps it."""
    if reuse is None or reuse.self_calibration_id is None or method not in USED_BY:
        return {}
    return {"self_calibration": reuse.self_calibration_id, "parts": reuse.parts}


def decisions(db: Session) -> dict[int, Reuse]:
    """The decision that counts, by session."""
    return {reuse.session_id: reuse for reuse in db.scalars(select(Reuse).order_by(Reuse.id))}


def load_prior(db: Session, reused: Mapping[str, Any]) -> PriorCalibration | None:
    """What a result takes over, for the method; None: nothing."""
    return (
        select_parts(get(db, reused["self_calibration"]).found, reused["parts"]) if reused else None
    )


def select_parts(found: Mapping[str, Any], parts: str) -> PriorCalibration:
    """Lengths alone, or also seats and biases."""
    everything = calibration_result.parse(dict(found))
    return everything if parts == ALL else everything.of_hand()


def glove_of(summary: Mapping[str, Any]) -> str:
    """The glove's number from a recording's summary; "" where it does not tell it. A name will not do: gloves of one make, and all imports of one
    system, share it."""
    return str(summary.get("source", {}).get("device_id") or "")[:200]


def _worn_glove(session: PatientSession) -> str | None:
    closed = [f for f in session.recordings if f.sha256]
    return glove_of(closed[-1].summary) if closed else None


def _offer(c: SelfCalibration, worn: str | None) -> Offer:
    """Seats are offered where the same glove may be worn still; an unknown glove is not held against it."""
    if c.glove and worn and c.glove != worn:
        return Offer(
            c,
            (LENGTHS,),
            phrase("self_calibration.other_glove"),
        )
    return Offer(c, (LENGTHS, ALL), "")
