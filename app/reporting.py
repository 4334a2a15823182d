"""The report of a kept result: gathered from the database and computed anew."""

from typing import Literal, cast

from app.options import with_options
from app.protocols import load_all
from app.report.content import Content, Visit, content
from app.results import computed
from app.version import software_version
from estimators.measures.assessment import assess
from estimators.methods import METHODS
from sessions import records
from sessions.store import Store
from sessions.tables import Result


def report(store: Store, result: Result) -> Content:
    """What the report of a result says."""
    recording, processed = computed(store, result)
    session, patient = result.recording.session, result.recording.session.patient
    visit = Visit(
        patient=patient.pseudonym,
        date=session.started,
        examiner=session.examiner,
        dominant=records.hand_of(patient.dominant_hand) if patient.dominant_hand else None,
        affected=cast(Literal["left", "right", "both"] | None, patient.affected_hand),
        notes=session.notes,
    )
    tasks = assess(processed.trajectory, recording.events)
    params = with_options(METHODS[result.method].Params, result.parameters)
    return content(visit, recording, processed, result.method, params, tasks, software_version(), load_all())
