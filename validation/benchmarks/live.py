"""Live: 17 sensors at 200 Hz, one station, four viewers of figures and 3-D scene: latency from a sample to the viewer, CPU of the server.

A sample's age is taken when its message is in the viewer's hands: the recording's clock is the glove's, and the least age ever seen of any
burst on arrival at the server defines its zero, as in sessions.clock_mapping; what the glove itself held back (its burst, its radio) counts.
A row waits for every strip, so that the radio of the forearm's sensor is in every age; without it (all on cables) the age is the server's.
"""

import asyncio
import json
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin, Subprotocol

from handscope.app.devices.virtual_glove.firmware import Build
from handscope.app.scene.bridge import PROTOCOL
from handscope.estimators.numerics.typing import Array
from handscope.validation.benchmarks import Metric, costs
from handscope.validation.benchmarks.server_under_test import (
    Client,
    act,
    begin_tasks,
    glove,
    server,
)

RATE = 200
VIEWERS = 4
SECONDS = 12.0  # less than the task lasts
STREAM_RATE = 120.0  # Hz, of the program that reads the poses beside the viewers
ASKED = 4  # times that a viewer asks for a scene
POSES = 12_000  # ten minutes of a page's
AS_A_PAGE_RATE = 20  # messages a second
AS_A_PAGE = f"rate={AS_A_PAGE_RATE}&changes=true"  # what static/station/connection.js asks for


def measure() -> list[Metric]:
    """Latency and CPU while the tapping task runs, with the radio link of the forearm's sensor and on cables alone."""
    radio = age_by_radio(np.random.default_rng(1), Build())
    wired = [replace(m, name=f"on cables: {m.name}") for m in _measure("--wired")]
    return [
        *_measure(),
        Metric("by the radio alone, median", float(np.median(radio)), "ms", None, "lower"),
        Metric("by the radio alone, p99", float(np.percentile(radio, 99)), "ms", None, "lower"),
        *wired,
    ]


def age_by_radio(rng: np.random.Generator, build: Build) -> Array:
    """Ages (ms) of poses that pages would get of a server that takes no time: POSES times, the next pose that is complete.

    Without the radio's least delay, which no clock can tell from an offset.
    """
    newest = build.burst * np.arange(1 + round(POSES / AS_A_PAGE_RATE / build.burst))
    least, mean = build.forearm_delay
    delay = rng.exponential(mean - least, len(newest))
    complete = np.maximum.accumulate(newest + delay)  # a radio link keeps the order
    asked = np.arange(POSES - 1) / AS_A_PAGE_RATE + rng.uniform(0, build.burst, POSES - 1)
    first = np.searchsorted(complete, asked)
    last = np.searchsorted(complete, complete[first], side="right") - 1  # that came with it
    ages: Array = 1e3 * (complete[last] - newest[last])
    return ages


def _measure(*words: str) -> list[Metric]:
    with tempfile.TemporaryDirectory() as folder:
        port = Path(folder) / "glove"
        with (
            glove(port, "--rate", str(RATE), *words),
            server(Path(folder) / "data") as (address, pid),
        ):
            client = Client(address)
            station = begin_tasks(client, port)
            act(client, station, "choose", task="tapping")
            act(client, station, "start")
            before, began = costs.time_of_processes(pid), time.monotonic()
            token = client.call("POST", f"/api/stations/{station}/streams", {"rate": STREAM_RATE})[
                "token"
            ]
            ages, streamed = asyncio.run(_watch_both(client, station, token))
            cpu = (costs.time_of_processes(pid) - before) / (time.monotonic() - began)
            lost = sum(
                s["lost"] for s in client.call("GET", f"/api/stations/{station}")["glove"]["strips"]
            )
            act(client, station, "stop")
            client.call("DELETE", f"/api/stations/{station}")
    return [
        Metric("sample to web socket, median", float(np.median(ages)), "ms", None, "lower"),
        Metric("sample to web socket, p99", float(np.percentile(ages, 99)), "ms", 20.0, "lower"),
        Metric("sample to stream, median", float(np.median(streamed)), "ms", None, "lower"),
        Metric("sample to stream, p99", float(np.percentile(streamed, 99)), "ms", 30.0, "lower"),
        Metric("messages per viewer", len(ages) / VIEWERS / SECONDS, "per s", None, "higher"),
        Metric("CPU of the server's processes", cpu, "cores", 1.0, "lower"),
        Metric("samples lost", float(lost), "samples", 0.0, "lower"),
    ]


async def _watch_both(client: Client, station: str, token: str) -> tuple[Array, list[float]]:
    """Ages (ms) at the viewers of the pages, and at a program that reads the stream of poses (docs/live-stream.md)."""
    (_, viewers), stream = await asyncio.gather(
        watch(client, [station], VIEWERS, SECONDS), _stream(client, token, SECONDS)
    )
    return viewers, stream


async def _stream(client: Client, token: str, seconds: float) -> list[float]:
    """Ages (ms) of the poses of a stream, as the program receives them."""
    ages, until = [], time.monotonic() + seconds
    async with connect(
        client.base.replace("http", "ws") + "/api/stream",
        additional_headers={"Authorization": f"Bearer {token}"},
        origin=Origin(client.base),
        compression=None,
        proxy=None,
    ) as socket:
        await socket.recv()  # what the poses are
        while time.monotonic() < until:
            pose = json.loads(await socket.recv())
            if pose["age_ms"] is not None:
                ages.append(pose["age_ms"] + 1e3 * (time.monotonic() - pose["sent"]))
    return ages


async def watch(
    client: Client, stations: Sequence[str], viewers: int, seconds: float
) -> tuple[Array, Array]:
    """What so many viewers of each station are told, figures and scene open: when each message came, s after the first of them asked, and the age (ms) of its newest sample."""
    began = time.monotonic()
    snapshot = asyncio.gather(
        *(_viewer(client, station, seconds) for station in stations for _ in range(viewers))
    )
    scenes = [
        asyncio.create_task(_scene(client, station)) for station in stations for _ in range(viewers)
    ]
    came, ages = np.transpose([one for viewer in await snapshot for one in viewer])
    if any(scene.done() for scene in scenes):
        raise RuntimeError("a viewer's 3-D scene was closed")
    for scene in scenes:
        scene.cancel()
    await asyncio.gather(*scenes, return_exceptions=True)  # each says goodbye
    return came - began, ages


async def _viewer(client: Client, station: str, seconds: float) -> list[tuple[float, float]]:
    """When (s) each message came to the viewer, and the age (ms) of its newest sample then."""
    ages, until = [], time.monotonic() + seconds
    async with _socket(client, f"/api/stations/{station}/live?{AS_A_PAGE}") as socket:
        while time.monotonic() < until:
            message = json.loads(await socket.recv())
            pulse, now = message["pulse"], time.monotonic()
            if pulse["row_age_ms"] is not None:
                ages.append((now, pulse["row_age_ms"] + 1e3 * (now - pulse["sent"])))
    return ages


async def _scene(client: Client, station: str) -> None:
    """Takes what the scene sends, as a browser would: it asks again where it was refused, for a while."""
    for _ in range(ASKED):
        with suppress(InvalidStatus):
            async with _socket(client, f"/scene/{station}", PROTOCOL) as socket:
                async for _ in socket:
                    pass
        await asyncio.sleep(1.0)


def _socket(client: Client, path: str, *protocols: Subprotocol) -> connect:
    url = client.base.replace("http", "ws") + path
    headers = {"Cookie": client.cookie}
    return connect(
        url,
        additional_headers=headers,
        origin=Origin(client.base),
        subprotocols=protocols or None,
        compression=None,
        max_size=None,
        proxy=None,
    )
