"""Figures of a running server for a monitoring system, read when it asks; none is about a patient."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from sqlalchemy import func, select
from sqlalchemy.exc import DBAPIError

from handscope.app.live.station import Station
from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.db.tables import AuditLine, Result
from handscope.sessions.store.store import free_bytes

if TYPE_CHECKING:
    from handscope.app.state import Parts

STATES = ("queued", "running", "failed")


def serve(parts: "Parts", host: str, port: int) -> tuple[Any, Any]:
    """Answer at http://host:port/metrics in the form of Prometheus; gives the server and its thread. InputError where that cannot be."""
    try:
        from prometheus_client import CollectorRegistry, ProcessCollector, start_http_server
        from prometheus_client.registry import Collector
    except ImportError:
        raise InputError("server.metrics_package_missing") from None

    class Figures(Collector):  # type: ignore[misc]  # mypy does not follow the package
        def collect(self) -> Iterator[Any]:
            return families(parts)

    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    registry.register(Figures())
    try:
        server, thread = start_http_server(port, host, registry)
    except OSError as problem:
        raise InputError(
            "server.metrics_cannot_listen",
            host=host,
            port=port,
            strerror=describe(problem),
        ) from None
    return server, thread


def families(parts: "Parts") -> Iterator[Any]:
    """The figures, with what each means."""
    from prometheus_client.core import GaugeMetricFamily

    live = [s for s in parts.stations.all() if isinstance(s, Station)]
    rows = [s for s in live if s.latest is not None and s.glove.now() is not None]
    ages = [
        max(0.0, float(s.glove.now() or 0.0) - float(s.latest.t[-1]))
        for s in rows
        if s.latest is not None
    ]
    lost = sum(count.lost for s in live for count in list(s.glove.assembler.counts.values()))
    yield GaugeMetricFamily(
        "handscope_sessions_running", "sessions that are being recorded", len(live)
    )
    yield GaugeMetricFamily("handscope_recordings_failing", "of them, those whose recording takes nothing any more: act at once", sum(s.glove.state.state == "recording_failed" for s in live))  # fmt: skip
    yield GaugeMetricFamily("handscope_gloves_away", "of them, those whose glove is not plugged in", sum(s.glove.state.state in ("port_lost", "port_closed") for s in live))  # fmt: skip
    yield GaugeMetricFamily(
        "handscope_samples_lost", "samples that gloves lost in the sessions that run", lost
    )
    yield GaugeMetricFamily("handscope_live_blocks_skipped", "blocks that live views left out in the sessions that run; the recordings have them", sum(s.tracking.skipped + s.glove.state.dropped for s in live))  # fmt: skip
    yield GaugeMetricFamily("handscope_estimator_failures", "times that a live method failed and was started again, in the sessions that run", sum(s.tracking.failures for s in live))  # fmt: skip
    yield GaugeMetricFamily(
        "handscope_pose_age_seconds",
        "age of the oldest of the newest poses, sampled to now",
        max(ages, default=0.0),
    )
    yield GaugeMetricFamily(
        "handscope_disk_free_bytes",
        "room on the disk of the data folder",
        free_bytes(parts.store.folder),
    )
    if parts.storage_mover:
        latest = parts.storage_mover.latest
        yield GaugeMetricFamily(
            "handscope_object_storage_up",
            "whether the object storage could be used in the last round",
            0 if latest.problem else 1,
        )
        yield GaugeMetricFamily(
            "handscope_files_waiting",
            "files that are still to go there, or to be removed there",
            latest.waiting,
        )
    try:
        with parts.store.database() as db:
            counts = {
                row.state: row.n
                for row in db.execute(
                    select(Result.state, func.count().label("n")).group_by(Result.state)
                )
            }
            lines = db.scalar(select(func.max(AuditLine.id))) or 0
        reachable = 1
        yield GaugeMetricFamily(
            "handscope_audit_lines", "lines of the audit trail: they never become fewer", lines
        )
    except DBAPIError:
        counts, reachable = {}, 0
    results = GaugeMetricFamily("handscope_results", "results by state", labels=["state"])
    for state in STATES:
        results.add_metric([state], counts.get(state, 0))
    yield results
    yield GaugeMetricFamily("handscope_database_up", "1 where the database answers", reachable)
