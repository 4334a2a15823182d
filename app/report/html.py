"""The report as one HTML file that needs nothing else: the same words and figures as the PDF, no script, nothing loaded from anywhere."""

import re
from functools import cache
from itertools import count
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from handscope.app.language import Language
from handscope.app.report.content import Content
from handscope.app.report.page import words_of

LAYOUT = Path(__file__).with_name("report.html.j2")
PROLOGUE: Final = re.compile(r"^.*?(?=<svg)", re.DOTALL)
NAMES: Final = re.compile(r'(id="|url\(#|href="#)')


def html(content: Content, language: Language) -> bytes:
    """The report; text prints as it was typed."""
    numbers = count()
    return (
        _template()
        .render(
            page=words_of(content, language), drawn=lambda svg: _insert_chart(svg, next(numbers))
        )
        .encode()
    )


@cache
def _template() -> Template:
    return Environment(
        loader=FileSystemLoader(LAYOUT.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    ).get_template(LAYOUT.name)


def _insert_chart(svg: str, number: int) -> Markup:
    """A figure of ours (plots.py, which escapes text) within the document: without its prologue, its names kept apart from other figures'."""
    return Markup(NAMES.sub(rf"\g<1>f{number}-", PROLOGUE.sub("", svg)))
