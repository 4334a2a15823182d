"""/api/patients/…/photographs: the printed sheet, photographs of a hand on it, and what they tell."""

import json
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Form, Response, UploadFile
from pydantic import Field

from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, requires_role
from handscope.app.live.station import Station
from handscope.app.photograph.pictures import (
    LARGEST,
    measure_hand,
    open_photograph,
    without_description,
)
from handscope.app.photograph.printing import print_sheet
from handscope.app.state import Db, LanguageDep, StationDep
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry, measures_from, sized
from handscope.estimators.photograph.hand_figures import Figures
from handscope.estimators.photograph.sheet import PAPERS, Sheet
from handscope.estimators.photograph.use import geometry_entries, pose_details
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import HandPhotograph, Patient
from handscope.sessions.hand_photographs import photographs
from handscope.sessions.store import records

router = APIRouter(tags=["photographs"], dependencies=[requires_role(CLINICIAN)])
MM = 1e3  # in a metre


class MeasuredPose(Incoming):
    """The photograph whose angles the next pose has."""

    photograph: int | None = Field(description="its number; null: the pose's nominal angles")


@router.get("/patients/{patient_id}/pose-sheet.pdf")
async def read_sheet(
    db: Db, language: LanguageDep, patient_id: int, hand: Hand, paper: str = "a4"
) -> Response:
    """The sheet for this patient's hand, to be printed at 100 %."""
    if paper not in PAPERS:
        raise InputError("api.unknown_paper", paper=paper, papers=", ".join(PAPERS))
    geometry = _geometry(patients.get(db, patient_id), hand)
    made = await to_thread.run_sync(print_sheet, Sheet(paper, hand), geometry, language)
    return Response(made, media_type="application/pdf")


@router.post("/patients/{patient_id}/photographs/landmarks")
async def propose_landmarks(
    db: Db,
    patient_id: int,
    file: UploadFile,
    hand: Annotated[Hand, Form()],
    ruler: Annotated[float | None, Form()] = None,
) -> dict[str, Any]:
    """Where the landmarks will be in the picture, pixels; nothing of it is kept. `ruler`: its printed length, m."""
    geometry = _geometry(patients.get(db, patient_id), hand)
    data = await _read(file)
    photograph = await to_thread.run_sync(open_photograph, data, hand, ruler)
    places = photograph.proposed(geometry)
    return {
        "size": photograph.camera.size,
        "markers": photograph.markers,
        "tilt": photograph.camera.tilt,
        "landmarks": {name: [float(x) for x in at] for name, at in places.items()},
    }


@router.post("/patients/{patient_id}/photographs", status_code=201)
async def measure_photograph(
    db: Db,
    patient_id: int,
    file: UploadFile,
    hand: Annotated[Hand, Form()],
    marks: Annotated[str, Form()],
    ruler: Annotated[float | None, Form()] = None,
    keep: Annotated[bool, Form()] = False,
    second: UploadFile | None = None,
) -> dict[str, Any]:
    """What the landmarks, pixels by name, tell of the hand; the picture itself is kept only where `keep` says so.

    `second`: another picture of the hand as it lies, from another side, its landmarks in `marks` by the same name; it is not kept.
    """
    patient = patients.get(db, patient_id)
    places, data = _marks(marks), await _read(file)
    pictures = [(await to_thread.run_sync(open_photograph, data, hand, ruler), places)]
    if second is not None:
        others = _landmarks(places.get("second"))
        more = await to_thread.run_sync(open_photograph, await _read(second), hand, ruler)
        pictures.append((more, others))
    found = await to_thread.run_sync(measure_hand, pictures)
    picture = await to_thread.run_sync(without_description, data) if keep else None
    figures = {
        "geometry": geometry_entries(found),
        "initial_pose": pose_details(found),
        "table": _table(found),
    }
    made = photographs.store(db, patient, hand, places, figures, software_version(), picture)
    return row(made)


@router.get(
    "/patients/{patient_id}/photographs", dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)
def list_photographs(db: Db, patient_id: int) -> list[dict[str, Any]]:
    """Figures of photographs of both hands, the newest first."""
    return [row(p) for p in patients.get(db, patient_id).photographs]


@router.get("/photographs/{photograph_id}/picture.jpg")
def read_picture(db: Db, photograph_id: int) -> Response:
    """The picture, where it was kept."""
    picture = photographs.picture_of(photographs.get(db, photograph_id))
    if picture is None:
        raise InputError("api.picture_not_stored", number=photograph_id)
    return Response(picture, media_type="image/jpeg")


@router.delete("/photographs/{photograph_id}", status_code=204)
def remove_photograph(db: Db, photograph_id: int) -> None:
    """Erase a photograph with its figures."""
    photographs.remove(db, photograph_id)


@router.put("/stations/{name}/measured-pose", status_code=204)
def use_photograph(db: Db, station: StationDep, wish: MeasuredPose) -> None:
    """The next pose at the station has the angles of this photograph, which was taken of the hand as it lies."""
    if not isinstance(station, Station):
        raise InputError("api.replay_takes_no_pose")
    details: dict[str, float] = {}
    if wish.photograph is not None:
        photograph = photographs.get(db, wish.photograph)
        session = records.get(db, station.setup.session)
        if (photograph.patient_id, photograph.hand) != (session.patient_id, session.hand):
            raise InputError("api.photograph_of_other_hand", number=wish.photograph)
        details = photograph.figures["initial_pose"]
    station.measured_pose.use_photograph(details)


def row(p: HandPhotograph) -> dict[str, Any]:
    """A photograph for people and programs; lengths in m, angles in deg."""
    return {
        "id": p.id,
        "hand": p.hand,
        "taken": p.taken,
        "picture": p.picture is not None,
        **p.figures,
    }


def _geometry(patient: Patient, hand: Hand) -> HandGeometry:
    return sized(hand, measures_from((patient.hand_measures or {}).get(hand, {})))


def _marks(given: str) -> dict[str, Any]:
    try:
        found = json.loads(given)
    except ValueError:
        found = None
    return _landmarks(found)


def _landmarks(found: object) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise InputError("photograph.landmarks_unreadable")
    return found


async def _read(file: UploadFile) -> bytes:
    data = await file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise InputError("photograph.too_large", most=LARGEST / 2**20)
    return data


def _table(found: Figures) -> list[dict[str, Any]]:
    """Rows for people: what, value and standard deviation, unit."""
    lengths = [
        {"what": name, "value": MM * value, "sd": MM * found.lengths_sd[name], "unit": "mm"}
        for name, value in found.lengths.items()
    ]
    details = pose_details(found)
    angles = [
        {
            "what": f"{joint}_deviation",
            "value": details[f"{joint}_deviation_deg"],
            "sd": details[f"{joint}_deviation_sd_deg"],
            "unit": "°",
        }
        for joint in found.deviation
    ]
    return lengths + angles
