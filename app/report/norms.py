"""Reference values of figures other than joint ranges, with who was measured and by whom: why this norm. The data are of an edition (references.py)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from handscope.app.report.references import Edition, Source, newest
from handscope.estimators.messages.sentence import with_code

EDITIONS = 8  # remembered at a time


@dataclass(frozen=True)
class Norm:
    """What others measured of a figure, in the unit a person reads; None where the source does not say."""

    what: str  # of the figure, as in estimators.measures.figure.Figure
    unit: str
    mean: float
    sd: float | None  # over people
    low: float | None  # of most people: 5 and 95 %, or the range, as the reference says
    high: float | None
    source: Source
    note: str = ""
    part: str | None = None  # None: any part
    task: str | None = None  # None: any task


@dataclass(frozen=True)
class PublishedChange:
    """What a change of a figure must exceed from one trial to the next (MDC95), in the unit a person reads."""

    what: str
    unit: str
    value: float
    source: Source
    note: str = ""


def norm_of(
    what: str, part: str = "", task: str = "", edition: Edition | None = None
) -> Norm | None:
    """The norm of a figure; None where there is none with a source."""
    return next(
        (
            n
            for n in norms(edition)
            if n.what == what and n.part in (None, part) and n.task in (None, task)
        ),
        None,
    )


def change_of_name(name: str, edition: Edition | None = None) -> PublishedChange | None:
    """The same by a figure's whole name, its part included: "index_tam"."""
    return next(
        (
            c
            for what, c in published_changes(edition).items()
            if name == what or name.endswith(f"_{what}")
        ),
        None,
    )


@lru_cache(EDITIONS)
def norms(edition: Edition | None = None) -> tuple[Norm, ...]:
    """All norms of an edition; without one of the newest."""
    edition = edition or newest()
    return tuple(
        Norm(
            v["what"],
            v["unit"],
            float(v["mean"]),
            v.get("sd"),
            v.get("low"),
            v.get("high"),
            edition.source(v["source"]),
            with_code(f"norm_note.{v['what']}", v.get("note", "")),
            v.get("part"),
            v.get("task"),
        )
        for v in edition.data["norms"]
    )


@lru_cache(EDITIONS)
def published_changes(edition: Edition | None = None) -> Mapping[str, PublishedChange]:
    """All published MDCs of an edition, by figure; without one of the newest."""
    edition = edition or newest()
    return {
        v["what"]: PublishedChange(
            v["what"],
            v["unit"],
            float(v["value"]),
            edition.source(v["source"]),
            v.get("note", ""),
        )
        for v in edition.data["smallest_changes"]
    }
