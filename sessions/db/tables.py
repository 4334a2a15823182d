"""The database's tables: patients under pseudonyms, their sessions, recordings, results and jobs. Samples are files, never rows.

NEVER_AGAIN  the number of a row that was erased is not given again: a page that still shows the old one, or a file left behind, must not meet another patient
"""

from datetime import date, datetime
from typing import Any

from sqlalchemy import Date, ForeignKey, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from handscope.sessions.db.columns import Base as Base
from handscope.sessions.db.columns import UtcDateTime as UtcDateTime
from handscope.sessions.db.columns import now as now
from handscope.sessions.db.earlier_texts import TextsWithCodes, TextWithCodes
from handscope.sessions.db.json_data import SentenceOrTyped
from handscope.sessions.db.patientless_tables import Attempt as Attempt
from handscope.sessions.db.patientless_tables import AuditLine as AuditLine
from handscope.sessions.db.patientless_tables import ErasedFile as ErasedFile
from handscope.sessions.db.patientless_tables import StoredColumnMap as StoredColumnMap

NEVER_AGAIN = {"sqlite_autoincrement": True}
HOUSE = 1  # number of the ward that everybody belongs to: all accounts see its patients, its accounts see all patients


class Ward(Base):
    """A part of the hospital that patients and accounts belong to (sessions/wards). HOUSE is the whole house."""

    __tablename__ = "ward"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(64), unique=True)
    created: Mapped[datetime] = mapped_column(default=now)


class WardMember(Base):
    """That an account sees a ward's patients."""

    __tablename__ = "ward_member"

    account_id: Mapped[int] = mapped_column(
        ForeignKey("account.id", ondelete="CASCADE"), primary_key=True
    )
    ward_id: Mapped[int] = mapped_column(ForeignKey("ward.id"), primary_key=True, index=True)
    head: Mapped[bool] = mapped_column(default=False)  # is shown emergency accesses

    ward: Mapped[Ward] = relationship(lazy="joined")


class Patient(Base):
    """A patient under a pseudonym; lengths in m."""

    __tablename__ = "patient"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    pseudonym: Mapped[str] = mapped_column(String(64), unique=True)
    ward_id: Mapped[int] = mapped_column(
        ForeignKey("ward.id"), index=True, default=HOUSE, server_default=str(HOUSE)
    )
    year_of_birth: Mapped[int | None]
    dominant_hand: Mapped[str | None] = mapped_column(String(5))
    affected_hand: Mapped[str | None] = mapped_column(String(5))
    # HandGeometry by hand: {"left": {...}, "right": {...}}
    hand_measures: Mapped[dict[str, Any]] = mapped_column(default=dict)
    trunk_height: Mapped[float | None]  # m, of the trunk's sensor above the axis of the hips
    archived: Mapped[bool] = mapped_column(default=False)
    created: Mapped[datetime] = mapped_column(default=now)
    # counts changes: two editors at once are noticed
    version: Mapped[int] = mapped_column(default=1)

    ward: Mapped[Ward] = relationship()
    emergency_accesses: Mapped[list["EmergencyAccess"]] = relationship(
        back_populates="patient", cascade="all, delete-orphan", order_by="EmergencyAccess.id.desc()"
    )
    sessions: Mapped[list["PatientSession"]] = relationship(
        back_populates="patient",
        cascade="all, delete-orphan",
        order_by="PatientSession.started.desc()",
    )
    notes: Mapped[list["Note"]] = relationship(
        cascade="all, delete-orphan", order_by="Note.id.desc()"
    )
    self_calibrations: Mapped[list["SelfCalibration"]] = relationship(
        cascade="all, delete-orphan", order_by="SelfCalibration.id.desc()"
    )
    photographs: Mapped[list["HandPhotograph"]] = relationship(
        cascade="all, delete-orphan", order_by="HandPhotograph.id.desc()"
    )
    treatment_events: Mapped[list["TreatmentEvent"]] = relationship(
        cascade="all, delete-orphan", order_by="TreatmentEvent.day"
    )
    goals: Mapped[list["Goal"]] = relationship(cascade="all, delete-orphan", order_by="Goal.id")

    __mapper_args__ = {"version_id_col": version}  # noqa: RUF012  SQLAlchemy's form


class Note(Base):
    """A note on a patient, with its day. A removed one can be brought back until it is purged (sessions/clinic/notes.py)."""

    __tablename__ = "note"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    text: Mapped[str]
    written: Mapped[datetime] = mapped_column(default=now)
    removed: Mapped[datetime | None]
    version: Mapped[int] = mapped_column(default=1)

    __mapper_args__ = {"version_id_col": version}  # noqa: RUF012  SQLAlchemy's form


class PatientSession(Base):
    """One visit: a hand measured, live or from an uploaded recording."""

    __tablename__ = "session"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    hand: Mapped[str] = mapped_column(String(5))
    # open (being recorded), recorded, processed, failed
    state: Mapped[str] = mapped_column(String(16), default="open", index=True)
    started: Mapped[datetime] = mapped_column(default=now)
    # what the clock said, where it was wrong and `started` was corrected
    recorded_as: Mapped[datetime | None]
    date_reason: Mapped[str] = mapped_column(default="", server_default="")  # of that correction
    finished: Mapped[datetime | None]
    examiner: Mapped[str] = mapped_column(default="")
    notes: Mapped[str] = mapped_column(default="")
    conclusion: Mapped[str] = mapped_column(default="", server_default="")  # the therapist's
    pain_rest: Mapped[int | None]  # numerical rating scale, 0 to 10; None: not asked
    pain_movement: Mapped[int | None]
    # hand measures of this session, as HandGeometry
    geometry: Mapped[dict[str, Any]] = mapped_column(default=dict)
    continues_id: Mapped[int | None] = mapped_column(
        ForeignKey("session.id", ondelete="SET NULL"), index=True
    )  # of the other hand, measured just before in the same visit
    trunk_height: Mapped[float | None]  # m, the patient's when the session began
    # name, version and title of the assessment plan that it had; empty: none
    plan: Mapped[dict[str, Any]] = mapped_column(TextsWithCodes, default=dict, server_default="{}")
    # m, entered afterwards: replaces that of the recording
    # (sessions/clinic/trunk_height.py)
    trunk_corrected: Mapped[float | None]
    # counts what people changed (sessions/store/visit_facts.py), nothing else
    version: Mapped[int] = mapped_column(default=1, server_default="1")

    patient: Mapped[Patient] = relationship(back_populates="sessions")
    recordings: Mapped[list["RecordingFile"]] = relationship(
        back_populates="session", cascade="all, delete-orphan", order_by="RecordingFile.id"
    )
    reuses: Mapped[list["Reuse"]] = relationship(cascade="all, delete-orphan", order_by="Reuse.id")


class RecordingFile(Base):
    """A recording on the disk: its file never changes once it is closed."""

    __tablename__ = "recording"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    session_id: Mapped[int] = mapped_column(
        ForeignKey("session.id", ondelete="CASCADE"), index=True
    )
    format: Mapped[str] = mapped_column(String(16))  # native, motion-bids
    file: Mapped[str]  # relative to the data folder
    original_name: Mapped[str] = mapped_column(default="")
    sha256: Mapped[str | None] = mapped_column(String(64))  # None while it is being written
    bytes: Mapped[int] = mapped_column(default=0)
    added: Mapped[datetime] = mapped_column(default=now)
    # which of several records it, and has it until it lies in the object storage
    server: Mapped[str] = mapped_column(String(32), default="", server_default="")
    # duration, streams, losses, warnings: for lists without opening the file
    summary: Mapped[dict[str, Any]] = mapped_column(default=dict)

    session: Mapped[PatientSession] = relationship(back_populates="recordings")
    corrections: Mapped[list["Correction"]] = relationship(
        back_populates="recording", cascade="all, delete-orphan", order_by="Correction.id"
    )
    results: Mapped[list["Result"]] = relationship(
        back_populates="recording", cascade="all, delete-orphan", order_by="Result.id.desc()"
    )


class Correction(Base):
    """A trial or a stretch of it that a person took out of the figures, or moved, and why (sessions/clinic/corrections.py). Never removed, only undone."""

    __tablename__ = "correction"

    id: Mapped[int] = mapped_column(primary_key=True)
    recording_id: Mapped[int] = mapped_column(
        ForeignKey("recording.id", ondelete="CASCADE"), index=True
    )
    event: Mapped[int]  # which of the recording's events, from 0
    kind: Mapped[str] = mapped_column(String(16))  # exclude, move, leave_out
    onset: Mapped[float]  # s of the recording
    end: Mapped[float]
    reason: Mapped[str] = mapped_column(SentenceOrTyped)
    made: Mapped[datetime] = mapped_column(default=now)
    undone: Mapped[datetime | None]

    recording: Mapped[RecordingFile] = relationship(back_populates="corrections")


class SelfCalibration(Base):
    """What self-calibration found of a hand and a glove in one stretch of free movement (sessions/clinic/self_calibrations.py). Never edited, only withdrawn."""

    __tablename__ = "self_calibration"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    recording_id: Mapped[int] = mapped_column(
        ForeignKey("recording.id", ondelete="CASCADE"), index=True
    )
    hand: Mapped[str] = mapped_column(String(5))
    # its number; "" where the recording does not tell it
    glove: Mapped[str] = mapped_column(String(200), default="")
    onset: Mapped[float]  # s of the recording
    end: Mapped[float]
    version: Mapped[str] = mapped_column(String(32))  # of the program
    # lengths, seats, biases with standard deviations (derivative.py), SI
    found: Mapped[dict[str, Any]] = mapped_column(TextsWithCodes, default=dict)
    # what it says of itself, in sentences
    messages: Mapped[list[Any]] = mapped_column("told", TextsWithCodes, default=list)
    stored: Mapped[datetime] = mapped_column("kept", default=now)
    withdrawn: Mapped[datetime | None]  # it is not offered any more

    recording: Mapped[RecordingFile] = relationship()


class HandPhotograph(Base):
    """Figures of a photograph of a hand on the sheet (sessions/hand_photographs/photographs.py)."""

    __tablename__ = "hand_photograph"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    hand: Mapped[str] = mapped_column(String(5))
    taken: Mapped[datetime] = mapped_column(default=now)  # when it was measured
    version: Mapped[str] = mapped_column(String(32))  # of the program
    marks: Mapped[dict[str, Any]] = mapped_column(
        default=dict
    )  # pixels, by landmark; `second`: in another picture
    figures: Mapped[dict[str, Any]] = mapped_column(default=dict)  # geometry (m), initial_pose
    # JPEG in base64; None: not kept
    picture: Mapped[str | None] = mapped_column(Text, deferred=True)


class TreatmentEvent(Base):
    """What was done to a hand on a day: progress is read with it (sessions/treatment/events.py)."""

    __tablename__ = "treatment_event"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    kind: Mapped[str] = mapped_column(String(32))
    hand: Mapped[str] = mapped_column(String(5))  # left, right, both
    day: Mapped[date] = mapped_column(Date)
    comment: Mapped[str] = mapped_column(default="")


class Goal(Base):
    """The range that a figure of a hand is to reach, as a therapist set it (sessions/treatment/goals.py)."""

    __tablename__ = "goal"
    __table_args__ = (
        UniqueConstraint("patient_id", "hand", "measure", "task", "figure"),
        NEVER_AGAIN,
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    hand: Mapped[str] = mapped_column(String(5))
    measure: Mapped[str] = mapped_column(String(60))
    task: Mapped[str] = mapped_column(String(60))
    figure: Mapped[str] = mapped_column(String(100))
    unit: Mapped[str] = mapped_column(String(16))  # of low and high: the one that people read
    low: Mapped[float]
    high: Mapped[float]
    changed: Mapped[datetime] = mapped_column(default=now, onupdate=now)


class Reuse(Base):
    """What a session takes over of an earlier self-calibration, as a person decided it. A row a decision, the newest counts."""

    __tablename__ = "reuse"

    id: Mapped[int] = mapped_column(primary_key=True)
    session_id: Mapped[int] = mapped_column(
        ForeignKey("session.id", ondelete="CASCADE"), index=True
    )
    self_calibration_id: Mapped[int | None] = mapped_column(
        ForeignKey("self_calibration.id", ondelete="CASCADE"), index=True
    )
    parts: Mapped[str] = mapped_column(String(20))  # nothing, lengths, lengths_and_seats
    made: Mapped[datetime] = mapped_column(default=now)

    self_calibration: Mapped[SelfCalibration | None] = relationship()


class Result(Base):
    """What a method gave: a function of (recording, corrections, trunk's height, reuse, method, parameters, version), recomputed at will, never edited."""

    __tablename__ = "result"
    __table_args__ = (UniqueConstraint("recording_id", "key", name="one_result_a_key"), NEVER_AGAIN)

    id: Mapped[int] = mapped_column(primary_key=True)
    recording_id: Mapped[int] = mapped_column(
        ForeignKey("recording.id", ondelete="CASCADE"), index=True
    )
    # sha256 of method, parameters, geometry, corrections and version
    key: Mapped[str] = mapped_column(String(64))
    method: Mapped[str] = mapped_column(String(32))
    parameters: Mapped[dict[str, Any]] = mapped_column(default=dict)
    # that it was computed with
    corrections: Mapped[list[Any]] = mapped_column(default=list, server_default="[]")
    # of an earlier self-calibration; empty: nothing
    reused: Mapped[dict[str, Any]] = mapped_column(default=dict, server_default="{}")
    # m, in place of that in the recording; None: as in the recording
    trunk_height: Mapped[float | None]
    version: Mapped[str] = mapped_column(String(32))
    created: Mapped[datetime] = mapped_column(default=now)
    # which of several computes it
    server: Mapped[str] = mapped_column(String(32), default="", server_default="")
    # queued, running, done, failed
    state: Mapped[str] = mapped_column(String(16), default="queued")
    # how often its computation was begun
    attempts: Mapped[int] = mapped_column(default=0, server_default="0")
    progress: Mapped[float] = mapped_column(default=0.0)
    error: Mapped[str] = mapped_column(TextWithCodes, default="")
    figures: Mapped[list[Any]] = mapped_column(TextsWithCodes, default=list)
    # tasks with their details and curves thinned for pages
    content: Mapped[dict[str, Any]] = mapped_column(TextsWithCodes, default=dict)
    warnings: Mapped[list[Any]] = mapped_column(TextsWithCodes, default=list)

    recording: Mapped[RecordingFile] = relationship(back_populates="results")


class ReferenceEdition(Base):
    """Reference values as they were when results were compared with them: the content of app/report/reference_values.json."""

    __tablename__ = "reference_edition"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)  # sha256 of data
    data: Mapped[dict[str, Any]] = mapped_column(default=dict)


class ResultReferences(Base):
    """What a result is compared with (sessions/clinic/references.py). A row a version, never edited."""

    __tablename__ = "result_references"
    __table_args__ = (UniqueConstraint("result_id", "number", name="one_version_a_number"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    result_id: Mapped[int] = mapped_column(ForeignKey("result.id", ondelete="CASCADE"), index=True)
    number: Mapped[int]  # from 1
    made: Mapped[datetime] = mapped_column(default=now)
    author: Mapped[str] = mapped_column(String(64), default="")  # account; "": the program
    edition_id: Mapped[str] = mapped_column(ForeignKey("reference_edition.id"))
    # before, other: values; visits: results and moments; own, glove: MDCs
    data: Mapped[dict[str, Any]] = mapped_column(default=dict)


class Repeatability(Base):
    """How far a figure comes out alike when measured again: derived from results, never edited (sessions/clinic/repeatability.py). SI units.

    Of one patient (device is ""), or of one glove over all patients who wore it (patient is None).
    """

    __tablename__ = "repeatability"

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int | None] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    device: Mapped[str] = mapped_column(String(200), default="", index=True)  # the glove's number
    hand: Mapped[str] = mapped_column(String(5))
    method: Mapped[str] = mapped_column(String(32))
    parameters: Mapped[dict[str, Any]] = mapped_column(default=dict)
    measure: Mapped[str] = mapped_column(String(32))
    task: Mapped[str]
    name: Mapped[str] = mapped_column(String(64))  # of the figure: index_pip_flexion_max
    unit: Mapped[str] = mapped_column(String(16))
    sem: Mapped[float]
    mdc95: Mapped[float]
    mdc95_low: Mapped[float]  # ends of the 95 % interval
    mdc95_high: Mapped[float]
    icc: Mapped[float | None]  # ICC(2,1); None where fewer than two people were measured again
    icc_low: Mapped[float | None]
    icc_high: Mapped[float | None]
    people: Mapped[int]
    sessions: Mapped[int]
    freedom: Mapped[int]  # degrees of freedom of the SEM
    results: Mapped[list[Any]] = mapped_column(default=list)  # ids that it comes from
    computed: Mapped[datetime] = mapped_column(default=now)


class AssessmentPlan(Base):
    """A version of an assessment plan of the clinic's own (sessions/assessment_plans/stored.py)."""

    __tablename__ = "assessment_plan"
    __table_args__ = (UniqueConstraint("name", "version"), NEVER_AGAIN)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60))
    version: Mapped[int]
    content: Mapped[dict[str, Any]] = mapped_column(default=dict)  # as the plan's file holds it
    author: Mapped[str] = mapped_column(String(64), default="")  # an account's name
    stored: Mapped[datetime] = mapped_column(default=now)
    withdrawn: Mapped[datetime | None]  # it is not offered any more


class Account(Base):
    """Who may log in, and as what (sessions/clinic/accounts.py)."""

    __tablename__ = "account"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(64), unique=True)
    roles: Mapped[list[Any]] = mapped_column(default=list)  # of db/roles.py
    # argon2id hash with its parameters; None: one-time codes or single sign-on
    password: Mapped[str | None] = mapped_column(String(200))
    # issuer and subject, of an account of single sign-on
    subject: Mapped[str | None] = mapped_column(String(400), unique=True)
    disabled: Mapped[bool] = mapped_column(default=False)
    created: Mapped[datetime] = mapped_column(default=now)
    # counts what administrators changed: roles, wards, in and out of use
    version: Mapped[int] = mapped_column(default=1, server_default="1")

    logins: Mapped[list["Login"]] = relationship(
        back_populates="account", cascade="all, delete-orphan"
    )
    memberships: Mapped[list[WardMember]] = relationship(
        cascade="all, delete-orphan", order_by="WardMember.ward_id", lazy="selectin"
    )


class EmergencyAccess(Base):
    """That an account opened a patient of another ward, for how long and why (sessions/wards/emergency_access.py). Only its end changes."""

    __tablename__ = "emergency_access"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(
        ForeignKey("patient.id", ondelete="CASCADE"), index=True
    )
    account_id: Mapped[int] = mapped_column(
        ForeignKey("account.id", ondelete="CASCADE"), index=True
    )
    reason: Mapped[str]
    begun: Mapped[datetime] = mapped_column(default=now)
    ends: Mapped[datetime]

    account: Mapped[Account] = relationship()
    patient: Mapped[Patient] = relationship(back_populates="emergency_accesses")


class Login(Base):
    """A browser that has logged in: the hash of its cookie."""

    __tablename__ = "login"

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    account_id: Mapped[int] = mapped_column(
        ForeignKey("account.id", ondelete="CASCADE"), index=True
    )
    created: Mapped[datetime] = mapped_column(default=now)
    seen: Mapped[datetime] = mapped_column(default=now)

    account: Mapped[Account] = relationship(back_populates="logins", lazy="joined")


class SecondFactor(Base):
    """What an account proves itself with besides its password (sessions/clinic/second_factors.py)."""

    __tablename__ = "second_factor"
    __table_args__ = NEVER_AGAIN

    id: Mapped[int] = mapped_column(primary_key=True)
    account_id: Mapped[int] = mapped_column(
        ForeignKey("account.id", ondelete="CASCADE"), index=True
    )
    kind: Mapped[str] = mapped_column(String(16))  # totp, passkey, recovery
    name: Mapped[str] = mapped_column(String(64), default="")
    secret: Mapped[str]  # base32 of TOTP; public key of a passkey, base64; hash of a recovery code
    credential: Mapped[str] = mapped_column(default="")  # number of a passkey, base64url
    host: Mapped[str] = mapped_column(String(255), default="")  # that a passkey was made for
    counter: Mapped[int] = mapped_column(default=0)  # last step of TOTP; uses of a passkey
    confirmed: Mapped[bool] = mapped_column(default=False)
    created: Mapped[datetime] = mapped_column(default=now)
    used: Mapped[datetime | None]
