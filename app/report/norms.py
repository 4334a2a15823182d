"""Reference values of figures other than joint ranges, with who was measured and by whom: why this norm. The data are references.FILE's."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from handscope.app.report.references import FILE, Source


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


def norm_of(what: str, part: str = "", task: str = "") -> Norm | None:
    """The norm of a figure; None where there is none with a source."""
    return next(
        (
            n
            for n in norms()
            if n.what == what and n.part in (None, part) and n.task in (None, task)
        ),
        None,
    )


def change_of(what: str) -> PublishedChange | None:
    """The published smallest change of a figure; None where there is none."""
    return published_changes().get(what)


def change_of_name(name: str) -> PublishedChange | None:
    """The same by a figure's whole name, its part included: "index_tam"."""
    return next(
        (c for what, c in published_changes().items() if name == what or name.endswith(f"_{what}")),
        None,
    )


@cache
def norms() -> tuple[Norm, ...]:
    file = _file()
    return tuple(
        Norm(
            v["what"],
            v["unit"],
            float(v["mean"]),
            v.get("sd"),
            v.get("low"),
            v.get("high"),
            Source(**file["sources"][v["source"]]),
            v.get("note", ""),
            v.get("part"),
            v.get("task"),
        )
        for v in file["norms"]
    )


@cache
def published_changes() -> Mapping[str, PublishedChange]:
    file = _file()
    return {
        v["what"]: PublishedChange(
            v["what"],
            v["unit"],
            float(v["value"]),
            Source(**file["sources"][v["source"]]),
            v.get("note", ""),
        )
        for v in file["smallest_changes"]
    }


def _file() -> dict[str, Any]:
    value: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return value
