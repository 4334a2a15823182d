"""Addresses of files that change when a file does: a browser keeps such a file and never asks for it again.

/v/VERSION/static/dom.js is /static/dom.js. Modules and styles name each other by relative addresses, so that the version stays in front.
"""

import hashlib
import os
import re
import time
from functools import lru_cache
from pathlib import Path

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from handscope.app import language
from handscope.app.page_files.files import STATIC

KEEP = "private, max-age=31536000, immutable"
ROOTS = (STATIC, Path(language.__file__).parent)
ENDINGS = (".js", ".css", ".svg", ".woff2", ".json")
_VERSIONED = re.compile(r"/v/(?P<version>[0-9a-f]{16})(?P<file>/(?:static|languages)/.+)")


class VersionedAddresses:
    """ASGI middleware, before the gate: an address with a version is the address without, whose answer is kept where the version is the newest."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        found = _VERSIONED.fullmatch(scope["path"]) if scope["type"] == "http" else None
        if found is None:
            await self._app(scope, receive, send)
            return

        async def send_kept(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] in (200, 304):
                MutableHeaders(scope=message)["Cache-Control"] = KEEP
            await send(message)

        is_newest = found["version"] == newest_version()
        await self._app({**scope, "path": found["file"]}, receive, send_kept if is_newest else send)


def newest_version() -> str:
    """Of all files of the pages and all words; looked at once a second at most."""
    return _version(int(time.monotonic()))


@lru_cache(maxsize=1)
def _version(second: int) -> str:
    walked = (
        (folder, name) for root in ROOTS for folder, _, names in os.walk(root) for name in names
    )
    paths = sorted(os.path.join(folder, name) for folder, name in walked if name.endswith(ENDINGS))
    return _hash(tuple((path, os.stat(path).st_mtime_ns) for path in paths))


@lru_cache(maxsize=1)
def _hash(files: tuple[tuple[str, int], ...]) -> str:
    whole = hashlib.sha256()
    for path, _ in files:
        whole.update(Path(path).read_bytes())
    return whole.hexdigest()[:16]
