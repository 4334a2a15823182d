"""Permissions to read a station's poses: a token each, bound to the station, which ends with it.

A token is shown once and kept as its sha256; it lies in memory alone, so that a restart of the server ends every stream.
"""

import hashlib
import secrets
import threading
from dataclasses import dataclass, field

from handscope.estimators.errors import InputError

MOST_STREAMS = 4  # of a station
MOST_CLIENTS = 4  # of a stream
SLOWEST, FASTEST = 1.0, 120.0  # Hz


@dataclass
class Permit:
    """One stream of a station; `clients` counts those that read it now."""

    name: str  # shown in lists; gives no access
    station: str
    rate: float  # Hz, most messages a second
    by: str  # the account that asked for it
    clients: int = 0
    withdrawn: threading.Event = field(default_factory=threading.Event)


class Permits:
    """All streams of a server by the hash of their token."""

    def __init__(self) -> None:
        self._permits: dict[str, Permit] = {}
        self._lock = threading.Lock()

    def grant(self, station: str, rate: float, by: str) -> tuple[Permit, str]:
        """A new stream and its token; InputError for a rate out of bounds and for one stream too many."""
        if not SLOWEST <= rate <= FASTEST:
            raise InputError(
                "live.stream_rate_outside", rate=rate, slowest=SLOWEST, fastest=FASTEST
            )
        token, permit = (
            secrets.token_urlsafe(32),
            Permit(secrets.token_hex(4), station, rate, by),
        )
        with self._lock:
            if len(self._of(station)) >= MOST_STREAMS:
                raise InputError("live.too_many_streams", streams=MOST_STREAMS)
            self._permits[_digest(token)] = permit
        return permit, token

    def enter(self, token: str) -> Permit | None:
        """The stream of a token, one client more; None where there is none or where it has enough clients."""
        with self._lock:
            permit = self._permits.get(_digest(token))
            if permit is None or permit.clients >= MOST_CLIENTS:
                return None
            permit.clients += 1
            return permit

    def leave(self, permit: Permit) -> None:
        """One client less."""
        with self._lock:
            permit.clients -= 1

    def list_of(self, station: str) -> list[Permit]:
        with self._lock:
            return self._of(station)

    def withdraw(self, station: str, name: str = "") -> None:
        """End one stream of a station, or all of them."""
        with self._lock:
            for digest, permit in list(self._permits.items()):
                if permit.station == station and name in ("", permit.name):
                    del self._permits[digest]
                    permit.withdrawn.set()

    def _of(self, station: str) -> list[Permit]:
        return [p for p in self._permits.values() if p.station == station]


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
