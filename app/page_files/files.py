"""Files of the pages as answers: text is packed, and a browser keeps what holds nothing of a patient and asks each time whether it is the newest."""

import gzip
import hashlib
import os
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
        """As the framework answers with a file; text is packed."""
        path, headers = Path(full_path), Headers(scope=scope)
        if path.suffix in TEXT and status_code == 200:
            return text_answer(_text_of(path, stat_result.st_mtime_ns), path.suffix, headers)
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = ASK
        return response


def text_answer(text: bytes, suffix: str, request: Headers) -> Response:
    """A text that holds nothing of a patient, packed where the browser can unpack it; nothing where its copy is the newest."""
    packed, tag = _compress(text)
    headers = {"ETag": tag, "Cache-Control": ASK, "Vary": "Accept-Encoding"}
    if tag in request.get("if-none-match", ""):
        return NotModifiedResponse(Headers(headers))
    if "gzip" not in request.get("accept-encoding", ""):
        return Response(text, media_type=TEXT[suffix], headers=headers)
    headers["Content-Encoding"] = "gzip"
    return Response(packed, media_type=TEXT[suffix], headers=headers)


@lru_cache(maxsize=512)
def _text_of(path: Path, changed: int) -> bytes:
    return path.read_bytes()


@lru_cache(maxsize=512)
def _compress(text: bytes) -> tuple[bytes, str]:
    """The text packed, and its tag."""
    return gzip.compress(text, 9, mtime=0), f'"{hashlib.sha256(text).hexdigest()[:32]}"'
