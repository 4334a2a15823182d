"""The report of a session: `content.content` gathers it, FORMS hand it out. What draws and sets is imported when a report is made."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.report.content import Content


def _pdf(content: "Content") -> bytes:
    from app.report.pdf import pdf

    return pdf(content)


def _csv(content: "Content") -> bytes:
    from app.report.tables import csv

    return csv(content)


def _json(content: "Content") -> bytes:
    from app.report.tables import json

    return json(content)


FORMS: Mapping[str, Callable[["Content"], bytes]] = {"pdf": _pdf, "csv": _csv, "json": _json}
