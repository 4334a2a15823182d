"""The pages' words as modules that a browser imports; one file in app/language is one more language here, too."""

import json
from functools import cache

from fastapi import APIRouter, Request
from starlette.responses import Response

from handscope.app import language
from handscope.app.auth.roles import ANYBODY, requires_role
from handscope.app.language import Language
from handscope.app.page_files.files import text_answer

router = APIRouter(include_in_schema=False, dependencies=[requires_role(ANYBODY)])


@router.get("/languages/names.js")
def names(request: Request) -> Response:
    """Which languages there are: {code: name}."""
    return text_answer(names_module(), ".js", request.headers)


@router.get("/languages/{code}.js")
def words(code: str, request: Request) -> Response:
    """Every text of the pages by its key, and the language's form of numbers and dates as `locale`."""
    return text_answer(words_module(code), ".js", request.headers)


def names_module() -> bytes:
    """The module of the languages' names."""
    return _module({one.code: one.name for one in language.languages().values()})


def words_module(code: str) -> bytes:
    """The module of a language's words."""
    return _words(language.language(code))


@cache
def _words(one: Language) -> bytes:
    return _module({"locale": str(one.locale).replace("_", "-"), **one.pages})


def _module(values: dict[str, str]) -> bytes:
    return f"export default {json.dumps(values, ensure_ascii=False)};\n".encode()
