"""Files of the pages as answers: text is packed, and a browser keeps what holds nothing of a patient."""

import gzip
import hashlib
import os
import re
import stat
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Scope

from handscope import static
from handscope.app.auth.roles import EVERY_ACCOUNT, RoleRequirement

STATIC = Path(static.__file__).parent
TEXT = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
ASK = "no-cache"  # keep it, and ask whether it is the newest
_STYLE = re.compile(rb'^@import "([\w./]+)";$', re.MULTILINE)


class Files(StaticFiles):
    """The pages' files; those of the login page are open to anybody (auth/gate.py)."""

    requires_role = RoleRequirement(frozenset(EVERY_ACCOUNT))

    async def get_response(self, path: str, scope: Scope) -> Response:
        """As the framework answers; a text's file is looked up here, since a page has up to eighty and a thread takes longer for each than the look."""
        if Path(path).suffix in TEXT and scope["method"] in ("GET", "HEAD"):
            with suppress(OSError, ValueError):  # the framework says what is wrong with the path
                found, about = self.lookup_path(path)
                if about and stat.S_ISREG(about.st_mode):
                    return self.file_response(found, about, scope)
        return await super().get_response(path, scope)

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """As the framework answers with a file; text is packed, styles come with those that they import."""
        path, headers = Path(full_path), Headers(scope=scope)
        if path.suffix in TEXT and status_code == 200:
            text = _text_of(path, stat_result.st_mtime_ns)
            if path.suffix == ".css":
                text = _with_imported(path.parent, text)
            return text_answer(text, path.suffix, headers)
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = ASK
        return response


def text_answer(text: bytes, suffix: str, request: Headers) -> Response:
    """A text that holds nothing of a patient, packed where the browser can unpack it; nothing where its copy is the newest."""
    tag = f'"{_digest(text)}"'
    headers = {"ETag": tag, "Cache-Control": ASK, "Vary": "Accept-Encoding"}
    if tag in request.get("if-none-match", ""):
        return NotModifiedResponse(Headers(headers))
    return packed_answer(text, TEXT[suffix], request, headers)


def packed_answer(
    text: bytes, media_type: str, request: Headers, headers: dict[str, str], status: int = 200
) -> Response:
    """A text, packed where the browser can unpack it."""
    headers = {**headers, "Vary": "Accept-Encoding"}
    if "gzip" not in request.get("accept-encoding", ""):
        return Response(text, status, headers, media_type)
    return Response(_compress(text), status, {**headers, "Content-Encoding": "gzip"}, media_type)


def _with_imported(folder: Path, text: bytes) -> bytes:
    """A sheet with the sheets that it imports in their places: one request in place of eight, each of which waits for a round trip."""

    def imported(found: re.Match[bytes]) -> bytes:
        path = folder / found[1].decode()
        return _text_of(path, path.stat().st_mtime_ns)

    return _STYLE.sub(imported, text)


@lru_cache(maxsize=512)
def _text_of(path: Path, changed: int) -> bytes:
    return path.read_bytes()


@lru_cache(maxsize=512)
def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()[:32]


@lru_cache(maxsize=512)
def _compress(text: bytes) -> bytes:
    return gzip.compress(text, 9, mtime=0)
