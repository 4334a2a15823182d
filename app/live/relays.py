"""All relays of a server: which session has its glove at a browser's port, who may send for it, and what of it is still to come.

A token lets one connection in, once, for a minute, from the login that asked for it. A session whose browser still keeps messages when it
ends, or when the server does, stays open until these have come or REST_WAIT has passed without a connection.
"""

import hashlib
import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from handscope.app.devices.ports import RELAY, is_relay
from handscope.app.devices.relay.live_relay import RelayEnd
from handscope.app.devices.relay.rest_of_relay import RestOfRelay
from handscope.app.live.stations import Stations
from handscope.estimators.errors import InputError
from handscope.sessions.files.continued_recording import first_metadata

log = logging.getLogger(__name__)
TOKEN_LIFE = 60.0  # s
MOST_TOKENS = 256  # not used yet; then the oldest go
REST_WAIT = 600.0  # s


def relay_port(session: int) -> str:
    """The port of a session whose glove is at a browser."""
    return f"{RELAY}{session}"


def relay_account(recording: Path) -> int | None:
    """The account whose browser sends what a recording holds; None of any other recording."""
    about = first_metadata(recording)
    if not is_relay(str(about.get("port", ""))):
        return None
    account = about.get("relay_account")
    return account if isinstance(account, int) else None


@dataclass(frozen=True)
class GrantedRelay:
    """What a token lets in to."""

    session: int
    end: RelayEnd


@dataclass
class _Awaited:
    """A session whose browser still keeps something."""

    account: int
    recording: Path
    timer: threading.Timer
    end: RestOfRelay | None = None


class Relays:
    """A context manager; `finish` is called with each session that is over."""

    def __init__(self, stations: Stations, finish: Callable[[int], object]) -> None:
        self._stations, self._finish = stations, finish
        self._tokens: dict[str, tuple[int, int, float]] = {}  # session, login, until; by hash
        self._awaited: dict[int, _Awaited] = {}
        self._lock = threading.RLock()

    def __enter__(self) -> "Relays":
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            for awaited in self._awaited.values():
                awaited.timer.cancel()
                if awaited.end is not None:
                    awaited.end.close()

    def grant(self, session: int, account: int, login: int) -> str:
        """A token for one connection; InputError where this account has no relay of this session."""
        if self._account_of(session) != account:
            raise InputError("live.no_relay", session=session)
        token = secrets.token_urlsafe(32)
        with self._lock:
            while len(self._tokens) >= MOST_TOKENS:
                self._tokens.pop(next(iter(self._tokens)))
            self._tokens[_digest(token)] = session, login, time.monotonic() + TOKEN_LIFE
        return token

    def redeem(self, token: str, login: int) -> GrantedRelay | None:
        """Where the messages of a token's holder go; the token is used up, whoever brings it. It may read a file."""
        with self._lock:
            session, owner, until = self._tokens.pop(_digest(token), (0, 0, 0.0))
        if owner != login or time.monotonic() > until:
            return None
        station = self._stations.of_session(session)
        end: RelayEnd | None
        if station is not None:
            end = station.glove.relay
        else:
            with self._lock:
                end = self._rest_of(session)
        return None if end is None else GrantedRelay(session, end)

    def await_rest(self, session: int, account: int, recording: Path) -> None:
        """A session is over whose browser still keeps messages."""
        with self._lock:
            self._awaited[session] = _Awaited(account, recording, self._timer(session))

    def is_awaited(self, session: int) -> bool:
        """Whether messages of this session are still to come."""
        return session in self._awaited

    def give_up(self, session: int) -> None:
        """Wait no longer: the session is finished with what has come."""
        with self._lock:
            awaited = self._awaited.pop(session, None)
        if awaited is None:
            return
        awaited.timer.cancel()
        if awaited.end is not None:
            awaited.end.close()
        self._finish(session)

    def _account_of(self, session: int) -> int | None:
        station = self._stations.of_session(session)
        if station is not None and station.glove.relay is not None:
            account: int = station.setup.about["relay_account"]
            return account
        awaited = self._awaited.get(session)
        return awaited.account if awaited else None

    def _rest_of(self, session: int) -> RestOfRelay | None:
        awaited = self._awaited.get(session)
        if awaited is None:
            return None
        awaited.timer.cancel()
        awaited.timer = self._timer(session)
        if awaited.end is None:
            awaited.end = RestOfRelay(awaited.recording, lambda: self.give_up(session))
        return awaited.end

    def _timer(self, session: int) -> threading.Timer:
        timer = threading.Timer(REST_WAIT, self.give_up, (session,))
        timer.daemon = True
        timer.start()
        return timer


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
