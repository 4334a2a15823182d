"""How long a browser on a slow network waits: for the largest text of the patients' list, for the hand of a station's 3-D scene; and how far the list moves meanwhile.

Chromium, its cache empty but for the scene's second time, slowed by its own tools to a network's rate and round trip. What the scene draws is dropped: a machine without a graphics processor would draw
its first pictures for seconds.
Run     python -m tests.app.pages.first_view_time
Limits  this machine's processor, which server and glove share, not a tablet's
"""

import statistics
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

from handscope.app.auth.gate import new_token
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import Client, begin_tasks, glove, server
from tests.app.scene.drawing_calls import COUNTED
from tests.browser import chromium

SIZE = {"width": 1024, "height": 768}
NETWORKS = {"10 Mbit/s, 40 ms": (10e6, 40), "1.6 Mbit/s, 150 ms": (1.6e6, 150)}
TEXT, SCENE, SHIFT = 1.0, 3.0, 0.01  # s, s, share of the page; wanted on the first of them
RUNS = 5
SHIFTED = """
  window.shifted = 0;
  new PerformanceObserver((seen) => seen.getEntries().forEach((one) => (shifted += one.value)))
    .observe({ type: "layout-shift", buffered: true });
"""
LARGEST = """() => new Promise((found) =>
  new PerformanceObserver((seen) => found(seen.getEntries().at(-1).startTime / 1e3))
    .observe({ type: "largest-contentful-paint", buffered: true }))"""
HAND_STANDS = "() => window.__viserSceneTree?.getState()['/hand/palm'] !== undefined"
HAND = f"{HAND_STANDS} && window.counted.rendered > 0"


def measure() -> list[Metric]:
    """Median and largest of RUNS."""
    with tempfile.TemporaryDirectory() as folder:
        port, data = Path(folder) / "glove", Path(folder) / "data"
        with glove(port), server(data) as (address, _), sync_playwright() as tool:
            client = Client(address)
            station = begin_tasks(client, port)
            one = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
            found = [m for n in NETWORKS for m in _on_network(one, client.base, data, station, n)]
            one.close()
            client.call("DELETE", f"/api/stations/{station}")
    return found


def _on_network(one: Browser, base: str, data: Path, station: str, name: str) -> list[Metric]:
    texts, shifts, scenes, again = [], [], [], []
    for _ in range(RUNS):
        page = _open_page(one, base, data, name)
        page.goto(base, wait_until="networkidle")
        texts.append(page.evaluate(LARGEST))
        shifts.append(page.evaluate("() => window.shifted"))
        page.context.close()
        page = _open_page(one, base, data, name)
        for times in (scenes, again):
            page.goto(f"{base}/stations/{station}", wait_until="commit")
            frame = page.wait_for_selector("iframe").content_frame()  # type: ignore[union-attr]
            assert frame is not None
            frame.wait_for_function(HAND, timeout=60_000)
            times.append(page.evaluate("() => performance.now() / 1e3"))
        page.context.close()
    text, scene = (TEXT, SCENE) if name == next(iter(NETWORKS)) else (None, None)
    return [
        Metric(f"{name}: largest text, median", statistics.median(texts), "s", text, "lower"),
        Metric(f"{name}: the same, longest of {RUNS}", max(texts), "s", None, "lower"),
        Metric(f"{name}: layout shift", max(shifts), "1", SHIFT, "lower"),
        Metric(
            f"{name}: hand in the scene, median", statistics.median(scenes), "s", scene, "lower"
        ),
        Metric(f"{name}: the same, longest of {RUNS}", max(scenes), "s", None, "lower"),
        Metric(f"{name}: with files kept, median", statistics.median(again), "s", scene, "lower"),
    ]


def _open_page(one: Browser, base: str, data: Path, network: str) -> Page:
    """A page of a new profile on the slow network, logged in."""
    context = one.new_context(viewport=SIZE)  # type: ignore[arg-type]
    context.request.post(f"{base}/api/login", data={"token": new_token(data)})
    context.add_init_script(SHIFTED)
    context.add_init_script(COUNTED + "counted.drop = true;")
    page = context.new_page()
    rate, latency = NETWORKS[network]
    devtools = context.new_cdp_session(page)
    devtools.send("Network.enable")
    devtools.send(
        "Network.emulateNetworkConditions",
        {
            "offline": False,
            "latency": latency,
            "downloadThroughput": rate / 8,
            "uploadThroughput": rate / 8,
        },
    )
    return page


if __name__ == "__main__":
    for metric in measure():
        sys.stdout.write(f"{metric.name:50} {metric.value:8.3g} {metric.unit}\n")
