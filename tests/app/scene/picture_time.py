"""What a tablet's browser does for each picture of the 3-D scene: processor time of the page's main thread, calls that draw, triangles.

Chromium opens a station whose hand moves, its processor slowed four times, as a tablet's. The graphics processor's work is left out: a machine
without one draws in software, in a process of its own, at a speed that says nothing of any tablet. The calls that draw are
dropped, and once passed on. Measured on Chromium's main thread, in processor time, so that other programs of the machine do not count.
Run     python -m tests.app.scene.picture_time
Limits  whether a tablet shows 60 pictures a second hangs on its graphics processor, too, and is told by a tablet alone
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import (
    Client,
    act,
    begin_tasks,
    glove,
    server,
)
from tests.browser import chromium

SIZE = {"width": 1024, "height": 768}
SLOWER = 4  # times
PICTURE = 1e3 / 60  # ms
WARM, DROPPED, PASSED = (
    20,
    240,
    30,
)  # pictures; those that are drawn in software take half a second each
LONG = 180_000  # ms until the hand is there
COUNTED = """
  window.drawn = { pictures: 0, calls: 0, triangles: 0, drop: false };
  const each = { drawArrays: 2, drawArraysInstanced: 2, drawElements: 1, drawElementsInstanced: 1, drawRangeElements: 3 };
  for (const [name, at] of Object.entries(each)) {
    const draw = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      drawn.calls += 1;
      if (given[0] === this.TRIANGLES) drawn.triangles += (given[at] / 3) * (name.endsWith("Instanced") ? given.at(-1) : 1);
      if (!drawn.drop) draw.apply(this, given);
    };
  }
  const next = () => ((drawn.pictures += 1), requestAnimationFrame(next));
  requestAnimationFrame(next);
"""


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
        devtools.send("Performance.enable", {"timeDomain": "threadTicks"})
        quick, drawn = _per_picture(devtools, frame, 1, DROPPED)
        slow, _ = _per_picture(devtools, frame, SLOWER, DROPPED)
        passed, _ = _per_picture(devtools, frame, SLOWER, PASSED)
        one.close()
    slower = f"main thread, {SLOWER} times slower"
    return [
        Metric("main thread, drawing dropped", quick, "ms", PICTURE, "lower"),
        Metric(f"{slower}, drawing dropped", slow, "ms", PICTURE, "lower"),
        Metric(f"{slower}, drawing in software", passed, "ms", None, "lower"),
        Metric("pictures a second, drawing dropped", drawn["rate"], "", None, "higher"),
        Metric("calls that draw, of a picture", drawn["calls"], "", None, "lower"),
        Metric("triangles, of a picture", drawn["triangles"], "", None, "lower"),
    ]


def _per_picture(
    devtools: Any, frame: Any, slower: int, pictures: int
) -> tuple[float, dict[str, float]]:
    """ms of the main thread, and what is drawn, of one of so many pictures after WARM ones; how many come in a second."""
    devtools.send("Emulation.setCPUThrottlingRate", {"rate": slower})
    drop = pictures == DROPPED
    _pass(frame, WARM, drop)
    before, began = _task_time(devtools), time.monotonic()
    drawn = _pass(frame, pictures, drop)
    took, passed = _task_time(devtools) - before, time.monotonic() - began
    each = {name: drawn[name] / drawn["pictures"] for name in ("calls", "triangles")}
    return 1e3 * took / drawn["pictures"], {**each, "rate": drawn["pictures"] / passed}


def _pass(frame: Any, pictures: int, drop: bool) -> dict[str, float]:
    """Let so many pictures pass; what was drawn in them."""
    frame.evaluate(
        "(drop) => Object.assign(drawn, { pictures: 0, calls: 0, triangles: 0, drop })", drop
    )
    frame.wait_for_function("(most) => drawn.pictures >= most", arg=pictures, timeout=LONG)
    found: dict[str, float] = frame.evaluate("({ ...drawn })")
    return found


def _task_time(devtools: Any) -> float:
    """Processor time of the main thread's tasks so far, s."""
    rows = devtools.send("Performance.getMetrics")["metrics"]
    return float(next(row["value"] for row in rows if row["name"] == "TaskDuration"))


if __name__ == "__main__":
    for metric in measure():
        sys.stdout.write(f"{metric.name:55} {metric.value:8.3g} {metric.unit}\n")
