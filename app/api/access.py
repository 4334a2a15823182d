"""Who may come in: one-time tokens make logins, logins are cookies, and nothing is served without one.

A token is a file named after its hash in the data folder: whoever may write there (the same user of the machine) may let a browser in.
"""

import contextlib
import hashlib
import secrets
from datetime import timedelta
from pathlib import Path
from urllib.parse import urlsplit

import anyio.to_thread
from sqlalchemy import delete, select
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session
from starlette.datastructures import URL, Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.settings import Settings
from sessions.store import Store
from sessions.tables import Login, now

COOKIE = "handscope"
OPEN_PATHS = ("/login", "/api/login", "/api/health")
OPEN_FOLDERS = ("/static/login/", "/static/fonts/", "/static/words/", "/languages/")
OPEN_FILES = (
    "/static/colors.css",
    "/static/style.css",
    "/static/favicon.svg",
    "/static/preferences.js",
    "/static/theme.js",
    "/static/dom.js",
)
TOKEN_LIFE = timedelta(hours=12)
TOUCH_EVERY = timedelta(minutes=1)
SAFE = ("GET", "HEAD", "OPTIONS")


def new_token(data: Path) -> str:
    """A one-time token for a server on this data folder."""
    token = secrets.token_urlsafe(24)
    folder = data / "tokens"
    folder.mkdir(mode=0o700, exist_ok=True)
    (folder / _hash(token)).touch(mode=0o600)
    return token


def redeem(store: Store, token: str) -> str | None:
    """The cookie of a new login, or None where the token is unknown, used or old."""
    path = store.folder / "tokens" / _hash(token)
    try:
        made = path.stat().st_mtime
        path.unlink()
    except OSError:
        return None
    if now().timestamp() - made > TOKEN_LIFE.total_seconds():
        return None
    cookie = secrets.token_urlsafe(32)
    with store.database() as db:
        db.add(Login(token_hash=_hash(cookie)))
        db.commit()
    return cookie


def logged_in(db: Session, cookie: str | None, idle: float) -> bool:
    """Whether a cookie belongs to a login that is still alive; keeps it alive."""
    if not cookie:
        return False
    login = db.scalar(select(Login).where(Login.token_hash == _hash(cookie)))
    if login is None:
        return False
    if now() - login.seen > timedelta(seconds=idle):
        db.delete(login)
        db.commit()
        return False
    if now() - login.seen > TOUCH_EVERY:
        login.seen = now()
        with contextlib.suppress(DBAPIError):  # a full disk locks nobody out
            db.commit()
    return True


def log_out(db: Session, cookie: str | None) -> None:
    """End a login."""
    if cookie:
        db.execute(delete(Login).where(Login.token_hash == _hash(cookie)))
        db.commit()


class Gate:
    """Lets only requests and web sockets of logged-in browsers of our own pages through; puts security headers on every answer."""

    def __init__(self, app: ASGIApp, store: Store, settings: Settings) -> None:
        self._app, self._store, self._settings = app, store, settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        refusal = self._foreign(connection, scope) or await anyio.to_thread.run_sync(self._stranger, connection, scope)
        if refusal is None:
            await self._app(scope, receive, _with_headers(send) if scope["type"] == "http" else send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "not logged in"})
        else:
            await refusal(scope, receive, _with_headers(send))

    def _foreign(self, connection: HTTPConnection, scope: Scope) -> Response | None:
        """Refuse what was addressed to another server or sent by another site's page."""
        host = connection.headers.get("host", "")
        if not self._known_host(host):
            return _answer(421, f"this server is not {host or 'without a name'}; open it under the address that it printed")
        if scope["type"] == "websocket" or scope["method"] not in SAFE:
            origin = connection.headers.get("origin")
            if (origin is None and scope["type"] == "websocket") or (origin is not None and urlsplit(origin).netloc != host):
                return _answer(403, "the request comes from another site's page")
        return None

    def _stranger(self, connection: HTTPConnection, scope: Scope) -> Response | None:
        """Refuse who is not logged in."""
        if scope["type"] == "http" and _is_open(connection.url):
            return None
        with self._store.database() as db:
            if logged_in(db, connection.cookies.get(COOKIE), self._settings.idle_logout):
                return None
        if scope["type"] == "http" and scope["method"] == "GET" and "text/html" in Headers(scope=scope).get("accept", ""):
            return RedirectResponse("/login", 303)
        return _answer(401, "not logged in; open the address that the server printed, or print a new one with: handscope login")

    def _known_host(self, host: str) -> bool:
        name = urlsplit(f"//{host}").hostname or ""
        return name in {"127.0.0.1", "localhost", "::1", self._settings.host, *self._settings.hosts}


PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; "
    "frame-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", PAGE_POLICY)
            headers.setdefault("X-Content-Type-Options", "nosniff")
            headers.setdefault("Referrer-Policy", "no-referrer")
            headers.setdefault("X-Frame-Options", "SAMEORIGIN")
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return sender


def _is_open(url: URL) -> bool:
    return url.path in OPEN_PATHS or url.path in OPEN_FILES or url.path.startswith(OPEN_FOLDERS)


def _answer(status: int, sentence: str) -> Response:
    return JSONResponse({"error": sentence}, status)


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
