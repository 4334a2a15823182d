"""The gate: it serves a request only where the route's declaration (app/auth/roles.py) admits the account."""

import asyncio
import contextlib
import posixpath
import time
from urllib.parse import urlsplit

import anyio.to_thread
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from handscope.app.auth.audit_hooks import AuditHooks
from handscope.app.auth.roles import ANYBODY, Requester, RouteAccess, RouteTable
from handscope.app.auth.security_headers import is_over_tls
from handscope.app.auth.ward_access import OTHER_WARD, is_visible, subjects
from handscope.app.database_answers import answer_to_database
from handscope.app.error_body import error_body
from handscope.app.settings import Settings
from handscope.app.state import preferred
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.second_factors import lacks_required
from handscope.sessions.login.logins import find_login, new_token
from handscope.sessions.store.store import Store
from handscope.sessions.wards import wards

__all__ = ["COOKIE", "Gate", "asks_for_page", "cookie_name", "cookie_of", "new_token"]
COOKIE = "handscope"
FILES = "/static/"
READS_FOR = 5.0  # s
OPEN_FOLDERS = (
    "/static/login/",
    "/static/patient_view/",
    "/static/vendor/inter/",
    "/static/vendor/lucide/",
    "/static/words/",
)
OPEN_FILES = (
    "/static/colors.css",
    "/static/style.css",
    "/static/favicon.svg",
    "/static/preferences.js",
    "/static/theme.js",
    "/static/dom.js",
    "/static/presses.js",
    "/static/same.js",
    "/static/forms.js",
    "/static/progress_bar.js",
    "/static/station/metronome_time.js",  # of the patient's screen, as those below
    "/static/station/clicks.js",
    "/static/station/cue_tones.js",
)
SAFE = ("GET", "HEAD", "OPTIONS")
STRANGER = phrase("gate.not_logged_in")
OTHER_SITE = phrase("gate.other_site")
NOT_YOURS = phrase("gate.not_allowed")
SECOND_FACTOR = phrase("gate.second_factor_needed")
FOR_ENROLLING = ("/account", "/api/me", "/api/login", "/api/health", "/login")
CHECK_EVERY = 15.0  # s between two checks of a web socket's login


def cookie_name(scope: Scope, name: str = COOKIE) -> str:
    """Behind TLS the browser guarantees that the cookie was set by this host over TLS (RFC 6265bis, 4.1.3.2)."""
    return f"__Host-{name}" if is_over_tls(scope) else name


def cookie_of(connection: HTTPConnection) -> str | None:
    """The value of the login's cookie, where the request has one."""
    return connection.cookies.get(cookie_name(connection.scope))


class Gate:
    """Passes requests and web sockets of our own pages to what their account may use."""

    def __init__(self, app: ASGIApp, store: Store, settings: Settings) -> None:
        self._app, self._store, self._settings = app, store, settings
        self._audit = AuditHooks(store)
        self._routes: RouteTable | None = None
        self._readers: dict[str | None, float] = {}  # s until which a cookie may read files

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        self._routes = self._routes or RouteTable(scope["app"].routes)
        access = self._routes.of(scope)
        refusal = self._refuse_foreign(connection, scope)
        if refusal is None and not self._is_known_reader(connection, access):
            refusal = await anyio.to_thread.run_sync(self._refuse_safely, connection, scope, access)
            if refusal is None and _is_file(scope["path"]):
                self._know_reader(connection)
        if refusal is not None and refusal.status_code < 500:
            await self._audit.record_refusal(connection, refusal.status_code)
        elif refusal is None and scope["type"] == "websocket":
            await self._audit.record_view(connection, access, 200)
        if scope["type"] == "http":
            recorded = self._audit.record_on(send, connection, access)
            await (refusal or self._app)(scope, receive, recorded)
        elif refusal is not None:
            await send({"type": "websocket.close", "code": 1008, "reason": "not allowed"})
        else:
            await self._serve_while_logged_in(connection, access, receive, send)

    def _is_known_reader(self, connection: HTTPConnection, access: RouteAccess | None) -> bool:
        """Whether no login has to be looked up: for anybody's pages, and for files whose reader was logged in a moment ago.

        A page asks for eighty files, which hold nothing of a patient; each look takes a thread and the database.
        """
        path = connection.scope["path"]
        return _is_for_anybody(path, access) or (
            _is_file(path) and self._readers.get(cookie_of(connection), 0.0) > time.monotonic()
        )

    def _know_reader(self, connection: HTTPConnection) -> None:
        """Whoever may read one file may read the others for a moment."""
        moment = time.monotonic()
        self._readers = {c: end for c, end in self._readers.items() if end > moment}
        self._readers[cookie_of(connection)] = moment + READS_FOR

    def _refuse_foreign(self, connection: HTTPConnection, scope: Scope) -> Response | None:
        """Refuse a request to another host, or from another site's page."""
        host = connection.headers.get("host", "")
        if not self._is_own_host(host):
            named = host or phrase("gate.without_name")
            return _answer(connection, 421, phrase("gate.other_host", host=named))
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE
        if _from_elsewhere(
            connection.headers,
            f"{'https' if is_over_tls(scope) else 'http'}://{host}",
            scope["type"],
            changes,
        ):
            return _answer(connection, 403, OTHER_SITE)
        return None

    def _refuse_requester(
        self, connection: HTTPConnection, scope: Scope, access: RouteAccess | None
    ) -> Response | None:
        """Refuse a request without a login, or to a route that does not admit the account."""
        if _is_for_anybody(scope["path"], access):
            return None
        requester = self._requester_of(connection)
        if requester is None:
            if asks_for_page(connection):
                return RedirectResponse("/login", 303)
            return _answer(connection, 401, STRANGER)
        scope.setdefault("state", {})["requester"] = requester
        if access is not None and (
            access.requirement is None or not access.requirement.admits(requester)
        ):
            return _answer(connection, 403, NOT_YOURS)
        if requester.lacks_second_factor and not _is_for_enrolling(scope["path"]):
            if asks_for_page(connection):
                return RedirectResponse("/account", 303)
            return _answer(connection, 403, SECOND_FACTOR)
        if not requester.is_of_house and access is not None:
            return self._refuse_other_ward(connection, requester, access)
        return None

    def _refuse_other_ward(
        self, connection: HTTPConnection, requester: Requester, access: RouteAccess
    ) -> Response | None:
        """Refuse what an address names of a patient whom the account does not see."""
        for subject in subjects(connection, access):
            if subject is None:  # a kind of number that ward_access.py does not know
                return _answer(connection, 403, NOT_YOURS)
            with self._store.database() as db:
                if not is_visible(db, requester, *subject):
                    return _answer(connection, 403, OTHER_WARD)
        return None

    def _refuse_safely(
        self, connection: HTTPConnection, scope: Scope, access: RouteAccess | None
    ) -> Response | None:
        """The same; a database that cannot be asked refuses with words."""
        try:
            return self._refuse_requester(connection, scope, access)
        except (DBAPIError, PoolTimeout) as problem:
            answer = answer_to_database(connection, problem)
            if answer is None:
                raise
            return answer

    def _requester_of(self, connection: HTTPConnection) -> Requester | None:
        with self._store.database() as db:
            login = find_login(
                db, cookie_of(connection), self._settings.idle_logout, self._settings.longest_login
            )
            if login is None:
                return None
            account, required = login.account, self._settings.second_factor
            return Requester(
                account.id,
                account.name,
                frozenset(account.roles),
                login.id,
                bool(required) and lacks_required(db, account, required),
                wards.visibility_of(db, account),
                wards.headed_by(account),
            )

    async def _serve_while_logged_in(
        self, connection: HTTPConnection, access: RouteAccess | None, receive: Receive, send: Send
    ) -> None:
        """Serve a web socket until its login ends: log-out, expiry, account disabled, or other roles."""
        app = asyncio.ensure_future(self._app(connection.scope, receive, send))
        end = asyncio.ensure_future(self._wait_for_end_of_login(connection, access))
        try:
            await asyncio.wait({app, end}, return_when=asyncio.FIRST_COMPLETED)
            over = not app.done()
        finally:
            app.cancel()
            end.cancel()
            await asyncio.wait({app, end})
        if over:
            with contextlib.suppress(RuntimeError):  # it has closed itself
                await send(
                    {"type": "websocket.close", "code": 1008, "reason": phrase("gate.login_ended")}
                )
        else:
            app.result()

    async def _wait_for_end_of_login(
        self, connection: HTTPConnection, access: RouteAccess | None
    ) -> None:
        await asyncio.sleep(CHECK_EVERY)
        while await anyio.to_thread.run_sync(self._may_stay, connection, access):
            await asyncio.sleep(CHECK_EVERY)

    def _may_stay(self, connection: HTTPConnection, access: RouteAccess | None) -> bool:
        """A database that cannot be asked for a while ends no live view."""
        refusal = self._refuse_safely(connection, connection.scope, access)
        return refusal is None or refusal.status_code >= 500

    def _is_own_host(self, host: str) -> bool:
        try:
            parts = urlsplit(f"//{host}")
            name, _ = parts.hostname or "", parts.port
        except ValueError:  # such as [::1 or localhost:99999
            return False
        return name in {"127.0.0.1", "localhost", "::1", self._settings.host, *self._settings.hosts}


def _from_elsewhere(headers: Headers, ours: str, kind: str, changes: bool) -> bool:
    """Whether another site's page sent it, by Origin and Fetch Metadata (W3C), which pages cannot forge.

    A change without either comes from a program: browsers send the Origin with every change (Fetch, 3.1).
    SameSite=Strict is the second defence. Another port of this host counts as another site, although a SameSite
    cookie is sent there. A link from elsewhere may be followed.
    """
    origin, site = headers.get("origin"), headers.get("sec-fetch-site", "none")
    if origin is None and kind == "websocket":
        return True
    if (
        changes and origin is not None and origin not in (ours, ours.replace("http://", "https://"))
    ):  # TLS may end at a proxy that is not configured
        return True
    followed = (
        not changes
        and headers.get("sec-fetch-mode") == "navigate"
        and headers.get("sec-fetch-dest") == "document"
    )
    return site not in ("same-origin", "none") and not followed


def _is_for_anybody(path: str, access: RouteAccess | None) -> bool:
    """Whether no login is needed."""
    requirement = None if access is None else access.requirement
    return _is_open(path) or (requirement is not None and ANYBODY in requirement.roles)


def _is_file(path: str) -> bool:
    """Whether a path, decoded, is one of the pages' files; none that leads out of their folder."""
    return path.startswith(FILES) and _is_plain(path)


def _is_plain(path: str) -> bool:
    """Whether a path leads nowhere but where it says."""
    return posixpath.normpath(path) == path and "\\" not in path


def _is_open(path: str) -> bool:
    """Whether a path, decoded, is one of the login page's; none that leads out of its folder."""
    return _is_plain(path) and (path in OPEN_FILES or path.startswith(OPEN_FOLDERS))


def asks_for_page(connection: HTTPConnection) -> bool:
    """Whether a person's browser asks for a page."""
    scope = connection.scope
    page = "text/html" in connection.headers.get("accept", "")
    return page and scope["type"] == "http" and scope["method"] == "GET"


def _is_for_enrolling(path: str) -> bool:
    """Whether an account may ask for it that has not made the second factor that its role requires."""
    return path in FOR_ENROLLING or path.startswith(("/static/", "/languages/", "/api/me/"))


def _answer(connection: HTTPConnection, status: int, sentence: str) -> Response:
    return JSONResponse(error_body(sentence, preferred(connection)), status)
