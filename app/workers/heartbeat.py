"""Says every few seconds that this one of several servers is there, whatever else it is at."""

import logging
import threading

from sqlalchemy.exc import DBAPIError

from handscope.sessions.store import shared_servers
from handscope.sessions.store.store import Store

log = logging.getLogger(__name__)
PAUSE = 10.0  # s


class Heartbeat:
    """A context manager; of a server by itself it does nothing."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    def __enter__(self) -> "Heartbeat":
        if self._store.server:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        if self._store.server:
            self._thread.join()

    def _run(self) -> None:
        while True:
            try:
                with self._store.database() as db:
                    shared_servers.record_heartbeat(db, self._store.server)
            except DBAPIError as problem:
                log.warning("no heartbeat: %s", type(problem).__name__)
            if self._leaving.wait(PAUSE):
                return
