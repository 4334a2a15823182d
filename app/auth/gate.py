"""The gate: who may come in, and where. Nothing is served that the route's declaration (app/auth/roles.py) does not give to the account."""

import asyncio
import contextlib
from urllib.parse import urlsplit

import anyio.to_thread
from starlette.datastructures import URL, Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from handscope.app.auth.audit_hooks import Watch
from handscope.app.auth.roles import ANYBODY, Door, Doors, Who
from handscope.app.settings import Settings
from handscope.app.state import preferred
from handscope.sessions.store.logins import alive, new_token
from handscope.sessions.store.store import Store

__all__ = ["COOKIE", "Gate", "cookie_name", "cookie_of", "new_token"]
COOKIE = "handscope"
OPEN_FOLDERS = ("/static/login/", "/static/fonts/", "/static/words/")
OPEN_FILES = (
    "/static/colors.css",
    "/static/style.css",
    "/static/favicon.svg",
    "/static/preferences.js",
    "/static/theme.js",
    "/static/dom.js",
)
SAFE = ("GET", "HEAD", "OPTIONS")
STRANGER = "not logged in; open the address that the server printed, or print a new one with: handscope login"
OTHER_SITE = "the request comes from another site's page"
NOT_YOURS = "your account may not do this; ask an administrator"
CHECK_EVERY = 15.0  # s between two looks at whether a web socket's login has ended


def cookie_name(scope: Scope) -> str:
    """Behind TLS the browser itself sees to it that the cookie comes from this very host, over TLS (RFC 6265bis, 4.1.3.2)."""
    return f"__Host-{COOKIE}" if secure(scope) else COOKIE


def cookie_of(connection: HTTPConnection) -> str | None:
    return connection.cookies.get(cookie_name(connection.scope))


def secure(scope: Scope) -> bool:
    """Whether the browser speaks TLS, with us or with a trusted proxy in front."""
    return scope["scheme"] in ("https", "wss")


class Gate:
    """Lets requests and web sockets of our own pages through to what their account may use; puts security headers on every answer."""

    def __init__(self, app: ASGIApp, store: Store, settings: Settings) -> None:
        self._app, self._store, self._settings = app, store, settings
        self._watch = Watch(store)
        self._doors: Doors | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        self._doors = self._doors or Doors(scope["app"].routes)
        door = self._doors.of(scope)
        refusal = self._foreign(connection, scope) or await anyio.to_thread.run_sync(
            self._unfit, connection, scope, door
        )
        if refusal is not None:
            await self._watch.refused(connection, refusal.status_code)
        elif scope["type"] == "websocket":
            await self._watch.answered(connection, door, 200)
        if scope["type"] == "http":
            told = _with_headers(self._watch.on(send, connection, door), secure(scope))
            await (refusal or self._app)(scope, receive, told)
        elif refusal is not None:
            await send({"type": "websocket.close", "code": 1008, "reason": "not allowed"})
        else:
            await self._while_logged_in(connection, door, receive, send)

    def _foreign(self, connection: HTTPConnection, scope: Scope) -> Response | None:
        """Refuse what was addressed to another server or sent by another site's page."""
        host = connection.headers.get("host", "")
        if not self._known_host(host):
            return JSONResponse(
                {
                    "error": f"this server is not {host or 'without a name'}; open it under the address that it printed"
                },
                421,
            )
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE
        if _from_elsewhere(
            connection.headers,
            f"{'https' if secure(scope) else 'http'}://{host}",
            scope["type"],
            changes,
        ):
            return _answer(connection, 403, OTHER_SITE)
        return None

    def _unfit(
        self, connection: HTTPConnection, scope: Scope, door: Door | None
    ) -> Response | None:
        """Refuse who is not logged in, and what the account may not use."""
        if _is_open(connection.url) or (
            door is not None and door.may is not None and ANYBODY in door.may.roles
        ):
            return None
        who = self._who(connection)
        if who is None:
            if (
                scope["type"] == "http"
                and scope["method"] == "GET"
                and "text/html" in Headers(scope=scope).get("accept", "")
            ):
                return RedirectResponse("/login", 303)
            return _answer(connection, 401, STRANGER)
        scope.setdefault("state", {})["who"] = who
        if door is not None and (door.may is None or not door.may.admits(who)):
            return _answer(connection, 403, NOT_YOURS)
        return None

    def _who(self, connection: HTTPConnection) -> Who | None:
        with self._store.database() as db:
            login = alive(
                db, cookie_of(connection), self._settings.idle_logout, self._settings.longest_login
            )
            return (
                Who(login.account_id, login.account.name, frozenset(login.account.roles), login.id)
                if login
                else None
            )

    async def _while_logged_in(
        self, connection: HTTPConnection, door: Door | None, receive: Receive, send: Send
    ) -> None:
        """A web socket ends with its login: logged out, expired, out of use or with other roles."""
        app = asyncio.ensure_future(self._app(connection.scope, receive, send))
        end = asyncio.ensure_future(self._end_of_login(connection, door))
        try:
            await asyncio.wait({app, end}, return_when=asyncio.FIRST_COMPLETED)
            over = not app.done()
        finally:
            app.cancel()
            end.cancel()
            await asyncio.wait({app, end})
        if over:
            with contextlib.suppress(RuntimeError):  # it closed itself meanwhile
                await send({"type": "websocket.close", "code": 1008, "reason": "the login ended"})
        else:
            app.result()

    async def _end_of_login(self, connection: HTTPConnection, door: Door | None) -> None:
        await asyncio.sleep(CHECK_EVERY)
        while (
            await anyio.to_thread.run_sync(self._unfit, connection, connection.scope, door) is None
        ):
            await asyncio.sleep(CHECK_EVERY)

    def _known_host(self, host: str) -> bool:
        name = urlsplit(f"//{host}").hostname or ""
        return name in {"127.0.0.1", "localhost", "::1", self._settings.host, *self._settings.hosts}


PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; "
    "frame-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)


def _with_headers(send: Send, over_tls: bool) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", PAGE_POLICY)
            headers.setdefault("X-Content-Type-Options", "nosniff")
            headers.setdefault("Referrer-Policy", "no-referrer")
            headers.setdefault("X-Frame-Options", "SAMEORIGIN")
            headers.setdefault("Cross-Origin-Opener-Policy", "same-origin")
            headers.setdefault("Cross-Origin-Resource-Policy", "same-origin")
            headers.setdefault("Cache-Control", "no-store")
            if over_tls:
                headers.setdefault("Strict-Transport-Security", "max-age=31536000")
        await send(message)

    return sender


def _from_elsewhere(headers: Headers, ours: str, kind: str, changes: bool) -> bool:
    """Whether another site's page sent it: by Origin and by Fetch Metadata (W3C), which browsers send and pages cannot forge.

    A change that says neither comes from a program, not from a page: browsers name the Origin of every one (Fetch, 3.1), and what has the cookie
    otherwise needs no forging. SameSite=Strict stands behind this.

    A page on another port of the same host is another site here, though a SameSite cookie goes there. A link from elsewhere may be followed.
    """
    origin, site = headers.get("origin"), headers.get("sec-fetch-site", "none")
    if origin is None and kind == "websocket":
        return True
    if (
        changes and origin is not None and origin not in (ours, ours.replace("http://", "https://"))
    ):  # TLS may end at a proxy that was not named
        return True
    followed = (
        not changes
        and headers.get("sec-fetch-mode") == "navigate"
        and headers.get("sec-fetch-dest") == "document"
    )
    return site not in ("same-origin", "none") and not followed


def _is_open(url: URL) -> bool:
    return url.path in OPEN_FILES or url.path.startswith(OPEN_FOLDERS)


def _answer(connection: HTTPConnection, status: int, sentence: str) -> Response:
    return JSONResponse({"error": preferred(connection).heard(sentence)}, status)
