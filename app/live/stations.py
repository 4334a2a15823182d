"""All stations of a server, by name: one for each glove or replay; closed with the server."""

import logging
import secrets
import threading
import time
from collections.abc import Callable, Mapping, Set
from pathlib import Path
from typing import Any

from handscope.app.devices.sources.addresses import is_source
from handscope.app.live.replay import Replay, SecondMovement
from handscope.app.live.setup import Setup
from handscope.app.live.station import Station
from handscope.app.options import with_options
from handscope.app.protocols import load_free, load_steps, offered
from handscope.app.protocols.plans import Plan, applied, named
from handscope.app.results.curves import matching_tasks
from handscope.app.results.make import load_replay
from handscope.app.workers.turns import Turns
from handscope.estimators.alignment.functional_movements import FunctionalParams
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry, measures_from, sized
from handscope.estimators.methods import METHODS
from handscope.estimators.numerics.jit import load_kernels
from handscope.sessions.clinic.self_calibrations import USED_BY
from handscope.sessions.db.tables import PatientSession, Result
from handscope.sessions.store import records
from handscope.sessions.store.store import Store
from handscope.sessions.tables_io import force_calibrations, tracker_places

log = logging.getLogger(__name__)
CLOSE_WAIT = 30.0  # s to wait for a session that another thread is closing
MOST_REPLAYS = 6  # beyond that, the least recently used is closed
AnyStation = Station | Replay
MakeSetup = Callable[[PatientSession, Path, str, str], Setup]


class Stations:
    """A context manager; calls `on_finish` with every live station whose recording is closed."""

    def __init__(self, on_finish: Callable[[Station], None]) -> None:
        self._stations: dict[str, AnyStation] = {}
        self._lock = threading.RLock()
        self._idle = threading.Condition(self._lock)
        self._closing: list[AnyStation] = []
        self._on_finish = on_finish
        self._turns = Turns()

    def __enter__(self) -> "Stations":
        assert all(method.TITLE for method in METHODS.values())  # imported
        load_kernels()  # now: once a glove sends, whoever computes for long costs samples
        return self

    def __exit__(self, *_: object) -> None:
        for station in self.all():
            self.close(station.name)
        with self._idle:  # the store stays open until a finished session is stored
            self._idle.wait_for(lambda: not self._closing, CLOSE_WAIT)

    def open_live(self, setup: Setup, name: str) -> Station:
        """A station for a glove; InputError where another one uses it."""
        with self._lock:
            self.require_free(setup.port)
            station = Station(name, setup, lambda s: self.close(s.name), self._turns)
            station.__enter__()
            self._stations[station.name] = station
            return station

    def open_replay(self, store: Store, result: Result, other: Result | None = None) -> Replay:
        """A station that replays a result, with another beside it; reuses one that nobody watches."""
        session = result.recording.session
        beside = None if other is None else _second_movement(store, result, other)
        wanted = (result.id, other and other.id)
        with self._lock:
            for station in self._stations.values():
                if (
                    isinstance(station, Replay)
                    and not station.is_taken
                    and (station.result, station.beside and station.beside.result) == wanted
                ):
                    station.used = time.monotonic()
                    return station
            self._close_oldest_replays()
            geometry = _geometry(result)
            replay = Replay(
                secrets.token_hex(4),
                geometry.hand,
                geometry,
                session.id,
                result.id,
                load_replay(store, result),
                beside,
            )
            replay.__enter__()
            self._stations[replay.name] = replay
            return replay

    def get(self, name: str) -> AnyStation:
        """The station; InputError where there is none."""
        with self._lock:
            station = self._stations.get(name)
        if station is None:
            raise InputError("live.station_closed", name=name)
        return station

    def all(self) -> list[AnyStation]:
        with self._lock:
            return list(self._stations.values())

    def of_session(self, session: int) -> Station | None:
        """The live station of a session."""
        return next(
            (s for s in self.all() if isinstance(s, Station) and s.setup.session == session), None
        )

    def saves(self, session: int) -> bool:
        """Whether a session's live station is being closed: its recording is read whole and stored."""
        with self._lock:
            live = [s for s in self._closing if isinstance(s, Station)]
        return any(s.setup.session == session for s in live)

    def uses(self, port: str) -> bool:
        """Whether a live station has this port."""
        return any(isinstance(s, Station) and _same(s.setup.port, port) for s in self.all())

    def require_free(self, port: str) -> None:
        """InputError where a live station has this port."""
        if self.uses(port):
            raise InputError("live.glove_in_use", port=port)

    def close(self, name: str) -> None:
        """End a station; a live one's recording is finished first, then `on_finish` is called."""
        with self._lock:
            station = self._stations.pop(name, None)
            if station is None:
                return
            self._closing.append(station)
        try:
            station.__exit__(None, None, None)
            if isinstance(station, Station):
                self._on_finish(station)
        finally:
            with self._idle:
                self._closing.remove(station)
                self._idle.notify_all()

    def close_replays(self, sessions: Set[int]) -> None:
        """End every replay of these sessions: they were erased."""
        for station in self.all():
            if isinstance(station, Replay) and (
                station.session in sessions
                or (station.beside and station.beside.session in sessions)
            ):
                self.close(station.name)

    def _close_oldest_replays(self) -> None:
        replays = sorted(
            (s for s in self._stations.values() if isinstance(s, Replay)),
            key=lambda s: (s.is_taken, s.used),
        )
        for replay in replays[: max(0, len(replays) - MOST_REPLAYS + 1)]:
            self._stations.pop(replay.name)
            replay.__exit__(None, None, None)


def live_setup(
    method: str, options: Mapping[str, Any], data: Path, plan: Plan | None = None
) -> MakeSetup:
    """Check method and options; returns a function that makes the setup once session and file exist.

    InputError for an unknown method or option.
    """
    if method not in METHODS:
        raise InputError("analysis.unknown_method", name=method, methods=", ".join(METHODS))
    module = METHODS[method]
    params = with_options(module.Params, options)
    protocols, faults, force_files = *offered(data), force_calibrations.read_stored(data)
    if plan:
        protocols = applied(plan, protocols)
    functional = isinstance(params, FunctionalParams) and params.uses_movements
    steps = tuple(load_steps().values()) if functional else ()
    free = load_free() if method in USED_BY else None

    def make(session: PatientSession, recording: Path, port: str, pseudonym: str) -> Setup:
        hand = records.hand_of(session.hand)
        return Setup(
            session=session.id,
            hand=hand,
            geometry=sized(hand, measures_from(session.geometry)),
            trunk_height=session.trunk_height,
            port=port,
            recording=recording,
            method_name=method,
            method=module,
            params=params,
            protocols=tuple(protocols.values()),
            plan_title=plan.title if plan else "",
            faults=tuple(faults),
            steps=steps,
            free=free,
            about={
                "session": session.id,
                "pseudonym": pseudonym,
                **({"plan": named(plan)} if plan else {}),
                **force_files,
                **_tracker_places(data, hand, port),
            },
        )

    return make


def _tracker_places(data: Path, hand: Hand, port: str) -> dict[str, Any]:
    """Where the trackers of a source sat on this hand the last time."""
    places = tracker_places.read_places(data, hand) if is_source(port) else {}
    return {tracker_places.PLACES: places} if places else {}


def _geometry(result: Result) -> HandGeometry:
    session = result.recording.session
    return sized(
        records.hand_of(session.hand),
        measures_from(session.geometry or result.recording.summary.get("geometry") or {}),
    )


def _second_movement(store: Store, result: Result, other: Result) -> SecondMovement:
    return SecondMovement(
        _geometry(other),
        other.recording.session_id,
        other.id,
        load_replay(store, other),
        matching_tasks(result, other),
    )


def _same(a: str, b: str) -> bool:
    return a == b or (
        Path(a).exists() and Path(b).exists() and Path(a).resolve() == Path(b).resolve()
    )
