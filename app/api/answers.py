"""What routes answer with, as types: for the OpenAPI page, and for the pages' JavaScript.

`make types` writes static/types/api.d.ts from them (typescript.py). Accounts that may not see everything get
`WITHHELD` (pseudonymisation.py) in place of some values.
"""

from datetime import date, datetime
from typing import Any, NotRequired

from typing_extensions import TypedDict


def answers(model: Any, status: int = 200) -> dict[int | str, dict[str, Any]]:
    """What a route's decorator takes as `responses`: described, not checked at run time."""
    return {status: {"model": model}}


class MembershipRow(TypedDict):
    """A ward that an account belongs to."""

    ward: int
    name: str
    head: bool  # is shown emergency accesses to its patients


class AccountRow(TypedDict):
    """An account; nothing secret."""

    id: int
    name: str
    roles: list[str]
    disabled: bool
    created: datetime
    wards: list[MembershipRow]
    proof: str  # how one logs in: code, single (sign-on), password, none
    local: bool
    version: int
    second: NotRequired[bool]  # it has a second factor
    code: NotRequired[str]  # of a new account
    lacks_second_factor: NotRequired[bool]  # the own account, where one is required


class WardRow(TypedDict):
    """A ward of the hospital."""

    id: int
    name: str
    house: bool  # the whole house
    own: bool  # the account sees its patients and may put new ones there


class EmergencyRow(TypedDict):
    """An emergency access to a patient of another ward."""

    id: int
    patient: int
    pseudonym: str
    by: str  # account
    reason: str
    begun: datetime
    ends: datetime
    lasts: bool  # still in force


class NoteRow(TypedDict):
    """A note on a patient."""

    id: int
    text: str
    written: datetime
    removed: datetime | None
    version: int


class TreatmentEventRow(TypedDict):
    """What was done to a hand on a day."""

    id: int
    kind: str  # injury, operation, botulinum_toxin, splint, therapy, other
    hand: str  # left, right, both
    day: date
    comment: str


class GoalRow(TypedDict):
    """The range that a figure is to reach."""

    id: int
    unit: str
    low: float
    high: float
    changed: datetime


class PatientRow(TypedDict):
    """A patient; lengths in m."""

    id: int
    pseudonym: str
    ward: int
    ward_name: str
    year_of_birth: int | None
    dominant_hand: str | None
    affected_hand: str | None
    hand_measures: dict[str, Any]
    trunk_height: float | None
    archived: bool
    created: datetime
    version: int


class PatientListed(PatientRow):
    """A patient in the list."""

    sessions: int
    planned: int  # sessions of a simulated patient while a demonstration makes them, else 0
    last_session: datetime | None


class PlanRow(TypedDict):
    """An assessment plan; `content` as its file holds it, Handscope's own in the reader's language."""

    name: str
    version: int
    title: str
    content: dict[str, Any]
    own: bool  # the clinic's own version
    author: str
    stored: datetime | None


class SessionRow(TypedDict):
    """A session; duration in s, trunk height in m."""

    id: int
    patient: Any  # its number; id and pseudonym where one session is read
    hand: str
    continues: int | None  # session of the other hand in the same visit, that it follows
    state: str
    started: datetime
    dated: bool  # false: nothing tells when it was recorded, and `started` is the instant of the upload
    recorded_as: datetime | None  # date of the clock, where it was corrected
    date_reason: str
    trunk_height: float | None
    trunk_corrected: bool
    version: int
    finished: datetime | None
    examiner: str
    notes: str | None
    conclusion: str | None
    pain_rest: int | None  # numerical rating scale, 0 to 10
    pain_movement: int | None
    source: str  # live, upload
    plan: dict[str, Any]  # name, version and title of its assessment plan; empty: none
    duration: float | None
    tasks: list[str]
    empty: bool  # holds no trial: may be deleted


class Visit(SessionRow):
    """A session among those of its patient."""

    calibration: dict[str, Any] | None
    warnings: int
    doubts: list[str]


class PatientAnswer(PatientRow):
    """A patient with notes and sessions."""

    notes: list[NoteRow] | None
    emergency_accesses: list[EmergencyRow]
    sessions: list[Visit]
    planned: int  # sessions of a simulated patient while a demonstration makes them, else 0
    clock: dict[str, Any]


class CorrectionRow(TypedDict):
    """A correction of a recording's event; times in s."""

    id: int
    event: int
    kind: str
    onset: float
    end: float
    reason: str  # as typed; of an offered one the English words
    reason_code: str  # of an offered one: helped, wrong, interrupted, slipped, pain
    made: datetime
    undone: datetime | None


class ResultRow(TypedDict):
    """A result among those of its recording."""

    id: int
    method: str
    parameters: dict[str, Any]
    version: str
    state: str
    created: datetime
    corrections: int
    reused: dict[str, Any]
    current: bool


class RecordingRow(TypedDict):
    """A recording's file with its results."""

    id: int
    format: str
    name: str
    sha256: str | None
    bytes: int
    added: datetime
    summary: dict[str, Any]
    corrections: list[CorrectionRow]
    results: list[ResultRow]


class SessionAnswer(SessionRow):
    """A session with its recordings."""

    geometry: dict[str, Any]
    station: str | None
    saving: bool  # it was finished, and its recording is being stored
    other_hand: dict[str, Any] | None  # session and hand, of the same visit
    same_recording: list[dict[str, Any]]  # session, started, added: it was kept there before
    recordings: list[RecordingRow]


class StationRow(TypedDict):
    """A station that runs."""

    station: str
    kind: str


class TableTriad(TypedDict):
    """Columns of one quantity in the order of its components."""

    quantity: str  # gyr, acc, mag, orientation
    columns: list[str | int]
    unit: str
    point: str | None  # segment, where the table names it


class TableAnswer(TypedDict):
    """A table that is being mapped: its first rows and a guess of its columns."""

    name: str
    is_text: bool  # its layout can be changed
    layout: dict[str, Any]  # as MAP.json has it, as is `map`
    names: list[str]  # empty where there is no header
    columns: int
    count: int  # rows
    rows: list[list[str]]  # the first ones
    map: dict[str, Any] | None
    triads: list[TableTriad]
    questions: list[str]  # what the guess leaves open
    problem: str | None  # why it cannot be read by this layout
    choices: dict[str, Any]  # units by quantity, units of time, segments
    stored: dict[str, Any] | None  # the map last used for this header, and when


class TableFinding(TypedDict):
    """A finding about the numbers of a mapped table."""

    severity: str  # info, warning
    text: str


class TableFindings(TypedDict):
    """Duration, rate, rests and findings of a mapped table's numbers; s and Hz."""

    duration: float
    rate: float
    rests: list[list[float]]  # onset and end, the longest first
    findings: list[TableFinding]


class ClockLag(TypedDict):
    """How a camera's clock stands against the recording's: the recording's time is the camera's plus `seconds`."""

    seconds: float
    correlation: float
    overlap: float  # s that both show
    rival: float | None  # s, another lag that fits as well
    ppm: float | None  # how much faster the camera's clock runs, where that was corrected


class AngleAgreement(TypedDict):
    """How far a camera's angle is from the result's, deg: a difference is camera less result."""

    what: str
    drms: float  # root mean square of the difference
    offset: float  # its mean
    drms_minus_offset: float
    rom_a: float  # range of motion of the result
    rom_b: float  # of the camera
    drom: float  # difference of both ranges
    correlation: float | None
    unit: str


class StretchAgreement(TypedDict):
    """All angles in one stretch."""

    event: int | None  # a task of the recording; null: all of it
    onset: float
    end: float
    angles: list[AngleAgreement]


class AngleCurve(TypedDict):
    """An angle of both, deg, on the recording's clock; null where unknown."""

    what: str
    t: list[float | None]
    a: list[float | None]
    b: list[float | None]
    difference: list[float | None]


class LandmarkAnswer(TypedDict):
    """A result beside a camera's hand landmarks."""

    name: str
    frames: int
    seen: float  # share of the frames that show a hand
    lag: ClockLag
    stretches: list[StretchAgreement]
    curves: list[AngleCurve]
