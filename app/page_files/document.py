"""The documents: each names its files by addresses with their version, and the modules that its address needs, so that a browser asks for all at once."""

import html
import json
import posixpath
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import Response

from handscope.app import language
from handscope.app.page_files.files import STATIC, packed_answer
from handscope.app.page_files.versions import newest_version

_IMPORTED = re.compile(r'^(?:import|export)\b(?:[^;"]*\bfrom)? *"(\.[^"]+)"', re.MULTILINE)
_SCRIPT = re.compile(r'<script type="module"[^>]* src="([^"]+)"></script>')
_FILE = re.compile(r'(?<=")(?=/(?:static|languages)/)')


def document(
    name: str,
    request: Headers,
    modules: tuple[str, ...] = (),
    account: dict[str, Any] | None = None,
    status: int = 200,
) -> Response:
    """static/NAME; `modules` are those that its script imports where it finds itself at this address, `account` is what it knows at once of who reads.

    Words are loaded early in the browser's own language; where a person chose another on the pages, it is loaded when it is found.
    """
    words = language.preferred(request.get("accept-language", "")).code
    text = _document(name, modules, words, newest_version())
    if account:
        known = html.escape(json.dumps(account))
        text = text.replace("<html ", f'<html data-account="{known}" ', 1)
    return packed_answer(text.encode(), "text/html", request, {}, status)


@lru_cache(maxsize=64)
def _document(name: str, modules: tuple[str, ...], words: str, version: str) -> str:
    text = (STATIC / name).read_text("utf-8")
    needed = with_imported([f"/languages/{words}.js", *_SCRIPT.findall(text), *modules])
    links = "".join(f'<link rel="modulepreload" href="{address}">\n    ' for address in needed)
    text = text.replace('<script type="module"', f'{links}<script type="module"', 1)
    return _FILE.sub(f"/v/{version}", text)


def with_imported(addresses: Iterable[str]) -> list[str]:
    """Modules, each followed by those of all that it imports in turn which were not named before."""
    found = list[str]()
    for address in addresses:
        waiting = [address]
        while waiting:
            address = waiting.pop(0)
            if address in found:
                continue
            found.append(address)
            if address.startswith("/static/"):
                text = (STATIC / address.removeprefix("/static/")).read_text("utf-8")
                named = _IMPORTED.findall(text)
                waiting += [posixpath.normpath(f"{posixpath.dirname(address)}/{n}") for n in named]
    return found
