"""The progress report of a patient in the database."""

from collections.abc import Mapping
from pathlib import Path

from sqlalchemy.orm import Session

from handscope.app.language import Language
from handscope.app.protocols import offered
from handscope.app.report.pdf import pdf_of
from handscope.app.report.progress.page import Patient, Treated, progress_page
from handscope.app.report.progress.series import Progress, progress
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.clinic import patients, repeatability
from handscope.sessions.db.tables import Goal
from handscope.sessions.store.store import Store
from handscope.sessions.treatment import goals

LAYOUT = Path(__file__).with_name("progress.typ")


def progress_report(
    db: Session, store: Store, patient_id: int, hand: Hand, language: Language, paper: str
) -> bytes:
    """PDF; InputError where no figure of the hand was measured twice."""
    patient, protocols = patients.get(db, patient_id), offered(store.folder)[0]
    history = progress(repeatability.history(db, patient_id), protocols)
    about = Patient(
        patient.pseudonym,
        [Treated(e.kind, e.hand, e.day, e.comment) for e in patient.treatment_events],
        _ranges(history, hand, goals.of_patient(patient)) if history else {},
        protocols,
    )
    page = progress_page(history, hand, about, language) if history else None
    if history is None or page is None:
        raise InputError("report.nothing_repeated")
    newest = history.sessions[hand][-1].started
    return pdf_of(page, LAYOUT, paper, int(newest.timestamp()))


def _ranges(
    history: Progress, hand: Hand, aims: Mapping[tuple[str, goals.Key], Goal]
) -> dict[tuple[str, goals.Key], tuple[float, float]]:
    """What the hand's figures are to reach."""
    keys = [((s.measure, s.task, s.name), s.unit) for s in history.series]
    return {
        (hand, key): (goal.low, goal.high)
        for key, unit in keys
        if (goal := goals.fitting(aims, hand, key, unit)) is not None
    }
