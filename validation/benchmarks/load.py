"""Load: viewers of one station, then stations with a viewer each, more and more until the 99th percentile of latency is beyond LATEST; 17 sensors at 100 Hz each.

Gloves, server and viewers share the machine, viewers take figures and 3-D scene. Beside each latency stands how much of the machine was used, and what
the server's own process took: one Python process computes on about one core, however many there are; what records is in processes of its own.
"""

import asyncio
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.live import TICKS, watch
from handscope.validation.benchmarks.server_under_test import Client, begin_tasks, glove, server

VIEWERS = (1, 4, 16)  # of one station
STATIONS = (2, 4, 6, 8)  # with one viewer each
SECONDS = 6.0
LATEST = 80.0  # ms


@dataclass(frozen=True)
class Seen:
    """One stretch under one load."""

    p99: float  # ms
    machine: float  # share of all cores in use, by whomever
    process: float  # cores that the server's own process took
    loop: float  # of them, the thread that speaks to browsers


def measure() -> list[Metric]:
    """Latency and use of the machine under each load, and the greatest load within LATEST."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as gloves:
        folder = Path(name)
        with server(folder / "data") as (address, pid):
            client = Client(address)
            stations = _begin_stations(client, gloves, folder, 0, 1)
            by_viewers = dict(_until_late(client, pid, ((n, stations) for n in VIEWERS)))
            by_stations = {1: by_viewers[1]} | {
                len(stations): seen
                for _, seen in _until_late(
                    client,
                    pid,
                    ((1, _with_more(client, gloves, folder, stations, n)) for n in STATIONS),
                )
            }
            skipped = sum(
                client.call("GET", f"/api/stations/{station}")["glove"]["dropped_live"]
                for station in stations
            )
    return [
        *(
            m
            for n, seen in by_viewers.items()
            for m in _metrics(f"1 station, {n} viewer{'s' * (n > 1)}", seen)
        ),
        *(
            m
            for n, seen in by_stations.items()
            if n > 1
            for m in _metrics(f"{n} stations, 1 viewer each", seen)
        ),
        Metric(f"viewers within {LATEST:g} ms", _most(by_viewers), "viewers", None, "higher"),
        Metric(
            f"stations within {LATEST:g} ms",
            _most(by_stations),
            "stations",
            float(STATIONS[-1]),
            "higher",
        ),
        Metric("blocks that live views left out", float(skipped), "blocks", None, "lower"),
    ]


def _until_late(
    client: Client, pid: int, loads: Iterator[tuple[int, list[str]]]
) -> Iterator[tuple[int, Seen]]:
    """Under one load after the other (viewers, stations); the first that is too late is the last."""
    for viewers, stations in loads:
        seen = _under(client, pid, stations, viewers)
        yield viewers, seen
        if seen.p99 > LATEST:
            return


def _under(client: Client, pid: int, stations: list[str], viewers: int) -> Seen:
    before, began = (_machine(), _thread_seconds(pid)), time.monotonic()
    ages = asyncio.run(watch(client, stations, viewers, SECONDS))
    after, took = (_machine(), _thread_seconds(pid)), time.monotonic() - began
    (busy, every), (process, loop) = (
        tuple(b - a for a, b in zip(*pair)) for pair in zip(before, after)
    )
    return Seen(float(np.percentile(ages, 99)), busy / every, process / took, loop / took)


def _with_more(
    client: Client, gloves: ExitStack, folder: Path, stations: list[str], wanted: int
) -> list[str]:
    stations += _begin_stations(client, gloves, folder, len(stations), wanted)
    return stations


def _begin_stations(
    client: Client, gloves: ExitStack, folder: Path, first: int, end: int
) -> list[str]:
    """Stations of new gloves, led to where tasks are chosen, all at once."""
    ports = [folder / f"glove-{k}" for k in range(first, end)]
    for k, port in enumerate(ports, first):
        gloves.enter_context(glove(port, "--task", "tapping", "--seed", str(k)))
    with ThreadPoolExecutor(len(ports)) as helpers:
        return list(helpers.map(lambda port: begin_tasks(client, port), ports))


def _metrics(load: str, seen: Seen) -> list[Metric]:
    return [
        Metric(f"{load}: p99", seen.p99, "ms", LATEST, "lower"),
        Metric("  of the machine", 100 * seen.machine, "%", None, "lower"),
        Metric("  the server's process", seen.process, "cores", None, "lower"),
        Metric("  of it, what speaks to browsers", seen.loop, "cores", None, "lower"),
    ]


def _most(seen: dict[int, Seen]) -> float:
    return float(max((n for n, one in seen.items() if one.p99 <= LATEST), default=0))


def _machine() -> tuple[float, float]:
    """Busy and all ticks of all cores so far."""
    ticks = [float(word) for word in Path("/proc/stat").read_text().split("\n")[0].split()[1:9]]
    return sum(ticks) - ticks[3] - ticks[4], sum(ticks)


def _thread_seconds(pid: int) -> tuple[float, float]:
    """CPU seconds of a process and of its first thread so far."""

    def seconds(stat: Path) -> float:
        fields = stat.read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    return seconds(Path(f"/proc/{pid}/stat")), seconds(Path(f"/proc/{pid}/task/{pid}/stat"))
