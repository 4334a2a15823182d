"""Load: viewers of one station, then stations with a viewer each, more and more until the 99th percentile of latency is beyond LATEST; 17 sensors at 100 Hz each.

Gloves, server and viewers share the machine, viewers take figures and 3-D scene. Beside each latency stands how much of the machine was used, what of it
gloves and viewers took, which in a clinic are hardware and other machines, and what the server's processes took alone; and the server's own process:
one Python process computes on about one core, however many there are; what records and draws is in processes of its own.

All viewers of a load open their pages at one instant, which in a clinic happens at no time: the first second of each stretch, in which they log in and are sent their
scenes, is a figure by itself.
"""

import asyncio
import os
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.validation.benchmarks import Metric, costs
from handscope.validation.benchmarks.live import watch
from handscope.validation.benchmarks.server_under_test import Client, begin_tasks, glove, server

VIEWERS = (1, 4, 16)  # of one station
STATIONS = (2, 4, 6, 8)  # with one viewer each
OPENING = 1.0  # s in which the pages of a load are opened
SECONDS = 7.0  # with it
LATEST = 80.0  # ms
MOST_MEMORY = 80.0  # MB a station


@dataclass(frozen=True)
class Seen:
    """One stretch under one load."""

    p99: float  # ms, from OPENING on
    opening: float  # ms, the same until then
    machine: float  # share of all cores in use, by whomever
    beside: float  # cores that gloves and viewers took
    server: float  # cores that all processes of the server took
    process: float  # of them, the server's own process
    loop: float  # of it, the thread that speaks to browsers
    memory: float  # MB of all processes of the server


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
        Metric(
            "memory of a station, right after its start",
            _growth(by_stations),
            "MB",
            MOST_MEMORY,
            "lower",
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
    before, began = _spent(pid), time.monotonic()
    came, ages = asyncio.run(watch(client, stations, viewers, SECONDS))
    after, took = _spent(pid), time.monotonic() - began
    busy, every, own, server, process, loop = (b - a for a, b in zip(before, after))
    return Seen(
        _p99(ages[came > OPENING]),
        _p99(ages[came <= OPENING]),
        busy / every,
        (own - server) / took,
        server / took,
        process / took,
        loop / took,
        costs.memory_of_processes(pid),
    )


def _p99(ages: Array) -> float:
    """99th percentile (ms); without end where no message came, as on a machine that takes all of the time to open the pages."""
    return float(np.percentile(ages, 99)) if len(ages) else np.inf


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
    cores = os.cpu_count() or 1
    return [
        Metric(f"{load}: p99", seen.p99, "ms", LATEST, "lower"),
        Metric(
            "  while all pages are opened at one instant: p99", seen.opening, "ms", None, "lower"
        ),
        Metric("  of the machine, with whatever else runs", 100 * seen.machine, "%", None, "lower"),
        Metric("  gloves and viewers", seen.beside, "cores", None, "lower"),
        Metric("  all processes of the server", seen.server, "cores", None, "lower"),
        Metric("  of the machine, the server alone", 100 * seen.server / cores, "%", None, "lower"),
        Metric("  the server's own process", seen.process, "cores", None, "lower"),
        Metric("  of it, what speaks to browsers", seen.loop, "cores", None, "lower"),
    ]


def _growth(seen: dict[int, Seen]) -> float:
    """MB that each station more takes, of the fewest and the most."""
    first, last = min(seen), max(seen)
    return (seen[last].memory - seen[first].memory) / max(last - first, 1)


def _most(seen: dict[int, Seen]) -> float:
    return float(max((n for n, one in seen.items() if one.p99 <= LATEST), default=0))


def _spent(pid: int) -> tuple[float, ...]:
    """So far: busy and all ticks of all cores; seconds of all that the benchmark started and itself, of the server's processes, of its own, of that one's first thread."""
    ticks = [float(word) for word in Path("/proc/stat").read_text().split("\n")[0].split()[1:9]]
    return (
        sum(ticks) - ticks[3] - ticks[4],
        sum(ticks),
        costs.time_of_processes(os.getpid()),
        costs.time_of_processes(pid),
        costs.time_of_process(pid),
        costs.time_of_process(pid, pid),
    )
