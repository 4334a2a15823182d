"""The server: pages, API and 3-D scenes on one port under one login."""

import logging
import tempfile
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, nullcontext
from functools import partial
from multiprocessing.util import get_temp_dir
from pathlib import Path
from typing import Any

import anyio.to_thread
from fastapi import FastAPI
from starlette.middleware import Middleware
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from handscope.app import language, metrics, protocols
from handscope.app.api import (
    accounts,
    errors,
    languages,
    methods,
    pages,
    patients,
    progress,
    references,
    results,
    self_calibrations,
    sessions,
    stations,
)
from handscope.app.api.assessment_plans import routes as plan_routes
from handscope.app.api.hand_photographs import routes as photograph_routes
from handscope.app.api.live import device_routes, relays, session_start, streams
from handscope.app.api.login import login_routes, oidc_routes, second_factors
from handscope.app.api.patient_view import invitation_routes, screen_routes
from handscope.app.api.treatment import routes as treatment_routes
from handscope.app.api.uploads import landmark_comparisons, tables
from handscope.app.api.wards import emergency_routes, ward_routes
from handscope.app.auth.gate import Gate
from handscope.app.auth.incoming_text import PlainAddresses
from handscope.app.auth.request_limits import RequestLimits
from handscope.app.auth.security_headers import SecurityHeaders
from handscope.app.documents import Documents
from handscope.app.job_queue import Jobs
from handscope.app.live.relays import Relays, relay_account
from handscope.app.live.station import Station
from handscope.app.live.stations import Stations
from handscope.app.page_files.files import STATIC, Files
from handscope.app.page_files.versions import VersionedAddresses
from handscope.app.settings import Settings
from handscope.app.state import Parts
from handscope.app.version import software_version
from handscope.app.workers.heartbeat import Heartbeat
from handscope.app.workers.session_repair import SessionRepair
from handscope.app.workers.storage_mover import StorageMover
from handscope.app.workers.upload_reader import UploadReader
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import self_calibrations as stored_calibrations
from handscope.sessions.store import crash_repair, records
from handscope.sessions.store.store import Store, open_store

log = logging.getLogger(__name__)


def create_app(settings: Settings) -> FastAPI:
    """Build everything from the settings; parts that run are opened and closed with the application."""
    for fault in protocols.offered(settings.data)[
        1
    ]:  # logged now, and shown where tasks are chosen
        log.warning("%s. This task is not offered, the others are.", fault)
    for fault in language.faults():
        log.warning("%s. This language is not offered, the others are.", fault)
    store = open_store(
        settings.data, settings.database_url, settings.recordings, settings.shared_at
    )

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        storage_mover = StorageMover(store, settings.cache_bytes) if store.away else None
        with (
            _spool_in(store.incoming),
            storage_mover or nullcontext(),
            Heartbeat(store),
            UploadReader() as upload_reader,
            Jobs(store) as jobs,
            Documents(store, settings.scheduler) as documents,
            Stations(lambda station: _store_finished(app.state.parts, station)) as open_stations,
            Relays(open_stations, lambda session: app.state.repair.add(session)) as open_relays,
        ):
            app.state.parts = Parts(
                settings,
                store,
                jobs,
                documents,
                open_stations,
                upload_reader,
                storage_mover,
                open_relays,
            )
            left = await anyio.to_thread.run_sync(_list_left_open, store, open_relays)
            finish = partial(_process_closed, app)
            with (
                SessionRepair(store, *left, finish) as app.state.repair,
                _serve_metrics(app.state.parts),
            ):
                yield
            await anyio.to_thread.run_sync(open_stations.__exit__, None, None, None)
        store.close()

    proxies = (
        [Middleware(ProxyHeadersMiddleware, trusted_hosts=list(settings.proxies))]
        if settings.proxies
        else []
    )
    app = FastAPI(
        title="Handscope",
        version=software_version(),
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        middleware=[
            *proxies,
            Middleware(SecurityHeaders),
            Middleware(PlainAddresses),
            Middleware(VersionedAddresses),
            Middleware(RequestLimits, largest_upload=settings.largest_upload),
            Middleware(Gate, store=store, settings=settings),
        ],
    )
    errors.install(app)
    # first: a page asks for eighty of them, and routes are tried in this order
    app.mount("/static", Files(directory=STATIC), name="static")
    for module in (
        accounts,
        patients,
        progress,
        sessions,
        session_start,
        tables,
        results,
        landmark_comparisons,
        references,
        self_calibrations,
        photograph_routes,
        treatment_routes,
        plan_routes,
        stations,
        device_routes,
        streams,
        invitation_routes,
        relays,
        methods,
        login_routes,
        ward_routes,
        emergency_routes,
    ):
        app.include_router(module.router, prefix="/api")
    app.include_router(accounts.own, prefix="/api")
    app.include_router(second_factors.router, prefix="/api")
    app.include_router(login_routes.pages)
    app.include_router(oidc_routes.router)
    app.include_router(languages.router)
    app.include_router(screen_routes.router)
    app.include_router(pages.router)
    return app


@contextmanager
def _spool_in(folder: Path) -> Iterator[None]:
    """Uploads wait in the data folder while they are read, not in the system's folder of temporary files."""
    get_temp_dir()  # where the working processes' sockets are, which need a short path
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = before


@contextmanager
def _serve_metrics(parts: Parts) -> Iterator[None]:
    """Serve figures to a monitoring system where configured."""
    if parts.settings.metrics is None:
        yield
        return
    server, thread = metrics.serve(parts, *parts.settings.metrics)
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _store_finished(parts: Parts, station: Station) -> None:
    """Close the recording of a live session that ended, and process it."""
    parts.permits.withdraw(station.name)
    parts.screens.withdraw(station.name)
    setup, relay = station.setup, station.glove.relay
    if relay is not None and relay.next_number and not relay.is_complete:
        parts.relays.await_rest(setup.session, setup.about["relay_account"], setup.recording)
        return
    _close(parts, station.setup.session, station.setup.method_name, {})


def _list_left_open(store: Store, relays: Relays) -> tuple[list[int], list[int]]:
    """Sessions that the last server left open, and those whose recordings it did not read whole; a session of which a browser
    still keeps something is awaited instead."""
    with store.database() as db:
        unread = [s.id for s in crash_repair.list_unread(db, store.server)]
        left = records.list_abandoned(db, store.server)
        files = {s.id: [f.file for f in s.recordings] for s in left}
    for session in list(files):
        recording = store.path_of(files[session][0]) if files[session] else None
        account = None if recording is None else relay_account(recording)
        if recording is not None and account is not None:
            relays.await_rest(session, account, recording)
            del files[session]
    return list(files), unread


def _process_closed(app: FastAPI, session_id: int) -> None:
    """Process a session that was repaired."""
    parts: Parts = app.state.parts
    with parts.store.database() as db:
        session = records.get(db, session_id)
        stored_calibrations.settle(db, session)
        sessions.queue_session(db, parts, session, None, {})


def _close(parts: Parts, session_id: int, method: str, options: dict[str, Any]) -> None:
    with parts.store.database() as db:
        try:
            session = records.close(db, parts.store, session_id)
            if session.state == "recorded":
                stored_calibrations.settle(db, session)
                sessions.queue_session(db, parts, session, method, options)
        except InputError as problem:
            log.warning("session %s: %s", session_id, problem)
