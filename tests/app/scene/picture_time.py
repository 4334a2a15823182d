"""What a tablet's browser does for each picture of the 3-D scene: processor time of the page's main thread, calls that draw, triangles.

Chromium opens a station whose hand moves. A tablet is taken to be four times slower (Chrome DevTools' mid-tier mobile has a Lighthouse BenchmarkIndex
of 1000; strings and copies counted so give 4200 here), a cheap or old one six times. The graphics processor's work is left out: a machine
without one draws in software, in a process of its own, at a speed that says nothing of any tablet. The calls that draw are
dropped, and once passed on. Measured on Chromium's main thread, in processor time, so that other programs of the machine do not count: each
picture's own time is that of the thread's tasks from one picture to the next, as Chromium's trace has them. It is given as it is, and four and six
times, without what no tablet does: a browser without a graphics processor copies the canvas for each picture on this thread
(`LayerTreeHost::DoUpdateLayers`; 0.3 to 0.4 ms, 0.07 ms where the page is put together as by a graphics processor). Parts of a picture's time come
from a trace of more events, which itself costs a little (picture_parts.py).
Run     python -m tests.app.scene.picture_time
Limits  whether a tablet shows 60 pictures a second hangs on its graphics processor, too, and is told by a tablet alone. Slowed by Chromium itself,
        the thread counts what it waits for the copy and for other processes that share the cores (the glove's, the server's), too
"""

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, sync_playwright

from handscope.estimators.numerics.typing import Array
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import (
    Client,
    act,
    begin_tasks,
    glove,
    server,
)
from tests.app.scene import picture_parts
from tests.app.scene.drawing_calls import COUNTED
from tests.app.scene.picture_parts import COPYING, TASK, TIMED, TRACED, main_thread, per_picture
from tests.browser import chromium

SIZE = {"width": 1024, "height": 768}
SLOWER = (4, 6)  # times
PICTURE = 1e3 / 60  # ms
LONG_TASK = 50.0  # ms, as the W3C's Long Tasks API has it
COMPILED = 240  # pictures until the browser has compiled what each of them runs
# pictures; those that are drawn in software take half a second each
WARM, DROPPED, PASSED = 20, 240, 30
POLLING = 100  # ms; with each picture, as by default, a look would count as a picture's work
LONG = 180_000  # ms until the hand is there


def measure() -> list[Metric]:
    """While the hand taps."""
    with tempfile.TemporaryDirectory() as folder:
        port = Path(folder) / "glove"
        with glove(port), server(Path(folder) / "data") as (address, _):
            client = Client(address)
            station = begin_tasks(client, port)
            act(client, station, "choose", task="tapping_30")
            found = _watch(client, station)
            client.call("DELETE", f"/api/stations/{station}")
    return found


def _watch(client: Client, station: str) -> list[Metric]:
    with sync_playwright() as tool:
        one = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        context = one.new_context(viewport=SIZE)  # type: ignore[arg-type]
        name, _, value = client.cookie.partition("=")
        context.add_cookies([{"name": name, "value": value, "url": client.base}])
        context.add_init_script(COUNTED)
        page = context.new_page()
        page.goto(f"{client.base}/stations/{station}")
        frame = page.wait_for_selector("iframe", timeout=LONG).content_frame()  # type: ignore[union-attr]
        assert frame is not None
        frame.wait_for_function(
            "() => window.__viserSceneTree?.getState()['/hand/palm'] !== undefined", timeout=LONG
        )
        act(client, station, "start")
        devtools = context.new_cdp_session(page)
        _pass(frame, COMPILED, drop=True)
        quick, copied, drawn = _pictures(one, devtools, frame, 1, DROPPED)
        parts = _parts(one, frame)
        slow = {n: _pictures(one, devtools, frame, n, DROPPED) for n in SLOWER}
        passed, _, _ = _pictures(one, devtools, frame, SLOWER[0], PASSED)
        one.close()
    return [
        Metric("main thread, drawing dropped", quick.mean(), "ms", PICTURE, "lower"),
        Metric("the same, 95th percentile", np.percentile(quick, 95), "ms", PICTURE, "lower"),
        Metric("copying the canvas, of it", copied.mean(), "ms", None, "lower"),
        *parts,
        *(metric for n in SLOWER for metric in _on_a_tablet(n * (quick - copied), n)),
        *(metric for n in SLOWER for metric in _slowed(slow[n][0], slow[n][2], n)),
        Metric(
            f"slowed {SLOWER[0]} times, drawing in software", passed.mean(), "ms", None, "lower"
        ),
        Metric("pictures a second, drawing dropped", drawn["rate"], "", None, "higher"),
        Metric("of them with a hand that moved", drawn["moved"], "", None, "higher"),
        Metric("calls that draw, of a picture", drawn["calls"], "", None, "lower"),
        Metric("triangles, of a picture", drawn["triangles"], "", None, "lower"),
    ]


def _on_a_tablet(times: Array, slower: int) -> list[Metric]:
    """Of each picture's time on a processor so many times slower."""
    return [
        Metric(f"the rest {slower} times", times.mean(), "ms", PICTURE, "lower"),
        Metric("the same, 95th percentile", np.percentile(times, 95), "ms", PICTURE, "lower"),
        Metric("the same, 99th percentile", np.percentile(times, 99), "ms", None, "lower"),
        Metric(f"the same, pictures over {PICTURE:.1f} ms", _late(times), "%", None, "lower"),
    ]


def _slowed(times: Array, drawn: dict[str, float], slower: int) -> list[Metric]:
    """Of each picture's time, slowed by Chromium itself."""
    name = f"main thread, slowed {slower} times by Chromium, drawing dropped"
    return [
        Metric(name, times.mean(), "ms", PICTURE, "lower"),
        Metric("the same, 95th percentile", np.percentile(times, 95), "ms", PICTURE, "lower"),
        Metric(f"the same, pictures over {PICTURE:.1f} ms", _late(times), "%", None, "lower"),
        Metric("the same, pictures a second", drawn["rate"], "", None, "higher"),
        Metric(
            f"the same, tasks of {LONG_TASK:.0f} ms in a minute", drawn["long"], "", None, "lower"
        ),
    ]


def _late(times: Array) -> float:
    return 100 * float((times > PICTURE).mean())


def _pictures(
    one: Browser, devtools: Any, frame: Any, slower: int, pictures: int
) -> tuple[Array, Array, dict[str, float]]:
    """ms of the main thread for each of so many pictures after WARM ones, of it for copying; what is drawn in one, how many come in a second, and how
    many long tasks in a minute."""
    devtools.send("Emulation.setCPUThrottlingRate", {"rate": slower})
    drop = pictures == DROPPED
    _pass(frame, WARM, drop)
    one.start_tracing(categories=TIMED)
    began = time.monotonic()
    drawn = _pass(frame, pictures, drop)
    passed = time.monotonic() - began
    thread = main_thread(json.loads(one.stop_tracing())["traceEvents"])
    long = sum(e["name"] == TASK and e["dur"] >= 1e3 * LONG_TASK for e in thread)
    rates = {"rate": drawn["pictures"], "moved": drawn["moved"], "long": 60 * long}
    return (
        per_picture(thread, TASK),
        per_picture(thread, COPYING),
        {
            **{name: drawn[name] / drawn["rendered"] for name in ("calls", "triangles")},
            **{name: count / passed for name, count in rates.items()},
        },
    )


def _parts(one: Browser, frame: Any) -> list[Metric]:
    """What a picture's time is."""
    one.start_tracing(categories=TRACED)
    _pass(frame, DROPPED, drop=True)
    found = picture_parts.by_parts(main_thread(json.loads(one.stop_tracing())["traceEvents"]))
    return [
        metric
        for name, times in found.items()
        for metric in (
            Metric(f"of it: {name}", times.mean(), "ms", None, "lower"),
            Metric("the same, 95th percentile", np.percentile(times, 95), "ms", None, "lower"),
        )
    ]


def _pass(frame: Any, pictures: int, drop: bool) -> dict[str, float]:
    """Let so many pictures pass; what was drawn in them."""
    frame.evaluate(
        "(drop) => Object.assign(counted, { pictures: 0, moved: 0, rendered: 0, calls: 0, triangles: 0, drop })",
        drop,
    )
    frame.wait_for_function(
        "(most) => counted.pictures >= most", arg=pictures, timeout=LONG, polling=POLLING
    )
    found: dict[str, float] = frame.evaluate("({ ...counted })")
    return found


if __name__ == "__main__":
    for metric in measure():
        sys.stdout.write(f"{metric.name:55} {metric.value:8.3g} {metric.unit}\n")
