"""The report of a session: `content.content` gathers it, FORMS hand it out. What draws and sets is imported when a report is made."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from handscope.app.language import ENGLISH, Language

if TYPE_CHECKING:
    from handscope.app.report.content import Content

Paper = Literal["a4", "us-letter"]
PAPERS: tuple[Paper, ...] = get_args(Paper)


@dataclass(frozen=True)
class Style:
    """How a report is to be written; tables for programs (CSV, JSON) are always in English."""

    language: Language = ENGLISH
    paper: Paper = "a4"


def _pdf(content: "Content", style: Style) -> bytes:
    from handscope.app.report.pdf import pdf

    return pdf(content, style.language, style.paper)


def _html(content: "Content", style: Style) -> bytes:
    from handscope.app.report.html import html

    return html(content, style.language)


def _csv(content: "Content", style: Style) -> bytes:
    from handscope.app.report.tables import csv

    return csv(content)


def _json(content: "Content", style: Style) -> bytes:
    from handscope.app.report.tables import json

    return json(content)


FORMS: Mapping[str, Callable[["Content", Style], bytes]] = {
    "pdf": _pdf,
    "html": _html,
    "csv": _csv,
    "json": _json,
}
