"""What changed since the patient's session before, and whether by more than repeated measurement gives.

Judged by the MDC95 of the patient's own repeated sessions where there are enough, else of the glove's, else the published default.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from handscope.app.report.norms import change_of_name
from handscope.app.report.references import Edition, newest
from handscope.app.report.units import reading
from handscope.estimators.measures.figure import Figure
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.repeatability import ENOUGH, Comparison, Key, is_sufficient
from handscope.sessions.db.tables import Repeatability

Basis = Literal["own", "glove", "published", "none"]
NEEDED = phrase("change.published", sessions=ENOUGH + 1)
NOT_KNOWN = phrase("change.not_judged")


@dataclass(frozen=True)
class Change:
    """Of one figure, in the unit a person reads."""

    measure: str
    task: str
    name: str
    value: float  # now less before
    unit: str
    mdc95: float | None  # None: not known
    basis: Basis
    sources: tuple[str, ...]  # of the MDC, in sentences; why there is none

    @property
    def beyond(self) -> bool:
        return self.mdc95 is not None and abs(self.value) > self.mdc95


@dataclass(frozen=True)
class Judge:
    """What a change of a figure is judged by, in the unit a person reads."""

    mdc95: float | None  # None: not known
    basis: Basis
    sources: tuple[str, ...]  # of the MDC, in sentences; why there is none


@dataclass(frozen=True)
class Changes:
    """Of a session since the patient's session before."""

    since: datetime
    each: tuple[Change, ...]

    def sources(self, measure: str) -> tuple[str, ...]:
        """What this measure's changes are judged by, in sentences."""
        return tuple(
            dict.fromkeys(
                sentence for c in self.each if c.measure == measure for sentence in c.sources
            )
        )

    def of(self, task: str, name: str) -> Change | None:
        return next((c for c in self.each if (c.task, c.name) == (task, name)), None)


def changes(compared: Comparison, edition: Edition | None = None) -> Changes | None:
    """Every figure that both sessions have, by the MDCs of an edition; None where there is none."""
    each = tuple(
        _change(key, value - compared.before[key][0], unit, compared, edition or newest())
        for key, (value, unit) in compared.now.items()
        if key in compared.before and not key[2].endswith("_range")
    )
    return Changes(compared.since, each) if each else None


def judged_by(
    key: Key,
    unit: str,
    own: Mapping[Key, Repeatability],
    glove: Mapping[Key, Repeatability],
    edition: Edition | None = None,
) -> Judge:
    """What a change of the figure `key`, SI unit `unit`, must exceed, from the patient's own and the glove's repeatability and what is published."""
    edition = edition or newest()
    mine: tuple[tuple[Basis, Repeatability | None], ...] = (
        ("own", own.get(key)),
        ("glove", glove.get(key)),
    )
    for basis, row in mine:
        if row is not None and is_sufficient(row):
            return Judge(read_as(key, row.mdc95, unit)[0], basis, (_source(row),))
    if key[0] == "range_of_motion" and unit == "rad":
        default = edition.smallest_change
        words = phrase("change.angle", size=default.value, source=default.source.name)
    elif key[2] == "tapping_rate":
        default = edition.smallest_change_of_rate
        words = phrase("change.tapping_rate", size=default.value, source=default.source.name)
    elif (published := change_of_name(key[2], edition)) is not None:
        unit = "°" if published.unit == "deg" else f" {published.unit}"
        size = f"{published.value:g}{unit}"
        return Judge(
            published.value,
            "published",
            (phrase("change.trial_to_trial", size=size, source=published.source.name), NEEDED),
        )
    else:
        return Judge(None, "none", (NOT_KNOWN,))
    return Judge(default.value, "published", (words, NEEDED))


def read_as(key: Key, value: float, unit: str) -> tuple[float, str]:
    """A figure's SI value in the unit a person reads, and that unit."""
    read = reading(Figure(key[2], value, unit, ""))
    return read.value, {"Hz": "per s"}.get(read.unit, read.unit)


def _change(
    key: Key, difference: float, unit: str, compared: Comparison, edition: Edition
) -> Change:
    value, shown = read_as(key, difference, unit)
    judge = judged_by(key, unit, compared.own, compared.glove, edition)
    return Change(*key, value, shown, judge.mdc95, judge.basis, judge.sources)


def _source(row: Repeatability) -> str:
    if row.patient_id is not None:
        return phrase("change.own", sessions=row.sessions)
    return phrase("change.of_glove", sessions=row.sessions, people=row.people)
